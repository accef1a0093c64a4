"""Commands of ROS 2 for a board: what controllers of ros2_control take, of one owner, and within the limits.

A part has a controller for positions, one for velocities, one for efforts and one for trajectories. All are active: the
mode of the board follows the last command. Whose program sends a command owns the part until it has left the domain,
at most 10 s after it was killed; meanwhile others are refused.
"""

from __future__ import annotations

import threading
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf import clock
from rtf.errors import RtfError
from rtf.robot.control_modes import ControlMode
from rtf.ros2.controllers import Interface
from rtf.ros2.description import described
from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import Float64MultiArray, JointTrajectory

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.ros2.node import Node
    from rtf.ros2.readers import Source

_MODES = {
    Interface.POSITION: ControlMode.POSITION_DIRECT,
    Interface.TRAJECTORY: ControlMode.POSITION_DIRECT,
    Interface.VELOCITY: ControlMode.VELOCITY,
    Interface.EFFORT: ControlMode.TORQUE,
}
#: Seconds between two setpoints of a motion; and for a board to show a new mode.
_PERIOD, _CHANGE = 0.01, 0.5
_MOST_POINTS = 10_000


class Command(NamedTuple):
    """What a part is to do: times (s) from its beginning on, and a row of values at each, in the units of boards."""

    interface: Interface
    times: FloatArray
    values: FloatArray

    def at(self, seconds: float) -> FloatArray:
        """Return the values at a time after the beginning, on straight lines between the rows."""
        return np.array([np.interp(seconds, self.times, column) for column in self.values.T])


