"""The model of a motor, fitted to its duty cycle, current and speed: its current sensor, its amplifier, its winding.

A winding of resistance *R* and torque constant *k* has, at the duty cycle *u* of a supply *V* and the speed *w*, the
current ``(u V - k w) / R``. What a sensor shows of it is fitted as::

    current = offset + upwards max(u, 0) + downwards min(u, 0) + induced w

without the states that do not belong. An even amplifier has the same factor for both signs of the duty cycle. It shows
the scale of the sensor, if the winding is known; the ratio of the last two factors does not depend on that scale, and
shows the torque constant: what a motor induces at a speed it gives of torque for a current.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.robust_fit import robust_fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.drives import Drive

#: A sign of the duty cycle is judged from this many states on, in which it is at least so large (per cent).
_FEWEST, _DRIVEN = 30, 0.5
#: What has a greater standard error, as a share of what is expected, was not shown by the motion.
_CERTAIN = 0.05
#: What the model may leave of the currents, as a share of what the duty cycles drive. It leaves more where these change
#: faster than the states show, as with a noisy encoder in the loop: then a current belongs to another duty cycle.
_LEFT = 0.3
#: Changes from state to state, as a share of those of white noise, that are faster than the states show.
_HASTY = 0.5
#: Noise of a current sensor that is no current, in standard deviations.
_OUTSIDE = 3.0
#: What a current sensor may be off by, in standard deviations of its noise: 2 % of the peak current, of which the noise
#: is 0.5 % by default; and the share of states with a wrong current that are nearly all.
_OFFSET, _NEARLY = 4.0, 0.8
#: States without a current that are a loose contact; the least current that they lack, as a share of that by the whole
#: supply at rest; and the share of the currents that has to flow otherwise, or the sensor is at fault.
_MOMENTS, _HARD, _FLOWS = 3, 0.1, 0.5
#: What makes the error of a coefficient great that has no effect: a share of the squares, and a noise (A).
_SINGULAR, _LEAST_NOISE = 1e-12, 1e-6
_PER_CENT = 100.0
#: What the currents, and the torque constant, of a healthy motor deviate by from those of its drive, as a share:
#: windings have tolerances of 10 %, and 24 % more resistance when they are 60 degrees warmer.
TOLERANCE = 0.3
#: What one direction of a healthy amplifier lacks of the other one, as a share.
UNEVEN = 0.2


class MotorModel(NamedTuple):
    """A motor as its sensors show it, by shares of what its drive says; NaN where the motion does not show it.

    ``upwards`` and ``downwards`` are the currents for positive and negative duty cycles, ``constant`` is the torque
    constant; ``offset`` is in A.
    """

    upwards: float
    downwards: float
    constant: float
    offset: float

    @property
    def gain(self) -> float:
        """The scale of the current sensor: the share of the direction in which the amplifier is the stronger one."""
        known = [share for share in (self.upwards, self.downwards) if not math.isnan(share)]
        return max(known, key=abs, default=math.nan)

    @property
    def uneven(self) -> float:
        """What the weaker direction lacks of the stronger one, negative if it is the positive one; NaN if unknown."""
        if self.gain == 0.0:
            return math.nan
        return (self.upwards - self.downwards) / self.gain


_UNKNOWN = MotorModel(math.nan, math.nan, math.nan, math.nan)


class WrongMotor(NamedTuple):
    """What a motor does not do as its drive says, in words, and the key of its likely causes."""

    text: str
    finding: str


class MotorRun(NamedTuple):
    """What a motor did: its duty cycles (%), currents (A) and rotor speeds (deg/s), and its drive and supply (V)."""

    duties: FloatArray
    currents: FloatArray
    speeds: FloatArray
    drive: Drive
    supply: float

    @property
    def driven(self) -> FloatArray:
        """The currents that the duty cycles drive (A)."""
        volts = self.duties * self.supply / _PER_CENT - np.radians(self.speeds) * self.drive.torque_constant
        driven: FloatArray = volts / self.drive.resistance
        return driven

    @property
    def noise(self) -> float:
        """What the current sensor shows without a current, at most (A)."""
        return _OUTSIDE * (self.drive.current_noise + self.drive.current_step)

    @property
    def is_hasty(self) -> bool:
        """Whether the duty cycle changes faster than the states show, so that a current belongs to another one."""
        if len(self.duties) < _FEWEST:
            return False
        return float(np.std(np.diff(self.duties))) > _HASTY * math.sqrt(2.0) * float(np.std(self.duties))

    def where(self, states: NDArray[np.bool_]) -> MotorRun:
        """Return some of the states."""
        return self._replace(duties=self.duties[states], currents=self.currents[states], speeds=self.speeds[states])


def wrong_motor(run: MotorRun) -> WrongMotor | None:
    """Return what is wrong with a motor by its states, see ``motor_model``; None if nothing is, or they do not show it.

    They show what the model says in both directions, currents by duty cycles and these by currents. Noise, as of the
    speeds of a motor whose current hardly changes, makes one of them say too much and the other one too little.
    """
    if _size(run.currents) <= run.noise:
        lacks = _size(run.driven) > _OUTSIDE * run.noise
        return WrongMotor("it has no current", "current sensor") if lacks else None
    return interruption(run) or _misfit(run)


def interruption(run: MotorRun) -> WrongMotor | None:
    """Return that a motor has no current for moments although its duty cycle drives one; None if it has, or never has.

    Without these moments it is as its drive says.
    """
    off = _without_current(run)
    rest = run.where(~off)
    if off.sum() < _MOMENTS or _size(run.currents) <= run.noise or not _flows(rest) or _misfit(rest) is not None:
        return None
    text = f"it has no current in {off.sum()} of {len(off)} states, and a duty cycle for one"
    return WrongMotor(text, "loose contact")


def _misfit(run: MotorRun) -> WrongMotor | None:
    """Return what is wrong with the model of a motor, or with its levels where no model can be fitted."""
    return None if run.is_hasty else _wrong_model(run) or _wrong_level(run) or _wrong_speed(run)


def _wrong_model(run: MotorRun) -> WrongMotor | None:
    """Return what is wrong with a motor by its model, if both directions of the fit say it."""
    found = motor_model(run)
    even = 1.0 if math.isnan(found.uneven) else np.where(run.duties > 0.0, found.upwards, found.downwards) / found.gain
    gain, constant = _backwards(run._replace(duties=even * run.duties))
    if not abs(found.gain - gain) <= TOLERANCE:
        return None
    if min(abs(found.gain - 1.0), abs(gain - 1.0)) > TOLERANCE:
        return WrongMotor(f"its current is {found.gain:.0%} of what its duty cycle drives", "current sensor")
    if abs(found.uneven) > UNEVEN:
        way = "positive" if found.uneven < 0.0 else "negative"
        return WrongMotor(f"a {way} duty cycle drives {abs(found.uneven):.0%} less current", "uneven amplifier")
    apart = min(abs(found.constant - 1.0), abs(constant - 1.0))
    if apart > TOLERANCE and abs(found.constant - constant) <= TOLERANCE:
        return WrongMotor(f"its torque constant is {found.constant:.0%} of that in robot.toml", "weak magnets")
    return None


def _wrong_level(run: MotorRun) -> WrongMotor | None:
    """Return that the current is another one than the duty cycle drives, nearly always while that has one sign.

    That shows where the current hardly changes, so that no model can be fitted: a joint at rest has the same torque
    whatever its motor needs for it.
    """
    offset = _OFFSET * run.drive.current_noise
    for way in (1.0, -1.0):
        there = run.where(way * run.driven > offset)
        if len(there.duties) < _FEWEST:
            continue
        wrong = np.abs(there.currents - there.driven) > TOLERANCE * np.abs(there.driven) + offset
        if wrong.mean() >= _NEARLY:
            shown, wanted = float(np.median(there.currents)), float(np.median(there.driven))
            text = f"its current is {shown:.2g} A where its duty cycle drives {wanted:.2g} A"
            return WrongMotor(text, "current sensor")
    return None


def _wrong_speed(run: MotorRun) -> WrongMotor | None:
    """Return that a motor is slower for its duty cycle than its drive says, where its current hardly changes.

    Then duty cycles show what a speed needs. Noise of the speeds would make that less.
    """
    values, errors, noise = _duties_by_currents(run)
    needed = math.radians(1.0) * run.drive.torque_constant * _PER_CENT / run.supply  # per cent, for a deg/s
    share = float(values[1]) / needed
    if errors[1] > _CERTAIN * needed or noise > _LEFT * float(np.std(run.duties)) or share < 1.0 + TOLERANCE:
        return None
    return WrongMotor(f"it needs {share:.0%} of the duty cycle that its drive needs for a speed", "weak amplifier")


def _without_current(run: MotorRun) -> NDArray[np.bool_]:
    """Return in which states a motor has no current although its duty cycle drives one.

    One or two states are none: a duty cycle that is shown a state before its current looks like that where it changes.
    Nor are those beside a change of its sign, of which there are many where a controller drives to and fro.
    """
    driven, least = run.driven, max(_OUTSIDE * run.noise, _HARD * run.supply / run.drive.resistance)
    off = (np.abs(run.currents) <= run.noise) & (np.abs(driven) > least)
    found: NDArray[np.bool_] = off & (_lasting(driven > 0.0) | _lasting(driven < 0.0))
    return found


def _flows(run: MotorRun) -> bool:
    """Return whether a motor has a current that its duty cycle drives."""
    there = run.where(np.abs(run.driven) > run.noise)
    return len(there.duties) > 0 and float(np.median(there.currents / there.driven)) > _FLOWS


def _lasting(states: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which states something holds that holds in the states before and after, too."""
    around = np.pad(states, 1, mode="edge")
    found: NDArray[np.bool_] = around[:-2] & states & around[2:]
    return found


