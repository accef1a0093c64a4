"""Duty cycle ramp of one motor: the duty cycle grows slowly until the motor moves.

Only the joint of that motor loses its controller meanwhile; on boards that change the modes of coupled joints
together those do, too, and their motors keep the duty cycles that have held them. The ramp starts from the duty cycle
at which the controller held the joint, so that gravity does not move it. Friction lets a controller hold a joint by
any duty cycle within a band; near the edge of the band the joint creeps without its controller, and a small
correction stops it. One that gives way is held by its controller again, and another duty cycle is tried: a motor that
it shares may give less torque than its duty cycle says. A joint that cannot be held in this way is let down until it
has come to rest. The added duty cycle is then what moves it.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RobotError
from rtf.robot_testing.motion.routines import pause, until
from rtf.testing.verdict import TestFailure

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.routines import Routine
    from rtf.robot_testing.motion.trace import Trace

#: A joint without its controller that is faster than this, deg/s, falls: it would be too fast for the guard soon.
_FALLING = 60.0
#: Observation time in which a joint has to be at rest, and the most time until then, s.
BASELINE, SETTLING = 0.5, 5.0
#: Time for the integral of a controller to take over the load of gravity, and time of averaging its output, s.
_HOLDING, _AVERAGED = 0.3, 0.2
#: Time for a board to change a mode, s.
_ENTERING = 1.0
#: Displacement beyond which the holding duty cycle does not hold, deg; speeds below which a joint has settled, and is
#: at rest, deg/s. The latter is so small that the creep of a whole ramp stays below the threshold of motion.
_HELD, _CALM, _AT_REST = 1.0, 1.0, 0.2
#: Least motion within ``BASELINE`` that is creep, and peak-to-peak jitter of a healthy encoder at most, deg.
LEAST_CREEP, _JITTER = _AT_REST * BASELINE, 0.2
#: Number of samples whose mean removes the jitter: about 0.1 s.
_MEAN_OF = 5
#: First correction of the duty cycle against creep, %; it is halved each time it was too much.
_CORRECTION = 1.0
#: How often a duty cycle is tried that holds a joint, and the first change of one that does not, %. It is doubled while
#: the joint goes the same way; between one for each way the middle is tried. None differs more from the first one, %:
#: what needs more is broken, and would be thrown.
_ATTEMPTS, _CHANGE, _MOST_CHANGE = 8, 2.0, 15.0
#: An unchanged duty cycle is sent again after this time, s, in case a command was lost.
_REPEAT = 0.1
#: Least motion that counts, deg of the joint: beyond the resolution of coarse encoders and the play of a gearbox.
FIRST_MOTION = 0.3
#: Greatest displacement of a joint that lost its controller because it is coupled with the driven one, deg.
_GREATEST_WAY = 15.0
#: Distance to a limit at which a ramp ends, deg.
LIMIT_MARGIN = 1.0
_ROUNDING = 1e-6  # of a step


class End(Enum):
    """Why a ramp has ended."""

    MOVED = "it moved"
    MAXIMUM = "the greatest duty cycle was reached"
    LIMIT = "the joint came to a limit"


@dataclass(frozen=True, slots=True)
class Ramp:
    """A ramp: the duty cycle (%) added to the holding one in the end, and the whole one at which motion began.

    ``motor`` and ``joint`` are the displacements by their encoders, in deg of the joint, positive in the direction in
    which a positive duty cycle should turn them. ``rows`` are the samples: time (s), duty cycle (%), motor and joint
    (deg).
    """

    end: End
    added: float
    breakaway: float
    motor: float
    joint: float
    rows: FloatArray

    @property
    def moved(self) -> bool:
        """Whether the encoder of the motor or of the joint has shown motion."""
        return self.end is End.MOVED


class ModeError(RobotError, TestFailure):
    """A joint does not enter a mode: the test fails, as the robot is at fault."""


class LimpMotor:
    """A motor without a controller, driven by duty cycle. Made by :func:`limp`; durations are of the robot's time.

    The methods that take time are routines: the motors of other queues are driven meanwhile.
    """

    def __init__(self, part: Part, transmission: Transmission, joint: int) -> None:
        self.part = part
        self.joint = joint
        self.holding = 0.0  # %
        self.jitter = _JITTER  # deg
        self.let_down = False  # no duty cycle held the joint where its controller did
        self.restless = (0.0, 0.0)  # peak-to-peak motion of motor and joint when it was last not at rest, deg
        self.along: list[int] = []  # coupled joints that the board put into the mode, too, and their positions, deg
        self.stood = np.zeros(0)
        self._gave_way = 0.0  # the sign of the way of a joint that was not held
        self._duties = np.zeros(part.axes)  # duty cycles of all motors while they were held, %
        self._factor = float(transmission.factors[joint])
        self._transmission = transmission
        self._sent, self._sent_at = 0.0, -np.inf

    def _where(self) -> tuple[float, float]:
        """Return the positions of motor and joint, in deg of the joint, positive as for a positive duty cycle.

        The motor also moves coupled joints that have lost their controllers; its position by all joint encoders
        together counts then.
        """
        board = self.part.board
        motor = float(board.motor_encoders(self.joint)[0]) / abs(self._factor)
        if self.along:
            return motor, float(self._transmission.rotors(board.encoders())[self.joint]) / abs(self._factor)
        return motor, board.encoder(self.joint) * float(np.sign(self._factor))

    def _speed(self) -> float:
        """Return how fast the joint is, deg/s."""
        return float(np.abs(self.part.board.encoder_speeds(self.joint))[0])

    def _drive(self, duty: float) -> Routine[None]:
        now = self.part.clock.now()
        if duty != self._sent or now >= self._sent_at + _REPEAT:
            self._send(duty, self.along)
            self._sent, self._sent_at = duty, now
        if self.along:
            self._check_coupled()
        yield None

    def _send(self, duty: float, others: list[int]) -> None:
        """Send a duty cycle; the motors of ``others`` keep their holding duty cycles."""
        self.part.board.set_reference_duty_cycles([duty, *self._duties[others]], [self.joint, *others])

    def _check_coupled(self) -> None:
        part = self.part
        gone = np.abs(part.board.encoders(self.along) - self.stood)
        if gone.max() > _GREATEST_WAY:
            one = self.along[int(gone.argmax())]
            raise RobotError(
                f"{part.names[one]} shares motors with {part.names[self.joint]}, and moved by "
                f"{part.shown(one, float(gone.max()), '.1f')} during the test of that one; test it in a posture "
                "in which gravity does not move them"
            )

    def rest(self, *, held: bool) -> Routine[bool]:
        """Find a duty cycle at which the joint is at rest; return whether there is one.

        ``held``: its controller holds it until now.
        """
        self._duties = self.part.board.duty_cycles()
        if held:
            self._duties = yield from self._held_by()
            self.holding = self._transmission.holding_duty(self._duties, self.joint)
        yield from self._enter()
        if held and self.along:  # the other motors go on with their shares
            self.holding = float(self._duties[self.joint])
        if held and (yield from self._can_be_held()):
            return True
        self.let_down = held
        self.holding = 0.0
        return (yield from self._comes_to_rest())

    def _held_by(self) -> Routine[FloatArray]:
        """Return the mean duty cycles of all motors of the part, once the joint has come to rest."""
        part, clock = self.part, self.part.clock
        yield from until(clock, lambda: self._speed() < _CALM, SETTLING)
        yield from pause(clock, _HOLDING)
        with part.recorded() as trace:
            yield from pause(clock, _AVERAGED)
        if not len(trace):
            return part.board.duty_cycles()
        self.jitter = self._jitter_of(trace)
        duties: FloatArray = trace.duty_cycles.mean(axis=0)
        return duties

    def _jitter_of(self, trace: Trace) -> float:
        """Return the displacement of a sample (deg) that exceeds the jitter of the encoders while the joint is held."""
        joint, motor = trace.positions[:, self.joint], trace.motor_positions[:, self.joint] / self._factor
        return float(np.clip(2.0 * max(np.ptp(joint), np.ptp(motor)), LEAST_CREEP, _JITTER))

    def _enter(self) -> Routine[None]:
        part, joint = self.part, self.joint
        coupled = [one for one in self._transmission.coupled(joint) if one != joint]
        stood = part.board.encoders(coupled) if coupled else self.stood
        part.board.set_interaction_modes(InteractionMode.STIFF, joint)
        part.board.set_control_modes(ControlMode.PWM, joint)
        end = part.clock.now() + _ENTERING
        # Repeated until the joint is in the mode, as a motor gives no torque there before its first command. Commands
        # to a joint in another mode are ignored.
        if coupled:
            self._send(self.holding, coupled)
        yield from self._drive_anew(self.holding)
        while part.board.control_mode(joint) is not ControlMode.PWM:
            if part.clock.now() >= end:
                word = part.board.control_mode(joint).word
                raise ModeError(f"{part.names[joint]} does not enter the duty cycle mode (PWM): it stays in {word}")
            yield from self._drive_anew(self.holding)
        self.along = self._transmission.went_along(part.board, joint, ControlMode.PWM)
        self.stood = stood[[coupled.index(one) for one in self.along]]

    def _drive_anew(self, duty: float) -> Routine[None]:
        self._sent_at = -np.inf
        return self._drive(duty)

    def _can_be_held(self) -> Routine[bool]:
        """Find a duty cycle that holds the joint; return whether there is one. Its controller holds it between two."""
        change, low, high, first = _CHANGE, -np.inf, np.inf, self.holding
        for _ in range(_ATTEMPTS):
            if (yield from self._correct_creep()):
                return True
            low, high = (low, self.holding) if self._gave_way > 0.0 else (self.holding, high)
            another = (low + high) / 2.0 if np.isfinite(high - low) else self.holding - self._gave_way * change
            another = float(np.clip(another, first - _MOST_CHANGE, first + _MOST_CHANGE))
            if not self._gave_way or not low < another < high:
                break
            change *= 2.0
            yield from self._hold_again()
            self.holding = another
            yield from self._enter()
        return False

    def _hold_again(self) -> Routine[None]:
        """Let the controller hold the joint where it is, until it rests."""
        part, clock = self.part, self.part.clock
        yield from part.entering(ControlMode.POSITION, [self.joint, *self.along])
        yield from pause(clock, _HOLDING)
        yield from until(clock, lambda: self._speed() < _CALM, SETTLING)

    def _correct_creep(self) -> Routine[bool]:
        """Drive the holding duty cycle, and correct it against creep, until both encoders are at rest.

        False if the joint does not come to rest, or moves by more than ``_HELD`` deg: then ``_gave_way`` is the sign of
        its way, 0 if its encoders disagree about it. Where they do, one of them or the gear has a wrong sign, for the
        ramps to find: the joint's counts, by which its controller has held it, until a correction has made the creep
        faster.
        """
        clock, change, way, fast = self.part.clock, _CORRECTION, 0.0, np.inf
        first = before = np.array(self._where())
        samples: list[FloatArray] = []
        self._gave_way = 0.0
        end, since = clock.now() + SETTLING, clock.now()
        while clock.now() < end:
            yield from self._drive(self.holding)
            samples.append(np.array(self._where()))
            here = samples[-1]
            if np.abs(here - first).max() > _HELD:
                motor, joint = np.sign(here - first)
                self._gave_way = float(motor) if motor == joint else 0.0
                return False
            gone = here - before
            if np.abs(gone).max() < self.jitter:  # it may be jitter: creep shows in the mean
                gone, here = _crept(samples), np.mean(samples[-_MEAN_OF:], axis=0)
            if np.abs(gone).max() >= LEAST_CREEP:
                disagree = gone[0] * gone[1] < 0.0 and np.abs(gone).min() >= LEAST_CREEP / 2.0
                crept = float(gone[1] if disagree else gone[np.abs(gone).argmax()])
                away, speed = float(np.sign(crept)), abs(crept) / (clock.now() - since)
                if away == -way:
                    change /= 2.0
                elif disagree and away == way and speed > fast:
                    change *= -2.0
                self.holding, way, fast = self.holding - away * change, away, speed
                before, since = here, clock.now()
                samples.clear()
            elif clock.now() >= since + BASELINE:
                return True
        return False

    def _comes_to_rest(self) -> Routine[bool]:
        """Drive the holding duty cycle until both encoders are at rest; return whether they are.

        A joint that falls is not let down: its controller has to catch it at once.
        """
        clock = self.part.clock
        end = clock.now() + SETTLING
        while clock.now() < end:
            samples, until_then = [np.array(self._where())], clock.now() + BASELINE
            falls = False
            while clock.now() < until_then and not falls:
                yield from self._drive(self.holding)
                samples.append(np.array(self._where()))
                falls = self._speed() > _FALLING
            ways = np.ptp(samples, axis=0)
            if not falls and np.abs(_crept(samples)).max() < LEAST_CREEP and ways.max() < _JITTER:
                return True
            self.restless = float(ways[0]), float(ways[1])
            if falls:
                break
        return False

    def ramp(
        self, sign: float, *, start: float, step: float, delay: float, most: float, threshold: float, margin: float
    ) -> Routine[Ramp]:
        """Add ``start`` % to the holding duty cycle, and ``step`` % more every ``delay`` s, until the joint has moved.

        The ramp ends after a motion of ``threshold`` deg, at ``most`` %, or ``margin`` deg before a limit.
        """
        part, joint = self.part, self.joint
        begin, (motor_0, joint_0) = part.clock.now(), self._where()
        group = [joint, *self.along]
        places = part.board.encoders(group)
        within = (part.low[group] <= places) & (places <= part.high[group])  # only then limits can end the ramp
        rows: list[tuple[float, float, float, float]] = []
        end, added, motor, turned = End.MAXIMUM, 0.0, 0.0, 0.0
        while True:
            since = part.clock.now() - begin
            added = start + step * int(since / delay + _ROUNDING)
            if added > most:
                added = most
                break
            yield from self._drive(self.holding + sign * added)
            now = self._where()
            since = part.clock.now() - begin
            motor, turned = now[0] - motor_0, now[1] - joint_0
            rows.append((since, self.holding + sign * added, motor, turned))
            if max(abs(motor), abs(turned)) >= threshold:
                end = End.MOVED
                break
            here = part.board.encoders(group)
            ways = zip(group, places, here, within, strict=True)
            if any(inside and _at_limit(part, one, begun, now, margin) for one, begun, now, inside in ways):
                end = End.LIMIT
                break
        self._send(self.holding, self.along)
        table = np.array(rows)
        return Ramp(end, added, _breakaway(table, self.holding + sign * added), motor, turned, table)


def _crept(samples: list[FloatArray]) -> FloatArray:
    """Return the displacements of motor and joint between the means of the first and the last samples, deg."""
    way: FloatArray = np.mean(samples[-_MEAN_OF:], axis=0) - np.mean(samples[:_MEAN_OF], axis=0)
    return way


def _at_limit(part: Part, joint: int, start: float, here: float, margin: float) -> bool:
    """Whether a joint that has moved is near the limit that it moves towards."""
    if abs(here - start) < LIMIT_MARGIN:
        return False
    return bool(here > part.high[joint] - margin if here > start else here < part.low[joint] + margin)


def _breakaway(rows: FloatArray, last: float) -> float:
    """Return the duty cycle (%) at which motor or joint began to move; the last one if they did not."""
    still = np.flatnonzero(np.abs(rows[:, 2:]).max(axis=1) < FIRST_MOTION) if len(rows) else np.zeros(0)
    after = int(still[-1]) + 1 if still.size else 0
    return float(rows[after, 1]) if after < len(rows) else last


@contextmanager
def limp(part: Part, transmission: Transmission, joint: int, *, held: bool) -> Iterator[LimpMotor]:
    """Drive the motor of a joint without its controller.

    On every exit its controller holds it again if it did before. Otherwise the joint is left without power, and so is
    one that the guard has excluded meanwhile.
    """
    motor = LimpMotor(part, transmission, joint)
    try:
        yield motor
    finally:
        group = [joint, *motor.along]
        part.board.set_reference_duty_cycles([0.0] * len(group), group)
        if part.guard is None or not part.guard.is_excluded(joint):
            part.set_mode(ControlMode.POSITION if held else ControlMode.IDLE, group)


def away_from_limits(part: Part, joint: int, distance: float) -> float:
    """Return the position nearest to a joint's home at ``distance`` deg, or a third of its range, from its limits."""
    room = min(distance, (part.high[joint] - part.low[joint]) / 3.0)
    return float(np.clip(part.home[joint], part.low[joint] + room, part.high[joint] - room))
