"""Faults of the skin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray, SensorCategory
    from rtf.simulator.skin import SimulatedSkin


class TaxelDead(Fault):
    """Constant reading of one taxel."""

    kind = "taxel_dead"
    layer = Layer.SENSOR
    target_kind = Target.SKIN
    description = "A taxel of the skin is dead: its trace is broken, or its cell of the chip."
    symptom = "Its reading has no noise, and does not fall when it is pressed."
    parameters = (
        Parameter("place", 0.5, "", "where it is in the patch: 0 the first taxel, 1 the last", 0.0, 1.0, healthy=None),
    )
    place: float
    skin: SimulatedSkin
    _held: float | None = None

    def aim(self) -> None:
        known = self.robot.skin
        if self.target not in known:
            raise RefusedError(
                f"{self.kind}: there is no patch of skin {self.target!r}; there are {', '.join(known) or 'none'}"
            )
        self.skin = known[self.target]
        self.taxel = round(self.place * (self.skin.channels() - 1))

    def begin(self) -> None:
        self._held = None
        self.skin.faults.append(self.show)

    def end(self) -> None:
        self.skin.faults.remove(self.show)

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        """Replace the reading of the taxel by its first one."""
        del name, category, now
        if self._held is None:
            self._held = float(values[self.taxel])
        values[self.taxel] = self._held


KINDS = (TaxelDead,)
