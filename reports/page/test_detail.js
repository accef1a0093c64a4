// The detail of a test: verdict, failures, measurements, series, files and messages. A subject (a joint, a port, a
// repetition) in the link restricts it to that part.

import { free, h, setText } from "./dom.js";
import { firstLine, formatBytes, formatDate, formatPlace, formatSeconds, formatTimeout, linkTo, linkToFixture, linkToLog, readPlace } from "./format.js";
import { badge, setBadge } from "./state_signs.js";
import { CasesPart, FailuresPart, PartsPart, MeasurementsPart, PlotsPart, MessagesPart, QuestionsPart, AttachmentsPart, OutputPart, StacksPart, ParametersPart } from "./test_sections.js";

export class TestDetail {
  constructor(page, test) {
    Object.assign(this, { page, test });
    this.subject = "";
    this.chosen = null; // number of the shown attempt; null for the last
    this.body = h("div", { class: "test-body" });
    this.verdict = badge(test.state);
    this.reason = free("", "span", { class: "verdict-reason" });
    this.name = free("", "h2");
    this.about = free("", "p");
    this.fault = free("", "strong");
    this.injected = h("p", { class: "narrowed" }, "fault injected: ", this.fault);
    this.attempts = h("div", { class: "attempts", role: "group", "aria-label": "Attempts" });
    this.narrow = h("p", { class: "narrowed" });
    this.element = h("article", { class: "test" },
      h("header", { class: "test-head" },
        h("p", { class: "crumbs" }, h("a", { href: linkTo(test.suite) }, free(page.model.suites.get(test.suite)?.name ?? test.suite)),
          h("span", { class: "dim", text: "/" }), free(test.id.slice(test.suite.length + 1), "span", { class: "dim" }),
          h("a", { class: "crumbs-end", href: linkToLog(test.id), text: "log of this test" })),
        this.name, h("p", { class: "verdict-line" }, this.verdict, this.reason), this.injected, this.about, this.attempts, this.narrow),
      this.body);
  }

  show(place = readPlace("")) {
    if (place.subject !== this.subject) this.body.textContent = "";
    this.subject = place.subject;
    this.measurement = place.measurement;
    this.#narrowed();
    this.update({ every: true });
    if (this.subject) this.#pointOut();
  }

  update(changes) {
    const { test } = this;
    if (!changes.every && !changes.plan && !changes.tests.has(test.id)) return;
    const attempt = test.attempts.find((one) => one.number === this.chosen) ?? test.attempt;
    setText(this.name, test.name);
    setText(this.about, test.description);
    this.about.hidden = !test.description;
    setText(this.fault, injectedFault(attempt));
    this.injected.hidden = !this.fault.textContent;
    const state = attempt === test.attempt ? test.state : attempt.ended?.outcome ?? "running";
    setBadge(this.verdict, state);
    setText(this.reason, verdictReason(test, attempt));
    this.#tabs(attempt);
    if (this.parts?.attempt !== attempt || !this.body.firstChild) this.#build(attempt);
    for (const part of this.parts) part.update();
  }

  tick() {
    this.facts?.tick();
  }

  destroy() {
    for (const part of this.parts ?? []) part.destroy?.();
  }

  #build(attempt) {
    this.destroy();
    this.parts = [];
    this.parts.attempt = attempt;
    this.facts = new FactsPart(this.page, this.test, attempt);
    if (!this.subject) this.parts.push(this.facts);
    if (attempt) {
      const matches = (record) => !this.subject || record.subject === this.subject || (record.subject ?? "").startsWith(`${this.subject}/`);
      const kinds = this.subject
        ? [FailuresPart, PartsPart, MeasurementsPart, PlotsPart, MessagesPart]
        : [FailuresPart, StacksPart, CasesPart, PartsPart, MeasurementsPart, PlotsPart, QuestionsPart, AttachmentsPart, MessagesPart, OutputPart, ParametersPart];
      for (const Part of kinds) this.parts.push(new Part(this.page, attempt, matches, this.test, this.subject));
    }
    this.body.replaceChildren(...this.parts.map((part) => part.element));
  }

  #tabs(shown) {
    const { attempts } = this.test;
    this.attempts.hidden = attempts.length < 2;
    const key = attempts.map((one) => `${one.number} ${one.ended?.outcome}`).join() + shown?.number;
    if (this.attempts.hidden || key === this.attemptKey) return;
    this.attemptKey = key;
    this.attempts.replaceChildren(...attempts.map((one) => h("button", {
      type: "button", "aria-pressed": String(one === shown), on: { click: () => this.#choose(one) },
    }, `attempt ${one.number} `, badge(one.ended?.outcome ?? "running"))));
  }

  #choose(attempt) {
    this.chosen = attempt === this.test.attempt ? null : attempt.number;
    this.update({ every: true });
  }

  #narrowed() {
    this.narrow.hidden = !this.subject;
    if (!this.subject) return;
    this.narrow.replaceChildren("only ", free(this.subject, "strong"), " · ", h("a", { href: linkTo(this.test.id), text: "show the whole test" }));
  }

  /** Scroll to the measurement of the link. */
  #pointOut() {
    for (const row of this.body.querySelectorAll("tr.pointed")) row.classList.remove("pointed");
    const row = [...this.body.querySelectorAll("tr[data-measurement]")].find((one) => one.dataset.measurement === this.measurement);
    row?.classList.add("pointed");
    row?.scrollIntoView({ block: "center" });
  }
}

