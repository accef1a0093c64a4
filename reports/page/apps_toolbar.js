// The buttons of an application: each works on what is selected, or on all.

import { showKeys } from "./apps_dialogs.js";
import { h, setText } from "./dom.js";

const MODULES = [["run", "Run"], ["stop", "Stop"], ["kill", "Kill"]];
const CONNECTIONS = [["connect", "Connect"], ["disconnect", "Disconnect"]];

export class AppToolbar {
  constructor(tab) {
    this.tab = tab;
    this.buttons = new Map([...MODULES, ...CONNECTIONS].map(([word, label]) => [word, this.#button(label, () => tab.control(word), word === "kill" ? "danger" : "")]));
    this.undo = this.#button("Undo", () => tab.undo(), "", "Control+Z");
    this.redo = this.#button("Redo", () => tab.redo(), "", "Control+Y");
    this.save = this.#button("Save", () => tab.save(), "default", "Control+S");
    this.add = this.#button("Add program…", () => tab.askToAdd(), "", "a");
    this.link = this.#button("Add connection…", () => tab.askToConnect(), "", "c");
    this.arrange = this.#button("Arrange", () => tab.arrange());
    this.fit = this.#button("Fit", () => tab.graph.canvas.fit(), "", "0");
    this.keys = this.#button("Keys", showKeys, "quiet", "?");
    const group = (label, several) => h("div", { class: "bar", role: "group", "aria-label": label }, several);
    this.element = h("div", { class: "apps-toolbar" }, group("What runs", [...this.buttons.values()]), group("The file", [this.add, this.link, this.undo, this.redo, this.save, this.arrange, this.fit, this.keys]));
  }

  /** A button; it cannot be pressed before the application is there. */
  #button(label, click, name = "", keys = null) {
    return h("button", { type: "button", disabled: true, class: name, "aria-keyshortcuts": keys, on: { click } }, h("span", { text: label }));
  }

  update() {
    const { tab } = this;
    const { document } = tab;
    const label = (several, chosen) => {
      for (const [word, text] of several) {
        setText(this.buttons.get(word).firstChild, chosen ? `${text} ${chosen.length}` : `${text} all`);
        this.buttons.get(word).disabled = !tab.editable || (word === "run" && document.changed);
      }
    };
    label(MODULES, tab.chosenModules);
    label(CONNECTIONS, tab.chosenConnections);
    this.buttons.get("run").title = document.changed ? "save the application first" : "";
    this.undo.disabled = !document.canUndo;
    this.redo.disabled = !document.canRedo;
    this.save.disabled = !document.changed;
    this.fit.disabled = false;
    this.keys.disabled = false;
    for (const button of [this.add, this.link, this.arrange]) button.disabled = !tab.editable;
  }
}
