// The keyboard: single letters, not in text fields, not with modifiers, not in dialogs.

import { h } from "./dom.js";
import { t } from "./texts.js";

const HELP = [
  [["j", "k", "↓", "↑"], "key.move"], [["Home", "End"], "key.ends"], [["Enter"], "key.open"], [["/"], "key.filter"],
  [["f"], "key.failures"], [["Esc"], "key.back"], [["s"], "key.stop"], [["?"], "key.help"],
];

/** Return whether an element handles keys itself. */
function takesKeys(element, key) {
  if (!element?.closest) return false;
  if (element.closest("input:not([type=checkbox]), select, textarea, [contenteditable]")) return true;
  if (element.closest("button, a[href], summary, input") && (key === "Enter" || key === " ")) return true;
  // Scrollable elements keep the keys for scrolling.
  return ["ArrowDown", "ArrowUp", "PageDown", "PageUp", "Home", "End"].includes(key) && Boolean(element.closest(".detail, .sort-region, [role=region], canvas, svg"));
}

/** Listen for the keys of the page. */
export function listenToKeys(page) {
  document.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    if (takesKeys(event.target, event.key)) return;
    if (pressed(page, event.key)) event.preventDefault();
  });
}

function pressed(page, key) {
  if (page.question.press(key)) return true;
  if (key === "s") page.askToStop();
  else if (key === "?") page.showHelp();
  else return page.pressView(key);
  return true;
}

/** The dialog that names the keys. */
export function helpDialog() {
  const dialog = h("dialog", { "aria-labelledby": "help-title" }, h("h2", { id: "help-title", text: t("help") }),
    h("dl", { class: "keys" }, HELP.map(([keys, text]) => [h("dt", {}, keys.map((key) => [h("kbd", { text: key }), " "])), h("dd", { text: t(text) })])),
    h("div", { class: "dialog-end" }, h("button", { type: "button", class: "quiet", text: t("close"), on: { click: () => dialog.close() } })));
  return dialog;
}
