"""Cartesian control: the tip of a chain of joints, such as a hand, is moved in space.

A pose is a vector of seven numbers in the frame of the root: x, y, z (m), the axis of the rotation, and its angle
(rad). A position is three numbers. Joints are those of the chain, from the root, in degrees and numbered from 0,
whether a control board has them in this order or not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Bottle
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


class CartesianEvent(NamedTuple):
    """Something that happened at a time, in seconds of the robot's clock.

    Names are ``motion-onset``, ``motion-ongoing``, which has the share of the way as ``checkpoint``, ``motion-done``
    and ``closing``.
    """

    name: str
    time: float
    checkpoint: float | None = None


#: Called with each event, in a thread of the sender, which waits.
EventObserver: TypeAlias = "Callable[[CartesianEvent], None]"


class ICartesianControl(ABC):
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
    def stop(self) -> None:
        """End a motion; the joints hold their positions."""

    @abstractmethod
    def motion_done(self) -> bool:
        """Return whether the last motion has ended."""

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

    @abstractmethod
    def info(self) -> Bottle:
        """Return what the controller says of itself: pairs of a key, such as ``arm_version``, and its value."""

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
    def tracking(self) -> bool:
        """Return whether the target is kept after the motion, whatever other joints do."""

    @abstractmethod
    def set_tracking(self, tracking: bool) -> None:
        """Set it."""

    @abstractmethod
    def reference_feedback(self) -> bool:
        """Return whether the setpoints of the joints count as their positions, instead of the encoders."""

    @abstractmethod
    def set_reference_feedback(self, feedback: bool) -> None:
        """Set it. Raises RefusedError without a board that tells its setpoints."""

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

    @abstractmethod
    def tweaks(self) -> Bottle:
        """Return the settings of the solver and such: pairs of a key and its value."""

    @abstractmethod
    def set_tweaks(self, tweaks: Bottle) -> None:
        """Set some of them."""

    # Contexts --------------------------------------------------------------------------------------------------------

    @abstractmethod
    def store_context(self) -> int:
        """Store all settings, and return the number under which ``restore_context`` finds them."""

    @abstractmethod
    def restore_context(self, context: int) -> None:
        """Restore settings; 0 are those of the start."""

    @abstractmethod
    def delete_contexts(self, contexts: Sequence[int]) -> None:
        """Forget stored settings; unknown numbers are ignored."""

    # Events ----------------------------------------------------------------------------------------------------------

    @abstractmethod
    def add_checkpoint(self, share: float) -> None:
        """Ask for an event ``motion-ongoing`` when a motion has done this share of its way, 0 to 1."""

    @abstractmethod
    def remove_checkpoint(self, share: float) -> None:
        """Take back what was asked for once. Raises RefusedError if it was not."""

    @abstractmethod
    def checkpoints(self) -> FloatArray:
        """Return the shares for which there will be events."""

    @abstractmethod
    def observe_events(self, observer: EventObserver) -> None:
        """Call a function with every event from now on."""

    @abstractmethod
    def unobserve_events(self, observer: EventObserver) -> None:
        """Stop calling a function; no error if it is unknown."""
