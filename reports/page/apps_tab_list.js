// Tabs, as ARIA describes them: one panel is shown, arrow keys go from tab to tab.

import { h, setText } from "./dom.js";

let lists = 0;

export class TabList {
  /** `panels` are [label, element]; `changed` is called when another one is shown. */
  constructor(label, panels, changed = () => {}) {
    lists += 1;
    this.changed = changed;
    this.panels = panels.map(([, element], index) => h("div", { class: "tab-panel", role: "tabpanel", id: `panel-${lists}-${index}`, "aria-labelledby": `tab-${lists}-${index}`, tabindex: element.querySelector("[tabindex]") ? null : 0 }, element));
    this.tabs = panels.map(([name], index) => h("button", { type: "button", role: "tab", id: `tab-${lists}-${index}`, "aria-controls": this.panels[index].id, on: { click: () => this.show(index) } }, h("bdi", { text: name })));
    this.list = h("div", { class: "tab-list", role: "tablist", "aria-label": label, on: { keydown: (event) => this.#key(event) } }, this.tabs);
    this.element = h("div", { class: "tabs" }, this.list, this.panels);
    this.show(0);
  }

  setLabel(index, text) {
    setText(this.tabs[index].firstChild, text);
  }

  show(index) {
    this.shown = index;
    this.tabs.forEach((tab, at) => {
      tab.setAttribute("aria-selected", String(at === index));
      tab.tabIndex = at === index ? 0 : -1;
    });
    this.panels.forEach((panel, at) => { panel.hidden = at !== index; });
    this.changed(index);
  }

  #key(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    this.show((this.shown + step + this.tabs.length) % this.tabs.length);
    this.tabs[this.shown].focus();
  }
}
