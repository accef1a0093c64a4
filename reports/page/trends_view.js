// The view of the trends over the last runs: drifting measurements, flaky tests.

import { NOT_CARRIED_OUT } from "./compare.js";
import { fill, free, h, setText } from "./dom.js";
import { linkTo } from "./format.js";
import { badge, toneOf } from "./state_signs.js";
import { alignedNumber, cellLink, SortTable } from "./sort_table.js";
import { sparkline, verdictStrip } from "./sparkline.js";
import { t } from "./texts.js";
import { TrendPlot } from "./trend_plot.js";

const SHOWN_PLACES = 4;
const STABLE = 1; // the pass rate from which on a test is not shown

/** The history of the tests and measurements of this run. */
export class TrendsView {
  #page;
  #asked = false;
  #history = null;
  #measurements = [];
  #plot = null;

  constructor(page) {
    this.#page = page;
    this.lead = h("p", { class: "trends-lead" });
    this.filter = h("input", {
      type: "search",
      "aria-label": "filter trends by test, subject or name",
      placeholder: "test, subject or name",
      on: { input: () => this.#filter() },
    });
    this.table = new SortTable({
      label: "trends of measurements",
      name: "trends-of-measurements",
      columns: this.#columns(),
      fallback: byConcern,
      empty: "no measurements",
    });
    this.detail = h("div", { class: "trend-detail" });
    this.tests = new SortTable({
      label: "tests that did not always pass",
      name: "unsteady-tests",
      columns: this.#testColumns(),
      fallback: (a, b) => b.flaky - a.flaky || a.rate[0] - b.rate[0],
      empty: "every test passed in all of these runs",
    });
    this.stable = h("p", { class: "dim" });
    this.content = h(
      "div",
      {},
      h("h2", { text: "Tests that did not always pass" }),
      this.tests.element,
      this.stable,
      h("h2", { text: "Measurements" }),
      h("div", { class: "bar" }, this.filter),
      this.detail,
      this.table.element,
    );
    this.content.hidden = true;
    this.element = h(
      "section",
      { class: "view figures trends", "aria-label": t("view.trends") },
      this.lead,
      this.content,
    );
  }

  update() {
    if (!this.#asked) this.#load();
  }

  async #load() {
    this.#asked = true;
    setText(this.lead, "loading the history …");
    try {
      this.#history = await this.#page.source.history();
      if (this.#history?.runs.length) this.#fill();
      else
        fill(
          this.lead,
          "There is no history yet. Keep one by starting runs with ",
          h("code", { text: "testrunner --history …" }),
        );
    } catch (error) {
      this.#asked = false;
      setText(this.lead, `The history cannot be read: ${error.message}`);
    }
  }

  #fill() {
    const { runs, measurements, tests } = this.#history;
    const [first, last] = [runs[0], runs[runs.length - 1]];
    const { date, visible } = this.#page.format;
    const places = new Set(runs.map((run) => [run.robot, run.station].filter(Boolean).join(" on ")));
    const named = places.size > SHOWN_PLACES ? [`${places.size} robots`] : places;
    const lead = [`${runs.length} runs from ${date(first.started)} to ${date(last.started)}`, ...named];
    setText(this.lead, visible(lead.filter(Boolean).join("; ")));
    this.#measurements = Object.entries(measurements).map(([key, item]) => trendRow(key, item));
    const judged = Object.entries(tests).map(([id, item]) => ({
      id,
      flaky: Number(item.flaky),
      rate: item.pass_rate,
      verdicts: item.verdicts,
      judged: item.verdicts.filter((one) => one !== null && !NOT_CARRIED_OUT.has(one)).length,
    }));
    const unsteady = judged.filter((row) => row.flaky || (row.rate[0] < STABLE && isJudged(row.rate)));
    this.tests.rows = unsteady;
    setText(this.stable, `${judged.length - unsteady.length} tests passed whenever they were judged.`);
    this.content.hidden = false;
    this.#filter();
  }

  #filter() {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    this.table.rows = this.#measurements.filter((row) => words.every((word) => row.text.includes(word)));
  }

