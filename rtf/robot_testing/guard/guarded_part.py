"""A part whose joints a guard may stop and exclude: its board, its state before the test, and its excluded joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.robot_testing.guard.reactions import LIMP, Reactions, take_power
from rtf.robot_testing.guard.snapshot import Snapshot, sliding_joints
from rtf.robot_testing.guard.transmission import Transmission

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.clock import Clock
    from rtf.robot.boards.client import RemoteBoard

_SETTLING = 0.2  # s after which the state shows a requested mode


class GuardedPart:
    """A part and its excluded joints. ``name`` is the prefix of its ports; ``report`` gets what is done to it."""

    def __init__(self, board: RemoteBoard, name: str, *, clock: Clock, report: Callable[[str], None]) -> None:
        self.board = board
        self.name = name
        self.clock = clock
        self.report = report
        self.snapshot = Snapshot.take(board)
        self.names = board.axis_names()
        #: Prismatic joints: neither the guard nor tests move them, as their commands are in degrees.
        self.sliding = sliding_joints(board)
        self.excluded: set[int] = set()
        self.reactions = Reactions(board, self.excluded, lambda: self.limp_before)
        self._held: set[int] = set()  # excluded joints of a board that cannot take their power
        self._idle_since: dict[int, float] = {}  # when this guard left joints idle, s of the robot's clock
        self._repowered: set[int] = set()  # excluded joints that had power again, and were reported
        self._coupling: Transmission | None = None  # read when a joint is excluded

    @property
    def limp_before(self) -> list[int]:
        """The joints that had no power before the test, and were not excluded."""
        return [joint for joint in self.included if self.snapshot.modes[joint] is ControlMode.IDLE]

    def exclude(self, joint: int, reason: str) -> None:
        """Exclude a joint that does not obey: switch off its power, and neither watch, move nor power it again."""
        if joint in self.excluded:
            return
        self.excluded.add(joint)  # before the command, whose answer may be lost
        MotionRecord().record_excluded(self.name, joint)
        self._leave_idle(joint)
        left = "is held, as its board cannot take its power" if joint in self._held else "is left idle"
        self.report(f"{self.names[joint]} {left}: {reason}")

    def _leave_idle(self, joint: int) -> None:
        self._idle_since[joint] = self.clock.now()
        if not take_power(self.board, joint):
            self._held.add(joint)

    def adopt_exclusions(self, joints: Collection[int]) -> None:
        """Exclude joints that another process has excluded and left without power."""
        self.excluded |= set(joints)

    def is_excluded(self, joint: int) -> bool:
        """Whether a joint was excluded."""
        return joint in self.excluded

    @property
    def included(self) -> list[int]:
        """The joints that are not excluded."""
        return [joint for joint in range(len(self.names)) if joint not in self.excluded]

    def exclude_coupled(self, joint: int, what: str) -> dict[int, str]:
        """Exclude the joints coupled with ``joint``. Return the reason for each that was not excluded yet.

        ``what`` is a relative clause about ``joint``. The reasons have no subject: ``is coupled with torso_roll, which
        had to be stopped``.
        """
        why = f"is coupled with {self.names[joint]}, {what}"
        others = [one for one in self.coupled_with(joint) if one not in self.excluded]
        for other in others:
            self.exclude(other, f"it {why}")
        return dict.fromkeys(others, why)

    def coupled_with(self, joint: int) -> list[int]:
        """Return the joints coupled with ``joint``: many boards change their modes together.

        If the board does not report its couplings, or invalid ones, there are none, which is reported once.
        """
        if self._coupling is None:
            self._coupling = Transmission.read_couplings(self.board)
            if self._coupling.unknown:
                self.report(f"the couplings of {self.name} are unknown, and taken for none: {self._coupling.unknown}")
        return [one for one in self._coupling.coupled(joint) if one != joint]

    def watch_excluded(self) -> None:
        """Check that excluded joints are still idle: their limits are not watched, so they could run away.

        A board that changes the modes of coupled joints together gives power to an excluded joint with another one.
        GuardError is raised once for each such joint.
        """
        if not self.excluded:
            return
        now, modes = self.clock.now(), self.board.control_modes()
        for joint in sorted(self.excluded):
            since = self._idle_since.get(joint, -np.inf)
            if joint in self._held or modes[joint] in LIMP or 0 <= now - since < _SETTLING:  # the state may be older
                continue
            self._leave_idle(joint)
            if joint in self._held or joint in self._repowered:  # already reported; switch it off again
                continue
            self._repowered.add(joint)
            self.exclude_coupled(joint, "which is to stay idle")
            raise GuardError(
                f"{self.names[joint]} ({self.name} joint {joint}) had been left idle, and was in {modes[joint].word}: "
                "its board powers it with another joint, or another program does; it is idle again",
                joint,
            )

    def halt(self, joints: Sequence[int]) -> None:
        """Stop joints in any mode; see :meth:`Reactions.hold`."""
        self.reactions.hold(joints)
