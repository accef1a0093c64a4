// The page of applications: a tab for each, and the keys that work everywhere in it.

import { AppsServer } from "./apps_server.js";
import { AppTab } from "./apps_tab.js";
import { TabList } from "./apps_tab_list.js";
import { showKeys } from "./apps_dialogs.js";
import { CARRIERS } from "./apps_panel.js";
import { h, setText } from "./dom.js";

const LOOK = 500; // milliseconds between two looks at an application

class ApplicationsPage {
  constructor() {
    this.server = new AppsServer();
    this.said = h("p", { class: "unseen", role: "status" });
  }

  async start() {
    const { files } = await this.server.get("facts");
    this.tabs = files.map((file, index) => new AppTab(this.server, index, file, (text) => setText(this.said, text)));
    const names = files.map((file) => file.split("/").pop());
    this.list = new TabList("Applications", this.tabs.map((tab, index) => [names[index], tab.element]), (index) => this.#shown(index));
    document.body.replaceChildren(
      h("header", { class: "apps-head" }, h("h1", { text: "Applications" }), this.server.control ? null : h("p", { class: "dim", text: "This page can only look: open the address with the token to change anything." })),
      h("main", {}, this.list.element), this.said, h("datalist", { id: "carriers" }, CARRIERS.map((value) => h("option", { value }))));
    document.addEventListener("keydown", (event) => this.#key(event));
    addEventListener("beforeunload", (event) => this.tabs.some((tab) => tab.document?.changed) && event.preventDefault());
    this.#shown(this.list.shown);
    setInterval(() => this.#look(), LOOK);
  }

  async #shown(index) {
    const tab = this.tabs[index];
    if (!this.list) return;
    document.title = `${tab.file.split("/").pop()} – applications`;
    if (!tab.loading) {
      tab.loading = tab.load();
      tab.loading.catch((error) => tab.fail(error));
    }
    await tab.loading;
    this.#look();
  }

  async #look() {
    const tab = this.tabs[this.list.shown];
    if (this.looking || document.hidden || !tab.model) return;
    this.looking = true;
    try {
      await tab.look();
    } finally {
      this.looking = false;
    }
  }

  /** Save, with what is being typed. */
  #save(tab, target) {
    target.dispatchEvent(new Event("change"));
    setTimeout(() => tab.save());
  }

  #key(event) {
    const tab = this.tabs[this.list.shown];
    const typing = event.target.closest?.("input:not([type=checkbox]), dialog");
    if (!tab.model || document.querySelector("dialog[open]")) return;
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey) {
      if (key === "s") this.#save(tab, event.target);
      else if (typing) return;
      else if (key === "y" || (key === "z" && event.shiftKey)) tab.redo();
      else if (key === "z") tab.undo();
      else return;
    } else if (typing || event.altKey) return;
    else if (key === "a") tab.askToAdd();
    else if (key === "?") showKeys();
    else return;
    event.preventDefault();
  }
}

new ApplicationsPage().start();
