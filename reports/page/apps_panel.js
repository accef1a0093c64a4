// What is selected: the texts of a module or connection, to be edited, its state, and its problems.

import { fill, free, h, setText } from "./dom.js";
import { visible } from "./format.js";
import { sign } from "./state_signs.js";
import { rateOfLink, showState, stateOfBox, stateOfLink } from "./apps_states.js";

const MODULE = [
  ["name", "Program"], ["parameters", "Parameters"], ["node", "Node"], ["prefix", "Prefix of ports"], ["workdir", "Working directory"],
  ["environment", "Environment"], ["deployer", "Deployer"], ["stdio", "Terminal on node"], ["display", "Display"],
];
const CONNECTION = [["source", "From"], ["target", "To"], ["protocol", "Carrier"]];
const CHECKS = [
  ["persist", "is made again whenever both ports are open"], ["source_external", "another program opens the first port"],
  ["target_external", "another program opens the second port"],
];
const DEPENDENCY = [["port", "Port"], ["timeout", "Timeout, s"], ["request", "Request"], ["reply", "Reply"]];
export const CARRIERS = ["tcp", "fast_tcp", "udp", "mcast", "unix_stream", "text", "mjpeg"];
const OUTPUT_PAUSE = 1000; // milliseconds between two looks at the output

function textField(name, label, value, set) {
  const input = h("input", { type: "text", name, autocomplete: "off", spellcheck: "false", list: name === "protocol" ? "carriers" : null, on: { change: () => set(name, input.value) } });
  input.value = value ?? "";
  return h("label", { class: "field" }, h("span", { text: label }), input);
}

export class AppPanel {
  constructor(page) {
    this.page = page;
    this.state = h("span");
    this.reason = free("");
    this.rate = h("span", { class: "number" });
    this.written = h("div", {}, h("h3", { text: "Output" }));
    this.output = h("pre", { class: "mono output", tabindex: 0, role: "region", "aria-label": "Output" });
    this.written.append(this.output);
    this.problems = h("div");
    this.element = h("aside", { class: "apps-panel", "aria-label": "Properties", on: { focusout: () => setTimeout(() => this.late && this.draw()) } });
    setInterval(() => this.#readOutput(), OUTPUT_PAUSE);
  }

  /** Show the selection. While somebody types in a field of it, only the problems are new, and the rest follows. */
  draw() {
    const { model, selection } = this.page;
    const [key] = selection.size === 1 ? selection : [];
    const item = model.byKey.get(key) ?? model.links.find((link) => link.name === key);
    const typing = item?.id && item.id === this.item?.id && this.element.querySelector("input[type=text]:focus");
    if (item?.key !== this.item?.key || !item) this.#showOutput("");
    this.item = item;
    this.late = Boolean(typing);
    fill(this.problems, this.#problems(item?.id));
    if (!typing) fill(this.element, ...(item ? this.#one(item) : this.#several(selection)));
  }

  #several(selection) {
    const { view, model } = this.page;
    if (selection.size) return [h("h2", { text: `${selection.size} selected` }), this.#removeButton()];
    const facts = [["Modules", model.boxes.filter((box) => box.kind !== "external").length], ["Connections", model.links.length], ["Problems", view.problems.length]];
    return [free(view.name, "h2"), view.description ? free(view.description, "p") : null, h("dl", { class: "facts" }, facts.map(([name, value]) => h("div", {}, h("dt", { text: name }), h("dd", { text: value }))))];
  }

  #one(item) {
    const isBox = Boolean(item.ports);
    const { document } = this.page;
    const editable = item.id && this.page.editable;
    return [
      free(isBox ? item.title : `${item.source} → ${item.target}`, "h2"), item.kind === "external" ? h("p", { class: "dim", text: "Ports that no program of this application opens." }) : h("p", {}, this.state, " ", this.reason),
      this.problems, isBox ? this.written : null,
      editable ? this.#fields(isBox ? MODULE : CONNECTION, isBox ? document.module(item.id) : document.connection(item.id), isBox) : this.#facts(item, isBox),
      editable ? this.#removeButton() : null,
      isBox ? null : this.#rate(item),
      isBox ? (editable ? this.#dependencies(document.module(item.id)) : this.#waits(item)) : null,
      isBox ? this.#help(item) : null, isBox ? this.#ports(item) : null,
    ];
  }

  #waits({ waits }) {
    return waits?.length ? [h("h3", { text: "Waits for" }), h("ul", {}, waits.map((name) => h("li", {}, free(name, "span", { class: "mono" }))))] : null;
  }

  /** The ports for which a module waits, to be edited. */
  #dependencies({ id, dependencies = [] }) {
    const now = () => this.page.document.module(id)?.dependencies ?? [];
    const edit = (several) => this.page.edit((document) => document.setModule(id, { dependencies: several }));
    const several = dependencies.map((texts, index) => {
      const set = (name, value) => setTimeout(() => now()[index] && (now()[index][name] ?? "") !== value && edit(now().map((one, at) => (at === index ? { ...one, [name]: value } : one))));
      const remove = h("button", { type: "button", class: "quiet", text: "Wait no more", "aria-label": visible(`wait no more for ${texts.port}`), on: { click: () => edit(now().filter((_, at) => at !== index)) } });
      return h("fieldset", {}, free(texts.port, "legend", { class: "mono" }), DEPENDENCY.map(([name, label]) => textField(name, label, texts[name], set)), remove);
    });
    const add = h("button", { type: "button", text: "Wait for a port…", on: { click: () => this.page.askToWait() } });
    return [h("h3", { text: "Waits for" }), h("form", { class: "fields", on: { submit: (event) => event.preventDefault() } }, several, h("p", {}, add))];
  }

  #fields(names, texts, isBox) {
    const found = () => (isBox ? this.page.document.module(texts.id) : this.page.document.connection(texts.id));
    const edit = (fields) => this.page.edit((document) => (isBox ? document.setModule(texts.id, fields) : document.setConnection(texts.id, fields)));
    // The event comes before the focus has moved to the next field, which must not be drawn again until then.
    const set = (name, value) => setTimeout(() => found() && (found()[name] ?? "") !== value && edit({ [name]: value }));
    const fields = names.map(([name, label]) => textField(name, label, texts[name], set));
    if (!isBox) fields.push(CHECKS.map(([name, label]) => this.#check(name, label, texts, set)));
    return h("form", { class: "fields", on: { submit: (event) => event.preventDefault() } }, fields);
  }

  #check(name, label, texts, set) {
    const box = h("input", { type: "checkbox", name, on: { change: () => set(name, box.checked) } });
    box.checked = Boolean(texts[name]);
    return h("label", { class: "check" }, box, ` ${label}`);
  }

  /** The rate of a connection, and a button that measures one that is not counted, by reading its source for a moment. */
  #rate(link) {
    const found = h("span", { class: "number", role: "status" });
    const button = h("button", { type: "button", disabled: !this.page.editable, text: "Measure the rate", on: { click: async () => {
      button.disabled = true;
      setText(found, "…");
      setText(found, await this.page.measure(link.key));
      button.disabled = false;
    } } });
    return [h("p", {}, "Rate: ", this.rate), h("p", { class: "rate" }, button, " ", found)];
  }

  #facts(item, isBox) {
    const facts = isBox ? [["Command", item.command], ["Node", item.node], ["Embedded in", item.kind === "embedded" ? item.file : ""]] : [["From", item.source], ["To", item.target], ["Carrier", item.carrier]];
    return h("dl", { class: "facts" }, facts.filter(([, value]) => value).map(([name, value]) => h("div", {}, h("dt", { text: name }), free(value, "dd"))));
  }

