// The charts of a campaign, as SVG that scales: detection curves, intervals of rates, distributions, cost and coverage.

import { niceStep, svg, tickText, ticks } from "./chart_helpers.js";
import { visible } from "./format.js";
import { figureText, rateText } from "./campaign_words.js";

const CARD = { width: 420, height: 250, left: 58, right: 14, top: 10, bottom: 40 };
const WIDE = { width: 720, height: 260, left: 58, right: 24, top: 12, bottom: 40 };
const MOST_LABELS = 7;
const FAR = 3; // a limit further away than so many widths of the values is not drawn

/** A detection curve: band, curve, levels with exact intervals, and the limit with its interval. */
export function detectionChart(curve, words) {
  const sizes = [...curve.points, ...curve.levels].map((one) => one.severity).filter((size) => size > 0);
  const [low, high] = [Math.min(...sizes) / 1.1, Math.max(...sizes) * 1.1];
  const logarithm = (value) => Math.log(Math.min(high, Math.max(low, value)));
  const { x, y, frame } = chartFrame(CARD, [logarithm(low), logarithm(high)], [0, 1], {
    xTicks: logTicks(low, high).map((at) => ({ at: Math.log(at), text: figureText(at) })),
    yTicks: shareTicks(),
    xTitle: curve.unit ? `severity (${curve.unit})` : "severity",
    yTitle: "found",
  });
  const at = (severity) => x(logarithm(severity));
  const line = (key) => curve.points.map((point) => `${at(point.severity)} ${y(point[key])}`);
  const { limit } = curve;
  const drawn = limit.severity !== null && limit.severity <= high;
  return pictureOf(CARD, words, frame, [
    drawn && curve.points.length > 0 &&
      svg("rect", {
        class: "limit-range", x: at(limit.low), y: y(1), width: Math.max(0, at(limit.high ?? high) - at(limit.low)), height: y(0) - y(1),
      }),
    svg("path", { class: "wanted", d: `M${at(low)} ${y(0.99)}H${at(high)}` }),
    drawn && svg("path", { class: "limit-line", d: `M${at(limit.severity)} ${y(0)}V${y(1)}` }),
    curve.points.length > 0 && svg("path", { class: "band", d: `M${line("low").join("L")}L${line("high").reverse().join("L")}Z` }),
    curve.points.length > 0 && svg("path", { class: "curve", d: `M${line("share").join("L")}` }),
    curve.levels.filter((level) => level.severity > 0).map((level) =>
      svg("g", { class: "level" },
        svg("title", { text: `${figureText(level.severity)}: ${rateText(level.found)}` }),
        svg("path", { d: `M${at(level.severity)} ${y(level.found.low)}V${y(level.found.high)}` }),
        svg("circle", { cx: at(level.severity), cy: y(level.found.share), r: 3.5 }))),
  ]);
}

/** Rates with their intervals, a row each: `rows` are {label, rate, tone}. */
export function intervalChart(rows, words) {
  const box = { ...WIDE, left: 220, height: 12 + rows.length * 22 + 40 };
  const most = Math.min(1, Math.max(0.05, ...rows.map((row) => row.rate.high)) * 1.05);
  const { x, frame } = chartFrame(box, [0, most], [0, 1], { xTicks: shareTicks(most), yTicks: [], xTitle: "failed on healthy robots" });
  return pictureOf(box, words, frame, rows.map((row, index) => {
    const middle = box.top + 22 * (index + 0.5);
    const { rate } = row;
    return svg("g", { class: "interval", data: { tone: row.tone } },
      svg("title", { text: `${row.label}: ${rateText(rate)}` }),
      svg("text", { x: box.left - 8, y: middle + 4, "text-anchor": "end", text: shortened(row.label, 30) }),
      svg("path", { d: `M${x(rate.low)} ${middle}H${x(rate.high)}M${x(rate.low)} ${middle - 4}v8M${x(rate.high)} ${middle - 4}v8` }),
      rate.share !== null && svg("circle", { cx: x(rate.share), cy: middle, r: 4 }));
  }));
}

