"""Everything that can be known to be wrong before a test is run: plug-ins that do not load, values that do not fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.testing.events import Diagnosed
from rtf.testing.inspection import inspect_uses
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.model import TestEntry
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from rtf.cli.running import Plan
    from rtf.testing.inspection import Inspection
    from rtf.testing.plan import PlannedSuite
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry


class _Use(NamedTuple):
    """An entry of a suite, what stands behind its name, and what it would be given."""

    planned: PlannedSuite
    what: str
    entry: TestEntry | FixtureEntry
    plugin: PluginRef | str
    values: dict[str, Any]


def problems_of(plan: Plan, overrides: Sequence[tuple[str, str]]) -> Iterator[Diagnosed]:
    """What is wrong with the plug-ins of a plan and with the values they would be given, in order."""
    uses = [*_uses(plan, tuple(overrides))]
    found = _inspected(uses)
    simulated: dict[tuple[str, str], dict[str, str]] = {}  # by suite and name of the fixture, which come before tests
    for use in uses:
        if isinstance(use.plugin, str):
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, use.plugin)
            continue
        inspection = found[use.plugin][tuple(use.values.values())]
        values = {row["name"]: row["value"].strip('"') for row in inspection.values}
        for problem in inspection.problems:
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, f"{use.what}: {problem}")
        for warning in inspection.warnings:
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


def _uses(plan: Plan, overrides: tuple[tuple[str, str], ...]) -> Iterator[_Use]:
    for planned in plan.suites:
        for fixture, plugin in planned.fixtures:
            yield _Use(planned, f"fixture {fixture.name}", fixture, plugin, _values(fixture, ()))
        for test in planned.tests:
            behind = test.plugin if test.plugin is not None else test.problem
            yield _Use(planned, f"test {test.entry.name}", test.entry, behind, _values(test.entry, overrides))


def _values(entry: TestEntry | FixtureEntry, overrides: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    return {
        "param": entry.param,
        "parameters": entry.parameters,
        "overrides": overrides,
        "environment": entry.environment,
        "place": str(entry.location) if entry.location.file else "",
        "folder": str(Path(entry.location.file).parent) if entry.location.file else "",
    }


def _inspected(uses: Sequence[_Use]) -> dict[PluginRef, dict[object, Inspection]]:
    """Look into each plug-in once, because to load it takes longer than all the rest."""
    wanted: dict[PluginRef, dict[object, dict[str, Any]]] = {}
    for use in uses:
        if not isinstance(use.plugin, str):
            wanted.setdefault(use.plugin, {})[tuple(use.values.values())] = use.values
    return {
        plugin: dict(zip(values, inspect_uses(plugin, [*values.values()]), strict=True))
        for plugin, values in wanted.items()
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
