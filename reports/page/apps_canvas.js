// The drawing of an application: boxes with ports as SVG above a canvas with the links. It knows no mouse and no keys.

import { BOX } from "./apps_model.js";
import { LinkLayer } from "./apps_links.js";
import { visible } from "./format.js";
import { h } from "./dom.js";

const SPACE = "http://www.w3.org/2000/svg";
const LONGEST = 24; // characters of a title or of a port in a box
const FAR = 0.45; // scale below which the names of ports are left out
const SCALES = { least: 0.05, most: 2 };
const MARGIN = 30;

function s(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SPACE, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function text(x, y, content, attributes = {}, most = LONGEST) {
  const whole = visible(String(content));
  const element = s("text", { x, y, ...attributes });
  element.textContent = whole.length > most ? `${whole.slice(0, most - 1)}…` : whole;
  return element;
}

function title(content) {
  const element = s("title");
  element.textContent = visible(content);
  return element;
}

export class AppCanvas {
  #boxes = new Map(); // key -> {element, signature}
  #model = { boxes: [], links: [], byKey: new Map() };
  #frame = 0;
  view = { x: MARGIN, y: MARGIN, scale: 1 };

  constructor() {
    this.links = new LinkLayer();
    this.worlds = [s("g"), s("g")]; // boxes that stand, and above them those that are being moved
    this.layers = this.worlds.map((world) => s("svg", { "aria-hidden": "true" }, world));
    this.element = h("div", { class: "drawing" }, this.links.element, this.layers);
    new ResizeObserver(() => this.#redraw()).observe(this.element);
  }

  get scale() {
    return this.view.scale;
  }

  /** Draw a model; a box that has not changed keeps its element. */
  draw(model) {
    this.drop();
    this.#model = model;
    this.links.links = model.links;
    const gone = new Set(this.#boxes.keys());
    for (const box of model.boxes) {
      gone.delete(box.key);
      this.#drawBox(box);
    }
    for (const key of gone) {
      this.#boxes.get(key).element.remove();
      this.#boxes.delete(key);
    }
    this.#redraw();
  }

  #drawBox(box) {
    const before = this.#boxes.get(box.key);
    const signature = JSON.stringify([box.title, box.command, box.node, box.kind, box.ports]);
    if (before?.signature !== signature) {
      const element = this.#box(box);
      if (before) before.element.replaceWith(element);
      else this.worlds[0].append(element);
      this.#boxes.set(box.key, { element, signature });
    }
    put(this.#boxes.get(box.key).element, box);
  }

  #box(box) {
    return s("g", { class: `box ${box.kind}`, "data-box": box.key }, title(`${box.command}${box.node ? `\n${box.node}` : ""}`),
      s("rect", { class: "frame", width: BOX.width, height: box.height, rx: 5 }), s("rect", { class: "tone", width: 6, height: box.height, rx: 3 }),
      text(14, 18, box.title, { class: "name" }), text(14, 35, box.kind === "own" ? box.node : box.command || box.file, { class: "note" }, 30),
      ...box.ports.map((port) => this.#port(port)));
  }

  #port(port) {
    const right = port.side === "right";
    const [x, y] = [right ? BOX.width : 0, BOX.head + (port.row + 0.5) * BOX.row];
    const shape = right ? s("circle", { cx: x, cy: y, r: 5 }) : s("path", { d: `M${x - 6} ${y - 5}L${x + 4} ${y}L${x - 6} ${y + 5}Z` });
    const label = text(right ? x - 12 : 12, y + 4, port.label, { class: right ? "label end" : "label" }, 15);
    return s("g", { class: `port ${port.kind}${port.required ? " required" : ""}`, "data-port": port.name, "data-side": port.side }, title(`${port.name}\n${port.kind} ${port.type ?? ""}`), shape, label);
  }

  /** Draw moved boxes and all links again. The others are not drawn again until `drop`. */
  move(boxes) {
    for (const box of boxes) {
      const { element } = this.#boxes.get(box.key);
      if (element.parentNode !== this.worlds[1]) this.worlds[1].append(element);
      put(element, box);
    }
    this.#redraw();
  }

  /** Put moved boxes to the others. */
  drop() {
    this.worlds[0].append(...this.worlds[1].childNodes);
  }

  /** Draw a link that is being made, from a place to a place; none without. */
  drawDraft(from, to) {
    this.links.draft = from ? { from, to } : null;
    this.#redraw();
  }

  /** Mark boxes and links: `tones` and `problems` by key of a box or name of a link, `selected` has both. */
  mark(marks) {
    for (const [key, { element }] of this.#boxes) {
      set(element, "data-tone", marks.tones.get(key) ?? "idle");
      set(element, "data-problem", marks.problems.get(key) ?? "");
      set(element, "data-selected", marks.selected.has(key) ? "yes" : "");
    }
    if (this.links.mark(marks)) this.#redraw();
  }

  /** Draw the links, once before the next frame. */
  #redraw() {
    this.#frame ||= requestAnimationFrame(() => {
      this.#frame = 0;
      this.links.draw(this.view);
    });
  }

  // The view

  /** The place in the graph of a place on the screen. */
  toWorld({ clientX, clientY }) {
    const frame = this.element.getBoundingClientRect();
    const { x, y, scale } = this.view;
    return { x: (clientX - frame.left - x) / scale, y: (clientY - frame.top - y) / scale };
  }

  pan(dx, dy) {
    this.#show({ ...this.view, x: this.view.x + dx, y: this.view.y + dy });
  }

  /** Zoom about a place on the screen, or about the middle. */
  zoom(factor, about = this.#middle()) {
    const fixed = this.toWorld(about);
    const frame = this.element.getBoundingClientRect();
    const scale = Math.min(SCALES.most, Math.max(SCALES.least, this.view.scale * factor));
    this.#show({ scale, x: about.clientX - frame.left - fixed.x * scale, y: about.clientY - frame.top - fixed.y * scale });
  }

  /** Show the whole graph. */
  fit() {
    const { boxes } = this.#model;
    const { width, height } = this.element.getBoundingClientRect();
    if (!boxes.length || !width) return this.#show({ x: MARGIN, y: MARGIN, scale: 1 });
    const [left, top] = ["x", "y"].map((axis) => Math.min(...boxes.map((box) => box[axis])));
    const right = Math.max(...boxes.map((box) => box.x + BOX.width));
    const bottom = Math.max(...boxes.map((box) => box.y + box.height));
    const scale = Math.max(SCALES.least, Math.min(1, (width - 2 * MARGIN) / (right - left), (height - 2 * MARGIN) / (bottom - top)));
    return this.#show({ scale, x: (width - (right + left) * scale) / 2, y: (height - (bottom + top) * scale) / 2 });
  }

  /** Bring a box into view. */
  reveal(box) {
    const { width, height } = this.element.getBoundingClientRect();
    const { x, y, scale } = this.view;
    const inside = (low, high, size) => (low < MARGIN ? MARGIN - low : high > size - MARGIN ? size - MARGIN - high : 0);
    const [left, top] = [box.x * scale + x, box.y * scale + y];
    this.pan(inside(left, left + BOX.width * scale, width), inside(top, top + box.height * scale, height));
  }

  #middle() {
    const { left, top, width, height } = this.element.getBoundingClientRect();
    return { clientX: left + width / 2, clientY: top + height / 2 };
  }

  /** The place in the middle of what is shown. */
  get centre() {
    return this.toWorld(this.#middle());
  }

  /** Show another part. The layers of the boxes are shifted without being drawn again. */
  #show(view) {
    if (view.scale !== this.shownScale) {
      this.shownScale = view.scale;
      for (const world of this.worlds) world.setAttribute("transform", `scale(${view.scale})`);
      this.element.classList.toggle("far", view.scale < FAR);
    }
    this.view = view;
    for (const layer of this.layers) layer.style.setProperty("transform", `translate(${view.x}px, ${view.y}px)`);
    this.#redraw();
  }

  /** The link that is near a place in the graph, or nothing. */
  linkNear(spot) {
    return this.links.near(spot, this.view.scale);
  }
}

function put(element, { x, y }) {
  element.setAttribute("transform", `translate(${x} ${y})`);
}

function set(element, name, value) {
  if ((element.getAttribute(name) ?? "") === value) return;
  if (value) element.setAttribute(name, value);
  else element.removeAttribute(name);
}