def _backwards(run: MotorRun) -> tuple[float, float]:
    """Return the scale of the currents and the torque constant by duty cycles that are explained by currents."""
    (by_current, by_speed, _), *_ = _duties_by_currents(run)
    volts = run.supply / _PER_CENT
    gain = run.drive.resistance / (volts * by_current) if by_current else math.inf
    return float(gain), float(volts * by_speed / (math.radians(1.0) * run.drive.torque_constant))


def _duties_by_currents(run: MotorRun) -> tuple[FloatArray, FloatArray, float]:
    """Return the fit of duty cycles by currents, speeds and a constant, see ``_fit``."""
    return _fit(np.column_stack([run.currents, run.speeds, np.ones(len(run.duties))]), run.duties)


def _size(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def motor_model(run: MotorRun) -> MotorModel:
    """Return the model of a motor from its states, by the resistance and the torque constant that its drive says."""
    duties, currents, speeds, drive, supply = run
    ways = [duties >= _DRIVEN, duties <= -_DRIVEN]
    driven = [way.sum() >= _FEWEST for way in ways]
    if not any(driven):
        return _UNKNOWN
    of_duty = [np.maximum(duties, 0.0), np.minimum(duties, 0.0)] if all(driven) else [duties]
    columns = np.column_stack([*of_duty, speeds, np.ones(len(duties))])
    values, errors, noise = _fit(columns, currents)
    ampere = supply / (_PER_CENT * drive.resistance)  # a per cent of duty cycle, at rest
    if noise > max(_LEFT * ampere * float(np.std(duties)), drive.current_noise + drive.current_step):
        return _UNKNOWN
    induced = math.radians(1.0) * drive.torque_constant / drive.resistance  # A less, a deg/s
    known = errors / np.array([ampere] * len(of_duty) + [induced, 1.0]) <= _CERTAIN
    shares = [float(value / ampere) if sure else math.nan for value, sure in zip(values, known[:-2], strict=False)]
    upwards, downwards = shares if all(driven) else [shares[0] if way else math.nan for way in driven]
    # With one sign only, the current without a duty cycle would be extrapolated.
    found = MotorModel(upwards, downwards, math.nan, float(values[-1]) if all(driven) else math.nan)
    constant = -float(values[-2]) / induced / found.gain if known[-2] and found.gain else math.nan
    return found._replace(constant=constant)


def _fit(columns: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the coefficients without the states that do not belong, their standard errors, and the noise."""
    sizes = np.maximum(np.abs(columns).max(axis=0), 1e-9)
    scaled = columns / sizes
    found, noise, inside = robust_fit(scaled, values)
    squares = scaled[inside].T @ scaled[inside] + _SINGULAR * len(values) * np.eye(len(found))
    errors: FloatArray = max(noise, _LEAST_NOISE) * np.sqrt(np.diag(np.linalg.inv(squares)))
    return found / sizes, errors / sizes, noise
