// The filters of a log, those of `rtf log`, kept in the address so that they survive a reload and can be sent to others.

import { h } from "./dom.js";

const LEVELS = ["trace", "debug", "info", "warning", "error", "fatal"];
const PAUSE = 250; // milliseconds after the last key until a filter is used
const FIELDS = [
  ["process", "Process", "a program's name, process number or log port"],
  ["host", "Host", "the computer, or the server of yarprun"],
  ["component", "Component", "a component, with those below it"],
  ["since", "Since", "how long ago, such as 10min or 2h, or a time such as 2026-11-25T14:00"],
  ["text", "Text", "a part of the message"],
];

export class LogFilters {
  constructor(changed) {
    this.changed = changed;
    this.level = h("select", { "aria-label": "Level", on: { change: () => this.#use() } },
      h("option", { value: "", text: "every level" }), LEVELS.map((level) => h("option", { value: level, text: `from ${level}` })));
    this.fields = new Map(FIELDS.map(([name, label, title]) => [name, this.#field(name, label, title)]));
    this.clear = h("button", { type: "button", on: { click: () => this.#clear() } }, "clear");
    this.element = [this.level, ...this.fields.values(), this.clear];
    this.#read();
    addEventListener("hashchange", () => {
      this.#read();
      this.changed();
    });
  }

  /** The filters that are set, as the server takes them. */
  get values() {
    const all = [["level", this.level.value], ...[...this.fields].map(([name, field]) => [name, field.value.trim()])];
    return Object.fromEntries(all.filter(([, value]) => value));
  }

  focus() {
    const field = this.fields.get("text");
    field.focus();
    field.select();
  }

  #field(name, label, title) {
    return h("input", {
      type: "search", class: `filter filter-${name}`, placeholder: label, "aria-label": label, title, spellcheck: "false", autocomplete: "off",
      on: { input: () => this.#later(), keydown: (event) => event.key === "Enter" && this.#use() },
    });
  }

  #later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#use(), PAUSE);
  }

  #use() {
    clearTimeout(this.timer);
    const hash = `#${new URLSearchParams(this.values)}`;
    if (hash === (location.hash || "#")) return;
    history.replaceState(null, "", hash);
    this.#mark();
    this.changed();
  }

  #clear() {
    this.level.value = "";
    for (const field of this.fields.values()) field.value = "";
    this.#use();
  }

  #read() {
    const words = new URLSearchParams(location.hash.slice(1));
    const level = words.get("level") ?? "";
    this.level.value = LEVELS.includes(level) ? level : "";
    for (const [name, field] of this.fields) field.value = words.get(name) ?? "";
    this.#mark();
  }

  #mark() {
    this.clear.hidden = Object.keys(this.values).length === 0;
  }
}
