// The view of the tests: a list beside the detail of one. On a narrow screen only one of them is shown.

import { h, setText } from "./dom.js";
import { firstLine, formatCount, formatRunning, formatSeconds, linkTo, readPlace } from "./format.js";
import { VERDICTS } from "./model.js";
import { Rows, rowHeight } from "./virtual_list.js";
import { RunDetail } from "./run_detail.js";
import { signOf, toneOf } from "./state_signs.js";
import { SuiteDetail } from "./suite_detail.js";
import { TestDetail } from "./test_detail.js";
import { stateWord, t } from "./texts.js";

/** The rank of states in the order "failures first": problems, running, good, planned. */
const RANK = new Map();
for (const verdict of VERDICTS.slice(0, 8)) RANK.set(verdict, RANK.size);
for (const state of ["running", ...VERDICTS.slice(8), "planned"]) RANK.set(state, RANK.size);

const ORDERS = ["worst", "plan", "duration"];

export class TestsView {
  constructor(page) {
    this.page = page;
    this.states = null; // the set of shown states, or null for all
    this.order = "worst";
    this.place = readPlace("");
    this.words = new Map(); // test -> its searched text
    this.#build();
  }

  #build() {
    this.rows = new Rows({
      label: t("view.tests"), height: rowHeight(44), key: (item) => item.id, make: makeRow,
      draw: (row, item) => (item.suite === undefined ? this.#drawSuite(row, item) : this.#drawTest(row, item)),
      pick: (item) => this.#picked(item), open: (item, byKey) => this.#opened(item, byKey),
    });
    this.filter = h("input", {
      type: "search", class: "grow", placeholder: t("list.filter"), "aria-label": t("list.filter"), spellcheck: "false", autocomplete: "off",
      on: { input: () => this.#arrange(), keydown: (event) => this.#filterKey(event) },
    });
    this.orders = h("select", { "aria-label": t("list.order"), on: { change: () => this.#setOrder(this.orders.value) } },
      ORDERS.map((order) => h("option", { value: order, text: t(`list.${order}`) })));
    this.none = h("p", { class: "empty" });
    this.clear = h("button", { type: "button", class: "quiet", text: t("list.clear"), on: { click: () => this.showAll() } });
    this.list = h("div", { class: "list" },
      h("div", { class: "bar", role: "search" }, this.filter, this.orders), this.rows.element, this.none, this.clear);
    this.holder = h("div");
    this.detail = h("div", { class: "detail", role: "region", "aria-label": "Details", tabindex: "0" },
      h("a", { class: "back", href: "#", text: `‹ ${t("list.back")}` }), this.holder);
    this.element = h("section", { class: "view split", "aria-label": t("view.tests") }, this.list, this.detail);
  }

  show(place) {
    this.place = readPlace(place ?? "");
    const { suite, test } = this.place;
    this.element.classList.toggle("shows-detail", Boolean(suite));
    this.rows.current = test || suite || this.rows.current;
    this.#arrange();
    this.rows.reveal();
    this.#showDetail();
  }

  update(changes) {
    if (changes.every || changes.plan) this.words.clear();
    else for (const id of changes.tests) this.words.delete(id);
    if (changes.every || changes.plan || changes.tests.size || changes.suites.size) this.#arrange();
    if (this.missing) this.#showDetail();
    else this.shown?.update(changes);
  }

  /** Update elapsed times. */
  tick() {
    if (this.page.model.running.size) this.rows.refresh();
    this.shown?.tick?.();
  }

  /** Show only tests in these states, or all with null. */
  showStates(states) {
    this.states = states;
    this.page.filtersChanged();
    this.#arrange();
  }

  showAll() {
    this.filter.value = "";
    this.showStates(null);
  }

  /** Handle a key of the page; return whether it had an effect. */
  press(key) {
    if (key === "/") {
      this.filter.focus();
      this.filter.select();
    } else if (key === "f") this.page.toggleFailures();
    else if (key === "Escape") return this.#escape();
    else return this.rows.press(key);
    return true;
  }

  #escape() {
    if (this.filter.value || this.states) this.showAll();
    else if (this.place.suite) this.page.go("#");
    else return false;
    return true;
  }

  #filterKey(event) {
    if (event.key === "Enter" || event.key === "ArrowDown") {
      this.rows.element.focus();
      if (this.rows.indexOf(this.rows.current) < 0) this.rows.move(1);
    } else if (event.key === "Escape") {
      if (this.filter.value) this.showAll();
      else this.rows.element.focus();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  #setOrder(order) {
    this.order = order;
    this.rows.element.scrollTop = 0;
    this.#arrange();
  }

  #picked(item) {
    if (this.page.wide() || this.place.suite) this.page.go(linkTo(item.id), { replace: true });
  }

  #opened(item, byKey) {
    this.page.go(linkTo(item.id));
    if (byKey || !this.page.wide()) this.detail.focus();
  }

  // The list

  #arrange() {
    const { model } = this.page;
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const wanted = (test) => (!this.states || this.states.has(test.state)) && words.every((word) => this.#words(test).includes(word));
    const items = [];
    if (this.order === "plan") for (const suite of model.suites.values()) pushSuite(items, suite, wanted);
    else for (const test of model.tests.values()) if (wanted(test)) items.push(test);
    if (this.order === "worst") sortByRank(items);
    if (this.order === "duration") items.sort((one, other) => other.duration - one.duration || one.index - other.index);
    this.rows.element.hidden = items.length === 0;
    this.rows.setItems(items);
    this.none.hidden = items.length > 0;
    this.clear.hidden = items.length > 0 || model.tests.size === 0;
    setText(this.none, t(model.tests.size ? "list.none" : "list.empty"));
  }

