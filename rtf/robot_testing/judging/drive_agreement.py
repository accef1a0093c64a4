"""Agreement of motors with their duty cycles: which motor, or which joint, does not follow, and which are exchanged.

A motor with a large duty cycle turns in its direction, or is held by something. This is true of any motor and any
load, so no model of either is needed; it is asked only after a motion that has gone wrong. Joints that share motors are
compared with the motors: a jam shows in the motion of one joint, a dead motor in the turns of one rotor, while the
controllers of the joints drive all of their motors. The explanation with the fewest culprits holds.

A joint that stands still with a large duty cycle may carry a load, or be pressed against something by others. That
explains the stop of the joint itself, or of one that shares its motors. Elsewhere it is likely only, and only at a duty
cycle that is half as large again; a motor that turns against its duty cycle is certain. A cause comes first, so who
stopped to follow first is accused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.blame import Evidence, Strength

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray

#: Duty cycle that no healthy joint needs in free motion at the speeds of tests, %: twice what counts as pressing.
LARGE = 30.0
#: Duty cycle with which a joint beside the stopped one presses, %: no load of a robot at rest needs as much.
_HARD = 1.5 * LARGE
#: A motor that is slower than this, deg/s of the joint, does not turn.
_SLOW = 1.0
#: Shortest time for which a motor must not follow, s: a fast joint that brakes is pushed back for less; and the share
#: of states in it in which it may.
_LASTING, _FOLLOWS = 0.15, 0.3
#: A motor turns against its duty cycle, and does not only stand still, by this way, deg of the joint.
_WAY = 5.0
#: Two motors are exchanged if each turns with the duty cycle of the other one for this share of the states in which it
#: turns clearly, deg/s of the joint; and the fewest of these.
_EXCHANGED, _CLEARLY, _FEWEST = 0.8, 10.0, 8
#: Who stops to follow later than the first one by this time, s, is not accused.
_LATER = 0.1


class Drive(NamedTuple):
    """The last moments of a motion: times (s), and arrays (states, axes).

    ``duties`` (%) are positive where they turn a motor and its joints in the positive direction; ``joints`` are the
    positions of the joints, ``turns`` those of the rotors by their gearbox ratios (deg).
    """

    time: FloatArray
    duties: FloatArray
    joints: FloatArray
    turns: FloatArray
    coupling: FloatArray

    @property
    def efforts(self) -> FloatArray:
        """The duty cycles of the motors of each joint together, %; of the shape (states, joints)."""
        together: FloatArray = self.duties @ self.coupling / np.abs(self.coupling).sum(axis=0)
        return together

    @property
    def last_efforts(self) -> FloatArray:
        """The median efforts of the last moments, %, by joint."""
        return _recent(self, self.efforts)


def drive_evidence(drive: Drive, names: Sequence[str], suspects: Collection[int] = ()) -> list[Evidence]:
    """Return the evidence on motors and joints that do not follow their duty cycles; none if all do.

    ``suspects`` are the joints that were stopped, or are late.
    """
    if len(drive.time) < 2:  # noqa: PLR2004 - speeds need two
        return []
    turning = _speeds(drive.time, drive.turns) / np.abs(drive.coupling).max(axis=1)
    efforts, moving = drive.efforts, _speeds(drive.time, drive.joints)
    motors = _stubborn(drive.time, drive.duties, turning)
    joints = _stubborn(drive.time, efforts, moving)
    astray = (moving * np.sign(efforts) <= -_CLEARLY) & (np.abs(efforts) >= LARGE)
    motors = {motor: since for motor, since in motors.items() if not _balanced(drive, motor)}
    if pair := _exchanged(motors, drive.duties, turning):
        what = f"the motors of {names[pair[0]]} and {names[pair[1]]} are swapped"
        return [Evidence(frozenset(pair), f"{what}: each turns by the duty cycle of the other", ("swapped motors",))]
    elsewhere: list[tuple[float, Evidence]] = []
    still: list[Evidence] = []
    for group in _groups(drive.coupling):
        of_motors, of_joints = [one for one in group if one in motors], [one for one in group if one in joints]
        by_motor = len(group) == 1 or len(of_motors) < len(of_joints) or not of_joints
        if not {*group}.isdisjoint(suspects) and (of_motors or of_joints):
            if (inverted := _first_against(drive, turning, astray, group)) is not None:
                return [_motor(drive, inverted, names)]
            if by_motor:
                return [_motor(drive, one, names) for one in of_motors]
            return [_joint(one, names, float(drive.last_efforts[one])) for one in of_joints]
        if by_motor:
            elsewhere += [(motors[one], _motor(drive, one, names)) for one in of_motors if _against(drive, one)]
            still += [_motor(drive, one, names, Strength.LIKELY) for one in of_motors if _pressing(drive, one)]
    first = min((since for since, _ in elsewhere), default=0.0)
    return [one for since, one in elsewhere if since <= first + _LATER] or still


def _speeds(time: FloatArray, positions: FloatArray) -> FloatArray:
    gaps = np.gradient(time)
    speeds: FloatArray = np.gradient(positions, axis=0) / np.where(gaps > 0, gaps, np.inf)[:, None]
    return speeds


def _stubborn(time: FloatArray, efforts: FloatArray, speeds: FloatArray) -> dict[int, float]:
    """Return the axes that have not moved with a large effort for some time until the end, each with its begin (s)."""
    follows = (np.abs(efforts) < LARGE) | (speeds * np.sign(efforts) >= _SLOW)
    recent = time >= time[-1] - _LASTING
    found = {}
    for axis in np.flatnonzero(follows[recent].mean(axis=0) <= _FOLLOWS):
        followed = np.flatnonzero(follows[~recent, axis])
        found[int(axis)] = float(time[followed[-1] + 1] if followed.size else time[0])
    return found


def _exchanged(motors: Mapping[int, float], duties: FloatArray, turning: FloatArray) -> tuple[int, int] | None:
    """Return the two motors of which each turns by the duty cycle of the other one, at least one not by its own.

    ``motors`` are those that do not follow, and since when. One that stopped to follow later than the first was pressed
    against something.
    """
    best, found = 0, None
    latest = min(motors.values(), default=0.0) + _LATER
    for motor in (one for one, since in motors.items() if since <= latest):
        for other in (one for one in range(duties.shape[1]) if motors.get(one, latest) <= latest):
            shares = _turning_by(duties[:, motor], turning[:, other]), _turning_by(duties[:, other], turning[:, motor])
            own = _turning_by(duties[:, other], turning[:, other])
            if other != motor and min(shares) > max(best, own):
                best, found = min(shares), (min(motor, other), max(motor, other))
    return found


def _first_against(drive: Drive, turning: FloatArray, astray: NDArray[np.bool_], group: Sequence[int]) -> int | None:
    """Return the motor of a group that first turned clearly against a large duty cycle, and still does; None if none.

    Those that it drags follow later. A joint that is thrown or braked turns so for a moment only. Where all motors of a
    joint together drive it the way it goes, and it is not ``astray`` (states, joints), another motor was stronger.
    """
    against = (np.abs(drive.duties) >= LARGE) & (turning * np.sign(drive.duties) <= -_CLEARLY)
    against &= (astray @ (drive.coupling != 0).T).astype(bool)
    lasting = np.gradient(drive.time) @ against >= _LASTING
    found = [motor for motor in group if lasting[motor]]
    first = min(found, key=lambda motor: int(np.argmax(against[:, motor])), default=None)
    return first if first is not None and _against(drive, first) else None


def _turning_by(duty: FloatArray, speed: FloatArray) -> int:
    """Return in how many states a motor turns clearly with a large duty cycle; 0 if it does in too few of all."""
    turns: NDArray[np.bool_] = np.abs(speed) >= _CLEARLY
    with_it = int((turns & (np.abs(duty) >= LARGE / 2) & (speed * duty > 0)).sum())
    return with_it if with_it >= max(_FEWEST, _EXCHANGED * int(turns.sum())) else 0


def _recent(drive: Drive, values: FloatArray) -> FloatArray:
    """Return the median values of the last moments."""
    median: FloatArray = np.median(values[drive.time >= drive.time[-1] - _LASTING], axis=0)
    return median


def _groups(coupling: FloatArray) -> list[list[int]]:
    """Return the groups of axes that are coupled, directly or through others."""
    linked = (coupling != 0) | (coupling != 0).T
    left, groups = [*range(len(coupling))], []
    while left:
        group, waiting = set[int](), {left[0]}
        while waiting:
            group |= waiting
            waiting = {int(other) for one in waiting for other in np.flatnonzero(linked[one])} - group
        groups.append(sorted(group))
        left = [axis for axis in left if axis not in group]
    return groups


def _balanced(drive: Drive, motor: int) -> bool:
    """Whether other motors hold one that stands still: no joint that it moves is driven by all of its motors."""
    moved = np.flatnonzero(drive.coupling[motor])
    return not _against(drive, motor) and bool((np.abs(drive.last_efforts[moved]) < LARGE).all())


def _turned(drive: Drive, motor: int) -> float:
    """Return how far a motor has turned, deg of the joint."""
    return float(drive.turns[-1, motor] - drive.turns[0, motor]) / float(np.abs(drive.coupling[motor]).max())


def _against(drive: Drive, motor: int) -> bool:
    """Whether a motor has turned against its duty cycle."""
    turned = _turned(drive, motor)
    return turned * float(_recent(drive, drive.duties)[motor]) < 0 and abs(turned) > _WAY


def _pressing(drive: Drive, motor: int) -> bool:
    """Whether a motor stands still at a duty cycle with which it presses hard."""
    return abs(float(_recent(drive, drive.duties)[motor])) >= _HARD


def _motor(drive: Drive, motor: int, names: Sequence[str], strength: Strength = Strength.CERTAIN) -> Evidence:
    duty = float(_recent(drive, drive.duties)[motor])
    turned_by = [names[int(joint)] for joint in np.flatnonzero(drive.coupling[motor])]
    what = f"the motor of {names[motor]}"
    if len(turned_by) > 1:
        what += f", which moves {' and '.join(turned_by)},"
    if _against(drive, motor):
        way = _turned(drive, motor)
        text = f"{what} turns against its duty cycle: by {way:+.1f} deg of the joint, at {duty:+.0f} %"
        return Evidence(frozenset({motor}), text, ("does not move", "sign"))
    text = f"{what} does not turn at a duty cycle of {duty:+.0f} %"
    return Evidence(frozenset({motor}), text, ("does not move",), strength)


def _joint(joint: int, names: Sequence[str], effort: float) -> Evidence:
    text = f"{names[joint]} does not move, although its motors drive it with {effort:+.0f} %"
    return Evidence(frozenset({joint}), text, ("does not move",))
