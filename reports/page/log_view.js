// The log: all records with a text, in order, filtered by severity, source and words; an entry opens below.

import { free, h, setText } from "./dom.js";
import { firstLine, formatDate, formatMoment, linkTo, visible, visibleOutput } from "./format.js";
import { longText } from "./long_text.js";
import { messageItem } from "./messages.js";
import { Rows, rowHeight } from "./virtual_list.js";
import { signOf, toneOf } from "./state_signs.js";

const WEIGHTS = ["debug", "info", "pass", "warning", "failure", "error"];
const THRESHOLDS = [["debug", "everything"], ["info", "from info"], ["warning", "from warnings"], ["failure", "failures"], ["error", "errors"]];
const SOURCES = [["", "from everywhere"], ["test", "tests"], ["fixture", "fixtures"], ["suite", "suites"], ["runner", "the runner"]];
const GRAVE_STATES = new Set(["collapsed", "failed"]);

/** The text of a record in one line, and its severity: {weight, text}. */
const SUMMARIES = {
  message: (one) => [one.severity, [one.subject, one.detail || one.title].filter(Boolean).join(": ")],
  test_started: (one) => ["info", one.attempt > 1 ? `begins, attempt ${one.attempt}` : "begins"],
  test_ended: (one) => [endWeight(one.verdict), [one.verdict, one.detail || one.reason].filter(Boolean).join(": ")],
  output_captured: (one) => ["info", visibleOutput(one.text)],
  stack_dumped: (one) => ["error", `stacks of all threads: ${one.cause}`],
  fixture_changed: (one) => [GRAVE_STATES.has(one.state) ? "error" : "info", [`${one.state}`, one.generation > 1 ? `(generation ${one.generation})` : "", one.detail].filter(Boolean).join(" ")],
  fixture_incident: (one) => ["error", `in ${one.phase}: ${one.cause}`],
  asked: (one) => ["warning", one.text],
  answered: (one) => ["info", `answer: ${one.answer ?? "none"} (${one.source})`],
  diagnosed: (one) => [one.severity, one.text],
  interrupted: (one) => ["warning", `asked to stop ${["", "after this test", "now", "by force"][one.stage] ?? ""} by ${one.source}`],
  internal_error: (one) => ["error", one.text],
  run_ended: (one) => [endWeight(one.verdict), `the run has ended: ${one.verdict}`],
};

function endWeight(verdict) {
  const tone = toneOf(verdict);
  return { good: "pass", bad: "failure", broken: "error", warn: "warning" }[tone] ?? "info";
}

function summaryOf(record) {
  return SUMMARIES[record.event]?.(record) ?? ["info", record.event];
}

function sourceKind(record) {
  if (record.test && record.event !== "fixture_incident") return "test";
  return record.fixture ? "fixture" : record.suite ? "suite" : "runner";
}

export class LogView {
  constructor(page) {
    this.page = page;
    this.only = ""; // the only test whose log is shown
    this.seen = 0; // entries of the model's log that were processed
    this.shown = [];
    this.numbers = new Map(); // record -> its position in the log
    this.#build();
  }

