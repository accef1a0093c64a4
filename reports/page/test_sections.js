// The sections of a test's detail: each shows one kind of records of an attempt, and is hidden while there are none.
//
// A section has `element` and `update()`, which adds new records; `matches(record)` returns whether a record is of the
// shown subject.

import { free, h, section } from "./dom.js";
import { formatBytes, formatLimits, formatNumber, formatSeconds, linkTo, visible, visibleOutput } from "./format.js";
import { folded, GrowingList, longText } from "./long_text.js";
import { marginBar } from "./margin_bar.js";
import { messageItem } from "./messages.js";
import { PlotPanel } from "./plots.js";
import { badge, sign, toneOf } from "./state_signs.js";
import { alignedNumber } from "./sort_table.js";

export class FailuresPart {
  constructor(page, attempt, matches) {
    Object.assign(this, { attempt, matches });
    const list = h("ol", { class: "messages" });
    this.list = new GrowingList(list, (record) => messageItem(record, page, { large: true }), 20);
    this.whole = h("div");
    this.element = section("Failures", this.whole, list);
    this.element.classList.add("failures");
  }

  update() {
    const severe = this.attempt.messages.filter((one) => (one.severity === "failure" || one.severity === "error") && this.matches(one));
    const any = this.list.update(severe);
    this.element.hidden = !any && !this.#sentence();
  }

  /** Show a reason of several lines in full: a test that could not be loaded has no message. */
  #sentence() {
    const { ended } = this.attempt;
    if (!ended?.detail?.includes("\n")) return false;
    if (!this.whole.firstChild) this.whole.append(longText(ended.detail));
    return true;
  }
}

export class PartsPart {
  constructor(page, attempt, matches, test) {
    Object.assign(this, { attempt, matches });
    const grid = h("ul", { class: "parts" });
    this.list = new GrowingList(grid, (record) => partItem(record, test), 200);
    this.element = section("Parts", grid);
  }

  update() {
    this.element.hidden = !this.list.update([...this.attempt.parts.values()].filter(this.matches));
  }
}

/** The cases of a program, each a test of its own. */
export class CasesPart {
  constructor(page, attempt, matches, test) {
    Object.assign(this, { test });
    const grid = h("ul", { class: "parts" });
    this.list = new GrowingList(grid, ({ ended, planned }) => caseItem(ended, planned), 200);
    this.element = section("Cases", grid);
  }

  update() {
    const cases = this.test.cases.filter((one) => one.verdict !== null);
    this.element.hidden = !this.list.update(cases);
  }
}

/** The least shown duration in seconds: joints that are tested at the same time are judged in no time. */
const SHOWN = 0.01;

function partItem(record, test) {
  return item(linkTo(test.id, record.subject), record.subject, record.verdict, record.reason, record.duration);
}

function caseItem({ test, verdict, detail, duration }, planned) {
  return item(linkTo(test), planned.case, verdict, detail, duration);
}

function item(href, name, verdict, reason, duration) {
  return h("li", {}, h("a", { href, title: reason ? visible(reason) : null, data: { tone: toneOf(verdict) } },
    sign(verdict), free(name), h("span", { class: "dim number", text: duration >= SHOWN ? formatSeconds(duration) : "" })));
}

export class MeasurementsPart {
  constructor(page, attempt, matches, test) {
    Object.assign(this, { attempt, matches });
    const body = h("tbody");
    this.list = new GrowingList(body, (record, before) => measurementRow(record, before, test, page), 100);
    const head = ["part", "quantity", "value", "unit", "limits", "", "verdict"];
    this.table = h("table", { class: "table" },
      h("thead", {}, h("tr", {}, head.map((text, index) => (text ? h("th", { scope: "col", class: index === 2 ? "number" : null, text }) : h("td"))))), body);
    this.element = section("Measurements", h("div", { class: "scroll", role: "region", "aria-label": "Measurements", tabindex: "0" }, this.table));
  }

  update() {
    const records = this.attempt.measurements.filter(this.matches);
    this.element.hidden = !this.list.update(records);
    this.table.classList.toggle("no-parts", !records.some((one) => one.subject));
  }
}

function measurementRow(record, before, test, page) {
  const { name, subject = "", value, unit = "", low, high, verdict = "recorded", file, line } = record;
  const again = before && (before.subject ?? "") === subject;
  return h("tr", { data: { measurement: name } },
    h("th", { scope: "row", class: "part" }, again ? null : h("a", { href: linkTo(test.id, subject) }, free(subject))),
    h("td", { class: "quantity", title: file ? `${file}:${line ?? ""}` : null }, h("a", { href: linkTo(test.id, subject, name) }, free(name))),
    h("td", { class: "number" }, alignedNumber(formatNumber(value))), h("td", { class: "unit", text: unit }),
    h("td", { class: "limits", text: formatLimits(low, high) }), h("td", {}, marginBar(record, page.format)), h("td", {}, badge(verdict)));
}

export class PlotsPart {
  constructor(page, attempt, matches, test, subject) {
    Object.assign(this, { page, attempt, matches, subject });
    this.element = section("Series");
  }

