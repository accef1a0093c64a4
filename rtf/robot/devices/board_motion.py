"""Motion of a board's axes: positions, velocities, torques, currents, duty cycles, impedance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import TRAJECTORY_MODES, VELOCITY_MODES, ControlMode
from rtf.robot.devices.board_base import BoardBase
from rtf.robot.errors import RefusedError
from rtf.robot.extended_state import Field
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

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

_DIRECT = frozenset({ControlMode.POSITION_DIRECT})
_TORQUE = frozenset({ControlMode.TORQUE})
_CURRENT = frozenset({ControlMode.CURRENT})
_PWM = frozenset({ControlMode.PWM})
_MOVING = TRAJECTORY_MODES | VELOCITY_MODES


class BoardMotion(
    BoardBase,
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
        self._command("position", targets, joints, TRAJECTORY_MODES, self.board.move)

    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        board = self.board
        self._command(
            "position",
            distances,
            joints,
            TRAJECTORY_MODES,
            lambda axes, by: board.move(axes, board.trajectories.at(board.tick, axes)[0] + by),
        )

    def motion_done(self, joints: AxisSelection = None) -> bool:
        self._update()
        done, now = self.board.trajectories.done, self.board.tick
        if type(joints) is int:  # a fast path, as it is called often
            return bool(done(self._axis(joints), now))
        return bool(done(self._places(joints), now).all())

    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.targets, joints)

    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl. Speeds are clipped to the greatest speed of the joint."""
        self._set_magnitudes("speeds", speeds, joints, self.board.speeds, self.board.max_velocity)

    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.speeds, joints)

    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        board = self.board
        self._set_magnitudes("accelerations", accelerations, joints, board.accelerations, np.full(board.count, np.inf))

    def _set_magnitudes(
        self, what: str, values: Values, joints: AxisSelection, into: FloatArray, most: FloatArray
    ) -> None:
        axes = self._places(joints)
        given = values_for(len(axes), values)
        if (given < 0).any():
            raise RefusedError(f"{self.name}: {what} must not be negative: {given.tolist()}")
        with self.board.lock:
            into[axes] = np.minimum(given, most[axes])

    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.accelerations, joints)

    def stop(self, joints: AxisSelection = None) -> None:
        axes = self._places(joints)
        with self._between_cycles() as board:
            taken = board.accept("stop", axes.tolist(), _MOVING)
            if taken:
                board.stop(axes[taken])

    # IVelocityControl

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        board = self.board
        self._command(
            "velocity",
            velocities,
            joints,
            VELOCITY_MODES,
            lambda axes, speeds: board.run(axes, speeds, board.accelerations[axes]),
        )

    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.velocities, joints)

    # IPositionDirect

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        self._command("direct", positions, joints, _DIRECT, self.board.follow)

    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.direct, joints)

    # ITorqueControl

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        return self._measured(Field.TORQUES, joints)

    def torque_range(self, joint: int) -> tuple[float, float]:
        most = self._setting(self.board.max_torque, joint)
        return -most, most

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        self._command("torque", torques, joints, _TORQUE, self.board.exert)

    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        return self._read(self.board.torques, joints)

    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        return self.board.torque_parameters[self._axis(joint)]

    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        axis = self._axis(joint)
        values_for(len(parameters), parameters)
        with self.board.lock:
            self.board.torque_parameters[axis] = parameters
            self.board.driver.configure(axis)

    # IImpedanceControl

    def impedance(self, joint: int) -> tuple[float, float]:
        axis = self._axis(joint)
        return float(self.board.stiffness[axis]), float(self.board.damping[axis])

    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        axis = self._axis(joint)
        least_k, most_k, least_d, most_d = self.impedance_limits(joint)
        if not (least_k <= stiffness <= most_k and least_d <= damping <= most_d):
            raise RefusedError(
                f"{self.name} joint {joint}: stiffness {stiffness:g} Nm/deg and damping {damping:g} Nm s/deg are not "
                f"within {least_k:g} to {most_k:g} and {least_d:g} to {most_d:g}"
            )
        with self.board.lock:
            self.board.stiffness[axis], self.board.damping[axis] = stiffness, damping
            self.board.driver.configure(axis)

    def impedance_offset(self, joint: int) -> float:
        return self._setting(self.board.impedance_offset, joint)

    def set_impedance_offset(self, joint: int, offset: float) -> None:
        self._write(offset, joint, self.board.impedance_offset)

    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        axis = self._axis(joint)
        return 0.0, float(self.board.max_stiffness[axis]), 0.0, float(self.board.max_damping[axis])

    # ICurrentControl

    def current_range(self, motor: int) -> tuple[float, float]:
        peak = self._setting(self.board.peak_current, motor, "motor")
        return -peak, peak

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        self._command("current", currents, motors, _CURRENT, self.board.drive_currents)

    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.board.currents, motors, "motor")

    # IPWMControl

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        self._command("duty", duties, motors, _PWM, self.board.drive)

    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        return self._read(self.board.duties, motors, "motor")

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        return self._measured(Field.DUTY_CYCLES, motors, "motor")