class CommandedPart:
    """A board that obeys commands of one owner, in a thread of its own. ``report`` gets what is not obeyed.

    Setpoints of positions go to their target no faster than the joints may. Raises RobotError, Ros2Error.
    """

    def __init__(self, name: str, board: RemoteBoard, node: Node, report: Callable[[str], None]) -> None:
        self.name, self._board, self._report = name, board, report
        self.joints = described(board)
        self._units = np.array([joint.unit for joint in self.joints])
        self._fastest = np.array([joint.velocity or np.inf for joint in self.joints]) * self._units
        self._owner: Source | None = None
        self._command: Command | None = None
        self._changed = threading.Condition()
        self._closed = False
        self._reported = ""
        self._mode: ControlMode | None = None
        self._stops = 0  # of calls; a mode that was entered during one is not the board's any more
        self._setpoint, self._sent_at = board.encoders(), 0.0
        for interface in Interface:
            self._listen(node, interface)
        self._thread = threading.Thread(target=self._run, name=f"rtf-commands {name}", daemon=True)
        self._thread.start()

    def controller(self, interface: Interface) -> str:
        """Return the name of a controller, such as ``arm_position_controller``."""
        return f"{self.name}_{interface.value}_controller"

    def stop(self) -> None:
        """Forget the command, and stop the joints where they are. Raises RobotError."""
        with self._changed:
            self._command, self._mode = None, None
            self._stops += 1
            self._changed.notify_all()
        self._halt()

    def _halt(self) -> None:
        self._board.set_control_modes(ControlMode.POSITION)
        self._board.stop()

    def close(self) -> None:
        """End. Positions are held, and boards end velocities and efforts by themselves."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()

    # Commands as they arrive, in threads of the DDS ----------------------------------------------------------------

    def _listen(self, node: Node, interface: Interface) -> None:
        def array(message: Float64MultiArray, source: Source) -> None:
            self._accept(source, lambda: self._row(interface, message))

        def trajectory(message: JointTrajectory, source: Source) -> None:
            self._accept(source, lambda: self._way(message))

        if interface is Interface.TRAJECTORY:
            node.listen(f"{self.controller(interface)}/joint_trajectory", JointTrajectory, trajectory)
        else:
            node.listen(f"{self.controller(interface)}/commands", Float64MultiArray, array)

    def _accept(self, source: Source, read: Callable[[], Command]) -> None:
        try:
            self._check_owner(source)
            command = read()
        except Ros2Error as error:
            self._report_once(str(error))
            return
        with self._changed:
            self._command = command
            self._changed.notify_all()

    def _check_owner(self, source: Source) -> None:
        if source == self._owner:
            return
        sender = source.participant
        if sender is None:
            raise Ros2Error("its sender has gone")
        owner = None if self._owner is None else self._owner.participant
        if owner not in (None, sender):
            raise Ros2Error("another program has commanded the part, and is still there")
        self._owner = source

    def _row(self, interface: Interface, message: Float64MultiArray) -> Command:
        values = self._checked(message.data)
        scaled = values if interface is Interface.EFFORT else values * self._units
        return Command(interface, np.zeros(1), scaled[np.newaxis])

    def _way(self, message: JointTrajectory) -> Command:
        """Return a trajectory as a command, which begins at the present setpoints."""
        names = [joint.name for joint in self.joints]
        if sorted(message.joint_names) != sorted(names):
            raise Ros2Error(f"a trajectory is for {', '.join(names)}, not for {', '.join(message.joint_names)[:200]}")
        if not 0 < len(message.points) <= _MOST_POINTS:
            raise Ros2Error(f"a trajectory has 1 to {_MOST_POINTS} points, not {len(message.points)}")
        order = [message.joint_names.index(name) for name in names]
        rows = [self._checked(point.positions)[order] * self._units for point in message.points]
        times = [point.time_from_start.seconds for point in message.points]
        if times[0] < 0 or any(later <= time for time, later in pairwise(times)):
            raise Ros2Error("the times of a trajectory do not increase")
        if times[0] > 0:
            rows, times = [self._begin(), *rows], [0.0, *times]
        return Command(Interface.TRAJECTORY, np.array(times), np.array(rows))

    def _begin(self) -> FloatArray:
        return self._setpoint if self._mode is ControlMode.POSITION_DIRECT else self._board.encoders()

    def _checked(self, values: Sequence[float]) -> FloatArray:
        found = np.asarray(values, dtype=np.float64)
        if found.shape != (len(self.joints),) or not np.isfinite(found).all():
            raise Ros2Error(f"{len(self.joints)} finite numbers are needed, one for each joint")
        return found

    # Commands as they are obeyed, in the thread --------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._command is not None or self._closed)
                command = self._command
            if command is None or self._closed:
                return
            try:
                self._obey(command)
                self._reported = ""
            except RtfError as error:
                self._report_once(str(error))
                self._finish(command)

    def _obey(self, command: Command) -> None:
        """Do what a command says, until it is done or another one has come. Raises RobotError, Ros2Error."""
        self._enter(command)
        begun = clock.current().now()
        while self._is_present(command):
            now = clock.current().now()
            target = command.at(now - begun)
            if command.interface is Interface.VELOCITY:
                self._board.velocity_move(target)
            elif command.interface is Interface.EFFORT:
                self._board.set_reference_torques(target)
            else:
                self._go_towards(target, now)
                if now - begun < command.times[-1] or not np.array_equal(self._setpoint, target):
                    self._pause(command)
                    continue
            self._finish(command)

    def _go_towards(self, target: FloatArray, now: float) -> None:
        step = self._fastest * min(max(now - self._sent_at, _PERIOD), 2 * _PERIOD)
        away = target - self._setpoint
        self._setpoint = np.where(np.abs(away) <= step, target, self._setpoint + np.clip(away, -step, step))
        self._sent_at = now
        self._board.set_positions(self._setpoint)

    def _enter(self, command: Command) -> None:
        """Bring the board into a mode if the last command had another; a joint that has left it is not put back."""
        board, mode = self._board, _MODES[command.interface]
        with self._changed:
            if self._command is not command:
                return
            stops = self._stops
        if self._mode is not mode:
            board.set_control_modes(mode)
            deadline = clock.Deadline.after(_CHANGE)
            while any(one is not mode for one in board.control_modes()) and not deadline.expired:
                clock.SystemClock().sleep(_PERIOD)
            positions = board.encoders()
            with self._changed:
                stopped = self._stops != stops
                if not stopped:
                    self._setpoint, self._mode = positions, mode
            if stopped:  # which may have been before the mode was set
                self._halt()
                return
        for joint, found in zip(self.joints, board.control_modes(), strict=True):
            if found is not mode:
                raise Ros2Error(f"{joint.name} is in the mode {found.word}, not {mode.word}")

    def _is_present(self, command: Command) -> bool:
        with self._changed:
            return self._command is command and not self._closed

    def _pause(self, command: Command) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._command is not command or self._closed, _PERIOD)

    def _finish(self, command: Command) -> None:
        with self._changed:
            if self._command is command:
                self._command = None

    def _report_once(self, sentence: str) -> None:
        """Report why a command is not obeyed, the same reason once."""
        if sentence != self._reported:
            self._reported = sentence
            self._report(f"{self.name}: a command is not obeyed: {sentence}")
