// Beside the list when no test is chosen: what of the whole run needs a look, worst first.

import { free, h, section } from "./dom.js";
import { formatPlace, linkTo, linkToFixture } from "./format.js";
import { folded, GrowingList } from "./long_text.js";
import { problemItem, problemsOf } from "./messages.js";
import { sign } from "./signs.js";
import { t } from "./texts.js";

export class RunDetail {
  constructor(page) {
    this.page = page;
    const list = (title, make, limit) => {
      const items = h("ol", { class: "messages" });
      const element = section(title, items);
      const grower = new GrowingList(items, make, limit);
      return { element, update: (all) => (element.hidden = !grower.update(all)) };
    };
    this.broken = list("The framework broke", internalItem, 10);
    this.tests = list("Problems", problemItem, 50);
    this.incidents = list("Incidents of fixtures", incidentItem, 20);
    this.diagnoses = list("Said of files and command line", diagnosisItem, 50);
    this.nothing = h("p", { class: "empty", text: t("list.select") });
    this.element = h("div", { class: "test" }, h("h2", { class: "unseen", text: "What needs a look" }), this.broken.element, this.tests.element, this.incidents.element, this.diagnoses.element, this.nothing);
    this.update();
  }

  update() {
    const { model } = this.page;
    this.broken.update(model.internalErrors);
    this.tests.update(problemsOf(model.tests.values()));
    this.incidents.update([...model.fixtures()].flatMap((fixture) => fixture.incidents));
    this.diagnoses.update(model.diagnostics);
    this.nothing.hidden = [this.broken, this.tests, this.incidents, this.diagnoses].some((list) => !list.element.hidden);
  }
}

function incidentItem(record) {
  const { suite, fixture, cause, phase, test, incarnation, output, traceback } = record;
  return h("li", { class: "message" }, sign("collapsed"),
    h("div", { class: "message-body" },
      h("p", {}, h("a", { href: linkToFixture(suite, fixture) }, free(fixture)), ": ", free(cause)),
      h("p", { class: "dim message-about" }, h("span", { text: `incarnation ${incarnation ?? 1}, ${phase ?? ""}` }), test ? h("a", { href: linkTo(test) }, free(test)) : null),
      output ? folded("last output", output, { className: "mono" }) : null,
      traceback ? folded("traceback", traceback, { className: "mono" }) : null));
}

function diagnosisItem({ severity, text, file, line, hint }) {
  return h("li", { class: "message" }, sign(severity),
    h("div", { class: "message-body" }, free(text, "p"), hint ? free(hint, "p", { class: "dim" }) : null,
      file ? free(formatPlace(file, line), "p", { class: "dim mono", title: file }) : null));
}

function internalItem({ text, traceback }) {
  return h("li", { class: "message" }, sign("error"), h("div", { class: "message-body" }, free(text, "p"), traceback ? folded("traceback", traceback, { className: "mono" }) : null));
}
