// Sparklines of many runs: the values of a measurement, and the verdicts of a test.

import { svg } from "./chart_helpers.js";
import { toneOf } from "./state_signs.js";

const SPARK_WIDTH = 150;
const SPARK_HEIGHT = 24;
const INSET = 3;
const CELL = 7;
const STRIP_HEIGHT = 16;

/** The values of a measurement over `count` runs between its limits. */
export function sparkline(points, count) {
  const known = points.filter((point) => Number.isFinite(point.value));
  const frame = svg("svg", {
    class: "spark",
    width: SPARK_WIDTH,
    height: SPARK_HEIGHT,
    viewBox: `0 0 ${SPARK_WIDTH} ${SPARK_HEIGHT}`,
    "aria-hidden": "true",
  });
  if (known.length === 0) return frame;
  const values = known.flatMap((point) => [point.value, point.low, point.high]).filter(Number.isFinite);
  const [min, max] = [Math.min(...values), Math.max(...values)];
  const x = (run) => INSET + (run / Math.max(1, count - 1)) * (SPARK_WIDTH - 2 * INSET);
  const y = (value) =>
    max > min ? SPARK_HEIGHT - INSET - ((value - min) / (max - min)) * (SPARK_HEIGHT - 2 * INSET) : SPARK_HEIGHT / 2;
  const path = (select) =>
    known
      .filter((point) => Number.isFinite(select(point)))
      .map((point, index) => `${index ? "L" : "M"}${x(point.run).toFixed(1)} ${y(select(point)).toFixed(1)}`)
      .join("");
  const last = known[known.length - 1];
  const failed = known.filter((point) => point.verdict === "failed");
  frame.append(
    ...["low", "high"].map((key) => svg("path", { class: "spark-limit", d: path((point) => point[key]) })),
    svg("path", { class: "spark-line", d: path((point) => point.value) }),
    ...failed.map((point) => svg("circle", { class: "spark-failed", cx: x(point.run), cy: y(point.value), r: 2 })),
    svg("circle", {
      class: "spark-last",
      cx: x(last.run),
      cy: y(last.value),
      r: 2.5,
      "data-tone": toneOf(last.verdict),
    }),
  );
  return frame;
}

/** The verdicts of a test, a column for each run: tall for not passed, low for passed, a line for not in the run. */
export function verdictStrip(verdicts, runs, format) {
  const counts = new Map();
  for (const verdict of verdicts) counts.set(verdict ?? "not there", (counts.get(verdict ?? "not there") ?? 0) + 1);
  const text = [...counts].map(([verdict, count]) => `${count} ${verdict}`).join(", ");
  const width = verdicts.length * CELL;
  return svg(
    "svg",
    {
      class: "verdict-strip",
      width,
      height: STRIP_HEIGHT,
      viewBox: `0 0 ${width} ${STRIP_HEIGHT}`,
      role: "img",
      "aria-label": text,
    },
    verdicts.map((verdict, index) => stripCell(verdict, index, runs[index], format)),
  );
}

function stripCell(verdict, index, run, format) {
  if (verdict === null)
    return svg("rect", { class: "verdict-absent", x: index * CELL, y: STRIP_HEIGHT - 1.5, width: CELL - 1, height: 1 });
  const tone = toneOf(verdict);
  const height = { good: 6, idle: 3 }[tone] ?? (tone === "warn" ? 11 : STRIP_HEIGHT);
  const title = svg("title", { text: format.visible(`${run?.run ?? ""}: ${verdict}`) });
  return svg(
    "rect",
    { class: "timeline-test", x: index * CELL, y: STRIP_HEIGHT - height, width: CELL - 1, height, data: { tone } },
    title,
  );
}
