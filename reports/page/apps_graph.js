// The graph of an application in its region: what the mouse and the keys do in it.
//
// All that it can do, the tables and dialogs can, too; screen readers are told what is selected.

import { AppCanvas } from "./apps_canvas.js";
import { BOX, portPlace } from "./apps_model.js";
import { h } from "./dom.js";

const STEP = 20; // by which a key moves a box
const CLICK = 4; // pixels that a pointer may move in a click
const ZOOM = 1.25;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const HELP = "Arrow keys go to another program, with Shift they move it; Enter shows it, C connects it, W has it wait for a port, Delete removes it, plus, minus and 0 zoom. The tables below have all that is in the graph.";

export class AppGraph {
  #model = { boxes: [], links: [], byKey: new Map() };
  #drag = null;
  #frame = 0;

  /** `page` has editable, selection, select(keys), moved(boxes), connect(source, target), wait(id, dependency), askToConnect(), askToWait(), open(), remove(). */
  constructor(page) {
    this.page = page;
    this.canvas = new AppCanvas();
    this.help = h("p", { class: "unseen", id: "graph-help", text: HELP });
    this.element = h("div", { class: "graph", role: "region", tabindex: 0, "aria-label": "Graph", "aria-describedby": "graph-help" }, this.canvas.element, this.help);
    const { element } = this;
    element.addEventListener("pointerdown", (event) => this.#pressed(event));
    element.addEventListener("pointermove", (event) => this.#dragged(event));
    element.addEventListener("pointerup", (event) => this.#released(event));
    element.addEventListener("pointercancel", () => this.#cancel());
    element.addEventListener("wheel", (event) => this.#wheeled(event), { passive: false });
    element.addEventListener("keydown", (event) => this.#key(event));
  }

  draw(model) {
    this.#model = model;
    this.canvas.draw(model);
  }

  // Mouse, pen and finger

  #pressed(event) {
    if (event.button > 1 || this.#drag) return;
    const port = event.target.closest("[data-port]");
    const box = this.#model.byKey.get(event.target.closest("[data-box]")?.dataset.box);
    const start = { clientX: event.clientX, clientY: event.clientY };
    if (port && this.page.editable) this.#drag = { kind: "link", box, port: port.dataset.port, side: port.dataset.side };
    else if (box && event.button === 0) this.#drag = { kind: "boxes", box, boxes: null };
    else this.#drag = { kind: "view" };
    Object.assign(this.#drag, { start, last: start, moved: false, more: event.shiftKey || event.ctrlKey });
    this.element.setPointerCapture(event.pointerId);
  }

  #dragged(event) {
    const drag = this.#drag;
    if (!drag) return;
    drag.now = { clientX: event.clientX, clientY: event.clientY };
    drag.moved ||= Math.hypot(event.clientX - drag.start.clientX, event.clientY - drag.start.clientY) > CLICK;
    if (drag.moved) this.#frame ||= requestAnimationFrame(() => this.#follow());
  }

  /** Show where the pointer is, once in a frame. */
  #follow() {
    this.#frame = 0;
    const drag = this.#drag;
    if (!drag?.now) return;
    const [dx, dy] = [drag.now.clientX - drag.last.clientX, drag.now.clientY - drag.last.clientY];
    drag.last = drag.now;
    if (drag.kind === "view") this.canvas.pan(dx, dy);
    else if (drag.kind === "link") this.#drawDraft(drag);
    else this.#shift(drag.boxes ??= this.#grabbed(drag.box), dx / this.canvas.scale, dy / this.canvas.scale);
  }

  /** The boxes that move with a box: the selected ones, if it is one of them. */
  #grabbed(box) {
    const { selection } = this.page;
    if (!selection.has(box.key)) this.page.select([box.key]);
    return this.#model.boxes.filter((one) => this.page.selection.has(one.key));
  }

  #shift(boxes, dx, dy) {
    for (const box of boxes) [box.x, box.y] = [box.x + dx, box.y + dy];
    this.canvas.move(boxes);
  }

  #drawDraft({ box, port, side, now }) {
    const [own, other] = [portPlace(box, port), this.canvas.toWorld(now)];
    if (side === "right") this.canvas.drawDraft(own, other);
    else this.canvas.drawDraft(other, own);
  }

  #released(event) {
    const drag = this.#drag;
    if (!drag) return;
    if (drag.moved) this.#follow();
    this.#cancel();
    if (!drag.moved) this.#clicked(drag);
    else if (drag.kind === "boxes") this.page.moved(drag.boxes);
    else if (drag.kind === "link") this.#dropped(drag, document.elementFromPoint(event.clientX, event.clientY));
  }

  #cancel() {
    this.#drag = null;
    this.canvas.drawDraft(null);
    this.canvas.drop();
  }

