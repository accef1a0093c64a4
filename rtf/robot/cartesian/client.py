"""The client of Cartesian control, ``cartesiancontrollerclient``, for our servers and those of the iCub."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Bottle
from rtf.robot.cartesian.requests import TABLE, VELOCITY
from rtf.robot.errors import DeviceError, NoAnswerError
from rtf.robot.interfaces.cartesian import CartesianPose, ICartesianControl
from rtf.robot.network.request_table import POSE_SIZE, floats, vector
from rtf.robot.network.task_client import TaskClient

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.robot.interfaces import FloatArray, Values
    from rtf.robot.interfaces.cartesian import CartesianPriority, CartesianSolution


class CartesianClient(TaskClient, ICartesianControl):
    """``cartesiancontrollerclient``: see :class:`~rtf.robot.network.task_client.TaskClient` for its parameters."""

    kind, table, rpc_ends = "Cartesian control", TABLE, ("/rpc:o", "/rpc:i")
    command_ends = ("command",)
    stream_sizes: ClassVar[Mapping[str, int]] = {"state": POSE_SIZE}

    def check_ready(self) -> None:
        """Refuse a server without a solver."""
        if not self.solver_connected():
            raise DeviceError(f"{self._remote} has no solver; start that first")

    # Motions ---------------------------------------------------------------------------------------------------------

    def go_to(self, target: Values, duration: float | None = None) -> None:
        self.call("go_to", target, duration)

    def stream_target(self, target: Values, duration: float | None = None) -> None:
        self.stream("command", TABLE.request("go_to", target, duration))

    def stream_velocity(self, velocity: Values) -> None:
        self.stream("command", Bottle([VELOCITY, floats(vector(velocity, POSE_SIZE))]))

    def ask(self, target: Values, start: Values | None = None) -> CartesianSolution:
        found: CartesianSolution = self.call("ask", target, start)
        return found

    # State -----------------------------------------------------------------------------------------------------------

    def pose(self, link: int | None = None) -> CartesianPose:
        """Return the latest pose of the stream; of a link, ask."""
        if link is not None:
            found: CartesianPose = self.call("pose", link)
            return found
        latest = self.latest("state")
        return CartesianPose(latest.value.copy(), latest.time)

    def desired(self) -> CartesianSolution:
        found: CartesianSolution = self.call("desired")
        return found

    def joint_velocities(self) -> FloatArray:
        return self.call_array("joint_velocities")

    def task_velocity(self) -> FloatArray:
        return self.call_array("task_velocity")

    def solver_connected(self) -> bool:
        return bool(self.call("solver_connected"))

    # Settings --------------------------------------------------------------------------------------------------------

    def trajectory_time(self) -> float:
        return float(self.call("trajectory_time"))

    def set_trajectory_time(self, duration: float) -> None:
        self.call("set_trajectory_time", duration)

    def tolerance(self) -> float:
        return float(self.call("tolerance"))

    def set_tolerance(self, tolerance: float) -> None:
        self.call("set_tolerance", tolerance)

    def reference_feedback(self) -> bool:
        return bool(self.call("reference_feedback"))

    def set_reference_feedback(self, feedback: bool) -> None:
        self.call("set_reference_feedback", feedback)

    def priority(self) -> CartesianPriority:
        found = self.call("priority")
        if found == "position":
            return "position"
        if found == "orientation":
            return "orientation"
        raise NoAnswerError(f"{self._remote} has the priority {found!r}")

    def set_priority(self, priority: CartesianPriority) -> None:
        self.call("set_priority", priority)

    def active_joints(self) -> tuple[bool, ...]:
        return tuple(map(bool, self.call("active_joints")))

    def set_active_joints(self, active: Sequence[bool | None]) -> tuple[bool, ...]:
        return tuple(map(bool, self.call("set_active_joints", active)))

    def rest_posture(self) -> FloatArray:
        return self.call_array("rest_posture")

    def set_rest_posture(self, posture: Values) -> FloatArray:
        return self.call_array("set_rest_posture", posture)

    def rest_weights(self) -> FloatArray:
        return self.call_array("rest_weights")

    def set_rest_weights(self, weights: Values) -> FloatArray:
        return self.call_array("set_rest_weights", weights)

    def limits(self, joint: int) -> tuple[float, float]:
        low, high = self.call("limits", joint)
        return float(low), float(high)

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        self.call("set_limits", joint, minimum, maximum)

    def tip(self) -> FloatArray:
        return self.call_array("tip")

    def set_tip(self, tip: Values) -> None:
        self.call("set_tip", vector(tip, POSE_SIZE))
