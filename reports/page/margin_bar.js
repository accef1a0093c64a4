// A small bar that shows a value between its limits.
//
// The track is the allowed range with a tick at each limit, and coloured marginal zones; the mark is the value. Beyond
// the ends of the bar the mark is an arrow.

import { number } from "./model.js";
import { svg } from "./chart_helpers.js";

const WIDTH = 96;
const HEIGHT = 12;
/** The positions of low and high; beyond them is room for values out of the limits. */
const LOW_AT = 14;
const HIGH_AT = 82;
const MIDDLE = HEIGHT / 2;

/** The bar as an element; null without limits or a finite value. */
export function marginBar(measurement, format) {
  const scale = marginScale(measurement);
  if (!scale) return null;
  const text = marginText(measurement, format);
  return svg(
    "svg",
    {
      class: `margin-bar is-${measurement.verdict ?? "recorded"}`,
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      width: WIDTH,
      height: HEIGHT,
      role: "img",
      "aria-label": text,
    },
    svg("title", { text }),
    svg("rect", { class: "margin-track", x: scale.from, y: MIDDLE - 2, width: scale.to - scale.from, height: 4 }),
    scale.zones.map(([from, to]) =>
      svg("rect", { class: "margin-zone", x: from, y: MIDDLE - 2, width: to - from, height: 4 }),
    ),
    scale.limits.map((at) => svg("path", { class: "margin-limit", d: `M${at} 1.5V${HEIGHT - 1.5}` })),
    svg("path", { class: "margin-mark", d: markShape(scale.mark) }),
  );
}

/** A measurement in words: "12.5 deg of 10 to 15 deg, margin 2.5 deg, marginal". */
export function marginText(measurement, format) {
  const { value, low, high, margin, unit = "", verdict = "recorded" } = measurement;
  const quantity = (one) => format.quantity(number(one), unit);
  const parts = [quantity(value)];
  if (isGiven(low) && isGiven(high)) parts[0] += ` of ${format.number(number(low))} to ${quantity(high)}`;
  else if (isGiven(low)) parts[0] += `, at least ${quantity(low)}`;
  else if (isGiven(high)) parts[0] += `, at most ${quantity(high)}`;
  if (isGiven(margin)) parts.push(`margin ${quantity(margin)}`);
  return [...parts, verdict].join(", ");
}

/** The distance to the nearest limit as a share of the allowed range, or of the only limit; null without limits. */
export function relativeMargin(measurement) {
  if (!isGiven(measurement.margin)) return null;
  const range = allowedRange(measurement);
  return range > 0 ? number(measurement.margin) / range : null;
}

/** The reference of a margin: high - low, or the size of the only limit; null without limits. */
export function allowedRange({ low, high }) {
  if (isGiven(low) && isGiven(high)) return number(high) - number(low);
  if (isGiven(low)) return Math.abs(number(low)) || null;
  return isGiven(high) ? Math.abs(number(high)) || null : null;
}

/** The layout in pixels: {from, to, limits, zones, mark: {at, beyond: -1, 0 or 1}}. */
export function marginScale(measurement) {
  const value = number(measurement.value);
  const low = finiteOrNull(measurement.low);
  const high = finiteOrNull(measurement.high);
  if ((low === null && high === null) || Number.isNaN(value)) return null;
  const [bottom, top] = scaleEnds(value, low, high, number(measurement.marginal ?? 0));
  const place = (one) => LOW_AT + ((one - bottom) / (top - bottom)) * (HIGH_AT - LOW_AT);
  const from = low === null ? 0 : LOW_AT;
  const to = high === null ? WIDTH : HIGH_AT;
  const at = place(value);
  return {
    from,
    to,
    limits: [low === null ? null : LOW_AT, high === null ? null : HIGH_AT].filter((one) => one !== null),
    zones: marginalZones(measurement, low, high, place, from, to),
    mark: { at: Math.min(WIDTH - 3, Math.max(3, at)), beyond: at < 2 ? -1 : at > WIDTH - 2 ? 1 : 0 },
  };
}

/** The values at the two ends of the range. With one limit the other end is chosen so that the value is visible. */
function scaleEnds(value, low, high, marginal) {
  if (low !== null && high !== null) return high > low ? [low, high] : [low - 1, low + 1];
  const limit = low ?? high;
  const reach = Math.max(Math.abs(limit), 4 * Math.abs(marginal)) || Math.abs(value) || 1;
  return low !== null ? [limit, limit + reach] : [limit - reach, limit];
}

function marginalZones(measurement, low, high, place, from, to) {
  const marginal = number(measurement.marginal ?? 0);
  if (!(marginal > 0)) return [];
  const zones = [];
  if (low !== null) zones.push([LOW_AT, Math.min(place(low + marginal), to)]);
  if (high !== null) zones.push([Math.max(place(high - marginal), from), HIGH_AT]);
  return zones.filter(([start, end]) => end > start);
}

function markShape({ at, beyond }) {
  if (beyond) return `M${at + 3 * beyond} ${MIDDLE}L${at - 3 * beyond} 1V${HEIGHT - 1}Z`;
  return `M${at - 1.5} 0H${at + 1.5}V${HEIGHT}H${at - 1.5}Z`;
}

function isGiven(value) {
  return value !== null && value !== undefined;
}

function finiteOrNull(value) {
  const one = isGiven(value) ? number(value) : null;
  return Number.isFinite(one) ? one : null;
}
