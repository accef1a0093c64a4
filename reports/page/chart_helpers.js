// Helpers of the charts: number formats, ticks, merged bars, and saving of text files.

const SVG = "http://www.w3.org/2000/svg";
const MOST_TICKS = 1000;
/** Steps of a time axis: up to 30 s, up to 30 min, up to days. */
const TIME_STEPS = [
  0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200,
  10800, 21600, 43200, 86400,
];

/** An SVG element; `attributes` and children as for h(). */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name === "text") element.textContent = value;
    else if (name === "data") Object.assign(element.dataset, value);
    else element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** The step of 1, 2 or 5 times a power of ten that gives at most `count` parts of `span`. */
export function niceStep(span, count) {
  const rough = span / Math.max(1, count);
  if (!(rough > 0) || !Number.isFinite(rough)) return 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= rough * (1 - 1e-9));
}

/** Round values from `low` to `high`, at most `count` + 1 of them. */
export function ticks(low, high, count, step = niceStep(high - low, count)) {
  const found = [];
  if (!((high - low) / step < MOST_TICKS)) return found;
  const first = Math.ceil(low / step - 1e-9);
  for (let index = first; index * step <= high + step * 1e-9; index += 1) found.push(index * step);
  return found;
}

/** Ticks of a time axis in seconds: {at, text}. */
export function timeTicks(low, high, count) {
  const rough = (high - low) / Math.max(1, count);
  const step = TIME_STEPS.find((one) => one >= rough) ?? Math.ceil(rough / 86400) * 86400;
  return ticks(low, high, count, step).map((at) => ({ at, text: clockText(at, step) }));
}

/** Format seconds for an axis: `2.5 s`, `1:30`, `2:05:00`; `step` is the resolution. */
export function clockText(seconds, step = 1) {
  if (seconds < 0) return `−${clockText(-seconds, step)}`;
  const digits = Math.min(3, digitsOf(step));
  if (seconds < 60 - 10 ** -digits / 2) return `${seconds.toFixed(digits)} s`;
  const whole = Number(seconds.toFixed(digits));
  const two = (value) => String(value).padStart(2, "0");
  const rest = whole % 60;
  const tail = digits ? rest.toFixed(digits).padStart(3 + digits, "0") : two(rest);
  const minutes = Math.floor(whole / 60);
  return minutes < 60 ? `${minutes}:${tail}` : `${Math.floor(minutes / 60)}:${two(minutes % 60)}:${tail}`;
}

/** Format a difference with four significant digits. */
export function shortNumber(value) {
  return String(Number(Number(value).toPrecision(4)));
}

/** Format a share as a percentage: `0.4 %`, `12 %`. */
export function percentText(share) {
  if (!Number.isFinite(share)) return "";
  const percent = share * 100;
  const digits = Math.abs(percent) < 10 && percent !== 0 ? 1 : 0;
  return `${percent.toFixed(digits).replace("-", "−")} %`;
}

/** Merge bars that are too thin to be distinguished: `bars` are {from, to, rank} in pixels, sorted by `from`. Only
 * neighbours of one rank become one, {from, to, rank, members}, so that a single failure between many stays visible.
 */
export function mergeBars(bars, least) {
  const merged = [];
  for (const bar of bars) {
    const last = merged[merged.length - 1];
    const thin = bar.to - bar.from < least;
    if (last?.thin && thin && last.rank === bar.rank && bar.from - last.to < least / 2) {
      last.to = Math.max(last.to, bar.to);
      last.members.push(bar);
    } else {
      merged.push({ from: bar.from, to: bar.to, rank: bar.rank, thin, members: [bar] });
    }
  }
  return merged;
}

/** Format rows of texts and numbers as CSV. A text that a spreadsheet would read as a formula gets a `'` before it. */
export function csvText(rows) {
  const cell = (value) => {
    if (value === null || value === undefined) return "";
    if (typeof value === "number") return String(value);
    const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
}

/** Let the browser save a text as a file. */
export function saveText(name, text, type = "text/csv") {
  const address = URL.createObjectURL(new Blob([text], { type: `${type};charset=utf-8` }));
  const link = document.createElement("a");
  link.href = address;
  link.download = name.replace(/[^\w.-]+/g, "_");
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/** Call `callback(width)` now and whenever the width of `element` changes by a pixel or more; returns the observer. */
export function watchWidth(element, callback) {
  let last = 0;
  const observer = new ResizeObserver(([entry]) => {
    const width = Math.floor(entry.contentRect.width);
    if (width === last || width === 0) return;
    last = width;
    callback(width);
  });
  observer.observe(element);
  return observer;
}

/** Format a value of an axis with the digits for its step. */
export function tickText(value, step) {
  const size = Math.max(Math.abs(value), Math.abs(step));
  if (size >= 1e7 || (step && Math.abs(step) < 1e-5)) return value.toPrecision(3).replace("-", "−");
  return value.toFixed(step ? digitsOf(Math.abs(step)) : 2).replace("-", "−");
}

/** Return the digits after the decimal point for a step: 1 for 0.5, 2 for 0.25. */
function digitsOf(step) {
  let digits = 0;
  while (digits < 12 && Math.abs(Number(step.toFixed(digits)) - step) > step * 1e-6) digits += 1;
  return digits;
}
