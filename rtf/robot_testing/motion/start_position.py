"""Moving joints to the start positions of a test; joints that do not arrive fail."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot_testing.judging.blame import Evidence, accused, blame, settle
from rtf.robot_testing.motion.part import PACE, TOLERANCE
from rtf.robot_testing.motion.routines import run_to_end
from rtf.robot_testing.motion.stop_evidence import stop_evidence

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.routines import Routine
    from rtf.testing import TestCase

#: The speed of such moves, deg/s.
BRINGING_SPEED = 20.0


def bring(
    test: TestCase,
    part: Part,
    joints: Sequence[int],
    targets: Sequence[float] | FloatArray,
    *,
    speed: float = BRINGING_SPEED,
    tolerance: float = TOLERANCE,
) -> None:
    """Move joints to their start positions in stiff position mode; fail with the names of those that do not arrive."""
    run_to_end(part, bringing(test, part, joints, targets, speed=speed, tolerance=tolerance), pace=PACE)


def bringing(
    test: TestCase,
    part: Part,
    joints: Sequence[int],
    targets: Sequence[float] | FloatArray,
    *,
    speed: float = BRINGING_SPEED,
    tolerance: float = TOLERANCE,
) -> Routine[None]:
    """Return the routine of ``bring``."""
    late = yield from _hold_and_move(part, joints, targets, speed=speed, tolerance=tolerance)
    if late:
        found = late_evidence(part, late)
        joint = next((one for one in accused(found) if one in late), next(iter(late)))
        complaint = Evidence.uncertain(joint, "; ".join(late.values()), "does not move")
        settle(test, blame(joint, complaint, found))


def late_evidence(part: Part, late: Mapping[int, str]) -> list[Evidence]:
    """Return the evidence on the joints of a part, some of which have not arrived, as ``late_joints`` says."""
    found = [Evidence.uncertain(joint, text, "does not move") for joint, text in late.items()]
    return [*stop_evidence(part, late=late), *found]


def late_joints(
    part: Part,
    joints: Sequence[int],
    targets: Sequence[float] | FloatArray,
    *,
    speed: float = BRINGING_SPEED,
    tolerance: float = TOLERANCE,
) -> dict[int, str]:
    """Move joints as ``bring`` does; return those that do not arrive, each with a message.

    The command is repeated once: a lost command is no failure of the joint.
    """
    return run_to_end(part, _hold_and_move(part, joints, targets, speed=speed, tolerance=tolerance), pace=PACE)


def late_held_joints(
    part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray, *, speed: float, tolerance: float
) -> dict[int, str]:
    """Move joints that are held already; return as ``late_joints`` does."""
    return run_to_end(part, _move_twice(part, joints, targets, speed=speed, tolerance=tolerance), pace=PACE)


def _hold_and_move(
    part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray, *, speed: float, tolerance: float
) -> Routine[dict[int, str]]:
    yield from holding(part, joints)
    return (yield from _move_twice(part, joints, targets, speed=speed, tolerance=tolerance))


def _move_twice(
    part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray, *, speed: float, tolerance: float
) -> Routine[dict[int, str]]:
    arrival = yield from part.moving(targets, joints, speed=speed, tolerance=tolerance)
    if not arrival.reached:
        arrival = yield from part.moving(targets, joints, speed=speed, tolerance=tolerance)
    if arrival.reached:
        return {}
    return {
        joint: f"{part.names[joint]} is at {part.shown(joint, where)}, not at {part.shown(joint, target)}, though it "
        "was commanded twice"
        for joint, where, target in zip(joints, arrival.positions, targets, strict=True)
        if not abs(where - target) <= tolerance
    }


def hold(part: Part, joints: Sequence[int]) -> None:
    """Hold joints at their present positions, in stiff position mode; excluded joints are left out."""
    run_to_end(part, holding(part, joints), pace=PACE)


def holding(part: Part, joints: Sequence[int]) -> Routine[None]:
    """Return the routine of ``hold``."""
    chosen = part.held(joints)
    if not chosen:
        return
    with suppress(NotSupportedError, RefusedError):  # a joint without interaction modes is always stiff
        part.board.set_interaction_modes([InteractionMode.STIFF] * len(chosen), chosen)
    yield from part.entering(ControlMode.POSITION, chosen)


def starting_point(
    part: Part, joint: int, wanted: float | None, room: float, *, both_sides: bool = False
) -> tuple[float, float]:
    """Return the start position of a joint (deg) and the direction (1 or -1) in which ``room`` deg are free.

    The start is ``wanted``, by default the home position, shifted into the limits. With ``both_sides`` there is room in
    both directions.
    """
    margin = min(_MARGIN, 0.05 * (part.high[joint] - part.low[joint]))
    low, high = part.low[joint] + margin, part.high[joint] - margin
    here = float(part.home[joint] if wanted is None else wanted)
    if both_sides:
        return float(np.clip(here, min(low + room, (low + high) / 2), max(high - room, (low + high) / 2))), 1.0
    here = float(np.clip(here, low, high))
    sign = 1.0 if here + room <= high else -1.0
    return here, sign


_MARGIN = 1.0  # deg, distance to the limits
