"""The red ball of a simulated scene, which cameras see and nothing touches.

It can be moved, resized, coloured and hidden at any time. It takes no part in the mechanics, so a robot moves the same
to the last bit wherever the ball is.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.model.engine import mujoco
from rtf.simulator.scene import BALL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.simulation import Simulation

#: The greatest coordinate and the radii of a ball (m).
FARTHEST = 10.0
SMALLEST, LARGEST = 0.001, 0.5
_COLOURS = 3


class Ball:
    """The ball of a simulation. Its place is that of its centre in the frame of the robot's root (m).

    A reset of the simulation brings it back to what it was at the start. Methods may be called in any thread; they
    raise RefusedError for values that a ball cannot have.
    """

    def __init__(self, simulation: Simulation, index: int) -> None:
        self._simulation = simulation
        self._index = index
        model = simulation.plant.model
        self._start = [array[index].copy() for array in self._arrays(model)]
        self._colour = model.geom_rgba[index].copy()
        simulation.on_reset.append(self._restore)

    @staticmethod
    def _arrays(model: Any) -> tuple[Any, ...]:
        return model.geom_pos, model.geom_size, model.geom_rbound, model.geom_rgba

    def _restore(self) -> None:
        """Called with the lock held."""
        for array, values in zip(self._arrays(self._simulation.plant.model), self._start, strict=True):
            array[self._index] = values

    @property
    def there(self) -> bool:
        """Whether it is visible."""
        return bool(self._simulation.plant.model.geom_rgba[self._index, 3] > 0.0)

    @property
    def place(self) -> FloatArray:
        """The place of its centre."""
        with self._simulation.lock:
            place: FloatArray = self._simulation.plant.model.geom_pos[self._index].copy()
        return place

    @property
    def radius(self) -> float:
        """Its radius (m)."""
        return float(self._simulation.plant.model.geom_size[self._index, 0])

    def move(self, place: Sequence[float]) -> None:
        """Put it elsewhere. Pictures that are taken from now on show it there."""
        values = place_of_ball(place)
        with self._simulation.lock:
            self._simulation.plant.model.geom_pos[self._index] = values
            self._simulation.data.geom_xpos[self._index] = values

    def show(self, place: Sequence[float], radius: float, colour: Sequence[float] = ()) -> None:
        """Make it visible at a place, with a radius (m) and a colour (red, green, blue from 0 to 1; else its own)."""
        if not SMALLEST <= radius <= LARGEST:
            raise RefusedError(f"the radius of a ball is from {SMALLEST:g} to {LARGEST:g} m, not {radius:g}")
        if colour and not (len(colour) == _COLOURS and all(0.0 <= one <= 1.0 for one in colour)):
            raise RefusedError(f"a colour is three numbers from 0 to 1, not {' '.join(f'{one:g}' for one in colour)}")
        place_of_ball(place)
        model = self._simulation.plant.model
        with self._simulation.lock:
            model.geom_size[self._index, 0] = model.geom_rbound[self._index] = radius
            model.geom_rgba[self._index] = [*colour, 1.0] if colour else self._colour
            self.move(place)

    def hide(self) -> None:
        """Make it invisible."""
        with self._simulation.lock:
            self._simulation.plant.model.geom_rgba[self._index, 3] = 0.0


def find_ball(simulation: Simulation) -> Ball | None:
    """Return the ball of a simulation; None if its scene has none."""
    index = mujoco().mj_name2id(simulation.plant.model, mujoco().mjtObj.mjOBJ_GEOM, BALL)
    return None if index < 0 else Ball(simulation, index)


def place_of_ball(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the place of a ball of three numbers (m). Raises RefusedError."""
    place = np.asarray(values, dtype=np.float64)
    if place.shape != (3,) or not all(math.isfinite(one) and abs(one) <= FARTHEST for one in place):
        shown = " ".join(f"{one:g}" for one in place.ravel()[:4])
        raise RefusedError(
            f"the place of a ball is three numbers from {-FARTHEST:g} to {FARTHEST:g} m, not {shown or 'nothing'}"
        )
    x, y, z = place.tolist()
    return x, y, z
