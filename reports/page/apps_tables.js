// The tables below the graph: all that is in it, and what happened. Rows are selected by their check boxes.

import { fill, free, h, setText } from "./dom.js";
import { visible } from "./format.js";
import { formatClock } from "./logs_entry.js";
import { rateOfLink, showState, stateOfBox, stateOfLink } from "./apps_states.js";
import { sign } from "./state_signs.js";

const SHOWN = 300; // sentences of what happened
const SEVERITY = { error: "failure", warning: "warning" };
const BAD = new Set(["failed", "lost"]);

/** A row with a check box for its selection, and cells that are drawn again with each status. */
class Row {
  constructor(page, key, name, cells) {
    this.key = key;
    this.box = h("input", { type: "checkbox", "aria-label": visible(`select ${name}`), on: { change: () => page.toggle(key, this.box.checked) } });
    this.element = h("tr", { data: { row: key } }, h("td", {}, this.box), cells.map((cell) => h("td", {}, cell)));
  }

  select(on) {
    this.box.checked = on;
    this.element.classList.toggle("chosen", on);
  }
}

function table(label, heads, rows) {
  return h("table", { "aria-label": label, class: "apps-table" }, h("thead", {}, h("tr", {}, heads.map((head) => h("th", { scope: "col" }, head)))), h("tbody", {}, rows));
}

/** A head for those who do not see what the column has. */
function unseen(text) {
  return h("span", { class: "unseen", text });
}

/** The modules of an application. */
export class ModuleTable {
  constructor(page) {
    this.page = page;
    this.element = h("div");
  }

  draw({ boxes }) {
    this.rows = boxes.filter((box) => box.kind !== "external").map((box) => {
      const state = h("span");
      const [node, pid, reason] = [free(""), h("span", { class: "number" }), free("", "span", { class: "wrap" })];
      const name = h("button", { type: "button", class: "quiet", on: { click: () => this.page.show(box.key) } }, free(box.title));
      const row = new Row(this.page, box.key, box.title, [name, state, node, pid, free(box.command, "span", { class: "mono" }), free(box.kind === "embedded" ? box.file : ""), reason]);
      return Object.assign(row, { item: box, state, node, pid, reason });
    });
    fill(this.element, table("Modules", [unseen("Select"), "Program", "State", "Node", "Process", "Command", "Embedded in", "Reason"], this.rows.map((row) => row.element)));
  }

  update(status, selection) {
    for (const row of this.rows ?? []) {
      const [word, pid, reason, node] = stateOfBox(row.item, status);
      showState(row.state, word);
      setText(row.node, node);
      setText(row.pid, pid || "");
      setText(row.reason, reason);
      row.select(selection.has(row.key));
    }
  }
}

/** The connections of an application. */
export class ConnectionTable {
  constructor(page) {
    this.page = page;
    this.element = h("div");
  }

  draw({ links }) {
    this.rows = links.map((link) => {
      const state = h("span");
      const name = h("button", { type: "button", class: "quiet", on: { click: () => this.page.show(link.name) } }, free(link.source));
      const rate = h("span", { class: "number" });
      const row = new Row(this.page, link.name, `${link.source} to ${link.target}`, [name, free(link.target), state, rate, free(link.carrier), link.persist ? "persists" : ""]);
      return Object.assign(row, { item: link, state, rate });
    });
    fill(this.element, table("Connections", [unseen("Select"), "From", "To", "State", "Rate", "Carrier", unseen("Persistent")], this.rows.map((row) => row.element)));
  }

  update(status, selection) {
    for (const row of this.rows ?? []) {
      showState(row.state, stateOfLink(row.item, status));
      setText(row.rate, rateOfLink(row.item, status));
      row.select(selection.has(row.key));
    }
  }
}

/** The nodes, and their load. */
export class NodeTable {
  constructor() {
    this.element = h("div");
  }

  draw() {}

  update({ nodes }) {
    const text = JSON.stringify(nodes);
    if (text === this.shown) return;
    this.shown = text;
    const rows = Object.entries(nodes).map(([name, found]) => h("tr", {}, h("td", {}, free(name)), cells(found)));
    fill(this.element, table("Nodes", ["Node", "Load", "Processors", "Free memory", unseen("Problem")], rows));
  }
}

function cells(found) {
  if (found.error) return [h("td"), h("td"), h("td"), h("td", {}, sign("failure"), free(found.error))];
  const memory = `${(found.memory_free / 1024).toFixed(1)} of ${(found.memory_total / 1024).toFixed(1)} GiB`;
  return [h("td", { class: "number", text: found.load.toFixed(2) }), h("td", { class: "number", text: found.cores }), h("td", { class: "number", text: memory }), h("td")];
}

/** The problems of an application, each with its place. */
export class ProblemTable {
  constructor(page) {
    this.page = page;
    this.element = h("div");
  }

  draw(_model, { problems }) {
    const rows = problems.map((one) => h("tr", {},
      h("td", {}, sign(SEVERITY[one.severity] ?? "info")), h("td", {}, free(one.text, "span", { class: "wrap" }), one.hint ? [" ", free(`(${one.hint})`, "span", { class: "dim" })] : null),
      h("td", {}, one.id ? h("button", { type: "button", class: "quiet", text: "show", "aria-label": visible(`show where: ${one.text}`), on: { click: () => this.page.show(one.id) } }) : null),
      h("td", {}, free(one.place.split("/").pop(), "span", { class: "mono", title: visible(one.place) }))));
    fill(this.element, problems.length ? table("Problems", [unseen("Severity"), "Problem", unseen("Where"), "Place"], rows) : h("p", { class: "empty", text: "No problem was found." }));
  }

  update() {}
}

/** What happened, the last first. */
export class HappenedList {
  #last = 0;

  constructor() {
    this.list = h("ol", { class: "happened" });
    this.element = h("div", {}, this.list);
  }

  draw() {}

  /** Add what happened since; the last of it that went wrong is returned. */
  update({ happened }) {
    let wrong = "";
    for (const one of happened) {
      if (one.number <= this.#last) continue;
      this.#last = one.number;
      const bad = BAD.has(one.kind);
      if (bad) wrong = one.text;
      this.list.prepend(h("li", {}, h("span", { class: "number dim", text: formatClock(one.time) }), sign(bad ? "failure" : "info"), free(one.text, "span", { class: "text" })));
      if (this.list.childElementCount > SHOWN) this.list.lastChild.remove();
    }
    return wrong;
  }

  get last() {
    return this.#last;
  }
}
