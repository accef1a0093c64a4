"""The motion guard of a part: snapshot before a test, limits during it, and restoration afterwards."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import (
    NoAnswerError,
    NotSupportedError,
    RefusedError,
    RobotError,
    StaleStateError,
)
from rtf.robot_testing.guard.contacts import WITHIN, NoForcesError
from rtf.robot_testing.guard.error_collector import ErrorCollector
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.monitored_quantities import (
    MonitoredPart,
    MonitoredQuantity,
    Violation,
    greatest_speeds,
    state_quantities,
    temperatures,
)
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.robot_testing.guard.settings_restoration import SettingsRestoration
from rtf.robot_testing.guard.snapshot import Snapshot, answered, sliding_joints
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.judging.real_time_checks import RecentCpuPressure

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.clock import Clock
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.contacts import ContactWatch

#: Speed at which joints are moved back, deg/s, and the most time for it, s.
RETURN_SPEED, RETURN_TIME = 20.0, 20.0
_ARRIVED = 2.0  # deg
_PACE = 0.05  # s
_AT_REST = 1.0  # deg/s
_TEMPERATURE_PERIOD = 1.0  # s between two readings of the temperatures
_STATE_WAIT = 3.0  # s to wait for states that have stopped, when a part is restored
_SETTLING = 0.2  # s after which the state shows a requested mode
#: Modes in which a joint goes on executing its last command, and ignores ``stop``.
_DRIVEN = frozenset({ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM, ControlMode.POSITION_DIRECT})
#: Modes in which it moves on without further commands.
_MOVING = _DRIVEN - {ControlMode.POSITION_DIRECT} | {ControlMode.VELOCITY}
#: Modes in which its motor has no power.
_LIMP = frozenset({ControlMode.IDLE, ControlMode.HARDWARE_FAULT})


class MotionGuard:
    """Guard of one part. ``clock`` is the robot's; ``report`` gets a line for everything that had to be restored.

    Call ``watch`` periodically while joints move, and ``restore`` at the end in any case, both in the same thread.
    ``contacts`` detects contacts by the part's force-torque sensor; None: contacts are not detected. ``name`` is the
    prefix of the part's port names.
    """

    def __init__(
        self,
        board: RemoteBoard,
        name: str,
        *,
        clock: Clock,
        report: Callable[[str], None],
        limits: Limits | None = None,
        contacts: ContactWatch | None = None,
    ) -> None:
        self.board = board
        self.name = name
        self.limits = limits or Limits()
        self.snapshot = Snapshot.take(board)
        self._clock = clock
        self._report = report
        self._names = board.axis_names()
        self._low = np.array([low for low, _ in self.snapshot.limits]) - self.limits.beyond
        self._high = np.array([high for _, high in self.snapshot.limits]) + self.limits.beyond
        #: The greatest speeds, deg/s; infinite if the board has none.
        self.fastest = greatest_speeds(board)
        #: Prismatic joints: neither the guard nor tests move them, as their commands are in degrees.
        self.sliding = sliding_joints(board)
        self._report_joints()
        place = MonitoredPart(name, self._names, report)
        self._quantities = state_quantities(board, place, self.limits, self.fastest, self.snapshot.max_currents)
        self._temperatures = temperatures(board, place, self.limits)
        self._temperatures_read = -np.inf  # when the temperatures were last read, s of the robot's clock
        self._excluded: set[int] = set()
        self._idle_since: dict[int, float] = {}  # when this guard left joints idle, s of the robot's clock
        self._repowered: set[int] = set()  # excluded joints that had power again, and were reported
        self._coupling: Transmission | None = None  # read when a joint is excluded
        self._secured: set[int] = set()  # joints that were reported as held
        self._contacts = contacts
        self._limitation_reported = False  # whether the low sensitivity to contacts was reported
        self._cpu_pressure = RecentCpuPressure()
        #: Called with a joint that was stopped.
        self.on_stop: Callable[[int], object] | None = None

    def _report_joints(self) -> None:
        """Report the joints that are watched without a speed limit, and those that are not moved."""
        if unknown := [self._names[joint] for joint in np.flatnonzero(np.isinf(self.fastest))]:
            self._report(f"{self.name} has no greatest speed for {', '.join(unknown)}: their speeds have no limit")
        if sliding := [self._names[joint] for joint in sorted(self.sliding)]:
            self._report(f"{self.name}: {', '.join(sliding)} are prismatic: tests do not move them")

    def exclude(self, joint: int, reason: str) -> None:
        """Exclude a joint that does not obey: switch off its power, and neither watch, move nor power it again."""
        if joint in self._excluded:
            return
        self._excluded.add(joint)  # before the command, whose answer may be lost
        MotionRecord().record_excluded(self.name, joint)
        self._leave_idle(joint)
        self._report(f"{self._names[joint]} is left idle: {reason}")

    def _leave_idle(self, joint: int) -> None:
        self._idle_since[joint] = self._clock.now()
        self.board.set_control_modes(ControlMode.IDLE, joint)

    def set_contact_watch(self, contacts: ContactWatch | None) -> None:
        """Start contact detection; None stops it."""
        self._contacts = contacts

    def adopt_exclusions(self, joints: Collection[int]) -> None:
        """Exclude joints that another process has excluded and left without power."""
        self._excluded |= set(joints)

    def is_excluded(self, joint: int) -> bool:
        """Whether a joint was excluded."""
        return joint in self._excluded

    @property
    def _included(self) -> list[int]:
        """The joints that are not excluded."""
        return [joint for joint in range(len(self._names)) if joint not in self._excluded]

    def exclude_coupled(self, joint: int, what: str) -> dict[int, str]:
        """Exclude the joints coupled with ``joint``. Return the reason for each that was not excluded yet.

        ``what`` is a relative clause about ``joint``. The reasons have no subject: ``is coupled with torso_roll, which
        had to be stopped``.
        """
        why = f"is coupled with {self._names[joint]}, {what}"
        others = [one for one in self.coupled_with(joint) if one not in self._excluded]
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
                self._report(f"the couplings of {self.name} are unknown, and taken for none: {self._coupling.unknown}")
        return [one for one in self._coupling.coupled(joint) if one != joint]

    # While joints move -----------------------------------------------------------------------------------------------

    def watch(self) -> None:
        """Check all limits; stop a joint that violates one, and raise GuardError.

        Raises StaleStateError if states no longer arrive; all joints are held then.
        """
        try:
            self._check_limits()
        except StaleStateError:
            with suppress(RobotError):  # reported by ``restore``, which reads the states first
                self._hold_without_states()
            raise

    def excuse(self) -> str:
        """Return the overload of this machine that may have caused a violation just now; "" if there was none.

        There is none in lockstep, as the robot's time waits for this process.
        """
        return "" if isinstance(self._clock, LockstepClock) else self._cpu_pressure.overload()

    def _check_limits(self) -> None:
        self._cpu_pressure.update()
        self._watch_excluded()
        positions = self.board.encoders()
        self._judge(
            Violation(np.isnan(positions), lambda joint: f"has no position: its encoder gives {positions[joint]}")
        )
        if self.snapshot.limits:
            outside = (positions < self._low) | (positions > self._high)
            self._judge(Violation(outside, lambda joint: f"is at {positions[joint]:.1f} deg, beyond its limits"))
        self._watch_motion()

    def _watch_excluded(self) -> None:
        """Check that excluded joints are still idle: their limits are not watched, so they could run away.

        A board that changes the modes of coupled joints together gives power to an excluded joint with another one.
        GuardError is raised once for each such joint.
        """
        if not self._excluded:
            return
        now, modes = self._clock.now(), self.board.control_modes()
        for joint in sorted(self._excluded):
            since = self._idle_since.get(joint, -np.inf)
            if modes[joint] in _LIMP or 0 <= now - since < _SETTLING:  # the state may be older
                continue
            self._leave_idle(joint)
            if joint in self._repowered:  # already reported; switch it off again
                continue
            self._repowered.add(joint)
            self.exclude_coupled(joint, "which is to stay idle")
            raise GuardError(
                f"{self._names[joint]} ({self.name} joint {joint}) had been left idle, and was in {modes[joint].word}: "
                "its board powers it with another joint, or another program does; it is idle again",
                joint,
            )

    def _watch_motion(self) -> None:
        """Check all limits but those of positions: a joint on its way back may be outside of them."""
        now = self._clock.now()
        for quantity in self._quantities:
            self._watch_quantity(quantity, now)
        self._watch_contacts()
        # The clock may also be set back.
        if self._temperatures is not None and not 0 <= now - self._temperatures_read < _TEMPERATURE_PERIOD:
            self._temperatures_read = now
            self._watch_quantity(self._temperatures, now)

    def _watch_quantity(self, quantity: MonitoredQuantity, now: float) -> None:
        for wrong in quantity.check(now):
            self._judge(wrong)

    def _watch_contacts(self) -> None:
        """Stop all joints of a part that is in contact: all of them may contribute to the force."""
        if self._contacts is None or self.limits.contact is None:
            return
        try:
            contact = self._contacts.detect(self.limits.contact)
        except NoForcesError as error:
            self._contacts = None
            self._report(f"{self.name} is not watched for contacts: {error}")
            return
        if not self._limitation_reported and (limitation := self._contacts.limitation(self.limits.contact)):
            self._limitation_reported = True
            self._report(f"{self.name} is watched for contacts with less sensitivity: {limitation}")
        held = self._included
        if contact is None or not held:
            return
        joint = max(held, key=lambda one: contact.speeds[one])
        what = "is in contact with an obstacle"
        if contact.speeds[joint] < _AT_REST:
            joint = self._farthest(held, joint)  # before the stop, which changes the targets
            what = "is at rest by its encoder, but in contact: something holds it, or the encoder is frozen"
        self._stop(
            held,
            f"{self._names[joint]} ({self.name} joint {joint}) {what}; {self._contacts.source} shows at least "
            f"{contact.force:.0f} N of contact within {WITHIN:g} s, more than {self.limits.contact:g} N; "
            "all joints of the part were stopped",
            joint,
        )

    def _farthest(self, joints: list[int], otherwise: int) -> int:
        """Return the joint farthest from its target; ``otherwise`` if the board does not report targets."""
        with suppress(NotSupportedError, RefusedError):
            away = np.abs(self.board.target_positions() - self.board.encoders())
            return max(joints, key=lambda one: away[one])
        return otherwise

    def _judge(self, wrong: Violation) -> None:
        found = [int(joint) for joint in np.flatnonzero(wrong.joints) if joint not in self._excluded]
        if found:
            joint = found[0]
            text = f"{self._names[joint]} ({self.name} joint {joint}) {wrong.describe(joint)}; it was stopped"
            self._stop([joint], text, joint)

    def _stop(self, joints: Sequence[int], text: str, joint: int) -> None:
        """Stop joints and raise GuardError with ``text``, even if the board refuses to stop them."""
        try:
            self.halt(joints)
        except RobotError as error:
            text = f"{text.rpartition('; ')[0]}; it could not be stopped: {error}"
        if self.on_stop is not None:
            self.on_stop(joint)
        raise GuardError(text, joint, self.excuse())

    def halt(self, joints: Sequence[int]) -> None:
        """Stop joints in any mode. A joint driven by duty cycle, current or torque is held in position mode.

        If states no longer arrive the modes are unknown: all joints of the part are stopped and held.
        """
        try:
            modes = self.board.control_modes()
        except StaleStateError:
            self._hold_without_states()
            return
        driven = [joint for joint in joints if modes[joint] in _DRIVEN]
        moving = [joint for joint in joints if modes[joint] not in _DRIVEN | _LIMP]
        problems = ErrorCollector()
        if driven:
            problems.attempt(self._hold, driven)
        if moving:
            problems.attempt(self.board.stop, moving)
        problems.raise_all("")

    def _hold_without_states(self) -> None:
        """Stop and hold all joints without knowing their states; those that had no power before get none."""
        problems, idle = ErrorCollector(), self._limp_before
        if held := [joint for joint in self._included if joint not in idle]:
            problems.attempt(self._hold, held)
            problems.attempt(self.board.stop, held)
        for joint in [*idle, *sorted(self._excluded)]:
            problems.attempt(self.board.set_control_modes, ControlMode.IDLE, joint)
        problems.raise_all("")

    @property
    def _limp_before(self) -> list[int]:
        return [joint for joint in self._included if self.snapshot.modes[joint] is ControlMode.IDLE]

    def _hold(self, joints: Sequence[int]) -> None:
        """Hold joints where they are; leave those without power whose boards refuse it."""
        try:
            self.board.set_control_modes([ControlMode.POSITION] * len(joints), joints)
        except RefusedError:
            for joint in joints:
                try:
                    self.board.set_control_modes(ControlMode.POSITION, joint)
                except RefusedError:
                    self.board.set_control_modes(ControlMode.IDLE, joint)

    # Afterwards ------------------------------------------------------------------------------------------------------

    def restore(self, seconds: float = RETURN_TIME, *, move_back: bool = True) -> None:
        """Restore the part as it was in the snapshot. Raises one RobotError for all problems.

        The order is: stop all motion, restore the settings, move the joints back within ``seconds`` (only with
        ``move_back``), and restore the modes. Unchanged settings are not written. A step that fails does not keep
        the following ones from being done.
        """
        problems = ErrorCollector()
        with suppress(NoAnswerError):  # collected; all further requests would time out as well
            problems.attempt(self.secure)
            problems.attempt(self._exclude_idle_coupled)
            SettingsRestoration(self.board, self.snapshot, self._names, self._report).run(problems)
            if move_back:
                problems.attempt(self._move_back, seconds)
            self._restore_modes(problems)
        problems.raise_all(f"{self.name} could not be restored: ")

    def secure(self) -> None:
        """Stop all joints that are driven or move. It needs no settings of the board.

        If states do not arrive all joints are held; RobotError is raised if they do not come back.
        """
        try:
            modes = self.board.control_modes()
        except StaleStateError as error:
            self._hold_without_states()
            if not self._states_return():
                raise RobotError(f"{error}; its joints are held where they were then") from error
            self._report(f"the states of {self.name} had stopped and are back; its joints were held meanwhile")
            modes = self.board.control_modes()
        on_the_way = self._moving_to_targets(modes)
        going = [joint for joint in self._included if modes[joint] in _MOVING or joint in on_the_way]
        if going:
            self.halt(going)
        for joint in going:
            if modes[joint] in _DRIVEN:
                self._secured.add(joint)
                self._report(f"{self._names[joint]}: is held, was left in {modes[joint].word}")

    def _exclude_idle_coupled(self) -> None:
        """Exclude the joints that went idle with an excluded one: that one would get power together with them."""
        modes, before = self.board.control_modes(), self.snapshot.modes
        for joint in sorted(self._excluded):
            for other in self.coupled_with(joint):
                if other not in self._excluded and modes[other] is ControlMode.IDLE is not before[other]:
                    self.exclude(other, f"its board left it idle with {self._names[joint]}, with which it is coupled")

    def _states_return(self) -> bool:
        """Wait for states to arrive again: the machine may have been too busy, or the network down for a moment."""
        end = self._clock.now() + _STATE_WAIT
        while self._clock.now() < end:
            self._clock.sleep(_PACE)
            with suppress(StaleStateError):
                self.board.encoders()
                return True
        return False

    def _moving_to_targets(self, modes: Sequence[ControlMode]) -> set[int]:
        """Return the joints that are on their way to a target: a board completes such a move without a client.

        If the board does not answer, these are all joints that might be.
        """
        found = {joint for joint in self._included if modes[joint] is ControlMode.MIXED}
        asked = [joint for joint in self._included if modes[joint] is ControlMode.POSITION]
        try:
            return found.union(joint for joint in asked if answered(partial(self.board.motion_done, joint)) is False)
        except NoAnswerError:
            return found.union(asked)

    def _move_back(self, seconds: float) -> None:
        """Move joints back to their positions in the snapshot. On any error all moving joints are stopped."""
        idle = self._limp_before
        mine = [joint for joint in self._included if joint not in idle and joint not in self.sliding]
        sent: list[int] = []
        end = self._clock.now() + seconds
        try:
            # Repeatedly, as a joint that was not held may begin to sink while others move.
            while away := self._not_back(mine):
                if new := [joint for joint in away if joint not in sent]:
                    sent += new
                    self._command_back(new)
                if self._clock.now() > end:
                    self._raise_late(away, seconds)
                self._clock.sleep(_PACE)
                try:
                    self._watch_excluded()
                    self._watch_motion()
                except GuardError as error:
                    raise GuardError(f"on the way back {error}", error.joint, error.excuse) from None
        except BaseException as error:
            if isinstance(error, GuardError):
                MotionRecord().record_obstacle(self.name)
            self.halt(sent)
            raise

    def _raise_late(self, away: Sequence[int], seconds: float) -> NoReturn:
        late = ", ".join(self._names[joint] for joint in away)
        raise GuardError(f"{late} did not return to its position before the test within {seconds:g} s; it was stopped")

    def _not_back(self, joints: Sequence[int]) -> list[int]:
        """Return the joints that are not at their positions in the snapshot. Raises GuardError without a position."""
        here = self.board.encoders()
        for joint in joints:
            if np.isnan(here[joint]):
                raise GuardError(f"{self._names[joint]} has no position, and cannot be brought back", joint)
        away = np.minimum(np.abs(here - self.snapshot.positions), np.abs(here - self._return_targets))
        return [joint for joint in joints if away[joint] > _ARRIVED]

    @property
    def _return_targets(self) -> FloatArray:
        """The positions in the snapshot; for a joint that was outside of its limits the nearest position within."""
        positions, limits = self.snapshot.positions, np.array(self.snapshot.limits)
        return np.clip(positions, limits[:, 0], limits[:, 1]) if limits.size else positions

    def _command_back(self, joints: Sequence[int]) -> None:
        board = self.board
        board.set_control_modes([ControlMode.POSITION] * len(joints), joints)
        board.set_reference_speeds([RETURN_SPEED] * len(joints), joints)
        board.position_move(self._return_targets[joints], joints)

    def _restore_modes(self, problems: ErrorCollector) -> None:
        board, before = self.board, self.snapshot

        def modes() -> None:
            for joint, (now, then) in enumerate(zip(board.control_modes(), before.modes, strict=True)):
                if joint not in self._excluded and now is not then and then in _RESTORABLE:
                    problems.attempt(self._restore_mode, joint, now)
            for joint in sorted(self._excluded):  # last: a board may have powered them with other joints
                problems.attempt(board.set_control_modes, ControlMode.IDLE, joint)

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
        then = self.snapshot.modes[joint]
        self.board.set_control_modes(then, joint)
        if joint not in self._secured:  # otherwise it was reported, and the last state does not show it yet
            self._report(f"{self._names[joint]}: in {then.word} again, was left in {now.word}")


#: Modes that are restored. Faults and calibration are up to the board; torque, current and duty cycle need a client
#: that sends commands.
_RESTORABLE = frozenset(
    {ControlMode.POSITION, ControlMode.POSITION_DIRECT, ControlMode.VELOCITY, ControlMode.MIXED, ControlMode.IDLE}
)
