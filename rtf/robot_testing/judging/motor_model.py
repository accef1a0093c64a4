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
#: The finding on a motor that has no current for moments.
LOOSE_CONTACT = "loose contact"
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


def wrong_motor(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> WrongMotor | None:
    """Return what is wrong with a motor by its states, see ``motor_model``; None if nothing is, or they do not show it.

    They show what the model says in both directions, currents by duty cycles and these by currents. Noise, as of the
    speeds of a motor whose current hardly changes, makes one of them say too much and the other one too little.
    """
    noise = _OUTSIDE * (drive.current_noise + drive.current_step)
    if _size(currents) <= noise:
        expected = _driven(duties, speeds, drive, supply)
        return WrongMotor("it has no current", "current sensor") if _size(expected) > _OUTSIDE * noise else None
    off = _without_current(duties, currents, speeds, drive, supply)
    rest = duties[~off], currents[~off], speeds[~off]
    if off.sum() >= _MOMENTS and _flows(*rest, drive, supply) and _misfit(*rest, drive, supply) is None:
        text = f"it has no current in {off.sum()} of {len(off)} states, and a duty cycle for one"
        return WrongMotor(text, LOOSE_CONTACT)
    return _misfit(duties, currents, speeds, drive, supply)


def _misfit(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> WrongMotor | None:
    """Return what is wrong with the model of a motor, or with its levels where no model can be fitted."""
    if _is_hasty(duties):
        return None
    columns = duties, currents, speeds, drive, supply
    return _wrong_model(*columns) or _wrong_level(*columns) or _wrong_speed(*columns)


def _is_hasty(values: FloatArray) -> bool:
    """Return whether values change faster than the states show, so that currents belong to others."""
    return float(np.std(np.diff(values))) > _HASTY * math.sqrt(2.0) * float(np.std(values))


def _wrong_model(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> WrongMotor | None:
    """Return what is wrong with a motor by its model, if both directions of the fit say it."""
    found = motor_model(duties, currents, speeds, drive, supply)
    even = 1.0 if math.isnan(found.uneven) else np.where(duties > 0.0, found.upwards, found.downwards) / found.gain
    gain, constant = _backwards(even * duties, currents, speeds, drive, supply)
    if not abs(found.gain - gain) <= TOLERANCE:
        return None
    if abs(found.gain - 1.0) > TOLERANCE:
        return WrongMotor(f"its current is {found.gain:.0%} of what its duty cycle drives", "current sensor")
    if abs(found.uneven) > UNEVEN:
        way = "positive" if found.uneven < 0.0 else "negative"
        return WrongMotor(f"a {way} duty cycle drives {abs(found.uneven):.0%} less current", "uneven amplifier")
    if abs(found.constant - 1.0) > TOLERANCE and abs(found.constant - constant) <= TOLERANCE:
        return WrongMotor(f"its torque constant is {found.constant:.0%} of that in robot.toml", "weak magnets")
    return None


def _wrong_level(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> WrongMotor | None:
    """Return that the current is another one than the duty cycle drives, nearly always while that has one sign.

    That shows where the current hardly changes, so that no model can be fitted: a joint at rest has the same torque
    whatever its motor needs for it.
    """
    driven, allowed = _driven(duties, speeds, drive, supply), _OFFSET * drive.current_noise + drive.current_step
    wrong = {}
    for way in (1.0, -1.0):
        there = way * driven > _OFFSET * drive.current_noise
        apart = np.abs(currents[there] - driven[there]) > TOLERANCE * np.abs(driven[there]) + allowed
        wrong[way] = there.sum() >= _FEWEST and float(apart.mean()) >= _NEARLY
    ways = [way for way, is_wrong in wrong.items() if is_wrong]
    if not ways:
        return None
    there = ways[0] * driven > _OFFSET * drive.current_noise
    shown, wanted = float(np.median(currents[there])), float(np.median(driven[there]))
    finding = "uneven amplifier" if len(ways) == 1 and (duties * ways[0] < 0.0).sum() >= _FEWEST else "current sensor"
    return WrongMotor(f"its current is {shown:.2g} A where its duty cycle drives {wanted:.2g} A", finding)


def _wrong_speed(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> WrongMotor | None:
    """Return that a motor is slower for its duty cycle than its drive says, where its current hardly changes.

    Then duty cycles show what a speed needs. Noise of the speeds would make that less.
    """
    columns = np.column_stack([currents, speeds, np.ones(len(duties))])
    values, errors, noise = _fit(columns, duties)
    needed = math.radians(1.0) * drive.torque_constant * _PER_CENT / supply  # per cent, for a deg/s
    share = float(values[1]) / needed
    if errors[1] > _CERTAIN * needed or noise > _LEFT * float(np.std(duties)) or share < 1.0 + TOLERANCE:
        return None
    return WrongMotor(f"it needs {share:.0%} of the duty cycle that its drive needs for a speed", "weak amplifier")


def _without_current(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> NDArray[np.bool_]:
    """Return in which states a motor has no current although its duty cycle drives one.

    One or two states are none: a duty cycle that is shown a state before its current looks like that where it changes.
    Nor are those beside a change of its sign, of which there are many where a controller drives to and fro.
    """
    noise = _OUTSIDE * (drive.current_noise + drive.current_step)
    driven = _driven(duties, speeds, drive, supply)
    off = (np.abs(currents) <= noise) & (np.abs(driven) > max(_OUTSIDE * noise, _HARD * supply / drive.resistance))
    found: NDArray[np.bool_] = off & (_lasting(driven > 0.0) | _lasting(driven < 0.0))
    return found


def _flows(duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float) -> bool:
    """Return whether a motor has a current that its duty cycle drives."""
    driven = _driven(duties, speeds, drive, supply)
    there = np.abs(driven) > _OUTSIDE * (drive.current_noise + drive.current_step)
    return bool(there.any()) and float(np.median(currents[there] / driven[there])) > _FLOWS


def _lasting(states: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which states something holds that holds in the states before and after, too."""
    around = np.pad(states, 1, mode="edge")
    found: NDArray[np.bool_] = around[:-2] & states & around[2:]
    return found


def _driven(duties: FloatArray, speeds: FloatArray, drive: Drive, supply: float) -> FloatArray:
    """Return the currents that duty cycles drive (A)."""
    volts = duties * supply / _PER_CENT - np.radians(speeds) * drive.torque_constant
    driven: FloatArray = volts / drive.resistance
    return driven


def _backwards(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> tuple[float, float]:
    """Return the scale of the currents and the torque constant by duty cycles that are explained by currents."""
    (by_current, by_speed, _), *_ = _fit(np.column_stack([currents, speeds, np.ones(len(duties))]), duties)
    volts = supply / _PER_CENT
    gain = drive.resistance / (volts * by_current) if by_current else math.inf
    return float(gain), float(volts * by_speed / (math.radians(1.0) * drive.torque_constant))


def _size(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def motor_model(
    duties: FloatArray, currents: FloatArray, speeds: FloatArray, drive: Drive, supply: float
) -> MotorModel:
    """Return the model of a motor from its states: duty cycles (per cent), currents (A) and rotor speeds (deg/s).

    ``supply`` is the voltage now (V); resistance and torque constant are those that its ``drive`` says.
    """
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
