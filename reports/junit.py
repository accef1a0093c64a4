"""JUnit XML that Jenkins (junit and xunit plug-ins), GitLab and the GitHub readers show truthfully.

There is no standard; ``docs/decisions/0003-junit-writer.md`` says what is written for whom, and why by hand. The
option ``junit-family`` chooses between ``strict`` (default), which is valid against Jenkins' ``junit-10.xsd`` and
therefore says what the schema has no word for as ``[[PROPERTY|name=value]]`` lines in ``system-out``, and ``rich``,
which says it as ``properties`` of the test case, with ``file`` and ``line`` as attributes.

The file is written anew, whole or not at all, when a suite has ended and when the run has; while suites end faster
than a file that grows can be written, some are skipped. The file is red exactly when RTF's exit code is not 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import Event, SuiteEnded
from rtf.testing.report.files import OF_A_TEST, AttemptEvents, Spool, Target, TestEvents
from rtf.testing.report.junit import CaseWriter, attributes, element, kind_of, problem_case, properties_of, seconds_of
from rtf.testing.report.problems import Problem, of_run, of_suite
from rtf.testing.report.text import near_path
from rtf.testing.reporting import Reporter

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.results import RunResult, SuiteResult, TestResult

FAMILIES = ("strict", "rich")

#: A file is written anew when it would grow by this part, or after so many seconds of the run.
_GROWTH = 1 / 20
_PAUSE = 10.0


@dataclass(slots=True)
class _Totals:
    """What the attributes of a suite count."""

    tests: int = 0
    failures: int = 0
    errors: int = 0
    skipped: int = 0

    def count(self, kind: str) -> None:
        self.tests += 1
        self.failures += kind == "failure"
        self.errors += kind == "error"
        self.skipped += kind == "skipped"

    def add(self, other: _Totals) -> None:
        self.tests += other.tests
        self.failures += other.failures
        self.errors += other.errors


class _Names:
    """Gives each case of a class a name that no other has: GitLab passes over a second one of the same name."""

    def __init__(self) -> None:
        self._given: dict[tuple[str, str], int] = {}

    def identity(self, group: str, name: str) -> list[tuple[str, object]]:
        """The attributes that say which case it is."""
        name = name or "(unnamed)"
        unique, count = name, self._given.get((group, name), 0)
        while (group, unique) in self._given:
            count += 1
            unique = f"{name}~{count}"
        self._given[group, unique] = 1
        self._given[group, name] = max(count, 1)
        return [("name", unique), ("classname", group)]


class JUnitReporter(Reporter):
    """Writes ``junit.xml``. Without a target it writes to standard output, once."""

    plugin_name = "junit"
    default_file = "junit.xml"

    _spool: Spool | None = None

    def open(self) -> None:
        """Make sure the report can be written. Raises OSError, and ValueError for an unknown family."""
        family = self.options.extra.get("junit-family", FAMILIES[0])
        if family not in FAMILIES:
            raise ValueError(f"junit-family is {family!r}; known families are {' and '.join(FAMILIES)}")
        self._cases = CaseWriter(self.options.run_folder, strict=family == "strict")
        self._target = Target(self.options.target)
        self._target.check()
        self._spool = Spool(self._target.folder)
        self._events = TestEvents()
        self._written = 0
        self._written_at = 0.0

    def handle(self, event: Event, results: RunResult) -> None:
        """Take one event; a test that has ended leaves the memory, and a suite that has ended is written."""
        if type(event) in OF_A_TEST and event.test:  # type: ignore[attr-defined]
            attempts = self._events.take(event)
            if attempts is not None:
                self._keep(attempts, results.tests.get(event.test))  # type: ignore[attr-defined]
        elif isinstance(event, SuiteEnded):
            self._suite_ended(event, results)

    def close(self, results: RunResult) -> None:
        """Write the whole file."""
        if self._spool is None:
            return
        for test, attempts in self._events.unfinished().items():
            self._keep(attempts, results.tests.get(test))
        spool = self._spool
        try:
            self._write(spool, results, over=True)
        finally:
            self._spool = None
            spool.close()

    def _keep(self, attempts: list[AttemptEvents], result: TestResult | None) -> None:
        if result is not None and self._spool is not None:
            self._spool.put(result.id, self._cases.body(result, attempts).encode())

    def _suite_ended(self, event: SuiteEnded, results: RunResult) -> None:
        spool = self._spool
        if spool is None or not self._target.replaceable:
            return
        grown = spool.size - self._written
        if grown > spool.size * _GROWTH or event.time - self._written_at > _PAUSE:
            self._written, self._written_at = spool.size, event.time
            self._write(spool, results, over=False)

    # The file ----------------------------------------------------------------------------------------------------

    def _write(self, spool: Spool, results: RunResult, *, over: bool) -> None:
        """Write all suites that have ended, or when the run is over all, and the run's own problems."""
        suites = [suite for suite in results.suites.values() if over or suite.ended is not None]
        problems = of_run(results) if over else []
        totals, elapsed = _Totals(), 0.0
        for suite in suites:
            totals.add(_totals(suite))
            elapsed += _elapsed(suite)
        for problem in problems:
            totals.count("error" if problem.red else "")
        pairs: list[tuple[str, object]] = [("name", "rtf"), ("tests", totals.tests), ("failures", totals.failures)]
        pairs += [("errors", totals.errors), ("time", seconds_of(elapsed))]
        with self._target.writing(last=over) as stream:
            head = attributes(pairs)
            stream.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<testsuites{head}>\n'.encode())
            names = _Names()
            for suite in suites:
                stream.write(self._suite_head(suite, results).encode())
                for piece in self._suite_cases(suite, spool, names, results):
                    stream.write(piece)
                stream.write(b"</testsuite>\n")
            if problems:
                stream.write(self._run_suite(problems, names, results).encode())
            stream.write(b"</testsuites>\n")

    def _suite_head(self, suite: SuiteResult, results: RunResult) -> str:
        totals, planned, run = _totals(suite), suite.planned, results.started
        pairs: list[tuple[str, object]] = [
            ("name", suite.name or "(unnamed)"),
            ("tests", totals.tests),
            ("failures", totals.failures),
            ("errors", totals.errors),
            ("skipped", totals.skipped),
            ("time", seconds_of(_elapsed(suite))),
        ]
        if suite.started is not None:
            pairs.append(("timestamp", clock.iso(round(suite.started, 6))))
        host = run.environment.get("host", "") if run else ""
        pairs += [("hostname", host)] if host else []
        pairs.append(("id", suite.id))
        pairs += [("file", near_path(planned.file))] if planned.file else []
        properties = [("description", planned.description), ("environment", planned.environment)]
        properties += [("tags", " ".join(planned.tags)), ("fixtures", " ".join(planned.fixtures))]
        return f"<testsuite{attributes(pairs)}>\n{properties_of([*_run_facts(results), *properties])}"

    def _suite_cases(self, suite: SuiteResult, spool: Spool, names: _Names, results: RunResult) -> Iterator[bytes]:
        group = _class_name(results, suite.name)
        for result in suite.tests.values():
            head = [*names.identity(group, result.label), ("time", seconds_of(result.duration))]
            body = spool.get(result.id) if result.id in spool else self._cases.body(result, []).encode()
            yield f"<testcase{attributes([*head, *self._cases.place(result)])}>\n".encode() + body + b"</testcase>\n"
        problems = of_suite(suite)
        for problem in problems:
            yield problem_case(problem, names.identity(group, problem.name)).encode()
        if not suite.tests and not problems:  # Jenkins drops a suite without a case
            empty = attributes([*names.identity(group, "(no tests)"), ("time", "0.000")])
            skipped = element("skipped", "the suite has no tests", ("message", "the suite has no tests"))
            yield f"<testcase{empty}>\n{skipped}</testcase>\n".encode()

    @staticmethod
    def _run_suite(problems: list[Problem], names: _Names, results: RunResult) -> str:
        totals = _Totals()
        for problem in problems:
            totals.count("error" if problem.red else "")
        pairs: list[tuple[str, object]] = [("name", "run"), ("tests", totals.tests), ("failures", 0)]
        pairs.append(("errors", totals.errors))
        group = _class_name(results, "run")
        cases = "".join(problem_case(problem, names.identity(group, problem.name)) for problem in problems)
        head = attributes([*pairs, ("skipped", 0), ("time", "0.000")])
        return f"<testsuite{head}>\n{properties_of(_run_facts(results))}{cases}</testsuite>\n"


def _totals(suite: SuiteResult) -> _Totals:
    totals = _Totals()
    for result in suite.tests.values():
        totals.count(kind_of(result))
    for problem in of_suite(suite):
        totals.count("error" if problem.red else "")
    if not totals.tests:
        totals.count("skipped")
    return totals


def _elapsed(suite: SuiteResult) -> float:
    if suite.ended is not None:
        return suite.ended.duration
    return sum(result.duration for result in suite.tests.values())


def _class_name(results: RunResult, suite: str) -> str:
    """``robot.suite``: what stands before the last dot is taken for a package, so the suite has no dot of its own."""
    robot = results.started.robot if results.started else ""
    suite = (suite or "(unnamed)").replace(".", "_")
    return f"{robot}.{suite}" if robot else suite


def _run_facts(results: RunResult) -> list[tuple[str, str]]:
    run = results.started
    if run is None:
        return []
    facts = [("robot", run.robot), ("station", run.station), ("rtf", run.version), ("run", run.run)]
    facts += [(f"device.{key}", value) for key, value in run.device.items()]
    facts += [("command", " ".join(run.command)), ("seed", "" if run.seed is None else str(run.seed))]
    return facts + sorted(run.environment.items())
