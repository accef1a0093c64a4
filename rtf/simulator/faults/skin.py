"""Faults of the skin."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target
from rtf.simulator.skin import LARGEST, TAXELS

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray, SensorCategory
    from rtf.simulator.skin import SimulatedSkin


_PAIR = 2  # triangles


class _SkinFault(Fault):
    """A fault of a patch: ``show`` changes its readings, whole numbers, in place."""

    layer = Layer.SENSOR
    target_kind = Target.SKIN
    skin: SimulatedSkin

    def aim(self) -> None:
        known = self.robot.skin
        if self.target not in known:
            raise RefusedError(
                f"{self.kind}: there is no patch of skin {self.target!r}; there are {', '.join(known) or 'none'}"
            )
        self.skin = known[self.target]

    def begin(self) -> None:
        self.skin.faults.append(self.show)

    def end(self) -> None:
        self.skin.faults.remove(self.show)

    @abstractmethod
    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        """Change the readings."""


class TaxelDead(_SkinFault):
    """Constant reading of one taxel."""

    kind = "taxel_dead"
    description = "A taxel of the skin is dead: its trace is broken, or its cell of the chip."
    symptom = "Its reading has no noise, and does not fall when it is pressed."
    parameters = (
        Parameter("place", 0.5, "", "where it is in the patch: 0 the first taxel, 1 the last", 0.0, 1.0, healthy=None),
    )
    place: float
    _held: float | None = None

    def aim(self) -> None:
        super().aim()
        self.taxel = round(self.place * (self.skin.channels() - 1))

    def begin(self) -> None:
        self._held = None
        super().begin()

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        if self._held is None:
            self._held = float(values[self.taxel])
        values[self.taxel] = self._held


class SkinNoise(_SkinFault):
    """Noise of a patch of skin."""

    kind = "skin_noise"
    description = "A patch of skin is noisy: its ground is loose, or its cable is disturbed."
    symptom = "The readings of its taxels jump although nothing touches them."
    parameters = (Parameter("deviation", 10.0, "count", "standard deviation of each reading", 0.0, 255.0),)
    deviation: float

    def begin(self) -> None:
        self._random = self.own_random(*self.target.encode())
        super().begin()

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values += np.rint(self._random.normal(0.0, self.deviation, values.shape))
        np.clip(values, 0.0, LARGEST, out=values)


class SkinRepeated(_SkinFault):
    """Triangle of skin that shows what another one does."""

    kind = "skin_repeated"
    description = "Two triangles of skin have the same address, or the board sends one of them twice."
    symptom = "Both show the same at all times; one of them does not feel what touches it."
    parameters = (
        Parameter(
            "place", 0.5, "", "where it is in the patch: 0 the second triangle, 1 the last", 0.0, 1.0, healthy=None
        ),
    )
    place: float

    def aim(self) -> None:
        super().aim()
        triangles = self.skin.channels() // TAXELS
        if triangles < _PAIR:
            raise RefusedError(f"{self.kind}: {self.target} has one triangle only")
        self.first = TAXELS * (1 + round(self.place * (triangles - _PAIR)))

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values[self.first : self.first + TAXELS] = values[self.first - TAXELS : self.first]


KINDS = (TaxelDead, SkinNoise, SkinRepeated)