  #removeButton() {
    return h("p", {}, h("button", { type: "button", class: "danger", disabled: !this.page.editable, text: "Remove", on: { click: () => this.page.remove() } }));
  }

  #problems(id) {
    const found = id ? this.page.view.problems.filter((one) => one.id === id) : [];
    return found.length ? h("ul", { class: "problems" }, found.map((one) => h("li", {}, sign(one.severity === "error" ? "failure" : "warning"), free(one.text), one.hint ? [" ", free(`(${one.hint})`, "span", { class: "dim" })] : null))) : null;
  }

  /** What the description of a program says of its arguments. */
  #help(box) {
    const program = this.page.palette.find((one) => one.name === box.command.split(" ", 1)[0].split("/").pop());
    if (!program) return null;
    const words = program.arguments.map((one) => h("div", {}, h("dt", { class: "mono" }, free(`--${one.name}`), one.required ? " (required)" : ""), h("dd", {}, free(one.description), one.default ? [" ", free(`default ${one.default}`, "span", { class: "dim" })] : null)));
    return [h("h3", { text: "Description" }), free(program.description, "p"), words.length ? h("dl", { class: "arguments" }, words) : null];
  }

  #ports(box) {
    if (!box.ports.length) return null;
    return [h("h3", { text: "Ports" }), h("ul", { class: "ports" }, box.ports.map((port) => h("li", {}, free(port.name, "span", { class: "mono" }), h("span", { class: "dim" }, ` ${port.kind} `, free(port.type), port.required ? ", required" : ""))))];
  }

  // What changes by itself

  update(status) {
    const { item } = this;
    if (!item) return;
    const [state, pid, reason] = item.ports ? (stateOfBox(item, status) ?? ["unknown", 0, ""]) : [stateOfLink(item, status), 0, ""];
    showState(this.state, state);
    setText(this.reason, reason || (pid ? `process ${pid}` : ""));
    if (!item.ports) setText(this.rate, rateOfLink(item, status) || "not counted");
  }

  async #readOutput() {
    const { item } = this;
    if (!item?.tag || this.reading || document.hidden || !this.element.checkVisibility()) return;
    this.reading = true;
    try {
      const lines = await this.page.server.get(`${this.page.place}/output?module=${encodeURIComponent(item.tag)}`);
      if (item === this.item) this.#showOutput(lines.join("\n"));
    } catch {
      // the status says that the server does not answer
    } finally {
      this.reading = false;
    }
  }

  #showOutput(text) {
    const { output } = this;
    this.written.hidden = !text;
    const atEnd = output.scrollTop + output.clientHeight >= output.scrollHeight - 2;
    setText(output, text);
    if (atEnd) output.scrollTop = output.scrollHeight;
  }
}
