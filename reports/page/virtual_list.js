// A virtual list, which only builds its visible rows: for ten thousand tests, a hundred thousand lines of a log.

import { h } from "./dom.js";

const OVERSCAN = 6; // additional rows above and below the visible ones, for scrolling

/** The height of a row, larger on touch screens. */
export function rowHeight(fine) {
  return matchMedia("(pointer: coarse)").matches ? Math.max(44, fine) : fine;
}

let lists = 0;

/** A listbox over `items`. `make()` builds the inside of a row and `draw(row, item)` fills it; `key(item)` identifies
 * an item; `pick(item)` is called when the cursor moves to another item, `open(item, byKey)` when it is opened.
 */
export class Rows {
  constructor({ label, height, make, draw, key, pick = () => {}, open = () => {}, follow = false }) {
    Object.assign(this, { height, make, draw, key, pick, open });
    this.items = [];
    this.current = null; // key of the item under the cursor
    this.follow = follow; // stay at the end while items are added
    this.onFollow = () => {};
    this.pool = [];
    this.prefix = `rows${(lists += 1)}-`;
    this.lastTop = 0;
    this.space = h("div", { class: "rows-space", role: "presentation" });
    this.element = h("div", {
      class: "rows", role: "listbox", tabindex: "0", "aria-label": label,
      on: { scroll: () => this.#scrolled(), click: (event) => this.#clicked(event), keydown: (event) => this.#pressed(event) },
    }, this.space);
    this.element.style.setProperty("--row", `${height}px`);
    new ResizeObserver(() => this.#resized()).observe(this.element);
  }

  /** Show these items; the top row of the view keeps its place, except at the very top. */
  setItems(items) {
    const top = this.element.scrollTop;
    const anchor = top > 0 && !this.follow ? this.items[Math.floor(top / this.height)] : undefined;
    const before = anchor === undefined ? -1 : Math.floor(top / this.height);
    this.items = items;
    this.space.style.setProperty("height", `${items.length * this.height}px`);
    if (this.follow) this.toEnd();
    else if (before >= 0) this.#hold(this.key(anchor), before);
    this.refresh();
  }

  #resized() {
    if (this.follow) this.toEnd();
    this.place();
  }

  #hold(key, before) {
    if (before < this.items.length && this.key(this.items[before]) === key) return;
    const index = this.indexOf(key);
    if (index >= 0) this.element.scrollTop += (index - before) * this.height;
  }

  toEnd() {
    this.element.scrollTop = this.items.length * this.height;
    this.lastTop = this.element.scrollTop;
  }

  indexOf(key) {
    return key === null ? -1 : this.items.findIndex((item) => this.key(item) === key);
  }

  /** Redraw the visible rows. */
  refresh() {
    this.currentIndex = this.indexOf(this.current);
    for (const row of this.pool) row.item = null;
    this.place();
  }

  /** Move the rows to the view; only new ones are drawn. */
  place() {
    const seen = Math.ceil(this.element.clientHeight / this.height) + 2 * OVERSCAN;
    const wanted = Math.min(seen, this.items.length);
    while (this.pool.length < wanted) this.#grow();
    const first = Math.max(0, Math.min(Math.floor(this.element.scrollTop / this.height) - OVERSCAN, this.items.length - wanted));
    for (let slot = 0; slot < this.pool.length; slot += 1) {
      const row = this.pool[slot];
      const index = first + ((slot - first) % this.pool.length + this.pool.length) % this.pool.length;
      const shown = index < first + wanted;
      row.element.hidden = !shown;
      if (shown) this.#put(row, index);
    }
    this.#point();
  }

  #grow() {
    const inside = this.make();
    inside.element = h("div", { class: "row", role: "option" }, ...inside.parts);
    inside.item = null;
    this.pool.push(inside);
    this.space.append(inside.element);
  }

  #put(row, index) {
    const item = this.items[index];
    if (row.item === item && row.index === index) return;
    const { element } = row;
    if (row.index !== index) {
      row.index = index;
      element.id = this.prefix + index;
      element.style.setProperty("transform", `translateY(${index * this.height}px)`);
      element.setAttribute("aria-posinset", String(index + 1));
    }
    element.setAttribute("aria-setsize", String(this.items.length));
    element.setAttribute("aria-selected", String(index === this.currentIndex));
    row.item = item;
    this.draw(row, item);
  }

  #point() {
    const row = this.pool.find((one) => one.index === this.currentIndex && !one.element.hidden);
    if (row) this.element.setAttribute("aria-activedescendant", row.element.id);
    else this.element.removeAttribute("aria-activedescendant");
  }

  /** Put the cursor on the item with this key, without calling `pick`. */
  setCurrent(key) {
    this.current = key;
    this.refresh();
  }

  /** Scroll until the cursor is visible. */
  reveal() {
    const index = this.indexOf(this.current);
    if (index < 0) return;
    const top = index * this.height;
    const view = this.element;
    if (top < view.scrollTop) view.scrollTop = top;
    else if (top + this.height > view.scrollTop + view.clientHeight) view.scrollTop = top + this.height - view.clientHeight;
    this.place();
  }

  /** Move the cursor by rows, or to an end with ±Infinity. */
  move(by) {
    if (!this.items.length) return;
    const from = this.indexOf(this.current);
    const start = from < 0 ? (by > 0 ? -1 : this.items.length) : from;
    const index = Math.max(0, Math.min(this.items.length - 1, by === Infinity ? this.items.length - 1 : start + by));
    this.current = this.key(this.items[index]);
    this.refresh();
    this.reveal();
    this.pick(this.items[index]);
  }

  /** Handle a key; return whether it had an effect. */
  press(key) {
    const page = Math.max(1, Math.floor(this.element.clientHeight / this.height) - 1);
    const steps = {
      ArrowDown: 1, j: 1, ArrowUp: -1, k: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity,
    };
    if (key in steps) this.move(steps[key]);
    else if (key === "Enter" && this.currentIndex >= 0) this.open(this.items[this.currentIndex], true);
    else return false;
    return true;
  }

  #pressed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || !this.press(event.key)) return;
    event.preventDefault();
    event.stopPropagation();
  }

  #clicked(event) {
    const element = event.target.closest(".row");
    const row = this.pool.find((one) => one.element === element);
    if (!row) return;
    this.current = this.key(row.item);
    this.refresh();
    this.open(row.item);
  }

  #scrolled() {
    const { scrollTop, clientHeight } = this.element;
    const atEnd = scrollTop + clientHeight >= this.items.length * this.height - this.height;
    const up = scrollTop < this.lastTop;
    this.lastTop = scrollTop;
    if (this.follow && up && !atEnd) this.setFollow(false);
    this.place();
  }

  setFollow(follow) {
    this.follow = follow;
    if (follow) this.toEnd();
    this.onFollow(follow);
  }
}
