"""Moving a part: positions, velocities, torques, currents, duty cycles, impedance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import TRAJECTORY_MODES, VELOCITY_MODES, ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
    ICurrentControl,
    IImpedanceControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    ITorqueControl,
    IVelocityControl,
    MotorTorqueParameters,
    values_for,
)
from rtf.simulator.part.base import PartBase
from rtf.simulator.position_gains import FULL

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

_DIRECT = frozenset({ControlMode.POSITION_DIRECT})
_TORQUE = frozenset({ControlMode.TORQUE})
_CURRENT = frozenset({ControlMode.CURRENT})
_PWM = frozenset({ControlMode.PWM})
_MOVING = TRAJECTORY_MODES | VELOCITY_MODES
#: The greatest impedance, as multiples of the default; beyond it a loop with 1 ms sampling is not stable.
_STIFFEST = 10.0


class PartMotion(
    PartBase,
    IPositionControl,
    IVelocityControl,
    IPositionDirect,
    ITorqueControl,
    IImpedanceControl,
    ICurrentControl,
    IPWMControl,
):
    """Motion commands, and their last values."""

    # IPositionControl

    def position_move(self, targets: Values, joints: AxisSelection = None) -> None:
        self._command("position", targets, joints, TRAJECTORY_MODES, self.boards.move)

    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        boards = self.boards
        self._command(
            "position",
            distances,
            joints,
            TRAJECTORY_MODES,
            lambda axes, by: boards.move(axes, boards.setpoints.at(boards.tick, axes)[0] + by),
        )

    def motion_done(self, joints: AxisSelection = None) -> bool:
        done, now = self.boards.setpoints.done, self.boards.tick
        if type(joints) is int:  # a fast path, as it is called often
            return bool(done(self._axis(joints), now))
        return bool(done(self._places(joints), now).all())

    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.targets, joints)

    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl. Speeds are clipped to the greatest speed of the joint."""
        axes = self._places(joints)
        given = values_for(len(axes), speeds)
        if (given < 0).any():
            raise RefusedError(f"{self.part}: speeds must not be negative: {given.tolist()}")
        with self.lock:
            self.boards.speeds[axes] = np.minimum(given, self.boards.max_velocity[axes])

    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.speeds, joints)

    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        axes = self._places(joints)
        given = values_for(len(axes), accelerations)
        if (given < 0).any():
            raise RefusedError(f"{self.part}: accelerations must not be negative: {given.tolist()}")
        with self.lock:
            self.boards.accelerations[axes] = given

    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.accelerations, joints)

    def stop(self, joints: AxisSelection = None) -> None:
        axes = self._places(joints)
        with self.lock:
            taken = self.boards.accept("stop", axes.tolist(), _MOVING)
            if taken:
                self.boards.stop(axes[taken])

    # IVelocityControl

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        boards = self.boards
        self._command(
            "velocity",
            velocities,
            joints,
            VELOCITY_MODES,
            lambda axes, speeds: boards.run(axes, speeds, boards.accelerations[axes]),
        )

    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.velocities, joints)

    # IPositionDirect

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        self._command("direct", positions, joints, _DIRECT, self.boards.follow)

    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.direct, joints)

    # ITorqueControl

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.measured_torques(), joints)

    def torque_range(self, joint: int) -> tuple[float, float]:
        most = float(FULL * self.boards.newton_metres[self._axis(joint)])
        return -most, most

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        self._command("torque", torques, joints, _TORQUE, self.boards.exert)

    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.torques, joints)

    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        """See ITorqueControl: the duty cycle (per cent) of a newton-metre."""
        axis = self._axis(joint)
        return self.boards.torque_parameters.get(
            axis, MotorTorqueParameters(ktau=float(1.0 / self.boards.newton_metres[axis]))
        )

    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        """See ITorqueControl. The parameters are stored; the simulated motor does not change."""
        with self.lock:
            self.boards.torque_parameters[self._axis(joint)] = parameters

    # IImpedanceControl

    def impedance(self, joint: int) -> tuple[float, float]:
        axis = self._axis(joint)
        return float(self.boards.stiffness[axis]), float(self.boards.damping[axis])

    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        axis = self._axis(joint)
        least_k, most_k, least_d, most_d = self.impedance_limits(joint)
        if not (least_k <= stiffness <= most_k and least_d <= damping <= most_d):
            raise RefusedError(
                f"{self.part} joint {joint}: stiffness {stiffness:g} Nm/deg and damping {damping:g} Nm s/deg are not "
                f"within {least_k:g} to {most_k:g} and {least_d:g} to {most_d:g}"
            )
        with self.lock:
            self.boards.stiffness[axis], self.boards.damping[axis] = stiffness, damping
            self.boards.refresh(axis)

    def impedance_offset(self, joint: int) -> float:
        return float(self.boards.impedance_offset[self._axis(joint)])

    def set_impedance_offset(self, joint: int, offset: float) -> None:
        axis = self._axis(joint)
        with self.lock:
            self.boards.impedance_offset[axis] = offset
            self.boards.refresh(axis)

    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        axis = self._axis(joint)
        return 0.0, float(_STIFFEST * self.boards.default_stiffness[axis]), 0.0, float(
            _STIFFEST * self.boards.default_damping[axis]
        )  # fmt: skip

    # ICurrentControl

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.motor_currents(), motors, "motor")

    def current_range(self, motor: int) -> tuple[float, float]:
        peak = float(self.boards.peak_current[self._axis(motor, "motor")])
        return -peak, peak

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        self._command("current", currents, motors, _CURRENT, self.boards.drive_currents)

    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.currents, motors, "motor")

    # IPWMControl

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        self._command("duty", duties, motors, _PWM, self.boards.drive)

    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.duties, motors, "motor")

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.boards.motor_duties(), motors, "motor")
