"""Faults of depth cameras."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rtf.simulator.depth_cameras import SimulatedDepthCamera


class _DepthFault(Fault):
    layer = Layer.CAMERA
    target_kind = Target.DEPTH_CAMERA
    camera: SimulatedDepthCamera

    def aim(self) -> None:
        known = self.robot.depth_cameras
        if self.target not in known:
            there = ", ".join(known) or "none, or the robot was started without cameras"
            raise RefusedError(f"{self.kind}: there is no depth camera {self.target!r}; there are {there}")
        self.camera = known[self.target]

    def begin(self) -> None:
        self.camera.faults.append(self.show)

    def end(self) -> None:
        self.camera.faults.remove(self.show)

    def show(self, depth: NDArray[np.float32], now: float) -> NDArray[np.float32]:
        """Return the depths to be published instead."""
        raise NotImplementedError


class DepthFrozen(_DepthFault):
    """Repetition of the last depths of a depth camera."""

    kind = "depth_frozen"
    description = "The depth camera sends the same depths again and again, with new pictures."
    symptom = "Its depths have no noise."
    _held: NDArray[np.float32] | None = None

    def begin(self) -> None:
        self._held = None
        super().begin()

    def show(self, depth: NDArray[np.float32], now: float) -> NDArray[np.float32]:
        del now
        if self._held is None:
            self._held = depth
        return self._held


class DepthScale(_DepthFault):
    """Depths of a depth camera with a wrong scale."""

    kind = "depth_scale"
    description = "The depths have a wrong scale: the depth camera is badly calibrated, or its unit is another one."
    symptom = "The depth of a known place is wrong."
    parameters = (Parameter("factor", 0.9, "", "factor of the depths", 1e-3, 1e3, healthy=1.0),)
    factor: float

    def show(self, depth: NDArray[np.float32], now: float) -> NDArray[np.float32]:
        del now
        return (depth * self.factor).astype(depth.dtype)


KINDS = (DepthFrozen, DepthScale)
