// The page of a campaign: what its outcomes teach, from the data that the page carries.

import { coverageChart, detectionChart, distributionChart, intervalChart } from "./campaign_charts.js";
import { LiveCampaign } from "./campaign_live.js";
import { capabilityText, curveTitle, figureText, limitText, needsText, rateText, sizeText } from "./campaign_words.js";
import { percentText } from "./chart_helpers.js";
import { blockJson } from "./data_source.js";
import { fill, free, h } from "./dom.js";
import { formatCount, formatLimits, formatSeconds, visible } from "./format.js";
import { SortTable } from "./sort_table.js";
import { badge } from "./state_signs.js";

const CURVES_FIRST = 60;
const DISTRIBUTIONS_FIRST = 12;
const CAPABLE = 4 / 3;
const BADGES = { "stable": "passed", "flaky": "flaky", "marginal": "marginal", "not known": "not run" };

/** A heading, a sentence and figures. */
function chapter(title, sentence, ...parts) {
  return h("section", { class: "chapter figures" }, h("h2", { text: title }), h("p", { class: "dim", text: sentence }), parts);
}

/** Figures in columns; more than `first` only on request. */
function gallery(items, first, draw, word) {
  const grid = h("div", { class: "gallery" }, items.slice(0, first).map(draw));
  if (items.length <= first) return grid;
  const more = h("button", { type: "button", text: `show all ${items.length} ${word}`, on: { click: () => {
    more.remove();
    grid.append(...items.slice(first).map(draw));
  } } });
  return [grid, more];
}

function card(title, picture, ...lines) {
  return h("figure", { class: "card" }, h("figcaption", {}, free(title, "h3")), picture, lines.filter(Boolean).map((text) => h("p", { text })));
}

function tableOf(label, name, columns, rows) {
  const table = new SortTable({ label, name, columns, empty: "nothing" });
  table.rows = rows;
  return table.element;
}

// Detection

function detectionChapter({ detection, size }) {
  const drawable = detection.filter((curve) => curve.levels.some((level) => level.severity > 0));
  const title = (curve) => curveTitle(curve, size.robots);
  const columns = [
    { key: "test", label: "Test", value: (row) => row.test, cell: (row) => free(row.test) },
    { key: "fault", label: "Fault", value: (row) => row.fault, cell: (row) => free(curveTitle({ ...row, test: "" }, size.robots)) },
    { key: "limit", label: "Found in 99 % from", value: (row) => row.limit.severity, cell: (row) => h("span", { title: row.reason || null, text: limitText(row) }) },
    { key: "found", label: "Found", value: (row) => row.found.share, cell: (row) => rateText(row.found) },
    { key: "right", label: "Right joint first", value: (row) => row.right_joint.share, cell: (row) => (row.right_joint.trials ? rateText(row.right_joint) : "") },
    { key: "worst", label: "Least at joint", value: (row) => worstJoint(row)?.found.share, cell: (row) => worstText(row) },
    { key: "unjudged", label: "No verdict", numeric: true, value: (row) => row.runs - row.found.trials, cell: (row) => String(row.runs - row.found.trials) },
  ];
  const lead = "How small a fault each test finds. The limit is the severity of which 99 % are found, with its 95 % interval; points are shares at a severity, with exact 95 % intervals.";
  return chapter("Detection limits", lead,
    tableOf("detection limits", "campaign-limits", columns, detection),
    gallery(drawable, CURVES_FIRST, (curve) => card(
      title(curve),
      detectionChart(curve, `${title(curve)}: found in 99 % from ${limitText(curve)}; ${rateText(curve.found)} found`),
      `99 % from: ${limitText(curve)}`,
      curve.reason && `No curve: ${curve.reason}.`,
      curve.right_joint.trials > 0 && `Right joint first: ${rateText(curve.right_joint)}.`,
    ), "curves"));
}

function worstJoint({ joints }) {
  return joints.length < 2 ? null : joints.reduce((worst, one) => ((one.found.share ?? 1) < (worst.found.share ?? 1) ? one : worst));
}

function worstText(curve) {
  const worst = worstJoint(curve);
  return worst && worst.found.share !== null ? free(`${worst.joint}: ${percentText(worst.found.share)}`) : "";
}

// Healthy robots

