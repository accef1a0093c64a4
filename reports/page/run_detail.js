// The panel beside the list while no test is selected: the running test and the problems of the run, worst first.

import { free, h, section } from "./dom.js";
import { formatPlace, linkTo, linkToFixture } from "./format.js";
import { folded, GrowingList } from "./long_text.js";
import { problemItem, problemsOf } from "./messages.js";
import { sign } from "./state_signs.js";
import { TestDetail } from "./test_detail.js";
import { t } from "./texts.js";

const SETTLED = 0.4; // seconds after which a running test is shown, so that short ones do not flicker

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
    this.running = h("div", { class: "following" });
    this.followed = null; // the detail of the running test
    this.nothing = h("p", { class: "empty", text: t("list.select") });
    this.element = h("div", { class: "test" }, h("h2", { class: "unseen", text: "Problems" }), this.running, this.broken.element, this.tests.element, this.incidents.element, this.diagnoses.element, this.nothing);
    this.update();
  }

  update(changes = { every: true }) {
    const { model } = this.page;
    this.#follow(changes);
    this.broken.update(model.internalErrors);
    this.tests.update(problemsOf(model.tests.values()));
    this.incidents.update([...model.fixtures()].flatMap((fixture) => fixture.incidents));
    this.diagnoses.update(model.diagnostics);
    this.nothing.hidden = [this.broken, this.tests, this.incidents, this.diagnoses].some((list) => !list.element.hidden) || Boolean(this.followed);
  }

  tick() {
    this.#follow({ tests: new Set() });
    this.followed?.tick();
  }

  destroy() {
    this.followed?.destroy();
    this.followed = null;
  }

  /** Show the running test, until another one starts or the run is over. */
  #follow(changes) {
    const { model } = this.page;
    const id = [...model.running].find((one) => this.page.now() - model.tests.get(one).attempt.started.time > SETTLED);
    if (id && id !== this.followed?.test.id) {
      this.destroy();
      this.followed = new TestDetail(this.page, model.tests.get(id));
      this.running.replaceChildren(this.followed.element);
      this.followed.show();
    } else if (model.ended && this.followed) {
      this.destroy();
      this.running.replaceChildren();
    } else this.followed?.update(changes);
  }
}

function incidentItem(record) {
  const { suite, fixture, cause, phase, test, generation, output, traceback } = record;
  return h("li", { class: "message" }, sign("collapsed"),
    h("div", { class: "message-body" },
      h("p", {}, h("a", { href: linkToFixture(suite, fixture) }, free(fixture)), ": ", free(cause)),
      h("p", { class: "dim message-about" }, h("span", { text: `generation ${generation ?? 1}, ${phase ?? ""}` }), test ? h("a", { href: linkTo(test) }, free(test)) : null),
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
