// Comparison of two runs: changed verdicts and measurements.
//
// Pure functions of the results of two runs. A run is a Map from the id of a test to {name, verdict, measurements}; the
// verdict is null as long as there is none.

import { GOOD, number } from "./model.js";
import { allowedRange } from "./margin_bar.js";

/** The kinds of change of a test, the most important first. */
export const CHANGES = ["newly failing", "fixed", "other verdict", "new test", "missing test"];
/** Verdicts of tests that were not carried out, which prove nothing. */
export const NOT_CARRIED_OUT = new Set(["not run", "interrupted", "blocked", "skipped"]);
const MEASURED_RANK = { failed: 0, marginal: 1, recorded: 2, passed: 3 };
/** The least change that is shown, as a share of the allowed range, or of the value. */
export const MOVED = 0.005;

/** Return the results of a run from its records, those of `GET /compare`. */
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

/** Return the results of a model's run so far; a running test has no verdict. */
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
 * now, unit, difference, share, was, verdict, changed, limits}), changed verdicts first, then the greatest changes; and
 * `same`, the numbers of unchanged ones, and of those with small changes (`still`).
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

/** Return the kind of change of a test; null if it did not change, or has not ended. */
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

/** Measurements by subject and name; repeated ones are numbered. */
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
