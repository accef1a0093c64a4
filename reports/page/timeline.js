// The timeline of a suite's fixtures: a row for each fixture, with its states and the tests that used it.
//
// It is one stop of the Tab key: arrow keys go from mark to mark, Enter opens a test. The meaning of a mark is written
// below the timeline.

import { fill, free, h, setText } from "./dom.js";
import { clockText, mergeBars, svg, timeTicks, watchWidth } from "./chart_helpers.js";
import { VERDICTS } from "./model.js";
import { toneOf } from "./state_signs.js";

const LABEL = 26; // pixels for the name above a row
const LIFE = 16; // height of the bar of a generation
const TESTS = 12; // and of the tests on it
const ROW_HEIGHT = LABEL + LIFE + TESTS + 12;
const AXIS_HEIGHT = 20;
const EDGE = 8;
const THIN = 4; // bars of tests that are narrower may be merged
const WIDEST = 32; // as a multiple of the width of the page
const STATE_TONES = {
  starting: "busy",
  ready: "good",
  stopping: "idle",
  stopped: "idle",
  collapsed: "broken",
  failed: "bad",
};

/** The timeline of one suite. `draw` updates it. */
export class Timeline {
  #page;
  #suite;
  #width = 0;
  #wide = 1;
  #marks = []; // {element, text, fixture, incident?, test?, at, row} in the order of time and row
  #current = -1;

