// One application: its graph, what is selected, its tables, and all that is asked of the server for it.

import { AppDocument } from "./apps_document.js";
import { askForConnection, askForDependency, askForProgram } from "./apps_dialogs.js";
import { AppGraph } from "./apps_graph.js";
import { arranged, modelOf } from "./apps_model.js";
import { AppPanel } from "./apps_panel.js";
import { RefusedError } from "./apps_server.js";
import { stateOfBox, stateOfLink, toneOfState } from "./apps_states.js";
import { ConnectionTable, HappenedList, ModuleTable, NodeTable, ProblemTable } from "./apps_tables.js";
import { TabList } from "./apps_tab_list.js";
import { AppToolbar } from "./apps_toolbar.js";
import { h, setText } from "./dom.js";

const CHECK_PAUSE = 300; // milliseconds from a change to the check of it
const NOTHING = { modules: {}, connections: {}, rates: {}, nodes: {}, happened: [], runner: 0, outdated: false };

export class AppTab {
  selection = new Set(); // keys of boxes and names of links
  status = NOTHING;
  palette = [];
  #places = new Map(); // of boxes that the file does not have
  #timer = 0;

  constructor(server, index, file, say) {
    this.server = server;
    this.index = index;
    this.file = file;
    this.say = say;
    this.place = `applications/${index}`;
    this.graph = new AppGraph(this);
    this.panel = new AppPanel(this);
    this.toolbar = new AppToolbar(this);
    this.banner = h("p", { class: "banner", role: "alert", hidden: true });
    this.notice = h("p", { class: "banner", role: "status", data: { tone: "warn" }, hidden: true });
    const parts = [["Modules", new ModuleTable(this)], ["Connections", new ConnectionTable(this)], ["Nodes", new NodeTable()], ["Problems", new ProblemTable(this)], ["What happened", new HappenedList()]];
    this.tables = parts.map(([, part]) => part);
    this.parts = new TabList("Lists", parts.map(([name, part]) => [name, part.element]), () => this.#present());
    this.element = h("div", { class: "app" }, this.toolbar.element, this.banner, this.notice,
      h("div", { class: "app-middle" }, this.graph.element, this.panel.element), this.parts.element);
  }

  get editable() {
    return this.server.control;
  }

  async load() {
    const [{ document, view }, palette] = await Promise.all([this.server.get(`${this.place}/document`), this.server.get(`${this.place}/palette`)]);
    this.palette = palette;
    this.document = new AppDocument(document);
    this.view = view;
    this.#draw();
    this.graph.canvas.fit();
    if (this.editable) this.#check(); // with the network
  }

  // Looking

  /** Ask how the application is. */
  async look() {
    const happened = this.tables.at(-1);
    try {
      this.status = await this.server.get(`${this.place}/status?after=${happened.last}`);
      this.#notify("");
    } catch (error) {
      this.#notify(error instanceof RefusedError ? error.message : "The server does not answer; the page goes on when it does.", "unreachable");
      return;
    }
    const wrong = happened.update(this.status);
    if (wrong) this.say(wrong);
    this.#present();
  }

  #draw() {
    this.model = modelOf(this.document.content, this.view, this.#places);
    const known = new Set([...this.model.byKey.keys(), ...this.model.links.map((link) => link.name)]);
    this.selection = new Set([...this.selection].filter((key) => known.has(key)));
    this.graph.draw(this.model);
    for (const part of this.tables) part.draw(this.model, this.view);
    const errors = this.view.problems.length;
    this.parts.setLabel(3, errors ? `Problems (${errors})` : "Problems");
    this.panel.draw();
    this.#present();
  }

  /** Show states and the selection. */
  #present() {
    if (!this.model) return;
    const { status, selection } = this;
    const [tones, problems] = [new Map(), new Map()];
    for (const box of this.model.boxes) tones.set(box.key, toneOfState(stateOfBox(box, status)?.[0]));
    for (const link of this.model.links) tones.set(link.name, toneOfState(stateOfLink(link, status)));
    for (const one of this.view.problems) if (one.id && problems.get(one.id) !== "error") problems.set(one.id, one.severity);
    this.graph.canvas.mark({ tones, problems, selected: selection });
    this.tables[this.parts.shown].update(status, selection);
    this.panel.update(status);
    this.toolbar.update();
    const runner = status.runner ? `Process ${status.runner} runs this application; here it can be watched, and stopped as a whole.` : "";
    const outdated = status.outdated ? "What runs was started before the file was saved." : "";
    setText(this.notice, runner || outdated);
    this.notice.hidden = !this.notice.textContent;
  }

  // Selecting

  select(keys) {
    this.selection = new Set(keys);
    this.panel.draw();
    this.#present();
    const [box] = keys.map((key) => this.model.byKey.get(key));
    if (keys.length === 1 && box) this.say(`${box.title}, ${stateOfBox(box, this.status)?.[0] ?? "other programs"}`);
  }

  toggle(key, on) {
    this.select(on ? [...this.selection, key] : [...this.selection].filter((one) => one !== key));
  }

  /** Select one thing, bring it into view and open its properties. */
  show(key) {
    this.select([key]);
    const box = this.model.byKey.get(key) ?? this.model.links.find((link) => link.name === key)?.from;
    if (box) this.graph.canvas.reveal(box);
    this.open();
  }

  open() {
    (this.panel.element.querySelector("input") ?? this.panel.element.querySelector("[tabindex]"))?.focus();
  }

  /** Tags of the selected modules, or null for all. */
  get chosenModules() {
    const boxes = [...this.selection].map((key) => this.model.byKey.get(key)).filter((box) => box?.tag);
    return boxes.length ? boxes.map((box) => box.tag) : null;
  }

