"""Restoring a part after a test: all motion is stopped, then settings, positions and modes are as in the snapshot."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import NoAnswerError, RobotError, StaleStateError
from rtf.robot_testing.guard.error_collector import ErrorCollector
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.robot_testing.guard.reactions import DRIVEN, MOVING, take_power
from rtf.robot_testing.guard.settings_restoration import SettingsRestoration
from rtf.robot_testing.guard.snapshot import answered

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.guarded_part import GuardedPart

#: Speed at which joints are moved back, deg/s, or less if they are slow, and the most time for it, s.
RETURN_SPEED, RETURN_TIME = 20.0, 20.0
_ARRIVED = 2.0  # deg
_PACE = 0.05  # s
_STATE_WAIT = 3.0  # s to wait for states that have stopped, when a part is restored
#: Modes that are restored. Faults and calibration are up to the board; torque, current and duty cycle need a client
#: that sends commands.
_RESTORABLE = frozenset(
    {ControlMode.POSITION, ControlMode.POSITION_DIRECT, ControlMode.VELOCITY, ControlMode.MIXED, ControlMode.IDLE}
)


class Restoration:
    """The restoration of a part. ``watch`` is called regularly while joints are moved back; it raises GuardError.

    ``fastest`` are the greatest speeds of moves of the joints (deg/s).
    """

    def __init__(self, part: GuardedPart, watch: Callable[[], None], fastest: FloatArray) -> None:
        self._part = part
        self._watch = watch
        self._speeds = np.minimum(RETURN_SPEED, fastest)
        self._secured: set[int] = set()  # joints that were reported as held

    def run(self, seconds: float = RETURN_TIME, *, move_back: bool = True) -> None:
        """Restore the part as it was in the snapshot. Raises one RobotError for all problems.

        The order is: stop all motion, restore the settings, move the joints back within ``seconds`` (only with
        ``move_back``), and restore the modes. Unchanged settings are not written. A step that fails does not keep
        the following ones from being done.
        """
        problems = ErrorCollector()
        with suppress(NoAnswerError):  # collected; all further requests would time out as well
            problems.attempt(self.secure)
            problems.attempt(self._exclude_idle_coupled)
            SettingsRestoration(self._part.board, self._part.snapshot, self._part.names, self._part.report).run(
                problems
            )
            if move_back:
                problems.attempt(self._move_back, seconds)
            self._restore_modes(problems)
        problems.raise_all(f"{self._part.name} could not be restored: ")

    def secure(self) -> None:
        """Stop all joints that are driven or move. It needs no settings of the board.

        If states do not arrive all joints are held; RobotError is raised if they do not come back.
        """
        try:
            modes = self._part.board.control_modes()
        except StaleStateError as error:
            self._part.reactions.hold_without_states()
            if not self._states_return():
                raise RobotError(f"{error}; its joints are held where they were then") from error
            self._part.report(
                f"the states of {self._part.name} had stopped and are back; its joints were held meanwhile"
            )
            modes = self._part.board.control_modes()
        going = self.going(modes)
        if going:
            self._part.halt(going)
        for joint in going:
            if modes[joint] in DRIVEN:
                self._secured.add(joint)
                self._part.report(f"{self._part.names[joint]}: is held, was left in {modes[joint].word}")

    def going(self, modes: Sequence[ControlMode]) -> list[int]:
        """Return the joints that are driven, or move to a target, in these modes of all joints."""
        on_the_way = self._moving_to_targets(modes)
        return [joint for joint in self._part.included if modes[joint] in MOVING or joint in on_the_way]

    def _exclude_idle_coupled(self) -> None:
        """Exclude the joints that went idle with an excluded one: that one would get power together with them."""
        modes, before = self._part.board.control_modes(), self._part.snapshot.modes
        for joint in sorted(self._part.excluded):
            for other in self._part.coupled_with(joint):
                if other not in self._part.excluded and modes[other] is ControlMode.IDLE is not before[other]:
                    self._part.exclude(
                        other, f"its board left it idle with {self._part.names[joint]}, with which it is coupled"
                    )

    def _states_return(self) -> bool:
        """Wait for states to arrive again: the machine may have been too busy, or the network down for a moment."""
        end = self._part.clock.now() + _STATE_WAIT
        while self._part.clock.now() < end:
            self._part.clock.sleep(_PACE)
            with suppress(StaleStateError):
                self._part.board.encoders()
                return True
        return False

    def _moving_to_targets(self, modes: Sequence[ControlMode]) -> set[int]:
        """Return the joints that are on their way to a target: a board completes such a move without a client.

        If the board does not answer, these are all joints that might be.
        """
        found = {joint for joint in self._part.included if modes[joint] is ControlMode.MIXED}
        asked = [joint for joint in self._part.included if modes[joint] is ControlMode.POSITION]
        try:
            if not asked or answered(self._part.board.motion_done):  # of all joints, in one request
                return found
            return found.union(
                joint for joint in asked if answered(partial(self._part.board.motion_done, joint)) is False
            )
        except NoAnswerError:
            return found.union(asked)

    def _move_back(self, seconds: float) -> None:
        """Move joints back to their positions in the snapshot. On any error all moving joints are stopped."""
        idle = self._part.limp_before
        mine = [joint for joint in self._part.included if joint not in idle and joint not in self._part.sliding]
        sent: list[int] = []
        end = self._part.clock.now() + seconds
        try:
            # Repeatedly, as a joint that was not held may begin to sink while others move.
            while away := self._not_back(mine):
                if new := [joint for joint in away if joint not in sent]:
                    sent += new
                    self._command_back(new)
                if self._part.clock.now() > end:
                    self._raise_late(away, seconds)
                self._part.clock.sleep(_PACE)
                try:
                    self._watch()
                except GuardError as error:
                    raise GuardError(f"on the way back {error}", error.joint, error.excuse) from None
        except BaseException as error:
            if isinstance(error, GuardError):
                MotionRecord().record_obstacle(self._part.name)
            self._part.halt(sent)
            raise

    def _raise_late(self, away: Sequence[int], seconds: float) -> NoReturn:
        late = ", ".join(self._part.names[joint] for joint in away)
        raise GuardError(f"{late} did not return to its position before the test within {seconds:g} s; it was stopped")

    def _not_back(self, joints: Sequence[int]) -> list[int]:
        """Return the joints that are not at their positions in the snapshot. Raises GuardError without a position."""
        here = self._part.board.encoders()
        for joint in joints:
            if np.isnan(here[joint]):
                raise GuardError(f"{self._part.names[joint]} has no position, and cannot be brought back", joint)
        away = np.minimum(np.abs(here - self._part.snapshot.positions), np.abs(here - self._return_targets))
        return [joint for joint in joints if away[joint] > _ARRIVED]

    @property
    def _return_targets(self) -> FloatArray:
        """The positions in the snapshot; for a joint that was outside of its limits the nearest position within."""
        positions, limits = self._part.snapshot.positions, np.array(self._part.snapshot.limits)
        return np.clip(positions, limits[:, 0], limits[:, 1]) if limits.size else positions

    def _command_back(self, joints: Sequence[int]) -> None:
        board = self._part.board
        board.set_control_modes([ControlMode.POSITION] * len(joints), joints)
        board.set_reference_speeds(self._speeds[joints], joints)
        board.position_move(self._return_targets[joints], joints)

    def _restore_modes(self, problems: ErrorCollector) -> None:
        board, before = self._part.board, self._part.snapshot

        def modes() -> None:
            for joint, (now, then) in enumerate(zip(board.control_modes(), before.modes, strict=True)):
                if joint not in self._part.excluded and now is not then and then in _RESTORABLE:
                    problems.attempt(self._restore_mode, joint, now)
            for joint in sorted(self._part.excluded):  # last: a board may have powered them with other joints
                problems.attempt(take_power, board, joint)

        def speeds() -> None:
            if before.speeds is not None and not np.array_equal(board.reference_speeds(), before.speeds):
                board.set_reference_speeds(before.speeds)

        def accelerations() -> None:
            then = before.accelerations
            if then is not None and not np.array_equal(board.reference_accelerations(), then):
                board.set_reference_accelerations(then)

        for step in (modes, speeds, accelerations):
            problems.attempt(step)

    def _restore_mode(self, joint: int, now: ControlMode) -> None:
        then = self._part.snapshot.modes[joint]
        self._part.board.set_control_modes(then, joint)
        if joint not in self._secured:  # otherwise it was reported, and the last state does not show it yet
            self._part.report(f"{self._part.names[joint]}: in {then.word} again, was left in {now.word}")
