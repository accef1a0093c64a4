"""What tests stand on where nobody names a fixture, on the command line or in a suite: those that they ask for.

A test that may move something may leave something behind that has to be put right by somebody who outlives it. Unless
its source says plainly that it does not, it is loaded and asked for its
:meth:`~rtf.testing.case.TestCase.implied_fixtures` in a child process, which then ends. One that gives no answer is not
run.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.testing.events import Diagnosed
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.model import FixtureEntry
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.inspection import Trial, Use
    from rtf.testing.plan import PlannedSuite, PlannedTest
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import TestSuite

#: A fixture that is asked for: its plug-in, and its parameters in order.
_Wanted = tuple[str, tuple[tuple[str, str], ...]]


class Stands(NamedTuple):
    """A suite whose tests stand on what they ask for, and what is to be said about it."""

    suite: TestSuite
    diagnostics: tuple[Diagnosed, ...]


def with_fixtures(planned: PlannedSuite, overrides: Sequence[tuple[str, str]]) -> Stands:
    """A suite without fixtures with those that its tests ask for; the others stand on none."""
    asking = [test for test in planned.tests if test.plugin is not None and test.spec.may_move]
    if not asking:
        return Stands(planned.suite, ())
    trials = _trials(asking, overrides)
    entries: dict[_Wanted, FixtureEntry] = {}
    diagnostics, tests = [], []
    for test in planned.suite.tests:
        trial = trials.get(test.id)
        if trial is not None and trial.no_answer:
            text = f"{test.name} was not asked what puts right what it may leave behind: {trial.no_answer}"
            diagnostics.append(Diagnosed(severity=Severity.WARNING, text=text))
            tests.append(replace(test, problem=text))
            continue
        asked = () if trial is None else trial.fixtures
        tests.append(replace(test, fixtures=tuple(_entry(wanted, entries).name for wanted in asked)))
    suite = replace(planned.suite, tests=tuple(tests), fixtures=tuple(entries.values()))
    return Stands(suite, tuple(diagnostics))


def _entry(wanted: _Wanted, entries: dict[_Wanted, FixtureEntry]) -> FixtureEntry:
    """The fixture of the suite for what is wanted: one for all tests that want the same."""
    if wanted not in entries:
        name, parameters = wanted
        shipped = shipped_folder("fixture") / f"{name}.py"  # whatever else is called so where the tests are
        count = sum(plugin == name for plugin, _ in entries)
        entries[wanted] = FixtureEntry(
            name=name if not count else f"{name}~{count + 1}",
            plugin=str(shipped) if shipped.is_file() else name,
            parameters=parameters,
        )
    return entries[wanted]


def _trials(tests: Sequence[PlannedTest], overrides: Sequence[tuple[str, str]]) -> dict[str, Trial]:
    """What each test asks for, by its id. One that cannot be loaded or filled asks for nothing; its run says why."""
    from rtf.testing.inspection import Use, inspect_plugins  # with all about parameters, which few runs need here

    wanted: dict[PluginRef, dict[str, Use]] = {}
    for test in tests:
        entry = test.entry
        use = Use(
            param=entry.param,
            parameters=entry.parameters,
            overrides=tuple(overrides),
            environment=entry.environment,
            folder=str(Path(entry.location.file).parent) if entry.location.file else "",
        )
        assert test.plugin is not None
        wanted.setdefault(test.plugin, {})[entry.id] = use
    found = inspect_plugins({ref: [*uses.values()] for ref, uses in wanted.items()}, ask=True)
    return {
        test_id: trial for ref, uses in wanted.items() for test_id, trial in zip(uses, found[ref].trials, strict=True)
    }
