// The top of the page: the state of the run, the running tests, and links to the views.

import { free, h, setText } from "./dom.js";
import { formatRunning, formatSeconds, formatTimeout, linkTo, visible } from "./format.js";
import { VERDICTS, isBad } from "./model.js";
import { signOf, toneOf } from "./state_signs.js";
import { stateWord, t } from "./texts.js";

const STATES = [...VERDICTS.slice(0, 8), "running", ...VERDICTS.slice(8), "planned"];
const SHOWN_RUNNING = 3; // greatest number of running tests that are shown

/** The state of the whole run: a verdict, `running`, `planned` before it began, or `gone`. */
export function runState(model, link) {
  if (model.ended) return model.ended.verdict;
  if (link === "complete") return model.started ? "gone" : "planned";
  return model.started ? "running" : "planned";
}

/** The state of the run in words: "failed", "running 12 of 40". */
export function runWords(model, link) {
  const state = runState(model, link);
  if (state === "gone") return t("run.gone");
  if (state === "planned") return t("run.waiting");
  if (state !== "running") return stateWord(state);
  return t("run.running", { n: finished(model) + model.running.size, all: model.tests.size });
}

/** The tone of the run: while it is running, that of the worst state so far. */
export function runTone(model, link) {
  const state = runState(model, link);
  if (state === "gone") return "broken";
  if (state !== "running") return toneOf(state);
  const worst = VERDICTS.find((verdict) => model.counts.get(verdict) > 0);
  return worst && isBad(worst) ? toneOf(worst) : "busy";
}

export function runSign(model, link) {
  const state = runState(model, link);
  return state === "gone" ? "!" : signOf(state);
}

export function finished(model) {
  return model.tests.size - (model.counts.get("planned") ?? 0) - model.running.size;
}

