"""What a guard does with joints that have to be stopped, chosen by the kind of violation.

===========  =========================================================================================================
hold         stop on the way to a target; a joint whose output was commanded is held where it is, in position mode
release      take the torque away, then hold where it is now: its controller begins without the output and the setpoint
             that pressed, with which a mere stop would press on; a board that cannot take it away holds at once
go back      release, then move a little back on the way by which the joint came: what was touched is free again
idle         take the torque away for good; where a board refuses to hold a joint
===========  =========================================================================================================
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError, StaleStateError
from rtf.robot_testing.guard.error_collector import ErrorCollector

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray

#: Modes in which a joint goes on executing its last command, and ignores ``stop``.
DRIVEN = frozenset({ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM, ControlMode.POSITION_DIRECT})
#: Modes in which it moves on without further commands.
MOVING = DRIVEN - {ControlMode.POSITION_DIRECT} | {ControlMode.VELOCITY}
#: Modes in which its motor has no power.
LIMP = frozenset({ControlMode.IDLE, ControlMode.HARDWARE_FAULT})
#: The way back from a contact, deg, and its speed, deg/s. It is more than a joint of 10 Hz bandwidth is ahead of its
#: position at 60 deg/s, 1 deg, so that the setpoint is surely back before the contact.
BACK, BACK_SPEED = 3.0, 20.0
#: A joint that was slower did not move into a contact, deg/s; nor one with less than this share of the greatest speed:
#: it may have been pushed by the contact, and would go back into it.
SLOWEST, _DRIVING = 1.0, 0.5


def take_power(board: RemoteBoard, joints: int | Sequence[int]) -> bool:
    """Take the power of joints; return whether that is possible.

    A board that refuses it, such as one of ROS 2, holds the joints where they are: a change of the mode sets the
    setpoint to the position, so that a joint that presses does so no more. Raises RobotError.
    """

    def request(mode: ControlMode) -> None:
        board.set_control_modes(mode if isinstance(joints, int) else [mode] * len(joints), joints)

    try:
        request(ControlMode.IDLE)
    except RefusedError:
        request(ControlMode.POSITION_DIRECT)
        request(ControlMode.POSITION)
        return False
    return True


class Reactions:
    """The reactions on the joints of one board. Joints without power stay without, as do those of ``excluded``.

    ``limp_before`` returns the joints that had no power before the test.
    """

    def __init__(
        self, board: RemoteBoard, excluded: Collection[int], limp_before: Callable[[], Collection[int]]
    ) -> None:
        self._board = board
        self._excluded = excluded
        self._limp_before = limp_before
        self._axes = board.axes()

    def hold(self, joints: Sequence[int]) -> None:
        """Stop joints in any mode. A joint driven by duty cycle, current or torque is held in position mode.

        If states no longer arrive the modes are unknown: all joints of the part are stopped and held.
        """
        try:
            modes = self._board.control_modes()
        except StaleStateError:
            self.hold_without_states()
            return
        driven = [joint for joint in joints if modes[joint] in DRIVEN]
        moving = [joint for joint in joints if modes[joint] not in DRIVEN | LIMP]
        problems = ErrorCollector()
        if driven:
            problems.attempt(self._hold_here, driven)
        if moving:
            problems.attempt(self._board.stop, moving)
        problems.raise_all("")

    def release(self, joints: Sequence[int]) -> None:
        """Take the torque of joints away, and hold them where they are then. Joints without power get none."""
        try:
            modes = self._board.control_modes()
        except StaleStateError:
            self.hold_without_states()
            return
        powered = [joint for joint in joints if modes[joint] not in LIMP]
        if powered and take_power(self._board, powered):
            self._hold_here(powered)

    def go_back(self, joints: Sequence[int], speeds: FloatArray, low: FloatArray, high: FloatArray) -> None:
        """Release joints, and move those back that came with ``speeds`` (deg/s, of all joints), within limits (deg).

        Without known limits ``low`` and ``high`` are empty.
        """
        self.release(joints)
        fast = max(SLOWEST, _DRIVING * float(np.abs(speeds[[*joints]]).max(initial=0.0)))
        back = [joint for joint in joints if abs(speeds[joint]) >= fast]
        if not back:
            return
        targets = self._board.encoders(back) - BACK * np.sign(speeds[back])
        if low.size:
            targets = np.clip(targets, low[back], high[back])
        with suppress(RefusedError):  # a joint that could not be held; it has no power
            self._board.set_reference_speeds([BACK_SPEED] * len(back), back)
            self._board.position_move(targets, back)

    def hold_without_states(self) -> None:
        """Stop and hold all joints without knowing their states; those that had no power before get none."""
        problems = ErrorCollector()
        idle = sorted(self._limp_before())
        held = [joint for joint in range(self._axes) if joint not in self._excluded and joint not in idle]
        if held:
            problems.attempt(self._hold_here, held)
            problems.attempt(self._board.stop, held)
        for joint in [*idle, *sorted(self._excluded)]:
            problems.attempt(take_power, self._board, joint)
        problems.raise_all("")

    def _hold_here(self, joints: Sequence[int]) -> None:
        """Hold joints where they are; leave those without power whose boards refuse it."""
        try:
            self._board.set_control_modes([ControlMode.POSITION] * len(joints), joints)
        except RefusedError:
            for joint in joints:
                try:
                    self._board.set_control_modes(ControlMode.POSITION, joint)
                except RefusedError:
                    self._board.set_control_modes(ControlMode.IDLE, joint)
