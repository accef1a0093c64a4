// The style of plots: colours, axes, lines and markers for the plotting library.

import { svg, tickText } from "./chart_helpers.js";

const COLOURS = 8; // --line-1 … in the style sheet
const MARKERS = ["circle", "square", "triangle", "diamond"];
const MARKER_GAP = 90; // pixels between the markers on a line
const MARKER_SIZE = 4;
const WANTED_DASH = [6, 4];
const AXIS_SIZE = 52; // of a vertical axis, beside its label
const LABEL_SIZE = 20;
const END = 12; // free space at the right

/** The present colours of the page, for canvases. */
export function plotTheme(element) {
  const style = getComputedStyle(element);
  const token = (name) => style.getPropertyValue(name).trim();
  const lines = Array.from({ length: COLOURS }, (_, index) => token(`--line-${index + 1}`));
  return {
    dim: token("--dim"),
    rule: token("--rule"),
    page: token("--page"),
    bad: token("--bad"),
    lines,
    font: `12px ${token("--font")}`,
  };
}

/** Call `listener` when the colours change: light and dark, screen and paper. */
export function watchTheme(listener, signal) {
  for (const query of ["(prefers-color-scheme: dark)", "print"])
    matchMedia(query).addEventListener("change", listener, { signal });
}

/** The height of a plot of this width, in pixels. */
export function plotHeight(width) {
  return width < 480 ? 200 : 260;
}

/** The options of the library for a figure of `layoutOf`; `shown(line)` returns whether a line is switched on. */
export function figureOptions(group, figure, theme, { width, sync, shown, limits }) {
  const lowest = group.figures[group.figures.length - 1] === figure;
  const missing = group.twoAxes && figure.scales.length < 2 ? AXIS_SIZE + LABEL_SIZE : 0;
  return {
    width,
    height: plotHeight(width),
    legend: { show: false },
    padding: [8, END + missing, 0, 0],
    cursor: {
      y: false,
      sync: { key: sync, setSeries: false },
      drag: { x: true, y: false, dist: 5 },
      points: { size: 7 },
    },
    scales: { x: { time: false }, ...Object.fromEntries(figure.scales.map((scale) => [scale.key, {}])) },
    axes: [xAxis(group.axis, theme, lowest), ...figure.scales.map((scale, index) => yAxis(scale, index, theme))],
    series: [{}, ...figure.lines.map((line) => lineOptions(line, figure, theme, shown(line)))],
    hooks: {
      drawClear: [(plot) => paintLimits(plot, figure.lines, limits, theme)],
      draw: [(plot) => paintMarkers(plot, figure.lines, theme)],
    },
  };
}

/** A horizontal axis; of stacked plots only the lowest has numbers. */
export function xAxis({ name, unit }, theme, numbers = true) {
  const label = numbers ? (unit ? `${name} (${unit})` : name) : undefined;
  return {
    ...axisLook(theme),
    label,
    size: numbers ? 30 : 8,
    values: numbers ? tickTexts : (_, splits) => splits.map(() => ""),
  };
}

/** A vertical axis, the second one to the right. */
export function yAxis({ key, unit }, index, theme) {
  const look = axisLook(theme);
  return {
    ...look,
    scale: key,
    side: index ? 1 : 3,
    label: unit || "no unit",
    size: AXIS_SIZE,
    grid: { ...look.grid, show: index === 0 },
    values: tickTexts,
  };
}

function axisLook(theme) {
  return {
    stroke: theme.dim,
    font: theme.font,
    labelFont: theme.font,
    labelSize: LABEL_SIZE,
    labelGap: 2,
    gap: 4,
    grid: { stroke: theme.rule, width: 1 },
    ticks: { stroke: theme.rule, width: 1, size: 4 },
  };
}

function tickTexts(_, splits) {
  return splits.map((value) => tickText(value, splits[1] - splits[0]));
}

function lineOptions(line, figure, theme, show) {
  return {
    label: line.name,
    scale: line.scale,
    show,
    stroke: lineColour(line, figure, theme),
    width: line.wanted ? 1.25 : 1.5,
    dash: line.wanted ? WANTED_DASH : undefined,
    points: { show: false },
  };
}

