// Creation of elements. Texts are never parsed as markup, here and on the whole page. And texts have no effect:
// characters that would act (control characters, changes of direction) are made visible.

import { visible } from "./format.js";

// Greatest lengths of a name, and of any text: the layout of longer ones takes seconds. Longer texts use long_text.js.
const LONG_NAME = 4000;
const LONGEST = 1 << 16;

/** Return a text, or a number, as it is put into the document. */
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

/** Replace the contents of an element. */
export function fill(element, ...children) {
  element.textContent = "";
  append(element, children);
}

/** Set a text only if it differs, so that there is no new layout, and screen readers do not repeat it. */
export function setText(element, text) {
  const plain = shown(text);
  if (element.textContent !== plain) element.textContent = plain;
}

/** A text from the run: it wraps where needed, its direction is isolated, and its length is limited.
 * All texts of tests, files and persons are made by this function.
 */
export function free(text, tag = "span", attributes = {}) {
  const name = attributes.class ? `free ${attributes.class}` : "free";
  return h(tag, { dir: "auto", ...attributes, class: name, text: shown(text, LONG_NAME) });
}

/** A heading with its contents; hidden while they are empty. */
export function section(title, ...children) {
  return h("section", { class: "section" }, h("h3", { text: title }), ...children);
}
