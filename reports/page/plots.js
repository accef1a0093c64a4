// Series as plots: those with the same axis in one plot, with the values at the cursor below.
//
// Chooses and loads series, updates live ones, and offers the values as a table and as a file. uPlot draws, with the
// options of plot_style.js.

import { fill, free, h, setText } from "./dom.js";
import { csvText, saveText, watchWidth } from "./chart_helpers.js";
import { columnTitles, joinTraces, layoutOf, limitsOf, rowsOf, tracesOf } from "./plot_data.js";
import { PlotFigure } from "./plot_figure.js";
import { plotTheme, watchTheme } from "./plot_style.js";

const ZOOM = 0.5;
const TABLE_ROWS = 1000;
const SHOWN_FIRST = 8; // number of series that are shown before the user's choice

let panels = 0;

/** Plots of series of one test: `series_recorded` records, and growing entries of `attempt.live`. Series of `subject`
 * are chosen first if there are several; `measurements` may have limits of a column.
 */
export class PlotPanel {
  #page;
  #subject;
  #measurements;
  #traces = [];
  #chosen = null; // keys of the user's choice
  #hidden = new Set(); // keys of lines that were switched off
  #groups = [];
  #figures = [];
  #built = []; // the traces that the figures show
  #ended = false;
  #zoomed = false;
  #frame = 0;
  #width = 0;
  #name = `plot-${(panels += 1)}`;

