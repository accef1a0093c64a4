"""Everything that can be known to be wrong before a test is run: plug-ins that do not load, values that do not fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.testing.events import Diagnosed
from rtf.testing.inspection import Inspection, inspect_plugin
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.cli.running import Plan
    from rtf.testing.plan import PlannedSuite
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry, TestEntry


def problems_of(plan: Plan, overrides: Sequence[tuple[str, str]]) -> Iterator[Diagnosed]:
    """What is wrong with the plug-ins of a plan and with the values they would be given, in order."""
    seen: dict[object, Inspection] = {}
    for planned in plan.suites:
        for fixture, found in planned.fixtures:
            yield from _problems(planned, f"fixture {fixture.name}", fixture, found, overrides=(), seen=seen)
        for test in planned.tests:
            found_test = test.plugin if test.plugin is not None else test.problem
            yield from _problems(
                planned, f"test {test.entry.name}", test.entry, found_test, overrides=overrides, seen=seen
            )


def _problems(
    planned: PlannedSuite,
    what: str,
    entry: TestEntry | FixtureEntry,
    found: PluginRef | str,
    *,
    overrides: Sequence[tuple[str, str]],
    seen: dict[object, Inspection],
) -> Iterator[Diagnosed]:
    if isinstance(found, str):
        yield _diagnosed(planned, entry, Severity.ERROR, found)
        return
    values: dict[str, Any] = {
        "param": entry.param,
        "parameters": entry.parameters,
        "overrides": tuple(overrides),
        "environment": entry.environment,
        "place": str(entry.location) if entry.location.file else "",
        "folder": str(Path(entry.location.file).parent) if entry.location.file else "",
    }
    key = (found, *values.values())
    inspection = seen.get(key)
    if inspection is None:
        inspection = seen[key] = inspect_plugin(found, **values)
    for problem in inspection.problems:
        yield _diagnosed(planned, entry, Severity.ERROR, f"{what}: {problem}")
    for warning in inspection.warnings:
        yield _diagnosed(planned, entry, Severity.WARNING, f"{what}: {warning}")


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
