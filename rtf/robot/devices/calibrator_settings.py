"""The configuration of a calibrator, with the parameter names of iCub files.

Each list has a number for each joint; names are case-insensitive. ``*``: optional, with the default in parentheses.

============== ======================== ===============================================================================
``GENERAL``    ``joints``               how many; as many as the board has
               ``skipCalibration`` *    yes: only go to the startup position (no)
               ``clearHwFault…`` *      ``clearHwFaultBeforeCalibration``, yes: leave faults at first (no)
``CALIBRATION`` ``calibrationType``     the procedure of the board
               ``calibration1`` … ``3`` its parameters; ``4`` * and ``5`` * (0)
               ``calibrationZero`` *    the zero in deg (0), and ``calibrationDelta`` *, which is added to it
               ``calibrationTimeout`` * s that a joint may take (20)
               ``startupPosition``      deg, where it goes then; the older name is ``positionZero``
               ``startupVelocity``      deg/s; ``velocityZero``
               ``startupMaxPwm`` *      per cent of duty cycle that the controller may give meanwhile; 0: as ever (0)
               ``startupPosThreshold`` * deg, how near is near enough (2)
               ``startupTimeout`` *     s that it may take (10)
``HOME``       ``positionHome``         deg, and ``velocityHome``, deg/s; ``homeTimeout`` *, s (30)
               ``disableHomeAndPark`` * 1 for joints that are neither homed nor parked
``PARK`` *     ``positionPark``         deg, and ``velocityPark``, deg/s; ``parkTimeout`` *, s (30). As ``HOME``
               ``powerOff`` *           yes: joints that are parked become idle (no)
``CALIB_ORDER`` *                       lists of joints, one list after the other: ``(0 1) (2)``. All at once
============== ======================== ===============================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, Property, Value, as_float, to_string
from rtf.robot.errors import ConfigurationError
from rtf.robot.interfaces import CalibrationParameters
from rtf.robot.parameters import count, flag, group_of

if TYPE_CHECKING:
    from typing import Self

    from rtf.robot.interfaces import FloatArray

_MAX_JOINTS = 1000
_CALIBRATION_TIMEOUT, _STARTUP_TIMEOUT, _REST_TIMEOUT = 20.0, 10.0, 30.0  # s
_THRESHOLD = 2.0  # deg


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """The target positions of joints (deg), their speeds (deg/s), and timeouts (s); one number for each joint."""

    positions: FloatArray
    speeds: FloatArray
    timeouts: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class CalibratorSettings:
    """The settings. ``order`` has the groups of joints to calibrate, ``rested`` those that are homed and parked."""

    joints: int
    order: tuple[tuple[int, ...], ...]
    rested: tuple[int, ...]
    parameters: tuple[CalibrationParameters, ...]
    calibration_timeouts: FloatArray
    duty_limits: FloatArray
    thresholds: FloatArray
    startup: Pose
    home: Pose
    park: Pose
    skip_calibration: bool
    clear_faults: bool
    power_off: bool

    @classmethod
    def read(cls, configuration: Property) -> Self:
        """Read a configuration. Raises ConfigurationError, with the location."""
        general = group_of(configuration, "GENERAL")
        joints = count(general, "Joints" if general.check("Joints") else "joints", 0, _MAX_JOINTS)
        calibration = _Rows(configuration, "CALIBRATION", joints)
        rest = _Rows(configuration, "HOME", joints)
        home = rest.pose("Home", _REST_TIMEOUT)
        has_park = configuration.check("PARK")
        return cls(
            joints=joints,
            order=_order(configuration, joints),
            rested=tuple(np.flatnonzero(rest.row("disableHomeAndPark", default=0.0) == 0).tolist()),
            parameters=_parameters(calibration),
            calibration_timeouts=calibration.positive("calibrationTimeout", default=_CALIBRATION_TIMEOUT),
            duty_limits=calibration.positive("startupMaxPwm", default=0.0),
            thresholds=calibration.positive("startupPosThreshold", "posZeroThreshold", default=_THRESHOLD),
            startup=Pose(
                calibration.row("startupPosition", "positionZero"),
                calibration.positive("startupVelocity", "velocityZero"),
                calibration.positive("startupTimeout", default=_STARTUP_TIMEOUT),
            ),
            home=home,
            park=_Rows(configuration, "PARK", joints).pose("Park", _REST_TIMEOUT) if has_park else home,
            skip_calibration=flag(general, "skipCalibration"),
            clear_faults=flag(general, "clearHwFaultBeforeCalibration"),
            power_off=flag(group_of(configuration, "PARK"), "powerOff"),
        )


class _Rows:
    """The lists of a configuration group."""

    def __init__(self, configuration: Property, name: str, joints: int) -> None:
        self._configuration = configuration
        self._name = name
        self._joints = joints
        self._lists: dict[str, tuple[str, list[Value]]] = {}
        for key, group in group_of(configuration, name).items():
            inner = group.get(1)
            self._lists[key.lower()] = key, list(inner if isinstance(inner, Bottle) else group[1:])

    def row(self, *names: str, default: float | None = None) -> FloatArray:
        """Return the list with one of these names; without one the default for each joint."""
        found = next((self._lists[name.lower()] for name in names if name.lower() in self._lists), None)
        if found is None:
            if default is None:
                raise self._wrong(names[0], f"it is missing; it has {self._joints} numbers, one for each joint")
            return np.full(self._joints, default)
        key, values = found
        if len(values) != self._joints or not all(isinstance(value, int | float) for value in values):
            said = to_string(Bottle(values))[:60]
            raise self._wrong(key, f"{said} is not a list of {self._joints} numbers, one for each joint")
        numbers = np.array([as_float(value) for value in values])
        if not np.isfinite(numbers).all():
            raise self._wrong(key, "a number is infinite or NaN")
        return numbers

    def positive(self, *names: str, default: float | None = None) -> FloatArray:
        """Return the list with one of these names, whose numbers must not be negative."""
        numbers = self.row(*names, default=default)
        if (numbers < 0).any():
            raise self._wrong(names[0], f"joint {int((numbers < 0).argmax())} has a negative number")
        return numbers

    def pose(self, what: str, timeout: float) -> Pose:
        """Return the pose of a group, such as ``Home``."""
        return Pose(
            self.row(f"position{what}"),
            self.positive(f"velocity{what}"),
            self.positive(f"{what.lower()}Timeout", default=timeout),
        )

    def _wrong(self, key: str, sentence: str) -> ConfigurationError:
        return _wrong(self._configuration, self._name, key, sentence)


def _parameters(rows: _Rows) -> tuple[CalibrationParameters, ...]:
    kinds = rows.positive("calibrationType")
    zeros = rows.row("calibrationZero", default=0.0) + rows.row("calibrationDelta", default=0.0)
    given = [rows.row(f"calibration{number}", default=None if number <= _NEEDED else 0.0) for number in range(1, 6)]
    columns = zip(kinds.tolist(), *(row.tolist() for row in given), zeros.tolist(), strict=True)
    return tuple(CalibrationParameters(int(kind), *numbers) for kind, *numbers in columns)


_NEEDED = 3


def _order(configuration: Property, joints: int) -> tuple[tuple[int, ...], ...]:
    """Read the order of calibration: lists of joints, possibly inside a list."""
    group = configuration.find_group("CALIB_ORDER")
    if group is None:
        return (tuple(range(joints)),)
    lists = list(group[1:])
    if len(lists) == 1 and isinstance(lists[0], Bottle) and any(isinstance(one, Bottle) for one in lists[0]):
        lists = list(lists[0])
    order: list[tuple[int, ...]] = []
    for one in lists:
        numbers = list(one) if isinstance(one, Bottle) else [one]
        if not all(isinstance(joint, int) and 0 <= joint < joints for joint in numbers):
            raise _wrong(
                configuration, "CALIB_ORDER", "", f"{to_string(one)[:60]} are not joints from 0 to {joints - 1}"
            )
        order.append(tuple(joint for joint in numbers if isinstance(joint, int)))
    everyone = [joint for one in order for joint in one]
    if len({*everyone}) != len(everyone):
        raise _wrong(configuration, "CALIB_ORDER", "", "a joint is there twice")
    return tuple(order)


def _wrong(configuration: Property, group: str, key: str, sentence: str) -> ConfigurationError:
    """Return the error, with the location of the list, or of its group."""
    location = (configuration.location(group, key) if key else None) or configuration.location(group)
    what = f"{group} {key}".rstrip()
    return ConfigurationError(f"{what}: {sentence}" if location is None else f"{location}: {what}: {sentence}")
