// Data of plots of recorded and live series: the columns of each plot, their scales, and statistics.
//
// Independent of the document; uses the plotting library only to join columns.

import { number } from "./model.js";

/** Columns of setpoints, which are drawn dashed and dim behind the measured ones. */
const WANTED = /(^|[^a-z])(references?|ref|command(ed)?|target|set ?point|desired|demand(ed)?|expected)([^a-z]|$)/i;
/** Columns of differences, which are small compared with their terms, so they get a plot of their own. */
const DIFFERENCE = /(^|[^a-z])(errors?|deviation|residuals?|difference)([^a-z]|$)/i;
/** The prefix of a unit in the name of a scale, so that a unit such as `x` is no name of the library. */
const SHARED = "shared ";
const APART = "apart  ";

/** The data of loaded series, by record: a second panel of a test, such as the printed one, has them at once. */
const READ = new WeakMap();

/** A series: recorded, with a `path`, or `live`, an entry of `attempt.live`. */
export class Trace {
  constructor(key, record, live, before) {
    this.key = key; // the same for a live series and the recorded one that follows it
    this.record = record;
    this.live = live;
    this.columns = (live ?? record).columns;
    this.state = "new"; // loading, ready, failed
    this.data = before?.live ? before.data : null; // clean columns of one length; of the live one until it is loaded
    this.changed = false; // since the last drawing
    this.thinned = false;
    this.remark = ""; // a note for the user
    if (READ.has(record)) this.take(READ.get(record));
  }

  get isLive() {
    return this.live !== null;
  }

  get title() {
    return [this.record.subject, this.record.name].filter(Boolean).join(" · ");
  }

  /** Series with the same axis go into one plot. */
  get axis() {
    return `${this.columns[0].name}\n${this.columns[0].unit ?? ""}`;
  }

  /** Add the new samples; the model appends to its arrays. */
  takeLive() {
    const { samples } = this.live;
    if (samples[0].length === this.taken) return;
    this.taken = samples[0].length;
    this.#put(samples.map((column) => column.slice()));
  }

  /** Set the data of a recorded series: {columns, thinned}. */
  take(series) {
    const { columns, thinned } = series;
    READ.set(this.record, series);
    if (columns.length !== this.columns.length) {
      this.fail(`${columns.length} columns where ${this.columns.length} were announced`);
      return;
    }
    this.thinned = thinned;
    this.#put(columns);
    if (thinned)
      this.remark = `${this.title}: ${this.data[0].length} of ${this.record.rows} rows, chosen so that no peak is lost`;
  }

  fail(reason) {
    this.state = "failed";
    this.remark = `${this.title} cannot be shown: ${reason}`;
  }

  #put(columns) {
    this.data = cleanColumns(columns);
    this.state = "ready";
    this.changed = true;
    this.remark = this.data[0].length ? "" : `${this.title} has no values`;
  }
}

/** The traces of `entries` (series_recorded records and live entries), keeping those of `before` that are the same. */
export function tracesOf(entries, before) {
  const seen = new Map();
  return entries.map((entry) => {
    const live = entry.samples ? entry : null;
    const record = live ? live.record : entry;
    const name = `${record.subject ?? ""}\n${record.name}`;
    const count = (seen.get(name) ?? 0) + 1;
    seen.set(name, count);
    const key = `${name}\n${count}`;
    const known = before.find((one) => one.key === key);
    return known && known.live === live && known.record.path === record.path
      ? known
      : new Trace(key, record, live, known);
  });
}

/** Return columns of equal length, by ascending axis, with null for numbers that are not finite (drawn as gaps). */
export function cleanColumns(columns) {
  const rows = Math.min(...columns.map((column) => column.length));
  const axis = columns[0];
  let order = null;
  for (let row = 0; row < rows; row += 1) {
    if (!Number.isFinite(axis[row]) || (row && axis[row] < axis[row - 1])) {
      order = Array.from({ length: rows }, (_, index) => index).filter((index) => Number.isFinite(axis[index]));
      order.sort((a, b) => axis[a] - axis[b]);
      break;
    }
  }
  return columns.map((column) => {
    const part = order ? order.map((row) => column[row]) : column.length === rows ? column : column.slice(0, rows);
    return part.every(Number.isFinite) ? part : Array.from(part, (value) => (Number.isFinite(value) ? value : null));
  });
}

/**
 * The lines of these traces, in plots: a group for each axis, {axis: {name, unit}, traces, twoAxes, figures: [{scales:
 * [{key, unit}], lines}]}. A line is {key, trace, column, name, unit, wanted, scale, colour}: colour counts from 0, and a
 * wanted line has that of its trace's first measured one. A figure has at most two scales.
 */
