"""Prismatic joints in tests: a degree stands for a share of their range, and what is reported is in metres.

The parameters of tests, speeds, steps and tolerances, are in degrees. A prismatic joint of the robot's model has a
number of metres that stands for one of them, by default a hundredth of its range (:attr:`rtf.robot.model.Axis.degree`):
a joint that slides its whole way is then tested like one that turns by a hundred degrees. The client of its board
converts: below it all is in metres, above it in degrees, and :func:`shown` and :func:`converted` convert back for
messages and reports. A part without prismatic joints has the client that it would have anyway.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Property
from rtf.robot.boards.client import make_client
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import JointType, PidType
from rtf.robot.network.board_stub import BoardStub
from rtf.robot.network.client_settings import TIMEOUT, unique_local

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection, FloatArray, Pid, Values
    from rtf.robot.model import RobotModel
    from rtf.robot.network.state_reader import Observer

_TURN = 360.0
_DIGITS = re.compile(r"\.(\d+)f")
#: Methods whose values are positions, speeds or accelerations; of the last ones only for controllers of these.
_MOTION = frozenset(
    {
        *("position_move", "relative_move", "target_positions", "velocity_move", "target_velocities"),
        *("set_positions", "reference_positions", "set_encoders", "limits", "set_limits"),
        *("reference_speeds", "set_reference_speeds", "reference_accelerations", "set_reference_accelerations"),
        *("velocity_limits", "set_velocity_limits"),
    }
)
_OF_CONTROLLERS = frozenset(
    {"pid_references", "set_pid_references", "pid_errors", "pid_error_limits", "set_pid_error_limits"}
)
#: Methods whose values are per degree.
_STIFFNESS = frozenset({"impedance", "set_impedance", "impedance_limits"})
_KINDS = (PidType.POSITION, PidType.VELOCITY)


class _Client(BoardStub[Any]):
    """What a client of either version implements."""

    if TYPE_CHECKING:

        def forward_reading(self, method: Callable[..., Any], axes: AxisSelection, *of: object) -> Sequence[Any]: ...
        def forward_setting(
            self, method: Callable[..., Any], values: Sequence[Any], axes: AxisSelection, *of: object
        ) -> None: ...
        def forward_single(
            self, method: Callable[..., Any], axis: int, *arguments: object, of: tuple[object, ...] = ()
        ) -> Any: ...


class SlidingBoard(_Client):
    """A client whose prismatic joints of known ``slides`` (metres a degree, by their names) seem to be revolute."""

    slides: Mapping[str, float]

    def open(self, configuration: Property) -> None:
        super().open(configuration)
        #: Metres a degree of each joint; 1 of those that turn.
        self.degree = np.ones(self.axes())
        self.degree = np.array([self.slides.get(name, 1.0) for name in self.axis_names()])
        self._scaled: dict[Observer, Observer] = {}

    def observe(self, observer: Observer) -> None:
        def scaled(time: float, state: ExtendedState) -> None:
            copied = state.copy()
            copied.floats[: Field.MOTOR_POSITIONS] /= self.degree
            observer(time, copied)

        self._scaled[observer] = scaled
        super().observe(scaled)

    def unobserve(self, observer: Observer) -> None:
        super().unobserve(self._scaled.pop(observer))

    # Measurements ----------------------------------------------------------------------------------------------------

    def _of(self, axes: AxisSelection) -> FloatArray:
        degree: FloatArray = self.degree[self.chosen(axes)] if axes is not None else self.degree
        return degree

    def encoders_together(self) -> tuple[FloatArray, FloatArray]:
        joints, motors = super().encoders_together()
        return joints / self.degree, motors

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        return super().encoders(joints) / self._of(joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return super().encoder_speeds(joints) / self._of(joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return super().encoder_accelerations(joints) / self._of(joints)

    # Requests --------------------------------------------------------------------------------------------------------

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        if method in _MOTION:
            values = self.checked(values, len(self.chosen(axes))) * self._of(axes)
        super()._stream(method, values, axes)

    def forward_reading(self, method: Callable[..., Any], axes: AxisSelection, *of: object) -> Sequence[Any]:
        found = super().forward_reading(method, axes, *of)
        return found if self._power(method, of) == 0 else (np.asarray(found) / self._of(axes)).tolist()

    def forward_setting(
        self, method: Callable[..., Any], values: Sequence[Any], axes: AxisSelection, *of: object
    ) -> None:
        if self._power(method, of):
            values = (np.asarray(values) * self._of(axes)).tolist()
        super().forward_setting(method, values, axes, *of)

    def forward_single(
        self, method: Callable[..., Any], axis: int, *arguments: object, of: tuple[object, ...] = ()
    ) -> Any:
        degree, name = float(self.degree[axis]), method.__name__
        if degree == 1.0:
            return super().forward_single(method, axis, *arguments, of=of)
        factor = degree ** self._power(method, of)
        given: list[Any] = [one * factor if isinstance(one, int | float) else one for one in arguments]
        if name == "set_gearbox_ratio":
            given = [one / (_TURN * degree) for one in given]
        if name == "set_pid" and of[0] in _KINDS:
            given = [_scaled_gains(one, 1.0 / degree) for one in given]
        found: Any = super().forward_single(method, axis, *given, of=of)
        if name == "joint_type":
            return JointType.REVOLUTE
        if name == "gearbox_ratio":
            return found * _TURN * degree  # which are turns a metre below
        if name == "pid" and of[0] in _KINDS:
            return _scaled_gains(found, degree)
        if factor != 1.0 and isinstance(found, tuple):
            return tuple(one / factor for one in found)
        return found / factor if factor != 1.0 and isinstance(found, float) else found

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        found = super().pids(kind)
        return tuple(map(_scaled_gains, found, self.degree.tolist())) if kind in _KINDS else found

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        if kind in _KINDS:
            pids = list(map(_scaled_gains, pids, (1.0 / self.degree).tolist()))
        super().set_pids(kind, pids)

    def _power(self, method: Callable[..., Any], of: tuple[object, ...]) -> int:
        """Return 1 if the values of a method are in metres, -1 if they are per metre, 0 if they are neither."""
        name = method.__name__
        if name in _MOTION or (name in _OF_CONTROLLERS and of[0] in _KINDS):
            return 1
        return -1 if name in _STIFFNESS else 0


def _scaled_gains(pid: Pid, factor: float) -> Pid:
    return pid._replace(kp=pid.kp * factor, ki=pid.ki * factor, kd=pid.kd * factor)


def slides_of(robot: RobotModel, part: str) -> dict[str, float]:
    """Return the metres that stand for a degree of each prismatic joint of a part, by its name."""
    known = robot.parts.get(part)
    return {axis.name: axis.degree for axis in known.axes if axis.prismatic} if known else {}


def make_board(place: str, slides: Mapping[str, float], network: Network, name: str = "") -> RemoteBoard:
    """Return a client of a board such as ``/icub/left_arm``, not yet open. ``slides`` are those of its part.

    Raises DeviceError if the board is not registered.
    """
    client = make_client(place, network, name)
    if not slides:
        return client
    kind = type(client)
    made: RemoteBoard = type(f"Sliding{kind.__name__}", (SlidingBoard, kind), {"slides": slides})(
        name or place, network=network
    )
    return made


def open_board(place: str, slides: Mapping[str, float], *, carrier: str, network: Network) -> RemoteBoard:
    """Open a client of a board. Raises DeviceError."""
    board = make_board(place, slides, network)
    board.open(Property({"remote": place, "local": unique_local(place), "carrier": carrier, "timeout": TIMEOUT}))
    return board


def in_metres(board: object, joint: int) -> float | None:
    """Return the metres that stand for a degree of a joint; None if it turns."""
    if not isinstance(board, SlidingBoard) or board.degree[joint] == 1.0:
        return None
    return float(board.degree[joint])


def in_units(board: object, values: FloatArray, joints: Sequence[int] | None = None) -> FloatArray:
    """Return positions or speeds of joints, by default of all, in the units of the robot's model: deg, or m.

    The last axis of ``values`` is that of the joints.
    """
    if not isinstance(board, SlidingBoard):
        return values
    return values * (board.degree if joints is None else board.degree[list(joints)])


def shown(board: object, joint: int, degrees: float, spec: str = ".2f", rate: str = "") -> str:
    """Return a position, distance or speed of a joint in its unit, as text; ``rate`` is ``/s`` for a speed.

    ``spec`` is the format of degrees; metres have two digits more behind the point.
    """
    return as_text(in_metres(board, joint), degrees, f"deg{rate}", spec)


def as_text(metres: float | None, value: float, symbol: str, spec: str = ".2f") -> str:
    """Return a value of a joint in ``symbol``, such as ``Nm`` or ``deg/s``, as text, in the unit of that joint."""
    factor, unit = converted(metres, symbol)
    if factor != 1.0:
        spec = _DIGITS.sub(lambda digits: f".{int(digits[1]) + 2}f", spec)
    return f"{value * factor:{spec}} {unit}"


def converted(metres: float | None, symbol: str) -> tuple[float, str]:
    """Return the factor and the unit in which values of a joint are reported that are in ``symbol``.

    A joint that turns has ``metres`` None. For a prismatic one Nm, the unit of its commands and measured torques, is N.
    """
    if metres is None:
        return 1.0, symbol
    if symbol.startswith("deg"):
        return metres, f"m{symbol.removeprefix('deg')}"
    torque, _, per_degree = symbol.partition("/deg")
    if not torque.startswith("Nm"):
        return 1.0, symbol
    force = f"N{torque.removeprefix('Nm')}"
    return (1.0 / metres, f"{force}/m{per_degree}") if torque != symbol else (1.0, force)
