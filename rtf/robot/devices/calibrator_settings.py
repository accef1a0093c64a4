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

from rtf.bottle import Bottle, Property, to_string
from rtf.robot.devices.rows import Rows, wrong_in
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
        calibration = Rows(configuration, "CALIBRATION", joints)
        rest = Rows(configuration, "HOME", joints)
        home = _pose(rest, "Home", _REST_TIMEOUT)
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
            park=_pose(Rows(configuration, "PARK", joints), "Park", _REST_TIMEOUT) if has_park else home,
            skip_calibration=flag(general, "skipCalibration"),
            clear_faults=flag(general, "clearHwFaultBeforeCalibration"),
            power_off=flag(group_of(configuration, "PARK"), "powerOff"),
        )


def _pose(rows: Rows, what: str, timeout: float) -> Pose:
    """Return the pose of a group, such as ``Home``."""
    return Pose(
        rows.row(f"position{what}"),
        rows.positive(f"velocity{what}"),
        rows.positive(f"{what.lower()}Timeout", default=timeout),
    )


def _parameters(rows: Rows) -> tuple[CalibrationParameters, ...]:
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
            raise wrong_in(
                configuration, "CALIB_ORDER", "", f"{to_string(one)[:60]} are not joints from 0 to {joints - 1}"
            )
        order.append(tuple(joint for joint in numbers if isinstance(joint, int)))
    everyone = [joint for one in order for joint in one]
    if len({*everyone}) != len(everyone):
        raise wrong_in(configuration, "CALIB_ORDER", "", "a joint is there twice")
    return tuple(order)