  constructor(page, suite) {
    this.#page = page;
    this.#suite = suite;
    this.title = h("h2", {}, free(suite.name));
    this.canvas = h("div", {
      class: "timeline-canvas",
      on: {
        pointerover: (event) => this.#point(event.target),
        click: (event) => this.#open(this.#markOf(event.target)),
      },
    });
    this.scroller = h(
      "div",
      {
        class: "timeline-scroll",
        role: "group",
        tabindex: 0,
        "aria-label": `timeline of ${suite.name}: arrow keys go from mark to mark, Enter opens a test`,
        on: { keydown: (event) => this.#key(event) },
      },
      this.canvas,
    );
    this.said = h("p", { class: "timeline-said", role: "status" });
    const button = (text, title, factor) =>
      h("button", {
        type: "button",
        "aria-label": `${text} ${title}`,
        title,
        text,
        on: { click: () => this.#widen(factor) },
      });
    const tools = h(
      "div",
      { class: "plot-tools", role: "toolbar", "aria-label": "timeline" },
      button("+", "look closer", 2),
      button("−", "look from further away", 0.5),
    );
    this.element = h(
      "div",
      { class: "timeline" },
      h("div", { class: "figure-head" }, this.title, tools),
      this.scroller,
      this.said,
    );
    watchWidth(this.scroller, (width) => {
      this.#width = width;
      this.draw();
    });
  }

  draw() {
    if (this.#width === 0) return;
    const { model } = this.#page;
    const begin = model.started?.time ?? 0;
    const fixtures = [...this.#suite.fixtures.values()];
    const span = spanOf(this.#suite, fixtures, this.#page.now());
    const width = Math.floor(this.#width * this.#wide);
    const x = (time) => EDGE + ((time - span.from) / (span.to - span.from)) * (width - 2 * EDGE);
    const height = fixtures.length * ROW_HEIGHT + AXIS_HEIGHT;
    const scale = { x, begin, now: span.to, model };
    this.#marks = [];
    const rows = fixtures.map((fixture, index) => this.#row(fixture, index * ROW_HEIGHT, scale));
    const axis = timeTicks(span.from - begin, span.to - begin, Math.max(2, width / 110)).map(({ at, text }) =>
      tickMark(x(at + begin), height, text, width),
    );
    fill(
      this.canvas,
      svg(
        "svg",
        { class: "timeline-picture", width, height, viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" },
        axis,
        rows,
      ),
    );
    this.#marks.sort((a, b) => a.row - b.row || a.at - b.at);
    if (this.#current >= this.#marks.length) this.#current = -1;
    this.#show(this.#current);
  }

  /** Scroll to this suite, and go to the first incident, or else the first mark, of a fixture. */
  reveal(fixture) {
    this.element.scrollIntoView({ block: "nearest" });
    const ofFixture = this.#marks.filter((mark) => mark.fixture === fixture);
    const mark = ofFixture.find((one) => one.incident) ?? ofFixture[0];
    if (!mark) return;
    this.scroller.focus({ preventScroll: true });
    this.#show(this.#marks.indexOf(mark));
  }

  #row(fixture, top, scale) {
    const { visible } = this.#page.format;
    const count = fixture.generations.length;
    const facts = [
      fixture.state || "not started",
      count > 1 && `${count} generations`,
      fixture.incidents.length &&
        `${fixture.incidents.length} ${fixture.incidents.length > 1 ? "incidents" : "incident"}`,
    ]
      .filter(Boolean)
      .join(", ");
    const label = svg(
      "text",
      { class: "timeline-name", x: EDGE, y: top + LABEL - 12 },
      visible(fixture.name),
      svg("tspan", { class: "timeline-facts", dx: 8, text: facts }),
    );
    const life = fixture.generations.flatMap((one) => this.#life(fixture, one, top, scale));
    const tests = this.#tests(fixture, top, scale);
    const incidents = fixture.incidents.map((one) => this.#incident(fixture, one, top, scale));
    return svg(
      "g",
      {},
      svg("path", { class: "timeline-base", d: `M0 ${top + ROW_HEIGHT - 6}H100000` }),
      label,
      life,
      tests,
      incidents,
    );
  }

  /** A generation: a bar for each of its states, until the next. */
  #life(fixture, generation, top, { x, begin, now }) {
    const bars = generation.changes.map((change, index) => ({
      change,
      until: generation.changes[index + 1]?.time ?? now,
    }));
    return bars
      .filter(({ change }) => change.state !== "stopped")
      .map(({ change, until }) => {
        const from = x(change.time);
        const width = Math.max(change.state === "failed" ? 6 : 1.5, x(Math.max(until, change.time)) - from);
        const name =
          fixture.generations.length > 1 ? `${fixture.name}, generation ${generation.number}` : fixture.name;
        const end = change.state === "failed" ? change.time : until;
        const text = [
          `${name}: ${change.state} ${period(change.time, end, begin)}`,
          change.detail,
          change.pid && `process ${change.pid}`,
        ]
          .filter(Boolean)
          .join(", ");
        const bar = svg("rect", {
          class: "timeline-life",
          x: from,
          y: top + LABEL,
          width,
          height: LIFE,
          data: { tone: STATE_TONES[change.state] ?? "idle", state: change.state },
        });
        const label =
          change.state === "ready" && fixture.generations.length > 1 && width > 40
            ? svg("text", {
                class: "timeline-number",
                x: from + 5,
                y: top + LABEL + LIFE - 4,
                text: `#${generation.number}`,
              })
            : null;
        return this.#mark(svg("g", {}, bar, label), { text, fixture: fixture.name, at: change.time, row: top });
      });
  }

  #tests(fixture, top, { x, begin, now, model }) {
    const stood = fixture.generations.flatMap((one) => one.tests).filter(({ attempt }) => attempt.started.time);
    const bars = stood.map(({ test, attempt }) => {
      const verdict = attempt.ended?.outcome ?? attempt.ended?.verdict ?? "running";
      const until = attempt.ended?.time ?? now;
      return {
        test,
        attempt,
        verdict,
        until,
        from: x(attempt.started.time),
        to: x(until),
        rank: verdict === "running" ? -1 : VERDICTS.indexOf(verdict),
      };
    });
    bars.sort((a, b) => a.from - b.from);
    const merged = mergeBars(bars, THIN).sort((a, b) => b.rank - a.rank); // bad ones are drawn over their neighbours
    return merged.map(({ from, to, members }) => {
      const [first] = members;
      const gap = to - from > 3 ? 1 : 0;
      const bar = svg("rect", {
        class: "timeline-test",
        x: from,
        y: top + LABEL + LIFE + 2,
        width: Math.max(1.5, to - from - gap),
        height: TESTS,
        data: { tone: toneOf(first.verdict) },
      });
      return this.#mark(bar, {
        text: testsText(members, model, begin),
        fixture: fixture.name,
        test: first.test,
        at: first.attempt.started.time,
        row: top + 1,
      });
    });
  }

  #incident(fixture, incident, top, { x, begin }) {
    const at = x(incident.time);
    const y = top + LABEL;
    const when = `at ${clockText(incident.time - begin, 0.01)}, generation ${incident.generation ?? 1}`;
    const text = `${fixture.name}: ${incident.cause} ${when}${incident.test ? `, under ${incident.test}` : ""}`;
    const shape = svg("path", { class: "timeline-incident", d: `M${at} ${y + 3}L${at - 6} ${y - 8}H${at + 6}Z` });
    const line = svg("path", { class: "timeline-incident-line", d: `M${at} ${y}V${y + LIFE + TESTS + 2}` });
    return this.#mark(svg("g", {}, line, shape), {
      text,
      fixture: fixture.name,
      incident,
      test: incident.test,
      at: incident.time,
      row: top + 2,
    });
  }

  #mark(element, mark) {
    element.classList.add("timeline-mark");
    if (mark.test) element.classList.add("is-link");
    this.#marks.push({ element, ...mark });
    return element;
  }

  #markOf(target) {
    return this.#marks.findIndex((mark) => mark.element.contains(target));
  }

  #point(target) {
    const index = this.#markOf(target);
    if (index >= 0) this.#show(index);
  }

