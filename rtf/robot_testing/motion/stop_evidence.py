"""Evidence on a motion that went wrong, from the last states of the part: whose fault it was.

The states before the guard stopped a joint, or before a joint was found not to have arrived, show which encoders
disagree, which motors do not follow, and which joints left their mode by themselves. Where a joint was stopped as soon
as the test began, there are none, and those after the stop are used: a motor that works against its controller does so
then, too. That the guard stopped a joint is evidence, too, but an uncertain one.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import mode_word
from rtf.robot.errors import RobotError
from rtf.robot.extended_state import Field
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.reactions import LIMP
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.drive_agreement import LARGE, Drive, drive_evidence
from rtf.robot_testing.judging.encoder_agreement import Motion, encoder_evidence
from rtf.robot_testing.judging.swaying import swaying_evidence
from rtf.robot_testing.motion.known_motors import MotorStates, motor_evidence

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from rtf.robot_testing.motion.part import Part

#: The time before a stop in which encoders are compared, and motors with their duty cycles, s.
_COMPARED = 5.0
#: The least number of states, and the time for which more are awaited after an earlier stop, s.
_FEWEST = 10
_LONGER = 0.3
_LIMP = [int(mode) for mode in LIMP]
_NEEDED = (Field.JOINT_POSITIONS, Field.MOTOR_POSITIONS, Field.DUTY_CYCLES)


def stop_evidence(
    part: Part,
    error: GuardError | None = None,
    transmission: Transmission | None = None,
    *,
    late: Collection[int] = (),
    moved: int = -1,
) -> list[Evidence]:
    """Return the evidence on the joints of a part after a motion that went wrong, the certain one first.

    ``error`` is the guard's, if it had to stop a joint; ``late`` are joints that did not go where they should, and
    ``moved`` is the only joint that was commanded to move, or the one that is judged. Without ``transmission`` it is
    read from the board.
    """
    suspects = late if error is None else [*late, error.joint]
    until = math.inf if error is None else error.time
    if len(part.history) < _FEWEST:
        _wait(part, _LONGER)
        until = math.inf
    last = None
    with suppress(RobotError):  # then the encoders cannot be compared, and the guard's word counts
        last = _last_moments(part, until, transmission or Transmission.read(part.board))
    found = [] if last is None else _by_sensors(part, last, suspects, moved)
    if error is not None and error.joint >= 0:
        works = last is None or abs(last.drive.last_efforts[error.joint]) >= LARGE
        found.append(_word_of_the_guard(part, error, moved if works else -1))
    return found


def complaint_of_stop(joint: int, error: GuardError, findings: Sequence[str], during: str = "") -> Evidence:
    """Return the complaint about a joint because of a stop; one that was blocked has causes of its own."""
    causes = (error.finding,) if error.finding == "blocked" or not findings else tuple(findings)
    text = f"{during}: {error}" if during else str(error)
    return Evidence.uncertain(joint, text, *causes, excuse=error.excuse)


def _word_of_the_guard(part: Part, error: GuardError, moved: int) -> Evidence:
    """Return that a joint was stopped: evidence against it, or against the one that ``moved`` and pulled it.

    A joint that is only held does not press by itself; the one that moves by motors of both may. But one that is pulled
    away, and hardly works against that, does not hold its place.
    """
    joint, text = error.joint, str(error)
    if error.finding == "blocked" and part.guard is not None and moved in part.guard.coupled_with(joint):
        joint, text = moved, f"{part.names[moved]} moves by a motor that it shares: {text}"
    return Evidence.uncertain(joint, text, error.finding, excuse=error.excuse)


def _wait(part: Part, seconds: float) -> None:
    """Wait for more states. The guard watches, and another joint that it stops is not what is asked about."""
    end = part.clock.now() + seconds
    while (left := end - part.clock.now()) > 0:
        with suppress(GuardError):
            part.wait(left)


class _LastMoments(NamedTuple):
    """The last seconds of a motion; ``modes`` has the shape (states, joints), ``motors`` is None without currents."""

    motion: Motion
    drive: Drive
    modes: NDArray[np.int32]
    motors: MotorStates | None


def _last_moments(part: Part, until: float, transmission: Transmission) -> _LastMoments | None:
    """Return the last seconds up to ``until``; None if a part does not show them."""
    states = part.history.copy()
    if len(states) < _FEWEST or not all(states.newest[1].valid[field] for field in _NEEDED):
        return None
    time = states.local_time
    before = time <= until
    chosen = before & (time > time[before].max(initial=-math.inf) - _COMPARED)
    if chosen.sum() < _FEWEST:
        return None
    joints, turns, duties = states.positions[chosen], states.motor_positions[chosen], states.duty_cycles[chosen]
    gearbox, coupling = transmission.gearbox, transmission.coupling
    modes, motors = states.control_modes[chosen], None
    if all(states.newest[1].valid[field] for field in (Field.MOTOR_VELOCITIES, Field.CURRENTS)):
        currents, speeds = states.currents[chosen], states.motor_velocities[chosen]
        motors = MotorStates(duties, currents, speeds, powered=~np.isin(modes, _LIMP))
    return _LastMoments(
        motion=Motion.of(joints, turns, gearbox, coupling),
        drive=Drive(time[chosen], duties * np.sign(gearbox), joints, turns / gearbox, coupling),
        modes=modes,
        motors=motors,
    )


def _by_sensors(part: Part, last: _LastMoments, suspects: Collection[int], moved: int) -> list[Evidence]:
    found = encoder_evidence(last.motion, part.names) or drive_evidence(last.drive, part.names, suspects)
    if found:
        return found
    found = _by_modes(part, last.modes, suspects)
    if last.motors is not None:
        concerned = {*suspects, moved} - {-1}
        sharing = [one for joint in concerned if part.guard is not None for one in part.guard.coupled_with(joint)]
        found += motor_evidence(last.motors, part.motors, part.names, {*concerned, *sharing})
    if part.guard is None or not part.guard.excluded:  # a limp limb swings, and shakes the others
        found += swaying_evidence(last.drive, part.names)
    return found


def _by_modes(part: Part, modes: NDArray[np.int32], suspects: Collection[int]) -> list[Evidence]:
    """Return which joints have no power although neither the test nor the guard took it.

    ``modes`` has the shape (states, joints). A joint that had none in any of these states counts if it is suspected.
    """
    excluded = part.guard.is_excluded if part.guard is not None else lambda _: False
    driven, found = ~np.isin(modes, _LIMP), []
    for joint in np.flatnonzero(~driven[-1]).tolist():
        before = modes[driven[:, joint], joint]
        # A joint in hardware fault that has just been stopped is excluded by that.
        if joint in part.let_go or (joint not in suspects and (excluded(joint) or not before.size)):
            continue
        now = mode_word(int(modes[-1, joint]))
        text = (
            f"left {mode_word(int(before[-1]))} for {now} by itself" if before.size else f"is in {now}, without power"
        )
        found.append(Evidence(frozenset({joint}), f"{part.names[joint]} {text}", ("lost mode",)))
    return found