  #build() {
    const choice = (label, options) => h("select", { "aria-label": label, on: { change: () => this.#again() } }, options.map(([value, text]) => h("option", { value, text })));
    this.weight = choice("Severity", THRESHOLDS);
    this.source = choice("Source", SOURCES);
    this.words = h("input", { type: "search", class: "grow", placeholder: "Filter log", "aria-label": "Filter log", spellcheck: "false", autocomplete: "off", on: { input: () => this.#again() } });
    this.follow = h("button", { type: "button", on: { click: () => this.rows.setFollow(!this.rows.follow) } }, "follow");
    this.count = h("span", { class: "dim number" });
    this.chip = h("p", { class: "narrowed" });
    this.rows = new Rows({
      label: "Log", height: rowHeight(26), key: (record) => this.#number(record), make: makeEntry, draw: (row, record) => this.#draw(row, record),
      pick: (record) => this.#open(record), open: (record) => this.#open(record), follow: !this.page.archived,
    });
    this.rows.onFollow = (on) => this.follow.setAttribute("aria-pressed", String(on));
    this.rows.onFollow(this.rows.follow);
    this.follow.hidden = this.page.archived;
    this.empty = h("p", { class: "empty", text: "Nothing was said." });
    this.entry = h("div", { class: "entry", role: "region", "aria-label": "Entry", tabindex: "0" });
    this.entry.hidden = true;
    this.element = h("section", { class: "view log", "aria-label": "Log" },
      h("div", { class: "bar", role: "search" }, this.words, this.weight, this.source, this.follow, this.count), this.chip,
      this.rows.element, this.empty, this.entry);
  }

  show(place) {
    let only = place ?? "";
    try {
      only = decodeURIComponent(only);
    } catch {
      only = "";
    }
    this.only = only;
    this.chip.hidden = !only;
    if (only) this.chip.replaceChildren("only ", h("a", { href: linkTo(only) }, free(only)), " · ", h("a", { href: "#~log", text: "show everything" }));
    this.#again();
  }

  update(changes) {
    if (!changes.log && !changes.every) return;
    this.#take();
    this.#present();
  }

  press(key) {
    if (key === "/") {
      this.words.focus();
      this.words.select();
    } else if (key === "Escape") {
      if (this.entry.hidden) return false;
      this.#close();
    } else return this.rows.press(key);
    return true;
  }

  #again() {
    this.seen = 0;
    this.shown = [];
    this.#take();
    this.#present();
  }

  #take() {
    const { log } = this.page.model;
    const least = WEIGHTS.indexOf(this.weight.value);
    const words = this.words.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (; this.seen < log.length; this.seen += 1) {
      const record = log[this.seen];
      if (this.only && record.test !== this.only) continue;
      if (this.source.value && sourceKind(record) !== this.source.value) continue;
      if (least > 0 && WEIGHTS.indexOf(summaryOf(record)[0]) < least) continue;
      if (words.length && !matchesWords(record, words)) continue;
      this.shown.push(record);
    }
  }

  #present() {
    this.rows.element.hidden = this.shown.length === 0;
    this.rows.setItems(this.shown);
    this.empty.hidden = this.shown.length > 0;
    const all = this.page.model.log.length;
    setText(this.count, this.shown.length === all ? String(all) : `${this.shown.length} of ${all}`);
  }

  /** The key of a record: its position in the journal. */
  #number(record) {
    return record.seq ?? record.time;
  }

  #draw(row, record) {
    const [weight, text] = summaryOf(record);
    const { model } = this.page;
    row.element.dataset.tone = toneOf(weight);
    setText(row.time, formatMoment(record.time, model.started?.time ?? record.time));
    setText(row.sign, signOf(weight));
    row.sign.title = weight;
    setText(row.source, sourceName(record, model));
    setText(row.text, firstLine(text, 400));
    row.text.classList.toggle("mono", record.event === "output_captured");
  }

  #open(record) {
    const head = h("p", { class: "entry-head" },
      h("span", { class: "number", text: `${formatMoment(record.time, this.page.model.started?.time ?? 0)} s` }),
      h("span", { class: "dim", text: formatDate(record.time) }),
      record.test ? h("a", { href: linkTo(record.test) }, free(sourceName(record, this.page.model))) : free(sourceName(record, this.page.model)),
      h("button", { type: "button", class: "quiet", text: "close", on: { click: () => this.#close() } }));
    this.entry.replaceChildren(head, entryBody(record, this.page));
    this.entry.hidden = false;
    this.entry.scrollTop = 0;
    this.rows.reveal();
  }

  #close() {
    this.entry.hidden = true;
    this.rows.element.focus();
  }
}

function makeEntry() {
  const row = {
    time: h("span", { class: "entry-time number" }), sign: h("span", { class: "sign", "aria-hidden": "true" }),
    source: h("bdi", { class: "entry-source" }), text: h("bdi", { class: "entry-text" }),
  };
  row.parts = [row.time, row.sign, row.source, row.text];
  return row;
}

function sourceName(record, model) {
  const { test, fixture, suite } = record;
  if (test && sourceKind(record) === "test") return model.tests.get(test)?.name ?? test;
  return fixture || (suite ? model.suites.get(suite)?.name ?? suite : "runner");
}

function matchesWords(record, words) {
  const [weight, text] = summaryOf(record);
  const all = `${weight}\n${record.test ?? ""}\n${record.fixture ?? ""}\n${record.suite ?? ""}\n${record.subject ?? ""}\n${text}\n${record.traceback ?? ""}`.toLowerCase();
  return words.every((word) => all.includes(word));
}

function entryBody(record, page) {
  if (record.event === "message") return h("ol", { class: "messages" }, messageItem(record, page));
  const [, text] = summaryOf(record);
  const parts = [longText(text, { clean: record.event === "output_captured" ? visibleOutput : visible, className: record.event === "output_captured" ? "mono" : "" })];
  const more = record.event === "stack_dumped" ? record.text : record.traceback;
  if (more) parts.push(longText(more, { className: "mono" }));
  if (record.output) parts.push(h("p", { class: "dim", text: "last output" }), longText(record.output, { clean: visibleOutput, className: "mono" }));
  if (record.hint) parts.push(free(record.hint, "p", { class: "dim" }));
  return h("div", {}, parts);
}