/** The values of a measurement as a histogram, with its limits. */
export function distributionChart(one, words) {
  const { start, width, counts } = one.histogram;
  const span = width * counts.length || Math.abs(start) * 0.1 || 1;
  const from = width ? start : start - span / 2;
  const near = (limit) => limit !== null && limit > from - FAR * span && limit < from + (FAR + 1) * span;
  const ends = [from, from + span, ...[one.lower, one.upper].filter(near)];
  const pad = (Math.max(...ends) - Math.min(...ends)) * 0.04;
  const [low, high] = [Math.min(...ends) - pad, Math.max(...ends) + pad];
  const step = niceStep(high - low, 5);
  const most = Math.max(...counts);
  const upward = Math.max(1, niceStep(most, 4));
  const { x, y, frame } = chartFrame({ ...CARD, height: 190 }, [low, high], [0, most], {
    xTicks: ticks(low, high, 5, step).map((at) => ({ at, text: tickText(at, step) })),
    yTicks: ticks(0, most, 4, upward).map((at) => ({ at, text: String(at) })),
    xTitle: one.unit, yTitle: "runs",
  });
  const bar = width || span;
  const outside = (place) => {
    const middle = from + (place + 0.5) * bar;
    return (one.lower !== null && middle < one.lower) || (one.upper !== null && middle > one.upper);
  };
  return pictureOf({ ...CARD, height: 190 }, words, frame, [
    counts.map((count, place) => count > 0 &&
      svg("rect", {
        class: outside(place) ? "bin is-outside" : "bin", x: x(from + place * bar), y: y(count),
        width: Math.max(1, x(from + (place + 1) * bar) - x(from + place * bar) - 1), height: y(0) - y(count),
      })),
    [one.lower, one.upper].map((limit) => near(limit) && svg("path", { class: "strip-limit", d: `M${x(limit)} ${y(0)}V${y(most)}` })),
  ]);
}

/** The share of the faults that is found over the time of the chosen tests. */
export function coverageChart(choice, words) {
  const end = choice.steps[choice.steps.length - 1].total_seconds;
  const step = niceStep(end, 6);
  const { x, y, frame } = chartFrame(WIDE, [0, end * 1.04], [0, 1], {
    xTicks: ticks(0, end, 6, step).map((at) => ({ at, text: tickText(at, step) })),
    yTicks: shareTicks(), xTitle: "time of the chosen tests (s)", yTitle: "found",
  });
  const corners = choice.steps.map((one) => `H${x(one.total_seconds)}V${y(one.share)}`);
  return pictureOf(WIDE, words, frame, [
    svg("path", { class: "curve", d: `M${x(0)} ${y(0)}${corners.join("")}H${x(end * 1.04)}` }),
    choice.steps.map((one, index) =>
      svg("g", { class: "step" },
        svg("title", { text: `${one.test}: ${figureText(100 * one.share)} %` }),
        svg("circle", { cx: x(one.total_seconds), cy: y(one.share), r: 8 }),
        svg("text", { x: x(one.total_seconds), y: y(one.share) + 4, "text-anchor": "middle", text: index + 1 }))),
  ]);
}

function chartFrame(box, [xLow, xHigh], [yLow, yHigh], { xTicks, yTicks, xTitle = "", yTitle = "" }) {
  const x = (value) => box.left + ((value - xLow) / (xHigh - xLow || 1)) * (box.width - box.left - box.right);
  const y = (value) => box.height - box.bottom - ((value - yLow) / (yHigh - yLow || 1)) * (box.height - box.top - box.bottom);
  const [floor, ceiling] = [box.height - box.bottom, box.top];
  const frame = svg("g", { class: "strip-axis" },
    yTicks.flatMap(({ at, text }) => [
      svg("path", { d: `M${box.left} ${y(at)}H${box.width - box.right}` }),
      svg("text", { x: box.left - 6, y: y(at) + 4, "text-anchor": "end", text }),
    ]),
    xTicks.flatMap(({ at, text }) => [
      svg("path", { d: `M${x(at)} ${floor}V${ceiling}` }),
      svg("text", { x: x(at), y: floor + 15, "text-anchor": "middle", text }),
    ]),
    svg("path", { class: "floor", d: `M${box.left} ${floor}H${box.width - box.right}` }),
    svg("text", { x: (box.left + box.width - box.right) / 2, y: box.height - 6, "text-anchor": "middle", text: xTitle }),
    yTitle && svg("text", { x: 12, y: (floor + ceiling) / 2, "text-anchor": "middle", text: yTitle, transform: `rotate(-90 12 ${(floor + ceiling) / 2})` }));
  return { x, y, frame };
}

function pictureOf(box, words, ...parts) {
  const present = parts.flat(Infinity).filter(Boolean);
  return svg("svg", { class: "chart", viewBox: `0 0 ${box.width} ${box.height}`, role: "img", "aria-label": visible(words) }, present);
}

function shareTicks(most = 1) {
  const step = niceStep(most * 100, 5);
  return ticks(0, most * 100, 5, step).map((at) => ({ at: at / 100, text: `${tickText(at, step)} %` }));
}

/** 1, 2 and 5 times powers of ten, or fewer, or an even division where there are none. */
function logTicks(low, high) {
  const first = Math.floor(Math.log10(low));
  const powers = Array.from({ length: Math.ceil(Math.log10(high)) - first + 1 }, (_, index) => 10 ** (first + index));
  for (const digits of [[1, 2, 5], [1, 3], [1]]) {
    const found = powers.flatMap((power) => digits.map((digit) => digit * power)).filter((at) => at >= low && at <= high);
    if (found.length >= 2 && found.length <= MOST_LABELS) return found;
  }
  return ticks(low, high, 5);
}

function shortened(text, length) {
  const whole = visible(text);
  return whole.length > length ? `${whole.slice(0, length - 1)}…` : whole;
}
