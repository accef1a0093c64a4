// The state of the run, computed from its events. Independent of the document.
//
// `apply` takes one record of the journal (docs/events.md). It keeps the records themselves, under the test, suite or
// fixture they belong to, and collects the changes since the last update, so that views redraw only those.

/** Worst first: the order in which tests are shown, and in which the verdicts of parts make one. */
export const VERDICTS = [
  "failed", "error", "fixture lost", "unexpected pass", "inconclusive", "interrupted", "blocked", "flaky",
  "not run", "skipped", "expected failure", "measured", "passed",
];
/** The verdicts of a run with exit code 0. */
export const GOOD = new Set(["passed", "measured", "skipped", "expected failure", "flaky"]);
/** States without a problem, besides the good verdicts. */
const QUIET = new Set(["planned", "running", "not run"]);
/** Return whether this state of a test is a problem. */
export function isBad(state) {
  return !GOOD.has(state) && !QUIET.has(state);
}

/** Verdicts of tests that run again when the run is resumed. */
const OPEN = new Set(["not run", "interrupted", "blocked"]);
const SEVERE = new Set(["failure", "error"]);

/** Numbers that JSON does not have are written as words. */
export function number(value) {
  return typeof value === "string" ? Number(value) : value;
}

class Attempt {
  constructor(record) {
    this.number = record.attempt ?? 1;
    this.started = record;
    this.ended = null;
    this.parameters = [];
    this.phases = [];
    this.messages = [];
    this.measurements = [];
    this.series = [];
    this.parts = new Map(); // subject -> subresult_ended
    this.attachments = [];
    this.questions = [];
    this.output = [];
    this.stacks = [];
    this.progress = null;
    this.live = new Map(); // "subject\nname" -> {record, columns, samples} of a series that is being recorded
  }
}

class Test {
  constructor(record, index) {
    this.id = record.test;
    this.suite = record.suite;
    this.name = record.name;
    this.description = "";
    this.planned = record;
    this.index = index; // place in the plan
    this.attempts = [];
    this.verdict = null; // the final one
    this.running = false;
    this.failures = 0; // messages of severity failure or error, last attempt
    this.renamed = false;
    this.cases = []; // of a program: tests of their own, as it reported them
    this.program = null; // of which it is a case
  }

  get attempt() {
    return this.attempts[this.attempts.length - 1] ?? null;
  }

  /** `planned`, `running`, or the verdict. */
  get state() {
    return this.running ? "running" : this.verdict ?? "planned";
  }

  /** Seconds over all attempts that ended. */
  get duration() {
    let sum = 0;
    for (const attempt of this.attempts) sum += attempt.ended?.duration ?? 0;
    return sum;
  }

  /** The `test_ended` record that counts, or null. */
  get ended() {
    return this.attempt?.ended ?? null;
  }
}

class Fixture {
  constructor(name, suite) {
    this.name = name;
    this.suite = suite;
    this.state = "";
    this.generations = []; // {number, changes: [fixture_changed], tests: [{test, attempt, started, ended}]}
    this.incidents = [];
    this.messages = [];
    this.output = [];
    this.stacks = [];
  }

  generation(count) {
    let found = this.generations.find((one) => one.number === count);
    if (!found) {
      found = { number: count, changes: [], tests: [] };
      this.generations.push(found);
    }
    return found;
  }
}

class Suite {
  constructor(record) {
    this.id = record.suite;
    this.name = record.name;
    this.planned = record;
    this.tests = [];
    this.fixtures = new Map();
    this.messages = [];
    this.started = null;
    this.ended = null;
  }

  fixture(name) {
    if (!this.fixtures.has(name)) this.fixtures.set(name, new Fixture(name, this.id));
    return this.fixtures.get(name);
  }
}

export class RunModel {
  constructor() {
    this.started = null; // the run_started record
    this.resumed = null; // the last run_started of a resumption
    this.ended = null;
    this.interrupted = null; // the highest stage so far
    this.internalErrors = [];
    this.diagnostics = [];
    this.suites = new Map();
    this.tests = new Map();
    this.running = new Set(); // ids
    this.counts = new Map(); // state -> number of tests
    this.log = []; // records with a text, in order
    this.questions = new Map(); // "test\nquestion" -> asked record without an answer
    this.time = 0; // of the newest record
    this.events = 0;
    this.fixtureHome = new Map(); // fixture -> suite id, for records without a suite
    this.#clear();
  }

  /** Return the changes since the last call: {tests, suites: Set of ids, plan, run, log, questions: boolean, every: boolean}. */
  takeChanges() {
    const changes = this.changes;
    this.#clear();
    return changes;
  }

