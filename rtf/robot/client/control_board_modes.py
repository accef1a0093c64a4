"""The client of a control board: modes, and what is wrong with joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Value, Vocab
from rtf.robot.client.questions import SETTING
from rtf.robot.client.stub import BoardStub
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import IControlMode, IInteractionMode, IJointFault

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.robot.interfaces import AxisSelection

_CONTROL_MODES: Mapping[int, ControlMode] = {int(mode): mode for mode in ControlMode}
_INTERACTION_MODES: Mapping[int, InteractionMode] = {int(mode): mode for mode in InteractionMode}


class ModesStub(BoardStub, IControlMode, IInteractionMode, IJointFault):
    """Modes that are read are those of the last state; a number that is none is the unknown mode.

    What was set shows when the next state has come, which takes the board's period and its way.
    """

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        """See IControlMode."""
        numbers = self._link.state.read(Field.CONTROL_MODES, joints).tolist()
        return tuple([_CONTROL_MODES.get(number, ControlMode.UNKNOWN) for number in numbers])

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """See IControlMode."""
        self._put(SETTING["set_control_modes"], self._one_for_each(modes, joints), joints)

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """See IInteractionMode."""
        numbers = self._link.state.read(Field.INTERACTION_MODES, joints).tolist()
        return tuple([_INTERACTION_MODES.get(number, InteractionMode.UNKNOWN) for number in numbers])

    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        """See IInteractionMode."""
        self._put(SETTING["set_interaction_modes"], self._one_for_each(modes, joints), joints)

    def last_joint_fault(self, joint: int) -> tuple[int, str]:
        """See IJointFault."""
        code, text = self._get_of("last_joint_fault", joint)
        return code, text

    def _one_for_each(self, modes: int | Sequence[int], joints: AxisSelection) -> list[Value]:
        """The words of modes. Raises RefusedError for another number of them."""
        count = len(self._chosen(joints))
        given = [modes] * count if isinstance(modes, int) else [*modes]
        if len(given) != count:
            raise RefusedError(f"{self._link.settings.remote}: {count} modes are needed, {len(given)} were given")
        return [Vocab(int(mode)) for mode in given]
