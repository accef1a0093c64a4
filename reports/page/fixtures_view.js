// The view of the fixtures: a timeline for each suite, and a list of all incidents.

import { fill, free, h, setText } from "./dom.js";
import { clockText } from "./chart_helpers.js";
import { readPlace } from "./format.js";
import { folded } from "./long_text.js";
import { badge } from "./state_signs.js";
import { t } from "./texts.js";
import { Timeline, timelineLegend } from "./timeline.js";

const GROWTH = 1000; // milliseconds between two drawings while the run goes on
const FEW = 5; // number of incidents whose last output is shown unfolded

/** Timelines and incidents of all suites that have fixtures. */
export class FixturesView {
  #page;
  #timelines = new Map(); // suite id -> Timeline
  #listed = 0;
  #stale = new Set(); // ids of suites that changed since their timeline was drawn
  #drawn = -Infinity;

  constructor(page) {
    this.#page = page;
    this.empty = h("p", {
      class: "dim",
      text: "This run has no fixtures: nothing was set up for its tests to stand on.",
    });
    this.legend = timelineLegend();
    this.charts = h("div", { class: "timelines" });
    this.heading = h("h2", { text: "Incidents" });
    this.none = h("p", { class: "dim", text: "none" });
    this.incidents = h("ol", { class: "incidents" });
    this.element = h(
      "section",
      { class: "view figures fixtures", "aria-label": t("view.fixtures") },
      this.empty,
      this.legend,
      this.charts,
      this.heading,
      this.none,
      this.incidents,
    );
  }

  /** At a fixture, `suite` or `suite/fixture`: bring its timeline into view. */
  show(place) {
    const { suite, test } = readPlace(place ?? "");
    this.#timelines.get(suite)?.reveal(test.slice(suite.length + 1));
  }

  update(changes) {
    for (const id of changes.suites) this.#stale.add(id);
    if (changes.plan || changes.run || performance.now() - this.#drawn > GROWTH) this.#refresh();
  }

  /** The page calls this several times a second while the run goes on: what lasts grows. */
  tick() {
    if (performance.now() - this.#drawn < GROWTH) return;
    for (const suite of this.#page.model.suites.values()) if (suite.started && !suite.ended) this.#stale.add(suite.id);
    if (this.#stale.size) this.#refresh();
  }

  #refresh() {
    this.#drawn = performance.now();
    const suites = [...this.#page.model.suites.values()].filter((suite) => suite.fixtures.size > 0);
    this.empty.hidden = suites.length > 0;
    this.heading.hidden = this.legend.hidden = suites.length === 0;
    for (const suite of suites) {
      if (!this.#timelines.has(suite.id)) this.#add(suite);
      if (this.#stale.has(suite.id)) this.#timelines.get(suite.id).draw();
    }
    this.#stale.clear();
    this.#list(suites);
  }

  #add(suite) {
    const timeline = new Timeline(this.#page, suite);
    this.#timelines.set(suite.id, timeline);
    this.charts.append(timeline.element);
  }

  #list(suites) {
    const all = suites.flatMap((suite) => [...suite.fixtures.values()].flatMap((fixture) => fixture.incidents));
    this.none.hidden = all.length > 0 || suites.length === 0;
    setText(this.heading, all.length ? `Incidents (${all.length})` : "Incidents");
    if (all.length === this.#listed) return;
    this.#listed = all.length;
    all.sort((a, b) => a.time - b.time);
    fill(
      this.incidents,
      all.map((incident) => this.#incident(incident, all.length <= FEW)),
    );
  }

  #incident(incident, open) {
    const { model, format, hashOf } = this.#page;
    const { started } = model;
    const test = model.tests.get(incident.test);
    const facts = [
      `generation ${incident.generation ?? 1}`,
      incident.phase && `in ${incident.phase}`,
      endOf(incident),
    ]
      .filter(Boolean)
      .join(", ");
    const stood =
      incident.test &&
      h("span", {}, "under ", h("a", { href: hashOf(incident.test) }, free(test?.name ?? incident.test)));
    return h(
      "li",
      {},
      h(
        "p",
        { class: "incident-head" },
        h("time", {
          title: format.date(incident.time),
          text: clockText(incident.time - (started?.time ?? incident.time), 0.01),
        }),
        badge("collapsed", "incident"),
        h("strong", {}, free(incident.fixture)),
        h("span", { class: "dim", text: facts }),
        stood || h("span", { class: "dim", text: "no test was running" }),
      ),
      free(incident.cause, "p", { class: "incident-cause" }),
      incident.output &&
        folded("last output", incident.output, { clean: format.visibleOutput, className: "mono", open }),
      incident.traceback && folded("traceback", incident.traceback, { className: "mono" }),
    );
  }
}

/** How the process ended, unless the cause says so already. */
function endOf({ exit_status: status, signal, cause = "" }) {
  if (signal && !cause.includes(signal)) return `killed by ${signal}`;
  return status !== undefined && status !== null && !cause.includes("exit status") ? `exit status ${status}` : "";
}
