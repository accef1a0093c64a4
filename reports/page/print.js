// Printing: the failures in full, one after the other, and then a line for every test, without controls.

import { free, h } from "./dom.js";
import { firstLine, formatSeconds } from "./format.js";
import { isBad } from "./model.js";
import { badge } from "./state_signs.js";
import { TestDetail } from "./test_detail.js";

const IN_FULL = 100; // number of failures that are printed in full
const LINES = 2000;
const ON_PAPER = new Set(["tests", "log", "operator"]); // other views are printed unchanged

/** Build the printed page before printing, and remove it afterwards. */
export function printAll(page) {
  let paper = null;
  let details = [];
  const lay = () => {
    if (paper || !ON_PAPER.has(document.documentElement.dataset.view)) return;
    document.documentElement.dataset.paper = "tests";
    const tests = [...page.model.tests.values()];
    details = tests.filter((test) => isBad(test.state)).slice(0, IN_FULL).map((test) => new TestDetail(page, test));
    for (const detail of details) detail.show();
    paper = h("section", { class: "paper" }, details.map((detail) => detail.element), testLines(tests));
    for (const fold of paper.querySelectorAll("details")) fold.open = true;
    document.body.append(paper);
  };
  const clear = () => {
    for (const detail of details) detail.destroy();
    paper?.remove();
    delete document.documentElement.dataset.paper;
    paper = null;
    details = [];
  };
  addEventListener("beforeprint", lay);
  addEventListener("afterprint", clear);
}

function testLines(tests) {
  const rows = tests.slice(0, LINES).map((test) => h("tr", {}, h("td", {}, badge(test.state)), free(test.id, "td"),
    h("td", { class: "number", text: test.duration ? formatSeconds(test.duration) : "" }), free(firstLine(test.ended?.detail, 120), "td", { class: "dim" })));
  return h("table", { class: "table" }, h("caption", { text: "All tests" }), h("tbody", {}, rows),
    tests.length > LINES ? h("tfoot", {}, h("tr", {}, h("td", { colspan: "4", text: `and ${tests.length - LINES} more` }))) : null);
}
