"""The fixtures of tests for which neither the command line nor the suite names any: those that the tests ask for.

A test that may move a robot may leave it in a state that only a fixture, which outlives the test, can put right. So
each test whose description does not exclude that it moves is loaded in an isolated child and asked for its
:meth:`~rtf.testing.case.TestCase.implied_fixtures`. A test that gives no answer is not run.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from rtf.testing.events import Diagnosed
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.model import FixtureEntry
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.inspection import Trial
    from rtf.testing.plan import PlannedSuite, PlannedTest
    from rtf.testing.suite.model import TestSuite

#: A fixture that is asked for: its plug-in, and its parameters in order.
_Wanted = tuple[str, tuple[tuple[str, str], ...]]


class Completed(NamedTuple):
    """A suite with the fixtures that its tests ask for, and the problems that were found."""

    suite: TestSuite
    diagnostics: tuple[Diagnosed, ...]


def with_fixtures(planned: PlannedSuite, overrides: Sequence[tuple[str, str]]) -> Completed:
    """Add to a suite without fixtures those that its tests ask for; a test that asks for none has none."""
    asking = [test for test in planned.tests if test.plugin is not None and test.spec.may_move]
    if not asking:
        return Completed(planned.suite, ())
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
    return Completed(suite, tuple(diagnostics))


def _entry(wanted: _Wanted, entries: dict[_Wanted, FixtureEntry]) -> FixtureEntry:
    """The fixture of the suite for one request; equal requests share it."""
    if wanted not in entries:
        name, parameters = wanted
        shipped = shipped_folder("fixture") / f"{name}.py"  # and no file of that name beside the tests
        count = sum(plugin == name for plugin, _ in entries)
        entries[wanted] = FixtureEntry(
            name=name if not count else f"{name}~{count + 1}",
            plugin=str(shipped) if shipped.is_file() else name,
            parameters=parameters,
        )
    return entries[wanted]


def _trials(tests: Sequence[PlannedTest], overrides: Sequence[tuple[str, str]]) -> dict[str, Trial]:
    """What each test asks for, by its id. One that cannot be loaded or filled asks for nothing; its run says why."""
    from rtf.testing.inspection import Use, try_uses  # with all about parameters, which few runs need here

    uses = {test.entry.id: (test.plugin, Use.of(test.entry, overrides)) for test in tests if test.plugin is not None}
    found = try_uses(uses.values(), ask=True)
    return {test_id: found[use] for test_id, use in uses.items()}
