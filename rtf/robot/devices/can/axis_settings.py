"""The configuration of boards on a bus: groups of a robot's XML file, with one value for each axis.

============== =================================================================================================
``GENERAL``    ``Joints``, ``AxisName``, ``AxisType``, ``Encoder`` (ticks/deg), ``Zeros`` (deg), ``Period`` (ms),
               ``fullscalePWM`` (counts), ``ampsToSensor`` (counts/A), ``newtonsToSensor`` (counts/Nm),
               ``Gearbox_M2J``, ``supplyVoltage`` (V, of the motors)
``CAN``        the bus, ``CanAddresses``, ``CanTimeout`` (ms), ``CanRetries``
``LIMITS``     ``jntPosMin`` and ``jntPosMax``, or ``Min`` and ``Max`` (deg), ``jntVelMax`` (deg/s), ``jntTrqMax``
               (Nm), ``motorNominalCurrents``, ``motorPeakCurrents``, ``motorOverloadCurrents`` (A),
               ``motorPwmLimit`` (counts), ``motorTemperatures`` (deg C)
``VELOCITY``   ``Shifts``, ``JntVelShift``, ``JntAccShift``, ``Timeout`` (ms)
``PIDS``       ``Pid0`` …: kp, kd, ki, integral limit, output limit, shift, offset, as boards have them;
               ``TORQUE_PIDS`` with ``TPid0`` … likewise
``STICTION``   ``Up``, ``Down`` (counts)
``IMPEDANCE``  ``stiffnessToSensor``, ``dampingToSensor``: counts for 1 Nm/deg and 1 Nm s/deg; ``stiffness``
               (Nm/deg) and ``damping`` (Nm s/deg) at the start
``FOC``        ``MotorPoles``, ``HasHallSensor``, ``HasQuadratureEncoder``, ``HasTempSensor``, ``HasIndex``,
               ``RotorEncoderResolution``, ``PositionGain`` (1/s), ``CurrentPid0`` … and ``VelocityPid0`` …
``COUPLINGS``  ``matrixJ2M``
============== =================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, to_string
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.board_configuration import configured_axes
from rtf.robot.devices.can.axis_scale import SHORT, AxisScale, RawPid
from rtf.robot.devices.can.codes import MotorFlag
from rtf.robot.devices.can.exchange import RETRIES, TIMEOUT
from rtf.robot.devices.can.messages import ADDRESSES
from rtf.robot.devices.rows import Rows, wrong_in
from rtf.robot.parameters import count, group_of, positive

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

#: Milliseconds after which a board ends a velocity that is not renewed, unless a configuration says otherwise.
_VELOCITY_TIMEOUT = 1000.0
#: Counts of 100 per cent of duty cycle, of boards of joints.
_FULL_DUTY = 1333.0
#: Ticks a degree, of boards that give 65536 a turn.
_TICKS = 65536 / 360
_MOST_RETRIES = 100
_PID, _MOST_SHIFT = 7, 15
_FLAGS = {
    "HasQuadratureEncoder": MotorFlag.QUADRATURE_ENCODER,
    "HasHallSensor": MotorFlag.HALL,
    "HasTempSensor": MotorFlag.TEMPERATURE_SENSOR,
    "HasIndex": MotorFlag.INDEX,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The settings of a board that drives a motor."""

    flags: MotorFlag
    resolution: int
    poles: int
    position_gain: float  # deg/s for a degree of error
    current_pid: RawPid | None
    velocity_pid: RawPid | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CanAxis:
    """An axis: its board, its place there, and what is sent to the board at the start."""

    board: int
    index: int
    scale: AxisScale
    axis: BoardAxis
    torque_pid: RawPid | None
    velocity_timeout: int  # ms
    stiffness: float  # counts for 1 Nm/deg; 0: the board has no impedance control
    damping: float
    drive: Drive


@dataclass(frozen=True, slots=True, kw_only=True)
class CanSettings:
    """The configuration of a device: its axes, and how it talks to their boards. Times are in seconds."""

    axes: tuple[CanAxis, ...]
    period: float
    timeout: float
    retries: int
    couplings: FloatArray | None

    @property
    def boards(self) -> list[int]:
        """The addresses of the boards, each once."""
        return list(dict.fromkeys(one.board for one in self.axes))


