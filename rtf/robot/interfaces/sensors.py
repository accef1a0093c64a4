"""Sensors: analog ones of all categories, cameras, batteries."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.types.image import Image
    from rtf.robot.interfaces.axes import FloatArray


class SensorCategory(IntEnum):
    """The kinds of sensors, in the order in which they travel."""

    GYROSCOPE = 0  # deg/s
    ACCELEROMETER = 1  # m/s²
    MAGNETOMETER = 2  # T
    ORIENTATION = 3  # roll, pitch, yaw in deg
    TEMPERATURE = 4  # °C
    FORCE_TORQUE = 5  # N, Nm
    CONTACT_LOAD_CELLS = 6
    ENCODER_ARRAY = 7
    SKIN_PATCH = 8
    POSITION = 9  # m
    LINEAR_VELOCITY = 10  # m/s
    ANGULAR_ACCELEROMETER = 11  # rad/s²


class SensorStatus(IntEnum):
    """How a sensor is."""

    OK = 0
    ERROR = 1
    OVERFLOW = 2
    TIMEOUT = 3
    WAITING_FOR_FIRST_READ = 4
    UNKNOWN = 5


class SensorInfo(NamedTuple):
    """What a sensor is called, and the frame it measures in."""

    name: str
    frame: str = ""
    metadata: str = ""


class SensorReading(NamedTuple):
    """What a sensor measured: shape (k,), in the units of its category, and when, by the robot's clock (s)."""

    values: FloatArray
    time: float


class IMultipleAnalogSensors(ABC):
    """Sensors of several categories in one device."""

    @abstractmethod
    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        """The sensors of a category; they are read by their place in it."""

    @abstractmethod
    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """How one is."""

    @abstractmethod
    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """What one measured last. Raises RefusedError unless its status is OK, StaleStateError when it is too old."""


class IAnalogSensor(ABC):
    """The older interface: channels of numbers."""

    @abstractmethod
    def channels(self) -> int:
        """How many there are."""

    @abstractmethod
    def read(self) -> SensorReading:
        """All channels. Errors as for ``IMultipleAnalogSensors.read_sensor``."""

    @abstractmethod
    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        """Make what is measured now the zero (or ``value``), of one channel or of all."""


class CameraFeature(IntEnum):
    """What may be set on a camera."""

    BRIGHTNESS = 0
    EXPOSURE = 1
    SHARPNESS = 2
    WHITE_BALANCE = 3
    HUE = 4
    SATURATION = 5
    GAMMA = 6
    SHUTTER = 7
    GAIN = 8
    IRIS = 9
    FOCUS = 10
    TEMPERATURE = 11
    TRIGGER = 12
    TRIGGER_DELAY = 13
    WHITE_SHADING = 14
    FRAME_RATE = 15
    ZOOM = 16
    PAN = 17
    TILT = 18
    OPTICAL_FILTER = 19
    CAPTURE_SIZE = 20
    CAPTURE_QUALITY = 21
    MIRROR = 22


class IFrameGrabber(ABC):
    """A camera."""

    @abstractmethod
    def width(self) -> int:
        """Pixels in a row."""

    @abstractmethod
    def height(self) -> int:
        """Rows."""

    @abstractmethod
    def image(self) -> tuple[Image, float]:
        """The newest image, and when it was taken (s, robot's clock)."""

    @abstractmethod
    def field_of_view(self) -> tuple[float, float]:
        """The horizontal and the vertical field of view in deg."""


class IFrameGrabberControls(ABC):
    """What may be set on a camera; values are fractions of the range, from 0 to 1."""

    @abstractmethod
    def camera_description(self) -> tuple[int, str]:
        """The kind of bus, and a text."""

    @abstractmethod
    def has_feature(self, feature: CameraFeature) -> bool:
        """Whether it has it."""

    @abstractmethod
    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        """The value, or the two of the white balance."""

    @abstractmethod
    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        """Change it."""

    @abstractmethod
    def is_active(self, feature: CameraFeature) -> bool:
        """Whether it is switched on."""

    @abstractmethod
    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        """Switch it on or off."""

    @abstractmethod
    def is_automatic(self, feature: CameraFeature) -> bool:
        """Whether the camera sets it by itself."""

    @abstractmethod
    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        """Let it, or not."""


class IBattery(ABC):
    """The battery: V, A, per cent of charge, °C."""

    @abstractmethod
    def voltage(self) -> float:
        """What it gives."""

    @abstractmethod
    def current(self) -> float:
        """What is drawn."""

    @abstractmethod
    def charge(self) -> float:
        """How full it is."""

    @abstractmethod
    def temperature(self) -> float:
        """How warm it is."""