  constructor(page, { series = [], subject = "", measurements = [] } = {}) {
    this.#page = page;
    this.#subject = subject;
    this.#measurements = measurements;
    this.title = h("h4", { class: "plot-title" });
    this.choice = h("fieldset", { class: "plot-choice" });
    this.status = h("p", { class: "plot-status dim", role: "status" });
    this.area = h("div", { class: "plot-area" });
    this.tools = this.#toolbar();
    this.values = h("div", { class: "plot-table", role: "group", "aria-label": "values of the plot", tabindex: 0 });
    this.table = h(
      "details",
      { class: "plot-details", on: { toggle: () => this.#fillTable() } },
      h("summary", { text: "Show as table" }),
      this.values,
    );
    this.element = h(
      "div",
      { class: "plot-panel", on: { keydown: (event) => this.#key(event) } },
      this.title,
      this.choice,
      this.status,
      this.area,
      this.tools,
      this.table,
    );
    this.observer = watchWidth(this.area, (width) => this.#resize(width));
    this.leaving = new AbortController();
    watchTheme(() => this.#restyle(), this.leaving.signal);
    this.show(series);
  }

  /** Show these series; may be called after any change. */
  show(series) {
    const before = this.#traces;
    this.#traces = tracesOf(series, before);
    const ended = this.#testEnded();
    if (ended !== this.#ended || !sameList(this.#traces, before)) {
      this.#ended = ended;
      this.#fillChoice();
    }
    this.element.hidden = this.#traces.length === 0;
    this.update();
  }

  /** Draw changes with the next frame. */
  update() {
    this.#frame ||= requestAnimationFrame(() => {
      this.#frame = 0;
      this.#draw();
    });
  }

  /** Release all resources; the panel cannot be used any more. */
  destroy() {
    cancelAnimationFrame(this.#frame);
    this.observer.disconnect();
    this.leaving.abort();
    this.#clear();
    this.element.remove();
  }

  // Choosing

  #selected() {
    const chosen = this.#chosen ?? this.#firstChoice();
    return this.#traces.filter((trace) => chosen.has(trace.key));
  }

  /** Return the series of the subject; if there are none, live ones and the first of the others. */
  #firstChoice() {
    const ofSubject = this.#traces.filter((trace) => this.#subject && trace.record.subject === this.#subject);
    const first = ofSubject.length ? ofSubject : this.#traces.toSorted((a, b) => Number(b.isLive) - Number(a.isLive));
    return new Set(first.slice(0, SHOWN_FIRST).map((trace) => trace.key));
  }

  #fillChoice() {
    const [only, ...others] = this.#traces;
    this.title.hidden = !only || others.length > 0;
    this.choice.hidden = others.length === 0;
    const live = (trace) =>
      trace.isLive &&
      h("span", { class: "plot-live", text: this.#ended ? "preview; the series was not kept" : "live" });
    if (others.length === 0) {
      if (only) fill(this.title, free(only.title), live(only));
      return;
    }
    const chosen = new Set(this.#selected());
    const boxes = this.#traces.map((trace) => {
      const box = h("input", {
        type: "checkbox",
        checked: chosen.has(trace),
        on: { change: () => this.#choose(trace.key, box.checked) },
      });
      return h("label", { class: "plot-chip" }, box, free(trace.title), live(trace));
    });
    const all = h("button", { type: "button", text: "all", on: { click: () => this.#chooseAll(true) } });
    const none = h("button", { type: "button", text: "none", on: { click: () => this.#chooseAll(false) } });
    fill(this.choice, h("legend", { text: "Series" }), boxes, all, none);
  }

  /** Return whether the attempt is over; live series are not recorded any more then. */
  #testEnded() {
    const test = this.#page.model.tests.get(this.#traces[0]?.record.test);
    return test !== undefined && !test.running;
  }

  #choose(key, on) {
    this.#chosen ??= this.#firstChoice();
    if (on) this.#chosen.add(key);
    else this.#chosen.delete(key);
    this.update();
  }

  #chooseAll(on) {
    this.#chosen = new Set(on ? this.#traces.map((trace) => trace.key) : []);
    for (const box of this.choice.querySelectorAll("input")) box.checked = on;
    this.update();
  }

  // Loading

  #load(trace) {
    if (trace.isLive) trace.takeLive();
    else if (trace.state === "new") this.#fetch(trace);
  }

  async #fetch(trace) {
    trace.state = "loading";
    try {
      trace.take(await this.#page.source.series(trace.record.path));
    } catch (error) {
      trace.fail(error.message);
    }
    if (!this.leaving.signal.aborted) this.update();
  }

  #sayState(selected) {
    const loading = selected.filter((trace) => trace.state === "loading").map((trace) => trace.title);
    const lines = selected.map((trace) => trace.remark).filter(Boolean);
    if (loading.length) lines.unshift(`loading ${loading.join(", ")} …`);
    if (selected.length === 0 && this.#traces.length) lines.push("no series is chosen");
    setText(this.status, this.#page.format.visible(lines.join("; ")));
    this.status.hidden = lines.length === 0;
  }

  // Drawing

  #draw() {
    const selected = this.#selected();
    for (const trace of selected) this.#load(trace);
    this.#sayState(selected);
    const ready = selected.filter((trace) => trace.data?.[0].length);
    if (this.#width === 0) return;
    if (!sameList(ready, this.#built)) this.#build(ready);
    else if (ready.some((trace) => trace.changed)) this.#refresh();
    for (const trace of ready) trace.changed = false;
    this.tools.hidden = this.table.hidden = ready.length === 0;
  }

  #build(ready) {
    const ranges = this.#zoomed ? new Map(this.#figures.map((one) => [one.group.axis.name, one.range])) : new Map();
    this.#clear();
    const theme = plotTheme(this.element);
    this.#groups = layoutOf(ready);
    for (const [index, group] of this.#groups.entries()) {
      joinTraces(group);
      for (const figure of group.figures)
        this.#figures.push(this.#figure(group, figure, theme, `${this.#name}-${index}`));
    }
    fill(
      this.area,
      this.#figures.map((one) => one.element),
    );
    for (const one of this.#figures) if (ranges.has(one.group.axis.name)) one.range = ranges.get(one.group.axis.name);
    this.#built = ready;
    this.#setZoomed(ranges.size > 0);
    this.#fillTable();
  }

  #figure(group, figure, theme, sync) {
    return new PlotFigure(group, figure, theme, {
      width: this.#width,
      sync,
      limits: figure.lines.map((line) => limitsOf(line, this.#measurements)),
      format: this.#page.format,
      hidden: this.#hidden,
      zoomed: () => this.#setZoomed(true),
      whole: () => this.#whole(),
    });
  }

  /** Update the data of the same lines; a zoomed range is kept. */
  #refresh() {
    for (const group of this.#groups) joinTraces(group);
    for (const one of this.#figures) one.refresh(this.#zoomed);
    this.#fillTable();
  }

  /** Redraw with other colours, at once, as printing waits for no frame. */
  #restyle() {
    this.#width = this.area.clientWidth || this.#width;
    this.#built = [];
    this.#draw();
  }

  #resize(width) {
    this.#width = width;
    for (const one of this.#figures) one.resize(width);
    this.update();
  }

  #clear() {
    for (const one of this.#figures) one.destroy();
    this.#figures = [];
  }

  // Zoom

  #toolbar() {
    const button = (text, title, action) =>
      h("button", { type: "button", "aria-label": `${text} ${title}`, title, text, on: { click: action } });
    this.reset = button("whole", "plot, as at first", () => this.#whole());
    return h(
      "div",
      { class: "plot-tools", role: "toolbar", "aria-label": "plot" },
      button("+", "look closer", () => this.#zoom(ZOOM, 0)),
      button("−", "look from further away", () => this.#zoom(1 / ZOOM, 0)),
      button("←", "move to the left", () => this.#zoom(1, -ZOOM)),
      button("→", "move to the right", () => this.#zoom(1, ZOOM)),
      this.reset,
      button("save CSV", "with the values of the chosen series", () => this.#save()),
    );
  }

  #setZoomed(on) {
    this.#zoomed = on;
    this.reset.disabled = !on;
  }

  #whole() {
    this.#setZoomed(false);
    for (const one of this.#figures) one.whole();
  }

  #zoom(factor, shift) {
    if (this.#figures.every((one) => one.holdsAll(factor))) {
      this.#whole();
      return;
    }
    this.#setZoomed(true);
    for (const one of this.#figures) if (!one.holdsAll(factor)) one.zoom(factor, shift);
  }

  #key(event) {
    if (event.key !== "Escape" || !this.#zoomed) return;
    this.#whole();
    event.stopPropagation();
  }

  // Values

  #fillTable() {
    if (this.table.open)
      fill(
        this.values,
        this.#groups.map((group) => valueTable(group, this.#page.format)),
      );
  }

  #save() {
    for (const group of this.#groups) {
      const name = [group.traces[0].record.test, ...new Set(group.traces.map((trace) => trace.record.name))].join("_");
      saveText(`${name}.csv`, csvText([columnTitles(group), ...rowsOf(group, Infinity)]));
    }
  }
}

function sameList(one, other) {
  return one.length === other.length && one.every((item, index) => item === other[index]);
}

function valueTable(group, format) {
  const count = group.joined[0].length;
  const caption = count > TABLE_ROWS ? `the first ${TABLE_ROWS} of ${count} rows` : `${count} rows`;
  const cell = (value) => h("td", { class: "number", text: value === null ? "" : format.number(value) });
  const head = h(
    "tr",
    {},
    columnTitles(group).map((text) => h("th", { scope: "col", class: "number" }, free(text))),
  );
  const body = rowsOf(group, TABLE_ROWS).map((row) => h("tr", {}, row.map(cell)));
  return h("table", { class: "table" }, h("caption", { text: caption }), h("thead", {}, head), h("tbody", {}, body));
}