def can_settings(configuration: Property) -> CanSettings:
    """Return the settings of a configuration. Raises ConfigurationError, with the location, for an invalid one."""
    given = configured_axes(configuration, BoardAxis(name="joint", max_velocity=100.0))
    joints = len(given)
    can, general = group_of(configuration, "CAN"), group_of(configuration, "GENERAL")
    places = _places(configuration, joints)
    scales, drives = _scales(configuration, joints), _drives(configuration, joints)
    axes = _axes(configuration, given, scales)
    torque = [_pid(configuration, "TORQUE_PIDS", f"TPid{joint}") for joint in range(joints)]
    timeouts = Rows(configuration, "VELOCITY", joints).row("Timeout", default=_VELOCITY_TIMEOUT, single=True)
    impedance = Rows(configuration, "IMPEDANCE", joints)
    stiffness, damping = (impedance.row(f"{what}ToSensor", default=0.0) for what in ("stiffness", "damping"))
    return CanSettings(
        axes=tuple(
            CanAxis(
                board=places[joint][0],
                index=places[joint][1],
                scale=scales[joint],
                axis=axes[joint],
                torque_pid=torque[joint],
                velocity_timeout=round(float(timeouts[joint])),
                stiffness=float(stiffness[joint]),
                damping=float(damping[joint]),
                drive=drives[joint],
            )
            for joint in range(joints)
        ),
        period=positive(general, "Period", 10.0) * 1e-3,
        timeout=positive(can, "CanTimeout", TIMEOUT * 1e3) * 1e-3,
        retries=count(can, "CanRetries", RETRIES, _MOST_RETRIES),
        couplings=_couplings(configuration, joints),
    )


