"""Modes of joints: how they are controlled, how they react to who pushes them, and what is wrong with them."""

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
        """The modes that the joints are in now."""

    @abstractmethod
    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """Ask for modes, one for all the joints or one for each.

        A mode that nobody may ask for is refused. One that the state of a joint forbids is ignored: read it back.
        """

    def control_mode(self, joint: int) -> ControlMode:
        """The mode of one joint."""
        return self.control_modes(joint)[0]


class IInteractionMode(ABC):
    """Stiff or compliant, for each joint, whatever its control mode."""

    @abstractmethod
    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """The interaction modes of the joints."""

    @abstractmethod
    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        """Set them, one for all the joints or one for each. A joint that cannot be compliant refuses it."""

    def interaction_mode(self, joint: int) -> InteractionMode:
        """The interaction mode of one joint."""
        return self.interaction_modes(joint)[0]


class IJointFault(ABC):
    """What is wrong with a joint."""

    @abstractmethod
    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        """The code and the sentence of the last fault of a joint; 0 and nothing when there was none."""


def modes_for(count: int, modes: M | Sequence[M]) -> list[M]:
    """So many modes: the one that is given for each, or those that are. Raises RefusedError for another number."""
    if not isinstance(modes, Sequence):
        return [modes] * count
    if len(modes) != count:
        raise RefusedError(f"{count} modes are needed, {len(modes)} were given")
    return list(modes)
