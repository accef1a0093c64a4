"""Modes of joints: control modes, interaction modes, and faults."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from rtf.robot.interfaces.axes import AxisSelection

M = TypeVar("M", ControlMode, InteractionMode)


class IControlMode(ABC):
    """The control mode of each joint; the rules are those of :mod:`rtf.robot.control_modes`."""

    @abstractmethod
    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        """Return the present control modes of the joints."""

    @abstractmethod
    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """Request control modes, one for all the joints or one for each.

        A mode that users may not request is refused. One that the state of a joint forbids is ignored: read it back.
        """

    def control_mode(self, joint: int) -> ControlMode:
        """Return the control mode of one joint."""
        return self.control_modes(joint)[0]


class IInteractionMode(ABC):
    """The interaction mode of each joint, stiff or compliant, independent of its control mode."""

    @abstractmethod
    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """Return the interaction modes of the joints."""

    @abstractmethod
    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        """Set interaction modes, one for all the joints or one for each. A joint that cannot be compliant refuses."""

    def interaction_mode(self, joint: int) -> InteractionMode:
        """Return the interaction mode of one joint."""
        return self.interaction_modes(joint)[0]


class IJointFault(ABC):
    """The faults of joints."""

    @abstractmethod
    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        """Return the code and the text of the last fault of a joint; 0 and an empty text if there was none."""


def modes_for(count: int, modes: M | Sequence[M]) -> list[M]:
    """Return ``count`` modes: the given one for each, or the given ones. Raises RefusedError for another number."""
    if not isinstance(modes, Sequence):
        return [modes] * count
    if len(modes) != count:
        raise RefusedError(f"{count} modes are needed, not {len(modes)}")
    return list(modes)