function alarmsChapter({ alarms, flakiness, size }) {
  const steady = new Map(flakiness.map((one) => [`${one.robot}\n${one.test}`, one]));
  const rows = alarms.map((one) => ({ ...one, steady: steady.get(`${one.robot}\n${one.test}`) }));
  const ordered = rows.toSorted((a, b) => (b.alarms.share ?? -1) - (a.alarms.share ?? -1) || b.alarms.high - a.alarms.high);
  const label = (row) => (size.robots.length > 1 ? `${row.test} · ${row.robot}` : row.test);
  const columns = [
    { key: "test", label: "Test", value: label, cell: (row) => free(label(row)) },
    { key: "alarms", label: "Failed healthy robots", value: (row) => row.alarms.share, first: -1, cell: (row) => rateText(row.alarms) },
    { key: "units", label: "Units", numeric: true, value: (row) => row.units, cell: (row) => String(row.units) },
    { key: "unjudged", label: "No verdict", numeric: true, value: (row) => row.unjudged, cell: (row) => String(row.unjudged) },
    { key: "steady", label: "Verdict twice", value: (row) => row.steady.verdict, cell: (row) => badge(BADGES[row.steady.verdict], row.steady.verdict) },
    { key: "differing", label: "Differing pairs", value: (row) => row.steady.differing.share, cell: (row) => (row.steady.differing.trials ? rateText(row.steady.differing) : "") },
    { key: "cause", label: "Marginal value", value: (row) => row.steady.measurement || null, cell: (row) => free(row.steady.measurement) },
  ];
  const bars = ordered.map((row) => ({ label: label(row), rate: row.alarms, tone: row.alarms.count ? "bad" : "good" }));
  const judged = bars.filter((bar) => bar.rate.trials);
  const lead = "How often each test fails a robot without a fault, with exact 95 % intervals; and whether two runs on one robot agree: flaky if not, marginal if a value at its limit explains it.";
  return chapter("False alarms and flakiness", lead,
    judged.length > 0 && h("div", { class: "wide" }, intervalChart(judged, `false alarms of ${judged.length} tests`)),
    tableOf("false alarms", "campaign-alarms", columns, ordered));
}

// Measurements

function distributionsChapter({ distributions, size }) {
  const title = (one) => [one.test, one.name, size.robots.length > 1 ? one.robot : ""].filter(Boolean).join(" · ");
  const tone = (value) => (value < 1 ? "bad" : value < CAPABLE ? "warn" : "good");
  const columns = [
    { key: "test", label: "Test", value: (row) => row.test, cell: (row) => free(row.test) },
    { key: "name", label: "Measurement", value: (row) => row.name, cell: (row) => free(row.name) },
    { key: "capability", label: "Cpk", value: (row) => row.capability?.value, cell: (row) => row.capability && h("strong", { data: { tone: tone(row.capability.value) }, text: capabilityText(row.capability) }) },
    { key: "tight", label: "Tight limit", value: (row) => row.tight || null, cell: (row) => row.tight },
    { key: "outside", label: "Outside", value: (row) => row.outside.share, cell: (row) => (row.outside.trials ? rateText(row.outside) : "") },
    { key: "median", label: "Median", numeric: true, value: (row) => row.median, cell: (row) => (row.median === null ? "" : sizeText(row.median, row.unit)) },
    { key: "range", label: "5 to 95 %", cell: (row) => (row.p5 === null ? "" : `${figureText(row.p5)} to ${figureText(row.p95)}`) },
    { key: "limits", label: "Limits", cell: (row) => formatLimits(row.lower, row.upper, row.unit) },
    { key: "runs", label: "Runs", numeric: true, value: (row) => row.runs, cell: (row) => String(row.runs) },
  ];
  const pictures = distributions.filter((one) => one.histogram && one.capability);
  const lead = "Measurements of healthy robots, those nearest to a limit first. Cpk is the distance of the mean to the nearer limit in three standard deviations; below 1.33 a limit is tight.";
  return chapter("Measurements over the population", lead,
    gallery(pictures, DISTRIBUTIONS_FIRST, (one) => card(
      title(one),
      distributionChart(one, `${title(one)}: median ${sizeText(one.median, one.unit)}, Cpk ${capabilityText(one.capability)}`),
      `Cpk ${capabilityText(one.capability)}${one.tight ? `, the ${one.tight} limit is tight` : ""}; ${formatLimits(one.lower, one.upper, one.unit)}`,
    ), "distributions"),
    tableOf("measurements", "campaign-measurements", columns, distributions));
}

// Costs

