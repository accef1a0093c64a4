// Texts that may be long: the first part is shown, the rest on demand and in pieces, so that a line of a megabyte
// costs nothing until it is opened.

import { h } from "./dom.js";
import { firstLine, formatBytes, visible } from "./format.js";

const FIRST = 8000; // characters
const PIECE = 200000;

/** A text in a block of its own; `clean` makes its control characters visible. */
export function longText(text, { clean = visible, className = "" } = {}) {
  const body = h("pre", { class: `free text ${className}`, dir: "auto", text: clean(text.slice(0, FIRST)) });
  if (text.length <= FIRST) return body;
  let shown = FIRST;
  const more = h("button", { type: "button", class: "quiet", on: { click: () => showMore() } });
  const label = () => {
    more.textContent = `show ${formatBytes(Math.min(PIECE, text.length - shown))} more of ${formatBytes(text.length - shown)}`;
  };
  const showMore = () => {
    body.append(clean(text.slice(shown, shown + PIECE)));
    shown += PIECE;
    if (shown < text.length) label();
    else more.remove();
  };
  label();
  return h("div", { class: "long-text" }, body, more);
}

/** Long contents that are folded under a summary line. */
export function folded(summary, text, options = {}) {
  const details = h("details", { class: "folded" }, h("summary", { text: firstLine(summary) }));
  if (options.open) details.open = true;
  const open = () => {
    if (details.open && details.childElementCount === 1) details.append(longText(text, options));
  };
  details.addEventListener("toggle", open);
  open();
  return details;
}

/** Elements of a growing list: existing ones are kept (folds stay open, selections hold), new ones are added,
 * and beyond `limit` there is a button.
 */
export class GrowingList {
  constructor(element, make, limit = 100) {
    Object.assign(this, { element, make, limit });
    this.first = limit;
    this.shown = [];
    this.more = h("button", { type: "button", class: "quiet", on: { click: () => this.#showMore() } });
  }

  /** Show these items; return whether there are any. */
  update(items) {
    this.items = items;
    const same = this.shown.length <= items.length && this.shown.every((item, index) => item === items[index]);
    if (!same) {
      this.element.textContent = "";
      this.shown = [];
      this.limit = this.first;
    }
    this.#fill();
    return items.length > 0;
  }

  #fill() {
    const until = Math.min(this.items.length, this.limit);
    for (let index = this.shown.length; index < until; index += 1) {
      this.element.append(this.make(this.items[index], this.items[index - 1]));
      this.shown.push(this.items[index]);
    }
    const rest = this.items.length - until;
    if (rest > 0) {
      this.more.textContent = `show ${Math.min(rest, 10 * this.first)} more of ${rest}`;
      if (!this.more.isConnected) this.element.after(this.more);
    } else this.more.remove();
  }

  #showMore() {
    this.limit += 10 * this.first;
    this.#fill();
  }
}
