"""A part of the robot as a test works with it: guarded, recorded, and with the words of tests."""

from __future__ import annotations

import math
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot_testing.courses import finish, pause, until
from rtf.robot_testing.listening_board import ListeningBoard, UndeclaredMotionError
from rtf.robot_testing.trace import Trace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.clock import Clock
    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.courses import Course
    from rtf.robot_testing.guard import MotionGuard

#: Seconds between two looks at joints that move.
PACE = 0.02
#: How near is there, deg, and what a move is given beyond the time that it should take, s.
TOLERANCE, GRACE = 0.5, 5.0
#: What a command may take to arrive on a busy machine, beyond its usual time, s.
LATEST = 0.3
_HISTORY = 1000


class Arrival(NamedTuple):
    """How a move ended: whether all joints are there, where they are, and how long it took (s)."""

    reached: bool
    positions: FloatArray
    seconds: float


class Part:
    """One part. ``joints`` are numbers of its axes everywhere; targets and speeds have one value for each of them.

    ``guard`` is None for tests that do not move anything: what would move raises UndeclaredMotionError then.
    """

    def __init__(self, name: str, board: RemoteControlBoard, clock: Clock, guard: MotionGuard | None) -> None:
        self.name = name
        self.board = board
        self.clock = clock
        self.guard = guard
        if guard is not None and isinstance(board, ListeningBoard):
            board.obey()
        self.axes = board.axes()
        self.names = board.axis_names()
        self.history = Trace(_HISTORY)  # the last seconds, for who wants to know what led to a failure
        board.observe(self.history.add)
        joints = range(self.axes)
        # The guard has just asked for them: each is a question a joint.
        limits = (guard and guard.snapshot.limits) or [board.limits(joint) for joint in joints]
        self.low = np.array([low for low, _ in limits])
        self.high = np.array([high for _, high in limits])
        fastest = None if guard is None else guard.fastest
        self.fastest = np.array([board.velocity_limits(joint)[1] for joint in joints]) if fastest is None else fastest
        self.home = np.clip(board.encoders(), self.low, self.high)

    # Joints ------------------------------------------------------------------------------------------------------

    def joint(self, which: int | str) -> int:
        """The number of a joint that is given by number or by name. Raises RefusedError for one that is not there."""
        if isinstance(which, str) and which in self.names:
            return self.names.index(which)
        if isinstance(which, int) and 0 <= which < self.axes:
            return which
        raise RefusedError(f"{self.name} has no joint {which!r}; it has 0 to {self.axes - 1}: {', '.join(self.names)}")

    def select(self, wanted: Sequence[int]) -> list[int]:
        """The joints that a parameter says; all of them when it says none."""
        return [self.joint(which) for which in wanted] if len(wanted) else list(range(self.axes))

    def within(self, joint: int, share: float) -> float:
        """The position at a share of a joint's range: 0 is its lower limit, 1 its upper one."""
        return float(self.low[joint] + share * (self.high[joint] - self.low[joint]))

    # Modes -------------------------------------------------------------------------------------------------------

    def set_mode(self, mode: ControlMode, joints: Sequence[int] | None = None, *, timeout: float = 1.0) -> bool:
        """Ask for a mode of joints, and wait until all are in it; whether they are."""
        return finish(self, self.entering(mode, joints, timeout=timeout), pace=PACE)

    def entering(self, mode: ControlMode, joints: Sequence[int] | None = None, *, timeout: float = 1.0) -> Course[bool]:
        """The same as a course."""
        self._need_guard("joints would change their modes")
        chosen = list(range(self.axes)) if joints is None else list(joints)
        self.board.set_control_modes([mode] * len(chosen), chosen)
        wanted = ControlMode.IDLE if mode is ControlMode.FORCE_IDLE else mode
        return (
            yield from until(
                self.clock, lambda: all(found is wanted for found in self.board.control_modes(chosen)), timeout
            )
        )

    # States ------------------------------------------------------------------------------------------------------

    def state_age(self) -> float:
        """How old the newest state is, s by the robot's clock; NaN before the first."""
        return self.clock.now() - self.history.newest[0] if len(self.history) else math.nan

    # Moving ------------------------------------------------------------------------------------------------------

    def move(
        self,
        targets: Sequence[float] | FloatArray,
        joints: Sequence[int] | None = None,
        *,
        speed: float | Sequence[float] | FloatArray = 20.0,
        tolerance: float = TOLERANCE,
        timeout: float | None = None,
    ) -> Arrival:
        """Move joints under position control and wait until they are there, or the time is up; the guard looks on.

        The time is twice what the distance takes at that speed, and some seconds more, unless it is given.
        """
        course = self.moving(targets, joints, speed=speed, tolerance=tolerance, timeout=timeout)
        return finish(self, course, pace=PACE)

    def moving(
        self,
        targets: Sequence[float] | FloatArray,
        joints: Sequence[int] | None = None,
        *,
        speed: float | Sequence[float] | FloatArray = 20.0,
        tolerance: float = TOLERANCE,
        timeout: float | None = None,
    ) -> Course[Arrival]:
        """The same as a course."""
        self._need_guard("joints would move")
        chosen = list(range(self.axes)) if joints is None else list(joints)
        goal = np.asarray(targets, dtype=np.float64)
        speeds = np.broadcast_to(np.asarray(speed, dtype=np.float64), goal.shape)
        begin, start = self.clock.now(), self.board.encoders(chosen)
        if timeout is None:
            timeout = float(np.max(2 * np.abs(goal - start) / speeds, initial=0.0)) + GRACE
        self.board.set_reference_speeds(speeds, chosen)
        self.board.position_move(goal, chosen)
        reached = yield from until(
            self.clock, lambda: bool((np.abs(self.board.encoders(chosen) - goal) <= tolerance).all()), timeout
        )
        return Arrival(reached, self.board.encoders(chosen), self.clock.now() - begin)

    def _need_guard(self, what: str) -> None:
        if self.guard is None:
            raise UndeclaredMotionError(self.name, what)

    def go_home(self, *, speed: float = 20.0, tolerance: float = TOLERANCE) -> Arrival:
        """Bring all joints, in position mode, to where they were when the test began."""
        self.set_mode(ControlMode.POSITION)
        return self.move(self.home, speed=speed, tolerance=tolerance)

    def wait_until(self, condition: Callable[[], bool], timeout: float, *, pace: float = PACE) -> bool:
        """Wait until a condition holds, looking every ``pace`` seconds of the robot's time; False when it does not."""
        return finish(self, until(self.clock, condition, timeout), pace=pace)

    def wait(self, seconds: float, *, pace: float = PACE) -> None:
        """Let time pass; the guard looks on."""
        finish(self, pause(self.clock, seconds), pace=pace)

    def wait_to_arrive(self, arrived: Callable[[], bool], usual: float, *, pace: float = PACE) -> bool:
        """Give a command the time that it usually takes to arrive, and more where it has not: it may only be late.

        Whether it has arrived in the end. A command that was lost never does.
        """
        self.wait(usual, pace=pace)
        return arrived() or self.wait_until(arrived, LATEST, pace=pace)

    @contextmanager
    def recorded(self) -> Iterator[Trace]:
        """Record every state that the board publishes during the block."""
        trace = Trace()
        self.board.observe(trace.add)
        try:
            yield trace
        finally:
            self.board.unobserve(trace.add)
