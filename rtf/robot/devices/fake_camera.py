"""A camera that generates its images from the time alone. It does not model noise, exposure or a lens."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.middleware.types import Image
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls

if TYPE_CHECKING:
    from rtf.bottle import Property

_MAX_SIDE = 8192
_BLUE = 2
#: The features and their initial values. The two of the white balance are those of red and of blue.
_FEATURES = {
    CameraFeature.BRIGHTNESS: (0.5,),
    CameraFeature.EXPOSURE: (0.5,),
    CameraFeature.WHITE_BALANCE: (0.5, 0.5),
    CameraFeature.HUE: (0.5,),
    CameraFeature.SATURATION: (0.5,),
    CameraFeature.GAMMA: (0.5,),
    CameraFeature.SHUTTER: (0.5,),
    CameraFeature.GAIN: (0.0,),
    CameraFeature.MIRROR: (0.0,),
}


class FakeFrameGrabber(Device, IFrameGrabber, IFrameGrabberControls):
    """``fakeFrameGrabber``: red increases to the right, green downwards; a blue line moves down one row per image.

    Parameters: ``width`` and ``height`` (default 320 and 240), ``period`` in seconds (default 0.033), ``horizontalFov``
    and ``verticalFov`` in deg. The line of image n is in row (n modulo height); image n is taken at n periods. The
    feature MIRROR changes the image; the others are only stored.
    """

    def open(self, configuration: Property) -> None:
        self._width = parameters.count(configuration, "width", 320, _MAX_SIDE)
        self._height = parameters.count(configuration, "height", 240, _MAX_SIDE)
        self.period = parameters.positive(configuration, "period", 0.033)
        angles = [parameters.positive(configuration, key, 60.0) for key in ("horizontalFov", "verticalFov")]
        self._field_of_view = (angles[0], angles[1])
        self._values = dict(_FEATURES)
        self._active = dict.fromkeys(_FEATURES, True)
        self._automatic = dict.fromkeys(_FEATURES, False)
        self._background = np.zeros((self._height, self._width, 3), np.uint8)
        self._background[:, :, 0] = np.linspace(0, 255, self._width).round()
        self._background[:, :, 1] = np.linspace(0, 255, self._height).round()[:, np.newaxis]

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def width(self) -> int:
        return self._width

    def height(self) -> int:
        return self._height

    def image(self) -> tuple[Image, float]:
        number = int(clock.current().now() / self.period)
        pixels = self._background.copy()
        pixels[number % self._height, :, _BLUE] = 255
        if self._values[CameraFeature.MIRROR][0]:
            pixels = np.ascontiguousarray(pixels[:, ::-1])
        return Image(pixels, "rgb"), number * self.period

    def field_of_view(self) -> tuple[float, float]:
        return self._field_of_view

    def camera_description(self) -> tuple[int, str]:
        return 0, "a camera that draws its images itself"

    def has_feature(self, feature: CameraFeature) -> bool:
        return feature in self._values

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        return self._values[self._known(feature)]

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        needed = len(self._values[self._known(feature)])
        if len(values) != needed or not all(0.0 <= value <= 1.0 for value in values):
            raise RefusedError(f"{self.name}: {feature.name} takes {needed} from 0 to 1, not {values}")
        self._values[feature] = tuple(map(float, values))

    def is_active(self, feature: CameraFeature) -> bool:
        return self._active[self._known(feature)]

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        self._active[self._known(feature)] = active

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._automatic[self._known(feature)]

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        self._automatic[self._known(feature)] = automatic

    def _known(self, feature: CameraFeature) -> CameraFeature:
        if feature not in self._values:
            raise NotSupportedError(f"{self.name} has no {CameraFeature(feature).name}")
        return feature
