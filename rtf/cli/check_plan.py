"""What a plan is and what is wrong with it, before a test is run: listing, dry run, validation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.cli.arguments import add_lenient_option
from rtf.cli.parser import Parser, key_value
from rtf.cli.planning import Plan
from rtf.testing.events import Diagnosed
from rtf.testing.inspection import try_uses
from rtf.testing.isolation.messages import Use
from rtf.testing.plan import Loaded, Planner, load_files, suite_files
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.diagnostics import diagnosed
from rtf.testing.suite.model import TestEntry, number_suites
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    import argparse
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry, TestSuite


def list_plan(plan: Plan) -> ExitCode:
    """Print a plan, and below it why something of it is not found: where that was looked for ``--dry-run`` tells."""
    show_plan(plan)
    missing = tuple(missing_of(plan))
    show_diagnostics(missing)
    return ExitCode.USAGE if plan.refused or missing else ExitCode.PASSED


def show_plan(plan: Plan) -> None:
    """Print the tests of a plan, a line each: id, plug-in, tags, what it does to the robot, whether it is missing."""
    show_diagnostics(plan.diagnostics)
    for planned in plan.suites:
        print(f"{planned.suite.name}  ({planned.suite.file or 'command line'})")
        for entry, found in planned.fixtures:
            missing = "  NOT FOUND" if isinstance(found, str) else ""
            needs = f"  needs {', '.join(entry.depends)}" if entry.depends else ""
            print(f"  fixture {entry.name}{needs}{missing}")
        for test in planned.tests:
            tags = f"  [{' '.join(test.entry.tags)}]" if test.entry.tags else ""
            missing = "  NOT FOUND" if test.plugin is None else ""
            safety = f"  safety: {test.spec.safety}" if test.spec.safety else ""
            print(f"  {test.entry.id}  {test.entry.name}{tags}{safety}{missing}")
            for case, _ in test.entry.cases:
                print(f"    {case}")
    print(_counted(sum(len(planned.tests) for planned in plan.suites), "test"))


def refuse(plan: Plan) -> ExitCode:
    """Say why nothing is run: a suite that cannot be read whole is not the suite that was meant."""
    show_diagnostics(plan.diagnostics)
    print(
        f"testrunner: nothing was run: {_counted(_errors(plan.diagnostics), 'error')} in the suite files",
        file=sys.stderr,
    )
    return ExitCode.USAGE


def show_diagnostics(diagnostics: Iterable[Diagnosed]) -> None:
    """Print what is wrong with files, and with the command line, to stderr, the way compilers do."""
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
    """Say everything that is wrong in suite files, their plug-ins and their parameters; run nothing."""
    from rtf.cli.project import project_value

    parser = Parser(
        prog="testrunner validate", description="Everything that is wrong in suite files, before anything moves."
    )
    parser.add_argument(
        "suites", nargs="*", metavar="SUITE", help="suite files, or folders of them (default: those of rtf.toml)"
    )
    parser.add_argument(
        "--define", metavar="NAME=VALUE", type=key_value, action="append", default=[], help="replace ${NAME}"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        type=key_value,
        action="append",
        default=[],
        dest="overrides",
        help="as for running",
    )
    parser.add_argument("--strict", action="store_true", help="warnings count as errors")
    add_lenient_option(parser)
    options = parser.parse_args(words)
    suites: list[TestSuite] = []
    found: list[Diagnosed] = []
    names = options.suites or project_value("suites")
    if not names:
        parser.error("which suites? Name files or folders, here or in rtf.toml")
    for name in names:
        loaded = _loaded(Path(name), dict(options.define), lenient=options.lenient)
        suites += loaded.suites
        found += loaded.diagnostics
    planner = Planner(options.overrides)
    plan = Plan(planner.plan(planner.complete(number_suites(suites))), ())
    found += problems_of(plan, options.overrides)
    show_diagnostics(found)
    errors = _errors(found)
    warnings = len(found) - errors
    tests = sum(len(planned.tests) for planned in plan.suites)
    size = f"{_counted(len(plan.suites), 'suite')}, {_counted(tests, 'test')}"
    print(f"{size}: {_counted(errors, 'error')}, {_counted(warnings, 'warning')}")
    return ExitCode.USAGE if errors or (options.strict and warnings) else ExitCode.PASSED


def _loaded(path: Path, variables: dict[str, str], *, lenient: bool) -> Loaded:
    """The suite of a file, or all suites of a folder, where there has to be one."""
    if not path.is_dir():
        return load_files([(path, True)], variables, lenient=lenient)
    loaded = load_files([(file, False) for file in suite_files(path, recursive=True)], variables, lenient=lenient)
    if loaded.suites or loaded.diagnostics:
        return loaded
    text = "there is no suite in this folder"
    return Loaded((), (Diagnosed(severity=Severity.ERROR, text=text, file=str(path)),))


def _errors(diagnostics: Iterable[Diagnosed]) -> int:
    return sum(diagnosed.severity is Severity.ERROR for diagnosed in diagnostics)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


class _Planned(NamedTuple):
    """An entry of a suite, its plug-in or why there is none, and what that would be given."""

    suite: TestSuite
    what: str
    entry: TestEntry | FixtureEntry
    plugin: PluginRef | str
    use: Use

    def diagnosed(self, severity: Severity, text: str) -> Diagnosed:
        """What is wrong with it, at its place."""
        return diagnosed(severity, text, self.entry.location, suite=self.suite.id)


def problems_of(plan: Plan, overrides: Sequence[tuple[str, str]]) -> Iterator[Diagnosed]:
    """What is wrong with the plug-ins of a plan and with the values they would be given, in order."""
    planned = [*_uses(plan, overrides)]
    trials = try_uses((one.plugin, one.use) for one in planned if not isinstance(one.plugin, str))
    simulated: dict[tuple[str, str], dict[str, str]] = {}  # by suite and name of the fixture, which come before tests
    for one in planned:
        if isinstance(one.plugin, str):
            yield one.diagnosed(Severity.ERROR, one.plugin)
            continue
        trial = trials[one.plugin, one.use]
        values = {row["name"]: row["value"].strip('"') for row in trial.values}
        yield from (one.diagnosed(Severity.ERROR, f"{one.what}: {problem}") for problem in trial.problems)
        yield from (one.diagnosed(Severity.WARNING, f"{one.what}: {warning}") for warning in trial.warnings)
        if values and Path(one.plugin.path) == shipped_folder("fixture") / "simulator.py":
            simulated[one.suite.id, one.entry.name] = values
        if absent := _absent_part(one.suite, one.entry, values, simulated):
            yield one.diagnosed(Severity.WARNING, f"{one.what}: {absent}")


def missing_of(plan: Plan) -> Iterator[Diagnosed]:
    """Why plug-ins of a plan are not found, a sentence each, without the places that were tried."""
    for one in _uses(plan, ()):
        if isinstance(one.plugin, str):
            yield one.diagnosed(Severity.ERROR, one.plugin.partition("\n")[0])


def _absent_part(
    suite: TestSuite,
    entry: TestEntry | FixtureEntry,
    values: dict[str, str],
    simulated: dict[tuple[str, str], dict[str, str]],
) -> str:
    """Says that the simulated robot on which a test stands does not have its part. Of other robots nothing is known."""
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
    from rtf.simulator.axes import PARTS

    return PARTS


def _uses(plan: Plan, overrides: Sequence[tuple[str, str]]) -> Iterator[_Planned]:
    for planned in plan.suites:
        for fixture, plugin in planned.fixtures:
            yield _Planned(planned.suite, f"fixture {fixture.name}", fixture, plugin, Use.of(fixture))
        for test in planned.tests:
            found = test.plugin if test.plugin is not None else test.problem
            use = Use.of(test.entry, overrides)
            yield _Planned(planned.suite, f"test {test.entry.name}", test.entry, found, use)
