"""One motor driven by its duty cycle, slowly more and more, until it moves: what tests of motors do to a robot.

Only the joint of that motor is without its controller meanwhile, and on boards that change the modes of coupled joints
together those, too: their motors keep the duty cycles that have held them. It begins with the duty cycle at which the
controller held it, so that gravity does not take it away. A controller gives something between what lets the joint fall
and what drives it, by chance at the edge of that: a joint that creeps away is caught by a little more or less. One that
cannot be held so hangs until it has come to rest. What moves it then is what was added.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RobotError
from rtf.robot_testing.courses import pause, until

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.courses import Course
    from rtf.robot_testing.part import Part
    from rtf.robot_testing.trace import Trace
    from rtf.robot_testing.transmission import Transmission

#: How long a joint is looked at to see whether it rests, and how long it may take to come to rest, s.
BASELINE, SETTLING = 0.5, 5.0
#: How long the integral of a controller has to take over what gravity needs, and its output is averaged, s.
_HOLDING, _AVERAGED = 0.3, 0.2
#: How long a board may take to change a mode, s.
_ENTERING = 1.0
#: Way beyond which the holding duty cycle does not hold, deg; and speeds below which a joint is calm, and rests, deg/s.
#: The latter is so small that a whole ramp adds no more than a part of what counts.
_HELD, _CALM, _AT_REST = 1.0, 1.0, 0.2
#: Motion within ``BASELINE`` that is no rest, and to and fro that is more than a healthy encoder's jitter, deg.
LEAST_CREEP, _JITTER = _AT_REST * BASELINE, 0.2
#: So many looks have a mean that does not jitter: some 0.1 s.
_MEAN_OF = 5
#: What is added first against a joint that creeps away, %; half of it when that was too much.
_CATCH = 1.0
#: A duty cycle that stays the same is told again so soon, s, lest a lost command keeps the motor from it.
_AGAIN = 0.1
#: Motion that counts as the first, deg of the joint: beyond the ticks of coarse encoders and the play of a gearbox.
FIRST_MOTION = 0.3
#: How far a joint may go that lost its controller only because it is coupled with the one that is driven, deg.
_ASTRAY = 15.0
#: How near a limit is touched, deg.
LIMIT_MARGIN = 1.0
_ROUNDING = 1e-6  # of a step


class End(Enum):
    """Why a ramp has ended."""

    MOVED = "it moved"
    MAXIMUM = "the greatest duty cycle was reached"
    LIMIT = "the joint came to a limit"


@dataclass(frozen=True, slots=True)
class Ramp:
    """A ramp: what was added to the holding duty cycle (%) in the end, and the whole one at which it began to move.

    ``motor`` and ``joint`` are how far their encoders went, in deg of the joint, positive where a
    positive duty cycle should turn them. ``rows`` are time (s), duty cycle (%), motor and joint, a row a look.
    """

    end: End
    added: float
    breakaway: float
    motor: float
    joint: float
    rows: FloatArray

    @property
    def moved(self) -> bool:
        """Whether there was motion, of the motor or of the joint, by their own account."""
        return self.end is End.MOVED


class LimpMotor:
    """A motor whose joint is driven by its duty cycle. Made by :func:`limp`; all durations are of the robot's time.

    What takes time is a course, for the motors of other queues are driven meanwhile.
    """

    def __init__(self, part: Part, transmission: Transmission, joint: int) -> None:
        self.part = part
        self.joint = joint
        self.holding = 0.0  # %
        self.jitter = _JITTER  # deg
        self.restless = (0.0, 0.0)  # the ways of motor and joint, to and fro, when it was seen last without rest, deg
        self.along: list[int] = []  # the joints that the board took along into the mode, and where they stood, deg
        self.stood = np.zeros(0)
        self._duties = np.zeros(part.axes)  # of all motors when they were held, %
        self._factor = float(transmission.factors[joint])
        self._transmission = transmission
        self._told, self._told_at = 0.0, -np.inf

    def _where(self) -> tuple[float, float]:
        """Motor and joint (deg of the joint), both positive where a positive duty cycle should turn them.

        Where others have lost their controllers, too, the motor moves them as well: what counts is where all of them
        together say that it is.
        """
        board = self.part.board
        motor = float(board.motor_encoders(self.joint)[0]) / abs(self._factor)
        if self.along:
            return motor, float(self._transmission.rotors(board.encoders())[self.joint]) / abs(self._factor)
        return motor, board.encoder(self.joint) * float(np.sign(self._factor))

    def _drive(self, duty: float) -> Course[None]:
        now = self.part.clock.now()
        if duty != self._told or now >= self._told_at + _AGAIN:
            self._tell(duty, self.along)
            self._told, self._told_at = duty, now
        if self.along:
            self._look_after()
        yield None

    def _tell(self, duty: float, others: list[int]) -> None:
        """Give a duty cycle; the motors of others keep those that have held them."""
        self.part.board.set_reference_duty_cycles([duty, *self._duties[others]], [self.joint, *others])

    def _look_after(self) -> None:
        part = self.part
        gone = np.abs(part.board.encoders(self.along) - self.stood)
        if gone.max() > _ASTRAY:
            one = self.along[int(gone.argmax())]
            raise RobotError(
                f"{part.names[one]} shares motors with {part.names[self.joint]}, and went {gone.max():.1f} deg while "
                "that one was driven; test it where gravity does not move them"
            )

    def rest(self, *, held: bool) -> Course[bool]:
        """Find a duty cycle at which the joint rests; whether it does. ``held``: its controller holds it until now."""
        self._duties = self.part.board.duty_cycles()
        if held:
            self._duties = yield from self._held_by()
            self.holding = self._transmission.holding_duty(self._duties, self.joint)
        yield from self._enter()
        if held and self.along:  # the other motors go on with their shares
            self.holding = float(self._duties[self.joint])
        if held and (yield from self._is_caught()):
            return True
        self.holding = 0.0
        return (yield from self._comes_to_rest())

    def _held_by(self) -> Course[FloatArray]:
        """The mean duty cycles of all motors of the part, when the joint has come to rest."""
        part, clock = self.part, self.part.clock
        yield from until(clock, lambda: float(np.abs(part.board.encoder_speeds(self.joint))[0]) < _CALM, SETTLING)
        yield from pause(clock, _HOLDING)
        with part.recorded() as trace:
            yield from pause(clock, _AVERAGED)
        if not len(trace):
            return part.board.duty_cycles()
        self.jitter = self._jitter_of(trace)
        duties: FloatArray = trace.duty_cycles.mean(axis=0)
        return duties

    def _jitter_of(self, trace: Trace) -> float:
        """How far a single look (deg) has to be away to be more than the jitter that shows while the joint is held."""
        joint, motor = trace.positions[:, self.joint], trace.motor_positions[:, self.joint] / self._factor
        return float(np.clip(2.0 * max(np.ptp(joint), np.ptp(motor)), LEAST_CREEP, _JITTER))

    def _enter(self) -> Course[None]:
        part, joint = self.part, self.joint
        coupled = [one for one in self._transmission.coupled(joint) if one != joint]
        stood = part.board.encoders(coupled) if coupled else self.stood
        part.board.set_interaction_modes(InteractionMode.STIFF, joint)
        part.board.set_control_modes(ControlMode.PWM, joint)
        end = part.clock.now() + _ENTERING
        # At once, and until it is in it: in the new mode a motor gives nothing until it is told. What is told to a
        # joint in another mode goes for nothing.
        if coupled:
            self._tell(self.holding, coupled)
        yield from self._drive_anew(self.holding)
        while part.board.control_mode(joint) is not ControlMode.PWM:
            if part.clock.now() >= end:
                raise RobotError(f"{part.names[joint]} does not take the mode in which duty cycles are given")
            yield from self._drive_anew(self.holding)
        self.along = self._transmission.went_along(part.board, joint, ControlMode.PWM)
        self.stood = stood[[coupled.index(one) for one in self.along]]

    def _drive_anew(self, duty: float) -> Course[None]:
        self._told_at = -np.inf
        return self._drive(duty)

    def _is_caught(self) -> Course[bool]:
        """Give the holding duty cycle, and change it against a joint that creeps away, until both encoders rest.

        False when the joint gets further than ``_HELD`` deg, or does not come to rest.
        """
        clock, change, way = self.part.clock, _CATCH, 0.0
        first = before = np.array(self._where())
        looks: list[FloatArray] = []
        end, since = clock.now() + SETTLING, clock.now()
        while clock.now() < end:
            yield from self._drive(self.holding)
            looks.append(np.array(self._where()))
            here = looks[-1]
            if np.abs(here - first).max() > _HELD:
                return False
            gone = here - before
            if np.abs(gone).max() < self.jitter:  # it may be no more than that: what creeps does so on the average
                gone, here = _crept(looks), np.mean(looks[-_MEAN_OF:], axis=0)
            if np.abs(gone).max() >= LEAST_CREEP:
                away = float(np.sign(gone[np.abs(gone).argmax()]))
                change /= 2.0 if away == -way else 1.0
                self.holding, way = self.holding - away * change, away
                before, since = here, clock.now()
                looks.clear()
            elif clock.now() >= since + BASELINE:
                return True
        return False

    def _comes_to_rest(self) -> Course[bool]:
        """Give the holding duty cycle until both encoders rest."""
        clock = self.part.clock
        end = clock.now() + SETTLING
        while clock.now() < end:
            looks, until_then = [np.array(self._where())], clock.now() + BASELINE
            while clock.now() < until_then:
                yield from self._drive(self.holding)
                looks.append(np.array(self._where()))
            ways = np.ptp(looks, axis=0)
            if np.abs(_crept(looks)).max() < LEAST_CREEP and ways.max() < _JITTER:
                return True
            self.restless = float(ways[0]), float(ways[1])
        return False

    def ramp(
        self, sign: float, *, start: float, step: float, delay: float, most: float, threshold: float, margin: float
    ) -> Course[Ramp]:
        """Add ``start`` %, and every ``delay`` s ``step`` % more, until it has moved by ``threshold`` deg.

        It ends, too, at ``most`` % and at a distance of ``margin`` deg from a limit that it moves towards.
        """
        part, joint = self.part, self.joint
        begin, (motor_0, joint_0) = part.clock.now(), self._where()
        group = [joint, *self.along]
        places = part.board.encoders(group)
        within = (part.low[group] <= places) & (places <= part.high[group])  # else it says nothing of limits
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
        self._tell(self.holding, self.along)
        table = np.array(rows)
        return Ramp(end, added, _breakaway(table, self.holding + sign * added), motor, turned, table)


def _crept(looks: list[FloatArray]) -> FloatArray:
    """How far motor and joint went from the first looks to the last ones, deg: without the jitter of single ones."""
    way: FloatArray = np.mean(looks[-_MEAN_OF:], axis=0) - np.mean(looks[:_MEAN_OF], axis=0)
    return way


def _at_limit(part: Part, joint: int, start: float, here: float, margin: float) -> bool:
    """Whether a joint that has moved is near the limit that it moves towards."""
    if abs(here - start) < LIMIT_MARGIN:
        return False
    return bool(here > part.high[joint] - margin if here > start else here < part.low[joint] + margin)


def _breakaway(rows: FloatArray, last: float) -> float:
    """The duty cycle (%) at which motor or joint began to move; the last one where they did not."""
    still = np.flatnonzero(np.abs(rows[:, 2:]).max(axis=1) < FIRST_MOTION) if len(rows) else np.zeros(0)
    after = int(still[-1]) + 1 if still.size else 0
    return float(rows[after, 1]) if after < len(rows) else last


@contextmanager
def limp(part: Part, transmission: Transmission, joint: int, *, held: bool) -> Iterator[LimpMotor]:
    """Drive the motor of a joint; whatever has happened, its controller holds it again afterwards, if it did before.

    Else it is left without power, and so is one that the guard has given up meanwhile.
    """
    motor = LimpMotor(part, transmission, joint)
    try:
        yield motor
    finally:
        group = [joint, *motor.along]
        part.board.set_reference_duty_cycles([0.0] * len(group), group)
        if part.guard is None or not part.guard.given_up(joint):
            part.set_mode(ControlMode.POSITION if held else ControlMode.IDLE, group)


def away_from_limits(part: Part, joint: int, distance: float) -> float:
    """The place nearest to a joint's home that leaves ``distance`` deg, or a third of its range, to its limits."""
    room = min(distance, (part.high[joint] - part.low[joint]) / 3.0)
    return float(np.clip(part.home[joint], part.low[joint] + room, part.high[joint] - room))
