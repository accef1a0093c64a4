"""Swaying: which joint shakes its part, as its controller drives it to and fro.

The loop of a joint with too large gains, a late encoder, or a gear that yields, sways, and the joints that are only
held have to work against it: their motors are driven to and fro, too, and may draw more current than the shaking one.
But their encoders agree with those of their motors. So the joint whose encoders are apart by far is the cause: its gear
yields or has play, or one of them is late. If none is, it is the one that sways farthest by far.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.judging.blame import Evidence, Strength

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.judging.drive_agreement import Drive

#: The last moments that are looked at, s: some periods of an arm on its gears, which is a few Hz.
_RECENT = 0.5
#: A controller drives a joint to and fro if its duty cycle passes this value with both signs, %, as no healthy motion
#: of tests does; and the fewest changes of its sign in these moments: a motion that starts and brakes has one.
_STRONG, _FEWEST = 30.0, 4
#: The least way from end to end that counts, deg, and how much farther the one that shakes goes than all others.
_LEAST, _FARTHER = 1.0, 1.5
#: How much farther apart its encoders are than those of all others.
_LOOSER = 4.0
#: The least way from end to end of a joint that is only held, deg, that is not the work of one that has come to rest.
_MOVED = 0.1


def swaying_evidence(drive: Drive, names: Sequence[str]) -> list[Evidence]:
    """Return the evidence against the joint that shakes its part; none without one."""
    recent, efforts = drive.time > drive.time[-1] - _RECENT, drive.efforts
    if (loose := _loose(drive, recent)) is not None and (np.abs(efforts[recent]) >= _STRONG).any():
        joint, apart = loose
        text = f"the encoders of {names[joint]} and of its motor were apart by up to {apart:.1f} deg"
        return [Evidence(frozenset({joint}), text, ("loose",), Strength.LIKELY)]
    ways = np.ptp(_without_trend(drive.time[recent], drive.joints[recent]), axis=0)
    driven = [joint for joint in range(len(names)) if _changes(efforts[recent, joint]) >= _FEWEST]
    if not driven:
        return []
    first = max(driven, key=lambda joint: float(ways[joint]))
    others = max((float(ways[joint]) for joint in driven if joint != first), default=0.0)
    if ways[first] < max(_LEAST, _FARTHER * others):
        return []
    low, high = efforts[recent, first].min(), efforts[recent, first].max()
    text = (
        f"{names[first]} sways by {ways[first]:.1f} deg: its controller drives its motors to and fro, "
        f"with {low:+.0f} to {high:+.0f} %"
    )
    return [Evidence(frozenset({first}), text, ("sways",), Strength.LIKELY)]


def moved_farthest(
    time: FloatArray, positions: FloatArray, joint: int, held: Collection[int]
) -> tuple[int, float] | None:
    """Return which joint that is only held moves to and fro farther than one that should rest, and how far (deg).

    ``positions`` have the shape (states, joints); a straight motion does not count. None if there is no such joint.
    """
    known, ways = np.isfinite(positions).all(axis=0), np.zeros(positions.shape[1])
    ways[known] = np.ptp(_without_trend(time, positions[:, known]), axis=0)
    least = max(_MOVED, float(ways[joint]))
    farther = [one for one in held if one != joint and ways[one] > least]
    return max(((one, float(ways[one])) for one in farther), key=lambda found: found[1], default=None)


def _loose(drive: Drive, recent: NDArray[np.bool_]) -> tuple[int, float] | None:
    """Return the joint whose encoder is apart from those of its motors farther than any other, and by how much."""
    joints, turns = drive.joints[recent], drive.turns[recent]
    if not (np.isfinite(joints).all() and np.isfinite(turns).all()):
        return None
    apart = np.ptp(joints - np.linalg.lstsq(drive.coupling, turns.T, rcond=None)[0].T, axis=0)
    joint = int(np.argmax(apart))
    others = float(np.delete(apart, joint).max(initial=0.0))
    return (joint, float(apart[joint])) if apart[joint] >= max(_LEAST, _LOOSER * others) else None


def _without_trend(time: FloatArray, positions: FloatArray) -> FloatArray:
    """Return positions without the straight motion in them."""
    columns = np.column_stack([time - time[0], np.ones(len(time))])
    left: FloatArray = positions - columns @ np.linalg.lstsq(columns, positions, rcond=None)[0]
    return left


def _changes(effort: FloatArray) -> int:
    """Return how often an effort changes between strongly positive and strongly negative."""
    signs = np.sign(effort[np.abs(effort) >= _STRONG])
    return int(np.count_nonzero(np.diff(signs)))
