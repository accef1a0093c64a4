// Builds elements. Text only ever becomes text: nothing here, or anywhere on the page, parses markup. And text only ever
// is read: characters that would act (end, turn, overwrite what is around them) are spelled out on the way.

import { visible } from "./format.js";

// Characters of a name, and of any text at once: the layout of more takes seconds. What is longer on purpose is a long text.
const LONG_NAME = 4000;
const LONGEST = 1 << 16;

/** A text as it is put into the document; a number, too. */
function shown(text, limit = LONGEST) {
  const whole = String(text ?? "");
  return visible(whole.length > limit ? `${whole.slice(0, limit)}…` : whole);
}

/**
 * Make an element. `attributes` may hold `class`, `text`, `on` (event name -> listener), `data` (dataset), `style`
 * (custom properties and others, by name) and plain attributes; null and false leave an attribute out.
 * Children are elements, texts, arrays of both, or null.
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name === "text") element.textContent = shown(value);
    else if (name === "class") element.className = value;
    else if (name === "on") for (const [event, listener] of Object.entries(value)) element.addEventListener(event, listener);
    else if (name === "data") Object.assign(element.dataset, value);
    else if (name === "style") for (const [key, part] of Object.entries(value)) element.style.setProperty(key, part);
    else element.setAttribute(name, value === true ? "" : value);
  }
  append(element, children);
  return element;
}

/** Append elements and texts; arrays are flattened, null and false left out. */
export function append(element, children) {
  for (const child of children) {
    if (Array.isArray(child)) append(element, child);
    else if (child !== null && child !== undefined && child !== false) element.append(child instanceof Node ? child : shown(child));
  }
}

/** Replace what is in an element. */
export function fill(element, ...children) {
  element.textContent = "";
  append(element, children);
}

/** Set a text only where it differs, so that nothing is laid out again and no reader repeats itself. */
export function setText(element, text) {
  const plain = shown(text);
  if (element.textContent !== plain) element.textContent = plain;
}

/**
 * A text from the run: it wraps where it must, its direction stays its own, and it ends before the page does.
 * Everything that a test, a file or a person wrote goes through here.
 */
export function free(text, tag = "span", attributes = {}) {
  const name = attributes.class ? `free ${attributes.class}` : "free";
  return h(tag, { dir: "auto", ...attributes, class: name, text: shown(text, LONG_NAME) });
}

/** A heading with what belongs under it; hidden until it has something to show. */
export function section(title, ...children) {
  return h("section", { class: "section" }, h("h3", { text: title }), ...children);
}
