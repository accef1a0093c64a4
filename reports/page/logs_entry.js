// Records of a log: their rows, and one of them whole.

import { free, h, setText } from "./dom.js";
import { firstLine, formatDate } from "./format.js";
import { longText } from "./long_text.js";
import { signOf, toneOf } from "./state_signs.js";

const STATES = { fatal: "failure", error: "failure", warning: "warning", info: "info" };
const DAY = 86400000; // milliseconds

/** The time of a record at this place, with its date unless it is of today: `14:02:31.120`. */
export function formatClock(seconds, now = Date.now()) {
  const date = new Date(seconds * 1000);
  if (Number.isNaN(date.getTime())) return "–";
  const two = (value) => String(value).padStart(2, "0");
  const time = `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}.${String(date.getMilliseconds()).padStart(3, "0")}`;
  const today = Math.abs(now - date) < DAY && new Date(now).getDate() === date.getDate();
  return today ? time : `${two(date.getMonth() + 1)}-${two(date.getDate())} ${time}`;
}

/** The inside of a row. */
export function makeLogRow() {
  const row = {
    time: h("span", { class: "entry-time number" }), sign: h("span", { class: "sign", "aria-hidden": "true" }), level: h("span", { class: "entry-level" }),
    source: h("bdi", { class: "entry-source" }), component: h("bdi", { class: "entry-component" }), text: h("bdi", { class: "entry-text" }),
  };
  row.parts = [row.time, row.sign, row.level, row.source, row.component, row.text];
  return row;
}

/** Show a record in a row. */
export function drawLogRow(row, record) {
  const state = STATES[record.level] ?? "debug";
  row.element.dataset.tone = toneOf(state);
  setText(row.time, formatClock(record.time));
  setText(row.sign, signOf(state));
  setText(row.level, record.level === "unknown" ? "" : record.level);
  setText(row.source, sourceOf(record));
  setText(row.component, record.component);
  setText(row.text, firstLine(record.message, 400));
}

function sourceOf(record) {
  return record.sender.replace(/^\/log\//, "");
}

/** All that is known of a record. */
export function logEntry(record) {
  const facts = [
    ["Level", record.level], ["Time", `${formatDate(record.time)} (${formatClock(record.time)})`], ["Arrived", formatClock(record.arrived)],
    ["Sender", record.sender], ["Component", record.component], ["Id", record.id], ...Object.entries(record.groups),
  ].filter(([, value]) => value);
  const parts = [longText(record.message), h("dl", { class: "facts" }, facts.map(([name, value]) => h("div", {}, free(name, "dt"), free(value, "dd"))))];
  if (record.backtrace) parts.push(longText(record.backtrace, { className: "mono" }));
  return h("div", {}, parts);
}
