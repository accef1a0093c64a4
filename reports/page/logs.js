// The page of a log: filters above, records that follow the file or stand still, and one record whole below.

import { h, setText } from "./dom.js";
import { LogFilters } from "./logs_filters.js";
import { drawLogRow, logEntry, makeLogRow } from "./logs_entry.js";
import { LogRequestError, LogWindow, askServer } from "./logs_window.js";
import { Rows, rowHeight } from "./virtual_list.js";

const LOOK = 500; // milliseconds between two looks for new records
const NEAR = 100; // rows from an end of the window at which more is asked for
const NUMBERS = new Intl.NumberFormat("en");
const UNREACHABLE = "The server does not answer; the page goes on when it does.";

class LogsPage {
  constructor() {
    this.window = new LogWindow();
    this.filters = new LogFilters(() => this.#again());
    this.file = h("bdi", { class: "free dim" });
    this.count = h("span", { class: "dim number" });
    this.state = h("span", { class: "dim", role: "status" });
    this.follow = h("button", { type: "button", title: "key f", on: { click: () => this.#toggle() } }, "follow");
    this.problem = h("p", { class: "banner refused", role: "alert", data: { tone: "warn" } });
    this.empty = h("p", { class: "empty", text: "No record matches." });
    this.entry = h("div", { class: "entry", role: "region", "aria-label": "Record", tabindex: "0" });
    this.rows = new Rows({
      label: "Records", height: rowHeight(26), key: (record) => record.number, make: makeLogRow, draw: drawLogRow,
      pick: (record) => this.entry.hidden || this.#open(record), open: (record) => this.#open(record), follow: true,
    });
    this.rows.onFollow = (on) => this.#followed(on);
    for (const hidden of [this.problem, this.empty, this.entry]) hidden.hidden = true;
    document.body.replaceChildren(
      h("header", { class: "logs-head" }, h("h1", { text: "Log" }), this.file, this.count, this.state),
      h("main", { class: "log logs" }, h("div", { class: "bar", role: "search" }, this.filters.element, this.follow),
        this.problem, this.rows.element, this.empty, this.entry));
  }

  async start() {
    this.rows.element.addEventListener("scroll", () => this.#work());
    document.addEventListener("keydown", (event) => this.#pressed(event));
    document.addEventListener("visibilitychange", () => this.#work());
    this.#again();
    this.#followed(true);
    setInterval(() => this.#look(), LOOK);
    const facts = await askServer("facts");
    setText(this.file, facts.file);
    document.title = `Log ${facts.file.split("/").pop()}`;
  }

  // What is asked of the server, one request after the other

  #again() {
    this.window.reset(this.filters.values);
    this.refused = false;
    this.#present();
    this.#work();
  }

  #look() {
    this.due = true; // it is time to look for new records
    this.#work();
  }

  async #work() {
    if (this.busy || this.refused || document.hidden) return;
    const step = this.#next();
    if (!step) return;
    const { window } = this;
    const { stop } = window;
    this.busy = true;
    try {
      await step();
      this.#showProblem("");
    } catch (error) {
      if (stop === window.stop && !stop.signal.aborted) this.#failed(error);
    } finally {
      this.busy = false;
    }
    this.#present();
    if (!this.problem.hidden) return;
    this.#work();
  }

  /** The next request, or nothing. */
  #next() {
    const { window, rows } = this;
    if (!window.loaded) return this.fromStart ? () => window.showBeginning() : () => window.showEnd();
    if (rows.follow && this.due) {
      this.due = false;
      return () => window.follow();
    }
    const { scrollTop, clientHeight } = rows.element;
    const space = NEAR * rows.height;
    if (scrollTop < space && window.hasOlder) return () => this.#addOlder();
    const below = rows.items.length * rows.height - scrollTop - clientHeight;
    return !rows.follow && below < space && window.hasNewer ? () => window.addNewer() : null;
  }

  async #addOlder() {
    const { element, height, follow } = this.rows;
    const added = await this.window.addOlder();
    const atTop = element.scrollTop === 0;
    this.#present();
    if (atTop && !follow) element.scrollTop = added * height; // the list holds its place everywhere but there
  }

  #failed(error) {
    this.refused = error instanceof LogRequestError && error.refused;
    this.#showProblem(error instanceof LogRequestError ? error.message : UNREACHABLE);
  }

  #showProblem(text) {
    this.problem.hidden = !text;
    setText(this.problem, text);
  }

  // What is shown

  #present() {
    const { window, rows } = this;
    if (rows.items !== window.items) rows.setItems(window.items);
    const all = Math.max(0, window.newest - window.oldest + 1);
    const searching = window.loaded && !window.items.length && window.hasOlder;
    this.empty.hidden = !window.loaded || window.items.length > 0;
    setText(this.empty, searching ? `Searching… ${NUMBERS.format(window.low)} records are left.` : all ? "No record matches." : "Nothing was logged yet.");
    rows.element.hidden = !this.empty.hidden;
    setText(this.count, window.loaded ? `${NUMBERS.format(all)} records in the file` : "");
  }

  #followed(on) {
    this.follow.setAttribute("aria-pressed", String(on));
    setText(this.state, on ? "following" : "paused");
  }

  async #open(record) {
    this.shown = record.number;
    try {
      const whole = await askServer(`records/${record.number}`);
      if (this.shown === record.number) this.#show(record.number, logEntry(whole));
    } catch (error) {
      this.#show(record.number, h("p", { text: error instanceof LogRequestError ? error.message : UNREACHABLE }));
    }
  }

  #show(number, contents) {
    const close = h("button", { type: "button", class: "quiet", text: "close", on: { click: () => this.#close() } });
    this.entry.replaceChildren(h("p", { class: "entry-head" }, h("strong", { class: "number", text: `Record ${number}` }), close), contents);
    this.entry.hidden = false;
    this.entry.scrollTop = 0;
    this.rows.reveal();
  }

  #close() {
    this.shown = null;
    this.entry.hidden = true;
    this.rows.element.focus();
  }

  // What is pressed

  #toggle() {
    if (this.rows.follow) this.rows.setFollow(false);
    else this.#jump(false);
  }

  /** Go to the beginning of the log, or to its end and follow it. */
  #jump(fromStart) {
    this.fromStart = fromStart;
    this.rows.setFollow(!fromStart);
    this.#again();
  }

  #pressed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select")) return;
    if (event.target.closest("button") && (event.key === "Enter" || event.key === " ")) return;
    if (this.#press(event.key)) event.preventDefault();
  }

  #press(key) {
    if (key === "f") this.#toggle();
    else if (key === "/") this.filters.focus();
    else if (key === "g") this.#jump(true);
    else if (key === "G") this.#jump(false);
    else if (key === "Escape" && !this.entry.hidden) this.#close();
    else return this.rows.press(key);
    return true;
  }
}

new LogsPage().start();
