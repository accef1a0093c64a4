// The links between boxes, drawn on a canvas: a thousand curves in SVG take too long in each frame.

import { portPlace } from "./apps_model.js";

const REACH = 40; // how far a curve goes straight at least
const NEAR = 8; // pixels from a curve in which it is meant
const STEPS = 60;
// Styles with their colours and widths in pixels of the screen. A line of at most one pixel is drawn many times as fast
// as a wider one, so only what is selected is wider.
const STYLES = [["idle", "--idle", 0.99], ["warning", "--warn", 0.99], ["error", "--bad", 0.99], ["good", "--good", 0.99], ["selected", "--accent", 3]];

export class LinkLayer {
  #links = [];
  #styles = new Map(); // name of a link -> its style
  draft = null; // {from, to} of a link that is being made

  constructor() {
    this.element = document.createElement("canvas");
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(this.view));
  }

  set links(links) {
    this.#links = links;
  }

  /** Set the styles of all links, and return whether any differs. */
  mark({ tones, problems, selected }) {
    const before = this.#styles;
    this.#styles = new Map(this.#links.map(({ name }) => [name, selected.has(name) ? "selected" : tones.get(name) === "good" ? "good" : problems.get(name) ?? "idle"]));
    return before.size !== this.#styles.size || [...this.#styles].some(([name, style]) => before.get(name) !== style);
  }

  /** Draw all, as it is seen by `view`, {x, y, scale}. */
  draw(view) {
    this.view = view;
    const { element } = this;
    const [width, height, ratio] = [element.clientWidth, element.clientHeight, devicePixelRatio];
    if (!width || !view) return;
    if (element.width !== Math.round(width * ratio) || element.height !== Math.round(height * ratio)) [element.width, element.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const context = element.getContext("2d");
    const colours = getComputedStyle(element);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, element.width, element.height);
    context.setTransform(view.scale * ratio, 0, 0, view.scale * ratio, view.x * ratio, view.y * ratio);
    const seen = { left: -view.x / view.scale, top: -view.y / view.scale, right: (width - view.x) / view.scale, bottom: (height - view.y) / view.scale };
    for (const [style, colour, line] of STYLES) {
      context.strokeStyle = colours.getPropertyValue(colour);
      context.lineWidth = line / (view.scale * ratio);
      context.beginPath();
      for (const link of this.#links) if ((this.#styles.get(link.name) ?? "idle") === style) trace(context, ends(link), seen);
      if (style === "selected" && this.draft) trace(context, this.draft, seen);
      context.stroke();
    }
  }

  /** The link that is near a place in the graph, or nothing. */
  near(spot, scale) {
    let best = null;
    let least = NEAR / scale;
    for (const link of this.#links) {
      const distance = distanceTo(spot, ends(link), least);
      if (distance < least) [best, least] = [link, distance];
    }
    return best;
  }
}

function ends({ from, to, source, target }) {
  return { from: portPlace(from, source), to: portPlace(to, target) };
}

function reachOf({ from, to }) {
  return Math.max(REACH, Math.abs(to.x - from.x) / 2);
}

function trace(context, link, seen) {
  const { from, to } = link;
  const reach = reachOf(link);
  if (Math.max(from.x, to.x) + reach < seen.left || Math.min(from.x, to.x) - reach > seen.right || Math.max(from.y, to.y) < seen.top || Math.min(from.y, to.y) > seen.bottom) return;
  context.moveTo(from.x, from.y);
  context.bezierCurveTo(from.x + reach, from.y, to.x - reach, to.y, to.x, to.y);
}

/** The distance of a place from a curve; infinite if it is clearly more than `enough`. */
function distanceTo(spot, link, enough) {
  const { from, to } = link;
  const reach = reachOf(link);
  if (spot.x < Math.min(from.x, to.x) - reach || spot.x > Math.max(from.x, to.x) + reach || spot.y < Math.min(from.y, to.y) - enough || spot.y > Math.max(from.y, to.y) + enough) return Infinity;
  let least = Infinity;
  for (let step = 0; step <= STEPS; step += 1) {
    const t = step / STEPS;
    const u = 1 - t;
    const [a, b, c, d] = [u * u * u, 3 * u * u * t, 3 * u * t * t, t * t * t];
    const x = a * from.x + b * (from.x + reach) + c * (to.x - reach) + d * to.x;
    const y = (a + b) * from.y + (c + d) * to.y;
    least = Math.min(least, Math.hypot(spot.x - x, spot.y - y));
  }
  return least;
}
