"""What may run at the same time, and which test a suite worker runs next. Each test of the run is handed out once.

Suites that use the same resource, such as a robot, run one after the other. A suite that may have ``copies`` of its
fixtures is run by several suite workers at the same time. A test waits for the tests that it requires, and for those of
any suite that occupy a resource that it occupies.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.testing.plugin_source import declared_names
from rtf.testing.plugins import spec_of
from rtf.testing.suite.values import substitute

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry, TestEntry, TestSuite

#: The variable in the ``param`` of a fixture that is replaced by the number of the copy.
COPY = "copy"
#: The resource that fixtures of robots occupy.
ROBOT = "robot"
#: The name of the fixture that starts a robot of its own.
_SIMULATOR = "simulator"


@dataclass(slots=True)
class _Queue:
    """The tests of one suite; ``unfinished`` are the ids of those that wait or run."""

    waiting: list[TestEntry]
    unfinished: set[str]
    running: dict[str, TestEntry] = field(default_factory=dict)
    workers: int = 0
    began: float = 0.0
    deadline: clock.Deadline = field(default_factory=clock.Deadline)


class Dispatcher:
    """Hands out tests, in the order of the plan unless a test has to wait for another. Any thread may ask."""

    def __init__(self, suites: Sequence[TestSuite], done: Collection[str]) -> None:
        self._lock = threading.Lock()
        self._queues = {}
        for suite in suites:
            tests = [test for test in suite.tests if test.id not in done]
            self._queues[suite.id] = _Queue(tests, {test.id for test in tests})
        self._occupied: set[str] = set()
        self._wakers: list[Callable[[], None]] = []

    def is_empty(self, suite: str) -> bool:
        """Whether all tests of a suite have been handed out."""
        return not self._queues[suite].waiting

    def enter(self, suite: TestSuite, wake: Callable[[], None]) -> tuple[bool, clock.Deadline]:
        """Register a worker at a suite. Returns whether it is the first one, and the deadline of the suite.

        ``wake`` is called whenever a test has ended for which others may wait.
        """
        with self._lock:
            queue = self._queues[suite.id]
            first = queue.workers == 0
            queue.workers += 1
            self._wakers.append(wake)
            if first:
                queue.began = clock.monotonic()
                queue.deadline = clock.Deadline.after(suite.timeout)
            return first, queue.deadline

    def leave(self, suite: str, wake: Callable[[], None]) -> tuple[bool, float]:
        """Unregister a worker from a suite. Returns whether it was the last one, and the suite's age in seconds."""
        with self._lock:
            queue = self._queues[suite]
            queue.workers -= 1
            self._wakers.remove(wake)
            return queue.workers == 0, clock.monotonic() - queue.began

    def take(self, suite: str, *, stopping: bool) -> str:
        """Return the id of the next test of a suite, or an empty text if none may begin now.

        When the run is ``stopping``, no test waits: each is only reported as not run.
        """
        with self._lock:
            queue = self._queues[suite]
            chosen = next((n for n, test in enumerate(queue.waiting) if stopping or self._may_begin(test, queue)), None)
            if chosen is None and queue.waiting and not (queue.running or self._occupied):
                chosen = 0  # it requires a later test, and its error says so
            if chosen is None:
                return ""
            test = queue.waiting.pop(chosen)
            queue.running[test.id] = test
            self._occupied.update(test.occupies)
            return test.id

    def _may_begin(self, test: TestEntry, queue: _Queue) -> bool:
        return queue.unfinished.isdisjoint(test.required_tests) and self._occupied.isdisjoint(test.occupies)

    def ended(self, suite: str, test: str) -> None:
        """Record the end of a test, and wake the workers that may wait for it."""
        with self._lock:
            queue = self._queues[suite]
            queue.unfinished.discard(test)
            self._occupied.difference_update(queue.running.pop(test).occupies)
            wakers = [*self._wakers]
        for wake in wakers:
            wake()


# What suites share ---------------------------------------------------------------------------------------------------


class Use(NamedTuple):
    """What a fixture provides: its plug-in, by file and class, or what it occupies; and its ``param``.

    Two uses of one ``thing`` are independent only where each has a ``param``, and not the same. With any other
    difference (names, ``<parameter>``, dependencies) they may be one robot that is written in two ways.
    """

    thing: str
    param: str