  #clicked(drag) {
    const key = drag.box?.key ?? this.canvas.linkNear(this.canvas.toWorld(drag.start))?.name;
    const { selection } = this.page;
    if (!drag.more) this.page.select(key ? [key] : []);
    else if (key) this.page.select(selection.has(key) ? [...selection].filter((one) => one !== key) : [...selection, key]);
  }

  /** A port that is dropped on one of the other side is connected; one that is dropped on a box is waited for. */
  #dropped({ box, port, side }, element) {
    const found = element?.closest("[data-port]");
    const waiting = this.#model.byKey.get(element?.closest("[data-box]")?.dataset.box);
    if (!found && waiting?.id && waiting !== box) this.page.wait(waiting.id, { port });
    if (!found || found.dataset.side === side) return;
    const [source, target] = side === "right" ? [port, found.dataset.port] : [found.dataset.port, port];
    this.page.connect(source, target);
  }

  #wheeled(event) {
    event.preventDefault();
    this.canvas.zoom(Math.exp(-event.deltaY / 500), event);
  }

  // Keys

  #key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const direction = ARROWS[event.key];
    if (direction && event.shiftKey) this.#nudge(direction);
    else if (direction) this.#go(direction);
    else if (!this.#press(event.key)) return;
    event.preventDefault();
  }

  #press(key) {
    if (key === "Enter") this.page.open();
    else if (key === "c") this.page.askToConnect();
    else if (key === "w") this.page.askToWait();
    else if (key === "Delete" || key === "Backspace") this.page.remove();
    else if (key === "+") this.canvas.zoom(ZOOM);
    else if (key === "-") this.canvas.zoom(1 / ZOOM);
    else if (key === "0") this.canvas.fit();
    else if (key === "Escape") this.page.select([]);
    else return false;
    return true;
  }

  #nudge([dx, dy]) {
    const boxes = this.#model.boxes.filter((box) => this.page.selection.has(box.key));
    if (!boxes.length) return;
    this.#shift(boxes, dx * STEP, dy * STEP);
    this.page.moved(boxes);
    this.canvas.reveal(boxes[0]);
  }

  /** Select the nearest box in a direction. */
  #go([dx, dy]) {
    const { boxes } = this.#model;
    const from = boxes.find((box) => this.page.selection.has(box.key));
    let best = from ? null : boxes[0];
    let least = Infinity;
    for (const box of from ? boxes : []) {
      const [x, y] = [box.x - from.x, box.y + box.height / 2 - from.y - from.height / 2];
      const [along, across] = [x * dx + y * dy, Math.abs(x * dy) + Math.abs(y * dx)];
      if (box === from || along <= 0 || along + 3 * across >= least) continue;
      [best, least] = [box, along + 3 * across];
    }
    if (!best) return;
    this.page.select([best.key]);
    this.canvas.reveal(best);
  }

  /** A free place for a new box, near the middle of what is shown. */
  get freePlace() {
    const { x, y } = this.canvas.centre;
    const spot = { x: Math.round(x - BOX.width / 2), y: Math.round(y - BOX.head) };
    const taken = () => this.#model.boxes.some((box) => Math.abs(box.x - spot.x) < BOX.width + STEP && spot.y < box.y + box.height + STEP && box.y < spot.y + 4 * STEP + BOX.head);
    while (taken()) spot.y += STEP;
    return spot;
  }
}
