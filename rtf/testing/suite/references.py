"""References inside a suite: of fixtures to fixtures, of tests to fixtures, of tests to earlier tests."""

from __future__ import annotations

import heapq
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

from rtf.testing.suite.ids import slug
from rtf.testing.suite.model import TEST_REQUIREMENT, FixtureEntry, Scope, TestEntry
from rtf.xml_tree import quote

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from rtf.testing.suite.diagnostics import DiagnosticLog

_SHOWN = 20  # members of a circle, so that the message stays readable


def order_fixtures(fixtures: Sequence[FixtureEntry], problems: DiagnosticLog) -> tuple[FixtureEntry, ...]:
    """Sort fixtures so that each comes after those it depends on, otherwise in file order.

    Fixtures that depend on something unknown, on something shorter lived, or on themselves in a circle are reported and
    left out, together with those that depend on them.
    """
    by_name = {fixture.name: fixture for fixture in fixtures}
    graph = {one.name: one.depends for one in fixtures if _dependencies_sound(one, by_name, problems)}
    sorter = TopologicalSorter(graph)
    circle: list[str] = []
    try:
        sorter.prepare()
    except CycleError as error:  # those in circles, and those that depend on them, never get ready
        circle = error.args[1][:0:-1]
        first = circle.index(min(circle, key=[*graph].index))
        circle = [*circle[first:], *circle[:first]]
        shown = circle if len(circle) <= _SHOWN else [*circle[:_SHOWN], "…"]
        message = f"fixtures depend on each other in a circle: {' -> '.join([*shown, circle[0]])}"
        problems.error(message, by_name[circle[0]].location)
    ordered = {name: by_name[name] for name in _in_order(sorter, [*graph])}
    for name in graph.keys() - circle - ordered.keys():
        message = f"fixture {quote(name)} is left out, because something it depends on could not be used"
        problems.error(message, by_name[name].location)
    return tuple(ordered.values())


def _in_order(sorter: TopologicalSorter[str], names: Sequence[str]) -> Iterator[str]:
    """Yield the names that come out of the sorter, those that are ready at the same time in their given order."""
    position = {name: index for index, name in enumerate(names)}
    ready: list[int] = []
    while True:
        for name in sorter.get_ready():
            if name in position:  # what a fixture depends on may be unusable, and then it never gets ready
                heapq.heappush(ready, position[name])
        if not ready:
            return
        name = names[heapq.heappop(ready)]
        yield name
        sorter.done(name)


def _dependencies_sound(fixture: FixtureEntry, by_name: Mapping[str, FixtureEntry], problems: DiagnosticLog) -> bool:
    sound = True
    for name in fixture.depends:
        other = by_name.get(name)
        if other is None:
            message = f"fixture {quote(fixture.name)} depends on {quote(name)}, which is not among the fixtures"
            problems.error(message, fixture.location, problems.did_you_mean(name, by_name))
            sound = False
        elif fixture.scope is Scope.RUN and other.scope is Scope.SUITE:
            message = f"fixture {quote(fixture.name)} lasts the whole run but depends on {quote(name)}, which does not"
            problems.error(message, fixture.location, f'give {quote(name)} scope="run" too')
            sound = False
    return sound


def check_test_fixtures(
    tests: Sequence[TestEntry], usable: Sequence[FixtureEntry], named: Collection[str], problems: DiagnosticLog
) -> list[TestEntry]:
    """Keep the tests whose ``fixtures`` exist; ``named`` are all fixtures of the file, also those left out."""
    known = {fixture.name for fixture in usable}
    kept = []
    for test in tests:
        unknown = [name for name in test.fixtures or () if name not in known]
        for name in unknown:
            what = "could not be used" if name in named else "is not among the fixtures"
            message = f"test {quote(test.name)} needs the fixture {quote(name)}, which {what}"
            problems.error(message, test.location, problems.did_you_mean(name, known))
        if not unknown:
            kept.append(test)
    return kept


def resolve_requirements(tests: Sequence[TestEntry], suite_id: str, problems: DiagnosticLog) -> list[TestEntry]:
    """Replace the test that ``test:…`` names by its id.

    A test is named by its id, by the id without the suite's part, or by its name; a name that several earlier tests
    share means all of them. A reference to another suite's test (an id with a slash) is left for the run to resolve.
    Tests that require one that does not come before them could never run: they are reported and left out.
    """
    targets: dict[str, list[str]] = {}
    kept: list[TestEntry] = []
    for test in tests:
        for token in test.requires:
            problems.spend(test.location, steps=1 + len(targets.get(token.removeprefix(TEST_REQUIREMENT), ())))
        resolved = _resolve(test, targets, suite_id, problems) if test.requires else test
        if resolved is None:
            continue
        kept.append(resolved)
        label = test.id.removeprefix(f"{suite_id}/")
        for key in {test.id, label, test.name, slug(label), f"{suite_id}/{slug(label)}"}:  # ids were in lower case once
            targets.setdefault(key, []).append(test.id)
    return kept


def _resolve(
    test: TestEntry, targets: Mapping[str, Sequence[str]], suite_id: str, problems: DiagnosticLog
) -> TestEntry | None:
    requires: dict[str, None] = {}
    for token in test.requires:
        reference = token.removeprefix(TEST_REQUIREMENT)
        if reference == token:
            requires[token] = None
        elif reference in targets:
            requires.update(dict.fromkeys(TEST_REQUIREMENT + target for target in targets[reference]))
        elif "/" in reference and not reference.startswith(f"{suite_id}/"):
            requires[token] = None
        else:
            message = f"test {quote(test.name)} requires the test {quote(reference)}, which does not stand before it"
            problems.error(
                message,
                test.location,
                problems.did_you_mean(reference, targets) or "name an earlier test of this suite",
            )
            return None
    return replace(test, requires=tuple(requires))
