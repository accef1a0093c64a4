"""The configuration of the driver of emulated boards, as a robot's XML file would have it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.robot.devices.can.axis_scale import AxisScale
from rtf.robot.interfaces import JointType
from rtf.simulator.angle_sensors import SimulatedAngles
from rtf.simulator.firmware.parameters import FULL_OUTPUT, IMPEDANCE_COUNTS, TORQUE_COUNTS, shift_of
from rtf.simulator.firmware.sensors_on_buses import INERTIAL, inertial_scales
from rtf.simulator.firmware.simulated_bus import INTERFACE
from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.simulator.firmware.boards_on_buses import Firmware
    from rtf.simulator.firmware.sensors_on_buses import SensorOnBus

#: Milliseconds in which an answer is missed. A simulation may be slow by the machine's clock.
_TIMEOUT = 2000


def can_configuration(firmware: Firmware, wire: str) -> Property:
    """Return the configuration of ``canMotionControl`` for the boards on a wire, with the gains that they have now."""
    own = [board for board in firmware.boards if board.wire.name == wire]
    axes = [axis for board in own for axis in board.axes]
    boards = firmware.simulation.boards

    def row(values: FloatArray | Iterable[object]) -> str:
        listed = list(values)
        return " ".join(_text(listed[axis]) for axis in axes)

    controllers = [_pid(boards.pids[axis], boards.resolution[axis]) for axis in axes]
    pids = " ".join(f"(Pid{place} {numbers})" for place, numbers in enumerate(controllers))
    able = boards.torque_controlled
    counts = [IMPEDANCE_COUNTS if one else 0.0 for one in able]
    couplings = boards.configured_couplings[axes][:, axes]
    kinds = ["prismatic" if kind is JointType.PRISMATIC else "revolute" for kind in boards.kinds]
    return Property.parse(
        f"(GENERAL (Joints {len(axes)}) (AxisName ({row(boards.names)})) (AxisType ({row(kinds)}))"
        f" (Encoder {row(boards.resolution)}) (fullscalePWM {' '.join([str(FULL_OUTPUT)] * len(axes))})"
        f" (newtonsToSensor {TORQUE_COUNTS:g}) (Gearbox_M2J {row(boards.configured_gearbox)})"
        f" (supplyVoltage {row(boards.supply_voltage)}))"
        f" (CAN (interface {INTERFACE}) (channel {wire}) (CanTimeout {_TIMEOUT})"
        f" (CanAddresses {' '.join(str(board.address) for board in own)}))"
        f" (LIMITS (jntPosMin {row(boards.minimum)}) (jntPosMax {row(boards.maximum)})"
        f" (jntVelMax {row(boards.max_velocity)}) (jntTrqMax {row(boards.max_torque)})"
        f" (motorNominalCurrents {row(boards.nominal_current)}) (motorPeakCurrents {row(boards.peak_current)})"
        f" (motorOverloadCurrents {row(boards.max_current)}) (motorPwmLimit {FULL_OUTPUT}))"
        f" (PIDS {pids})"
        f" (IMPEDANCE (stiffnessToSensor {row(counts)}) (dampingToSensor {row(counts)})"
        f" (stiffness {row(boards.stiffness * able)}) (damping {row(boards.damping * able)}))"
        f" (COUPLINGS (matrixJ2M {' '.join(map(_text, couplings.ravel().tolist()))}))"
    )


def sensor_configuration(placed: SensorOnBus) -> tuple[str, Property]:
    """Return the type of the driver of a sensor on a bus, and its configuration."""
    sensor, addresses = placed.sensor, " ".join(str(board.address) for board in placed.boards)
    bus = f"(CAN (interface {INTERFACE}) (channel {placed.wire}))"
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