  #words(test) {
    let text = this.words.get(test.id);
    if (text === undefined) {
      const { plugin = "", tags = [] } = test.planned;
      text = [test.id, test.name, plugin, ...tags, test.state, stateWord(test.state), reasonOf(test)].join("\n").toLowerCase();
      this.words.set(test.id, text);
    }
    return text;
  }

  #drawTest(row, test) {
    const { state } = test;
    this.#drawState(row, state, test.name);
    setText(row.note, state === "running" ? runningNote(test) : firstLine(reasonOf(test), 200) || tally(test));
    setText(row.suite, this.page.model.suites.size > 1 ? this.page.model.suites.get(test.suite)?.name ?? test.suite : "");
    setText(row.attempts, test.attempts.length > 1 ? `${test.attempts.length}×` : "");
    row.attempts.title = test.attempts.length > 1 ? `${test.attempts.length} attempts` : "";
    this.#drawDuration(row, test);
  }

  #drawDuration(row, test) {
    const limit = test.planned.run_timeout;
    const seconds = test.running ? this.page.now() - test.attempt.started.time : test.ended?.duration;
    const known = seconds !== undefined && test.attempts.length > 0;
    setText(row.duration, known ? (test.running ? formatRunning(seconds) : formatSeconds(seconds)) : "");
    row.bar.hidden = !known || !limit;
    row.bar.style.setProperty("--part", known && limit ? Math.min(1, seconds / limit).toFixed(3) : 0);
    row.bar.dataset.tone = known && limit && seconds > 0.8 * limit ? "warn" : "idle";
  }

  #drawSuite(row, suite) {
    const state = suite.ended?.verdict ?? (suite.started ? "running" : "planned");
    this.#drawState(row, state, suite.name);
    row.element.dataset.suite = "yes";
    const done = suite.tests.filter((test) => test.verdict !== null).length;
    setText(row.note, `${done} of ${suite.tests.length} tests`);
    setText(row.suite, "");
    setText(row.attempts, "");
    setText(row.duration, suite.ended ? formatSeconds(suite.ended.duration) : "");
    row.bar.hidden = true;
  }

  #drawState(row, state, name) {
    delete row.element.dataset.suite;
    row.element.dataset.tone = toneOf(state);
    setText(row.sign, signOf(state));
    setText(row.name, name);
    setText(row.state, stateWord(state));
  }

  // The detail

  #showDetail() {
    const { suite, test } = this.place;
    const { model } = this.page;
    const item = test ? model.tests.get(test) : model.suites.get(suite);
    this.missing = Boolean(suite) && !item;
    if (this.missing) {
      this.#mount(null);
      this.holder.replaceChildren(h("p", { class: "empty", text: `There is no ${test ? "test" : "suite"} “${test || suite}” in this run.` }));
      return;
    }
    if (!this.shown || this.shown.item !== item) this.#mount(item ? (test ? new TestDetail(this.page, item) : new SuiteDetail(this.page, item)) : new RunDetail(this.page), item);
    this.shown.show?.(this.place);
  }

  #mount(detail, item) {
    this.shown?.destroy?.();
    this.shown = detail;
    if (!detail) return;
    detail.item = item;
    this.holder.replaceChildren(detail.element);
    this.detail.scrollTop = 0;
  }
}

function makeRow() {
  const part = (name, tag = "span") => h(tag, { class: `row-${name}` });
  const row = {
    sign: h("span", { class: "sign", "aria-hidden": "true" }),
    name: h("bdi", { class: "row-name" }), state: part("state"), suite: h("bdi", { class: "row-suite" }),
    note: h("bdi", { class: "row-note" }), attempts: part("attempts"), duration: part("duration"),
    bar: h("span", { class: "time-bar", "aria-hidden": "true" }),
  };
  row.parts = [
    row.sign,
    h("span", { class: "row-line" }, row.name, row.attempts, row.duration, row.bar),
    h("span", { class: "row-line row-second" }, row.state, row.suite, row.note),
  ];
  return row;
}

function pushSuite(items, suite, wanted) {
  const tests = suite.tests.filter((test) => !test.program).flatMap((test) => [test, ...test.cases]).filter(wanted);
  if (tests.length) items.push(suite, ...tests);
}

/** Sort in place, by rank and then by plan, with buckets, as this is done in every frame with a changed test. */
function sortByRank(items) {
  const buckets = Array.from({ length: RANK.size + 1 }, () => []);
  for (const test of items) buckets[RANK.get(test.state) ?? RANK.size].push(test);
  items.length = 0;
  for (const bucket of buckets) for (const test of bucket) items.push(test);
}

function runningNote(test) {
  const { progress, phases } = test.attempt;
  if (progress?.text) return firstLine(progress.text);
  return phases[phases.length - 1]?.phase ?? "";
}

/** The reason for the state of a test; empty if there is none. */
function reasonOf(test) {
  const { attempt } = test;
  if (!attempt) return "";
  if (attempt.ended?.detail) return attempt.ended.detail;
  const severe = test.failures ? attempt.messages.find((one) => one.severity === "failure" || one.severity === "error") : null;
  const before = test.attempts.find((one) => one.ended && !one.ended.final && one.ended.detail);
  return severe?.detail || severe?.title || attempt.ended?.reason || before?.ended.detail || "";
}

/** The summary of a passed test. */
function tally(test) {
  const { parts, measurements } = test.attempt ?? { parts: new Map(), measurements: [] };
  return [formatCount(test.cases.length, "case"), formatCount(parts.size, "part"), formatCount(measurements.length, "measurement")].filter(Boolean).join(" · ");
}
