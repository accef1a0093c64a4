// The dialogs that add a program or a connection, for those without a mouse, too.

import { fill, free, h } from "./dom.js";
import { CARRIERS } from "./apps_panel.js";

const KEYS = [
  [["←", "→", "↑", "↓"], "in the graph: go to the next box"], [["Shift", "arrow"], "in the graph: move the selected boxes"],
  [["Enter"], "in the graph: edit what is selected"], [["a"], "add a program"], [["c"], "in the graph: add a connection"], [["w"], "in the graph: have the selected program wait for a port"],
  [["Delete"], "in the graph: remove what is selected"], [["+"], "in the graph: zoom in"], [["-"], "in the graph: zoom out"], [["0"], "in the graph: show all"],
  [["Ctrl", "Z"], "undo"], [["Ctrl", "Y"], "redo"], [["Ctrl", "S"], "save"], [["?"], "this list"],
];
const SHOWN = 100; // programs of the palette that are listed

/** A dialog with a form; `done` gets its values by name. */
function dialog(heading, parts, button, done) {
  const id = `title-${heading.replaceAll(" ", "-")}`;
  const form = h("form", { method: "dialog", class: "fields" }, h("h2", { id, text: heading }), ...parts,
    h("div", { class: "dialog-end" }, h("button", { type: "button", class: "quiet", text: "Cancel", on: { click: () => element.close() } }), h("button", { class: "default", text: button })));
  const element = h("dialog", { "aria-labelledby": id }, form);
  form.addEventListener("submit", () => done(Object.fromEntries(new FormData(form))));
  return element;
}

function field(name, label, attributes = {}) {
  return h("label", { class: "field" }, h("span", { text: label }), h("input", { type: "text", name, autocomplete: "off", spellcheck: "false", ...attributes }));
}

function open(element) {
  document.body.append(element);
  element.addEventListener("close", () => element.remove());
  element.showModal();
}

/** Ask for a program: one of the palette, or any other. */
export function askForProgram(palette, done) {
  const list = h("div", { class: "palette", role: "listbox", "aria-label": "Described programs", tabindex: palette.length ? 0 : -1 });
  const name = field("name", "Program", { required: true });
  const input = name.querySelector("input");
  const choose = (program) => {
    input.value = program.name;
    draw();
  };
  const draw = () => {
    const found = palette.filter((one) => one.name.toLowerCase().includes(input.value.toLowerCase())).slice(0, SHOWN);
    fill(list, found.map((one) => h("div", { role: "option", "aria-selected": String(one.name === input.value), on: { click: () => choose(one) } }, free(one.name, "strong"), " ", free(one.description, "span", { class: "dim" }))));
    list.hidden = !found.length;
  };
  list.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const at = palette.findIndex((one) => one.name === input.value);
    input.value = "";
    choose(palette[Math.min(palette.length - 1, Math.max(0, at + step))]);
  });
  input.addEventListener("input", draw);
  draw();
  open(dialog("Add a program", [name, list, field("parameters", "Parameters"), field("node", "Node", { placeholder: "this machine" })], "Add", done));
}

/** Ask for a port that a program waits for; `boxes` have those that are known. */
export function askForDependency(boxes, done) {
  const known = boxes.flatMap((box) => box.ports.map((one) => h("option", { value: one.name })));
  const port = field("port", "Port", { list: "ports", pattern: "(/|\\$).*", title: "The name of a port begins with a slash", required: true });
  const timeout = field("timeout", "Timeout, s", { inputmode: "decimal", placeholder: "that of the run" });
  open(dialog("Wait for a port", [port, timeout, field("request", "Request"), field("reply", "Reply"), h("datalist", { id: "ports" }, known)], "Wait", done));
}

/** Show what the keys do. */
export function showKeys() {
  const list = h("dl", { class: "keys" }, KEYS.map(([keys, text]) => [h("dt", {}, keys.map((key) => [h("kbd", { text: key }), " "])), h("dd", { text })]));
  const close = h("button", { type: "button", class: "quiet", text: "Close", on: { click: () => element.close() } });
  const element = h("dialog", { "aria-labelledby": "title-keys" }, h("h2", { id: "title-keys", text: "Keys" }), list, h("div", { class: "dialog-end" }, close));
  open(element);
}

/** Ask for a connection between ports; `boxes` have those that are known. */
export function askForConnection(boxes, from, done) {
  const options = (side) => boxes.flatMap((box) => box.ports.filter((port) => port.side === side).map((port) => port.name)).map((value) => h("option", { value }));
  const lists = [h("datalist", { id: "sources" }, options("right")), h("datalist", { id: "targets" }, options("left")), h("datalist", { id: "new-carriers" }, CARRIERS.map((value) => h("option", { value })))];
  const port = { pattern: "/.*", title: "The name of a port begins with a slash", required: true };
  const source = field("source", "From", { list: "sources", value: from, ...port });
  open(dialog("Add a connection", [source, field("target", "To", { list: "targets", ...port }), field("protocol", "Carrier", { list: "new-carriers", placeholder: "tcp" }), lists], "Add", done));
}
