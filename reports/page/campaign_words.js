// Words for the figures of a campaign.

import { percentText } from "./chart_helpers.js";
import { formatQuantity } from "./format.js";

/** A number with three significant digits. */
export function figureText(value) {
  return String(Number(value.toPrecision(3)));
}

/** `12 of 40, 17 to 47 %`. */
export function rateText(rate) {
  return rate.trials ? `${rate.count} of ${rate.trials}, ${intervalText(rate.low, rate.high)}` : "not judged";
}

/** `17 to 47 %`. */
export function intervalText(low, high) {
  return `${percentText(low).replace(" %", "")} to ${percentText(high)}`;
}

/** A size with its unit and three or four digits. */
export function sizeText(value, unit) {
  return formatQuantity(figureText(value), unit);
}

/** The detection limit in words: `0.52 deg (0.44 to 0.71)`. */
export function limitText({ limit, unit, method, levels, reason }) {
  if (method === "rate") return "has no size";
  if (limit.severity === null) return method === "levels" ? "not reached" : "too large for a number";
  if (method === "logistic") {
    const ends = limit.high === null ? `above ${figureText(limit.low)}` : `${figureText(limit.low)} to ${figureText(limit.high)}`;
    return `${sizeText(limit.severity, unit)} (${ends})${limit.extrapolated ? ", extrapolated" : ""}`;
  }
  const below = reason.startsWith("all") ? "or less" : limit.low === null ? "" : `above ${figureText(limit.low)}`;
  const runs = levels.find((level) => level.severity === limit.severity)?.found.trials ?? 0;
  return [`${sizeText(limit.severity, unit)}`, below, `all of ${runs} found`].filter(Boolean).join(", ");
}

/** The test and what it is to find: `JointSweep · encoder_drift −`. */
export function curveTitle({ test, fault, direction, robot }, robots) {
  const sign = direction === "-" ? " −" : direction === "+" ? " +" : "";
  return [test, `${fault}${sign}`, robots.length > 1 ? robot : ""].filter(Boolean).join(" · ");
}

/** The capability with its interval: `0.83 (0.61 to 1.05)`. */
export function capabilityText(capability) {
  if (capability === null) return "";
  return `${capability.value.toFixed(2)} (${capability.low.toFixed(2)} to ${capability.high.toFixed(2)})`;
}

/** What is to be found, in a few words: `encoder_drift 0.5 to 4 deg/s, motor_sign`. */
export function needsText(needs, unitOf) {
  const kinds = new Map();
  for (const need of needs) {
    const key = `${need.fault}\n${need.direction}`;
    kinds.set(key, [...(kinds.get(key) ?? []), need]);
  }
  return [...kinds.values()].map((some) => rangeText(some, unitOf(some[0]))).join(", ");
}

function rangeText([first, ...others], unit) {
  if (first.severity === null) return first.fault;
  const last = others.length ? ` to ${figureText(others[others.length - 1].severity)}` : "";
  return `${first.fault} ${first.direction === "-" ? "−" : ""}${figureText(first.severity)}${last} ${unit}`.trimEnd();
}
