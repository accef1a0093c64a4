"""Which joints and sensors of a robot the tests of a plan judge: from the suites and the robot's model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from rtf.robot_testing.robot_test import RobotTest
from rtf.testing.isolation.messages import Use
from rtf.testing.parameters import ParameterError
from rtf.testing.plugin_makers import load_test

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rtf.robot.model import RobotModel
    from rtf.testing.plan import Plan
    from rtf.testing.suite.model import TestEntry


@dataclass(frozen=True, slots=True)
class Check:
    """What a test judges, in all suites and with all its parameters: names of joints, and keys of sensors."""

    test: str
    subjects: frozenset[str]


def coverage(robot: RobotModel, plan: Plan, overrides: Sequence[tuple[str, str]] = ()) -> list[Check]:
    """Return the checks of a plan, in its order, those without a joint or sensor left out.

    ``overrides`` are those of ``--set``. The tests are loaded in this process; what they raise then is not caught. One
    whose parameters do not fit judges nothing.
    """
    found: dict[str, set[str]] = {}
    for suite in plan.suites:
        for entry in suite.tests:
            name, subjects = _judged(robot, entry, overrides)
            found.setdefault(name, set()).update(subjects)
    return [Check(name, frozenset(subjects)) for name, subjects in found.items() if subjects]


def untouched(robot: RobotModel, checks: Iterable[Check]) -> list[str]:
    """Return the joints and sensors that no check judges, in the robot's order."""
    touched = frozenset[str]().union(*(check.subjects for check in checks))
    joints = [axis.name for part in robot.served for axis in robot.part(part).axes]
    return [subject for subject in (*joints, *robot.sensor_keys) if subject not in touched]


def _judged(robot: RobotModel, entry: TestEntry, overrides: Sequence[tuple[str, str]]) -> tuple[str, Sequence[str]]:
    """Return the name of a test, and its subjects."""
    if entry.found is None or entry.found.language != "python":
        return entry.name, ()
    test = load_test(entry.found)
    if not isinstance(test, RobotTest):
        return entry.name, ()
    use = Use.of(entry, overrides)
    try:
        test.resolve_parameters(**msgspec.structs.asdict(use))
    except ParameterError:  # with which it will end when it is run: it judges nothing
        return type(test).__name__, ()
    return type(test).__name__, test.subjects(robot)
