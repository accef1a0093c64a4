"""Bringing joints of a board to a pose, with a limit of time, until somebody says stop."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.robot.control_modes import POWERLESS, ControlMode
from rtf.robot.errors import DeviceError, RobotError
from rtf.robot.interfaces import IAxisInfo, IControlMode, IEncoders, IPositionControl

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.device import Device
    from rtf.robot.devices.calibrator_settings import Pose
    from rtf.robot.interfaces import FloatArray

#: Seconds of the robot's clock between two looks at the joints.
_LOOK = 0.02
#: Seconds that a board may take to change the modes of its joints.
_MODES = 1.0
_CALIBRATING = frozenset({ControlMode.CALIBRATING, ControlMode.CALIBRATION_DONE})


class Movement:
    """Something that is done with a board, in one thread; ``abort`` may come from another one.

    Raises NotSupportedError for a board whose joints cannot be moved.
    """

    def __init__(self, board: Device, what: str) -> None:
        self.what = what
        self._axes = board.view(IAxisInfo)  # type: ignore[type-abstract]  # it is only looked for
        self._encoders = board.view(IEncoders)  # type: ignore[type-abstract]  # it is only looked for
        self._position = board.view(IPositionControl)  # type: ignore[type-abstract]  # it is only looked for
        self._modes = board.view(IControlMode)  # type: ignore[type-abstract]  # it is only looked for
        self._aborted = threading.Event()

    def abort(self) -> None:
        """Have whoever waits here stop soon, with DeviceError."""
        self._aborted.set()

    def wait(self, over: Callable[[], bool], seconds: float) -> bool:
        """Wait until something is so, for so many s of the robot's clock at most; returns whether it is."""
        time = clock.current()
        end = time.now() + seconds
        while not over():
            if self._aborted.is_set():
                raise DeviceError(f"{self.what} was aborted")
            if time.now() >= end:
                return False
            if isinstance(time, clock.SystemClock):
                self._aborted.wait(_LOOK)
            else:
                time.sleep(_LOOK)
        return True

    def named(self, joints: Sequence[int]) -> str:
        """Joints with their numbers and names."""
        return ", ".join(f"joint {joint} ({self._name(joint)})" for joint in joints)

    def _name(self, joint: int) -> str:
        try:
            return self._axes.axis_name(joint)
        except RobotError:  # what it is called is not worth an error
            return "without a name"

    def go(self, joints: Sequence[int], pose: Pose, thresholds: FloatArray, *, wake: bool = False) -> dict[int, str]:
        """Bring joints to a pose; returns those that did not get there, each with a sentence about it.

        Joints without power stay as they are: somebody may have had a reason. ``wake``: those that are idle get power,
        as after a calibration, at whose end some boards leave them so.
        """
        without = POWERLESS - {ControlMode.IDLE} if wake else POWERLESS
        self.wait(lambda: not {*self._modes.control_modes(joints)} & _CALIBRATING, _MODES)
        powered = [joint for joint in joints if self._modes.control_mode(joint) not in without]
        if powered:
            self._enter_position_mode(powered)
            self._position.set_reference_speeds(pose.speeds[powered], powered)
            self._position.position_move(pose.positions[powered], powered)
            self.wait(lambda: self._settled(powered, pose, thresholds), float(pose.timeouts[powered].max()))
        return self._missing(joints, pose, thresholds)

    def _enter_position_mode(self, joints: list[int]) -> None:
        if {*self._modes.control_modes(joints)} == {ControlMode.POSITION}:
            return
        self._modes.set_control_modes(ControlMode.POSITION, joints)
        self.wait(lambda: {*self._modes.control_modes(joints)} == {ControlMode.POSITION}, _MODES)

    def _settled(self, joints: list[int], pose: Pose, thresholds: FloatArray) -> bool:
        """Whether all have arrived; one that a fault or somebody took out of the mode never will."""
        modes = zip(joints, self._modes.control_modes(joints), strict=True)
        moving = [joint for joint, mode in modes if mode is ControlMode.POSITION]
        if not moving:
            return True
        away = np.abs(self._encoders.encoders(moving) - pose.positions[moving])
        return bool((away <= thresholds[moving]).all()) and self._position.motion_done(moving)

    def _missing(self, joints: Sequence[int], pose: Pose, thresholds: FloatArray) -> dict[int, str]:
        found: dict[int, str] = {}
        measured = self._encoders.encoders(joints).tolist()
        for joint, mode, angle in zip(joints, self._modes.control_modes(joints), measured, strict=True):
            wanted = float(pose.positions[joint])
            if abs(angle - wanted) > thresholds[joint]:
                found[joint] = f"{self.named([joint])} is at {angle:.1f} deg, not at {wanted:.1f}, in mode {mode.word}"
        return found

    def stop(self, joints: Sequence[int]) -> None:
        """Have joints stay where they are."""
        self._position.stop(list(joints))

    def power_off(self, joints: Sequence[int]) -> None:
        """Have joints be without power; one that is in fault stays so."""
        if joints:
            self._modes.set_control_modes(ControlMode.IDLE, list(joints))

    def leave_faults(self, joints: Sequence[int]) -> None:
        """Bring joints that are in fault out of it; they are idle then."""
        broken = [joint for joint in joints if self._modes.control_mode(joint) is ControlMode.HARDWARE_FAULT]
        if broken:
            self._modes.set_control_modes(ControlMode.FORCE_IDLE, broken)
            self.wait(lambda: ControlMode.HARDWARE_FAULT not in self._modes.control_modes(broken), _MODES)