def _places(configuration: Property, joints: int) -> list[tuple[int, int]]:
    """Return the board of each joint and its axis there: two a board, or one if there are as many boards."""
    given = Rows(configuration, "CAN", joints).values("CanAddresses") or []
    addresses = [one for one in given if isinstance(one, int) and one in ADDRESSES]
    if len(set(addresses)) != len(given) or len(given) not in (joints, (joints + 1) // 2):
        raise wrong_in(
            configuration,
            "CAN",
            "CanAddresses",
            f"{to_string(Bottle(given))[:60]} are not the addresses (1 to 14, each once) of {joints} boards with "
            f"one axis, or of {(joints + 1) // 2} with two",
        )
    return [*product(addresses, range(1 if len(addresses) == joints else 2))][:joints]


def _scales(configuration: Property, joints: int) -> list[AxisScale]:
    """Return the scales of the axes."""
    general, velocity = (Rows(configuration, name, joints) for name in ("GENERAL", "VELOCITY"))
    ticks, zeros = general.scale("Encoder", default=_TICKS), general.row("Zeros", default=0.0)
    duties = general.scale("fullscalePWM", default=_FULL_DUTY)
    amperes = general.scale("ampsToSensor", default=1000.0)
    newtons = general.row("newtonsToSensor", default=0.0, single=True)
    shifts = [
        _shift(velocity, key, default) for key, default in (("Shifts", 4), ("JntVelShift", 5), ("JntAccShift", 5))
    ]
    return [
        AxisScale(
            ticks=float(ticks[joint]),
            zero=float(zeros[joint]),
            move_shift=shifts[0][joint],
            speed_shift=shifts[1][joint],
            acceleration_shift=shifts[2][joint],
            full_duty=float(duties[joint]),
            amperes=float(amperes[joint]),
            newtons=float(newtons[joint]),
        )
        for joint in range(joints)
    ]


def _shift(rows: Rows, key: str, default: int) -> list[int]:
    """Return the shifts of the axes."""
    found = rows.row(key, default=default, single=True)
    if ((found < 0) | (found > _MOST_SHIFT)).any():
        raise rows.wrong(key, f"{found.tolist()} are not shifts from 0 to {_MOST_SHIFT}")
    return [round(one) for one in found.tolist()]


def _axes(configuration: Property, given: list[BoardAxis], scales: list[AxisScale]) -> list[BoardAxis]:
    """Return the axes with their limits, gearboxes and controllers."""
    joints, usual = len(given), given[0]
    limits, general, stiction = (Rows(configuration, name, joints) for name in ("LIMITS", "GENERAL", "STICTION"))
    impedance = Rows(configuration, "IMPEDANCE", joints)
    able = impedance.row("stiffnessToSensor", default=0.0)
    stiffness, damping = (impedance.positive(what, default=0.0) for what in ("stiffness", "damping"))
    gearboxes = general.scale("Gearbox_M2J", default=1.0)
    supplies = general.positive("supplyVoltage", default=usual.supply_voltage)
    up, down = stiction.row("Up", default=0.0), stiction.row("Down", default=0.0)
    least, most = (
        limits.row("jntPosMin", "Min", default=usual.minimum),
        limits.row("jntPosMax", "Max", default=usual.maximum),
    )
    if (least >= most).any():
        raise limits.wrong(
            "jntPosMin", f"the minimum of joint {int((least >= most).argmax())} is not below its maximum"
        )
    velocities = limits.positive("jntVelMax", default=usual.max_velocity)
    torques = limits.positive("jntTrqMax", default=usual.max_torque)
    nominal = limits.positive("motorNominalCurrents", default=usual.nominal_current)
    peak = limits.positive("motorPeakCurrents", default=usual.peak_current)
    overload = limits.positive("motorOverloadCurrents", default=usual.max_current)
    heat = limits.row("motorTemperatures", default=usual.temperature_limit, single=True)
    duties = limits.row("motorPwmLimit", default=max(abs(scale.full_duty) for scale in scales), single=True)
    made = []
    for joint, (axis, scale) in enumerate(zip(given, scales, strict=True)):
        raw = _pid(configuration, "PIDS", f"Pid{joint}") or RawPid(0, 0, 0, 0, 0, 0, 0)
        raw = raw._replace(stiction_up=round(float(up[joint])), stiction_down=round(float(down[joint])))
        made.append(
            replace(
                axis,
                minimum=float(least[joint]),
                maximum=float(most[joint]),
                max_velocity=float(velocities[joint]),
                max_torque=float(torques[joint]),
                gearbox=float(gearboxes[joint]),
                supply_voltage=float(supplies[joint]),
                nominal_current=float(nominal[joint]),
                peak_current=float(peak[joint]),
                max_current=float(overload[joint]),
                temperature_limit=float(heat[joint]),
                duty_limit=min(abs(scale.per_cent(float(duties[joint]))), 100.0),
                torque_controlled=bool(able[joint]),
                stiffness=float(stiffness[joint]),
                damping=float(damping[joint]),
                pid=scale.pid(raw),
            )
        )
    return made


def _drives(configuration: Property, joints: int) -> list[Drive]:
    """Return the settings of drives of motors."""
    rows = Rows(configuration, "FOC", joints)
    given = {flag: rows.row(key, default=0.0) for key, flag in _FLAGS.items()}
    poles, gains = rows.row("MotorPoles", default=0.0), rows.row("PositionGain", default=10.0, single=True)
    resolutions = rows.row("RotorEncoderResolution", default=0.0)
    found = []
    for joint in range(joints):
        flags = MotorFlag(0)
        for flag, row in given.items():
            flags |= flag if row[joint] else MotorFlag(0)
        found.append(
            Drive(
                flags=flags,
                resolution=round(float(resolutions[joint])),
                poles=round(float(poles[joint])),
                position_gain=float(gains[joint]),
                current_pid=_pid(configuration, "FOC", f"CurrentPid{joint}"),
                velocity_pid=_pid(configuration, "FOC", f"VelocityPid{joint}"),
            )
        )
    return found


def _pid(configuration: Property, group: str, key: str) -> RawPid | None:
    """Return a controller as kp, kd, ki, integral limit, output limit, shift, offset; None if it is missing."""
    given = Rows(configuration, group, _PID).values(key)
    if given is None:
        return None
    raw = [round(one) for one in given if isinstance(one, int | float) and SHORT[0] <= one <= SHORT[1]]
    if len(raw) != _PID or len(given) != _PID or not 0 <= raw[5] <= _MOST_SHIFT:
        raise wrong_in(
            configuration,
            group,
            key,
            f"{to_string(Bottle(given))[:60]} are not kp, kd, ki, limits of integral and output, shift, offset",
        )
    kp, kd, ki, integral, output, shift, offset = raw
    return RawPid(kp, ki, kd, shift, offset, output, integral)


def _couplings(configuration: Property, joints: int) -> FloatArray | None:
    """Return the matrix from joints to motors, row by row in a configuration; None without one."""
    if configuration.find_group("COUPLINGS") is None:
        return None
    return Rows(configuration, "COUPLINGS", joints**2).row("matrixJ2M").reshape(joints, joints)
