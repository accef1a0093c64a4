// A strip plot: a measurement of many subjects, as dots between their limits.
//
// If all limits are equal the axis is the value, otherwise the position between the limits, from 0 to 100 %.

import { niceStep, svg, tickText, ticks } from "./chart_helpers.js";
import { number } from "./model.js";
import { markerShape } from "./plot_style.js";

const DOT_ROW_HEIGHT = 18;
const MOST_STRIPS = 24; // more subjects go into one strip
const MOST_DOTS = 3000;
const AXIS = 18;
const TOP = 6;
const MARKS = { failed: "cross", marginal: "triangle" };

/** The plot of rows of the measurements' table: {test, record, verdict, value}. */
export function stripPlot(rows, width, page) {
  if (width < 100) return null;
  const shown = rows.filter((row) => Number.isFinite(row.value)).slice(0, MOST_DOTS);
  const frame = stripScale(shown);
  if (!frame) return null;
  const strips = stripsOf(shown, page.format);
  const left = Math.min(width / 3, 8 + 7.2 * Math.max(...strips.map((strip) => strip.label.length)));
  const step = niceStep(frame.max - frame.min, Math.max(2, (width - left) / 90));
  const x = (value) => left + ((value - frame.min) / (frame.max - frame.min)) * (width - left - 16);
  const height = TOP + strips.length * DOT_ROW_HEIGHT;
  const text = stripText(rows, shown, page.format);
  return svg(
    "svg",
    {
      class: "strip",
      width,
      height: height + AXIS,
      viewBox: `0 0 ${width} ${height + AXIS}`,
      role: "img",
      "aria-label": text,
    },
    svg("title", { text }),
    ticks(frame.min, frame.max, 8, step).map((at) =>
      axisTick(x(at), height, tickText(at, step) + (frame.share ? " %" : "")),
    ),
    strips.map((strip, index) => stripLine(strip, TOP + (index + 0.5) * DOT_ROW_HEIGHT, left, width)),
    frame.limits.map((limit) => svg("path", { class: "strip-limit", d: `M${x(limit)} 0V${height}` })),
    strips.flatMap((strip, index) =>
      strip.rows.map((row, place) =>
        dot(row, x(frame.at(row)), TOP + (index + 0.5) * DOT_ROW_HEIGHT + spread(place, strip.rows.length), page),
      ),
    ),
    svg("text", {
      class: "strip-axis",
      x: left - 8,
      y: height + 13,
      "text-anchor": "end",
      text: frame.share ? "of the range" : (rows[0].record.unit ?? ""),
    }),
  );
}

function axisTick(x, height, text) {
  return svg(
    "g",
    { class: "strip-axis" },
    svg("path", { d: `M${x} 0V${height}` }),
    svg("text", { x, y: height + 13, "text-anchor": "middle", text }),
  );
}

function stripLine(strip, y, left, width) {
  const label = strip.label.length > 28 ? `${strip.label.slice(0, 27)}…` : strip.label;
  return svg(
    "g",
    { class: "strip-row" },
    svg("path", { d: `M${left} ${y}H${width - 16}` }),
    svg("text", { x: left - 8, y: y + 4, "text-anchor": "end", text: label }),
  );
}

function dot(row, x, y, page) {
  const where = [row.test.name, row.record.subject].filter(Boolean).join(" · ");
  const title = svg("title", { text: `${where}: ${page.format.quantity(row.value, row.record.unit)}, ${row.verdict}` });
  return svg(
    "path",
    {
      class: `strip-dot is-${row.verdict}`,
      d: markerShape(MARKS[row.verdict] ?? "circle", x, y, row.verdict === "passed" ? 3 : 4),
    },
    title,
  );
}

/** The vertical offset of a dot, so that dots overlap less; always the same. */
function spread(place, count) {
  return count < 3 ? 0 : (((place * 5) % 9) / 8 - 0.5) * (DOT_ROW_HEIGHT - 8);
}

function stripsOf(rows, format) {
  const bySubject = new Map();
  for (const row of rows) {
    const label = row.record.subject ?? "";
    if (!bySubject.has(label)) bySubject.set(label, []);
    bySubject.get(label).push(row);
  }
  if (bySubject.size > MOST_STRIPS) return [{ label: `${bySubject.size} subjects`, rows }];
  const strips = [...bySubject].map(([label, members]) => ({
    label: format.visible(label) || "whole test",
    rows: members,
  }));
  return strips.sort((a, b) => a.label.localeCompare(b.label, undefined, { numeric: true }));
}

/** The axis: {min, max, limits, share, at(row)}; null without values. */
function stripScale(rows) {
  if (rows.length === 0) return null;
  const limit = (row, key) =>
    row.record[key] === undefined || row.record[key] === null ? null : number(row.record[key]);
  const [low, high] = ["low", "high"].map((key) => limit(rows[0], key));
  const same = rows.every((row) => limit(row, "low") === low && limit(row, "high") === high);
  const share = !same && rows.every((row) => limit(row, "high") > limit(row, "low") && limit(row, "low") !== null);
  const at = share
    ? (row) => (100 * (row.value - limit(row, "low"))) / (limit(row, "high") - limit(row, "low"))
    : (row) => row.value;
  const limits = (share ? [0, 100] : same ? [low, high] : []).filter(Number.isFinite);
  let [min, max] = [Infinity, -Infinity];
  for (const value of [...rows.map(at), ...limits]) [min, max] = [Math.min(min, value), Math.max(max, value)];
  const pad = (max - min) * 0.04 || Math.abs(max) * 0.1 || 1;
  return { min: min - pad, max: max + pad, limits, share, at };
}

function stripText(rows, shown, format) {
  const values = shown.map((row) => row.value);
  const unit = rows[0].record.unit ?? "";
  const counts = [...new Set(rows.map((row) => row.verdict))].map(
    (verdict) => `${rows.filter((row) => row.verdict === verdict).length} ${verdict}`,
  );
  const left = rows.length > shown.length ? `; ${shown.length} of ${rows.length} drawn` : "";
  const [least, most] = [Math.min(...values), Math.max(...values)].map((value) => format.quantity(value, unit));
  return format.visible(
    `${rows[0].record.name}: ${rows.length} values from ${least} to ${most}; ${counts.join(", ")}${left}`,
  );
}
