// A figure of lines over an axis, with its legend: name, value at the cursor, and statistics of each line.

import { free, h, setText } from "./dom.js";
import { columnSummary, figureData } from "./plot_data.js";
import { figureOptions, lineSwatch, plotHeight } from "./plot_style.js";

const CURSOR_STEP = 2; // pixels a key press moves the cursor
const CURSOR_LEAP = 20; // and with the shift key

/** A figure of a group of `layoutOf`. `zoomed` is called after a drag, `whole` after a double click. */
export class PlotFigure {
  #format;
  #rows = [];

  constructor(group, figure, theme, { format, hidden, zoomed, whole, ...options }) {
    Object.assign(this, { group, figure });
    this.#format = format;
    this.holder = h("div", {
      class: "plot-canvas",
      role: "group",
      tabindex: 0,
      "aria-label": this.#words(),
      on: { keydown: (event) => this.#key(event) },
    });
    this.element = h("figure", { class: "plot-figure" }, this.holder, this.#legend(theme, hidden));
    const settings = figureOptions(group, figure, theme, { ...options, shown: (line) => !hidden.has(line.key) });
    settings.hooks.setCursor = [() => this.#sayValues()];
    settings.hooks.setSelect = [zoomed];
    this.plot = new uPlot(settings, figureData(group, figure), this.holder);
    this.plot.over.addEventListener("dblclick", whole);
    passTouches(this.plot.over);
    this.#summarize();
  }

  /** Draw the present data of the traces; `keep` keeps the range. */
  refresh(keep) {
    this.plot.setData(figureData(this.group, this.figure), !keep);
    if (keep) this.plot.redraw();
    this.#summarize();
  }

  resize(width) {
    this.plot.setSize({ width, height: plotHeight(width) });
  }

  whole() {
    this.plot.setData(this.plot.data, true);
  }

  get range() {
    const { min, max } = this.plot.scales.x;
    return { min, max };
  }

  set range({ min, max }) {
    this.plot.setScale("x", { min, max });
  }

  /** Return whether a range `factor` times as wide would show all data. */
  holdsAll(factor) {
    const { min, max } = this.range;
    const [start, end] = this.#ends();
    return factor * (max - min) >= end - start;
  }

  /** Make the range `factor` times as wide about its middle, and move it by `shift` of its width. */
  zoom(factor, shift) {
    const { min, max } = this.range;
    const [start, end] = this.#ends();
    const width = factor * (max - min);
    const from = (min + max) / 2 + shift * (max - min) - width / 2;
    const low = Math.max(start, Math.min(end - width, from));
    this.range = { min: low, max: low + width };
  }

  destroy() {
    this.plot.destroy();
  }

  #ends() {
    const [axis] = this.plot.data;
    return [axis[0], axis[axis.length - 1]];
  }

  #key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step || event.target !== this.holder) return;
    const { width } = this.plot.over.getBoundingClientRect();
    const from = this.plot.cursor.left >= 0 ? this.plot.cursor.left : width / 2;
    const left = from + step * (event.shiftKey ? CURSOR_LEAP : CURSOR_STEP);
    this.plot.setCursor({ left: Math.min(width, Math.max(0, left)), top: 1 });
    event.preventDefault();
  }

  #words() {
    const { axis } = this.group;
    const titles = [...new Set(this.figure.lines.map((line) => line.trace.title))].join(", ");
    const lines = [...new Set(this.figure.lines.map(({ name, unit }) => (unit ? `${name} in ${unit}` : name)))].join(
      ", ",
    );
    return this.#format.visible(
      `Plot of ${titles}: ${lines} over ${axis.name}${axis.unit ? ` in ${axis.unit}` : ""}. Arrow keys move the cursor; the values stand below.`,
    );
  }

  // The legend

  #legend(theme, hidden) {
    this.at = h("th", { scope: "col", class: "number plot-at" });
    this.#rows = this.figure.lines.map((line, index) => this.#legendRow(line, index, theme, hidden));
    const { traces } = this.group;
    const byTrace = this.#rows.toSorted((a, b) => traces.indexOf(a.line.trace) - traces.indexOf(b.line.trace));
    const heads = ["min", "mean", "max"].map((text) => h("th", { scope: "col", class: "number", text }));
    const head = h(
      "tr",
      {},
      h("th", { scope: "col", text: "Line" }),
      h("th", { scope: "col", text: "Unit" }),
      this.at,
      heads,
    );
    const table = h(
      "table",
      { class: "table" },
      h("thead", {}, head),
      h(
        "tbody",
        {},
        byTrace.map((row) => row.element),
      ),
    );
    return h(
      "div",
      { class: "plot-legend", role: "group", tabindex: 0, "aria-label": "lines and their values" },
      table,
    );
  }

  #legendRow(line, index, theme, hidden) {
    const toggle = () => {
      if (box.checked) hidden.delete(line.key);
      else hidden.add(line.key);
      this.plot.setSeries(index + 1, { show: box.checked });
    };
    const box = h("input", { type: "checkbox", checked: !hidden.has(line.key), on: { change: toggle } });
    const title = this.group.traces.length > 1 ? `${line.trace.title} · ${line.name}` : line.name;
    const label = h("label", { class: "plot-line" }, box, lineSwatch(line, this.figure, theme), free(title));
    const [now, min, mean, max] = ["plot-now", "", "", ""].map((name) => h("td", { class: `number ${name}` }));
    return {
      line,
      now,
      min,
      mean,
      max,
      element: h("tr", {}, h("th", { scope: "row" }, label), free(line.unit, "td"), now, min, mean, max),
    };
  }

  #sayValues() {
    const { idx, idxs } = this.plot?.cursor ?? {};
    const { name, unit } = this.group.axis;
    const here = idx === null || idx === undefined ? null : this.plot.data[0][idx];
    setText(
      this.at,
      here === null ? "at cursor" : this.#format.visible(`at ${name} ${this.#format.quantity(here, unit)}`),
    );
    this.#rows.forEach((row, index) => {
      const value = here === null ? null : this.plot.data[index + 1][idxs?.[index + 1] ?? idx];
      setText(row.now, value === null || value === undefined ? "" : this.#format.number(value));
    });
  }

  #summarize() {
    this.#sayValues();
    for (const { line, min, mean, max } of this.#rows) {
      const summary = columnSummary(line.trace.data[line.column]);
      setText(min, summary ? this.#format.number(summary.min) : "no value");
      setText(max, summary ? this.#format.number(summary.max) : "");
      // The extremes of a thinned series are exact; its mean would be wrong.
      setText(mean, summary && !line.trace.thinned ? this.#format.number(summary.mean) : "");
    }
  }
}

/** Convert touch events to mouse events, as the library handles only the mouse. */
function passTouches(over) {
  const kinds = { touchstart: "mousedown", touchmove: "mousemove", touchend: "mouseup" };
  for (const [kind, mouse] of Object.entries(kinds)) {
    over.addEventListener(
      kind,
      (event) => {
        const { clientX, clientY } = event.changedTouches[0];
        over.dispatchEvent(new MouseEvent(mouse, { bubbles: true, clientX, clientY, button: 0, movementX: 1 }));
      },
      { passive: true },
    );
  }
}
