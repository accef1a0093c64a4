"""Restoration of the settings of a part as they are in its snapshot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.interfaces import PidType
from rtf.robot_testing.guard.snapshot import answered
from rtf.robot_testing.slides import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import Pid
    from rtf.robot_testing.guard.error_collector import ErrorCollector
    from rtf.robot_testing.guard.snapshot import Snapshot


class SettingsRestoration:
    """Restoration of greatest currents, limits, impedances, gains and interaction modes, and the end of new faults.

    Unchanged settings are not written. ``names`` are those of the joints; ``report`` gets a line for what is restored.
    """

    def __init__(
        self, board: RemoteBoard, snapshot: Snapshot, names: Sequence[str], report: Callable[[str], None]
    ) -> None:
        self._board = board
        self._before = snapshot
        self._report = report
        self._names = names

    def run(self, problems: ErrorCollector) -> None:
        """Restore everything; ``problems`` collects the errors, which do not keep the other steps from being done."""
        for joint in range(len(self._names)):
            for step in (self._restore_current, self._restore_limits, self._restore_impedance):
                problems.attempt(step, joint)
        problems.attempt(self._restore_pids, problems)
        problems.attempt(self._restore_interactions)
        problems.attempt(self._leave_faults)

    def _restore_current(self, joint: int) -> None:
        before = self._before.max_currents[joint]
        if before is not None and self._board.max_current(joint) != before:
            self._board.set_max_current(joint, before)
            self._report(f"{self._names[joint]}: the greatest current is {before:g} A again")

    def _restore_limits(self, joint: int) -> None:
        before = self._before.limits
        if before and self._board.limits(joint) != before[joint]:
            self._board.set_limits(joint, *before[joint])
            low, high = (shown(self._board, joint, one, "g") for one in before[joint])
            self._report(f"{self._names[joint]}: the limits are {low} and {high} again")

    def _restore_impedance(self, joint: int) -> None:
        before = self._before.impedances[joint]
        if before is not None and self._board.impedance(joint) != before:
            self._board.set_impedance(joint, *before)
            self._report(f"{self._names[joint]}: stiffness and damping are {before} again")

    def _restore_pids(self, problems: ErrorCollector) -> None:
        board, all_now = self._board, answered(lambda: self._board.pids(PidType.POSITION))  # one request for all joints

        def restore(joint: int, before: Pid) -> None:
            if (all_now[joint] if all_now else board.pid(PidType.POSITION, joint)) != before:
                board.set_pid(PidType.POSITION, joint, before)
                self._report(f"{self._names[joint]}: the gains of the position controller are as before")

        for joint, before in enumerate(self._before.pids):
            if before is not None:
                problems.attempt(restore, joint, before)

    def _restore_interactions(self) -> None:
        board, before = self._board, self._before.interactions
        if before and board.interaction_modes() != before:
            for joint, mode in enumerate(before):
                if mode is not InteractionMode.UNKNOWN and board.interaction_mode(joint) is not mode:
                    board.set_interaction_modes(mode, joint)

    def _leave_faults(self) -> None:
        for joint, mode in enumerate(self._board.control_modes()):
            if mode is ControlMode.HARDWARE_FAULT and self._before.modes[joint] is not ControlMode.HARDWARE_FAULT:
                self._board.set_control_modes(ControlMode.FORCE_IDLE, joint)
                self._report(f"{self._names[joint]} was in hardware fault: forced idle")