/** Setpoints are grey, unless there are those of several series. */
function lineColour(line, { lines }, theme) {
  const wanted = new Set(lines.filter((one) => one.wanted).map((one) => one.trace));
  return line.wanted && wanted.size < 2 ? theme.dim : theme.lines[line.colour % COLOURS];
}

/** The marker of a line, so that lines differ without colour; none for a single line. */
function markerOf(line, lines) {
  return line.wanted || lines.filter((one) => !one.wanted).length < 2 ? null : MARKERS[line.colour % MARKERS.length];
}

function paintMarkers(plot, lines, theme) {
  plot.ctx.setLineDash([]);
  plot.ctx.lineWidth = 1.5 * devicePixelRatio;
  plot.ctx.fillStyle = theme.page;
  lines.forEach((line, index) => {
    const marker = markerOf(line, lines);
    if (!marker || !plot.series[index + 1].show) return;
    plot.ctx.strokeStyle = theme.lines[line.colour % COLOURS];
    const first = (MARKER_GAP * (1 + line.colour)) / (lines.length + 1);
    for (let x = first; x * devicePixelRatio < plot.bbox.width; x += MARKER_GAP)
      paintMarker(plot, marker, index + 1, line.scale, x);
  });
}

function paintMarker(plot, marker, series, scale, x) {
  const column = plot.data[series];
  const row = nextKnown(column, plot.posToIdx(x));
  if (column[row] === null || column[row] === undefined) return;
  const at = [plot.valToPos(plot.data[0][row], "x", true), plot.valToPos(column[row], scale, true)];
  if (at[0] < plot.bbox.left || at[0] > plot.bbox.left + plot.bbox.width) return;
  const shape = new Path2D(markerShape(marker, ...at, MARKER_SIZE * devicePixelRatio));
  plot.ctx.fill(shape);
  plot.ctx.stroke(shape);
}

/** Return the first row, from a row of joined series on, with a sample of this one. */
function nextKnown(column, row) {
  let next = row;
  while (next < column.length && column[next] === undefined) next += 1;
  return next;
}

/** The outline of a marker about a point, as an SVG path. */
export function markerShape(marker, x, y, size) {
  if (marker === "square") return `M${x - size * 0.85} ${y - size * 0.85}h${size * 1.7}v${size * 1.7}h${-size * 1.7}Z`;
  if (marker === "triangle") return `M${x} ${y - size * 1.1}L${x + size * 1.1} ${y + size * 0.85}H${x - size * 1.1}Z`;
  if (marker === "diamond")
    return `M${x} ${y - size * 1.2}L${x + size * 1.2} ${y}L${x} ${y + size * 1.2}L${x - size * 1.2} ${y}Z`;
  if (marker === "cross")
    return `M${x - size} ${y - size}L${x + size} ${y + size}M${x + size} ${y - size}L${x - size} ${y + size}`;
  return `M${x - size} ${y}a${size} ${size} 0 1 0 ${2 * size} 0a${size} ${size} 0 1 0 ${-2 * size} 0Z`;
}

function paintLimits(plot, lines, limits, theme) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = theme.bad;
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
  lines.forEach((line, index) => {
    const { min, max } = plot.scales[line.scale];
    for (const limit of limits[index]) {
      if (!(limit >= min && limit <= max)) continue;
      ctx.stroke(new Path2D(`M${bbox.left} ${plot.valToPos(limit, line.scale, true)}h${bbox.width}`));
    }
  });
  ctx.restore();
}

/** A sample of a line for the legend. */
export function lineSwatch(line, figure, theme) {
  const marker = markerOf(line, figure.lines);
  const stroke = lineColour(line, figure, theme);
  return svg(
    "svg",
    { class: "plot-swatch", width: 28, height: 12, viewBox: "0 0 28 12", "aria-hidden": "true" },
    svg("path", {
      d: "M0 6H28",
      stroke,
      "stroke-width": 2,
      "stroke-dasharray": line.wanted ? WANTED_DASH.join(" ") : null,
    }),
    marker &&
      svg("path", { d: markerShape(marker, 14, 6, MARKER_SIZE), fill: theme.page, stroke, "stroke-width": 1.5 }),
  );
}