  update() {
    const { attempt } = this;
    const series = [...attempt.series, ...attempt.live.values()].filter((one) => this.matches(one.record ?? one));
    this.element.hidden = series.length === 0;
    if (this.panel) this.panel.show(series);
    else if (series.length) this.#plot(series);
  }

  /** Choose the first failed subject with a series, as its plot is the most important one. */
  #plot(series) {
    const subjects = series.map((one) => (one.record ?? one).subject ?? "");
    const worst = subjects.find((one) => toneOf(this.attempt.parts.get(one)?.verdict) === "bad");
    this.panel = new PlotPanel(this.page, { series, subject: this.subject || worst || "", measurements: this.attempt.measurements });
    this.element.append(this.panel.element);
  }

  destroy() {
    this.panel?.destroy();
  }
}

export class MessagesPart {
  constructor(page, attempt, matches) {
    Object.assign(this, { attempt, matches });
    const list = h("ol", { class: "messages" });
    this.list = new GrowingList(list, (record) => messageItem(record, page), 100);
    this.element = section("Messages", list);
  }

  update() {
    const said = this.attempt.messages.filter((one) => one.severity !== "failure" && one.severity !== "error" && this.matches(one));
    this.element.hidden = !this.list.update(said);
  }
}

export class QuestionsPart {
  constructor(page, attempt) {
    this.attempt = attempt;
    this.list = h("dl", { class: "questions" });
    this.element = section("Questions", this.list);
  }

  update() {
    const { questions } = this.attempt;
    this.element.hidden = questions.length === 0;
    const key = `${questions.length} ${questions.filter((one) => one.answered).length}`;
    if (key === this.key) return;
    this.key = key;
    this.list.replaceChildren(...questions.flatMap(({ asked, answered }) => [
      free(asked.text, "dt"),
      h("dd", {}, answered
        ? [free(answered.answer ?? "no answer", "strong"), h("span", { class: "dim", text: ` ${asked.unit ?? ""} (${answered.source})` })]
        : h("span", { class: "dim", text: "waits for an answer" })),
    ]));
  }
}

export class AttachmentsPart {
  constructor(page, attempt) {
    this.attempt = attempt;
    const list = h("ul", { class: "attachments" });
    this.list = new GrowingList(list, (record) => attachmentItem(record, page), 24);
    this.element = section("Attachments", list);
  }

  update() {
    this.element.hidden = !this.list.update(this.attempt.attachments);
  }
}

function attachmentItem(record, page) {
  const { name, media_type: type = "", size } = record;
  const link = h("a", { download: name.split("/").pop() }, free(name));
  const item = h("li", {}, h("p", {}, link, h("span", { class: "dim", text: ` ${formatBytes(size ?? 0)}` })));
  page.source.file(record).then((address) => {
    if (!address) {
      const left = page.facts.left_out?.find((one) => one.path === record.path);
      item.replaceChildren(h("p", {}, free(name), h("span", { class: "dim", text: ` ${formatBytes(size ?? 0)}, not in this page${left ? `: ${left.reason}` : ""}` })));
      return;
    }
    link.href = address;
    if (type.startsWith("image/")) item.prepend(h("a", { href: address, download: name.split("/").pop() }, h("img", { src: address, alt: visible(name), loading: "lazy" })));
  });
  return item;
}

export class OutputPart {
  constructor(page, attempt) {
    this.attempt = attempt;
    const list = h("div", { class: "output" });
    this.list = new GrowingList(list, outputPiece, 60);
    this.element = section("Output", list);
  }

  update() {
    this.element.hidden = !this.list.update(this.attempt.output);
  }
}

function outputPiece(record, before) {
  const text = record.text ?? "";
  return h("div", { class: "output-piece", data: { stream: record.stream } },
    before?.stream === record.stream ? null : h("span", { class: "dim output-stream", text: record.stream }),
    record.omitted ? h("p", { class: "dim", text: `${formatBytes(record.omitted)} before this were not kept` }) : null,
    longText(text.endsWith("\n") ? text.slice(0, -1) : text, { clean: visibleOutput, className: "mono" }));
}

export class StacksPart {
  constructor(page, attempt) {
    this.attempt = attempt;
    const list = h("div");
    this.list = new GrowingList(list, (record) => folded(`all threads, ${record.cause}`, record.text, { className: "mono", open: attempt.stacks.length === 1 }), 10);
    this.element = section("Stacks", list);
  }

  update() {
    this.element.hidden = !this.list.update(this.attempt.stacks);
  }
}

export class ParametersPart {
  constructor(page, attempt) {
    this.attempt = attempt;
    const body = h("tbody");
    this.list = new GrowingList(body, resolvedRow, 100);
    this.element = section("Parameters", h("div", { class: "scroll", role: "region", "aria-label": "Parameters", tabindex: "0" }, h("table", { class: "table" },
      h("thead", {}, h("tr", {}, ["name", "value", "unit", "source"].map((text) => h("th", { scope: "col", text })))), body)));
  }

  update() {
    this.element.hidden = !this.list.update(this.attempt.parameters);
  }
}

function resolvedRow({ name, value, unit, source }) {
  return h("tr", {}, h("th", { scope: "row" }, free(name)), free(value, "td", { class: "mono" }), free(unit, "td", { class: "unit" }),
    free(source, "td", { class: "dim" }));
}
