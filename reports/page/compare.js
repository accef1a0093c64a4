// Two runs beside each other: which verdicts changed, and which measurements moved.
//
// Pure: takes what two runs came to, and tells the differences. A run is a Map from the id of a test to
// {name, verdict, measurements}; the verdict is null as long as there is none.

import { GOOD, number } from "./model.js";
import { allowedRange } from "./margin_bar.js";

/** The kinds of change of a test, in the order in which they matter. */
export const CHANGES = ["newly failing", "fixed", "other verdict", "new test", "missing test"];
/** What was not carried out says neither that it works nor that it does not. */
export const NOT_CARRIED_OUT = new Set(["not run", "interrupted", "blocked", "skipped"]);
const MEASURED_RANK = { failed: 0, marginal: 1, recorded: 2, passed: 3 };
/** Less than this share of the allowed range, or of the value, is not worth a line. */
export const MOVED = 0.005;

/** What a run came to, from its records: those of `GET /compare`. */
export function outcomesOfRecords(records) {
  const outcomes = new Map();
  for (const record of records) {
    if (record.event === "test_planned" && !outcomes.has(record.test))
      outcomes.set(record.test, { name: record.name, verdict: null, measurements: [] });
    const test = outcomes.get(record.test);
    if (record.event === "measured") test?.measurements.push(record);
    else if (record.event === "test_ended" && test) test.verdict = record.verdict;
  }
  return outcomes;
}

/** What the run of a model came to so far; a test that is running has no verdict yet. */
export function outcomesOfModel(model) {
  return new Map(
    [...model.tests].map(([id, test]) => [
      id,
      { name: test.name, verdict: test.running ? null : test.verdict, measurements: test.attempt?.measurements ?? [] },
    ]),
  );
}

/**
 * The differences: `tests` ({test, name, change, before, now}), worst first; `measurements` ({test, name, record, before,
 * now, unit, difference, share, was, verdict, changed, limits}), changed verdicts first and then what moved most; and
 * `same`, how many of each are as they were, or moved too little to be told of (`still`).
 */
export function compareOutcomes(older, newer) {
  const tests = [];
  const measurements = [];
  const counts = { tests: 0, measurements: 0, still: 0 };
  for (const id of new Set([...newer.keys(), ...older.keys()])) {
    const before = older.get(id);
    const now = newer.get(id);
    const change = testChange(before, now);
    if (change)
      tests.push({
        test: id,
        name: (now ?? before).name,
        change,
        before: before?.verdict ?? null,
        now: now?.verdict ?? null,
      });
    else if (now?.verdict) counts.tests += 1;
    if (before && now?.verdict) compareMeasurements(id, before, now, measurements, counts);
  }
  tests.sort((a, b) => CHANGES.indexOf(a.change) - CHANGES.indexOf(b.change));
  measurements.sort(byImportance);
  return { tests, measurements, same: counts };
}

/** How a test changed; null if it did not, or if it has not ended. */
function testChange(before, now) {
  if (!now) return "missing test";
  if (!before) return "new test";
  if (!now.verdict || before.verdict === now.verdict) return null;
  const [was, is] = [GOOD.has(before.verdict), GOOD.has(now.verdict)];
  if (!is && (was || NOT_CARRIED_OUT.has(before.verdict) || before.verdict === null) && now.verdict !== "not run")
    return "newly failing";
  return is &&
    !was &&
    before.verdict !== null &&
    !NOT_CARRIED_OUT.has(before.verdict) &&
    !NOT_CARRIED_OUT.has(now.verdict)
    ? "fixed"
    : "other verdict";
}

function compareMeasurements(test, before, now, found, counts) {
  const earlier = byKey(before.measurements);
  for (const [key, record] of byKey(now.measurements)) {
    const old = earlier.get(key);
    if (!old) continue;
    const change = measurementChange(old, record);
    if (change.changed || Math.abs(change.share ?? 0) >= MOVED) found.push({ test, name: now.name, record, ...change });
    else if (change.difference === 0 || Number.isNaN(change.difference)) counts.measurements += 1;
    else counts.still += 1;
  }
}

function measurementChange(old, record) {
  const [before, now] = [number(old.value), number(record.value)];
  const [was, verdict] = [old.verdict ?? "recorded", record.verdict ?? "recorded"];
  const difference = now - before;
  const scale = allowedRange(record) || Math.abs(before) || Math.abs(now);
  const changed = was !== verdict || Number.isNaN(now) !== Number.isNaN(before);
  return {
    before,
    now,
    unit: record.unit ?? "",
    difference,
    share: scale ? difference / scale : 0,
    was,
    verdict,
    changed,
    limits: !sameLimits(old, record),
  };
}

function sameLimits(one, other) {
  return (one.low ?? null) === (other.low ?? null) && (one.high ?? null) === (other.high ?? null);
}

/** Measurements by subject and name; what was measured several times counts on. */
function byKey(measurements) {
  const found = new Map();
  const seen = new Map();
  for (const record of measurements) {
    const name = `${record.subject ?? ""}\n${record.name}`;
    const count = (seen.get(name) ?? 0) + 1;
    seen.set(name, count);
    found.set(`${name}\n${count}`, record);
  }
  return found;
}

function byImportance(one, other) {
  if (one.changed !== other.changed) return Number(other.changed) - Number(one.changed);
  if (one.changed && one.verdict !== other.verdict) return MEASURED_RANK[one.verdict] - MEASURED_RANK[other.verdict];
  return Math.abs(other.share) - Math.abs(one.share);
}
