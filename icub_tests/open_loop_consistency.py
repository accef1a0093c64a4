"""Open-loop consistency: in PWM mode a motor gets the commanded duty cycle."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing import Limits, Safety, likely_causes
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.joints_test import JointsTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.interfaces import FloatArray


class OpenLoopConsistency(JointsTest):
    """Drives all motors with small duty cycles, and compares reference and output with the command.

    On entering PWM mode reference and output have to be zero. Back in position mode the last reference must still be
    readable. The joints fall a little meanwhile, and are moved home.
    """

    aliases = ("OpenloopConsistency", "openLoopConsistency", "openloopConsistency", "openloop-consistency")
    tags = ("references", "effort")
    safety = Safety.EFFORT
    limits = Limits(speed=5.0, current=None, contact=None)  # light joints fall fast

    level = Parameter(float, "the duty cycle, in both directions", unit="%", default=1.0, low=0.1, high=5.0)
    tolerance = Parameter(float, "tolerance of reference and output", unit="%", default=0.05, low=0.0)
    settling = Parameter(float, "time for a command to take effect", unit="s", default=0.05, low=0.01)

    def setup(self) -> None:
        """Open the part and bring its joints home."""
        super().setup()
        self.chosen = self._with_those_that_share_motors(self.chosen)
        self.bring_home()

    def _with_those_that_share_motors(self, joints: list[int]) -> list[int]:
        """Add all coupled joints: the controller of one joint would drive the motor of another."""
        part = self.robot_part
        chosen = set[int]().union(*map(Transmission.read_couplings(part.board).coupled, joints))
        if added := sorted(chosen - {*joints}):
            self.report(f"driven, too, as they share motors: {', '.join(part.names[joint] for joint in added)}")
        return sorted(chosen)

    def run(self) -> None:
        """Enter PWM mode, drive up and down, and leave it. A joint that the guard stops is excluded from then on."""
        part, board = self.robot_part, self.robot_part.board
        self.retry_without_stopped(lambda: part.set_mode(ControlMode.PWM, self.chosen, timeout=_CHANGES))
        self._await(0.0, _PACE)
        self._look("on entering", 0.0)
        for duty in (self.level, 0.0, -self.level):
            board.set_reference_duty_cycles(np.full(len(self.chosen), duty), self.chosen)
            self._await(duty, self.settling)
            self._look(f"at {duty:g} %", duty)
        self.retry_without_stopped(lambda: part.set_mode(ControlMode.POSITION, self.chosen))
        self.retry_without_stopped(lambda: part.wait(self.settling, pace=_PACE))
        self._judge("reference kept after leaving", board.reference_duty_cycles(self.chosen), -self.level)
        self.bring_home(self.chosen)

    def _await(self, duty: float, usual: float) -> None:
        """Wait for the boards to apply a duty cycle, and for their states to show it."""
        part = self.robot_part
        self.retry_without_stopped(lambda: part.wait_to_arrive(lambda: self._follows(duty), usual, pace=_PACE))

    def _follows(self, duty: float) -> bool:
        """Whether references and outputs of all joints are at ``duty``."""
        board = self.robot_part.board
        outputs = (board.reference_duty_cycles(self.chosen), board.duty_cycles(self.chosen))
        return bool((np.abs(np.array(outputs) - duty) <= self.tolerance).all())

    def _look(self, when: str, duty: float) -> None:
        """Judge mode, reference and output of the joints."""
        board = self.robot_part.board
        modes = board.control_modes(self.chosen)
        references, outputs = board.reference_duty_cycles(self.chosen), board.duty_cycles(self.chosen)
        stayed = {joint: mode for joint, mode in zip(self.chosen, modes, strict=True) if mode is not ControlMode.PWM}
        self._judge(f"reference {when}", references, duty)
        self._judge(f"output {when}", outputs, duty, stayed)
        for joint, mode in zip(self.chosen, modes, strict=True):
            name = self.robot_part.names[joint]
            with self.subresult(name):
                text = f"{name}: is in {mode.word} {when}, not in PWM mode; {likely_causes('mode')}"
                self.check_fail_if_false(mode is ControlMode.PWM, text)

    def _judge(
        self, what: str, values: FloatArray, duty: float, stayed: Mapping[int, ControlMode] = MappingProxyType({})
    ) -> None:
        """Judge a value of all joints, but no motors that they share with joints that ``stayed`` in other modes."""
        names, guard = self.robot_part.names, self.robot_part.guard
        for joint, value in zip(self.chosen, values, strict=True):
            name = names[joint]
            with self.subresult(name):
                wrong = f"{name}: {what} is {value:.2f} %, not {duty:g}"
                sharing = stayed.keys() & (guard.coupled_with(joint) if guard is not None else ())
                if joint not in stayed and sharing and abs(value - duty) > self.tolerance:
                    other = min(sharing)
                    self.inconclusive(f"{wrong}; but it shares motors: {names[other]} is in {stayed[other].word}")
                hint = f"{wrong}; {likely_causes('references')}"
                self.measure(what, value, "%", low=duty - self.tolerance, high=duty + self.tolerance, hint=hint)


#: Time for a board to change a mode, s: joints that change at once wait without power for those that do not.
_CHANGES = 0.3
#: Period of the checks, s.
_PACE = 0.01