  #clear() {
    this.changes = { tests: new Set(), suites: new Set(), plan: false, run: false, log: false, questions: false };
  }

  /** Apply a record; unknown kinds and members are ignored. */
  apply(record) {
    this.events += 1;
    if (record.time > this.time) this.time = record.time;
    const handler = HANDLERS[record.event];
    if (handler) handler(this, record);
  }

  /** All fixtures of all suites. */
  *fixtures() {
    for (const suite of this.suites.values()) yield* suite.fixtures.values();
  }

  /** Seconds since the run began, on the clock of the run. */
  elapsed(now) {
    if (!this.started) return 0;
    return this.ended && !this.resumed ? this.ended.duration : Math.max(0, now - this.started.time);
  }

  shift(test, before) {
    const after = test.state;
    if (before === after) return;
    if (before) this.counts.set(before, (this.counts.get(before) ?? 1) - 1);
    this.counts.set(after, (this.counts.get(after) ?? 0) + 1);
  }

  /** Take a test out of the run, and the cases of a program with it. */
  forget(test) {
    for (const one of [...test.cases]) this.forget(one);
    this.counts.set(test.state, this.counts.get(test.state) - 1);
    this.running.delete(test.id);
    this.tests.delete(test.id);
    for (const home of [this.suites.get(test.suite)?.tests, test.program?.cases]) {
      if (home?.includes(test)) home.splice(home.indexOf(test), 1);
    }
    this.changes.plan = true;
  }

  note(record) {
    this.log.push(record);
    this.changes.log = true;
  }

  /** Return the attempt that a record belongs to; null for a test that was not planned. */
  attemptOf(record) {
    const test = this.tests.get(record.test);
    if (!test) return null;
    this.changes.tests.add(test.id);
    if (!test.attempt) test.attempts.push(new Attempt({ test: test.id, attempt: 0, time: record.time }));
    return test.attempt;
  }

  /** Return the fixture of a record, or null. */
  fixtureOf(record) {
    const suite = this.suites.get(record.suite ?? "") ?? this.suites.get(this.fixtureHome.get(record.fixture) ?? "");
    if (!suite || !record.fixture) return null;
    this.changes.suites.add(suite.id);
    return suite.fixture(record.fixture);
  }
}

/** Add a record to a list of its attempt. */
const into = (list) => (run, record) => run.attemptOf(record)?.[list].push(record);

