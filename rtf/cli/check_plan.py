"""Everything that can be known to be wrong before a test is run: plug-ins that do not load, values that do not fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.cli.running import Plan, show_diagnostics, show_plan
from rtf.testing.events import Diagnosed
from rtf.testing.inspection import Use, inspect_plugins
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.model import TestEntry
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    import argparse
    from collections.abc import Collection, Iterator, Sequence

    from rtf.cli.running import Plan
    from rtf.testing.inspection import Trial
    from rtf.testing.plan import PlannedSuite
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry


class _Planned(NamedTuple):
    """An entry of a suite, its plug-in or why there is none, and what that would be given."""

    planned: PlannedSuite
    what: str
    entry: TestEntry | FixtureEntry
    plugin: PluginRef | str
    use: Use


def problems_of(plan: Plan, overrides: Sequence[tuple[str, str]]) -> Iterator[Diagnosed]:
    """What is wrong with the plug-ins of a plan and with the values they would be given, in order."""
    uses = [*_uses(plan, tuple(overrides))]
    found = _inspected(uses)
    simulated: dict[tuple[str, str], dict[str, str]] = {}  # by suite and name of the fixture, which come before tests
    for use in uses:
        if isinstance(use.plugin, str):
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, use.plugin)
            continue
        trial, problems = found[use.plugin, use.use]
        values = {row["name"]: row["value"].strip('"') for row in trial.values}
        for problem in (*problems, *trial.problems):
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, f"{use.what}: {problem}")
        for warning in trial.warnings:
            yield _diagnosed(use.planned, use.entry, Severity.WARNING, f"{use.what}: {warning}")
        if values and Path(use.plugin.path) == shipped_folder("fixture") / "simulator.py":
            simulated[use.planned.suite.id, use.entry.name] = values
        absent = _absent_part(use.planned, use.entry, values, simulated)
        if absent:
            yield _diagnosed(use.planned, use.entry, Severity.WARNING, f"{use.what}: {absent}")


def missing_of(plan: Plan) -> Iterator[Diagnosed]:
    """Why plug-ins of a plan are not found, a sentence each, without the places that were tried."""
    for use in _uses(plan, ()):
        if isinstance(use.plugin, str):
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, use.plugin.partition("\n")[0])


def _absent_part(
    planned: PlannedSuite,
    entry: TestEntry | FixtureEntry,
    values: dict[str, str],
    simulated: dict[tuple[str, str], dict[str, str]],
) -> str:
    """Says that the simulated robot on which a test stands does not have its part. Of other robots nothing is known."""
    part = values.get("part", "")
    if not part or not isinstance(entry, TestEntry):
        return ""
    names = [fixture.name for fixture in planned.suite.fixtures] if entry.fixtures is None else entry.fixtures
    robots = [simulated[planned.suite.id, name] for name in names if (planned.suite.id, name) in simulated]
    if len(robots) != 1 or values.get("robot", "").strip("/") not in ("", robots[0]["robot"].strip("/")):
        return ""
    known = _parts_of(robots[0])
    return "" if part in known else f"part: the simulated robot has no {part!r}, but {', '.join(known)}"


def _parts_of(robot: dict[str, str]) -> Collection[str]:
    if robot["parts"]:
        return [part.strip() for part in robot["parts"].split(",")]
    from rtf.simulator.axes import PARTS

    return PARTS


def _uses(plan: Plan, overrides: tuple[tuple[str, str], ...]) -> Iterator[_Planned]:
    for planned in plan.suites:
        for fixture, plugin in planned.fixtures:
            yield _Planned(planned, f"fixture {fixture.name}", fixture, plugin, _use(fixture, ()))
        for test in planned.tests:
            behind = test.plugin if test.plugin is not None else test.problem
            yield _Planned(planned, f"test {test.entry.name}", test.entry, behind, _use(test.entry, overrides))


def _use(entry: TestEntry | FixtureEntry, overrides: tuple[tuple[str, str], ...]) -> Use:
    return Use(
        param=entry.param,
        parameters=entry.parameters,
        overrides=overrides,
        environment=entry.environment,
        place=str(entry.location) if entry.location.file else "",
        folder=str(Path(entry.location.file).parent) if entry.location.file else "",
    )


def _inspected(planned: Sequence[_Planned]) -> dict[tuple[PluginRef, Use], tuple[Trial, tuple[str, ...]]]:
    """The trial of each use of each plug-in, and why that could not be loaded."""
    wanted: dict[PluginRef, dict[Use, None]] = {}
    for one in planned:
        if not isinstance(one.plugin, str):
            wanted.setdefault(one.plugin, {})[one.use] = None
    found = inspect_plugins({plugin: [*uses] for plugin, uses in wanted.items()})
    return {
        (plugin, use): (trial, found[plugin].problems)
        for plugin, uses in wanted.items()
        for use, trial in zip(uses, found[plugin].trials, strict=True)
    }


def _diagnosed(planned: PlannedSuite, entry: TestEntry | FixtureEntry, severity: Severity, text: str) -> Diagnosed:
    location = entry.location
    return Diagnosed(
        severity=severity,
        text=text,
        file=location.file,
        line=location.line,
        column=location.column,
        suite=planned.suite.id,
    )


def dry_run(plan: Plan, options: argparse.Namespace) -> ExitCode:
    """Print the plan and every problem. Exit code 0 when a run could begin."""
    show_plan(plan)
    problems = tuple(problems_of(plan, options.overrides))
    show_diagnostics(problems)
    errors = sum(problem.severity is Severity.ERROR for problem in problems)
    print(f"dry run: nothing was run, {errors} error{'s' if errors != 1 else ''} found")
    return ExitCode.USAGE if errors else ExitCode.PASSED
