"""Cartesian control: the tip of a chain of joints, such as a hand, is moved in space.

A pose is a vector of seven numbers in the frame of the root: x, y, z (m), the axis of the rotation, and its angle
(rad). A position is three numbers. Joints are those of the chain, from the root, in degrees and numbered from 0,
whether a control board has them in this order or not.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

from rtf.robot.interfaces.task_control import ITaskControl

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces.axes import FloatArray, Values

#: What is met first of a pose that cannot be met.
CartesianPriority: TypeAlias = Literal["position", "orientation"]


class CartesianPose(NamedTuple):
    """A pose, and its time in seconds of the robot's clock."""

    vector: FloatArray
    time: float


class CartesianSolution(NamedTuple):
    """A pose, and the positions of all joints (deg) that have it."""

    pose: FloatArray
    joints: FloatArray


class ICartesianControl(ITaskControl):
    """Motions of the tip of a chain, and what they keep to."""

    # Motions ---------------------------------------------------------------------------------------------------------

    @abstractmethod
    def go_to(self, target: Values, duration: float | None = None) -> None:
        """Start a motion to a pose, or to a position with any orientation; return when the solver has an answer.

        A ``duration`` above 0, in seconds, stays that of later motions; None: that of earlier ones. A target out of
        reach is not refused: the motion ends at the nearest pose, for which see ``desired``. Raises RefusedError if
        there is no solver, no active joint, or a joint in fault.
        """

    @abstractmethod
    def stream_target(self, target: Values, duration: float | None = None) -> None:
        """Start a motion as ``go_to`` does, without an answer: for targets that follow each other."""

    @abstractmethod
    def stream_velocity(self, velocity: Values) -> None:
        """Move until the next command: velocity of the tip (m/s), axis of the rotation, and its speed (rad/s)."""

    @abstractmethod
    def ask(self, target: Values, start: Values | None = None) -> CartesianSolution:
        """Return what the solver answers to a pose or a position, without a motion.

        ``start`` are positions of the active joints (deg); None: the present ones.
        """

    # State -----------------------------------------------------------------------------------------------------------

    @abstractmethod
    def pose(self, link: int | None = None) -> CartesianPose:
        """Return the present pose of the tip, or of the frame of a link."""

    @abstractmethod
    def desired(self) -> CartesianSolution:
        """Return the pose and the joints that are being reached: the solver's answer, not the target."""

    @abstractmethod
    def joint_velocities(self) -> FloatArray:
        """Return the commanded speeds of the active joints (deg/s)."""

    @abstractmethod
    def task_velocity(self) -> FloatArray:
        """Return the commanded velocity of the tip, as in ``stream_velocity``."""

    @abstractmethod
    def solver_connected(self) -> bool:
        """Return whether there is a solver; without one nothing moves."""

    # Settings --------------------------------------------------------------------------------------------------------

    @abstractmethod
    def trajectory_time(self) -> float:
        """Return the duration of motions (s)."""

    @abstractmethod
    def set_trajectory_time(self, duration: float) -> None:
        """Set the duration of motions (s); a controller may raise it."""

    @abstractmethod
    def tolerance(self) -> float:
        """Return how near to its end a motion counts as done: metres and radians in one norm."""

    @abstractmethod
    def set_tolerance(self, tolerance: float) -> None:
        """Set it."""

    @abstractmethod
    def reference_feedback(self) -> bool:
        """Return whether the setpoints of the joints count as their positions, instead of the encoders."""

    @abstractmethod
    def set_reference_feedback(self, feedback: bool) -> None:
        """Set it. Raises RefusedError without a board that reports its setpoints."""

    @abstractmethod
    def priority(self) -> CartesianPriority:
        """Return what is met first of a pose that cannot be met."""

    @abstractmethod
    def set_priority(self, priority: CartesianPriority) -> None:
        """Set it."""

    @abstractmethod
    def active_joints(self) -> tuple[bool, ...]:
        """Return which joints of the chain take part in motions."""

    @abstractmethod
    def set_active_joints(self, active: Sequence[bool | None]) -> tuple[bool, ...]:
        """Choose the joints that take part, and return which do; None, and what is missing at the end: as before.

        Any motion is stopped. Joints that only move together stay as they are unless all of them are chosen.
        """

    @abstractmethod
    def rest_posture(self) -> FloatArray:
        """Return the posture that is preferred (deg)."""

    @abstractmethod
    def set_rest_posture(self, posture: Values) -> FloatArray:
        """Set it for the first joints, and return all of it, within the limits."""

    @abstractmethod
    def rest_weights(self) -> FloatArray:
        """Return how much each joint is drawn to the rest posture; 0: to where it is."""

    @abstractmethod
    def set_rest_weights(self, weights: Values) -> FloatArray:
        """Set it for the first joints, and return all of it."""

    @abstractmethod
    def limits(self, joint: int) -> tuple[float, float]:
        """Return the limits of a joint in motions (deg)."""

    @abstractmethod
    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """Set them, within those of the board."""

    @abstractmethod
    def tip(self) -> FloatArray:
        """Return the pose of the tool in the frame of the last link."""

    @abstractmethod
    def set_tip(self, tip: Values) -> None:
        """Set the tool."""
