// A measurement over the last runs, with its limits and the verdict of each run; each robot is a line of its own.

import { fill, free, h, setText } from "./dom.js";
import { svg, watchWidth } from "./chart_helpers.js";
import { markerShape, plotTheme, watchTheme, xAxis, yAxis } from "./plot_style.js";
import { badge } from "./state_signs.js";

const TREND_HEIGHT = 240;
const LINE_COLOURS = 8; // of the style sheet
const ROBOT_MARKS = ["circle", "square"];
const TREND_MARKS = { failed: "diamond", marginal: "triangle" };

/** The plot of a row of the trends; `destroy` frees it. */
export class TrendPlot {
  #row;
  #runs;
  #page;
  #plot = null;

  constructor(page, row, runs) {
    this.#page = page;
    this.#row = row;
    this.#runs = runs;
    this.robots = [...new Set(row.points.map((point) => robotOf(runs[point.run])))];
    this.legend = h("ul", { class: "trend-legend", "aria-label": "robots", hidden: this.robots.length < 2 });
    this.holder = h("div", { class: "plot-canvas", role: "img", "aria-label": this.#words() });
    this.said = h("p", { class: "trend-said dim", text: "Point at a run to see which it was." });
    this.table = h("details", { on: { toggle: () => this.#fillTable() } }, h("summary", { text: "Show as table" }));
    this.element = h("div", { class: "trend-plot" }, this.holder, this.legend, this.said, this.table);
    this.leaving = new AbortController();
    watchTheme(() => this.#draw(this.width), this.leaving.signal);
    this.observer = watchWidth(this.holder, (width) => this.#draw(width));
  }

  destroy() {
    this.observer.disconnect();
    this.leaving.abort();
    this.#plot?.destroy();
    this.element.remove();
  }

  #words() {
    const { format } = this.#page;
    const values = this.#row.points.map((point) => point.value).filter(Number.isFinite);
    const ends = [Math.min(...values), Math.max(...values)].map((value) => format.quantity(value, this.#row.unit));
    const range = values.length ? `from ${ends.join(" to ")}` : "no values";
    const robots = this.robots.length > 1 ? ` of ${this.robots.length} robots` : "";
    return format.visible(`${this.#row.title} over ${this.#runs.length} runs${robots}: ${range}`);
  }

  #draw(width) {
    this.width = width;
    this.#plot?.destroy();
    const theme = plotTheme(this.element);
    const { points, unit } = this.#row;
    const line = { spanGaps: true, points: { show: false } };
    const limit = { ...line, stroke: theme.bad, width: 1, dash: [4, 3] };
    const column = (key, robot) =>
      points.map((point) => (Number.isFinite(point[key]) && (robot === undefined || this.#isOf(point, robot)) ? point[key] : null));
    const data = [
      points.map((point) => point.run),
      column("low"),
      column("high"),
      ...this.robots.map((robot) => column("value", robot)),
    ];
    const options = {
      width,
      height: TREND_HEIGHT,
      legend: { show: false },
      padding: [8, 12, 0, 0],
      cursor: { y: false, drag: { x: false, y: false }, points: { size: (_, series) => (series > 2 ? 9 : 0) } },
      scales: {
        x: { time: false, range: [-0.5, this.#runs.length - 0.5] },
        y: { range: (_, min, max) => padded(min, max) },
      },
      axes: [
        {
          ...xAxis({ name: "run", unit: "" }, theme),
          incrs: [1, 2, 5, 10],
          values: (_, splits) => splits.map((run) => this.#date(run)),
          space: 90,
        },
        yAxis({ key: "y", unit }, 0, theme),
      ],
      series: [{}, limit, limit, ...this.robots.map((robot) => ({ ...line, stroke: this.#colour(robot, theme), width: 1.5 }))],
      hooks: { setCursor: [(plot) => this.#say(plot.cursor.idx)], draw: [(plot) => this.#paintPoints(plot, theme)] },
    };
    this.#plot = new uPlot(options, data, this.holder);
    fill(this.legend, this.robots.map((robot) => this.#key(robot, theme)));
  }

  #key(robot, theme) {
    const colour = this.#colour(robot, theme);
    const mark = svg("path", { d: markerShape(this.#mark(robot), 7, 7, 4), fill: theme.page, stroke: colour, "stroke-width": 1.5 });
    return h("li", {}, svg("svg", { width: 14, height: 14, "aria-hidden": "true" }, mark), free(robot));
  }

  #isOf(point, robot) {
    return robotOf(this.#runs[point.run]) === robot;
  }

  #colour(robot, theme) {
    return theme.lines[this.robots.indexOf(robot) % theme.lines.length];
  }

  /** The marker of a robot: more robots than colours have other markers. */
  #mark(robot) {
    return ROBOT_MARKS[Math.floor(this.robots.indexOf(robot) / LINE_COLOURS) % ROBOT_MARKS.length];
  }

  #date(run) {
    const started = this.#runs[run]?.started;
    return started ? new Date(started * 1000).toLocaleDateString(undefined, { day: "numeric", month: "short" }) : "";
  }

  #paintPoints(plot, theme) {
    const { ctx } = plot;
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([]);
    for (const point of this.#row.points) {
      if (!Number.isFinite(point.value)) continue;
      const robot = robotOf(this.#runs[point.run]);
      const at = [plot.valToPos(point.run, "x", true), plot.valToPos(point.value, "y", true)];
      const shape = new Path2D(
        markerShape(
          TREND_MARKS[point.verdict] ?? this.#mark(robot),
          ...at,
          (point.verdict === "failed" ? 5 : 3.5) * devicePixelRatio,
        ),
      );
      ctx.fillStyle = point.verdict === "failed" ? theme.bad : theme.page;
      ctx.strokeStyle = point.verdict === "failed" ? theme.bad : this.#colour(robot, theme);
      ctx.fill(shape);
      ctx.stroke(shape);
    }
  }

  #say(index) {
    const point = this.#row.points[index];
    if (!point) return;
    setText(this.said, this.#page.format.visible(this.#facts(point)));
  }

  #facts(point) {
    const { format } = this.#page;
    const run = this.#runs[point.run] ?? {};
    const value = point.value === null ? "no number" : format.quantity(point.value, this.#row.unit);
    return [
      `${run.run ?? ""}: ${value}, ${point.verdict}`,
      this.robots.length > 1 && robotOf(run),
      format.limits(point.low, point.high, this.#row.unit),
      run.started && format.date(run.started),
      run.version && `RTF ${run.version}`,
    ]
      .filter(Boolean)
      .join("; ");
  }

  #fillTable() {
    if (!this.table.open || this.table.childElementCount > 1) return;
    const { format } = this.#page;
    const row = (point) => {
      const run = this.#runs[point.run] ?? {};
      return h(
        "tr",
        {},
        h("th", { scope: "row" }, free(run.run ?? "")),
        h("td", { text: run.started ? format.date(run.started) : "" }),
        h("td", { class: "number", text: point.value === null ? "" : format.number(point.value) }),
        h("td", {}, badge(point.verdict)),
        h("td", { text: format.limits(point.low, point.high, this.#row.unit) }),
      );
    };
    const head = h(
      "tr",
      {},
      ["Run", "Started", "Value", "Verdict", "Limits"].map((text) => h("th", { scope: "col", text })),
    );
    const region = h("div", { class: "plot-table", role: "group", tabindex: 0, "aria-label": "values of the runs" });
    fill(region, h("table", { class: "table" }, h("thead", {}, head), h("tbody", {}, this.#row.points.map(row))));
    this.table.append(region);
  }
}

/** The name of the robot of a run, and where there are several of one name its station. */
function robotOf(run) {
  return [run?.robot, run?.station].filter(Boolean).join(" on ");
}

function padded(min, max) {
  const pad = (max - min) * 0.1 || Math.abs(max) * 0.1 || 1;
  return [min - pad, max + pad];
}
