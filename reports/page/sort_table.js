// A virtual table, which is sorted by its headers and builds only its visible rows.
//
// All rows have the same height, from the style sheet (--row); spacers replace the rows that are not built. A row that
// is the same object as before keeps its element, so row objects must not change: a change needs a new object.

import { fill, free, h } from "./dom.js";
import { visible } from "./format.js";

const SPARE = 10; // additional rows at both edges, for scrolling
const PRINTED = 500; // number of printed rows

/** Columns are {key, label, value(row), cell(row), numeric?, title?, first?}: `value` is the sort key (null
 * goes to the end), `cell` an element or a text, `first` the direction of the first press, 1 or -1.
 */
export class SortTable {
  #columns;
  #rows = [];
  #sorted = [];
  #sort;
  #fallback;
  #range = [Infinity, -1]; // rows that are built
  #built = new Map(); // row -> its element, of visible rows
  #height = 0;

  /** `name`: a class for the widths of the columns; `fallback(a, b)`: the order at first, and among equals. */
  constructor({ label, columns, name = "", fallback = () => 0, empty = "nothing to show" }) {
    this.#columns = columns;
    this.#fallback = fallback;
    this.#sort = null;
    this.heads = columns.map((column) => this.#head(column));
    this.above = h("tr", { class: "sort-spacer", "aria-hidden": "true" }, h("td", { colspan: columns.length }));
    this.below = h("tr", { class: "sort-spacer", "aria-hidden": "true" }, h("td", { colspan: columns.length }));
    this.body = h("tbody");
    this.table = h(
      "table",
      { class: `sort-table ${name}`, "aria-label": label },
      h("thead", {}, h("tr", { "aria-rowindex": 1 }, this.heads)),
      this.body,
    );
    this.empty = h("p", { class: "dim", text: empty });
    this.element = h(
      "div",
      {
        class: "sort-region",
        role: "region",
        "aria-label": `${label}, scrolls`,
        tabindex: 0,
        on: { scroll: () => this.#draw() },
      },
      this.table,
      this.empty,
    );
    new ResizeObserver(() => this.#draw()).observe(this.element);
    addEventListener("beforeprint", () => this.#draw(PRINTED));
    addEventListener("afterprint", () => this.#redraw());
  }

  /** Show these rows. */
  set rows(rows) {
    this.#rows = rows;
    this.#order();
  }

  /** The rows in the displayed order. */
  get sorted() {
    return this.#sorted;
  }

  #head(column) {
    const button = h(
      "button",
      { type: "button", class: "sort-button", title: column.title, on: { click: () => this.#press(column) } },
      column.label,
      h("span", { class: "sort-sign", "aria-hidden": "true" }),
    );
    return h("th", { scope: "col", class: cellClass(column) }, column.value ? button : column.label);
  }

  #press(column) {
    const first = column.first ?? 1;
    if (this.#sort?.column !== column) this.#sort = { column, direction: first };
    else if (this.#sort.direction === first) this.#sort.direction = -first;
    else this.#sort = null;
    this.element.scrollTop = 0;
    this.#order();
  }

  #order() {
    this.#sorted = this.#sort ? this.#byColumn() : [...this.#rows].sort(this.#fallback);
    this.heads.forEach((head, index) => {
      const on = this.#sort?.column === this.#columns[index];
      if (!this.#columns[index].value) return;
      head.setAttribute("aria-sort", on ? (this.#sort.direction > 0 ? "ascending" : "descending") : "none");
      head.querySelector(".sort-sign").textContent = on ? (this.#sort.direction > 0 ? "▲" : "▼") : "";
    });
    this.table.hidden = this.#rows.length === 0;
    this.empty.hidden = this.#rows.length > 0;
    this.table.setAttribute("aria-rowcount", this.#rows.length + 1);
    this.#redraw();
  }

  #byColumn() {
    const { column, direction } = this.#sort;
    const keyed = this.#rows.map((row) => ({ row, key: column.value(row) }));
    keyed.sort((one, other) => {
      const gap = Number(isNothing(one.key)) - Number(isNothing(other.key));
      if (gap || isNothing(one.key)) return gap || this.#fallback(one.row, other.row);
      return direction * compareValues(one.key, other.key) || this.#fallback(one.row, other.row);
    });
    return keyed.map(({ row }) => row);
  }

  #redraw() {
    this.#range = [Infinity, -1];
    this.#draw();
  }

  #draw(least = 0) {
    if (!this.element.isConnected || this.element.clientHeight === 0) return;
    this.#height ||= parseFloat(getComputedStyle(this.element).getPropertyValue("--row")) * rootSize();
    const top = Math.floor(this.element.scrollTop / this.#height);
    const end = top + Math.ceil(this.element.clientHeight / this.#height);
    const last = this.#sorted.length;
    if (!least && this.#range[0] <= Math.max(0, top - 1) && this.#range[1] >= Math.min(last, end + 1)) return;
    const from = least ? 0 : Math.max(0, top - SPARE);
    const to = Math.min(last, Math.max(end + SPARE, least));
    this.#range = [from, to];
    const before = this.#built;
    this.#built = new Map();
    for (let index = from; index < to; index += 1) {
      const row = this.#sorted[index];
      const element = before.get(row) ?? this.#row(row);
      element.setAttribute("aria-rowindex", index + 2);
      this.#built.set(row, element);
    }
    this.#spacer(this.above, from);
    this.#spacer(this.below, this.#sorted.length - to);
    const focused = document.activeElement;
    fill(this.body, this.above, [...this.#built.values()], this.below);
    if (focused !== document.activeElement && this.body.contains(focused)) focused.focus({ preventScroll: true });
  }

  #spacer(row, count) {
    row.hidden = count === 0;
    row.firstChild.style.setProperty("height", `${count * this.#height}px`);
  }

  #row(row) {
    return h(
      "tr",
      {},
      this.#columns.map((column) => h("td", { class: cellClass(column) }, column.cell(row))),
    );
  }
}

/** A link in a cell, with a text from the run; the tooltip has the whole text. */
export function cellLink(href, text, title = text) {
  return h("a", { href, title: visible(title) }, free(text));
}

/** A number aligned at its decimal point with the others of its column. */
export function alignedNumber(text) {
  const [, whole, rest] = /^([^.e]*)(.*)$/.exec(text);
  return h(
    "span",
    { class: "aligned" },
    h("span", { class: "aligned-whole", text: whole }),
    h("span", { class: "aligned-rest", text: rest }),
  );
}

function cellClass(column) {
  return `col-${column.key}${column.numeric ? " number" : ""}`;
}

function isNothing(value) {
  return value === null || value === undefined || Number.isNaN(value);
}

const COLLATOR = new Intl.Collator(undefined, { numeric: true });

function compareValues(a, b) {
  return typeof a === "number" && typeof b === "number" ? (a < b ? -1 : Number(a > b)) : COLLATOR.compare(a, b);
}

function rootSize() {
  return parseFloat(getComputedStyle(document.documentElement).fontSize);
}