def uses(suite: TestSuite) -> list[Use]:
    """Return what the fixtures of a suite provide; of what a plug-in occupies there is only one.

    A test that may move something and has no simulator among its fixtures moves a robot that was there before the run.
    """
    found = [_use(entry) for entry in suite.fixtures]
    if Use(ROBOT, "") not in found and _moves_real_robot(suite):
        found.append(Use(ROBOT, ""))
    return found


def _moves_real_robot(suite: TestSuite) -> bool:
    simulators = {entry.name for entry in suite.fixtures if _is_simulator(entry.found)}
    return any(
        test.found is not None
        and test.spec.may_move
        and simulators.isdisjoint(fixture.name for fixture in suite.fixtures_of(test))
        for test in suite.tests
    )


def _is_simulator(plugin: PluginRef | None) -> bool:
    if plugin is None or plugin.language != "python":
        return False
    class_name = spec_of(plugin).class_name
    return bool(class_name) and declared_names(Path(plugin.path)).get(_SIMULATOR) == class_name


def _use(entry: FixtureEntry) -> Use:
    plugin = entry.found
    if plugin is None:
        return Use(entry.plugin, entry.param)
    spec = spec_of(plugin)
    if spec.occupies is None:  # a class from another file, which may be that of a robot
        return Use(ROBOT, "")
    return Use(spec.occupies, "") if spec.occupies else Use(f"{plugin.path}:{spec.class_name}", entry.param)


def groups_sharing_fixtures(suites: Sequence[TestSuite]) -> list[list[TestSuite]]:
    """Return groups of suites, in the order of the plan; suites with a common fixture are in one group."""
    used = [uses(suite) for suite in suites]
    there_once = {use.thing for of_suite in used for use in of_suite if not use.param}
    groups: list[tuple[set[Use], list[TestSuite]]] = []
    for suite, of_suite in zip(suites, used, strict=True):
        keys = {Use(use.thing, "") if use.thing in there_once else use for use in of_suite}
        joined = [group for group in groups if group[0] & keys]
        members = [member for group in joined for member in group[1]]
        merged = (keys.union(*(group[0] for group in joined)), [*members, suite])
        groups = [group for group in groups if not group[0] & keys]
        groups.append(merged)
    order = {id(suite): index for index, suite in enumerate(suites)}
    return [sorted(members, key=lambda suite: order[id(suite)]) for _, members in groups]


# Copies of a suite ---------------------------------------------------------------------------------------------------


def copies_of(suite: TestSuite, most: int) -> list[TestSuite]:
    """Return the suite as it is run by each of at most ``most`` suite workers at the same time.

    There is only one if its fixtures exist once: those that declare it, such as a robot, and those whose ``param`` is
    the same in every copy.
    """
    count = min(suite.copies, most, len(suite.tests))
    copies = [suite, *(numbered_copy(suite, number) for number in range(2, count + 1))]
    return copies if len(groups_sharing_fixtures(copies)) == len(copies) else [suite]


def numbered_copy(suite: TestSuite, number: int) -> TestSuite:
    """Return a suite with a copy of its fixtures; from the second copy on their names end with the number."""
    tests = (
        test
        if number == 1 or test.fixtures is None
        else replace(test, fixtures=tuple(_numbered(name, number) for name in test.fixtures))
        for test in suite.tests
    )
    fixtures = tuple(_copied(entry, number) for entry in suite.written)
    return replace(suite, fixtures=fixtures, tests=tuple(tests), copy=number)


def _copied(entry: FixtureEntry, number: int) -> FixtureEntry:
    variables = {COPY: str(number)}
    return replace(
        entry,
        name=_numbered(entry.name, number),
        depends=tuple(_numbered(name, number) for name in entry.depends),
        param=substitute(entry.param, variables),
        parameters=tuple((name, substitute(value, variables)) for name, value in entry.parameters),
    )


def _numbered(name: str, number: int) -> str:
    return f"{name}{copy_suffix(number)}"


def copy_suffix(number: int) -> str:
    """Return the ending of the names of a copy's fixtures."""
    return "" if number == 1 else f"@{number}"
