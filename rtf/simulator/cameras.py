"""Pictures and depths from the robot's eyes, and from a camera in front of the robot.

Cost in software, for 320x240: a few milliseconds with the light covers that ``Options(cameras=True)`` gives; shadows
would make it a hundred.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rtf.robot.model.engine import mujoco
from rtf.simulator.rendering import make_context

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MAX_GEOMS = 500


class Camera:
    """A camera of a model, which renders pictures of a state.

    It belongs to the thread that makes it: all calls, close() included, must come from that thread. Raises
    RenderingError if the machine cannot render, ValueError for a camera that the model does not have or a picture that
    is too large.
    """

    def __init__(self, model: Any, name: str, width: int, height: int) -> None:
        engine = mujoco()
        self._index = engine.mj_name2id(model, engine.mjtObj.mjOBJ_CAMERA, name)
        if self._index < 0:
            known = ", ".join(model.camera(number).name for number in range(model.ncam))
            raise ValueError(f"the model has no camera {name!r}; there are {known or 'none'}")
        largest = (model.vis.global_.offwidth, model.vis.global_.offheight)
        if not (0 < width <= largest[0] and 0 < height <= largest[1]):
            raise ValueError(f"camera {name}: a picture of {width}x{height} is not within {largest[0]}x{largest[1]}")
        self.name = name
        self.width = width
        self.height = height
        self._model = model
        self._gl = make_context(width, height)
        self._gl.make_current()
        self._context = engine.MjrContext(model, engine.mjtFontScale.mjFONTSCALE_100)
        engine.mjr_setBuffer(engine.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._prepare(engine)

    def _prepare(self, engine: Any) -> None:
        self._scene = engine.MjvScene(self._model, _MAX_GEOMS)
        for flag in (engine.mjtRndFlag.mjRND_SHADOW, engine.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = 0
        self._view = engine.MjvCamera()
        self._view.type = engine.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = self._index
        self._option = engine.MjvOption()
        self._area = engine.MjrRect(0, 0, self.width, self.height)
        self._pixels = np.empty((self.height, self.width, 3), dtype=np.uint8)

    def render(self, data: Any) -> NDArray[np.uint8]:
        """Render a picture: RGB, shape (height, width, 3), top row first.

        ``data`` must have been forwarded, and must not be stepped meanwhile.
        """
        self._draw(data)
        mujoco().mjr_readPixels(self._pixels, None, self._area, self._context)
        return np.ascontiguousarray(self._pixels[::-1])

    def render_depth(self, data: Any) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Render a picture, and the depth of its pixels along the optical axis in m, shape (height, width).

        Where nothing is in sight the depth is that of the far plane of the model.
        """
        engine = mujoco()
        self._context.readDepthMap = engine.mjtDepthMap.mjDEPTH_ZEROFAR
        self._draw(data)
        buffer = np.empty((self.height, self.width), dtype=np.float32)
        engine.mjr_readPixels(self._pixels, buffer, self._area, self._context)
        # The buffer has 1 at the near plane, 0 at the far one, and is linear in 1 / depth.
        extent, planes = float(self._model.stat.extent), self._model.vis.map
        near, far = float(planes.znear) * extent, float(planes.zfar) * extent
        depth = near * far / (buffer[::-1].astype(np.float64) * (far - near) + near)
        return np.ascontiguousarray(self._pixels[::-1]), depth.astype(np.float32)

    def _draw(self, data: Any) -> None:
        engine = mujoco()
        self._gl.make_current()
        everything = engine.mjtCatBit.mjCAT_ALL
        engine.mjv_updateScene(self._model, data, self._option, None, self._view, everything, self._scene)
        engine.mjr_render(self._area, self._scene, self._context)

    def field_of_view(self) -> tuple[float, float]:
        """The horizontal and the vertical field of view, in deg."""
        vertical = math.radians(float(self._model.cam_fovy[self._index]))
        horizontal = 2 * math.atan(math.tan(vertical / 2) * self.width / self.height)
        return math.degrees(horizontal), math.degrees(vertical)

    def close(self) -> None:
        """Release the graphics memory. A second call does nothing."""
        if self._gl is None:
            return
        self._gl.make_current()
        self._context.free()
        self._gl.free()
        self._gl = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
