"""Errors of encoders that show while a joint moves: lost counts, spikes, delays, eccentric magnets."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from rtf.simulator.faults.base import Parameter
from rtf.simulator.faults.encoders import EncoderFault, MotorEncoderFault
from rtf.simulator.faults.moments import RandomMoments

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray


class _LostCounts(EncoderFault):
    """A counting encoder that is too slow for its speed; what is lost in one direction comes back in the other."""

    parameters = (
        Parameter("share", 0.05, "", "of the counts at such a speed that are lost", 0.0, 1.0),
        Parameter("above", 40.0, "deg/s", "speed of the joint above which counts are lost", 0.0, 1e4),
    )
    share: float
    above: float

    @property
    def ratio(self) -> float:
        """Degrees that the encoder turns for a degree of the joint."""
        return 1.0

    def begin(self) -> None:
        self._lost, self._before = 0.0, math.nan
        super().begin()

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        here, speed = float(position[self.axis]), float(velocity[self.axis])
        if abs(speed) > self.above * self.ratio:
            if not math.isnan(self._before):
                self._lost += self.share * (here - self._before)
            velocity[self.axis] -= self.share * speed
        self._before = here
        position[self.axis] -= self._lost


class EncoderLostCounts(_LostCounts):
    """Counts of the joint encoder that are lost at high speed."""

    kind = "encoder_lost_counts"
    description = "The joint encoder loses counts when the joint is fast."
    symptom = "Slow moves are right; after a fast one the joint is not where its encoder says."


class MotorEncoderLostCounts(MotorEncoderFault, _LostCounts):
    """Counts of the motor encoder that are lost at high speed."""

    kind = "motor_encoder_lost_counts"
    description = "The motor encoder loses counts when the motor is fast."
    symptom = "Slow moves are right; after a fast one the motor encoder does not return to its earlier reading."

    @property
    def ratio(self) -> float:
        row = self.boards.joint_to_motor[self.axis] * self.boards.gearbox[self.axis]
        return float(np.abs(row).max())


class _Spikes(EncoderFault):
    parameters = (
        Parameter("height", 5.0, "deg", "of a spike, in either direction", 0.0, 1e5),
        Parameter("rate", 2.0, "1/s", "mean number of spikes", 1e-3, 1e3),
        Parameter("length", 0.01, "s", "duration of a spike", 0.0, 60.0),
    )
    height: float
    rate: float
    length: float

    def begin(self) -> None:
        self._spikes = RandomMoments(self.own_random(self.axis), self.rate, self.length, self.simulation.now)
        super().begin()

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del velocity
        if self._spikes.holds(now):
            position[self.axis] += self._spikes.sign * self.height


class EncoderSpikes(_Spikes):
    """Spikes of the joint encoder."""

    kind = "encoder_spikes"
    description = "Single readings of the joint encoder are wrong: a disturbed line, or bits that are lost."
    symptom = "The position jumps and returns at once; the motor jerks."


class MotorEncoderSpikes(MotorEncoderFault, _Spikes):
    """Spikes of the motor encoder."""

    kind = "motor_encoder_spikes"
    description = "Single readings of the motor encoder are wrong: a disturbed line, or bits that are lost."
    symptom = "The reading jumps and returns at once, while the joint moves on."
    parameters = (Parameter("height", 500.0, "deg", "of a spike, of the rotor", 0.0, 1e7), *_Spikes.parameters[1:])


class _Late(EncoderFault):
    parameters = (Parameter("age", 0.02, "s", "of the readings", 0.0, 10.0),)
    age: float

    def begin(self) -> None:
        self._seen: deque[tuple[float, float, float]] = deque()  # time, position, speed
        super().begin()

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        seen, then = self._seen, now - self.age
        if not seen or now > seen[-1][0]:
            seen.append((now, float(position[self.axis]), float(velocity[self.axis])))
        while len(seen) > 1 and seen[1][0] <= then:
            seen.popleft()
        times, positions, speeds = zip(*list(seen)[:2], strict=True)
        position[self.axis] = np.interp(then, times, positions)
        velocity[self.axis] = np.interp(then, times, speeds)


class EncoderLate(_Late):
    """Delay of the joint encoder."""

    kind = "encoder_late"
    description = "The readings of the joint encoder are late: a slow bus, or a filter."
    symptom = "It lags behind the motor encoder by its delay times the speed; the joint overshoots, or swings."


class MotorEncoderLate(MotorEncoderFault, _Late):
    """Delay of the motor encoder."""

    kind = "motor_encoder_late"
    description = "The readings of the motor encoder are late: a slow bus, or a filter."
    symptom = "It lags behind the joint encoder by its delay times the speed."


class EncoderEccentric(EncoderFault):
    """Magnet of the joint encoder that is not centred."""

    kind = "encoder_eccentric"
    description = "The magnet of the joint encoder is not centred on its axis."
    symptom = "The error is a sine of the angle with one period a turn; the joint agrees with its motor nowhere else."
    parameters = (
        Parameter("amplitude", 2.0, "deg", "greatest error", 0.0, 45.0),
        Parameter("phase", 0.0, "deg", "angle of the joint, below zero, at which the error is zero", -360.0, 360.0),
    )
    amplitude: float
    phase: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        angle = math.radians(float(position[self.axis]) + self.phase)
        position[self.axis] += self.amplitude * math.sin(angle)
        velocity[self.axis] *= 1.0 + math.radians(self.amplitude) * math.cos(angle)


KINDS = (
    EncoderLostCounts,
    EncoderSpikes,
    EncoderLate,
    EncoderEccentric,
    MotorEncoderLostCounts,
    MotorEncoderSpikes,
    MotorEncoderLate,
)
