"""Faults of the wiring: connectors of two axes that were exchanged."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.simulator.faults.base import AxisFault, Layer, Parameter
from rtf.simulator.faults.mechanics import MotorFault

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.motors import Windings


class _Swapped(AxisFault):
    """Exchanged connectors of a joint and of the joint ``by`` numbers farther in the same part."""

    parameters = (
        Parameter("by", 1.0, "", "how many joints farther in the part the other one is", -3.0, 3.0, healthy=None),
    )
    by: float

    def aim(self) -> None:
        super().aim()
        axes = self.robot.model.axes
        self.other = self.axis + round(self.by)
        inside = 0 <= self.other < len(axes) and axes[self.other].part == axes[self.axis].part
        if not inside or self.other == self.axis:
            raise RefusedError(
                f"{self.kind}: {self.by:g} joints farther than {self.target} is no other one of its part"
            )

    @property
    def axes(self) -> NDArray[np.intp]:
        """The indices of both."""
        return np.array([self.axis, self.other])

    def swap(self, values: FloatArray) -> None:
        """Exchange the values of both in place."""
        values[self.axes] = values[self.axes[::-1]]


class EncodersSwapped(_Swapped):
    """Exchanged joint encoders."""

    kind = "encoders_swapped"
    layer = Layer.ENCODER
    description = "The connectors of two joint encoders are exchanged: each joint shows the position of the other."
    symptom = "The encoder of a joint stands still while its motor turns it, and that of the other joint moves."

    def begin(self) -> None:
        self.boards.encoder_faults.append(self.show)
        self._power_up()

    def end(self) -> None:
        self.boards.encoder_faults.remove(self.show)
        self._power_up()

    def _power_up(self) -> None:
        """Let the controllers hold the positions that are shown now: connectors are not exchanged under power."""
        self.boards.hold_as_shown(self.axes)

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        """Change the measurements (deg, deg/s) in place."""
        del now
        self.swap(position)
        self.swap(velocity)


class MotorEncodersSwapped(_Swapped):
    """Exchanged motor encoders."""

    kind = "motor_encoders_swapped"
    layer = Layer.ENCODER
    description = "The connectors of two motor encoders are exchanged: each motor shows the turns of the other."
    symptom = "The encoder of a motor stands still while its joint moves, and that of the other motor turns."

    def begin(self) -> None:
        self.among.append(self.show)

    def end(self) -> None:
        self.among.remove(self.show)

    @property
    def among(self) -> list[Callable[[FloatArray, FloatArray, float], None]]:
        """The active faults of motor encoders."""
        return self.boards.motor_encoder_faults

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        """Change the measurements (deg, deg/s) in place."""
        del now
        self.swap(position)
        self.swap(velocity)


class MotorsSwapped(_Swapped, MotorFault):
    """Exchanged motors."""

    kind = "motors_swapped"
    description = "The connectors of two motors are exchanged: each amplifier drives the motor of the other."
    symptom = "A joint that is commanded stands still, and another one moves."

    def change(self, windings: Windings) -> None:
        """Exchange the motors of both amplifiers."""
        windings.connected[self.axes] = windings.connected[self.axes[::-1]]


KINDS = (EncodersSwapped, MotorEncodersSwapped, MotorsSwapped)