export class Overview {
  constructor(page, views) {
    this.page = page;
    this.sign = h("span", { class: "run-sign", "aria-hidden": "true" });
    this.title = h("h1", {});
    this.summary = h("p", { class: "run-summary" });
    this.facts = h("p", { class: "run-facts dim" });
    this.elapsed = h("span", { class: "run-elapsed number" });
    this.link = h("span", { class: "run-link" });
    this.strip = h("div", { class: "run-strip", role: "img" });
    this.segments = new Map(STATES.map((state) => [state, this.#segment(state)]));
    this.chips = h("div", { class: "chips", role: "group", "aria-label": t("list.filter") });
    this.chipOf = new Map(STATES.map((state) => [state, this.#chip(state)]));
    this.now = h("div", { class: "now" });
    this.runningTests = Array.from({ length: SHOWN_RUNNING }, () => new RunningTest(page));
    this.now.append(...this.runningTests.map((card) => card.element));
    this.stop = h("button", { type: "button", class: "stop", "aria-keyshortcuts": "s", text: t("stop.button"), on: { click: () => page.askToStop() } });
    this.help = h("button", { type: "button", class: "quiet help", "aria-keyshortcuts": "?", on: { click: () => page.showHelp() }, text: t("help") });
    this.list = h("ul", {}, views.map(({ name, title }) => h("li", { data: { view: name } },
      h("a", { href: name === "tests" ? "#" : `#~${name}`, text: title }))));
    this.nav = h("nav", { "aria-label": "Views" }, this.list);
    this.element = h("header", { class: "overview" },
      h("div", { class: "run" }, this.sign, h("div", { class: "run-words" }, this.title, this.summary), h("div", { class: "run-side" }, h("p", { class: "run-clock" }, this.elapsed, this.link), this.facts)),
      this.strip, h("div", { class: "run-state" }, this.chips, this.now),
      h("div", { class: "run-nav" }, this.nav, h("div", { class: "run-actions" }, this.help, this.stop)));
  }

  #segment(state) {
    const element = h("span", { class: "segment", data: { tone: toneOf(state), state } });
    this.strip.append(element);
    return element;
  }

  #chip(state) {
    const count = h("span", { class: "number" });
    const element = h("button", { type: "button", class: "chip", data: { tone: toneOf(state) }, "aria-pressed": "false", on: { click: () => this.page.toggleState(state) } },
      h("span", { class: "sign", "aria-hidden": "true", text: signOf(state) }), count, ` ${stateWord(state)}`);
    element.count = count;
    element.hidden = true;
    this.chips.append(element);
    return element;
  }

  /** Mark the view that is shown. */
  mark(name) {
    for (const { dataset, firstChild: link } of this.list.children) {
      if (dataset.view !== name) link.removeAttribute("aria-current");
      else {
        link.setAttribute("aria-current", "page");
        link.scrollIntoView({ block: "nearest", inline: "nearest" });
      }
    }
  }

  update() {
    const { model, link } = this.page;
    const state = runState(model, link);
    this.element.dataset.tone = runTone(model, link);
    this.element.dataset.state = state;
    setText(this.sign, runSign(model, link));
    setText(this.title, runWords(model, link));
    setText(this.summary, this.#summary());
    setText(this.link, t(this.page.archived && link === "complete" ? "link.archive" : `link.${link}`));
    this.link.dataset.link = link;
    this.stop.hidden = this.page.archived || state !== "running" && state !== "planned";
    this.#facts();
    this.#counts();
    this.#showRunning();
    this.tick();
  }

  #summary() {
    const { model, link } = this.page;
    const state = runState(model, link);
    if (state === "planned") return "";
    let problems = 0;
    for (const [one, count] of model.counts) if (isBad(one)) problems += count;
    const asked = model.interrupted && state === "running" ? t(model.interrupted.stage > 1 ? "run.stopping2" : "run.stopping1") : "";
    const sum = problems ? t("run.problems", { n: problems, all: model.tests.size }) : state === "running" ? "" : model.tests.size === 1 ? t("run.test") : t("run.tests", { n: model.tests.size });
    return [asked, sum].filter(Boolean).join(" · ");
  }

  #facts() {
    const { started, suites } = this.page.model;
    if (!started) return;
    const names = [...suites.values()].map((suite) => suite.name);
    const suite = names.length > 2 ? `${names.length} suites` : names.join(", ");
    const { serial, part } = started.device ?? {};
    const device = [part, serial].filter(Boolean).join(" ");
    const key = [suite, started.robot, started.station, device, started.run].join("\n");
    if (key === this.factKey) return;
    this.factKey = key;
    const parts = [suite && free(suite, "strong"), started.robot && free(started.robot), started.station && free(started.station), device && free(device), free(started.run)];
    this.facts.replaceChildren(...parts.filter(Boolean).flatMap((part, index) => (index ? [" · ", part] : [part])));
  }

  #counts() {
    const { model } = this.page;
    const said = [];
    for (const state of STATES) {
      const count = model.counts.get(state) ?? 0;
      const chip = this.chipOf.get(state);
      const segment = this.segments.get(state);
      chip.hidden = count === 0;
      segment.hidden = count === 0;
      if (!count) continue;
      setText(chip.count, String(count));
      segment.style.setProperty("flex-grow", count);
      said.push(`${count} ${stateWord(state)}`);
    }
    const text = said.join(", ");
    if (text !== this.said) this.strip.setAttribute("aria-label", (this.said = text) || t("list.empty"));
  }

  /** Show the states by which the list is filtered. */
  press(states) {
    for (const [state, chip] of this.chipOf) chip.setAttribute("aria-pressed", String(Boolean(states?.has(state))));
  }

  #showRunning() {
    const running = [...this.page.model.running];
    this.now.hidden = running.length === 0;
    this.runningTests.forEach((card, index) => card.show(running[index] ? this.page.model.tests.get(running[index]) : null));
  }

  /** Update elapsed times. */
  tick() {
    const { model } = this.page;
    setText(this.elapsed, model.ended ? formatSeconds(model.ended.duration) : model.started ? formatRunning(model.elapsed(this.page.now())) : "");
    for (const card of this.runningTests) card.tick();
  }
}

/** A running test: its name, its progress, and its time with its limit. */
export class RunningTest {
  constructor(page) {
    this.page = page;
    this.name = h("a", {}, h("bdi"));
    this.text = h("bdi", { class: "dim running-text" });
    this.time = h("span", { class: "number dim" });
    this.progress = h("div", { class: "meter", role: "progressbar", "aria-valuemin": "0", "aria-valuemax": "100" });
    this.limit = h("div", { class: "meter thin", "aria-hidden": "true" });
    this.element = h("div", { class: "running-test" }, h("p", { class: "running-line" }, this.name, this.text, this.time), this.progress, this.limit);
    this.element.hidden = true;
  }

  show(test) {
    this.test = test;
    this.element.hidden = !test;
    if (!test) return;
    const { progress, phases } = test.attempt;
    const phase = phases[phases.length - 1];
    this.name.setAttribute("href", linkTo(test.id));
    setText(this.name.firstChild, test.name);
    setText(this.text, progress?.text || phase?.phase || "");
    this.progress.hidden = !progress;
    if (progress) {
      const percent = Math.round(100 * Math.max(0, Math.min(1, progress.fraction)));
      this.progress.setAttribute("aria-valuenow", String(percent));
      this.progress.setAttribute("aria-label", visible(test.name));
      this.progress.style.setProperty("--part", percent / 100);
    }
    this.phase = phase;
    this.tick();
  }

  tick() {
    if (!this.test) return;
    const since = this.phase ?? this.test.attempt.started;
    const seconds = Math.max(0, this.page.now() - since.time);
    const limit = this.phase?.limit ?? this.test.planned.run_timeout;
    setText(this.time, limit ? `${formatRunning(seconds)} / ${formatTimeout(limit)}` : formatRunning(seconds));
    this.limit.hidden = !limit;
    if (!limit) return;
    const part = Math.min(1, seconds / limit);
    this.limit.style.setProperty("--part", part.toFixed(3));
    this.limit.dataset.tone = part > 0.8 ? "warn" : "idle";
  }
}
