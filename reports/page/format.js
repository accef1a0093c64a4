// Writes numbers, times and texts for people. Pure functions; the same words as the other reports use.

const SECOND = 1;
const MINUTE = 60 * SECOND;
const HOUR = 60 * MINUTE;

/** Six significant digits, no trailing zeros; whole numbers whole. Takes the words NaN, Infinity, -Infinity too. */
export function formatNumber(value) {
  const plain = Number(value);
  if (Number.isNaN(plain)) return "NaN";
  if (!Number.isFinite(plain)) return plain > 0 ? "Infinity" : "-Infinity";
  if (Number.isInteger(plain) && Math.abs(plain) < 1e12) return String(plain);
  return String(Number(plain.toPrecision(6)));
}

/** A value with its unit: `12.5 deg`, `80%`. */
export function formatQuantity(value, unit = "") {
  if (unit === "%") return `${formatNumber(value)}%`;
  return unit ? `${formatNumber(value)} ${unit}` : formatNumber(value);
}

/** Limits in words: `within [1, 3] deg`, `at most 5 ms`, `at least 2 N`, or nothing. */
export function formatLimits(low, high, unit = "") {
  const has = (limit) => limit !== null && limit !== undefined;
  const suffix = unit ? ` ${unit}` : "";
  if (has(low) && has(high)) return `within [${formatNumber(low)}, ${formatNumber(high)}]${suffix}`;
  if (has(low)) return `at least ${formatNumber(low)}${suffix}`;
  if (has(high)) return `at most ${formatNumber(high)}${suffix}`;
  return "";
}

/** A duration: `0.41 s`, `12.3 s`, `2:05 min`, `1:02:03 h`. */
export function formatSeconds(seconds) {
  const value = Number(seconds);
  if (!Number.isFinite(value)) return "–";
  if (value < 0.0995) return `${(value * 1000).toFixed(value < 0.00995 ? 1 : 0)} ms`;
  if (value < 9.995) return `${value.toFixed(2)} s`;
  if (value < 99.95) return `${value.toFixed(1)} s`;
  return formatRunning(value);
}

/** A duration that is still growing: whole seconds, so that it does not flicker. */
export function formatRunning(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < MINUTE) return `${whole} s`;
  const two = (value) => String(value).padStart(2, "0");
  if (whole < HOUR) return `${Math.floor(whole / MINUTE)}:${two(whole % MINUTE)} min`;
  return `${Math.floor(whole / HOUR)}:${two(Math.floor((whole % HOUR) / MINUTE))}:${two(whole % MINUTE)} h`;
}

/** A limit as it was written: `10 s`, `2:00 min`. */
export function formatTimeout(seconds) {
  return seconds < 2 * MINUTE ? `${formatNumber(seconds)} s` : formatRunning(seconds);
}

/** A moment of the run, in seconds since it began: `12.345`. */
export function formatMoment(time, start) {
  return (time - start).toFixed(3);
}

/** A time of day and its date, as this place writes them. */
export function formatDate(time) {
  const date = new Date(time * 1000);
  return Number.isNaN(date.getTime()) ? "" : date.toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" });
}

/** A number of bytes: `812 B`, `29.3 MiB`. */
export function formatBytes(count) {
  let value = Number(count);
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  let index = 0;
  while (value >= 1024 && index < units.length - 1) {
    value /= 1024;
    index += 1;
  }
  return `${index === 0 || value >= 100 ? Math.round(value) : value.toFixed(1)} ${units[index]}`;
}

/** So many of something: `1 part`, `4 parts`; nothing for none. */
export function formatCount(count, word) {
  return count ? `${count} ${word}${count === 1 ? "" : "s"}` : "";
}

/** A file and its line, the file's last two parts only: the whole path belongs into a tooltip. */
export function formatPlace(file, line) {
  if (!file) return "";
  const short = file.split("/").slice(-2).join("/");
  return line ? `${short}:${line}` : short;
}

// Characters with an effect: control characters, and those that change the direction of the text.
const ACTING = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u061c\u2028\u2029\u202a-\u202e\u2066-\u2069\ufeff]/g;
const LINE_END = /\r\n/g;
const TERMINAL = /\u001b(?:\[[0-?]*[ -/]*[@-~]|\][^\u0007\u001b]*(?:\u0007|\u001b\\))/g;

function spell(char) {
  const code = char.charCodeAt(0);
  return code < 0x100 ? `\\x${code.toString(16).padStart(2, "0")}` : `\\u${code.toString(16).padStart(4, "0")}`;
}

/** Return a text with visible control and direction characters; tabs and line ends stay. */
export function visible(text) {
  return String(text ?? "").replace(LINE_END, "\n").replace(ACTING, spell);
}

/** Return terminal output without colours and cursor movements, and with visible control characters. */
export function visibleOutput(text) {
  return visible(String(text ?? "").replace(TERMINAL, ""));
}

/** Return the first line that is not empty, cut to a limit. */
export function firstLine(text, limit = 300) {
  const start = String(text ?? "").slice(0, 4 * limit).trimStart();
  const end = start.indexOf("\n");
  const line = end < 0 ? start : start.slice(0, end);
  return line.length > limit ? `${line.slice(0, limit - 1)}…` : line;
}

// A lone surrogate, in the name of a file that is not valid text, cannot be in a URL; it is replaced by a
// character of the last private plane.
const HALF = 0xd800;
const PRIVATE = 0x10f000;

function encodeSegment(text) {
  return encodeURIComponent(text.replace(/\p{Surrogate}/gu, (half) => String.fromCodePoint(half.charCodeAt(0) - HALF + PRIVATE)));
}

function decodeSegment(text) {
  try {
    return decodeURIComponent(text).replace(/[\u{10f000}-\u{10f7ff}]/gu, (one) => String.fromCharCode(one.codePointAt(0) - PRIVATE + HALF));
  } catch {
    return text; // typed by a person
  }
}

/** The link to a test, a part of it, or a measurement: `#suite/test/subject/measurement`, each segment encoded. */
export function linkTo(test, subject = "", measurement = "") {
  const slash = test.indexOf("/");
  const segments = slash < 0 ? [test] : [test.slice(0, slash), test.slice(slash + 1)];
  if (subject || measurement) segments.push(subject);
  if (measurement) segments.push(measurement);
  return `#${segments.map(encodeSegment).join("/")}`;
}

/** The link to the timeline of a fixture. */
export function linkToFixture(suite, fixture) {
  return `#~fixtures/${encodeSegment(suite)}/${encodeSegment(fixture)}`;
}

/** The link to the log of one test. */
export function linkToLog(test) {
  return `#~log/${encodeSegment(test)}`;
}

/** Parse a place (a link without its `#`): {suite, test, subject, measurement}, with empty texts for missing parts. */
export function readPlace(place) {
  const [suite, name, subject, measurement] = place.split("/").map(decodeSegment);
  return { suite, test: name ? `${suite}/${name}` : "", subject: subject ?? "", measurement: measurement ?? "" };
}

/** The functions by short names, for the views. */
export const format = {
  number: formatNumber, quantity: formatQuantity, limits: formatLimits, seconds: formatSeconds, running: formatRunning,
  timeout: formatTimeout, moment: formatMoment, date: formatDate, bytes: formatBytes, place: formatPlace, visible,
  visibleOutput, firstLine,
};
