"""A film of the demonstration: the robot from outside, with what its left eye sees, as an animated WebP.

The view from outside is drawn from recorded positions, by a model of the robot; it needs the packages of the simulator.
"""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING, NamedTuple

from PIL import Image

from rtf.robot.model.engine import mujoco
from rtf.simulator.ball import find_ball
from rtf.simulator.cameras import Camera
from rtf.simulator.plant import Options, build
from rtf.simulator.scene import OUTSIDE
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel

_WIDTH, _HEIGHT = 480, 360
#: The picture of the eye in the corner of the film (px).
_INSET = (160, 120)
_QUALITY = 70


class Scene(NamedTuple):
    """A moment: the positions of joints (deg) by their names, the ball (m), and the picture of the left eye, if any."""

    positions: Mapping[str, float]
    ball: FloatArray
    eye: NDArray[np.uint8] | None


def film_of(scenes: Sequence[Scene], robot: RobotModel, period: float) -> bytes:
    """Return the film of scenes that are ``period`` s apart. Raises MissingPackageError and RenderingError."""
    plant = build(robot, Options(collision="none", cameras=True))
    simulation = Simulation(plant)
    ball = find_ball(simulation)
    frames = []
    with Camera(plant.model, OUTSIDE, _WIDTH, _HEIGHT) as camera:
        for scene in scenes:
            axes = plant.home_axes.copy()
            for name, position in scene.positions.items():
                axes[robot.index[name]] = position * robot.axis(name).internal
            simulation.data.qpos[:] = plant.pose(axes)
            mujoco().mj_forward(plant.model, simulation.data)
            if ball is not None:
                ball.move(scene.ball.tolist())
            frames.append(_frame(camera.render(simulation.data), scene.eye))
    written = io.BytesIO()
    duration = math.floor(period * 1000.0)
    frames[0].save(
        written, "WEBP", save_all=True, append_images=frames[1:], duration=duration, loop=0, quality=_QUALITY, method=2
    )
    return written.getvalue()


def _frame(outside: NDArray[np.uint8], eye: NDArray[np.uint8] | None) -> Image.Image:
    frame = Image.fromarray(outside)
    if eye is not None:
        frame.paste(Image.fromarray(eye).resize(_INSET), (_WIDTH - _INSET[0], 0))
    return frame
