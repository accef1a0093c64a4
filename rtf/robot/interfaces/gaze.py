"""Gaze control: neck and eyes turn until both eyes look at a point.

Points are three numbers in the frame of the root (m). Angles are azimuth (to the right), elevation (up) and vergence,
in degrees, seen from the middle of the eyes. A pixel is (u, v) from the upper left corner of an eye's picture. Joints
are those of the head: pitch, roll and yaw of the neck, tilt, version and vergence of the eyes, in degrees.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

from rtf.robot.interfaces.task_control import ITaskControl

if TYPE_CHECKING:
    from rtf.bottle import Bottle
    from rtf.robot.interfaces.axes import FloatArray, Values
    from rtf.robot.interfaces.cartesian import CartesianPose

Eye: TypeAlias = Literal["left", "right"]
NeckAxis: TypeAlias = Literal["pitch", "roll", "yaw"]


class FixationPoint(NamedTuple):
    """A target: a point (m)."""

    point: Values


class GazeAngles(NamedTuple):
    """A target: azimuth, elevation and vergence (deg), relative to where the robot looks now or absolute."""

    azimuth: float
    elevation: float
    vergence: float
    relative: bool = False


class MonoPixel(NamedTuple):
    """A target: a pixel of one eye, at a depth along its axis (m)."""

    eye: Eye
    u: float
    v: float
    depth: float = 1.0


class MonoPixelWithVergence(NamedTuple):
    """A target: a pixel of one eye, as far away as a vergence (deg) says."""

    eye: Eye
    u: float
    v: float
    vergence: float


class StereoPixels(NamedTuple):
    """A target: the pixels (u, v) at which both eyes see it."""

    left: tuple[float, float]
    right: tuple[float, float]


GazeTarget: TypeAlias = FixationPoint | GazeAngles | MonoPixel | MonoPixelWithVergence | StereoPixels


class GazeMeasurement(NamedTuple):
    """Measured values, and their time in seconds of the robot's clock."""

    values: FloatArray
    time: float


