// The view of the comparison with an earlier run: new failures, fixed tests, changed measurements.

import { CHANGES, MOVED, compareOutcomes, outcomesOfModel, outcomesOfRecords } from "./compare.js";
import { fill, free, h, setText } from "./dom.js";
import { csvText, percentText, saveText, shortNumber } from "./chart_helpers.js";
import { marginBar } from "./margin_bar.js";
import { badge, sign } from "./state_signs.js";
import { alignedNumber, cellLink, SortTable } from "./sort_table.js";
import { t } from "./texts.js";

const COMPARE_PAUSE = 1000; // milliseconds between two comparisons while the run goes on

/** Verdicts and measurements that differ. */
export class CompareView {
  #page;
  #older = null; // outcomes of the earlier run
  #asked = false;
  #late = 0;

  constructor(page) {
    this.#page = page;
    this.lead = h("p", { class: "compare-lead" });
    this.summary = h("p", { class: "compare-summary", role: "status" });
    this.tests = new SortTable({
      label: "changed verdicts",
      name: "changed-verdicts",
      columns: this.#testColumns(),
      empty: "no verdict changed",
    });
    this.measurements = new SortTable({
      label: "moved measurements",
      name: "moved-measurements",
      columns: this.#measurementColumns(),
      empty: "no measurement moved",
    });
    const save = h("button", { type: "button", text: "save CSV", on: { click: () => this.#save() } });
    this.rest = h("p", { class: "dim" });
    this.content = h(
      "div",
      {},
      this.summary,
      h("h2", { text: "Verdicts" }),
      this.tests.element,
      h("div", { class: "figure-head" }, h("h2", { text: "Measurements" }), save),
      this.measurements.element,
      this.rest,
    );
    this.content.hidden = true;
    this.element = h(
      "section",
      { class: "view figures compare", "aria-label": t("view.compare") },
      this.lead,
      this.content,
    );
  }

  update(changes) {
    if (!this.#asked) this.#load();
    if (!this.#older) return;
    if (changes.every) this.#refresh();
    else if (changes.tests.size || changes.plan) this.#late ||= setTimeout(() => this.#refresh(), COMPARE_PAUSE);
  }

  async #load() {
    this.#asked = true;
    setText(this.lead, "loading the earlier run …");
    try {
      const records = await this.#page.source.compare();
      if (records) this.#compareWith(records);
      else
        fill(
          this.lead,
          "There is nothing to compare this run with. Name an earlier run when you start one: ",
          h("code", { text: "testrunner --compare RUN …" }),
        );
    } catch (error) {
      this.#asked = false;
      setText(this.lead, `The earlier run cannot be read: ${error.message}`);
    }
  }

  #compareWith(records) {
    const { format } = this.#page;
    const started = records.find((record) => record.event === "run_started") ?? {};
    const ended = records.findLast((record) => record.event === "run_ended");
    const facts = [
      started.time && format.date(started.time),
      started.robot,
      started.station,
      started.version && `RTF ${started.version}`,
    ]
      .filter(Boolean)
      .join(", ");
    fill(
      this.lead,
      "Compared with ",
      h("strong", {}, free(started.run ?? "an earlier run")),
      facts && ` (${format.visible(facts)})`,
      ended && badge(ended.verdict),
    );
    this.#older = outcomesOfRecords(records);
    this.content.hidden = false;
    this.#refresh();
  }

  #refresh() {
    clearTimeout(this.#late);
    this.#late = 0;
    const { tests, measurements, same } = compareOutcomes(this.#older, outcomesOfModel(this.#page.model));
    this.tests.rows = tests;
    this.measurements.rows = measurements;
    const counts = CHANGES.map((change) => [change, tests.filter((row) => row.change === change).length]).filter(
      ([, count]) => count > 0,
    );
    fill(
      this.summary,
      counts.map(([change, count]) => changeBadge(change, `${count} ${counted(change, count)}`)),
      h("span", { class: "dim", text: `${same.tests} unchanged` }),
    );
    const moved = measurements.filter((row) => !row.changed).length;
    const rest = [
      `${measurements.length - moved} changed their verdict`,
      `${moved} moved`,
      `${same.still} moved by less than ${percentText(MOVED)} of their range`,
      `${same.measurements} are the same`,
    ];
    setText(this.rest, `${rest.join(", ")}.`);
  }

  #testColumns() {
    const { hashOf } = this.#page;
    const known = (row) =>
      row.change === "missing test" ? free(row.name) : cellLink(hashOf(row.test), row.name, row.test);
    return [
      {
        key: "change",
        label: "Change",
        value: (row) => CHANGES.indexOf(row.change),
        cell: (row) => changeBadge(row.change, row.change),
      },
      { key: "test", label: "Test", value: (row) => row.test, cell: known },
      {
        key: "before",
        label: "Before",
        value: (row) => row.before ?? "",
        cell: (row) => row.before && badge(row.before),
      },
      { key: "now", label: "Now", value: (row) => row.now ?? "", cell: (row) => row.now && badge(row.now) },
    ];
  }

  #measurementColumns() {
    const { format, hashOf } = this.#page;
    const signed = (value) => (value > 0 ? `+${shortNumber(value)}` : shortNumber(value));
    return [
      {
        key: "verdict",
        label: "Verdict",
        value: (row) => Number(!row.changed),
        cell: (row) => [row.was !== row.verdict && [sign(row.was), "→ "], badge(row.verdict)],
      },
      {
        key: "test",
        label: "Test",
        value: (row) => row.test,
        cell: (row) => cellLink(hashOf(row.test), row.name, row.test),
      },
      {
        key: "subject",
        label: "Subject",
        value: (row) => row.record.subject ?? "",
        cell: (row) => free(row.record.subject ?? ""),
      },
      {
        key: "name",
        label: "Name",
        value: (row) => row.record.name,
        cell: (row) => cellLink(hashOf(row.test, row.record.subject, row.record.name), row.record.name),
      },
      {
        key: "before",
        label: "Before",
        numeric: true,
        value: (row) => row.before,
        cell: (row) => alignedNumber(format.number(row.before)),
      },
      {
        key: "now",
        label: "Now",
        numeric: true,
        value: (row) => row.now,
        cell: (row) => h("strong", {}, alignedNumber(format.number(row.now))),
      },
      { key: "unit", label: "Unit", cell: (row) => row.unit },
      {
        key: "difference",
        label: "Change",
        numeric: true,
        first: -1,
        value: (row) => Math.abs(row.difference),
        cell: (row) => alignedNumber(signed(row.difference)),
      },
      {
        key: "relative",
        label: "Of range",
        numeric: true,
        first: -1,
        title: "change as a share of the allowed range; without one, of the earlier value",
        value: (row) => Math.abs(row.share),
        cell: (row) => percentText(row.share),
      },
      {
        key: "bar",
        label: "Now within limits",
        cell: (row) => [
          marginBar(row.record, format),
          row.limits && h("abbr", { class: "dim", title: "the limits are not those of the earlier run", text: " ≠" }),
        ],
      },
    ];
  }

  #save() {
    const head = [
      "verdict before",
      "verdict now",
      "test",
      "subject",
      "name",
      "before",
      "now",
      "unit",
      "change",
      "change of range",
    ];
    const rows = this.measurements.sorted.map((row) => [
      row.was,
      row.verdict,
      row.test,
      row.record.subject ?? "",
      row.record.name,
      row.before,
      row.now,
      row.unit,
      row.difference,
      row.share,
    ]);
    saveText("comparison.csv", csvText([head, ...rows]));
  }
}

/** A change with the sign and the colour of its result. */
function changeBadge(change, text) {
  const states = {
    "newly failing": "failed",
    fixed: "passed",
    "other verdict": "flaky",
    "new test": "planned",
    "missing test": "skipped",
  };
  return badge(states[change], text);
}

function counted(change, count) {
  return count > 1 && /test|verdict/.test(change) ? `${change}s` : change;
}