function choiceParts(choice, units, robots) {
  const unit = (need) => units.get(`${need.fault}\n${need.direction}`) ?? "";
  const list = (needs) => needsText(needs, unit);
  const folded = (summary, needs) => needs.length > 0 && h("details", {}, h("summary", { text: `${needs.length} ${summary}` }), free(list(needs), "p"));
  const total = choice.steps[choice.steps.length - 1];
  const within = choice.budget === null ? "" : ` within ${formatSeconds(choice.budget)}`;
  return [
    robots.length > 1 && free(choice.robot, "h3"),
    total
      ? h("p", { text: `${formatCount(choice.steps.length, "test")}, ${formatSeconds(total.total_seconds)}${within}: ${percentText(total.share)} of the ${choice.needs} faults and severities that any test finds at 99 %.` })
      : h("p", { text: "No test finds anything at 99 % in this time." }),
    total && h("div", { class: "wide" }, coverageChart(choice, `${formatCount(choice.steps.length, "test")}: ${percentText(total.share)} found in ${formatSeconds(total.total_seconds)}`)),
    h("ol", { class: "chosen" }, choice.steps.map((step) =>
      h("li", {}, h("strong", {}, free(step.test)), ` ${formatSeconds(step.seconds)}, finds ${step.adds.length} more: `, free(list(step.adds), "span", { class: "dim" })))),
    folded("faults and severities are missed", choice.missed),
    folded("faults and severities are found by no test at 99 %", choice.found_by_none),
  ];
}

function costsChapter({ choices, costs, detection, size }) {
  const units = new Map(detection.map((curve) => [`${curve.fault}\n${curve.direction}`, curve.unit]));
  const columns = [
    { key: "test", label: "Test", value: (row) => row.test, cell: (row) => free(row.test) },
    { key: "robot", label: "Robot", value: (row) => row.robot, cell: (row) => free(row.robot) },
    { key: "seconds", label: "Mean time", numeric: true, value: (row) => row.seconds, cell: (row) => formatSeconds(row.seconds) },
    { key: "longest", label: "Longest", numeric: true, value: (row) => row.longest, cell: (row) => formatSeconds(row.longest) },
    { key: "processor", label: "Processor", numeric: true, value: (row) => row.processor_seconds, cell: (row) => formatSeconds(row.processor_seconds) },
    { key: "runs", label: "Runs", numeric: true, value: (row) => row.runs, cell: (row) => String(row.runs) },
  ];
  const lead = "The tests that find everything for the least time, in the order of what each adds in a second; and the time of each test.";
  return chapter("What to run", lead, choices.map((choice) => choiceParts(choice, units, size.robots)), tableOf("costs", "campaign-costs", columns, costs));
}

function headOf({ name, size }) {
  const robots = size.robots.filter(Boolean).join(", ");
  const facts = [
    `${formatCount(size.runs, "run")}, ${size.healthy} without a fault`, formatCount(size.tests, "test"),
    `${formatCount(size.faults, "kind") || "no kind"} of faults`,
    robots && `${formatCount(size.units, "unit")} of ${robots}`, `${formatSeconds(size.seconds)} of runs`,
  ].filter(Boolean);
  return h("header", { class: "campaign-head" }, h("h1", { text: `Campaign ${name}` }), h("p", { class: "dim", text: visible(facts.join(" · ")) }));
}

function chaptersOf(report) {
  return [
    report.detection.length > 0 && detectionChapter(report),
    report.alarms.length > 0 && alarmsChapter(report),
    report.distributions.length > 0 && distributionsChapter(report),
    costsChapter(report),
  ];
}

/** The page of a campaign that is running: the report below what is going on, drawn anew where the reader is. */
function showLive() {
  const head = h("div", {}, h("header", { class: "campaign-head" }, h("h1", { text: "Campaign" })));
  const chapters = h("div");
  const live = new LiveCampaign((report) => {
    const place = scrollY;
    fill(head, headOf(report));
    fill(chapters, chaptersOf(report));
    scrollTo({ top: place, behavior: "instant" });
  });
  document.body.replaceChildren(head, h("main", {}, live.element, chapters));
  live.start();
}

async function showCampaign() {
  document.body.classList.add("campaign");
  const report = await blockJson("rtf-campaign");
  if (!report) return showLive();
  document.title = visible(`Campaign ${report.name}`);
  document.body.replaceChildren(headOf(report), h("main", {}, chaptersOf(report)));
}

showCampaign();
