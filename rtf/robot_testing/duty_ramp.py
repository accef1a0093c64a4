"""One motor driven by its duty cycle, slowly more and more, until it moves: what tests of motors do to a robot.

Only the joint of that motor is without its controller meanwhile. It begins with the duty cycle at which the controller
held it, so that gravity does not take it away; where that does not hold it, it hangs until it has come to rest. What
moves it then is what was added.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RobotError
from rtf.robot_testing.part import PACE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.part import Part
    from rtf.robot_testing.transmission import Transmission

#: How long a joint is looked at to see whether it rests, and how long it may take to come to rest, s.
BASELINE, SETTLING = 0.5, 5.0
#: How long the integral of a controller has to take over what gravity needs, and its output is averaged, s.
_HOLDING, _AVERAGED = 0.5, 0.3
#: How long a board may take to change a mode, s.
_ENTERING = 1.0
#: Way beyond which the holding duty cycle does not hold, deg; and speeds below which a joint is calm, and rests, deg/s.
#: The latter is so small that a whole ramp adds no more than a part of what counts.
_HELD, _CALM, _AT_REST = 1.0, 1.0, 0.2
#: Motion that counts as the first, deg of the joint: beyond the ticks of coarse encoders and the play of a gearbox.
FIRST_MOTION = 0.3
#: How near a limit is touched, deg.
LIMIT_MARGIN = 1.0


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
    """A motor whose joint is driven by its duty cycle. Made by :func:`limp`; all durations are of the robot's time."""

    def __init__(self, part: Part, transmission: Transmission, joint: int) -> None:
        self.part = part
        self.joint = joint
        self.holding = 0.0  # %
        self._factor = float(transmission.factors[joint])
        self._transmission = transmission

    def _where(self) -> tuple[float, float]:
        """Motor and joint (deg of the joint), both positive where a positive duty cycle should turn them."""
        board = self.part.board
        motor = float(board.motor_encoders(self.joint)[0]) / abs(self._factor)
        return motor, board.encoder(self.joint) * float(np.sign(self._factor))

    def _drive(self, duty: float) -> None:
        self.part.board.set_reference_duty_cycles([duty], [self.joint])
        self.part.clock.sleep(PACE)
        if self.part.guard is not None:
            self.part.guard.watch()

    def rest(self, *, held: bool) -> bool:
        """Find a duty cycle at which the joint rests; whether it does. ``held``: its controller holds it until now."""
        if held:
            self.holding = self._held_by()
        self._enter()
        if held and self._comes_to_rest(most=_HELD):
            return True
        self.holding = 0.0
        return self._comes_to_rest()

    def _held_by(self) -> float:
        """The mean duty cycle with which the controller holds the joint, when it has come to rest."""
        part = self.part
        part.wait_until(lambda: float(np.abs(part.board.encoder_speeds(self.joint))[0]) < _CALM, SETTLING)
        part.wait(_HOLDING)
        with part.recorded() as trace:
            part.wait(_AVERAGED)
        duties = trace.duty_cycles.mean(axis=0) if len(trace) else part.board.duty_cycles()
        return self._transmission.holding_duty(duties, self.joint)

    def _enter(self) -> None:
        part, joint = self.part, self.joint
        part.board.set_interaction_modes(InteractionMode.STIFF, joint)
        part.board.set_control_modes(ControlMode.PWM, joint)
        end = part.clock.now() + _ENTERING
        self._drive(self.holding)  # at once, for in the new mode the motor gives nothing until it is told
        while part.board.control_mode(joint) is not ControlMode.PWM:
            if part.clock.now() >= end:
                raise RobotError(f"{part.names[joint]} does not take the mode in which duty cycles are given")
            self._drive(self.holding)

    def _comes_to_rest(self, most: float = np.inf) -> bool:
        """Give the holding duty cycle until both encoders rest; not when it takes them further than ``most`` deg."""
        first, end = np.array(self._where()), self.part.clock.now() + SETTLING
        while self.part.clock.now() < end:
            before, until = np.array(self._where()), self.part.clock.now() + BASELINE
            while self.part.clock.now() < until:
                self._drive(self.holding)
                if np.abs(np.array(self._where()) - first).max() > most:
                    return False
            if np.abs(np.array(self._where()) - before).max() < _AT_REST * BASELINE:
                return True
        return False

    def ramp(
        self, sign: float, *, start: float, step: float, delay: float, most: float, threshold: float, margin: float
    ) -> Ramp:
        """Add ``start`` %, and every ``delay`` s ``step`` % more, until it has moved by ``threshold`` deg.

        It ends, too, at ``most`` % and at a distance of ``margin`` deg from a limit that it moves towards.
        """
        part, joint = self.part, self.joint
        begin, (motor_0, joint_0) = part.clock.now(), self._where()
        within = part.low[joint] <= part.board.encoder(joint) <= part.high[joint]  # else it says nothing of limits
        rows: list[tuple[float, float, float, float]] = []
        end, added, motor, turned = End.MAXIMUM, 0.0, 0.0, 0.0
        while True:
            since = part.clock.now() - begin
            added = start + step * int(since / delay)
            if added > most:
                added = most
                break
            self._drive(self.holding + sign * added)
            now = self._where()
            since = part.clock.now() - begin
            motor, turned = now[0] - motor_0, now[1] - joint_0
            rows.append((since, self.holding + sign * added, motor, turned))
            if max(abs(motor), abs(turned)) >= threshold:
                end = End.MOVED
                break
            if within and _at_limit(part, joint, turned * np.sign(self._factor), margin):
                end = End.LIMIT
                break
        part.board.set_reference_duty_cycles([self.holding], [joint])
        table = np.array(rows)
        return Ramp(end, added, _breakaway(table, self.holding + sign * added), motor, turned, table)


def _at_limit(part: Part, joint: int, turned: float, margin: float) -> bool:
    """Whether a joint that has moved is near the limit that it moves towards."""
    if abs(turned) < LIMIT_MARGIN:
        return False
    here = part.board.encoder(joint)
    return bool(here > part.high[joint] - margin if turned > 0 else here < part.low[joint] + margin)


def _breakaway(rows: FloatArray, last: float) -> float:
    """The duty cycle (%) at which motor or joint began to move; the last one where they did not."""
    still = np.flatnonzero(np.abs(rows[:, 2:]).max(axis=1) < FIRST_MOTION) if len(rows) else np.zeros(0)
    after = int(still[-1]) + 1 if still.size else 0
    return float(rows[after, 1]) if after < len(rows) else last


@contextmanager
def limp(part: Part, transmission: Transmission, joint: int, *, held: bool) -> Iterator[LimpMotor]:
    """Drive the motor of a joint; whatever has happened, its controller holds it again afterwards, if it did before.

    Else it is left without power.
    """
    try:
        yield LimpMotor(part, transmission, joint)
    finally:
        part.board.set_reference_duty_cycles([0.0], [joint])
        part.set_mode(ControlMode.POSITION if held else ControlMode.IDLE, [joint])


def away_from_limits(part: Part, joint: int, distance: float) -> float:
    """The place nearest to a joint's home that leaves ``distance`` deg, or a third of its range, to its limits."""
    room = min(distance, (part.high[joint] - part.low[joint]) / 3.0)
    return float(np.clip(part.home[joint], part.low[joint] + room, part.high[joint] - room))
