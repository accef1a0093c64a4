"""Everything that can be known to be wrong before a test is run: plug-ins that do not load, values that do not fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.testing.events import Diagnosed
from rtf.testing.inspection import inspect_uses
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.cli.running import Plan
    from rtf.testing.inspection import Inspection
    from rtf.testing.plan import PlannedSuite
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry, TestEntry


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
    for use in uses:
        if isinstance(use.plugin, str):
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, use.plugin)
            continue
        inspection = found[use.plugin][tuple(use.values.values())]
        for problem in inspection.problems:
            yield _diagnosed(use.planned, use.entry, Severity.ERROR, f"{use.what}: {problem}")
        for warning in inspection.warnings:
            yield _diagnosed(use.planned, use.entry, Severity.WARNING, f"{use.what}: {warning}")


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
