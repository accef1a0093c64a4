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
    """The categories of sensors, in the order of the messages."""

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
    """The status of a sensor."""

    OK = 0
    ERROR = 1
    OVERFLOW = 2
    TIMEOUT = 3
    WAITING_FOR_FIRST_READ = 4
    UNKNOWN = 5


class SensorInfo(NamedTuple):
    """The name of a sensor, and the frame it measures in."""

    name: str
    frame: str = ""
    metadata: str = ""


class SensorReading(NamedTuple):
    """A reading: values of shape (k,), in the units of the category, and the time in s of the robot's clock."""

    values: FloatArray
    time: float


class IMultipleAnalogSensors(ABC):
    """Sensors of several categories in one device."""

    @abstractmethod
    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        """Return the sensors of a category; their index in it identifies them."""

    @abstractmethod
    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """Return the status of a sensor."""

    @abstractmethod
    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """Return the latest reading. Raises RefusedError unless the status is OK, StaleStateError if it is too old."""


class IAnalogSensor(ABC):
    """The older interface: channels of numbers."""

    @abstractmethod
    def channels(self) -> int:
        """Return the number of channels."""

    @abstractmethod
    def read(self) -> SensorReading:
        """Read all channels. Errors as for ``IMultipleAnalogSensors.read_sensor``."""

    @abstractmethod
    def calibrate(self, channel: int | None = None, value: float | None = None) -> None:
        """Make the present value zero (or ``value``), of one channel or of all."""


class CameraFeature(IntEnum):
    """A feature of a camera."""

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
        """Return the pixels per row."""

    @abstractmethod
    def height(self) -> int:
        """Return the number of rows."""

    @abstractmethod
    def image(self) -> tuple[Image, float]:
        """Return the latest image, and its time (s, robot's clock)."""

    @abstractmethod
    def field_of_view(self) -> tuple[float, float]:
        """Return the horizontal and the vertical field of view in deg."""


class IFrameGrabberControls(ABC):
    """The features of a camera; values are fractions of the range, from 0 to 1."""

    @abstractmethod
    def camera_description(self) -> tuple[int, str]:
        """Return the kind of bus, and a text."""

    @abstractmethod
    def has_feature(self, feature: CameraFeature) -> bool:
        """Return whether the camera has a feature."""

    @abstractmethod
    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        """Return the value of a feature; two values for the white balance."""

    @abstractmethod
    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        """Set the value of a feature."""

    @abstractmethod
    def is_active(self, feature: CameraFeature) -> bool:
        """Return whether a feature is switched on."""

    @abstractmethod
    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        """Switch a feature on or off."""

    @abstractmethod
    def is_automatic(self, feature: CameraFeature) -> bool:
        """Return whether the camera controls a feature automatically."""

    @abstractmethod
    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        """Let the camera control a feature automatically, or not."""


class BatteryStatus(IntEnum):
    """The status of a battery, in the numbers of the messages."""

    STANDBY = 0
    CHARGING = 1
    IN_USE = 2
    ERROR = 3
    TIMEOUT = 4
    LOW = 5
    CRITICAL = 6


class IBattery(ABC):
    """A battery."""

    @abstractmethod
    def voltage(self) -> float:
        """Return the voltage at its terminals in V."""

    @abstractmethod
    def current(self) -> float:
        """Return the current in A: positive while the battery is discharged, negative while it is charged."""

    @abstractmethod
    def charge(self) -> float:
        """Return the charge in per cent, from 0, empty, to 100, full."""

    @abstractmethod
    def temperature(self) -> float:
        """Return the temperature in °C."""

    @abstractmethod
    def battery_status(self) -> BatteryStatus:
        """Return the status."""

    @abstractmethod
    def battery_info(self) -> str:
        """Return a description of the hardware, for people."""
