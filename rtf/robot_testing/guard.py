"""The guard of a part: what it was like before, what it may not do meanwhile, and putting it back afterwards."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError, UnreachableError
from rtf.robot.interfaces import PidType
from rtf.robot_testing.contacts import WITHIN, NoForcesError
from rtf.testing.outcome import TestFailure

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.clock import Clock
    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.interfaces import FloatArray, Pid
    from rtf.robot_testing.contacts import ContactWatch

#: What joints are parked with, deg/s, and how long it may take, s.
PARKING_SPEED, PARKING_TIME = 20.0, 20.0
_ARRIVED = 2.0  # deg
_PACE = 0.05  # s
_STANDING = 1.0  # deg/s
_WARMING = 1.0  # s between two looks at temperatures


class GuardError(RobotError, TestFailure):
    """A part does what it may not: the sentence names the joint, the value and the limit. The joint was stopped.

    It is a failure of the test, for it is the robot that is wrong. ``joint`` is its number in the part, -1 where that
    is not told.
    """

    def __init__(self, text: str, joint: int = -1) -> None:
        super().__init__(text)
        self.joint = joint


@dataclass(frozen=True, slots=True)
class Limits:
    """What a joint may do while a test moves it; None: whatever it likes."""

    beyond: float = 5.0  # deg outside of its position limits
    speed: float = 1.5  # times its greatest speed
    current: float | None = 1.0  # times its greatest current
    torque: float | None = 1.5  # times what its motor can exert: more than that comes from outside
    temperature: float | None = 1.0  # times its limit
    #: N by which the force at the part's sensor may change suddenly beyond what its motion explains. A free limb of the
    #: simulated robot shows 0.3 N, falling or stopped from full speed, and 13 N where stamps are 20 ms wrong; one that
    #: strikes itself at 20 deg/s shows 25 N with a finger, 60 to 100 N with anything else.
    contact: float | None = 15.0


@dataclass(slots=True)
class Snapshot:
    """A part as it was: everything that a test may change and that outlives it. What a board has not got is missing."""

    positions: FloatArray
    modes: tuple[ControlMode, ...]
    interactions: tuple[InteractionMode, ...] = ()
    speeds: FloatArray | None = None
    accelerations: FloatArray | None = None
    limits: list[tuple[float, float]] = field(default_factory=list)
    max_currents: list[float] = field(default_factory=list)
    pids: list[Pid] = field(default_factory=list)
    impedances: list[tuple[float, float]] = field(default_factory=list)

    @classmethod
    def take(cls, board: RemoteControlBoard) -> Snapshot:
        """Ask a board for all of it. Raises RobotError when it cannot even say where its joints are."""
        shot = cls(board.encoders(), board.control_modes())
        joints = range(board.axes())

        def ask(fill: Callable[[], None]) -> None:
            with suppress(NotSupportedError):  # what it has not got nobody can change
                fill()

        ask(lambda: setattr(shot, "interactions", board.interaction_modes()))
        ask(lambda: setattr(shot, "speeds", board.reference_speeds()))
        ask(lambda: setattr(shot, "accelerations", board.reference_accelerations()))
        ask(lambda: setattr(shot, "limits", [board.limits(joint) for joint in joints]))
        ask(lambda: setattr(shot, "max_currents", [board.max_current(joint) for joint in joints]))
        ask(lambda: setattr(shot, "pids", list(board.pids(PidType.POSITION))))
        ask(lambda: setattr(shot, "impedances", [board.impedance(joint) for joint in joints]))
        return shot


class MotionGuard:
    """Guards one part through its board. ``clock`` is the robot's; ``report`` is told what had to be put back.

    ``watch`` is called while joints move, ``restore`` at the end, whatever has happened; both from one thread.
    ``contacts`` is the watch of the part's force-torque sensor; None: it is not watched for contacts.
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
        #: The greatest speeds, deg/s; infinite where there is none, and None where the board knows none.
        self.fastest = self._ask(lambda joint: board.velocity_limits(joint)[1])
        self._currents = np.array(self.snapshot.max_currents)
        self._torques = self._ask(lambda joint: max(map(abs, board.torque_range(joint))))
        self._hottest = self._ask(board.temperature_limit)
        self._felt = -np.inf  # when temperatures were last asked for, s of the robot's clock
        self._given_up: set[int] = set()
        self._contacts = contacts

    def _ask(self, question: Callable[[int], float]) -> FloatArray | None:
        """What the board says is the most of each joint; None where it has no such thing.

        Boards say 0, or refuse to say, for joints that have no such limit.
        """

        def most(joint: int) -> float:
            try:
                return question(joint) or np.inf
            except RefusedError:
                return np.inf

        try:
            return np.array([most(joint) for joint in range(self.board.axes())])
        except NotSupportedError:
            return None

    def give_up(self, joint: int, reason: str) -> None:
        """Leave a joint that does not obey without power: it is neither watched nor parked any more."""
        if joint in self._given_up:
            return
        self._given_up.add(joint)
        self._report(f"{self._names[joint]} is left idle: {reason}")
        self.board.set_control_modes(ControlMode.IDLE, joint)

    def given_up(self, joint: int) -> bool:
        """Whether a joint was left to itself."""
        return joint in self._given_up

    def watch(self) -> None:
        """Look whether every joint does what it may; stop the one that does not, and raise GuardError."""
        positions = self.board.encoders()
        if self.snapshot.limits:
            outside = (positions < self._low) | (positions > self._high)
            self._judge(outside, positions, "is at {:.1f} deg, beyond its limits")
        self._watch_motion()

    def _watch_motion(self) -> None:
        """All but where joints are: one that is to come back may be anywhere."""
        board = self.board
        if self.fastest is not None:
            speeds = np.abs(board.encoder_speeds())
            self._judge(speeds > self.limits.speed * self.fastest, speeds, "turns at {:.0f} deg/s, too fast")
        if self.limits.current is not None and self._currents.size:
            currents = np.abs(board.currents())
            self._judge(currents > self.limits.current * self._currents, currents, "draws {:.2f} A, too much")
        if self.limits.torque is not None and self._torques is not None:
            torques = np.abs(board.torques())
            self._judge(torques > self.limits.torque * self._torques, torques, "bears {:.1f} Nm, too much")
        self._watch_contacts()
        self._watch_temperatures()

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
        held = [joint for joint in range(len(self._names)) if joint not in self._given_up]
        if strike is None or not held:
            return
        joint = max(held, key=lambda one: strike.speeds[one])
        what = "strikes something, or something is in the way"
        if strike.speeds[joint] < _STANDING:
            joint = self._farthest(held, joint)  # before the stop, after which no joint is to go anywhere
            what = "stands still by its encoder, and something pushes: it is held, or the encoder is frozen"
        self.board.stop(held)
        raise GuardError(
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

    def _watch_temperatures(self) -> None:
        """They come slowly, and have to be asked for."""
        now = self._clock.now()
        if self.limits.temperature is None or self._hottest is None or now < self._felt + _WARMING:
            return
        self._felt = now
        try:
            temperatures = self.board.temperatures()
        except (NotSupportedError, RefusedError):
            self._hottest = None  # it has limits, and nothing that measures
            return
        self._judge(temperatures > self.limits.temperature * self._hottest, temperatures, "has {:.0f} degC, too hot")

    def _judge(self, wrong: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], values: FloatArray, what: str) -> None:
        found = [int(joint) for joint in np.flatnonzero(wrong) if joint not in self._given_up]
        if not found:
            return
        joint = found[0]
        self.board.stop(joint)
        raise GuardError(
            f"{self._names[joint]} ({self.name} joint {joint}) {what.format(values[joint])}; it was stopped", joint
        )

    def restore(self) -> None:
        """Put the part back: settings first, then its modes, then where its joints were. Raises one RobotError for all.

        What was not changed is not written.
        """
        problems: list[str] = []
        for step in (self._restore_settings, self._leave_faults, self._park, self._restore_modes):
            try:
                step()
            except UnreachableError as error:
                problems.append(str(error))
                break  # the others would wait as long for the same
            except RobotError as error:
                problems.append(str(error))
        if problems:
            raise RobotError(f"{self.name} could not be put back as it was: {'; '.join(problems)}")

    def _restore_settings(self) -> None:
        board, before = self.board, self.snapshot
        for joint, name in enumerate(self._names):
            if before.max_currents and board.max_current(joint) != before.max_currents[joint]:
                board.set_max_current(joint, before.max_currents[joint])
                self._report(f"{name}: the greatest current is {before.max_currents[joint]:g} A again")
            if before.limits and board.limits(joint) != before.limits[joint]:
                board.set_limits(joint, *before.limits[joint])
                self._report(f"{name}: the limits are {before.limits[joint]} deg again")
            if before.impedances and board.impedance(joint) != before.impedances[joint]:
                board.set_impedance(joint, *before.impedances[joint])
                self._report(f"{name}: stiffness and damping are {before.impedances[joint]} again")
        if before.pids:
            for joint, (now, then) in enumerate(zip(board.pids(PidType.POSITION), before.pids, strict=True)):
                if now != then:
                    board.set_pid(PidType.POSITION, joint, then)
                    self._report(f"{self._names[joint]}: the gains of the position controller are as before")
        if before.interactions and board.interaction_modes() != before.interactions:
            for joint, mode in enumerate(before.interactions):
                if mode is not InteractionMode.UNKNOWN and board.interaction_mode(joint) is not mode:
                    board.set_interaction_modes(mode, joint)

    def _leave_faults(self) -> None:
        for joint, mode in enumerate(self.board.control_modes()):
            if mode is ControlMode.HARDWARE_FAULT and self.snapshot.modes[joint] is not ControlMode.HARDWARE_FAULT:
                self.board.set_control_modes(ControlMode.FORCE_IDLE, joint)
                self._report(f"{self._names[joint]} was in fault, and is forced out of it")

    def _park(self) -> None:
        """Bring joints that are somewhere else to where they were; all are stopped when one does what it may not."""
        board, before = self.board, self.snapshot.positions
        away = [int(j) for j in np.flatnonzero(np.abs(board.encoders() - before) > _ARRIVED)]
        held = [j for j in away if self.snapshot.modes[j] is not ControlMode.IDLE and j not in self._given_up]
        if not held:
            return
        board.set_control_modes([ControlMode.POSITION] * len(held), held)
        board.set_reference_speeds([PARKING_SPEED] * len(held), held)
        board.position_move(before[held], held)
        end = self._clock.now() + PARKING_TIME
        while np.abs(board.encoders(held) - before[held]).max() > _ARRIVED:
            if self._clock.now() > end:
                late = [self._names[j] for j in held if abs(board.encoder(j) - before[j]) > _ARRIVED]
                raise GuardError(f"{', '.join(late)} did not come back to where it was within {PARKING_TIME:g} s")
            self._clock.sleep(_PACE)
            try:
                self._watch_motion()
            except GuardError as error:
                board.stop(held)
                raise GuardError(f"on the way back {error}", error.joint) from None

    def _restore_modes(self) -> None:
        board, before = self.board, self.snapshot
        if before.speeds is not None and not np.array_equal(board.reference_speeds(), before.speeds):
            board.set_reference_speeds(before.speeds)
        if before.accelerations is not None and not np.array_equal(
            board.reference_accelerations(), before.accelerations
        ):
            board.set_reference_accelerations(before.accelerations)
        for joint, (now, then) in enumerate(zip(board.control_modes(), before.modes, strict=True)):
            if joint in self._given_up:
                board.set_control_modes(ControlMode.IDLE, joint)
            elif now is not then and then in _RESTORABLE:
                board.set_control_modes(then, joint)
                self._report(f"{self._names[joint]}: in {then.word} again, was left in {now.word}")


#: Modes that a joint may be put back into. Out of faults and calibration it is the board that decides; torque, current
#: and duty cycle need somebody who commands them.
_RESTORABLE = frozenset(
    {ControlMode.POSITION, ControlMode.POSITION_DIRECT, ControlMode.VELOCITY, ControlMode.MIXED, ControlMode.IDLE}
)
