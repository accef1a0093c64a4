"""Steps in modes in which nothing holds a joint, where a board changes the mode of all that share motors with it.

Many boards do so. Then those joints, too, are without their controllers; each is told what it gave before, or what
who derives has for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.courses import until
from rtf.robot_testing.guard import GuardError
from rtf.robot_testing.positioning import bringing
from rtf.robot_testing.steps import StepTest
from rtf.robot_testing.transmission import Transmission

if TYPE_CHECKING:
    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.courses import Course

#: What a board may take to show its mode, s.
_MODE_TIME = 0.2
#: How far such a joint may go, deg; and how near it is brought back to where it stood, deg.
_ASTRAY, _BACK = 15.0, 2.0


class CoupledStepTest(StepTest):
    """Steps of joints in a mode of efforts. Who derives enters it by ``entering``, and commands in ``tell``."""

    def setup(self) -> None:
        """See the base; and see how the part is geared."""
        super().setup()
        self.transmission = Transmission.read(self.robot_part.board)
        self.transmission.tell(self, self.robot_part.name)
        #: The joints that went along with each joint; where all stood then, deg, and what each gave.
        self.along: dict[int, list[int]] = {joint: [] for joint in self.chosen}
        self.stood: dict[int, FloatArray] = {}
        self._held: dict[int, FloatArray] = {}

    def tell(self, joints: list[int], efforts: list[float]) -> None:
        """Command joints what they are to give."""
        raise NotImplementedError

    def give(self, joint: int, effort: float, others: list[float] | None = None) -> None:
        """Tell a joint what to give, and those that went along, without any what they gave before.

        GuardError for one of these that goes far.
        """
        along = self.along[joint]
        self.tell([joint, *along], [effort, *(self._held[joint][along].tolist() if others is None else others)])
        if along:
            self._look_after(joint)

    def entering(self, joint: int, mode: ControlMode, effort: float, held: FloatArray) -> Course[bool]:
        """Bring a joint into a mode with an effort; whether it is in it. ``held`` is what all joints gave before."""
        part = self.robot_part
        coupled = [one for one in self.transmission.coupled(joint) if one != joint]
        self.stood[joint], self._held[joint] = part.board.encoders(), held
        part.board.set_control_modes([mode], [joint])
        if coupled:  # those in other modes ignore it
            self.tell(coupled, held[coupled].tolist())
        self.give(joint, effort)
        entered = yield from until(part.clock, lambda: part.board.control_modes(joint)[0] is mode, _MODE_TIME)
        self.along[joint] = self.transmission.went_along(part.board, joint, mode)
        return entered

    def _look_after(self, joint: int) -> None:
        part, along = self.robot_part, self.along[joint]
        gone = np.abs(part.board.encoders(along) - self.stood[joint][along])
        if gone.max() > _ASTRAY:
            one = along[int(gone.argmax())]
            raise GuardError(
                f"{part.names[one]} shares motors with {part.names[joint]}, and went {gone.max():.1f} deg while that "
                "one was stepped",
                one,
            )

    def _bring(self, joint: int) -> Course[None]:
        yield from super()._bring(joint)
        along = self.along[joint]
        if along:
            part, self.along[joint] = self.robot_part, []
            yield from bringing(self, part, along, self.stood[joint][along], tolerance=_BACK)
