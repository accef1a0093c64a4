"""Which suites must not run at the same time: those that stand on the same thing, such as a robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.testing.plugins import facts_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.plan import PlannedSuite
    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry

#: What fixtures of robots occupy.
ROBOT = "robot"
#: Classes of safety of tests that move nothing; most tests are of none.
_HARMLESS = ("", "still")


class Use(NamedTuple):
    """What a fixture stands for: its plug-in, by file and class, or what it occupies; and its ``param``.

    Two of one ``thing`` are two only where each has a ``param``, and another one. Any other difference, be it their
    names, ``<parameter>`` or what they depend on, may well be one robot that is written in two ways.
    """

    thing: str
    param: str


def uses(planned: PlannedSuite) -> list[Use]:
    """What the fixtures of a suite stand for. What a plug-in occupies is there once.

    Tests that say that they are not safe, and stand on no fixture, move a robot that somebody else has started.
    """
    if planned.fixtures:
        return [_use(entry, plugin) for entry, plugin in planned.fixtures]
    return [Use(ROBOT, "")] if any(_moves(test.plugin) for test in planned.tests) else []


def _use(entry: FixtureEntry, plugin: PluginRef | str) -> Use:
    if isinstance(plugin, str):  # there is none of that name
        return Use(entry.plugin, entry.param)
    facts = facts_of(plugin)
    if facts is not None and facts.occupies:
        return Use(facts.occupies, "")
    return Use(f"{plugin.path}:{facts.class_name if facts is not None else ''}", entry.param)


def _moves(plugin: PluginRef | None) -> bool:
    facts = None if plugin is None else facts_of(plugin)
    return facts is not None and facts.safety not in _HARMLESS


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
