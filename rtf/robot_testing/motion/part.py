"""A part of the robot for tests: guarded, recorded, with blocking moves and their routines."""

from __future__ import annotations

import math
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot_testing.guard.monitored_quantities import greatest_speeds
from rtf.robot_testing.guard.read_only_board import ReadOnlyBoard, UndeclaredMotionError
from rtf.robot_testing.motion.joint_queues import queues
from rtf.robot_testing.motion.known_motors import known_motors
from rtf.robot_testing.motion.routines import one_at_a_time, pause, run_to_end, until
from rtf.robot_testing.motion.trace import Trace
from rtf.robot_testing.slides import as_text, converted, in_metres, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rtf.clock import Clock
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel
    from rtf.robot_testing.guard.motion_guard import MotionGuard
    from rtf.robot_testing.motion.known_motors import KnownMotor
    from rtf.robot_testing.motion.routines import Routine

#: Period of the checks while joints move, s.
PACE = 0.02
#: Tolerance of a position, deg, and additional time of a move beyond twice the expected one, s.
TOLERANCE, GRACE = 0.5, 5.0
#: Additional time for a command to arrive on a busy machine, s.
LATEST = 0.3
#: Time of a move within the tolerance, s, and its least speed, deg/s.
_NEAR_TIME, _SLOWEST = 0.2, 1.0
#: The greatest speed of a minimum-jerk trajectory, as a share of its mean.
_PEAK = 15 / 8
_HISTORY = 1000


class Arrival(NamedTuple):
    """The end of a move: whether all joints arrived, their positions (deg), the duration (s) and the tolerance (deg).

    Excluded joints do not move and need not arrive; their positions are included.
    """

    reached: bool
    positions: FloatArray
    seconds: float
    tolerance: float = TOLERANCE

    def late(self, part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray) -> str:
        """Return which of the ``joints`` are not at their targets (deg), with where they are."""
        return "; ".join(
            f"{part.names[joint]} is at {part.shown(joint, where)}, not {part.shown(joint, target)}"
            for joint, where, target in zip(joints, self.positions, targets, strict=True)
            if not abs(where - target) <= self.tolerance
        )


