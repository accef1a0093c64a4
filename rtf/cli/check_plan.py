"""Show a plan and its problems before a test is run: listing, dry run, validation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.arguments import add_reading_options
from rtf.cli.parser import Parser
from rtf.testing.events import Diagnosed
from rtf.testing.inspection import try_uses
from rtf.testing.isolation.messages import Use
from rtf.testing.plan import Plan, Planner, load_files, suite_files, unused_variables
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.diagnostics import diagnosed
from rtf.testing.suite.model import TestEntry, number_suites
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    import argparse
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from rtf.testing.suite.model import FixtureEntry, TestSuite


_NOT_FOUND = "  NOT FOUND"


def list_plan(plan: Plan) -> ExitCode:
    """Print a plan, and below it why something is not found. ``--dry-run`` also prints where it was looked for."""
    show_plan(plan)
    missing = tuple(missing_of(plan))
    show_diagnostics(missing)
    return ExitCode.USAGE if plan.has_errors or missing else ExitCode.PASSED


def show_plan(plan: Plan) -> None:
    """Print the tests of a plan, a line each: id, name, tags, safety class, whether it is missing."""
    show_diagnostics(plan.diagnostics)
    for suite in plan.suites:
        print(f"{suite.name}  ({suite.file or 'command line'})")
        for fixture in suite.fixtures:
            needs = f"  needs {', '.join(fixture.depends)}" if fixture.depends else ""
            print(f"  fixture {fixture.name}{needs}{_NOT_FOUND if fixture.problem else ''}")
        for test in suite.tests:
            tags = f"  [{' '.join(test.tags)}]" if test.tags else ""
            safety = f"  safety: {test.spec.safety}" if test.spec.safety else ""
            print(f"  {test.id}  {test.name}{tags}{safety}{_NOT_FOUND if test.problem else ''}")
            for case, _ in test.cases:
                print(f"    {case}")
    print(_counted(sum(len(suite.tests) for suite in plan.suites), "test"))


def refuse(plan: Plan) -> ExitCode:
    """Report why nothing is run: a suite that cannot be read whole is not the suite that was meant."""
    show_diagnostics(plan.diagnostics)
    print(
        f"testrunner: nothing was run: {_counted(_errors(plan.diagnostics), 'error')} in the suite files",
        file=sys.stderr,
    )
    return ExitCode.USAGE


def show_diagnostics(diagnostics: Iterable[Diagnosed]) -> None:
    """Print the diagnostics of files and of the command line to stderr, as compilers do."""
    for one in diagnostics:
        print(one, file=sys.stderr)


def dry_run(plan: Plan, options: argparse.Namespace) -> ExitCode:
    """Print the plan and every problem. Exit code 0 when a run could begin."""
    show_plan(plan)
    problems = [*problems_of(plan, options.overrides)]
    show_diagnostics(problems)
    print(f"dry run: nothing was run, {_counted(_errors(problems), 'error')} found")
    return ExitCode.USAGE if _errors(problems) else ExitCode.PASSED


def validate(words: Sequence[str]) -> ExitCode:
    """Report all problems of suite files, their plug-ins and their parameters; run nothing."""
    from rtf.cli.project import project_value

    parser = Parser(
        prog="testrunner validate", description="Everything that is wrong in suite files, before anything moves."
    )
    parser.add_argument(
        "suites", nargs="*", metavar="SUITE", help="suite files, or folders of them (default: those of rtf.toml)"
    )
    parser.add_argument("--strict", action="store_true", help="warnings count as errors")
    add_reading_options(parser)
    options = parser.parse_args(words)
    names = options.suites or project_value("suites")
    if not names:
        parser.error("which suites? Name files or folders, here or in rtf.toml")
    variables = dict(options.define)
    parts = [_loaded(Path(name), variables, lenient=options.lenient) for name in names]
    suites = number_suites([suite for part in parts for suite in part.suites])
    asked = frozenset[str]().union(*(part.variables for part in parts))
    plan = Plan(Planner(options.overrides).plan(suites), variables=asked)
    found = [one for part in parts for one in part.diagnostics]
    found += [*unused_variables(variables, plan), *problems_of(plan, options.overrides)]
    show_diagnostics(found)
    errors = _errors(found)
    warnings = len(found) - errors
    tests = sum(len(suite.tests) for suite in plan.suites)
    size = f"{_counted(len(plan.suites), 'suite')}, {_counted(tests, 'test')}"
    print(f"{size}: {_counted(errors, 'error')}, {_counted(warnings, 'warning')}")
    return ExitCode.USAGE if errors or (options.strict and warnings) else ExitCode.PASSED


def _loaded(path: Path, variables: dict[str, str], *, lenient: bool) -> Plan:
    """Return the suite of a file, or all suites of a folder, which must have one."""
    if not path.is_dir():
        return load_files([(path, True)], variables, lenient=lenient)
    loaded = load_files([(file, False) for file in suite_files(path, recursive=True)], variables, lenient=lenient)
    if loaded.suites or loaded.diagnostics:
        return loaded
    text = "there is no suite in this folder"
    return Plan((), (Diagnosed(severity=Severity.ERROR, text=text, file=str(path)),))


def _errors(diagnostics: Iterable[Diagnosed]) -> int:
    return sum(diagnosed.severity is Severity.ERROR for diagnosed in diagnostics)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


def problems_of(plan: Plan, overrides: Sequence[tuple[str, str]]) -> Iterator[Diagnosed]:
    """Yield the problems of a plan's plug-ins and of their values, in order."""
    entries = [*_entries(plan)]
    given = {  # --set is for tests
        id(entry): (entry.found, Use.of(entry, overrides if isinstance(entry, TestEntry) else ()))
        for _, entry in entries
        if entry.found is not None
    }
    trials = try_uses(given.values())
    simulated: dict[tuple[str, str], dict[str, str]] = {}  # by suite and name of the fixture, which come before tests
    for suite, entry in entries:
        if entry.found is None:
            yield _diagnosed(suite, entry, entry.problem)
            continue
        what = f"{'test' if isinstance(entry, TestEntry) else 'fixture'} {entry.name}"
        trial = trials[given[id(entry)]]
        values = {row["name"]: row["value"].strip('"') for row in trial.values}
        yield from (_diagnosed(suite, entry, f"{what}: {problem}") for problem in trial.problems)
        warnings = [*trial.warnings]
        if values and Path(entry.found.path) == shipped_folder("fixture") / "simulator.py":
            simulated[suite.id, entry.name] = values
        if absent := _absent_part(suite, entry, values, simulated):
            warnings.append(absent)
        yield from (_diagnosed(suite, entry, f"{what}: {warning}", Severity.WARNING) for warning in warnings)


