"""A camera of a simulated robot as a device of a robot configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import as_string
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError
from rtf.robot.interfaces import IFrameGrabber, IFrameGrabberControls
from rtf.simulator.attachment import simulating
from rtf.simulator.simulated_cameras import SimulatedCamera

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property
    from rtf.middleware.types import Image
    from rtf.robot.interfaces import CameraFeature


class SimulatedCameraDevice(Device, IFrameGrabber, IFrameGrabberControls):
    """``simulatedCamera``: the camera that ``sensor`` names, as ``[sensors.cameras]`` of the robot does.

    The simulated robot that it is attached to has to have ``cameras``.
    """

    _name = ""
    _camera: SimulatedCamera | None = None

    def open(self, configuration: Property) -> None:
        self._name = as_string(configuration.find("sensor"))

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Attach the device to a simulated robot. Raises DeviceError if that does not have this camera."""
        known = simulating(self, devices).devices(SimulatedCamera)
        if self._name not in known:
            there = ", ".join(known) or "none; see the parameter cameras of simulatedRobot"
            raise DeviceError(f"{self.name}: the robot has no camera {self._name!r}; it has {there}")
        self._camera = known[self._name]

    def detach(self) -> None:
        self._camera = None

    def close(self) -> None:
        self.detach()

    def _attached(self) -> SimulatedCamera:
        if self._camera is None:
            raise DeviceError(f"{self.name} is attached to no simulated robot; its action 'attach' comes first")
        return self._camera

    def width(self) -> int:
        return self._attached().width()

    def height(self) -> int:
        return self._attached().height()

    def image(self) -> tuple[Image, float]:
        return self._attached().image()

    def field_of_view(self) -> tuple[float, float]:
        return self._attached().field_of_view()

    def camera_description(self) -> tuple[int, str]:
        return self._attached().camera_description()

    def has_feature(self, feature: CameraFeature) -> bool:
        return self._attached().has_feature(feature)

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        return self._attached().feature(feature)

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        self._attached().set_feature(feature, *values)

    def is_active(self, feature: CameraFeature) -> bool:
        return self._attached().is_active(feature)

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        self._attached().set_active(feature, active=active)

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._attached().is_automatic(feature)

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        self._attached().set_automatic(feature, automatic=automatic)
