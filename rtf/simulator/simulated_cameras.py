"""The cameras of the simulated robot as devices.

Only the thread with the graphics context can render, so each camera has a thread. It renders while the caller waits and
holds the lock.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from rtf.middleware.types import Image
from rtf.robot.device import Device
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.simulator.cameras import Camera

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.simulator.simulation import Simulation

_FEATURES = (CameraFeature.BRIGHTNESS, CameraFeature.GAIN)
_FULL = 255.0


class SimulatedCamera(Device, IFrameGrabber, IFrameGrabberControls):
    """A camera of the model. Raises RenderingError if the machine cannot render."""

    def __init__(self, name: str, simulation: Simulation, *, width: int = 320, height: int = 240) -> None:
        super().__init__(name)
        self._simulation = simulation
        self._size = width, height
        self._settings = dict.fromkeys(_FEATURES, 0.5)
        #: Faults: each is called with a picture and the time, and returns the picture to be published.
        self.faults: list[Callable[[NDArray[np.uint8], float], NDArray[np.uint8]]] = []
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"rtf-camera {name}")
        try:
            self._camera = self._thread.submit(Camera, simulation.plant.model, name, width, height).result()
        except BaseException:
            self._thread.shutdown()
            raise

    def open(self, configuration: Property) -> None:
        """Do nothing: it is open from its construction."""

    def close(self) -> None:
        """Release the graphics context."""
        self._thread.submit(self._camera.close).result()
        self._thread.shutdown()

    def width(self) -> int:
        return self._size[0]

    def height(self) -> int:
        return self._size[1]

    def picture(self) -> tuple[NDArray[np.uint8], float]:
        """Return the scene as it is now, and the time; without faults."""
        with self._simulation.lock:
            pixels = self._thread.submit(self._camera.render, self._simulation.data).result()
            now = self._simulation.now
        return self._exposed(pixels), now

    def image(self) -> tuple[Image, float]:
        """See IFrameGrabber: the scene as it is now."""
        pixels, now = self.picture()
        for fault in self.faults:
            pixels = fault(pixels, now)
        return Image(pixels), now

    def _exposed(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        factor = 4.0 * self._settings[CameraFeature.BRIGHTNESS] * self._settings[CameraFeature.GAIN]
        if factor == 1.0:
            return pixels
        return (pixels * factor).clip(0.0, _FULL).astype(pixels.dtype)

    def field_of_view(self) -> tuple[float, float]:
        return self._camera.field_of_view()

    # IFrameGrabberControls

    def camera_description(self) -> tuple[int, str]:
        return 0, f"simulated camera {self.name}"

    def has_feature(self, feature: CameraFeature) -> bool:
        return feature in _FEATURES

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        return (self._settings[self._known(feature)],)

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        if len(values) != 1 or not 0.0 <= values[0] <= 1.0:
            raise RefusedError(f"{self.name}: {feature.name} must be one value from 0 to 1, not {values}")
        self._settings[self._known(feature)] = values[0]

    def is_active(self, feature: CameraFeature) -> bool:
        return self._known(feature) is feature

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        if self._known(feature) is feature and not active:
            raise RefusedError(f"{self.name}: {feature.name} cannot be switched off")

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._known(feature) is not feature

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        if self._known(feature) is feature and automatic:
            raise RefusedError(f"{self.name}: {feature.name} has no automatic setting")

    def _known(self, feature: CameraFeature) -> CameraFeature:
        if feature not in _FEATURES:
            raise RefusedError(f"{self.name} has no {CameraFeature(feature).name}")
        return feature
