// The page: connects source, model and views; updates at most once a frame.

import { Announcer } from "./announcer.js";
import { CompareView } from "./compare_view.js";
import { EnvironmentView } from "./environment_view.js";
import { FixturesView } from "./fixtures_view.js";
import { LogView } from "./log_view.js";
import { MeasurementsView } from "./measurements_view.js";
import { TrendsView } from "./trends_view.js";
import { h, setText } from "./dom.js";
import { format, linkTo } from "./format.js";
import { helpDialog, listenToKeys } from "./key_bindings.js";
import { RunModel, VERDICTS, isBad } from "./model.js";
import { OperatorView, QuestionPanel, StopDialog } from "./operator.js";
import { Overview, runSign, runState, runTone, runWords } from "./overview.js";
import { printAll } from "./print.js";
import { Sound } from "./sound.js";
import { openSource } from "./data_source.js";
import { showInTab } from "./browser_tab.js";
import { TestsView } from "./tests_view.js";
import { chooseLanguage, t } from "./texts.js";

const TICK = 250; // milliseconds between two updates of elapsed times
const HIDDEN_PAUSE = 1000; // milliseconds between two updates of a hidden page
const WIDE = matchMedia("(min-width: 60rem)");
const BAD = new Set(VERDICTS.filter(isBad));

class Page {
  constructor(source) {
    Object.assign(this, { source, facts: source.facts, format, texts: t, hashOf: linkTo, model: new RunModel(), link: "connecting", skew: Infinity });
    this.archived = this.facts.mode === "archive";
    this.sound = new Sound();
    this.announcer = new Announcer(this);
    this.question = new QuestionPanel(this);
    this.stopDialog = new StopDialog(this);
    this.help = helpDialog();
    this.views = this.#makeViews();
    this.overview = new Overview(this, [...this.views].map(([name, { title }]) => ({ name, title })));
    this.banner = h("p", { class: "banner", role: "alert" });
    this.banner.hidden = true;
    this.main = h("main", {}, this.question.element, this.banner);
    document.body.replaceChildren(this.overview.element, this.main, this.announcer.element, this.stopDialog.element, this.help);
  }