def missing_of(plan: Plan) -> Iterator[Diagnosed]:
    """Yield why plug-ins of a plan are not found, a sentence each, without the places that were tried."""
    for suite, entry in _entries(plan):
        if entry.found is None:
            yield _diagnosed(suite, entry, entry.problem.partition("\n")[0])


def _entries(plan: Plan) -> Iterator[tuple[TestSuite, TestEntry | FixtureEntry]]:
    for suite in plan.suites:
        yield from ((suite, fixture) for fixture in suite.fixtures)
        yield from ((suite, test) for test in suite.tests)


def _diagnosed(
    suite: TestSuite, entry: TestEntry | FixtureEntry, text: str, severity: Severity = Severity.ERROR
) -> Diagnosed:
    """Return the diagnostic of an entry of a suite, at its place."""
    return diagnosed(severity, text, entry.location, suite=suite.id)


def _absent_part(
    suite: TestSuite,
    entry: TestEntry | FixtureEntry,
    values: dict[str, str],
    simulated: dict[tuple[str, str], dict[str, str]],
) -> str:
    """Return that the simulated robot of a test lacks its part, or an empty text; other robots are not known."""
    part = values.get("part", "")
    if not part or not isinstance(entry, TestEntry):
        return ""
    names = [fixture.name for fixture in suite.fixtures] if entry.fixtures is None else entry.fixtures
    robots = [simulated[suite.id, name] for name in names if (suite.id, name) in simulated]
    if len(robots) != 1 or values.get("robot", "").strip("/") not in ("", robots[0]["robot"].strip("/")):
        return ""
    known = _parts_of(robots[0])
    return "" if part in known else f"part: the simulated robot has no {part!r}, but {', '.join(known)}"


def _parts_of(robot: dict[str, str]) -> Collection[str]:
    if robot["parts"]:
        return [part.strip() for part in robot["parts"].split(",")]
    from rtf.robot.model import DEFAULT_ROBOT, load_robot

    return load_robot(robot["model"] or DEFAULT_ROBOT).parts