/** The injected fault of the simulated robot, by its parameter; empty for none. */
function injectedFault(attempt) {
  const value = attempt?.parameters.find((one) => one.name === "inject")?.value ?? "";
  return value.replace(/^"(.*)"$/, "$1");
}

/** The reason of a verdict. */
function verdictReason(test, attempt) {
  const { ended } = attempt ?? {};
  if (!ended) return "";
  const word = ended.reason && !["failure", "failed"].includes(ended.reason) ? ended.reason : "";
  const detail = firstLine(ended.detail, 600);
  const outcome = attempt === test.attempt && ended.outcome !== ended.verdict ? `this attempt ${ended.outcome}` : "";
  return [word, outcome, detail].filter(Boolean).join(" · ");
}

class FactsPart {
  constructor(page, test, attempt) {
    Object.assign(this, { page, test, attempt });
    this.element = h("dl", { class: "facts" });
  }

  update() {
    const { attempt, test } = this;
    const key = `${attempt?.ended ? "ended" : "open"} ${attempt?.phases.length}`;
    if (key === this.key) return;
    this.key = key;
    const { planned } = test;
    const ended = attempt?.ended ?? {};
    this.duration = h("dd", { class: "number" });
    const facts = [
      ["duration", this.duration],
      ["plug-in", free(planned.type && planned.type !== planned.plugin ? `${planned.plugin} (${planned.type})` : planned.plugin)],
      ["case of", test.program && h("a", { href: linkTo(test.program.id) }, free(test.program.id))],
      ["defined in", planned.file && free(formatPlace(planned.file, planned.line), "span", { title: planned.file })],
      ["parameters", planned.param && free(planned.param, "span", { class: "mono" })],
      ["stood on", this.#fixtures()],
      ["processor", ended.cpu_time && formatSeconds(ended.cpu_time)],
      ["memory", ended.max_rss && formatBytes(ended.max_rss)],
      ["ended by", ended.signal || (ended.exit_status ? `exit status ${ended.exit_status}` : "")],
      ["expected to", planned.expected && planned.expected !== "pass" ? planned.expected : ""],
      ["repetitions", planned.repetition ? planned.repetition + 1 : ""],
      ["retries", planned.retries || ""],
      ["tags", planned.tags?.length && free(planned.tags.join(", "))],
      ["began", attempt?.started.pid && formatDate(attempt.started.time)],
    ];
    this.element.replaceChildren(
      ...facts.filter(([, value]) => value).map(([name, value]) => h("div", {}, h("dt", { text: name }), value instanceof HTMLElement && value.tagName === "DD" ? value : h("dd", {}, value))));
    this.tick();
  }

  #fixtures() {
    const stood = Object.entries(this.attempt?.started.fixtures ?? {});
    return stood.length > 0 && stood.map(([name, generation], index) => [
      index ? ", " : "",
      h("a", { href: linkToFixture(this.test.suite, name) }, free(name)),
      generation > 1 ? ` (generation ${generation})` : "",
    ]);
  }

  tick() {
    const { attempt, test } = this;
    const seconds = attempt?.ended?.duration ?? (attempt && test.running ? this.page.now() - attempt.started.time : null);
    const limit = test.planned.run_timeout;
    if (this.duration) setText(this.duration, `${seconds === null ? "–" : formatSeconds(seconds)}${limit ? ` of at most ${formatTimeout(limit)}` : ""}`);
  }
}
