// The detail of a suite: its description, its result, and the messages that belong to none of its tests.

import { free, h, section, setText } from "./dom.js";
import { formatCount, formatPlace, formatSeconds, linkToFixture } from "./format.js";
import { GrowingList } from "./long_text.js";
import { messageItem, problemItem, problemsOf } from "./messages.js";
import { badge, setBadge } from "./state_signs.js";

export class SuiteDetail {
  constructor(page, suite) {
    Object.assign(this, { page, suite });
    this.verdict = badge("planned");
    this.summary = h("span", { class: "dim" });
    const problems = h("ol", { class: "messages" });
    this.bad = new GrowingList(problems, problemItem, 50);
    this.problems = section("Problems", problems);
    const messages = h("ol", { class: "messages" });
    this.list = new GrowingList(messages, (record) => messageItem(record, page));
    this.said = section("Messages", messages);
    this.fixtures = h("ul", { class: "plain" });
    this.needs = section("Fixtures", this.fixtures);
    const { planned } = suite;
    this.element = h("article", { class: "test" },
      h("header", { class: "test-head" },
        free(suite.name, "h2"), h("p", { class: "verdict-line" }, this.verdict, " ", this.summary),
        planned.description ? free(planned.description, "p") : null,
        h("p", { class: "dim mono" }, free(formatPlace(planned.file, 0), "span", { title: planned.file }), planned.environment ? [" · ", free(planned.environment)] : null),
      ),
      this.problems, this.said, this.needs);
    this.update();
  }

  update() {
    const { suite } = this;
    setBadge(this.verdict, suite.ended?.verdict ?? (suite.started ? "running" : "planned"));
    const done = suite.tests.filter((test) => test.verdict !== null).length;
    setText(this.summary, `${done} of ${suite.tests.length} tests${suite.ended ? ` in ${formatSeconds(suite.ended.duration)}` : ""}`);
    this.problems.hidden = !this.bad.update(problemsOf(suite.tests));
    this.said.hidden = !this.list.update(suite.messages);
    const key = [...suite.fixtures.values()].map((one) => `${one.name}\n${one.state}\n${one.incidents.length}`).join("\n");
    if (key === this.fixtureKey) return;
    this.fixtureKey = key;
    this.needs.hidden = suite.fixtures.size === 0;
    this.fixtures.replaceChildren(...[...suite.fixtures.values()].map(fixtureItem));
  }
}

function fixtureItem(fixture) {
  const incidents = fixture.incidents.length;
  return h("li", {},
    h("a", { href: linkToFixture(fixture.suite, fixture.name) }, free(fixture.name)), " ",
    badge(fixture.state || "planned"),
    h("span", { class: "dim", text: ` ${[formatCount(fixture.generations.length, "generation"), formatCount(incidents, "incident")].filter(Boolean).join(", ")}` }));
}
