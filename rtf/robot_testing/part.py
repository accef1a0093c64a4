"""A part of the robot as a test works with it: guarded, recorded, and with the words of tests."""

from __future__ import annotations

import math
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot_testing.courses import finish, pause, until
from rtf.robot_testing.listening_board import ListeningBoard, UndeclaredMotionError
from rtf.robot_testing.trace import Trace
from rtf.robot_testing.watched import greatest_speeds

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
#: What is near already goes there in so long a time, s, but not slower than this, deg/s.
_NEAR_TIME, _SLOWEST = 0.2, 1.0
_HISTORY = 1000


class Arrival(NamedTuple):
    """How a move ended: whether all joints are there, where they are, how long it took (s), how near is there (deg).

    Of joints that were given up it is told where they are, and they need not be there.
    """

    reached: bool
    positions: FloatArray
    seconds: float
    tolerance: float = TOLERANCE


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
        #: The greatest speeds (deg/s); infinite where the board knows none.
        self.fastest = greatest_speeds(board) if guard is None else guard.fastest
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
        """The joints that a parameter says; all of them when it says none, and with a guard all that turn.

        Raises RefusedError for one that is not there, or slides.
        """
        sliding = frozenset[int]() if self.guard is None else self.guard.sliding
        chosen = [self.joint(which) for which in wanted] or [j for j in range(self.axes) if j not in sliding]
        if wrong := [self.names[joint] for joint in chosen if joint in sliding]:
            raise RefusedError(f"{', '.join(wrong)} of {self.name} slides, and does not turn: a test moves by degrees")
        if not chosen:
            raise RefusedError(f"no joint of {self.name} turns")
        return chosen

    def within(self, joint: int, share: float) -> float:
        """The position at a share of a joint's range: 0 is its lower limit, 1 its upper one."""
        return float(self.low[joint] + share * (self.high[joint] - self.low[joint]))

    def held(self, joints: Sequence[int] | None = None) -> list[int]:
        """Those of some joints, or of all, that a test moves: they turn, and the guard has not given them up."""
        chosen, guard = range(self.axes) if joints is None else joints, self.guard
        return [j for j in chosen if guard is None or not (guard.given_up(j) or j in guard.sliding)]

    # Modes -------------------------------------------------------------------------------------------------------

    def set_mode(self, mode: ControlMode, joints: Sequence[int] | None = None, *, timeout: float = 1.0) -> bool:
        """Ask for a mode of joints that were not given up, and wait until all are in it; whether they are."""
        return finish(self, self.entering(mode, joints, timeout=timeout), pace=PACE)

    def entering(self, mode: ControlMode, joints: Sequence[int] | None = None, *, timeout: float = 1.0) -> Course[bool]:
        """The same as a course."""
        self._need_guard("joints would change their modes")
        asked = range(self.axes) if joints is None else joints
        chosen = self.held(asked)
        if not chosen:
            return not asked
        with suppress(RefusedError):  # boards may answer so when a joint has not obeyed: which one, its mode shows
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

    def tell_of_clocks(self, report: Callable[[str], None]) -> None:
        """Report it where the board's stamps are by another clock than this machine's."""
        if apart := self.history.clocks_apart:
            report(f"{self.name}: {apart}")

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

        The time is twice what the distance takes at that speed, and some seconds more, unless it is given. Joints that
        were given up are left out.
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
        held = self.held(chosen)
        going = [place for place, joint in enumerate(chosen) if joint in held]
        begin, here = self.clock.now(), self.board.encoders(chosen)
        if not going:
            return Arrival(not chosen, here, 0.0, tolerance)
        way = np.abs(goal - here)
        if timeout is None:
            timeout = float(np.nanmax(2 * way[going] / speeds[going], initial=0.0)) + GRACE
        # What is there already is so at once: the next command comes in the middle of the little way that is left. At
        # full speed that takes milliseconds; boards may go on with the acceleration which that takes, and swing.
        paces = np.where(way <= tolerance, np.minimum(speeds, np.maximum(_SLOWEST, way / _NEAR_TIME)), speeds)
        self.board.set_reference_speeds(paces[going], held)
        self.board.position_move(goal[going], held)
        if (paces != speeds)[going].any():  # whoever gives commands of their own later takes the speed to be theirs
            self.board.set_reference_speeds(speeds[going], held)

        def arrived() -> bool:
            nonlocal here
            here = self.board.encoders(chosen)  # where they are told to be in the end: they may move on
            return bool((np.abs(here - goal)[going] <= tolerance).all())

        reached = yield from until(self.clock, arrived, timeout)
        return Arrival(reached, here, self.clock.now() - begin, tolerance)

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
