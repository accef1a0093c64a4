"""Depth cameras: a picture in colours and the depth of each of its pixels."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum, IntEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rtf.middleware.types.image import Image
    from rtf.robot.interfaces.axes import FloatArray


class RgbdPart(Enum):
    """The two cameras of a depth camera."""

    COLOUR = "colour"
    DEPTH = "depth"


class RgbdStatus(IntEnum):
    """The status of a depth camera, in the numbers of the messages."""

    NOT_READY = 0
    STANDBY = 1
    IN_USE = 2
    COLOUR_ERROR = 3
    DEPTH_ERROR = 4
    ERROR = 5
    TIMEOUT = 6


class Intrinsics(NamedTuple):
    """The parameters of a pinhole camera in pixels; the middle of the top left pixel is at (0, 0).

    A point at (x, y, z), x to the right, y down, z away from the camera, is seen at the pixel
    (focal_x * x / z + centre_x, focal_y * y / z + centre_y). ``distortion`` has k1, k2, t1, t2 and k3 of the model
    ``plumb_bob``.
    """

    focal_x: float
    focal_y: float
    centre_x: float
    centre_y: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


class RgbdImages(NamedTuple):
    """A picture, and the depth along the optical axis in m, format ``dec``; 0 where there is no measurement.

    The times are in s of the robot's clock.
    """

    colour: Image
    depth: Image
    colour_time: float
    depth_time: float


class IRgbdOptics(ABC):
    """All of a depth camera but its images."""

    @abstractmethod
    def size(self, part: RgbdPart) -> tuple[int, int]:
        """Return the pixels of a row, and the number of rows."""

    @abstractmethod
    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:
        """Return the horizontal and the vertical field of view in deg."""

    @abstractmethod
    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        """Return the parameters of the projection."""

    @abstractmethod
    def clip_planes(self) -> tuple[float, float]:
        """Return the least and the greatest depth that is measured, in m."""

    @abstractmethod
    def depth_accuracy(self) -> float:
        """Return the accuracy of the depth in m."""

    @abstractmethod
    def extrinsics(self) -> FloatArray:
        """Return the pose of the depth camera in the frame of the colour camera, shape (4, 4), in m."""

    @abstractmethod
    def rgbd_status(self) -> RgbdStatus:
        """Return the status."""


class IRgbdSensor(IRgbdOptics):
    """A depth camera."""

    @abstractmethod
    def images(self) -> RgbdImages:
        """Return the latest picture with its depth."""