  #open(index) {
    const mark = this.#marks[index];
    if (mark?.test) this.#page.go(this.#page.hashOf(mark.test));
  }

  #show(index) {
    this.#current = index;
    for (const [place, mark] of this.#marks.entries()) mark.element.classList.toggle("is-current", place === index);
    const mark = this.#marks[index];
    setText(this.said, mark ? this.#page.format.visible(mark.text) : "");
  }

  #key(event) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (event.key === "Enter") this.#open(this.#current);
    else if (step && this.#marks.length) this.#show((this.#current + step + this.#marks.length) % this.#marks.length);
    else return;
    event.preventDefault();
    event.stopPropagation();
    this.#marks[this.#current]?.element.scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  #widen(factor) {
    const { scrollLeft, clientWidth } = this.scroller;
    const before = this.#wide;
    this.#wide = Math.min(WIDEST, Math.max(1, before * factor));
    this.draw();
    this.scroller.scrollLeft = (scrollLeft + clientWidth / 2) * (this.#wide / before) - clientWidth / 2;
  }
}

/** The time span of the fixtures' records; up to `now` while the suite is running. */
function spanOf(suite, fixtures, now) {
  const changes = fixtures
    .flatMap((fixture) => fixture.generations.flatMap((one) => one.changes))
    .map((change) => change.time);
  const from = Math.min(suite.started?.time ?? Infinity, ...changes, now);
  const to = suite.ended?.time ?? now;
  return { from, to: Math.max(to, from + 0.1) };
}

function tickMark(x, height, text, width) {
  const anchor = x < 30 ? "start" : x > width - 30 ? "end" : "middle";
  return svg(
    "g",
    { class: "timeline-tick" },
    svg("path", { d: `M${x} 0V${height - AXIS_HEIGHT + 4}` }),
    svg("text", { x, y: height - 4, "text-anchor": anchor, text }),
  );
}

function period(from, to, begin) {
  return `from ${clockText(from - begin, 0.01)} to ${clockText(to - begin, 0.01)}`;
}

function testsText(bars, model, begin) {
  const [first] = bars;
  const name = model.tests.get(first.test)?.name ?? first.test;
  const last = Math.max(...bars.map((bar) => bar.until));
  const who = bars.length > 1 ? `${bars.length} tests, the first ${name}` : name;
  return `${who}: ${first.verdict} ${period(first.attempt.started.time, last, begin)}`;
}

/** The legend of the timelines. */
export function timelineLegend() {
  const entry = (tone, text) =>
    h(
      "span",
      { class: "timeline-key" },
      svg(
        "svg",
        { width: 12, height: 12, "aria-hidden": "true" },
        svg("rect", { class: "timeline-life", width: 12, height: 12, data: { tone } }),
      ),
      text,
    );
  return h(
    "p",
    { class: "timeline-legend dim" },
    entry("busy", "starting"),
    entry("good", "ready"),
    entry("broken", "collapsed"),
    entry("idle", "stopping"),
    entry("bad", "failed"),
    h("span", { text: "▾ incident" }),
    h("span", { text: "thin bars: tests" }),
  );
}
