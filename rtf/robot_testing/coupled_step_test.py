"""Step tests in effort modes, on boards that change the mode of all coupled joints together.

In an effort mode (torque, current, duty cycle) no position controller holds a joint. Many boards put the joints that
share motors with it into that mode, too. Each of those is commanded the effort it had before, or an effort that the
subclass chooses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.routines import until
from rtf.robot_testing.motion.start_position import bringing
from rtf.robot_testing.step_test import StepTest

if TYPE_CHECKING:
    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.motion.routines import Routine

#: Time for a board to report its mode, s.
_MODE_TIME = 0.2
#: Greatest displacement of such a joint, deg; and tolerance of its move back, deg.
_GREATEST_WAY, _BACK = 15.0, 2.0


class CoupledStepTest(StepTest):
    """Steps of joints in an effort mode.

    A subclass enters the mode by ``entering`` and sends commands in ``command``.
    """

    def setup(self) -> None:
        """Open the part, and read its transmission."""
        super().setup()
        self.transmission = Transmission.read(self.robot_part.board)
        self.transmission.warn_if_unknown(self, self.robot_part.name)
        #: By joint: the coupled joints that changed their mode with it, the positions of all joints before (deg), and
        #: their efforts before.
        self.along: dict[int, list[int]] = {joint: [] for joint in self.chosen}
        self.stood: dict[int, FloatArray] = {}
        self._held: dict[int, FloatArray] = {}

    def command(self, joints: list[int], efforts: list[float]) -> None:
        """Send the efforts of joints."""
        raise NotImplementedError

    def give(self, joint: int, effort: float, others: list[float] | None = None) -> None:
        """Command the effort of a joint, and those of the joints that changed their mode with it.

        Without ``others`` these keep the efforts they had before. Raises GuardError if one of them moves too far.
        """
        along = self.along[joint]
        self.command([joint, *along], [effort, *(self._held[joint][along].tolist() if others is None else others)])
        if along:
            self._check_coupled(joint)

    def entering(self, joint: int, mode: ControlMode, effort: float, held: FloatArray) -> Routine[bool]:
        """Bring a joint into a mode with an effort; return whether it entered the mode.

        ``held`` are the efforts of all joints before.
        """
        part = self.robot_part
        coupled = [one for one in self.transmission.coupled(joint) if one != joint]
        self.stood[joint], self._held[joint] = part.board.encoders(), held
        part.board.set_control_modes([mode], [joint])
        if coupled:  # joints in other modes ignore the command
            self.command(coupled, held[coupled].tolist())
        self.give(joint, effort)
        entered = yield from until(part.clock, lambda: part.board.control_modes(joint)[0] is mode, _MODE_TIME)
        self.along[joint] = self.transmission.went_along(part.board, joint, mode)
        return entered

    def _check_coupled(self, joint: int) -> None:
        part, along = self.robot_part, self.along[joint]
        gone = np.abs(part.board.encoders(along) - self.stood[joint][along])
        if gone.max() > _GREATEST_WAY:
            one = along[int(gone.argmax())]
            raise GuardError(
                f"{part.names[one]} shares motors with {part.names[joint]}, and moved by "
                f"{part.shown(one, float(gone.max()), '.1f')} during the step",
                one,
            )

    def _bring(self, joint: int) -> Routine[None]:
        yield from super()._bring(joint)
        along = self.along[joint]
        if along:
            part, self.along[joint] = self.robot_part, []
            yield from bringing(self, part, along, self.stood[joint][along], tolerance=_BACK)
