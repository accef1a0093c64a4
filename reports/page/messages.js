// Messages as entries of a list, with value and limits, location and traceback.

import { free, h } from "./dom.js";
import { formatLimits, formatNumber, formatPlace, formatQuantity, linkTo } from "./format.js";
import { folded, longText } from "./long_text.js";
import { marginBar } from "./margin_bar.js";
import { VERDICTS, isBad } from "./model.js";
import { badge, sign } from "./state_signs.js";

/** A message record. Titles are short kinds (`checks`), details the author's sentence. */
export function messageItem(record, page, { large = false } = {}) {
  const { severity, title, detail = "", file, line, traceback, subject, test } = record;
  return h("li", { class: large ? "message large" : "message", data: { severity } },
    sign(severity),
    h("div", { class: "message-body" },
      detail ? messageText(detail, large) : free(title, "p", { class: "message-detail" }),
      messageValue(record, page),
      h("p", { class: "dim message-about" },
        detail && title ? free(title) : null,
        subject ? h("a", { href: linkTo(test ?? "", subject) }, free(subject)) : null,
        record.phase ? h("span", { text: record.phase }) : null,
        file ? free(formatPlace(file, line), "span", { class: "mono", title: line ? `${file}:${line}` : file }) : null,
      ),
      traceback ? folded("traceback", traceback, { className: "mono" }) : null));
}

function messageText(detail, large) {
  const short = detail.length < 600 && !detail.includes("\n");
  return short ? free(detail, "p", { class: "message-detail" }) : longText(detail, { className: large ? "message-detail" : "" });
}

function messageValue(record, page) {
  const { value, low, high } = record;
  if (typeof value !== "number" || ((low ?? null) === null && (high ?? null) === null)) return null;
  const bar = marginBar({ ...record, verdict: record.severity === "pass" ? "passed" : "failed" }, page.format);
  const stated = record.detail?.includes(formatNumber(value));
  return bar && h("p", { class: "message-value" }, bar, stated ? null : free(` ${formatQuantity(value, record.unit)}, wanted ${formatLimits(low, high, record.unit)}`));
}

/** The ends of the tests with problems, worst first. */
export function problemsOf(tests) {
  const bad = [...tests].filter((test) => isBad(test.state));
  bad.sort((one, other) => VERDICTS.indexOf(one.state) - VERDICTS.indexOf(other.state));
  return bad.map((test) => test.ended);
}

/** A test with a problem, and the whole reason. */
export function problemItem(ended) {
  const { test, verdict, detail, reason } = ended;
  return h("li", { class: "problem" }, badge(verdict),
    h("div", { class: "message-body" }, h("a", { href: linkTo(test) }, free(test)), detail || reason ? longText(detail || reason, { className: "dim" }) : null));
}
