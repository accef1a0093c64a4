"""Bringing joints to where a test begins: a robot whose joints do not come there fails."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.courses import finish
from rtf.robot_testing.part import PACE, TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.case import RobotTest
    from rtf.robot_testing.courses import Course
    from rtf.robot_testing.part import Part

#: The speed of such moves, deg/s.
BRINGING_SPEED = 20.0


def bring(
    test: RobotTest,
    part: Part,
    joints: Sequence[int],
    targets: Sequence[float] | FloatArray,
    *,
    speed: float = BRINGING_SPEED,
    tolerance: float = TOLERANCE,
) -> None:
    """Move joints in position mode, stiff, to where they are to begin; fail, naming those that do not come there."""
    finish(part, bringing(test, part, joints, targets, speed=speed, tolerance=tolerance), pace=PACE)


def bringing(
    test: RobotTest,
    part: Part,
    joints: Sequence[int],
    targets: Sequence[float] | FloatArray,
    *,
    speed: float = BRINGING_SPEED,
    tolerance: float = TOLERANCE,
) -> Course[None]:
    """The same as a course."""
    late = yield from _coming(part, joints, targets, speed=speed, tolerance=tolerance)
    test.assert_fail_if_true(late, f"{'; '.join(late.values())}; {likely_causes('does not move')}")


def late_joints(
    part: Part,
    joints: Sequence[int],
    targets: Sequence[float] | FloatArray,
    *,
    speed: float = BRINGING_SPEED,
    tolerance: float = TOLERANCE,
) -> dict[int, str]:
    """The same, returning the joints that do not come there, with a sentence about each.

    A move that does not begin is told twice, for whether commands get lost is no matter here.
    """
    return finish(part, _coming(part, joints, targets, speed=speed, tolerance=tolerance), pace=PACE)


def late_of_held(
    part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray, *, speed: float, tolerance: float
) -> dict[int, str]:
    """The same of joints that are held already."""
    return finish(part, _going(part, joints, targets, speed=speed, tolerance=tolerance), pace=PACE)


def _coming(
    part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray, *, speed: float, tolerance: float
) -> Course[dict[int, str]]:
    yield from holding(part, joints)
    return (yield from _going(part, joints, targets, speed=speed, tolerance=tolerance))


def _going(
    part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray, *, speed: float, tolerance: float
) -> Course[dict[int, str]]:
    arrival = yield from part.moving(targets, joints, speed=speed, tolerance=tolerance)
    if not arrival.reached:
        arrival = yield from part.moving(targets, joints, speed=speed, tolerance=tolerance)
    if arrival.reached:
        return {}
    return {
        joint: f"{part.names[joint]} is at {where:.2f} deg, not at {target:.2f}, though it was told twice to go there"
        for joint, where, target in zip(joints, arrival.positions, targets, strict=True)
        if not abs(where - target) <= tolerance
    }


def hold(part: Part, joints: Sequence[int]) -> None:
    """Have joints held where they are: stiff where that can be said, in position mode; none that was given up."""
    finish(part, holding(part, joints), pace=PACE)


def holding(part: Part, joints: Sequence[int]) -> Course[None]:
    """The same as a course."""
    chosen = part.held(joints)
    if not chosen:
        return
    with suppress(NotSupportedError, RefusedError):  # what cannot be compliant is stiff
        part.board.set_interaction_modes([InteractionMode.STIFF] * len(chosen), chosen)
    yield from part.entering(ControlMode.POSITION, chosen)


def starting_point(
    part: Part, joint: int, wanted: float | None, room: float, *, both_sides: bool = False
) -> tuple[float, float]:
    """Where a joint begins (deg) and which way it goes (1 or -1) so that ``room`` degrees are left within its limits.

    That is what is ``wanted``, or else where it is. With ``both_sides`` there is room on either side of it.
    """
    margin = min(_MARGIN, 0.05 * (part.high[joint] - part.low[joint]))
    low, high = part.low[joint] + margin, part.high[joint] - margin
    here = float(part.home[joint] if wanted is None else wanted)
    if both_sides:
        return float(np.clip(here, min(low + room, (low + high) / 2), max(high - room, (low + high) / 2))), 1.0
    here = float(np.clip(here, low, high))
    sign = 1.0 if here + room <= high else -1.0
    return here, sign


_MARGIN = 1.0  # deg that is kept from the limits
