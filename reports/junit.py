"""JUnit XML that Jenkins (junit and xunit plug-ins), GitLab and the GitHub readers show truthfully.

There is no standard; ``docs/decisions/0003-junit-writer.md`` says what is written for whom, and why by hand. The
option ``junit-family`` chooses between ``strict`` (default), which is valid against Jenkins' ``junit-10.xsd`` and
therefore says what the schema has no word for as ``[[PROPERTY|name=value]]`` lines in ``system-out``, and ``rich``,
which says it as ``properties`` of the test case, with ``file`` and ``line`` as attributes.

The file is written anew, whole or not at all, while the run goes on. A test that has not ended is an error in it, *not
run: the runner was killed*, until it has; so the file of a run that was killed tells the truth. The file is red exactly
when RTF's exit code is not 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

from rtf import clock
from rtf.testing.report.files import FileReporter
from rtf.testing.report.junit import CaseWriter, attributes, element, kind_of, problem_case, properties_of, seconds_of
from rtf.testing.report.problems import of_run, of_suite
from rtf.testing.report.text import near_path

if TYPE_CHECKING:
    from rtf.testing.report.files import AttemptEvents
    from rtf.testing.report.problems import Problem
    from rtf.testing.results import RunResult, SuiteResult, TestResult

#: What is said of a test that has not begun. There may be thousands of them, and they are made while the run goes on.
_NOT_RUN = element(
    "error", "not run: the runner was killed", ("type", "not run"), ("message", "not run: the runner was killed")
)

FAMILIES = ("strict", "rich")


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

    def __init__(self, given: dict[tuple[str, str], int] | None = None) -> None:
        self._given = given or {}
        self._of_tests: dict[str, str] = {}

    def copy(self) -> _Names:
        """Names for the cases that are no tests, which are others each time the file is written."""
        return _Names({**self._given})

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

    def of_test(self, test: str, group: str, name: str) -> list[tuple[str, object]]:
        """The attributes of a test, which are the same each time the file is written."""
        if test not in self._of_tests:
            self._of_tests[test] = str(self.identity(group, name)[0][1])
        return [("name", self._of_tests[test]), ("classname", group)]


class JUnitReporter(FileReporter):
    """Writes ``junit.xml``. Without a target it writes to standard output, once."""

    plugin_name = "junit"
    default_file = "junit.xml"

    def open(self) -> None:
        """Make sure the report can be written. Raises OSError, and ValueError for an unknown family."""
        family = self.options.extra.get("junit-family", FAMILIES[0])
        if family not in FAMILIES:
            raise ValueError(f"junit-family is {family!r}; known families are {' and '.join(FAMILIES)}")
        self._cases = CaseWriter(self.options.run_folder, strict=family == "strict")
        self._names = _Names()
        super().open()

    def entry(self, result: TestResult, attempts: list[AttemptEvents], results: RunResult) -> bytes:
        identity = self._identity(result.id, results)
        if result.verdict is None and not attempts:
            return f"<testcase{attributes([*identity, ('time', '0.000')])}>\n{_NOT_RUN}</testcase>\n".encode()
        return self._cases.case(result, attempts, identity).encode()

    def _identity(self, test: str, results: RunResult) -> list[tuple[str, object]]:
        result, suite = results.tests.get(test), results.suite_of(test)
        if result is None or suite is None:
            return []
        return self._names.of_test(test, _class_name(results, suite.name), result.label)

    # The file ----------------------------------------------------------------------------------------------------

    def document(self, stream: BinaryIO, results: RunResult) -> None:
        suites = [*results.suites.values()]
        problems = of_run(results)
        of_suites = [_totals(suite) for suite in suites]
        totals = _Totals()
        for one in of_suites:
            totals.add(one)
        for problem in problems:
            totals.count("error" if problem.red else "")
        elapsed = sum(_elapsed(suite) for suite in suites)
        pairs: list[tuple[str, object]] = [("name", "rtf"), ("tests", totals.tests), ("failures", totals.failures)]
        pairs += [("errors", totals.errors), ("time", seconds_of(elapsed))]
        names = self._names.copy()
        stream.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<testsuites{attributes(pairs)}>\n'.encode())
        for suite, one in zip(suites, of_suites, strict=True):
            stream.write(self._suite_head(suite, one, results).encode())
            stream.writelines(self.entries(suite.tests))
            stream.write(self._beside_tests(suite, names, results).encode())
        if problems:
            stream.write(self._run_suite(problems, names, results).encode())
        stream.write(b"</testsuites>\n")

    def _suite_head(self, suite: SuiteResult, totals: _Totals, results: RunResult) -> str:
        planned, run = suite.planned, results.started
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

    @staticmethod
    def _beside_tests(suite: SuiteResult, names: _Names, results: RunResult) -> str:
        group = _class_name(results, suite.name)
        problems = of_suite(suite)
        cases = [problem_case(problem, names.identity(group, problem.name)) for problem in problems]
        if not suite.tests and not problems:  # Jenkins drops a suite without a case
            empty = attributes([*names.identity(group, "(no tests)"), ("time", "0.000")])
            skipped = element("skipped", "the suite has no tests", ("message", "the suite has no tests"))
            cases.append(f"<testcase{empty}>\n{skipped}</testcase>\n")
        return "".join([*cases, "</testsuite>\n"])

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
