"""What tests stand on where nobody names a fixture, on the command line or in a suite: those that they ask for.

A test that may move something may leave something behind that has to be put right by somebody who outlives it. Unless
its source says plainly that it does not, it is loaded and asked for its
:meth:`~rtf.testing.case.TestCase.implied_fixtures` in a child process, which then ends. One that gives no answer is not
run.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.testing.declared_safety import may_move
from rtf.testing.events import Diagnosed
from rtf.testing.plugins import load_test, safety_of, shipped_folder
from rtf.testing.session import text_of
from rtf.testing.suite.model import FixtureEntry
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.plan import PlannedSuite, PlannedTest
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import TestEntry, TestSuite

#: A fixture that is asked for: its plug-in, and its parameters in order.
_Wanted = tuple[str, tuple[tuple[str, str], ...]]


class Stands(NamedTuple):
    """A suite whose tests stand on what they ask for, and what is to be said about it."""

    suite: TestSuite
    diagnostics: tuple[Diagnosed, ...]


def with_fixtures(planned: PlannedSuite, overrides: Sequence[tuple[str, str]]) -> Stands:
    """A suite without fixtures with those that its tests ask for; the others stand on none."""
    asking = {test.entry.id: test for test in planned.tests if _is_asked(test)}
    if not asking:
        return Stands(planned.suite, ())
    answers = _answers([*asking.values()], overrides)
    entries: dict[_Wanted, FixtureEntry] = {}
    diagnostics, tests = [], []
    for test in planned.suite.tests:
        answer = answers.get(test.id, [])
        if isinstance(answer, str):
            text = f"{test.name} was not asked what puts right what it may leave behind: {answer}"
            diagnostics.append(Diagnosed(severity=Severity.WARNING, text=text))
            tests.append(replace(test, problem=text))
            continue
        tests.append(replace(test, fixtures=tuple(_entry(wanted, entries).name for wanted in answer)))
    suite = replace(planned.suite, tests=tuple(tests), fixtures=tuple(entries.values()))
    return Stands(suite, tuple(diagnostics))


def _is_asked(test: PlannedTest) -> bool:
    return test.plugin is not None and may_move(safety_of(test.plugin))


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


def _answers(tests: Sequence[PlannedTest], overrides: Sequence[tuple[str, str]]) -> dict[str, list[_Wanted] | str]:
    """What each test wants, by its id, or why it could not be asked: at once, for what they import takes the time."""
    if not tests:
        return {}
    from rtf.testing.inspection import LOAD_LIMIT  # with all about parameters, which few runs need here
    from rtf.testing.isolation.isolated_child import run_isolated

    answer = run_isolated(
        lambda: {test.entry.id: _ask(test.plugin, test.entry, overrides) for test in tests}, LOAD_LIMIT
    )
    if isinstance(answer, str):
        if len(tests) == 1:
            return {tests[0].entry.id: answer}
        return {name: found for test in tests for name, found in _answers([test], overrides).items()}
    return {name: found if isinstance(found, str) else _as_tuples(found) for name, found in answer.items()}


def _as_tuples(found: list[Any]) -> list[_Wanted]:
    return [(plugin, tuple((key, value) for key, value in values)) for plugin, values in found]


def _ask(ref: PluginRef | None, entry: TestEntry, overrides: Sequence[tuple[str, str]]) -> list[Any] | str:
    """In the child: names and parameters, as lists, or why it did not say.

    A test that cannot be loaded or filled says so when it is run.
    """
    assert ref is not None
    try:
        test = load_test(ref)
        test.resolve_parameters(
            param=entry.param, parameters=entry.parameters, overrides=overrides, environment=entry.environment
        )
    except (Exception, SystemExit):  # noqa: BLE001 - it ends the test as well, and is told there
        return []
    try:
        return [[name, [*values.items()]] for name, values in test.implied_fixtures()]
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever it is, there is no answer
        return f"{type(error).__name__}: {text_of(error)}"