  #makeViews() {
    const kinds = { tests: TestsView, measurements: MeasurementsView, fixtures: FixturesView, log: LogView, environment: EnvironmentView };
    if (this.facts.compare) kinds.compare = CompareView;
    if (this.facts.history) kinds.trends = TrendsView;
    if (!this.archived) kinds.operator = OperatorView;
    return new Map(Object.entries(kinds).map(([name, kind]) => [name, { title: t(`view.${name}`), kind, view: null }]));
  }

  start() {
    addEventListener("hashchange", () => this.#route());
    document.addEventListener("visibilitychange", () => this.changed());
    listenToKeys(this);
    printAll(this);
    this.#route();
    startAtTheTop();
    this.source.start((records) => this.#take(records), (link) => this.#connected(link));
    setInterval(() => this.#tick(), TICK);
  }

  // For the views

  /** Seconds since 1970 on the clock of the run. */
  now() {
    if (this.archived || this.link === "complete" || this.model.ended) return this.model.time;
    return Math.max(this.model.time, Date.now() / 1000 - (Number.isFinite(this.skew) ? this.skew : 0));
  }

  /** Return whether two columns have room side by side. */
  wide() {
    return WIDE.matches;
  }

  /** Go to a link of this page; `replace` adds no entry to the history. */
  go(hash, { replace = false } = {}) {
    if (hash === (location.hash || "#")) return;
    if (!replace) location.hash = hash;
    else {
      history.replaceState(null, "", hash);
      this.#route();
    }
  }

  say(text, urgently) {
    this.announcer.say(text, urgently);
  }

  askToStop() {
    this.stopDialog.open();
  }

  showHelp() {
    if (!this.help.open) this.help.showModal();
  }

  /** Return whether the user is idle, so that the page may change its place. */
  idle() {
    return !document.activeElement || document.activeElement === document.body;
  }

  pressView(key) {
    return this.view?.press?.(key) ?? false;
  }

  toggleFailures() {
    const { tests } = this;
    tests.showStates(tests.states ? null : BAD);
  }

  /** Show only tests in this state, or all again. */
  toggleState(state) {
    const { tests } = this;
    const states = new Set(tests.states === BAD ? [] : tests.states);
    if (!states.delete(state)) states.add(state);
    tests.showStates(states.size ? states : null);
    if (this.view !== tests) this.go("#");
  }

  filtersChanged() {
    this.overview.press(this.tests.states);
  }

  get tests() {
    return this.#view("tests");
  }

  // Inside

  #view(name) {
    const entry = this.views.get(name);
    entry.view ??= new entry.kind(this);
    return entry.view;
  }

  #route() {
    const hash = location.hash.slice(1);
    const [, name, , rest] = /^~([^/]*)(\/(.*))?$/.exec(hash) ?? [null, "tests", null, hash];
    const known = this.views.has(name) ? name : "tests";
    const view = this.#view(known);
    if (this.view !== view) {
      this.view?.element.remove();
      this.view = view;
      this.main.append(view.element);
      document.documentElement.dataset.view = known;
      this.overview.mark(known);
    }
    view.update(this.#everything());
    view.show?.(known === name ? rest ?? "" : "");
  }

  #everything() {
    const { tests, suites } = this.model;
    return { tests: new Set(tests.keys()), suites: new Set(suites.keys()), plan: true, run: true, log: true, questions: true, every: true };
  }

  #take(records) {
    for (const record of records) this.model.apply(record);
    const last = records[records.length - 1];
    if (last) this.skew = Math.min(this.skew, Date.now() / 1000 - last.time);
    this.changed();
  }

  #connected(link) {
    this.link = link === "reconnecting" && this.model.ended ? "complete" : link;
    if (this.link === "complete") this.source.stopListening();
    this.linkChanged = true;
    this.changed();
  }

  /** Schedule an update with the next frame. A hidden tab updates only its title. */
  changed() {
    if (document.hidden) this.hiddenTimer ??= setTimeout(() => this.#drawHidden(), HIDDEN_PAUSE);
    else this.frame ??= requestAnimationFrame(() => this.#draw());
  }

  #inTab() {
    const { model, link } = this;
    showInTab(runTone(model, link), runSign(model, link), runWords(model, link), model.started?.robot || this.facts.run);
  }

  /** Update the title, the icon, sound and announcements, also of a hidden tab. */
  #drawHidden() {
    this.hiddenTimer = undefined;
    this.announcer.update(this.model.changes);
    if (this.model.changes.questions) this.question.update();
    this.#inTab();
  }

  #draw() {
    this.frame = undefined;
    const changes = this.model.takeChanges();
    if (this.linkChanged) changes.run = true;
    this.linkChanged = false;
    this.#warn();
    this.overview.update();
    if (changes.questions) this.question.update();
    this.announcer.update(changes);
    this.#inTab();
    this.view.update(changes);
  }

  #warn() {
    const state = runState(this.model, this.link);
    const text = state === "gone" ? t("link.gone") : this.link === "reconnecting" ? t("link.cut") : "";
    const unread = this.source.unreadable ? t("run.unreadable", { n: this.source.unreadable }) : "";
    this.banner.hidden = !text && !unread;
    this.banner.dataset.tone = state === "gone" ? "broken" : "warn";
    setText(this.banner, [text, unread].filter(Boolean).join(" "));
  }

  #tick() {
    if (document.hidden || this.model.ended || this.link === "complete" || !this.model.started) return;
    this.overview.tick();
    this.question.tick();
    this.view.tick?.();
  }
}

/** Let the first Tab key go to the top: browsers begin at the place of the original contents of the body. */
function startAtTheTop() {
  if (document.activeElement !== document.body) return;
  document.body.tabIndex = -1;
  document.body.focus({ preventScroll: true });
  document.body.removeAttribute("tabindex");
}

const wantedLanguage = new URLSearchParams(location.search).get("lang");
document.documentElement.lang = chooseLanguage([wantedLanguage ?? "", ...navigator.languages]);
openSource().then(
  (source) => new Page(source).start(),
  (error) => document.body.replaceChildren(h("p", { class: "banner", role: "alert", data: { tone: "broken" }, text: t("link.none", { why: error.message }) })),
);
