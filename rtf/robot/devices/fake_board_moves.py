"""The motion interfaces of a fake board: trajectories, speeds, direct positions, and torques without effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board_parts import FakeParts
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
    IEncoders,
    IImpedanceControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    ITorqueControl,
    IVelocityControl,
    MotorTorqueParameters,
    values_for,
)

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

#: Defaults: deg/s, Nm, and Nm/deg and Nm s/deg of compliant joints.
SPEED_LIMITS, TORQUE_RANGE = (0.0, 50.0), (-100.0, 100.0)
#: The largest position of a joint, in deg.
FARTHEST = 1e6
IMPEDANCE_LIMITS = (0.0, 1000.0, 0.0, 100.0)


class FakeMoves(FakeParts, IEncoders, IPositionControl, IVelocityControl, IPositionDirect):
    """The encoder and motion interfaces of the joints."""

    def __init__(self) -> None:
        super().__init__()
        self._speed_limits = np.zeros((0, 2))

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._now().positions[self._chosen(joints)]

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._now().speeds[self._chosen(joints)]

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._now().accelerations[self._chosen(joints)]

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return np.full(len(self._chosen(joints)), self._now().time)

    def set_encoders(self, values: Values, joints: AxisSelection = None) -> None:
        chosen, positions = self._given(values, joints)
        if (np.abs(positions) > FARTHEST).any():
            raise RefusedError(f"the positions {positions.tolist()} deg are out of range; the limit is {FARTHEST:g}")
        with self._lock:
            self._now().declare(chosen, positions)

    def reset_encoders(self, joints: AxisSelection = None) -> None:
        chosen = self._chosen(joints)
        self.set_encoders(np.zeros(len(chosen)), chosen)

    # Moves -------------------------------------------------------------------------------------------------------

    def position_move(self, targets: Values, joints: AxisSelection = None) -> None:
        chosen, positions = self._given(targets, joints)
        with self._lock:
            self._now().move(chosen, positions)

    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        chosen, ways = self._given(distances, joints)
        with self._lock:
            axes = self._now()
            axes.move(chosen, axes.targets[chosen] + ways)

    def motion_done(self, joints: AxisSelection = None) -> bool:
        with self._lock:
            return not self._now().moving[self._chosen(joints)].any()

    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.targets[self._chosen(joints)]

    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """Set the reference speeds; the sign is ignored."""
        chosen, values = self._given(speeds, joints)
        self._axes.reference_speeds[chosen] = np.abs(values)

    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._axes.reference_speeds[self._chosen(joints)]

    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        chosen, values = self._given(accelerations, joints)
        with self._lock:
            self._now().reference_accelerations[chosen] = np.abs(values)

    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._axes.reference_accelerations[self._chosen(joints)]

    def stop(self, joints: AxisSelection = None) -> None:
        with self._lock:
            self._now().stop(self._chosen(joints))

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """Set target velocities. This board has no watchdog that stops the joint."""
        chosen, speeds = self._given(velocities, joints)
        with self._lock:
            greatest = self._speed_limits[chosen, 1]
            self._now().run(chosen, np.clip(speeds, -greatest, greatest))

    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.target_speeds[self._chosen(joints)]

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        chosen, values = self._given(positions, joints)
        with self._lock:
            self._now().follow(chosen, values)

    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.direct[self._chosen(joints)]


class FakeForces(FakeParts, ITorqueControl, IImpedanceControl, IPWMControl):
    """The torque, duty cycle and impedance interfaces, whose values are only stored."""

    def __init__(self) -> None:
        super().__init__()
        self._motor_torques: list[MotorTorqueParameters] = []
        self._impedances = np.zeros((0, 2))
        self._impedance_offsets = np.zeros(0)

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.measured(ControlMode.TORQUE)[self._chosen(joints)]

    def torque_range(self, joint: int) -> tuple[float, float]:
        self._one(joint)
        return TORQUE_RANGE

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        chosen, values = self._given(torques, joints)
        with self._lock:
            self._now().refer(ControlMode.TORQUE, chosen, np.clip(values, *TORQUE_RANGE))

    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.references[ControlMode.TORQUE][self._chosen(joints)]

    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        return self._motor_torques[self._one(joint)]

    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        values_for(len(parameters), parameters)
        self._motor_torques[self._one(joint)] = parameters

    def impedance(self, joint: int) -> tuple[float, float]:
        stiffness, damping = self._impedances[self._one(joint)]
        return float(stiffness), float(damping)

    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        least_stiffness, greatest_stiffness, least_damping, greatest_damping = IMPEDANCE_LIMITS
        if not least_stiffness <= stiffness <= greatest_stiffness or not least_damping <= damping <= greatest_damping:
            raise RefusedError(
                f"joint {joint}: a stiffness of {stiffness:g} Nm/deg with a damping of {damping:g} Nm s/deg is beyond "
                f"the limits {IMPEDANCE_LIMITS}"
            )
        self._impedances[self._one(joint)] = stiffness, damping

    def impedance_offset(self, joint: int) -> float:
        return float(self._impedance_offsets[self._one(joint)])

    def set_impedance_offset(self, joint: int, offset: float) -> None:
        chosen, value = self._given(offset, joint)
        self._impedance_offsets[chosen] = value

    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        self._one(joint)
        return IMPEDANCE_LIMITS

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        chosen, values = self._given(duties, motors)
        with self._lock:
            greatest = self._settings["pwm_limit"][chosen]
            self._now().refer(ControlMode.PWM, chosen, np.clip(values, -greatest, greatest))

    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.references[ControlMode.PWM][self._chosen(motors)]

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.measured(ControlMode.PWM)[self._chosen(motors)]