class IGazeControl(ITaskControl):
    """Motions of neck and eyes, and what they keep to."""

    # Motions ---------------------------------------------------------------------------------------------------------

    @abstractmethod
    def look_at(self, target: GazeTarget) -> None:
        """Start to look at a target; return when the controller has it.

        A target out of reach is not refused: it is looked at as far as the joints allow. Raises RefusedError for what
        is no target, while the controller is suspended, and for a joint in fault.
        """

    @abstractmethod
    def stream_target(self, target: GazeTarget) -> None:
        """Start to look at a target, without an answer: for targets that follow each other."""

    @abstractmethod
    def saccade_done(self) -> bool:
        """Return whether no saccade, a jump of the eyes, is under way."""

    @abstractmethod
    def suspend(self) -> None:
        """Stop, and refuse targets until ``resume``; the joints are left alone, so that others can move them."""

    @abstractmethod
    def resume(self) -> None:
        """Take targets again."""

    @abstractmethod
    def status(self) -> str:
        """Return ``running`` or ``suspended``."""

    # State -----------------------------------------------------------------------------------------------------------

    @abstractmethod
    def fixation_point(self) -> GazeMeasurement:
        """Return the point at which the eyes look."""

    @abstractmethod
    def angles(self) -> GazeMeasurement:
        """Return azimuth, elevation and vergence of the fixation point, absolute."""

    @abstractmethod
    def joints(self) -> GazeMeasurement:
        """Return the positions of nine joints: torso pitch, roll and yaw (0 without a torso), and the head."""

    @abstractmethod
    def pose(self, part: Eye | Literal["head"]) -> CartesianPose:
        """Return the pose of an eye, or of the middle between the eyes as they look straight ahead."""

    @abstractmethod
    def desired(self) -> FloatArray:
        """Return where the joints of the head are to be (deg)."""

    @abstractmethod
    def joint_velocities(self) -> FloatArray:
        """Return the commanded speeds of the joints of the head (deg/s)."""

    @abstractmethod
    def pixel_of(self, eye: Eye, point: Values) -> FloatArray:
        """Return the pixel at which an eye sees a point. Raises RefusedError for a point behind the eye."""

    @abstractmethod
    def point_of(self, target: GazeTarget) -> FloatArray:
        """Return the point of a target (m)."""

    @abstractmethod
    def point_on_plane(self, eye: Eye, pixel: Values, plane: Values) -> FloatArray:
        """Return where what an eye sees at a pixel meets the plane ax + by + cz + d = 0, given by these numbers."""

    @abstractmethod
    def angles_of(self, point: Values) -> FloatArray:
        """Return the absolute angles of a point."""

    # Settings --------------------------------------------------------------------------------------------------------

    @abstractmethod
    def neck_trajectory_time(self) -> float:
        """Return the duration of motions of the neck (s)."""

    @abstractmethod
    def set_neck_trajectory_time(self, duration: float) -> None:
        """Set it; a controller may raise it."""

    @abstractmethod
    def eyes_trajectory_time(self) -> float:
        """Return the duration of motions of the eyes (s)."""

    @abstractmethod
    def set_eyes_trajectory_time(self, duration: float) -> None:
        """Set it; a controller may raise it."""

    @abstractmethod
    def vor_gain(self) -> float:
        """Return how much of a measured rotation of the head the eyes make up for (vestibulo-ocular reflex)."""

    @abstractmethod
    def set_vor_gain(self, gain: float) -> None:
        """Set it."""

    @abstractmethod
    def ocr_gain(self) -> float:
        """Return how much of a commanded rotation of the neck the eyes make up for (opto-kinetic response)."""

    @abstractmethod
    def set_ocr_gain(self, gain: float) -> None:
        """Set it."""

    @abstractmethod
    def saccades(self) -> bool:
        """Return whether the eyes jump to a target that is far away from where the head points."""

    @abstractmethod
    def set_saccades(self, saccades: bool) -> None:
        """Set it."""

    @abstractmethod
    def saccades_inhibition_period(self) -> float:
        """Return the shortest time between two saccades (s)."""

    @abstractmethod
    def set_saccades_inhibition_period(self, period: float) -> None:
        """Set it."""

    @abstractmethod
    def saccades_activation_angle(self) -> float:
        """Return how far a target is from the axis of the head for a saccade (deg)."""

    @abstractmethod
    def set_saccades_activation_angle(self, angle: float) -> None:
        """Set it."""

    @abstractmethod
    def neck_tolerance(self) -> float:
        """Return how near to the target the axis of the head has to be (deg); 0: the neck turns all the way."""

    @abstractmethod
    def set_neck_tolerance(self, tolerance: float) -> None:
        """Set it."""

    @abstractmethod
    def stabilization(self) -> bool:
        """Return whether neck and eyes are held against rotations that the inertial sensor measures."""

    @abstractmethod
    def set_stabilization(self, stabilization: bool) -> None:
        """Set it. Raises RefusedError without an inertial sensor."""

    @abstractmethod
    def stereo_options(self) -> Bottle:
        """Return the settings of the loop on streamed stereo pixels: lists of a key and its values."""

    @abstractmethod
    def set_stereo_options(self, options: Bottle) -> None:
        """Set some of them."""

    # Ranges ----------------------------------------------------------------------------------------------------------

    @abstractmethod
    def neck_range(self, axis: NeckAxis) -> tuple[float, float]:
        """Return within what limits a joint of the neck is moved (deg)."""

    @abstractmethod
    def bind_neck(self, axis: NeckAxis, minimum: float, maximum: float) -> None:
        """Set them, within those of the start; a joint with the same limits is blocked there."""

    @abstractmethod
    def clear_neck(self, axis: NeckAxis) -> None:
        """Allow the limits of the start again."""

    @abstractmethod
    def blocked_vergence(self) -> float | None:
        """Return the vergence of eyes that are bound (deg); None if they are free."""

    @abstractmethod
    def bind_eyes(self, vergence: float) -> None:
        """Keep the eyes straight ahead with a vergence (deg); one below 0 is ignored."""

    @abstractmethod
    def clear_eyes(self) -> None:
        """Let them move again."""
