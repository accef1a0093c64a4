"""Movement of a board's joints to a pose, with a timeout and an abort."""

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

#: Polling period of the joints, in seconds of the robot's clock.
_LOOK = 0.02
#: Seconds that a board may take to change the modes of its joints.
_MODES = 1.0
_CALIBRATING = frozenset({ControlMode.CALIBRATING, ControlMode.CALIBRATION_DONE})


class Movement:
    """A movement of a board, in one thread; ``abort`` may be called from another one.

    Raises NotSupportedError for a board without the interfaces to move its joints.
    """

    def __init__(self, board: Device, what: str) -> None:
        self.what = what
        self._axes = board.view(IAxisInfo)  # type: ignore[type-abstract]  # an abstract type is allowed here
        self._encoders = board.view(IEncoders)  # type: ignore[type-abstract]  # an abstract type is allowed here
        self._position = board.view(IPositionControl)  # type: ignore[type-abstract]  # an abstract type is allowed here
        self._modes = board.view(IControlMode)  # type: ignore[type-abstract]  # an abstract type is allowed here
        self._aborted = threading.Event()

    def abort(self) -> None:
        """Make ``wait`` raise DeviceError soon."""
        self._aborted.set()

    def wait(self, over: Callable[[], bool], seconds: float) -> bool:
        """Wait until a condition holds, at most ``seconds`` of the robot's clock; return whether it holds."""
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
        """Return joints as text, with their numbers and names."""
        return ", ".join(f"joint {joint} ({self._name(joint)})" for joint in joints)

    def _name(self, joint: int) -> str:
        try:
            return self._axes.axis_name(joint)
        except RobotError:  # a missing name is not worth an error
            return "without a name"

    def go(self, joints: Sequence[int], pose: Pose, thresholds: FloatArray, *, wake: bool = False) -> dict[int, str]:
        """Move joints to a pose; return those that did not arrive, each with a sentence about it.

        Joints without power are not moved: the reason is unknown. ``wake``: idle joints get power, as after a
        calibration, at whose end some boards leave them idle.
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
        """Return whether all have arrived. A joint that left position mode, by a fault or a request, is not awaited."""
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
        """Stop joints where they are."""
        self._position.stop(list(joints))

    def power_off(self, joints: Sequence[int]) -> None:
        """Switch joints off; one in fault stays in fault."""
        if joints:
            self._modes.set_control_modes(ControlMode.IDLE, list(joints))

    def leave_faults(self, joints: Sequence[int]) -> None:
        """Reset joints that are in fault; they are idle then."""
        broken = [joint for joint in joints if self._modes.control_mode(joint) is ControlMode.HARDWARE_FAULT]
        if broken:
            self._modes.set_control_modes(ControlMode.FORCE_IDLE, broken)
            self.wait(lambda: ControlMode.HARDWARE_FAULT not in self._modes.control_modes(broken), _MODES)