  /** Keys of the selected connections, or null for all. */
  get chosenConnections() {
    const links = this.model.links.filter((link) => this.selection.has(link.name));
    return links.length ? links.map((link) => link.key) : null;
  }

  // Editing

  /** Change the document by `change(document)`, and have it checked. */
  edit(change) {
    if (!this.editable) return;
    change(this.document);
    this.#changed();
  }

  #changed() {
    this.#draw();
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#check(), CHECK_PAUSE);
  }

  async #check() {
    const { content } = this.document;
    try {
      const { view } = await this.server.post(`${this.place}/check`, content);
      if (content !== this.document.content) return; // it was changed meanwhile, and is checked again
      this.view = view;
      this.#notify("", "refused");
      this.#draw();
    } catch (error) {
      this.fail(error);
    }
  }

  undo() {
    if (!this.document.canUndo) return;
    this.document.undo();
    this.#changed();
    this.say("undone");
  }

  redo() {
    if (!this.document.canRedo) return;
    this.document.redo();
    this.#changed();
    this.say("done again");
  }

  async save() {
    if (!this.document.changed) return;
    clearTimeout(this.#timer);
    try {
      const saved = await this.server.post(`${this.place}/save`, this.document.content);
      this.document = new AppDocument(saved.document);
      this.view = saved.view;
      this.selection.clear();
      this.#notify("", "refused");
      this.#draw();
      if (document.activeElement === document.body) this.graph.element.focus();
      this.say("saved");
    } catch (error) {
      this.fail(error);
    }
  }

  moved(boxes) {
    const places = new Map(boxes.map(({ key, x, y }) => [key, { x, y }]));
    for (const [key, spot] of places) this.#places.set(key, spot);
    this.edit((document) => document.move(places));
  }

  /** Put all boxes into columns. */
  arrange() {
    const places = arranged(this.model.boxes, this.model.links);
    this.#places = new Map(places);
    this.edit((document) => document.move(places));
    this.graph.canvas.fit();
  }

  connect(source, target, protocol = "") {
    let id = "";
    this.edit((document) => { id = document.addConnection(source, target, protocol); });
    this.select([id]);
    this.say(`connected ${source} to ${target}`);
  }

  askToConnect() {
    if (!this.editable) return;
    const from = this.model.boxes.find((box) => this.selection.has(box.key))?.ports.find((port) => port.side === "right");
    askForConnection(this.model.boxes, from?.name ?? "", ({ source, target, protocol }) => this.connect(source, target, protocol));
  }

  /** Have a module start when a port is open. */
  wait(id, dependency) {
    const { dependencies = [] } = this.document.module(id);
    if (dependencies.some((one) => one.port === dependency.port)) return;
    this.edit((document) => document.setModule(id, { dependencies: [...dependencies, dependency] }));
    this.select([id]);
    this.say(`${this.model.byKey.get(id).title} waits for ${dependency.port}`);
  }

  askToWait() {
    const [id] = [...this.selection].filter((key) => this.document.module(key));
    if (!this.editable || !id) return;
    const others = this.model.boxes.filter((box) => box.key !== id);
    askForDependency(others, (dependency) => this.wait(id, dependency));
  }

  askToAdd() {
    if (!this.editable) return;
    askForProgram(this.palette, (fields) => {
      let id = "";
      this.edit((document) => { id = document.addModule({ ...fields, ...this.graph.freePlace }); });
      this.select([id]);
      this.graph.canvas.reveal(this.model.byKey.get(id));
      this.say(`added ${fields.name}`);
    });
  }

  /** Remove what is selected; with a module go its connections. */
  remove() {
    const boxes = this.model.boxes.filter((box) => box.id && this.selection.has(box.key));
    const links = this.model.links.filter((link) => this.selection.has(link.name) || boxes.includes(link.from) || boxes.includes(link.to));
    const ids = new Set([...boxes, ...links].map((one) => one.id).filter(Boolean));
    if (!ids.size) return;
    this.edit((document) => document.remove(ids));
    this.say(`removed ${ids.size}`);
    this.graph.element.focus();
  }

  // Controlling

  /** Ask the server to `run`, `stop`, `kill`, `connect` or `disconnect` what is selected, or all. */
  async control(word) {
    const connections = word.endsWith("connect");
    try {
      await this.server.post(`${this.place}/${word}`, connections ? { connections: this.chosenConnections } : { modules: this.chosenModules });
      this.#notify("", "refused");
    } catch (error) {
      this.fail(error);
    }
    await this.look();
  }

  /** The rate of a connection, as a text. */
  async measure(key) {
    try {
      const { messages, bytes } = await this.server.post(`${this.place}/rate`, { connections: [key] });
      return messages ? `${messages.toFixed(1)} messages and ${(bytes / 1024).toFixed(1)} KiB a second` : "no message came";
    } catch (error) {
      this.fail(error);
      return "";
    }
  }

  fail(error) {
    if (!(error instanceof RefusedError) && !(error instanceof TypeError)) throw error;
    this.#notify(error instanceof RefusedError ? error.message : "The server does not answer.", "refused");
  }

  /** Show why something cannot be done. That the server answers again ends only what said that it does not. */
  #notify(text, why = "unreachable") {
    if (!text && why === "unreachable" && this.banner.dataset.why === "refused") return;
    this.banner.dataset.why = text ? why : "";
    this.banner.dataset.tone = "bad";
    setText(this.banner, text);
    this.banner.hidden = !text;
  }
}
