"""The depth cameras of the simulated robot as devices: the picture and the depths of one rendering.

Only the thread with the graphics context can render, so each camera has a thread. It renders while the caller waits and
holds the lock. The depths have white noise; shadows of the projector, flying pixels at edges and the influence of
light and surfaces are not modelled.
"""

from __future__ import annotations

import zlib
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from rtf.middleware.types import Image
from rtf.robot.device import Device
from rtf.robot.interfaces import Intrinsics, IRgbdSensor, RgbdImages, RgbdPart, RgbdStatus
from rtf.robot.network.camera_optics import pinhole
from rtf.robot.sensors.rgbd import DEPTH_FORMAT
from rtf.simulator.cameras import Camera

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.file import DepthCamera
    from rtf.simulator.simulation import Simulation

#: The random numbers of each camera are its own, so the noise of other sensors does not depend on who sees its images.
_SEED = 0xD397


class SimulatedDepthCamera(Device, IRgbdSensor):
    """A depth camera at the place of a camera of the model. Raises RenderingError if the machine cannot render.

    The depth is 0 where nothing is between its clip planes.
    """

    def __init__(self, name: str, settings: DepthCamera, simulation: Simulation) -> None:
        super().__init__(name)
        self.settings = settings
        self._simulation = simulation
        #: Faults: each is called with the depths and the time, and returns the depths to be published.
        self.faults: list[Callable[[NDArray[np.float32], float], NDArray[np.float32]]] = []
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"rtf-depth {name}")
        size = settings.width, settings.height
        try:
            self._camera = self._thread.submit(Camera, simulation.plant.model, settings.camera, *size).result()
        except BaseException:
            self._thread.shutdown()
            raise
        self._begin_anew()
        simulation.on_reset.append(self._begin_anew)

    def _begin_anew(self) -> None:
        self._random = np.random.default_rng([self._simulation.seed, _SEED, zlib.crc32(self.name.encode())])

    def open(self, configuration: Property) -> None:
        """Do nothing: it is open from its construction."""

    def close(self) -> None:
        """Release the graphics context."""
        self._thread.submit(self._camera.close).result()
        self._thread.shutdown()

    def images(self) -> RgbdImages:
        """See IRgbdSensor: the scene as it is now."""
        settings = self.settings
        with self._simulation.lock:
            pixels, depth = self._thread.submit(self._camera.render_depth, self._simulation.data).result()
            now = self._simulation.now
            noise = self._random.standard_normal(depth.shape, dtype=np.float32)
        seen = (depth >= settings.near) & (depth <= settings.far)
        depth += np.float32(settings.noise) * noise
        np.clip(depth, settings.near, settings.far, out=depth)
        depth[~seen] = 0.0
        for fault in self.faults:
            depth = fault(depth, now)
        return RgbdImages(Image(pixels), Image(depth, DEPTH_FORMAT), now, now)

    def size(self, part: RgbdPart) -> tuple[int, int]:  # noqa: ARG002 - both are the same
        return self.settings.width, self.settings.height

    def field_of_view(self, part: RgbdPart) -> tuple[float, float]:  # noqa: ARG002
        return self._camera.field_of_view()

    def intrinsics(self, part: RgbdPart) -> Intrinsics:
        return pinhole(self.size(part), self.field_of_view(part))

    def clip_planes(self) -> tuple[float, float]:
        return self.settings.near, self.settings.far

    def depth_accuracy(self) -> float:
        return self.settings.accuracy

    def extrinsics(self) -> FloatArray:
        return np.eye(4)

    def rgbd_status(self) -> RgbdStatus:
        return RgbdStatus.IN_USE