  #open(row, button) {
    this.#plot?.destroy();
    const close = h("button", { type: "button", text: "close", on: { click: () => this.#close(button) } });
    this.#plot = new TrendPlot(this.#page, row, this.#history.runs);
    fill(this.detail, h("div", { class: "figure-head" }, h("h3", {}, free(row.title)), close), this.#plot.element);
    this.detail.scrollIntoView({ block: "nearest" });
    close.focus({ preventScroll: true });
  }

  #close(button) {
    this.#plot.destroy();
    this.#plot = null;
    fill(this.detail);
    if (button.isConnected) button.focus();
  }

  #columns() {
    const { format } = this.#page;
    const count = () => this.#history.runs.length;
    return [
      { key: "test", label: "Test", value: (row) => row.test, cell: (row) => this.#testLink(row.test) },
      { key: "subject", label: "Subject", value: (row) => row.subject, cell: (row) => free(row.subject) },
      { key: "name", label: "Name", value: (row) => row.name, cell: (row) => free(row.name) },
      { key: "spark", label: "Runs", cell: (row) => this.#sparkButton(row, count()) },
      {
        key: "last",
        label: "Last",
        numeric: true,
        value: (row) => row.last.value,
        cell: (row) =>
          h(
            "strong",
            { data: { tone: toneOf(row.last.verdict) } },
            alignedNumber(row.last.value === null ? "" : format.number(row.last.value)),
          ),
      },
      { key: "unit", label: "Unit", cell: (row) => row.unit },
      { key: "limits", label: "Limits", cell: (row) => free(format.limits(row.last.low, row.last.high)) },
      {
        key: "drift",
        label: "Drift",
        first: 1,
        title: "change from run to run; p is how likely it is to be chance",
        value: (row) => row.drift?.p ?? null,
        cell: (row) => driftWords(row, format),
      },
      {
        key: "after",
        label: "At limit",
        numeric: true,
        title: "runs until the drift reaches a limit",
        value: (row) => row.after,
        cell: (row) => (row.after === null ? "" : row.after === 0 ? "now" : `in ${row.after} runs`),
      },
      {
        key: "rate",
        label: "Passed",
        numeric: true,
        title: "runs that passed of those that were judged, and the 95 % interval of the rate",
        value: (row) => (isJudged(row.rate) ? row.rate[0] : null),
        cell: (row) => rateWords(row.rate, row.judged),
      },
    ];
  }

  #testColumns() {
    return [
      { key: "test", label: "Test", value: (row) => row.id, cell: (row) => this.#testLink(row.id) },
      { key: "flaky", label: "Flaky", cell: (row) => (row.flaky ? badge("flaky") : null) },
      { key: "strip", label: "Runs", cell: (row) => verdictStrip(row.verdicts, this.#history.runs, this.#page.format) },
      {
        key: "rate",
        label: "Passed",
        numeric: true,
        value: (row) => row.rate[0],
        cell: (row) => rateWords(row.rate, row.judged),
      },
    ];
  }

  #testLink(id) {
    const test = this.#page.model.tests.get(id);
    return test ? cellLink(linkTo(id), test.name, id) : free(id);
  }

  #sparkButton(row, count) {
    const button = h(
      "button",
      {
        type: "button",
        class: "spark-button",
        "aria-label": `plot ${row.title}`,
        on: { click: () => this.#open(row, button) },
      },
      sparkline(row.points, count),
    );
    return button;
  }
}

function trendRow(key, item) {
  const [test, subject, name] = key.split("\n");
  const points = item.points.map(([run, value, low, high, verdict]) => ({
    run,
    value,
    low: low ?? null,
    high: high ?? null,
    verdict,
  }));
  const judged = new Set(points.filter((point) => point.verdict !== "recorded").map((point) => point.run)).size;
  const believed = item.drift?.believed ?? false;
  return {
    test,
    subject,
    name,
    unit: item.unit ?? "",
    points,
    judged,
    drift: item.drift,
    believed,
    after: believed ? (item.drift.after ?? null) : null,
    rate: item.pass_rate,
    last: points[points.length - 1],
    title: [name, subject, test].filter(Boolean).join(" · "),
    text: key.toLowerCase(),
  };
}

/** Order: the fewest runs to a limit, then the lowest pass rate, then drifts. */
function byConcern(one, other) {
  const concern = (row) => [row.after ?? Infinity, isJudged(row.rate) ? row.rate[0] : 1, row.believed ? 0 : 1];
  const [a, b] = [concern(one), concern(other)];
  const index = a.findIndex((value, place) => value !== b[place]);
  return index < 0 ? 0 : a[index] - b[index];
}

/** Without verdicts only the interval is shown. */
function isJudged([, low, high]) {
  return high - low < 1;
}

function driftWords({ drift, believed }, format) {
  if (!drift) return h("span", { class: "dim", text: "too few runs of one robot" });
  const p = drift.p < 0.001 ? "p < 0.001" : `p = ${drift.p.toFixed(3)}`;
  const sign = drift.slope > 0 ? "↗ +" : drift.slope < 0 ? "↘ " : "";
  const slope = `${sign}${format.number(Number(drift.slope.toPrecision(3)))} ${drift.unit}`;
  return h(
    "span",
    { class: believed ? "" : "dim", title: believed ? null : "may well be chance" },
    slope,
    h("span", { class: "dim", text: ` ${p}` }),
  );
}

/** `48/50, 86–99 %`: passed of judged runs, and the interval of the rate. */
function rateWords(rate, judged) {
  if (!isJudged(rate)) return h("span", { class: "dim", text: "never judged" });
  const [share, low, high] = rate;
  const interval = `${Math.round(low * 100)}–${Math.round(high * 100)} %`;
  return `${Math.round(share * judged)}/${judged}, ${interval}`;
}
