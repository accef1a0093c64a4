"""The configuration of the driver of emulated boards, as a robot's XML file would have it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Property
from rtf.robot.devices.can.axis_scale import AxisScale
from rtf.robot.devices.can.bus_settings import SIMULATED, BusSettings
from rtf.robot.interfaces import JointType
from rtf.simulator.angle_sensors import SimulatedAngles
from rtf.simulator.firmware.foc_board import FocBoard
from rtf.simulator.firmware.parameters import FULL_OUTPUT, IMPEDANCE_COUNTS, TORQUE_COUNTS, shift_of
from rtf.simulator.firmware.rotors import PART
from rtf.simulator.firmware.sensors_on_buses import INERTIAL, inertial_scales
from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.simulator.boards import Boards
    from rtf.simulator.firmware.boards_on_buses import Firmware
    from rtf.simulator.firmware.sensors_on_buses import SensorOnBus

#: Milliseconds in which an answer is missed. A simulation may be slow by the machine's clock.
_TIMEOUT = 2000
#: Milliseconds between two setpoints of drives, and the gain of the positions behind them, 1/s.
_DRIVE_PERIOD, _POSITION_GAIN = 4, 10
#: Ticks of a velocity in a message at its greatest, as multiples of those of the greatest velocity of the joint.
_REACH = 2.0
_MS = 1e3


def can_configuration(firmware: Firmware, wire: str, bus: BusSettings | None = None) -> Property:
    """Return the configuration of ``canMotionControl`` for the boards on a wire, with the gains that they have now.

    ``bus`` is the bus of python-can that the wire is bridged to, if the driver is to use that.
    """
    bus = bus or BusSettings(SIMULATED, wire)
    options = f" (OPTIONS {' '.join(f'({name} {value})' for name, value in bus.options)})" if bus.options else ""
    own = [board for board in firmware.motor_boards if board.wire.name == wire]
    axes = [axis for board in own for axis in board.axes]
    boards, row = firmware.simulation.boards, partial(_row, axes)
    kinds = ["prismatic" if kind is JointType.PRISMATIC else "revolute" for kind in boards.kinds]
    drives = isinstance(own[0], FocBoard)
    period = f"(Period {_DRIVE_PERIOD})" if drives else ""
    return Property.parse(
        f"(GENERAL (Joints {len(axes)}) (AxisName ({row(boards.names)})) (AxisType ({row(kinds)})) {period}"
        f" (Encoder {row(boards.resolution)}) (fullscalePWM {' '.join([str(FULL_OUTPUT)] * len(axes))})"
        f" (newtonsToSensor {TORQUE_COUNTS:g}) (Gearbox_M2J {row(boards.configured_gearbox)})"
        f" (supplyVoltage {row(boards.supply_voltage)}))"
        f" (CAN (interface {bus.interface}) (channel {bus.channel}){options} (CanTimeout {_TIMEOUT})"
        f" (CanAddresses {' '.join(str(board.address) for board in own)}))"
        f" (LIMITS (jntPosMin {row(boards.minimum)}) (jntPosMax {row(boards.maximum)})"
        f" (jntVelMax {row(boards.max_velocity)}) (jntTrqMax {row(boards.max_torque)})"
        f" (motorNominalCurrents {row(boards.nominal_current)}) (motorPeakCurrents {row(boards.peak_current)})"
        f" (motorOverloadCurrents {row(boards.max_current)}) (motorPwmLimit {FULL_OUTPUT})"
        f" (motorTemperatures {row(boards.temperature_limit)}))"
        f" {_of_drives(boards, axes) if drives else _of_joints(boards, axes)}"
    )


def _of_joints(boards: Boards, axes: list[int]) -> str:
    """Return the groups of boards that control joints. Their velocities have as many bits as the messages hold."""
    row = partial(_row, axes)
    controllers = [_pid(boards.pids[axis], boards.resolution[axis]) for axis in axes]
    pids = " ".join(f"(Pid{place} {numbers})" for place, numbers in enumerate(controllers))
    able = boards.torque_controlled
    counts = [IMPEDANCE_COUNTS if one else 0.0 for one in able]
    couplings = boards.configured_couplings[axes][:, axes]
    shifts = [shift_of(_REACH * speed) for speed in (boards.max_velocity * boards.resolution / _MS).tolist()]
    return (
        f"(VELOCITY (Shifts {row(shifts)}) (JntVelShift {row(shifts)}))"
        f" (PIDS {pids})"
        f" (IMPEDANCE (stiffnessToSensor {row(counts)}) (dampingToSensor {row(counts)})"
        f" (stiffness {row(boards.stiffness * able)}) (damping {row(boards.damping * able)}))"
        f" (COUPLINGS (matrixJ2M {' '.join(map(_text, couplings.ravel().tolist()))}))"
    )


def _of_drives(boards: Boards, axes: list[int]) -> str:
    """Return the group of boards that drive motors.

    The controller of the velocity is that of the position: with the gain of its speed, and that of its position for
    the sum of the errors.
    """
    made = [_velocity_pid(boards, axis) for axis in axes]
    pids = " ".join(f"(VelocityPid{place} {numbers})" for place, numbers in enumerate(made))
    ones, resolutions = " ".join(["1"] * len(axes)), _row(axes, boards.rotor_resolution)
    return (
        f"(FOC (HasQuadratureEncoder {ones}) (HasTempSensor {ones}) (RotorEncoderResolution {resolutions})"
        f" (PositionGain {_POSITION_GAIN}) {pids})"
    )


def _velocity_pid(boards: Boards, axis: int) -> str:
    """Return the controller of the velocity of a rotor, in mA a part of a turn in a millisecond."""
    pid, one = boards.pids[axis], np.zeros(boards.count)
    one[axis] = 1.0
    milliamperes = boards.newton_metres[axis] / boards.motors.torques_of(one)[axis] * 1e3  # a per cent
    part = PART / boards.gearbox[axis]  # deg of the joint
    kp, ki = float(pid.kd * milliamperes * part * _MS), float(pid.kp * milliamperes * part)
    shift = shift_of(kp)
    most = round(boards.peak_current[axis] * 1e3)
    return f"{round(kp * 2**shift)} 0 {round(ki * 2**shift)} {most} {most} {shift} 0"


def _row(axes: list[int], values: FloatArray | Iterable[object]) -> str:
    listed = list(values)
    return " ".join(_text(listed[axis]) for axis in axes)


def sensor_configuration(placed: SensorOnBus) -> tuple[str, Property]:
    """Return the type of the driver of a sensor on a bus, and its configuration."""
    sensor, addresses = placed.sensor, " ".join(str(board.address) for board in placed.boards)
    bus = f"(CAN (interface {SIMULATED}) (channel {placed.wire}) (CanTimeout {_TIMEOUT}))"
    if isinstance(sensor, SimulatedForceTorque):
        link = sensor.sensor.settings.link
        return "canBusStrain", Property.parse(
            f"(canAddress {addresses}) (sensorName {sensor.name}) (frameName {link}) {bus}"
        )
    if isinstance(sensor, SimulatedImu):
        scales = " ".join(f"({INERTIAL[kind].name}Scale {scale!r})" for kind, scale in inertial_scales(sensor).items())
        return "canBusInertialMTB", Property.parse(
            f"(canAddresses {addresses}) (sensorName {sensor.name}) (frameName {sensor.imu.frame}) {scales} {bus}"
        )
    if isinstance(sensor, SimulatedAngles):
        return "canBusMais", Property.parse(f"(canAddress {addresses}) {bus}")
    triangles = sensor.settings.triangles
    return "canBusSkin", Property.parse(f"(canAddresses {addresses}) (triangles {triangles}) {bus}")


def _text(value: object) -> str:
    return f"{float(value)!r}" if isinstance(value, float) else str(value)


def _pid(pid: Pid, ticks: float) -> str:
    """Return a controller in whole numbers: kp, kd, ki, limits of integral and output, shift and offset."""
    scale = AxisScale(ticks=float(ticks), full_duty=FULL_OUTPUT)
    greatest = max(abs(number) for number in scale.raw_pid(pid._replace(scale=0.0))[:3])
    shift = shift_of(max(greatest, 1))
    raw = scale.raw_pid(pid._replace(scale=float(shift)))
    return " ".join(
        str(one) for one in (raw.kp, raw.kd, raw.ki, raw.integral_limit, raw.output_limit, raw.shift, raw.offset)
    )