export function layoutOf(traces) {
  const groups = new Map();
  for (const trace of traces) {
    if (!groups.has(trace.axis)) groups.set(trace.axis, []);
    groups.get(trace.axis).push(trace);
  }
  return [...groups.values()].map((members) => {
    const [{ name, unit = "" }] = members[0].columns;
    const figures = figuresOf(members.flatMap(linesOf));
    return {
      axis: { name, unit },
      traces: members,
      twoAxes: figures.some((figure) => figure.scales.length > 1),
      figures,
    };
  });
}

function linesOf(trace) {
  return trace.columns.slice(1).map(({ name, unit = "" }, index) => {
    const difference = DIFFERENCE.test(name);
    return {
      key: `${trace.key}\n${index}`,
      trace,
      column: index + 1,
      name,
      unit,
      wanted: WANTED.test(name) && !difference,
      scale: `${difference ? APART : SHARED}${unit}`,
    };
  });
}

function figuresOf(lines) {
  const scales = [...new Set(lines.map((line) => line.scale))];
  const figures = [];
  for (const key of scales) {
    const last = figures[figures.length - 1];
    const pairs = last?.scales.length === 1 && key.startsWith(SHARED) && last.scales[0].key.startsWith(SHARED);
    const scale = { key, unit: key.slice(SHARED.length) };
    if (pairs) last.scales.push(scale);
    else figures.push({ scales: [scale] });
  }
  for (const figure of figures) {
    figure.lines = lines.filter((line) => figure.scales.some((scale) => scale.key === line.scale));
    colour(figure.lines);
    figure.lines.sort((a, b) => Number(b.wanted) - Number(a.wanted));
  }
  return figures;
}

function colour(lines) {
  let next = 0;
  for (const line of lines) if (!line.wanted) line.colour = next++;
  for (const line of lines) {
    if (line.wanted) line.colour = lines.find((other) => !other.wanted && other.trace === line.trace)?.colour ?? next++;
  }
}

/** Join all columns of a group on one axis, as `joined` of the group, with the first column of each trace. Series that
 * were sampled at other times have gaps in it (undefined, across which lines are drawn).
 */
export function joinTraces(group) {
  const tables = group.traces.map((trace) => trace.data);
  group.joined = tables.length > 1 ? uPlot.join(tables) : tables[0];
  group.starts = new Map();
  let column = 1;
  for (const trace of group.traces) {
    group.starts.set(trace, column);
    column += trace.columns.length - 1;
  }
}

/** The joined columns that a figure draws, the axis first. */
export function figureData({ joined, starts }, figure) {
  return [joined[0], ...figure.lines.map((line) => joined[starts.get(line.trace) + line.column - 1])];
}

/** The heads of the joined columns. */
export function columnTitles({ axis, traces }) {
  const withUnit = ({ name, unit }) => (unit ? `${name} (${unit})` : name);
  const prefix = (trace) => (traces.length > 1 ? `${trace.title} · ` : "");
  return [
    withUnit(axis),
    ...traces.flatMap((trace) => trace.columns.slice(1).map((column) => prefix(trace) + withUnit(column))),
  ];
}

/** The first rows of the joined columns; null where a series has no value. */
export function rowsOf({ joined }, limit) {
  return Array.from({ length: Math.min(limit, joined[0].length) }, (_, row) =>
    joined.map((column) => column[row] ?? null),
  );
}

/** Statistics of a column without its gaps: {min, max, mean}, or null if it is empty. */
export function columnSummary(column) {
  let [count, sum, min, max] = [0, 0, Infinity, -Infinity];
  for (const value of column) {
    if (value === null) continue;
    count += 1;
    sum += value;
    if (value < min) min = value;
    if (value > max) max = value;
  }
  if (count === 0) return null;
  const mean = sum / count;
  const noise = 1e-12 * (max - min); // rounding errors of a sum
  return { min, max, mean: Math.abs(mean) < noise ? 0 : mean };
}

/** The limits of a line by measurements of its subject with its name and unit. */
export function limitsOf(line, measurements) {
  const subject = line.trace.record.subject ?? "";
  const found = measurements.findLast(
    (one) => one.name === line.name && (one.unit ?? "") === line.unit && (one.subject ?? "") === subject,
  );
  return [found?.low, found?.high]
    .filter((limit) => limit !== undefined && limit !== null)
    .map(number)
    .filter(Number.isFinite);
}