class Part:
    """One part of the robot. ``joints`` are axis numbers; targets and speeds have one value for each of them.

    ``guard`` is None for tests that do not move the robot: a command raises UndeclaredMotionError then.
    """

    def __init__(
        self,
        name: str,
        board: RemoteBoard,
        clock: Clock,
        guard: MotionGuard | None,
        *,
        together: Sequence[Sequence[Sequence[str]]] = (),
        robot: RobotModel | None = None,
        simulated: bool = False,
    ) -> None:
        self.name = name
        self.board = board
        self.clock = clock
        self.guard = guard
        #: See :attr:`rtf.robot.model.Part.together`.
        self.together = together
        self._robot, self._simulated = robot, simulated
        if guard is not None and isinstance(board, ReadOnlyBoard):
            board.allow_commands()
        self.axes = board.axes()
        self.names = board.axis_names()
        self.history = Trace(_HISTORY)  # the last seconds, for the recording of a failure
        #: Joints that a test leaves without power on purpose, now or before.
        self.let_go: set[int] = set()
        board.observe(self.history.add)
        joints = range(self.axes)
        # As read by the guard: reading takes a request for each joint.
        limits = (guard and guard.snapshot.limits) or [board.limits(joint) for joint in joints]
        self.low = np.array([low for low, _ in limits])
        self.high = np.array([high for _, high in limits])
        #: The greatest speeds (deg/s); infinite if the board has none.
        self.fastest = greatest_speeds(board) if guard is None else guard.fastest
        self.home = np.clip(board.encoders(), self.low, self.high)

    @cached_property
    def motors(self) -> dict[int, KnownMotor]:
        """Its motors that robot.toml describes."""
        return known_motors(self.board, self.names, self._robot, simulated=self._simulated) if self._robot else {}

    def queues(self, joints: Iterable[int]) -> list[list[list[int]]]:
        """Return the queues of joints that may be moved at the same time, each a list of groups."""
        return queues(self.names, joints, self.together)

    def one_at_a_time(self, joints: Iterable[int]) -> list[list[list[int]]]:
        """Return the queues of joints with a single joint in each group."""
        return one_at_a_time(self.names, joints, self.together)

    # Joints ------------------------------------------------------------------------------------------------------

    def joint(self, which: int | str) -> int:
        """Return the number of a joint given by number or name. Raises RefusedError for an unknown joint."""
        if isinstance(which, str) and which in self.names:
            return self.names.index(which)
        if isinstance(which, int) and 0 <= which < self.axes:
            return which
        raise RefusedError(f"{self.name} has no joint {which!r}; it has 0 to {self.axes - 1}: {', '.join(self.names)}")

    def select(self, wanted: Sequence[int]) -> list[int]:
        """Return the joints of a parameter; without any, all joints, or with a guard all revolute ones.

        Raises RefusedError for an unknown joint and, with a guard, for a prismatic one.
        """
        sliding = frozenset[int]() if self.guard is None else self.guard.sliding
        chosen = [self.joint(which) for which in wanted] or [j for j in range(self.axes) if j not in sliding]
        if wrong := [self.names[joint] for joint in chosen if joint in sliding]:
            names = ", ".join(wrong)
            raise RefusedError(f"{names} of {self.name} is prismatic, and the robot's model does not say so: not moved")
        if not chosen:
            raise RefusedError(f"no joint of {self.name} is revolute")
        return chosen

    def within(self, joint: int, share: float) -> float:
        """Return the position at a share of a joint's range: 0 is its lower limit, 1 its upper limit."""
        return float(self.low[joint] + share * (self.high[joint] - self.low[joint]))

    def held(self, joints: Sequence[int] | None = None) -> list[int]:
        """Return those of some joints, by default of all, that a test moves: revolute and not excluded."""
        chosen, guard = range(self.axes) if joints is None else joints, self.guard
        return [j for j in chosen if guard is None or not (guard.is_excluded(j) or j in guard.sliding)]

    def paced(self, speeds: FloatArray, joints: Sequence[int] | None = None) -> FloatArray:
        """Return speeds for moves (deg/s), at most those whose peak a joint reaches; of ``joints``, None: of all."""
        most = self.fastest if joints is None else self.fastest[list(joints)]
        paced: FloatArray = np.minimum(speeds, most / _PEAK)
        return paced

    def shown(self, joint: int, degrees: float, spec: str = ".2f", rate: str = "") -> str:
        """Return a position, distance or speed (``rate`` "/s") of a joint as text, in the joint's unit."""
        return shown(self.board, joint, degrees, spec, rate)

    def shown_torque(self, joint: int, torque: float, spec: str = ".2f") -> str:
        """Return a torque of a joint (Nm), or the force of a prismatic one (N), as text."""
        return as_text(in_metres(self.board, joint), torque, "Nm", spec)

    def column(self, joint: int, degrees: FloatArray, rate: str = "") -> tuple[FloatArray, str]:
        """Return positions, or with a ``rate`` speeds, of a joint in its unit, with that unit, for a recording."""
        factor, unit = converted(in_metres(self.board, joint), f"deg{rate}")
        return degrees * factor, unit

    # Modes -------------------------------------------------------------------------------------------------------

    def set_mode(self, mode: ControlMode, joints: Sequence[int] | None = None, *, timeout: float = 1.0) -> bool:
        """Set the mode of the joints that are not excluded, and wait for it; return whether all entered it."""
        return run_to_end(self, self.entering(mode, joints, timeout=timeout), pace=PACE)

    def entering(
        self, mode: ControlMode, joints: Sequence[int] | None = None, *, timeout: float = 1.0
    ) -> Routine[bool]:
        """Return the routine of ``set_mode``."""
        self._need_guard("joints would change their modes")
        asked = range(self.axes) if joints is None else joints
        chosen = self.held(asked)
        if not chosen:
            return not asked
        with suppress(RefusedError):  # a board may refuse all because of one joint; the modes show which
            self.board.set_control_modes([mode] * len(chosen), chosen)
        wanted = ControlMode.IDLE if mode is ControlMode.FORCE_IDLE else mode
        if wanted is ControlMode.IDLE:
            self.let_go.update(chosen)
        return (
            yield from until(
                self.clock, lambda: all(found is wanted for found in self.board.control_modes(chosen)), timeout
            )
        )

    # States ------------------------------------------------------------------------------------------------------

    def state_age(self) -> float:
        """Return the age of the newest state, s of the robot's clock; NaN before the first state."""
        return self.clock.now() - self.history.newest[0] if len(self.history) else math.nan

    def report_clock_offset(self, report: Callable[[str], None]) -> None:
        """Report the offset of the board's stamps from this machine's clock, if there is one."""
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
        """Move joints in position mode, and wait until they arrive or the time is up; the guard watches.

        The default ``timeout`` is twice the expected time of the move and ``GRACE`` seconds. Excluded joints are left
        out. Positions in deg, speeds in deg/s.
        """
        routine = self.moving(targets, joints, speed=speed, tolerance=tolerance, timeout=timeout)
        return run_to_end(self, routine, pace=PACE)

    def moving(
        self,
        targets: Sequence[float] | FloatArray,
        joints: Sequence[int] | None = None,
        *,
        speed: float | Sequence[float] | FloatArray = 20.0,
        tolerance: float = TOLERANCE,
        timeout: float | None = None,
    ) -> Routine[Arrival]:
        """Return the routine of ``move``."""
        self._need_guard("joints would move")
        chosen = list(range(self.axes)) if joints is None else list(joints)
        goal = np.asarray(targets, dtype=np.float64)
        speeds = self.paced(np.broadcast_to(np.asarray(speed, dtype=np.float64), goal.shape), chosen)
        held = self.held(chosen)
        going = [place for place, joint in enumerate(chosen) if joint in held]
        begin, here = self.clock.now(), self.board.encoders(chosen)
        if not going:
            return Arrival(not chosen, here, 0.0, tolerance)
        way = np.abs(goal - here)
        if timeout is None:
            timeout = float(np.nanmax(2 * way[going] / speeds[going], initial=0.0)) + GRACE
        # A joint within the tolerance has arrived at once, so the next command interrupts the rest of its move. At full
        # speed that rest takes milliseconds, and a board that goes on with its acceleration would oscillate.
        paces = np.where(way <= tolerance, np.minimum(speeds, np.maximum(_SLOWEST, way / _NEAR_TIME)), speeds)
        self.board.set_reference_speeds(paces[going], held)
        self.command_move(goal[going], held, speeds=paces[going])
        if (paces != speeds)[going].any():  # later commands of the test rely on the speed it asked for
            self.board.set_reference_speeds(speeds[going], held)

        def arrived() -> bool:
            nonlocal here
            here = self.board.encoders(chosen)  # the positions that are returned: the joints may move on
            return bool((np.abs(here - goal)[going] <= tolerance).all())

        reached = yield from until(self.clock, arrived, timeout)
        return Arrival(reached, here, self.clock.now() - begin, tolerance)

    def command_move(
        self, targets: Sequence[float] | FloatArray, joints: Sequence[int] | None, *, speeds: FloatArray | None = None
    ) -> None:
        """Command a move in position mode, once the guard has checked it; None: of all joints, in one request.

        ``speeds`` are those that were set, by default those that the board reports. Raises RefusedMoveError.
        """
        if self.guard is not None and self.guard.checks_moves:
            known = self.board.reference_speeds(joints) if speeds is None else speeds
            chosen = range(self.axes) if joints is None else joints
            self.guard.check_move(np.asarray(targets, dtype=np.float64), chosen, known)
        self.board.position_move(targets, joints)

    def median_positions(self) -> FloatArray:
        """Return the medians of the newest joint positions (deg), see :meth:`Trace.median_positions`."""
        return self.history.median_positions() if len(self.history) else self.board.encoders()

    def _need_guard(self, what: str) -> None:
        if self.guard is None:
            raise UndeclaredMotionError(self.name, what)

    def go_home(self, *, speed: float = 20.0, tolerance: float = TOLERANCE) -> Arrival:
        """Move all joints, in position mode, to their positions at the beginning of the test."""
        self.set_mode(ControlMode.POSITION)
        return self.move(self.home, speed=speed, tolerance=tolerance)

    def wait_until(self, condition: Callable[[], bool], timeout: float, *, pace: float = PACE) -> bool:
        """Wait until a condition holds, checked every ``pace`` s of the robot's time; return False on time-out."""
        return run_to_end(self, until(self.clock, condition, timeout), pace=pace)

    def wait(self, seconds: float, *, pace: float = PACE) -> None:
        """Wait for ``seconds`` of the robot's time; the guard watches."""
        run_to_end(self, pause(self.clock, seconds), pace=pace)

    def wait_to_arrive(self, arrived: Callable[[], bool], usual: float, *, pace: float = PACE) -> bool:
        """Wait for a command to arrive: the usual time, and ``LATEST`` seconds more if it has not by then.

        Return whether it has arrived. A lost command never does.
        """
        self.wait(usual, pace=pace)
        return arrived() or self.wait_until(arrived, LATEST, pace=pace)

    @contextmanager
    def recorded(self) -> Iterator[Trace]:
        """Record every state that the board publishes inside the ``with`` block."""
        trace = Trace()
        self.board.observe(trace.add)
        try:
            yield trace
        finally:
            self.board.unobserve(trace.add)
