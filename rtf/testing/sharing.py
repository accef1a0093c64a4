"""Which suites must not run at the same time: those that use the same thing, such as a robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.testing.plugin_source import declared_names
from rtf.testing.plugins import spec_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.plan import PlannedSuite
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry

#: What fixtures of robots occupy.
ROBOT = "robot"
#: The name of the fixture that starts a robot of its own.
_SIMULATOR = "simulator"


class Use(NamedTuple):
    """What a fixture provides: its plug-in, by file and class, or what it occupies; and its ``param``.

    Two uses of one ``thing`` are independent only where each has a ``param``, and not the same. With any other
    difference (names, ``<parameter>``, dependencies) they may be one robot that is written in two ways.
    """

    thing: str
    param: str


def uses(planned: PlannedSuite) -> list[Use]:
    """Return what the fixtures of a suite provide. What a plug-in occupies is there once.

    A test that may move something and has no simulator among its fixtures moves a robot that was there before the run.
    """
    found = [_use(entry, plugin) for entry, plugin in planned.fixtures]
    if Use(ROBOT, "") not in found and _moves_real_robot(planned):
        found.append(Use(ROBOT, ""))
    return found


def _moves_real_robot(planned: PlannedSuite) -> bool:
    simulators = {entry.name for entry, plugin in planned.fixtures if _is_simulator(plugin)}
    return any(
        test.plugin is not None
        and test.spec.may_move
        and simulators.isdisjoint(fixture.name for fixture in planned.suite.fixtures_of(test.entry))
        for test in planned.tests
    )


def _is_simulator(plugin: PluginRef | str) -> bool:
    if isinstance(plugin, str) or plugin.language != "python":
        return False
    class_name = spec_of(plugin).class_name
    return bool(class_name) and declared_names(Path(plugin.path)).get(_SIMULATOR) == class_name


def _use(entry: FixtureEntry, plugin: PluginRef | str) -> Use:
    if isinstance(plugin, str):  # there is none of that name
        return Use(entry.plugin, entry.param)
    spec = spec_of(plugin)
    if spec.occupies is None:  # a class from another file, which may be that of a robot
        return Use(ROBOT, "")
    return Use(spec.occupies, "") if spec.occupies else Use(f"{plugin.path}:{spec.class_name}", entry.param)


def groups_sharing_fixtures(suites: Sequence[PlannedSuite]) -> list[list[PlannedSuite]]:
    """Suites that use a fixture in common must not run at the same time; the groups keep the order of the plan."""
    used = [uses(planned) for planned in suites]
    there_once = {use.thing for of_suite in used for use in of_suite if not use.param}
    groups: list[tuple[set[Use], list[PlannedSuite]]] = []
    for planned, of_suite in zip(suites, used, strict=True):
        keys = {Use(use.thing, "") if use.thing in there_once else use for use in of_suite}
        joined = [group for group in groups if group[0] & keys]
        members = [member for group in joined for member in group[1]]
        merged = (keys.union(*(group[0] for group in joined)), [*members, planned])
        groups = [group for group in groups if not group[0] & keys]
        groups.append(merged)
    order = {id(planned): index for index, planned in enumerate(suites)}
    return [sorted(members, key=lambda planned: order[id(planned)]) for _, members in groups]
