"""The driver of a control board over ROS 2: states of joints, and the commands of a controller of ros2_control."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf import clock
from rtf.robot import parameters
from rtf.robot.control_modes import HOLDING_MODES, ControlMode
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.board_driver import BoardDriver, Setpoints
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.extended_state import ExtendedState, Field
from rtf.ros2.controllers import Controller, Interface, description_of, joints_of, why_inactive
from rtf.ros2.description import DescribedJoint, read_joints
from rtf.ros2.errors import Ros2Error
from rtf.ros2.joint_states import JointStates
from rtf.ros2.node import Node, make_node

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray

#: The modes that an interface can serve. Positions are enough for velocities, whose setpoints the board integrates.
_MODES = {
    Interface.POSITION: HOLDING_MODES,
    Interface.TRAJECTORY: HOLDING_MODES,
    Interface.VELOCITY: frozenset({ControlMode.VELOCITY}),
    Interface.EFFORT: frozenset({ControlMode.TORQUE}),
}
#: The rows of the states of joints.
_ROWS = (Field.JOINT_POSITIONS, Field.JOINT_VELOCITIES, Field.TORQUES)
#: What a joint without limits has (deg).
_ENDLESS = 180.0
#: A process that wrote nothing for so long (s) has paused. Its joints then catch up with twice the speed of their
#: trajectories and so much (deg/s): below what a guard takes for a motion out of control.
_PAUSE, _CATCHING_UP = 0.05, 20.0
#: Setpoints (rad, m) that differ by the conversion to degrees only.
_SAME = 1e-9


class Ros2Board(BoardDriver):
    """``ros2ControlBoard``: joints of a ROS 2 robot.

    Parameters: ``controller``, such as ``arm_controller``, of ros2_control, and its ``interface``: ``position``
    (default), ``velocity``, ``effort`` or ``trajectory``; ``joints``, which otherwise the controller is asked for;
    ``states`` (``joint_states``) and ``description`` (``robot_description``), topics; ``namespace`` (``/``) and
    ``domain`` (ROS_DOMAIN_ID); ``period`` (s, 0.01); ``timeout`` (s, 0.5), the greatest age of a state, and
    ``patience`` (s, 10) for the robot when the board is opened.

    Names, kinds and limits are those of the description. ROS 2 has no way to take the power of a joint, to command
    currents or duty cycles, nor to set controllers: such modes are refused, such measurements do not exist.
    """

    plugin_name = "ros2ControlBoard"
    _node: Node | None = None
    _controller: Controller
    _states: JointStates
    _sent: FloatArray = np.empty(0)  # what the controller has: at first the place where the board holds the joints

    def connect(self, configuration: Property) -> list[BoardAxis]:
        """Find the joints, their limits, their states and the controller. Raises as BoardDriver says."""
        self.disconnect()
        name = parameters.text(configuration, "controller")
        interface = Interface(
            parameters.choice(configuration, "interface", "position", [one.value for one in Interface])
        )
        self.period = parameters.positive(configuration, "period", 0.01)
        self.max_age = parameters.positive(configuration, "timeout", 0.5)
        patience = parameters.positive(configuration, "patience", 10.0)
        try:
            self._node = make_node(configuration, "rtf_board", self.report)
            return self._find(self._node, configuration, name, interface, patience)
        except Ros2Error as error:
            self.disconnect()
            raise DeviceError(str(error)) from error
        except BaseException:
            self.disconnect()
            raise

    def _find(
        self, node: Node, configuration: Property, name: str, interface: Interface, patience: float
    ) -> list[BoardAxis]:
        joints = [*parameters.names(configuration, "joints")] or joints_of(node, name, patience)
        text = description_of(node, parameters.text(configuration, "description", "robot_description"), patience)
        described = read_joints(text)
        if unknown := [joint for joint in joints if joint not in described]:
            raise DeviceError(f"the description has no joint {', '.join(unknown)}; it has {', '.join(described)}")
        topic = parameters.text(configuration, "states", "joint_states")
        self._states = JointStates(node, topic, joints)
        if not self._states.await_all(patience):
            missing = ", ".join(self._states.missing())
            raise DeviceError(f"no state of {missing} came on {node.full_name(topic)} within {patience:g} s")
        if why := why_inactive(node, node.full_name(name)):
            raise DeviceError(why)
        self._controller = Controller(node, name, interface, joints, self.period or 0.0)
        if not self._controller.await_reader(patience):
            raise DeviceError(f"nobody takes commands on {self._controller.topic}; ros2 control list_controllers")
        return self._axes([described[joint] for joint in joints], interface)

    def _axes(self, joints: Sequence[DescribedJoint], interface: Interface) -> list[BoardAxis]:
        known = [not np.isnan(row).any() for row in self._states.latest().values]
        self.measures = frozenset(field for field, there in zip(_ROWS, known, strict=True) if there)
        self.supported = _MODES[interface]
        self._units = np.array([joint.unit for joint in joints])
        self._arrived, self._written = 0.0, self.time()
        self._behind = np.zeros(len(joints), dtype=bool)
        self._first: dict[int, tuple[Any, ...]] = {}
        return [_axis(joint, interface) for joint in joints]

    def disconnect(self) -> None:
        """Leave the robot: velocities and efforts end, positions are held by its controller."""
        node, self._node = self._node, None
        if node is not None:
            if self._sent.size and self._repeats():
                self._controller.send(np.zeros_like(self._sent), np.zeros_like(self._sent))
            node.close()
        self._sent = np.empty(0)

    def read(self, state: ExtendedState) -> None:
        """Take the latest state, and wait for one for a period. Raises DeviceError if it is too old."""
        found = self._states.await_newer(self._arrived, self.period or 0.0)
        age = clock.current().now() - found.arrived
        if age > self.max_age:
            raise DeviceError("no states of the joints come any more; is the robot's node running?")
        state.joint_positions[:] = found.values[0] * self._units
        if Field.JOINT_VELOCITIES in self.measures:
            state.joint_velocities[:] = found.values[1] * self._units
        if Field.TORQUES in self.measures:
            state.torques[:] = found.values[2]
        self._time, self._arrived = found.time, found.arrived
        if not self._sent.size:
            self._sent = np.zeros_like(found.values[0]) if self._repeats() else found.values[0].copy()

    def stamp(self, now: float) -> float:
        """Return the time of the latest state."""
        return min(self._time, now)

    def write(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> None:
        """Send the setpoints if they have changed, or are an effort or a velocity."""
        values = self._values(setpoints, modes)
        if (np.abs(values - self._sent) > _SAME).any() or (self._repeats() and values.any()):
            self._sent = values
            try:
                self._controller.send(values, setpoints.velocities / self._units)
            except Ros2Error as error:
                raise DeviceError(str(error)) from error

    def _repeats(self) -> bool:
        return self._controller.interface in (Interface.VELOCITY, Interface.EFFORT)

    def _values(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> FloatArray:
        interface = self._controller.interface
        values = self._paced(setpoints, modes)
        if interface is Interface.VELOCITY:
            values = np.where(modes == ControlMode.VELOCITY, setpoints.velocities / self._units, 0.0)
        elif interface is Interface.EFFORT:
            values = np.where(modes == ControlMode.TORQUE, setpoints.torques, 0.0)
        return values

    def _paced(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> FloatArray:
        """Return the positions to send. After a pause of this process joints on their way do not rush to catch up."""
        wanted: FloatArray = setpoints.positions / self._units
        now = self.board.tick  # of the trajectories, in s
        passed, self._written = now - self._written, now
        if passed > _PAUSE:
            self._behind |= modes != ControlMode.POSITION_DIRECT
        speed = 2.0 * np.abs(setpoints.velocities) + _CATCHING_UP * self.board.degree
        step = np.where(self._behind, speed * min(passed, _PAUSE) / self._units, np.inf)
        values = np.clip(wanted, self._sent - step, self._sent + step)
        self._behind &= values != wanted
        return values

    def configure(self, axis: int) -> None:
        """Refuse a change of a setting: the controllers of a robot of ROS 2 have their own."""
        board = self.board
        now = board.pids[axis], *(float(values[axis]) for values in self._settings())
        first = self._first.setdefault(axis, now)
        if now != first:
            board.pids[axis] = first[0]
            for values, value in zip(self._settings(), first[1:], strict=True):
                values[axis] = value
            raise RefusedError(f"{board.names[axis]}: ROS 2 has no gains, greatest currents and outputs, or stiffness")

    def _settings(self) -> tuple[FloatArray, ...]:
        board = self.board
        return board.max_current, board.duty_limit, board.stiffness, board.damping


def _axis(joint: DescribedJoint, interface: Interface) -> BoardAxis:
    low, high = joint.limits or (-_ENDLESS / joint.unit, _ENDLESS / joint.unit)
    axis = BoardAxis(
        name=joint.name,
        kind=joint.kind,
        minimum=low * joint.unit,
        maximum=high * joint.unit,
        torque_controlled=interface is Interface.EFFORT,
    )
    if joint.velocity is not None:
        axis = replace(axis, max_velocity=joint.velocity * joint.unit)
    return axis if joint.effort is None else replace(axis, max_torque=joint.effort)
