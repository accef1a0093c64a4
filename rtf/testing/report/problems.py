"""What went wrong beside the tests, as cases for formats that have nothing but tests.

JUnit and CTRF have no words for a fixture that collapsed, a suite that could not be loaded or a run that was
interrupted. A consumer that reads only such a file must neither miss them nor see a green run where RTF's exit code
is not 0. So each becomes a case of its own, *red* when it is a reason for the exit code and merely visible when the
run recovered:

==========================================  =====================================
what happened                               red
==========================================  =====================================
a fixture collapsed and came back           no
a fixture was given up                      yes
a fixture's teardown went wrong             yes
a suite or fixture said failure or error    yes
a suite, plug-in or file was diagnosed      when the run did not end with code 0
the run was interrupted, or RTF broke       yes
none of the above, no test is red, and
yet the exit code is not 0                  yes: ``run`` says why
==========================================  =====================================
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf.testing.report.text import counts, incident, place, problem_text
from rtf.testing.verdict import ExitCode, FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from rtf.testing.events import Diagnosed, FixtureIncident
    from rtf.testing.results import RunResult, SuiteResult

#: Verdicts of tests that a consumer of tests shows as not carried out; they alone do not make it red.
PASSED_OVER = frozenset({Verdict.SKIPPED, Verdict.EXPECTED_FAILURE, Verdict.BLOCKED, Verdict.NOT_RUN})


@dataclass(slots=True)
class Problem:
    """One problem: its name as a case, its kind as a type, a sentence, and the full text."""

    name: str
    kind: str
    red: bool = False
    message: str = ""
    texts: list[str] = field(default_factory=list)
    incidents: list[FixtureIncident] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The full text; never empty."""
        return "\n".join(self.texts) or self.message or self.name


def of_suite(suite: SuiteResult) -> list[Problem]:
    """Return the problems of one suite: each fixture that had one, then the suite itself."""
    found: dict[str, Problem] = {}
    for event in suite.incidents:
        problem = _of_fixture(found, event.fixture)
        problem.red |= event.phase is Phase.TEARDOWN
        problem.message = incident(event)
        problem.incidents.append(event)
        problem.texts.append(incident_text(event))
    for message in suite.problems:
        kind = "SuiteFailure" if message.severity is Severity.FAILURE else "SuiteError"
        whole = Problem(f"suite: {suite.name}", kind)
        problem = _of_fixture(found, message.fixture) if message.fixture else found.setdefault("suite", whole)
        problem.red = True
        problem.message = problem.message or message.detail or message.title
        problem.texts.append(problem_text(message))
    for name, changed in suite.fixtures.items():
        if changed.state is FixtureState.FAILED:
            problem = _of_fixture(found, name)
            problem.red = True
            problem.message = f"given up: {changed.detail}" if changed.detail else "given up"
            problem.texts.append(problem.message)
    return list(found.values())


def _of_fixture(found: dict[str, Problem], name: str) -> Problem:
    return found.setdefault(f"fixture {name}", Problem(f"fixture: {name}", "FixtureCollapsed"))


def incident_text(event: FixtureIncident) -> str:
    """Return an incident in full: the sentence, the traceback, the last output."""
    last = f"last output:\n{event.output}" if event.output else ""
    return "\n".join(part.rstrip("\n") for part in (incident(event), event.traceback, last) if part)


def of_run(results: RunResult) -> list[Problem]:
    """Return the problems of the run itself, so far."""
    code = results.ended.exit_code if results.ended is not None else int(results.exit_code())
    found: dict[str, Problem] = {}
    for event in results.diagnostics:
        if event.severity in (Severity.ERROR, Severity.FAILURE):
            _diagnosed(found, event, red=code != ExitCode.PASSED)
    problems = list(found.values())
    for error in results.internal_errors:
        texts = [text for text in (error.text, error.traceback.rstrip("\n")) if text]
        problems.append(Problem("run: internal error", "InternalError", red=True, message=error.text, texts=texts))
    if results.interrupted is not None:
        message = f"interrupted by {results.interrupted.source}"
        problems.append(Problem("run: interrupted", "Interrupted", red=True, message=message))
    if results.ended is None and results.interrupted is None:  # in a file that is written while the run goes on
        message = "the run did not end in order: the runner was killed"
        problems.append(Problem("run", "RunError", red=True, message=message))
    if code != ExitCode.PASSED and not _red_somewhere(results, problems):
        problems.append(_unexplained(results, code))
    return problems


def _diagnosed(found: dict[str, Problem], event: Diagnosed, *, red: bool) -> None:
    name = event.suite or event.file or "command line"
    problem = found.setdefault(name, Problem(f"load: {name}", "LoadError", red=red))
    problem.message = problem.message or event.text
    where = place(event.file, event.line, event.column)
    hint = f"; {event.hint}" if event.hint else ""
    problem.texts.append(f"{where}: {event.text}{hint}" if where else f"{event.text}{hint}")


def _red_somewhere(results: RunResult, problems: list[Problem]) -> bool:
    if any(problem.red for problem in problems):
        return True
    if any(not verdict.good and verdict not in PASSED_OVER for verdict in results.counts()):
        return True
    return any(problem.red for suite in results.suites.values() for problem in of_suite(suite))


def _unexplained(results: RunResult, code: int) -> Problem:
    try:
        word = ExitCode(code).name.lower().replace("_", " ")
    except ValueError:
        word = f"exit code {code}"
    return Problem("run", "RunError", red=True, message=f"{word}: {counts(results.counts())}")
