"""The guard of a part: what it was like before, what it may not do meanwhile, and putting it back afterwards."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from rtf.middleware.time import LockstepClock
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import (
    NoAnswerError,
    NotSupportedError,
    RefusedError,
    RobotError,
    StaleStateError,
)
from rtf.robot.interfaces import PidType
from rtf.robot_testing.contacts import WITHIN, NoForcesError
from rtf.robot_testing.lateness import LastMoments
from rtf.robot_testing.ledger import MotionLedger
from rtf.robot_testing.problems import Problems
from rtf.robot_testing.snapshot import Snapshot, answered, sliding_joints
from rtf.robot_testing.transmission import Transmission
from rtf.robot_testing.watched import Place, Watched, Wrong, greatest_speeds, in_the_state, temperatures
from rtf.testing.outcome import TestFailure

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.clock import Clock
    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.interfaces import Pid
    from rtf.robot_testing.contacts import ContactWatch

#: What joints are parked with, deg/s, and how long it may take, s.
PARKING_SPEED, PARKING_TIME = 20.0, 20.0
_ARRIVED = 2.0  # deg
_PACE = 0.05  # s
_STANDING = 1.0  # deg/s
_WARMING = 1.0  # s between two looks at temperatures
_RETURNING = 3.0  # s for which states that have stopped are waited for, when a part is put back
_SETTLING = 0.2  # s after which the state shows a mode that was asked for
#: In these a joint goes on with what it was told last, and ``stop`` means nothing to it.
_DRIVEN = frozenset({ControlMode.TORQUE, ControlMode.CURRENT, ControlMode.PWM, ControlMode.POSITION_DIRECT})
#: In these it goes on although nobody commands it.
_RESTLESS = _DRIVEN - {ControlMode.POSITION_DIRECT} | {ControlMode.VELOCITY}
#: In these nothing drives it.
_LIMP = frozenset({ControlMode.IDLE, ControlMode.HARDWARE_FAULT})


class GuardError(RobotError, TestFailure):
    """A part does what it may not: the sentence names the joint, the value and the limit. The joint was stopped.

    It is a failure of the test, for it is the robot that is wrong; but not where there is an ``excuse``: this machine
    was too busy just then to control joints. ``joint`` is its number in the part, -1 where that is not told.
    """

    def __init__(self, text: str, joint: int = -1, excuse: str = "") -> None:
        super().__init__(text)
        self.joint = joint
        self.excuse = excuse


@dataclass(frozen=True, slots=True)
class Limits:
    """What a joint may do while a test moves it; None: whatever it likes."""

    beyond: float = 5.0  # deg outside of its position limits
    #: Times what is usual: its greatest speed, or, where that is less, twice what it was told to turn at, 80 deg/s at
    #: least. Infinite: it may be as fast as it likes.
    speed: float = 1.5
    current: float | None = 1.0  # times its greatest current
    torque: float | None = 1.5  # times what its motor can exert: more than that comes from outside
    temperature: float | None = 1.0  # times its limit
    #: N by which the force at the part's sensor may change suddenly beyond what its motion explains. A free limb of the
    #: simulated robot shows 0.3 N, falling or stopped from full speed, and 13 N where stamps are 20 ms wrong; one that
    #: strikes itself at 20 deg/s shows 25 N with a finger, 60 to 100 N with anything else.
    contact: float | None = 15.0


class MotionGuard:
    """Guards one part through its board. ``clock`` is the robot's; ``report`` is told what had to be put back.

    ``watch`` is called while joints move, ``restore`` at the end, whatever has happened; both from one thread.
    ``contacts`` is the watch of the part's force-torque sensor; None: it is not watched for contacts. ``name`` begins
    the names of the part's ports.
    """

    def __init__(
        self,
        board: RemoteControlBoard,
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
        #: The greatest speeds, deg/s; infinite where the board knows none.
        self.fastest = greatest_speeds(board)
        #: Joints that slide: all that is told here, and by tests, is of degrees.
        self.sliding = sliding_joints(board)
        self._tell_of_joints()
        place = Place(name, self._names, report)
        self._quantities = in_the_state(board, place, self.limits, self.fastest, self.snapshot.max_currents)
        self._temperatures = temperatures(board, place, self.limits)
        self._felt = -np.inf  # when temperatures were last asked for, s of the robot's clock
        self._given_up: set[int] = set()
        self._idle_since: dict[int, float] = {}  # of those that were given up here, s of the robot's clock
        self._powered_again: set[int] = set()  # of these it was told
        self._coupling: Transmission | None = None  # asked for where a joint is given up
        self._secured: set[int] = set()  # joints that nobody drives any more
        self._contacts = contacts
        self._doubted = False  # whether it was told that contacts are felt late
        self._last_moments = LastMoments()
        #: Called with a joint that was stopped.
        self.on_stop: Callable[[int], object] | None = None

    def _tell_of_joints(self) -> None:
        """Report what is not watched, or not moved, as one might think it were."""
        if unknown := [self._names[joint] for joint in np.flatnonzero(np.isinf(self.fastest))]:
            self._report(f"{self.name} tells no greatest speed of {', '.join(unknown)}: they are watched without it")
        if sliding := [self._names[joint] for joint in sorted(self.sliding)]:
            self._report(f"{self.name}: {', '.join(sliding)} slide: nothing that turns joints moves them")

    def give_up(self, joint: int, reason: str) -> None:
        """Leave a joint that does not obey without power: it is neither watched nor parked, nor powered any more."""
        if joint in self._given_up:
            return
        self._given_up.add(joint)  # before the board is told, whose answer may be lost
        MotionLedger().gave_up(self.name, joint)
        self._leave_idle(joint)
        self._report(f"{self._names[joint]} is left idle: {reason}")

    def _leave_idle(self, joint: int) -> None:
        self._idle_since[joint] = self._clock.now()
        self.board.set_control_modes(ControlMode.IDLE, joint)

    def feel(self, contacts: ContactWatch | None) -> None:
        """Watch the part for contacts from now on, or no more."""
        self._contacts = contacts

    def leave_alone(self, joints: Collection[int]) -> None:
        """Neither watch nor move nor power joints that somebody else has given up."""
        self._given_up |= set(joints)

    def given_up(self, joint: int) -> bool:
        """Whether a joint was left to itself."""
        return joint in self._given_up

    @property
    def _kept(self) -> list[int]:
        """The joints that were not given up."""
        return [joint for joint in range(len(self._names)) if joint not in self._given_up]

    def give_up_companions(self, joint: int, what: str) -> dict[int, str]:
        """Give up the joints that are coupled with one, of which ``what`` is told; why, for each that was not yet.

        The reason has no subject: ``is coupled with torso_roll, which …``.
        """
        why = f"is coupled with {self._names[joint]}, {what}"
        others = [one for one in self.companions(joint) if one not in self._given_up]
        for other in others:
            self.give_up(other, f"it {why}")
        return dict.fromkeys(others, why)

    def companions(self, joint: int) -> list[int]:
        """The joints that are coupled with one: many boards change their modes together."""
        if self._coupling is None:
            self._coupling = Transmission.read(self.board)
        return [one for one in self._coupling.coupled(joint) if one != joint]

    # While joints move -----------------------------------------------------------------------------------------------

    def watch(self) -> None:
        """Look whether every joint does what it may; stop the one that does not, and raise GuardError.

        Where the state does not come any more nobody can look: all are held, and StaleStateError is raised.
        """
        try:
            self._look()
        except StaleStateError:
            with suppress(RobotError):  # it is told when the part is put back, which begins with the same
                self._hold_unseen()
            raise

    def excuse(self) -> str:
        """Why what joints did a moment ago may be no fault of theirs; "" where this machine could control them.

        In lockstep it always can, for time waits for it.
        """
        return "" if isinstance(self._clock, LockstepClock) else self._last_moments.busyness()

    def _look(self) -> None:
        self._last_moments.pass_by()
        self._watch_given_up()
        positions = self.board.encoders()
        self._judge(Wrong(np.isnan(positions), lambda joint: f"has no position: its encoder gives {positions[joint]}"))
        if self.snapshot.limits:
            outside = (positions < self._low) | (positions > self._high)
            self._judge(Wrong(outside, lambda joint: f"is at {positions[joint]:.1f} deg, beyond its limits"))
        self._watch_motion()

    def _watch_given_up(self) -> None:
        """See that what was left idle is so: nobody looks at such a joint, and it may run away.

        Where a board changes the modes of several joints together, whoever powers one of them powers it as well. That
        is told once, by GuardError.
        """
        if not self._given_up:
            return
        now, modes = self._clock.now(), self.board.control_modes()
        for joint in sorted(self._given_up):
            since = self._idle_since.get(joint, -np.inf)
            if modes[joint] in _LIMP or 0 <= now - since < _SETTLING:  # the state may be of before
                continue
            self._leave_idle(joint)
            if joint in self._powered_again:  # it goes on: all that can be done is to ask again
                continue
            self._powered_again.add(joint)
            self.give_up_companions(joint, "which is to stay idle")
            raise GuardError(
                f"{self._names[joint]} ({self.name} joint {joint}) had been left idle, and was in {modes[joint].word}: "
                "its board powers it with another joint, or somebody else does; it is idle again",
                joint,
            )

    def _watch_motion(self) -> None:
        """All but where joints are: one that is to come back may be anywhere."""
        now = self._clock.now()
        for quantity in self._quantities:
            self._watch_quantity(quantity, now)
        self._watch_contacts()
        # A clock may also jump back.
        if self._temperatures is not None and not 0 <= now - self._felt < _WARMING:
            self._felt = now
            self._watch_quantity(self._temperatures, now)

    def _watch_quantity(self, quantity: Watched, now: float) -> None:
        for wrong in quantity.look(now):
            self._judge(wrong)

    def _watch_contacts(self) -> None:
        """Stop all joints of a part that runs into something: whichever moved, it pressed with all of them."""
        if self._contacts is None or self.limits.contact is None:
            return
        try:
            strike = self._contacts.look(self.limits.contact)
        except NoForcesError as error:
            self._contacts = None
            self._report(f"{self.name} is not watched for contacts: {error}")
            return
        if not self._doubted and (doubt := self._contacts.doubt(self.limits.contact)):
            self._doubted = True
            self._report(f"{self.name} is watched less well for contacts: {doubt}")
        held = self._kept
        if strike is None or not held:
            return
        joint = max(held, key=lambda one: strike.speeds[one])
        what = "strikes something, or something is in the way"
        if strike.speeds[joint] < _STANDING:
            joint = self._farthest(held, joint)  # before the stop, after which no joint is to go anywhere
            what = "stands still by its encoder, and something pushes: it is held, or the encoder is frozen"
        self._stop(
            held,
            f"{self._names[joint]} ({self.name} joint {joint}) {what}; {self._contacts.source} shows at least "
            f"{strike.force:.0f} N from outside within {WITHIN:g} s, more than {self.limits.contact:g} N; "
            "all joints of the part were stopped",
            joint,
        )

    def _farthest(self, joints: list[int], otherwise: int) -> int:
        """The joint that is farthest from where it was told to move, where the board knows that."""
        with suppress(NotSupportedError, RefusedError):
            away = np.abs(self.board.target_positions() - self.board.encoders())
            return max(joints, key=lambda one: away[one])
        return otherwise

    def _judge(self, wrong: Wrong) -> None:
        found = [int(joint) for joint in np.flatnonzero(wrong.joints) if joint not in self._given_up]
        if found:
            joint = found[0]
            self._stop(
                [joint], f"{self._names[joint]} ({self.name} joint {joint}) {wrong.say(joint)}; it was stopped", joint
            )

    def _stop(self, joints: Sequence[int], text: str, joint: int) -> None:
        """Stop joints and raise GuardError with why: also where the board does not let them be stopped."""
        try:
            self.halt(joints)
        except RobotError as error:
            text = f"{text.rpartition('; ')[0]}; and it could not be stopped: {error}"
        if self.on_stop is not None:
            self.on_stop(joint)
        raise GuardError(text, joint, self.excuse())

    def halt(self, joints: Sequence[int]) -> None:
        """Stop joints in whatever modes they are. One that is driven by duty cycle, current or torque is held.

        Where the board sends no state nobody knows their modes: all of the part are stopped and held.
        """
        try:
            modes = self.board.control_modes()
        except StaleStateError:
            self._hold_unseen()
            return
        driven = [joint for joint in joints if modes[joint] in _DRIVEN]
        moving = [joint for joint in joints if modes[joint] not in _DRIVEN | _LIMP]
        problems = Problems()
        if driven:
            problems.attempt(self._hold, driven)
        if moving:
            problems.attempt(self.board.stop, moving)
        problems.tell("")

    def _hold_unseen(self) -> None:
        """Stop and hold all joints without knowing how they are; those that were without power have none again."""
        problems, idle = Problems(), self._limp_before
        if held := [joint for joint in self._kept if joint not in idle]:
            problems.attempt(self._hold, held)
            problems.attempt(self.board.stop, held)
        for joint in [*idle, *sorted(self._given_up)]:
            problems.attempt(self.board.set_control_modes, ControlMode.IDLE, joint)
        problems.tell("")

    @property
    def _limp_before(self) -> list[int]:
        return [joint for joint in self._kept if self.snapshot.modes[joint] is ControlMode.IDLE]

    def _hold(self, joints: Sequence[int]) -> None:
        """Have joints held where they are; without power where the board refuses that."""
        try:
            self.board.set_control_modes([ControlMode.POSITION] * len(joints), joints)
        except RefusedError:
            for joint in joints:
                try:
                    self.board.set_control_modes(ControlMode.POSITION, joint)
                except RefusedError:
                    self.board.set_control_modes(ControlMode.IDLE, joint)

    # Afterwards ------------------------------------------------------------------------------------------------------

    def restore(self, seconds: float = PARKING_TIME, *, where_it_was: bool = True) -> None:
        """Put the part back; ``seconds`` are what joints have to come back. Raises one RobotError for all problems.

        First of all nothing drives a joint any more. Then settings, ``where_it_was``, and modes. What was not changed
        is not written, and one thing that cannot be put back keeps no other from being so.
        """
        problems = Problems()
        with suppress(NoAnswerError):  # it was told, and all others would wait as long for the same
            problems.attempt(self.secure)
            problems.attempt(self._leave_companions)
            self._restore_settings(problems)
            problems.attempt(self._leave_faults)
            if where_it_was:
                problems.attempt(self._park, seconds)
            self._restore_modes(problems)
        problems.tell(f"{self.name} could not be put back as it was: ")

    def secure(self) -> None:
        """Have nothing drive a joint any more, and nothing go on: no reading is needed for that.

        Where the state does not come, and does not come back either, that is told by RobotError.
        """
        try:
            modes = self.board.control_modes()
        except StaleStateError as error:
            self._hold_unseen()
            if not self._sees_again():
                raise RobotError(f"{error}; its joints are held where they were then") from error
            self._report(f"the states of {self.name} had stopped, and come again; its joints were held meanwhile")
            modes = self.board.control_modes()
        on_their_way = self._on_their_way(modes)
        going = [joint for joint in self._kept if modes[joint] in _RESTLESS or joint in on_their_way]
        if going:
            self.halt(going)
        for joint in going:
            if modes[joint] in _DRIVEN:
                self._secured.add(joint)
                self._report(f"{self._names[joint]}: is held, was left in {modes[joint].word}")

    def _leave_companions(self) -> None:
        """Do not power joints that went idle with one that was given up: that one would be powered with them."""
        modes, before = self.board.control_modes(), self.snapshot.modes
        for joint in sorted(self._given_up):
            for other in self.companions(joint):
                if other not in self._given_up and modes[other] is ControlMode.IDLE is not before[other]:
                    self.give_up(other, f"its board left it so with {self._names[joint]}, with which it is coupled")

    def _sees_again(self) -> bool:
        """Wait whether states come again: a machine may have been too busy, or a network gone for a moment."""
        end = self._clock.now() + _RETURNING
        while self._clock.now() < end:
            self._clock.sleep(_PACE)
            with suppress(StaleStateError):
                self.board.encoders()
                return True
        return False

    def _restore_settings(self, problems: Problems) -> None:
        for joint in range(len(self._names)):
            for step in (self._restore_current, self._restore_limits, self._restore_impedance):
                problems.attempt(step, joint)
        problems.attempt(self._restore_pids, problems)
        problems.attempt(self._restore_interactions)

    def _on_their_way(self, modes: Sequence[ControlMode]) -> set[int]:
        """The joints that would go on to where they were told to, which a board does without anybody.

        Where it does not answer that, all that might are.
        """
        found = {joint for joint in self._kept if modes[joint] is ControlMode.MIXED}
        asked = [joint for joint in self._kept if modes[joint] is ControlMode.POSITION]
        try:
            return found.union(joint for joint in asked if answered(partial(self.board.motion_done, joint)) is False)
        except NoAnswerError:
            return found.union(asked)

    def _restore_current(self, joint: int) -> None:
        before = self.snapshot.max_currents[joint]
        if before is not None and self.board.max_current(joint) != before:
            self.board.set_max_current(joint, before)
            self._report(f"{self._names[joint]}: the greatest current is {before:g} A again")

    def _restore_limits(self, joint: int) -> None:
        before = self.snapshot.limits
        if before and self.board.limits(joint) != before[joint]:
            self.board.set_limits(joint, *before[joint])
            self._report(f"{self._names[joint]}: the limits are {before[joint]} deg again")

    def _restore_impedance(self, joint: int) -> None:
        before = self.snapshot.impedances[joint]
        if before is not None and self.board.impedance(joint) != before:
            self.board.set_impedance(joint, *before)
            self._report(f"{self._names[joint]}: stiffness and damping are {before} again")

    def _restore_pids(self, problems: Problems) -> None:
        board, all_now = self.board, answered(lambda: self.board.pids(PidType.POSITION))  # one question for all joints

        def restore(joint: int, before: Pid) -> None:
            if (all_now[joint] if all_now else board.pid(PidType.POSITION, joint)) != before:
                board.set_pid(PidType.POSITION, joint, before)
                self._report(f"{self._names[joint]}: the gains of the position controller are as before")

        for joint, before in enumerate(self.snapshot.pids):
            if before is not None:
                problems.attempt(restore, joint, before)

    def _restore_interactions(self) -> None:
        board, before = self.board, self.snapshot.interactions
        if before and board.interaction_modes() != before:
            for joint, mode in enumerate(before):
                if mode is not InteractionMode.UNKNOWN and board.interaction_mode(joint) is not mode:
                    board.set_interaction_modes(mode, joint)

    def _leave_faults(self) -> None:
        for joint, mode in enumerate(self.board.control_modes()):
            if mode is ControlMode.HARDWARE_FAULT and self.snapshot.modes[joint] is not ControlMode.HARDWARE_FAULT:
                self.board.set_control_modes(ControlMode.FORCE_IDLE, joint)
                self._report(f"{self._names[joint]} was in fault, and is forced out of it")

    def _park(self, seconds: float) -> None:
        """Bring joints that are somewhere else to where they were; all are stopped when that fails in any way."""
        idle = self._limp_before
        mine = [joint for joint in self._kept if joint not in idle and joint not in self.sliding]
        sent: list[int] = []
        end = self._clock.now() + seconds
        try:
            # One that nobody held may begin to sink only while others are on their way.
            while away := self._away(mine):
                if new := [joint for joint in away if joint not in sent]:
                    sent += new
                    self._send_home(new)
                if self._clock.now() > end:
                    self._complain_of(away, seconds)
                self._clock.sleep(_PACE)
                try:
                    self._watch_given_up()
                    self._watch_motion()
                except GuardError as error:
                    raise GuardError(f"on the way back {error}", error.joint, error.excuse) from None
        except BaseException as error:
            if isinstance(error, GuardError):
                MotionLedger().blocked(self.name)
            self.halt(sent)
            raise

    def _complain_of(self, away: Sequence[int], seconds: float) -> NoReturn:
        late = ", ".join(self._names[joint] for joint in away)
        raise GuardError(f"{late} did not come back to where it was within {seconds:g} s; it was stopped")

    def _away(self, joints: Sequence[int]) -> list[int]:
        """Which of them are not where they were. Raises GuardError for one that does not know where it is."""
        here, before = self.board.encoders(), self.snapshot.positions
        for joint in joints:
            if np.isnan(here[joint]):
                raise GuardError(f"{self._names[joint]} has no position, and cannot be brought back", joint)
        return [joint for joint in joints if abs(here[joint] - before[joint]) > _ARRIVED]

    def _send_home(self, joints: Sequence[int]) -> None:
        board = self.board
        board.set_control_modes([ControlMode.POSITION] * len(joints), joints)
        board.set_reference_speeds([PARKING_SPEED] * len(joints), joints)
        board.position_move(self.snapshot.positions[joints], joints)

    def _restore_modes(self, problems: Problems) -> None:
        board, before = self.board, self.snapshot

        def modes() -> None:
            for joint, (now, then) in enumerate(zip(board.control_modes(), before.modes, strict=True)):
                if joint not in self._given_up and now is not then and then in _RESTORABLE:
                    problems.attempt(self._restore_mode, joint, now)
            for joint in sorted(self._given_up):  # after all others, with which a board may have powered it
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
        if joint not in self._secured:  # else it was told, and the state that came last does not show it yet
            self._report(f"{self._names[joint]}: in {then.word} again, was left in {now.word}")


#: Modes that a joint may be put back into. Out of faults and calibration it is the board that decides; torque, current
#: and duty cycle need somebody who commands them.
_RESTORABLE = frozenset(
    {ControlMode.POSITION, ControlMode.POSITION_DIRECT, ControlMode.VELOCITY, ControlMode.MIXED, ControlMode.IDLE}
)
