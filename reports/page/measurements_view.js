// All measurements of the run in one table: failed ones first, then those closest to their limits.

import { fill, h, setText } from "./dom.js";
import { csvText, percentText, saveText, shortNumber, watchWidth } from "./chart_helpers.js";
import { marginBar, relativeMargin } from "./margin_bar.js";
import { number } from "./model.js";
import { badge } from "./state_signs.js";
import { alignedNumber, cellLink, SortTable } from "./sort_table.js";
import { stripPlot } from "./strip_plot.js";
import { t } from "./texts.js";

const WORST_FIRST = ["failed", "marginal", "passed", "recorded"];
const SLOW = 5000; // number of rows beyond which the table is not sorted with each frame
const SORT_PAUSE = 1000; // milliseconds between two sortings then

/** The measurements of the last attempt of every test. */
export class MeasurementsView {
  #page;
  #rows = new Map(); // test id -> its rows
  #verdict = "";
  #late = 0;

  constructor(page) {
    this.#page = page;
    this.table = new SortTable({
      label: "measurements",
      columns: this.#columns(),
      fallback: byUrgency,
      empty: "no measurements",
    });
    this.filter = h("input", {
      type: "search",
      "aria-label": "filter measurements by test, subject, name or unit",
      placeholder: "test, subject, name or unit",
      on: { input: () => this.#refresh() },
    });
    this.names = h("select", {
      "aria-label": "one measurement across all tests",
      on: { change: () => this.#refresh() },
    });
    this.verdicts = h("div", { class: "figure-verdicts", role: "group", "aria-label": "verdict" });
    this.count = h("p", { class: "dim", role: "status" });
    this.strip = h("div", { class: "strip-plot" });
    const save = h("button", { type: "button", text: "save CSV", on: { click: () => this.#save() } });
    this.element = h(
      "section",
      { class: "view figures measurements", "aria-label": t("view.measurements") },
      h("div", { class: "bar" }, this.filter, this.names, this.verdicts, save),
      this.count,
      this.strip,
      this.table.element,
    );
    watchWidth(this.strip, () => this.#drawStrip());
  }

  update(changes) {
    for (const id of changes.tests) this.#take(this.#page.model.tests.get(id));
    if (changes.every) this.#refresh();
    else if (changes.tests.size === 0) return;
    else if (this.table.sorted.length < SLOW) this.#refresh();
    else this.#late ||= setTimeout(() => this.#refresh(), SORT_PAUSE);
  }

  #take(test) {
    const measurements = test.attempt?.measurements ?? [];
    const known = this.#rows.get(test.id) ?? [];
    if (known[0]?.record === measurements[0] && known.length === measurements.length) return;
    this.#rows.set(
      test.id,
      measurements.map((record, index) => (known[index]?.record === record ? known[index] : urgencyRow(test, record))),
    );
  }

  #all() {
    return [...this.#rows.values()].flat();
  }

  #refresh() {
    clearTimeout(this.#late);
    this.#late = 0;
    const all = this.#all();
    this.#fillNames(all);
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const name = this.names.value;
    const matching = all.filter(
      (row) => (!name || row.record.name === name) && words.every((word) => row.text.includes(word)),
    );
    this.#fillVerdicts(matching);
    this.shown = this.#verdict ? matching.filter((row) => row.verdict === this.#verdict) : matching;
    this.table.rows = this.shown;
    setText(this.count, this.shown.length === all.length ? "" : `${this.shown.length} of ${all.length} measurements`);
    this.#drawStrip();
  }

  #fillNames(all) {
    const names = [...new Set(all.map((row) => row.record.name))].sort();
    if (names.join("\n") === this.known) return;
    this.known = names.join("\n");
    const { value } = this.names;
    fill(
      this.names,
      h("option", { value: "", text: "all measurements" }),
      names.map((name) => h("option", { value: name, text: this.#page.format.firstLine(name, 60) })),
    );
    this.names.value = value;
  }

  #fillVerdicts(matching) {
    const counts = new Map(WORST_FIRST.map((verdict) => [verdict, 0]));
    for (const row of matching) counts.set(row.verdict, (counts.get(row.verdict) ?? 0) + 1);
    const state = JSON.stringify([...counts, this.#verdict]);
    if (state === this.verdicts.dataset.state) return;
    this.verdicts.dataset.state = state;
    const focused = this.verdicts.contains(document.activeElement) ? document.activeElement.dataset.verdict : null;
    fill(
      this.verdicts,
      [...counts].map(([verdict, count]) => this.#verdictButton(verdict, count)),
    );
    if (focused) this.verdicts.querySelector(`[data-verdict="${focused}"]`)?.focus();
  }

  #verdictButton(verdict, count) {
    const press = () => {
      this.#verdict = this.#verdict === verdict ? "" : verdict;
      this.#refresh();
    };
    return h(
      "button",
      { type: "button", "aria-pressed": String(this.#verdict === verdict), data: { verdict }, on: { click: press } },
      badge(verdict),
      h("span", { class: "figure-count", text: count }),
    );
  }

  /** The plot of all rows with one name. */
  #drawStrip() {
    const rows = this.shown ?? [];
    const one =
      rows.length > 1 &&
      rows.every((row) => row.record.name === rows[0].record.name && row.record.unit === rows[0].record.unit);
    fill(this.strip, one && stripPlot(rows, this.strip.clientWidth, this.#page));
  }

  #columns() {
    const { format, hashOf } = this.#page;
    const value = (row, key) =>
      row.record[key] === undefined || row.record[key] === null ? null : number(row.record[key]);
    const quantity = (key, label) => ({
      key,
      label,
      numeric: true,
      value: (row) => value(row, key),
      cell: (row) => (value(row, key) === null ? "" : alignedNumber(format.number(value(row, key)))),
    });
    return [
      { key: "verdict", label: "Verdict", value: (row) => row.rank, cell: (row) => badge(row.verdict) },
      {
        key: "test",
        label: "Test",
        value: (row) => row.test.id,
        cell: (row) => cellLink(hashOf(row.test.id), row.test.name, row.test.id),
      },
      {
        key: "subject",
        label: "Subject",
        value: (row) => row.record.subject ?? "",
        cell: (row) => row.record.subject && cellLink(hashOf(row.test.id, row.record.subject), row.record.subject),
      },
      {
        key: "name",
        label: "Name",
        value: (row) => row.record.name,
        cell: (row) => cellLink(hashOf(row.test.id, row.record.subject, row.record.name), row.record.name),
      },
      { ...quantity("value", "Value"), cell: (row) => h("strong", {}, alignedNumber(format.number(row.value))) },
      { key: "unit", label: "Unit", cell: (row) => row.record.unit ?? "" },
      quantity("low", "Low"),
      quantity("high", "High"),
      {
        ...quantity("margin", "Margin"),
        cell: (row) => (row.record.margin === undefined ? "" : alignedNumber(shortNumber(row.record.margin))),
      },
      {
        key: "relative",
        label: "Of range",
        numeric: true,
        title: "margin as a share of the allowed range; with one limit, of that limit",
        value: (row) => row.relative,
        cell: (row) => (row.relative === null ? "" : percentText(row.relative)),
      },
      { key: "bar", label: "Within limits", cell: (row) => marginBar(row.record, format) },
    ];
  }

  #save() {
    const head = ["verdict", "test", "subject", "name", "value", "unit", "low", "high", "margin", "margin of range"];
    const rows = this.table.sorted.map(({ test, record, verdict, value, relative }) => [
      verdict,
      test.id,
      record.subject ?? "",
      record.name,
      value,
      record.unit ?? "",
      number(record.low),
      number(record.high),
      number(record.margin),
      relative,
    ]);
    saveText("measurements.csv", csvText([head, ...rows]));
  }
}

function urgencyRow(test, record) {
  const verdict = record.verdict ?? "recorded";
  const text = [test.id, test.name, record.subject ?? "", record.name, record.unit ?? ""].join("\n").toLowerCase();
  return {
    test,
    record,
    verdict,
    rank: WORST_FIRST.indexOf(verdict),
    value: number(record.value),
    relative: relativeMargin(record),
    text,
  };
}

/** Order: failed, marginal, then by the smallest remaining share of the range. */
function byUrgency(one, other) {
  return (
    one.rank - other.rank ||
    (one.relative ?? Infinity) - (other.relative ?? Infinity) ||
    one.test.index - other.test.index
  );
}
