// The view of the environment: everything that is needed to repeat the run.

import { fill, free, h } from "./dom.js";
import { folded } from "./long_text.js";
import { badge } from "./state_signs.js";
import { cellLink, SortTable } from "./sort_table.js";
import { t } from "./texts.js";

const STAGES = { 1: "after the running test", 2: "now", 3: "by force" };

/** Facts of the run, problems of its files, its suites, and the parameters of its tests. */
export class EnvironmentView {
  #page;
  #rows = new Map(); // test id -> {parameters, rows}

  constructor(page) {
    this.#page = page;
    this.command = h("p", { class: "command" });
    this.facts = h("dl", { class: "facts" });
    this.problems = h("div", { class: "problems" });
    this.suites = h("div", { class: "suite-facts" });
    this.filter = h("input", {
      type: "search",
      "aria-label": "filter parameters by test, name, value or source",
      placeholder: "test, name, value or source",
      on: { input: () => this.#filterParameters() },
    });
    this.parameters = new SortTable({ label: "parameters", columns: this.#columns(), empty: "no parameters" });
    this.element = h(
      "section",
      { class: "view figures environment", "aria-label": t("view.environment") },
      this.command,
      this.facts,
      this.problems,
      h("h2", { text: "Suites" }),
      this.suites,
      h("h2", { text: "Parameters" }),
      h("div", { class: "bar" }, this.filter),
      this.parameters.element,
    );
  }

  update(changes) {
    if (changes.run) {
      this.#fillFacts();
      this.#fillProblems();
    }
    if (changes.plan) this.#fillSuites();
    this.#fillParameters(changes.tests);
  }

  #fillFacts() {
    const { started, resumed, ended, interrupted } = this.#page.model;
    if (!started) return;
    const environment = started.environment ?? {};
    const rows = [
      ["run", started.run],
      ["robot", started.robot],
      ["station", started.station],
      ...Object.entries(started.device ?? {}).map(([key, value]) => [`device: ${key}`, value]),
      ["RTF version", started.version],
      ["seed", started.seed],
      ["started", this.#moment(started.time)],
      ["resumed", resumed && this.#moment(resumed.time)],
      ["ended", ended ? this.#moment(ended.time) : "not yet"],
      ["interrupted", interrupted && (STAGES[interrupted.stage] ?? `stage ${interrupted.stage}`)],
      ["interrupted by", interrupted?.source],
      ...Object.entries(environment),
    ];
    const given = rows.filter(([, value]) => value !== undefined && value !== null && value !== "");
    fill(this.command, this.#command(resumed ?? started));
    fill(
      this.facts,
      given.map(([name, value]) => h("div", {}, h("dt", { text: name }), free(String(value), "dd"))),
    );
  }

  /** The command line, quoted for a shell, with a button that copies it. */
  #command(record) {
    if (!record.command?.length) return null;
    const line = ["testrunner", ...record.command.map(quoted)].join(" ");
    const copy = h("button", { type: "button", text: "copy", on: { click: () => this.#copy(line, copy) } });
    return [free(line, "code"), copy];
  }

  async #copy(line, button) {
    try {
      await navigator.clipboard.writeText(line);
      button.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(button.previousSibling); // a page from a file may not write to the clipboard
      button.textContent = "marked: copy it with Ctrl+C";
    }
  }

  #moment(time) {
    return `${this.#page.format.date(time)}  (${new Date(time * 1000).toISOString().replace("T", " ").slice(0, 19)} UTC)`;
  }

  #fillProblems() {
    const { diagnostics, internalErrors } = this.#page.model;
    const place = ({ file, line, column }) => [file, line, column].filter(Boolean).join(":");
    const said = diagnostics.map((one) =>
      h(
        "li",
        {},
        badge(one.severity ?? "warning"),
        free(place(one), "code"),
        free(one.text),
        one.hint && free(one.hint, "span", { class: "dim" }),
      ),
    );
    const broken = internalErrors.map((one) =>
      h(
        "li",
        {},
        badge("error"),
        free(one.text),
        one.traceback && folded("traceback", one.traceback, { className: "mono" }),
      ),
    );
    fill(
      this.problems,
      said.length > 0 && [
        h("h2", { text: "About the files and the command line" }),
        h("ul", { class: "diagnostics" }, said),
      ],
      broken.length > 0 && [h("h2", { text: "Errors of the framework" }), h("ul", { class: "diagnostics" }, broken)],
    );
  }

  #fillSuites() {
    const row = ({ planned, tests }) =>
      h(
        "tr",
        {},
        h("th", { scope: "row" }, free(planned.name)),
        h("td", {}, free(planned.file ?? "", "code")),
        h("td", {}, free(planned.environment ?? "", "code")),
        h("td", {}, free(planned.description ?? "")),
        h("td", { class: "number", text: tests.length }),
      );
    const head = h(
      "tr",
      {},
      ["Suite", "File", "Environment", "Description", "Tests"].map((text) => h("th", { scope: "col", text })),
    );
    fill(
      this.suites,
      h(
        "div",
        { class: "scroll", role: "region", tabindex: 0, "aria-label": "suites, scrolls" },
        h(
          "table",
          { class: "table" },
          h("thead", {}, head),
          h("tbody", {}, [...this.#page.model.suites.values()].map(row)),
        ),
      ),
    );
  }

  #fillParameters(ids) {
    let changed = false;
    for (const id of ids) {
      const test = this.#page.model.tests.get(id);
      const parameters = test.attempt?.parameters ?? [];
      if (this.#rows.get(id)?.parameters === parameters) continue;
      this.#rows.set(id, { parameters, rows: parameters.map((parameter) => shownParameter(test, parameter)) });
      changed = true;
    }
    if (changed) this.#filterParameters();
  }

  #filterParameters() {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const all = [...this.#rows.values()].flatMap(({ rows }) => rows);
    this.parameters.rows = all.filter((row) => words.every((word) => row.text.includes(word)));
  }

  #columns() {
    const { format, hashOf } = this.#page;
    const plain = (key, label) => ({
      key,
      label,
      value: (row) => row.parameter[key] ?? "",
      cell: (row) => free(row.parameter[key] ?? "", "span", { title: format.visible(row.parameter[key]) }),
    });
    return [
      {
        key: "test",
        label: "Test",
        value: (row) => row.test.id,
        cell: (row) => cellLink(hashOf(row.test.id), row.test.name, row.test.id),
      },
      plain("name", "Name"),
      plain("value", "Value"),
      plain("unit", "Unit"),
      plain("source", "Source"),
    ];
  }
}

function shownParameter(test, parameter) {
  const text = [test.id, test.name, parameter.name, parameter.value, parameter.source].join("\n").toLowerCase();
  return { test, parameter, text };
}

/** An argument, quoted for a POSIX shell. */
function quoted(argument) {
  return /^[\w@%+=:,./-]+$/.test(argument) ? argument : `'${argument.replaceAll("'", "'\\''")}'`;
}