const HANDLERS = {
  run_started(run, record) {
    run.changes.run = true;
    run.ended = null;
    run.interrupted = null;
    run.internalErrors = [];
    if (!record.resumed || !run.started) {
      run.started = record;
      return;
    }
    run.resumed = record;
    for (const suite of run.suites.values()) suite.ended = null;
    for (const test of [...run.tests.values()]) {
      if (!run.tests.has(test.id) || (test.verdict !== null && !OPEN.has(test.verdict))) continue;
      for (const one of [...test.cases]) run.forget(one); // the program reports them again
      const before = test.state;
      Object.assign(test, { verdict: null, running: false, attempts: [], failures: 0 });
      run.running.delete(test.id);
      run.shift(test, before);
      run.changes.tests.add(test.id);
    }
  },

  run_ended(run, record) {
    run.ended = record;
    run.changes.run = true;
    run.note(record);
  },

  diagnosed(run, record) {
    run.diagnostics.push(record);
    run.changes.run = true;
    run.note(record);
  },

  internal_error(run, record) {
    run.internalErrors.push(record);
    run.changes.run = true;
    run.note(record);
  },

  interrupted(run, record) {
    if (!run.interrupted || record.stage >= run.interrupted.stage) run.interrupted = record;
    run.changes.run = true;
    run.note(record);
  },

  plan_changed(run, record) {
    for (const id of [...(record.removed ?? []), ...(record.changed ?? [])]) {
      const test = run.tests.get(id);
      if (test) run.forget(test);
      run.suites.delete(id);
    }
    run.changes.plan = true;
  },

  suite_planned(run, record) {
    if (run.suites.has(record.suite)) return;
    const suite = new Suite(record);
    run.suites.set(record.suite, suite);
    for (const name of record.fixtures ?? []) {
      suite.fixture(name);
      run.fixtureHome.set(name, record.suite);
    }
    run.changes.plan = true;
  },

  test_planned(run, record) {
    if (run.tests.has(record.test)) return;
    const test = new Test(record, run.tests.size);
    const program = run.tests.get(record.parent);
    if (program && !program.program) {
      test.program = program;
      program.cases.push(test);
    }
    run.tests.set(record.test, test);
    run.suites.get(record.suite)?.tests.push(test);
    run.shift(test, null);
    run.changes.plan = true;
  },

  suite_started(run, record) {
    const suite = run.suites.get(record.suite);
    if (!suite) return;
    suite.started = record;
    for (const name of suite.fixtures.keys()) run.fixtureHome.set(name, suite.id);
    run.changes.suites.add(suite.id);
  },

  suite_ended(run, record) {
    const suite = run.suites.get(record.suite);
    if (!suite) return;
    suite.ended = record;
    run.changes.suites.add(suite.id);
  },

  test_started(run, record) {
    const test = run.tests.get(record.test);
    if (!test) return;
    const before = test.state;
    test.attempts.push(new Attempt(record));
    test.running = true;
    test.verdict = null;
    test.failures = 0;
    run.running.add(test.id);
    run.shift(test, before);
    run.changes.tests.add(test.id);
    const suite = run.suites.get(test.suite);
    for (const [name, generation] of Object.entries(record.fixtures ?? {})) {
      suite?.fixture(name).generation(generation).tests.push({ test: test.id, attempt: test.attempt });
    }
    if (suite && record.fixtures) run.changes.suites.add(suite.id);
    run.note(record);
  },

  test_renamed(run, record) {
    const test = run.tests.get(record.test);
    if (!test) return;
    test.name = record.name;
    test.renamed = true;
    test.description = record.description ?? test.description;
    run.changes.tests.add(test.id);
  },

  test_ended(run, record) {
    const test = run.tests.get(record.test);
    if (!test) return;
    const before = test.state;
    run.attemptOf(record).ended = record;
    test.running = false;
    if (record.final ?? true) test.verdict = record.verdict;
    run.running.delete(test.id);
    run.shift(test, before);
    run.changes.tests.add(test.id);
    if (test.program) run.changes.tests.add(test.program.id);
    for (const [key, asked] of run.questions) {
      if (asked.test === test.id) {
        run.questions.delete(key);
        run.changes.questions = true;
      }
    }
    run.note(record);
  },

  parameters_resolved(run, record) {
    const attempt = run.attemptOf(record);
    if (attempt) attempt.parameters = record.parameters;
  },

  phase_started: into("phases"),

  message(run, record) {
    run.note(record);
    if (record.test) {
      const attempt = run.attemptOf(record);
      if (!attempt) return;
      attempt.messages.push(record);
      if (SEVERE.has(record.severity)) run.tests.get(record.test).failures += 1;
      return;
    }
    const home = run.fixtureOf(record) ?? run.suites.get(record.suite);
    if (!home) return;
    home.messages.push(record);
    if (record.suite) run.changes.suites.add(record.suite);
  },

  measured: into("measurements"),

  series_sampled(run, record) {
    const attempt = run.attemptOf(record);
    if (!attempt) return;
    const key = `${record.subject ?? ""}\n${record.name}`;
    let live = attempt.live.get(key);
    if (!live) {
      live = { record, columns: record.columns, samples: record.columns.map(() => []) };
      attempt.live.set(key, live);
    }
    record.samples.forEach((column, index) => {
      for (const value of column) live.samples[index]?.push(number(value));
    });
  },

  series_recorded(run, record) {
    const attempt = run.attemptOf(record);
    if (!attempt) return;
    attempt.live.delete(`${record.subject ?? ""}\n${record.name}`);
    attempt.series.push(record);
  },

  subresult_ended(run, record) {
    run.attemptOf(record)?.parts.set(record.subject, record);
  },

  attached(run, record) {
    if (record.test) into("attachments")(run, record);
  },

  progressed(run, record) {
    const attempt = run.attemptOf(record);
    if (attempt) attempt.progress = record;
  },

  asked(run, record) {
    const attempt = run.attemptOf(record);
    if (!attempt) return;
    attempt.questions.push({ asked: record, answered: null });
    run.questions.set(`${record.test}\n${record.question}`, record);
    run.changes.questions = true;
    run.note(record);
  },

  answered(run, record) {
    const attempt = run.attemptOf(record);
    run.questions.delete(`${record.test}\n${record.question}`);
    run.changes.questions = true;
    const question = attempt?.questions.findLast((one) => one.asked.question === record.question);
    if (question) question.answered = record;
    run.note(record);
  },

  output_captured(run, record) {
    run.note(record);
    if (record.test) into("output")(run, record);
    else run.fixtureOf(record)?.output.push(record);
  },

  stack_dumped(run, record) {
    run.note(record);
    if (record.test) into("stacks")(run, record);
    else run.fixtureOf(record)?.stacks.push(record);
  },

  fixture_changed(run, record) {
    run.fixtureHome.set(record.fixture, record.suite);
    const fixture = run.fixtureOf(record);
    if (!fixture) return;
    fixture.state = record.state;
    fixture.generation(record.generation).changes.push(record);
    run.note(record);
  },

  fixture_incident(run, record) {
    const fixture = run.fixtureOf(record);
    fixture?.incidents.push(record);
    run.note(record);
  },
};
