"""The motion guard of a part: snapshot before a test, limits during it, and restoration afterwards."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError, StaleStateError
from rtf.robot_testing.guard.contacts import WITHIN, NoForcesError
from rtf.robot_testing.guard.coverage import coverage_table
from rtf.robot_testing.guard.guarded_part import GuardedPart
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.monitored_quantities import (
    PEAK_RATIO,
    MonitoredPart,
    MonitoredQuantity,
    Violation,
    greatest_speeds,
    state_quantities,
    temperatures,
)
from rtf.robot_testing.guard.planned_moves import AHEAD
from rtf.robot_testing.guard.restoration import RETURN_TIME, Restoration
from rtf.robot_testing.guard.snapshot import answered
from rtf.robot_testing.guard.watches.joint_state import JointBounds
from rtf.robot_testing.guard.watches.joint_watch import JointWatch
from rtf.robot_testing.judging.real_time_checks import RecentCpuPressure
from rtf.robot_testing.slides import in_units, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.clock import Clock
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel
    from rtf.robot_testing.guard.contacts import ContactWatch
    from rtf.robot_testing.guard.heartbeat import Heartbeat
    from rtf.robot_testing.guard.planned_moves import MoveCheck

_AT_REST = 1.0  # deg/s
_TEMPERATURE_PERIOD = 1.0  # s between two readings of the temperatures
#: Quantities of which too much means that a joint presses.
_EFFORTS = frozenset({"current", "torque"})


class MotionGuard(GuardedPart):
    """Guard of one part. ``clock`` is the robot's; ``report`` gets a line for everything that had to be restored.

    Call ``watch`` periodically while joints move, and ``restore`` at the end in any case, both in the same thread.
    ``contacts`` detects contacts by the part's force-torque sensor; None: contacts are not detected. ``name`` is the
    prefix of the part's port names. ``robot`` has the currents of its motors and the times of the watches; None: the
    board's currents and the usual times. ``heartbeat`` shows the fixture ``robot`` that this guard watches. ``moves``
    checks planned moves, and where joints go; None: they are not checked.
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
        robot: RobotModel | None = None,
        heartbeat: Heartbeat | None = None,
        moves: MoveCheck | None = None,
    ) -> None:
        super().__init__(board, name, clock=clock, report=report)
        self.limits = limits or Limits()
        self._low = np.array([low for low, _ in self.snapshot.limits]) - self.limits.beyond
        self._high = np.array([high for _, high in self.snapshot.limits]) + self.limits.beyond
        #: The greatest speeds, deg/s; infinite if the board has none.
        self.fastest = greatest_speeds(board)
        self._report_joints()
        place = MonitoredPart(name, self.names, report)
        self._quantities = state_quantities(board, place, self.limits, self.fastest, self.snapshot.max_currents)
        self._temperatures = temperatures(board, place, self.limits)
        self._temperatures_read = -np.inf  # when the temperatures were last read, s of the robot's clock
        self._restoration = Restoration(self, self._watch_way_back, self.fastest / PEAK_RATIO)
        self._joints = self._watch_joints(robot)
        self._heartbeat = heartbeat
        self._moves = moves
        self._contacts = contacts
        self._limitation_reported = False  # whether the low sensitivity to contacts was reported
        self._cpu_pressure = RecentCpuPressure()
        self._stops = Counter[int]()  # how often joints were stopped
        #: Called with a joint that was stopped.
        self.on_stop: Callable[[int], object] | None = None

    def _watch_joints(self, robot: RobotModel | None) -> JointWatch | None:
        if not self.limits.pressing:
            return None
        bounds = JointBounds.of(self.board, self.names, robot)
        return JointWatch(self.board, self.names, bounds, currents=self.limits.current is not None)

    def _report_joints(self) -> None:
        """Report the joints that are watched without a speed limit, and those that are not moved."""
        if unknown := [self.names[joint] for joint in np.flatnonzero(np.isinf(self.fastest))]:
            self.report(f"{self.name} has no greatest speed for {', '.join(unknown)}: their speeds have no limit")
        if sliding := [self.names[joint] for joint in sorted(self.sliding)]:
            self.report(f"{self.name}: {', '.join(sliding)} are prismatic: tests do not move them")

    def set_contact_watch(self, contacts: ContactWatch | None) -> None:
        """Start contact detection; None stops it."""
        self._contacts = contacts

    # While joints move -----------------------------------------------------------------------------------------------

    def watch(self) -> None:
        """Check all limits; stop a joint that violates one, and raise GuardError.

        Raises StaleStateError if states no longer arrive; all joints are held then.
        """
        try:
            self._check_limits()
        except StaleStateError:
            with suppress(RobotError):  # reported by ``restore``, which reads the states first
                self.reactions.hold_without_states()
            raise

    def excuse(self) -> str:
        """Return the overload of this machine that may have caused a violation just now; "" if there was none.

        There is none in lockstep, as the robot's time waits for this process.
        """
        return "" if isinstance(self.clock, LockstepClock) else self._cpu_pressure.overload()

    def _check_limits(self) -> None:
        self._cpu_pressure.update()
        self.watch_excluded()
        positions = self.board.encoders()
        self._judge(
            Violation(np.isnan(positions), lambda joint: f"has no position: its encoder gives {positions[joint]}")
        )
        if self.snapshot.limits:
            outside = (positions < self._low) | (positions > self._high)
            where = partial(shown, self.board, spec=".1f")
            self._judge(Violation(outside, lambda joint: f"is at {where(joint, positions[joint])}, beyond its limits"))
        if self.limits.fault:
            self._watch_faults()
        self._watch_motion()

    def _watch_faults(self) -> None:
        """Stop all joints when one is in hardware fault that was not in the snapshot."""
        modes, before, fault = self.board.control_modes(), self.snapshot.modes, ControlMode.HARDWARE_FAULT
        joint = next((one for one in self.included if modes[one] is fault and before[one] is not fault), None)
        if joint is not None:
            cause = answered(partial(self.board.last_joint_fault, joint))
            why = f": {cause[1]}" if cause is not None and cause[1] else ""
            text = f"{self.names[joint]} ({self.name} joint {joint}) went into hardware fault{why}"
            self._stop(self.included, f"{text}; all joints of the part were stopped", joint)

    def _watch_way_back(self) -> None:
        """Check what is checked while joints are moved back: one may be outside of its limits then."""
        self.watch_excluded()
        self._watch_motion()

    def _watch_motion(self) -> None:
        """Check all limits but those of positions: a joint on its way back may be outside of them."""
        now = self.clock.now()
        if self._heartbeat is not None and (why := self._heartbeat.beat()):
            raise GuardError(why, excuse=self.excuse())
        self.watch_pressing()
        for quantity in self._quantities:
            self._watch_quantity(quantity, now)
        self._watch_ahead()
        self._watch_contacts()
        # The clock may also be set back.
        if self._temperatures is not None and not 0 <= now - self._temperatures_read < _TEMPERATURE_PERIOD:
            self._temperatures_read = now
            self._watch_quantity(self._temperatures, now)

    def watch_pressing(self) -> None:
        """Release a joint that presses, with those that share its motors: a mere stop would let it press on."""
        press = self._joints and self._joints.check(self.excluded)
        if not press or self._joints is None:
            return
        released = self._with_sharing(press.joint)
        joint = self._joints.farthest(released)
        motor = (
            "" if joint == press.joint else f"stands still, and a motor that it shares with {self.names[press.joint]} "
        )
        self._joints.forget(released)
        text = f"{self.names[joint]} ({self.name} joint {joint}) {motor}{press.text}; it was released"
        self._stop(released, text, joint, self.reactions.release, finding="blocked")

    def _watch_quantity(self, quantity: MonitoredQuantity, now: float) -> None:
        """Stop the first joint with too much of a quantity; raises GuardError.

        One that may press is released, as a mere stop would let it press on: with too much current or torque, or if it
        shares motors with others, of which one may be blocked.
        """
        for wrong in quantity.check(now):
            if (joint := self._first(wrong)) is not None:
                joints = self._with_sharing(joint)
                presses = quantity.what in _EFFORTS or len(joints) > 1
                self._stop(joints, self._described(wrong, joint), joint, self.reactions.release if presses else None)

    def coverage(self) -> str:
        """Return the table of what is watched."""
        known = np.ones(len(self.names), dtype=bool)
        watched, missing = {"position": known}, dict[str, str]()
        quantities = [*self._quantities, *([] if self._temperatures is None else [self._temperatures])]
        watched |= {one.what: one.limited for one in quantities}
        if self._joints is not None:
            watched |= self._joints.coverage()
            missing |= self._joints.missing()
        else:
            missing["pressing"] = "this test drives joints against their limits, or without power"
        if self._contacts is not None and self.limits.contact is not None:
            watched["contact"] = known
        else:
            missing["contact"] = "no force-torque sensor" if self._contacts is None else "joints of this test fall"
        if self._moves is not None:
            watched["self-collision"] = known
        else:
            missing["self-collision"] = "see the parameter check_moves"
        if self._heartbeat is None:
            missing["other parts, and a test that hangs"] = "in lockstep the robot's time waits for the test"
        return coverage_table(self.name, self.names, watched, missing)

    @property
    def checks_moves(self) -> bool:
        """Whether planned moves are checked."""
        return self._moves is not None

    def check_move(self, targets: FloatArray, joints: Sequence[int], speeds: FloatArray) -> None:
        """Check a move that is about to be commanded. Raises RefusedMoveError.

        Boards keep their limits. One that does not is found on the way, as motion is checked ahead, too.
        """
        if self._moves is None:
            return
        limits = np.array(self.snapshot.limits)
        kept = np.clip(targets, limits[joints, 0], limits[joints, 1]) if limits.size else targets
        part = self.name.rpartition("/")[2]
        self._moves.check(part, joints, in_units(self.board, kept, joints), in_units(self.board, speeds, joints))

    def _watch_ahead(self) -> None:
        """Stop all joints of a part before two links of the robot touch."""
        if self._moves is None or self.limits.contact is None:
            return
        speeds = self.board.encoder_speeds()
        if wrong := self._moves.ahead(self.name.rpartition("/")[2], in_units(self.board, speeds)):
            joint = int(np.nanargmax(np.abs(speeds)))
            text = (
                f"{self.names[joint]} ({self.name} joint {joint}) goes on, and {wrong} within {AHEAD:g} s by the model"
            )
            self._stop(self.included, f"{text}; all joints of the part were stopped", joint)

    def _watch_contacts(self) -> None:
        """Stop all joints of a part that is in contact: all of them may contribute to the force."""
        if self._contacts is None or self.limits.contact is None:
            return
        try:
            contact = self._contacts.detect(self.limits.contact)
        except NoForcesError as error:
            self._contacts = None
            self.report(f"{self.name} is not watched for contacts: {error}")
            return
        if not self._limitation_reported and (limitation := self._contacts.limitation(self.limits.contact)):
            self._limitation_reported = True
            self.report(f"{self.name} is watched for contacts with less sensitivity: {limitation}")
        held = self.included
        if contact is None or not held:
            return
        joint = max(held, key=lambda one: abs(contact.speeds[one]))
        what = "is in contact with an obstacle"
        if abs(contact.speeds[joint]) < _AT_REST:
            joint = self._farthest(held, joint)  # before the stop, which changes the targets
            what = "is at rest by its encoder, but in contact: something holds it, or the encoder is frozen"
        text = (
            f"{self.names[joint]} ({self.name} joint {joint}) {what}; {self._contacts.source} shows at least "
            f"{contact.force:.0f} N of contact within {WITHIN:g} s, more than {self.limits.contact:g} N; "
            "all joints of the part were stopped"
        )
        limits = np.array(self.snapshot.limits).reshape(-1, 2).T
        self._stop(held, text, joint, lambda joints: self.reactions.go_back(joints, contact.speeds, *limits))

    def _farthest(self, joints: list[int], otherwise: int) -> int:
        """Return the joint farthest from its target; ``otherwise`` if the board does not report targets."""
        with suppress(NotSupportedError, RefusedError):
            away = np.abs(self.board.target_positions() - self.board.encoders())
            return max(joints, key=lambda one: away[one])
        return otherwise

    def _judge(self, wrong: Violation) -> None:
        """Stop the first joint with a violation; raises GuardError."""
        if (joint := self._first(wrong)) is not None:
            self._stop([joint], self._described(wrong, joint), joint)

    def _first(self, wrong: Violation) -> int | None:
        if not wrong.joints.any():  # nearly always, at every tick
            return None
        return next((int(joint) for joint in np.flatnonzero(wrong.joints) if joint not in self.excluded), None)

    def _described(self, wrong: Violation, joint: int) -> str:
        return f"{self.names[joint]} ({self.name} joint {joint}) {wrong.describe(joint)}; it was stopped"

    def _with_sharing(self, joint: int) -> list[int]:
        """Return a joint and those that share its motors, without the excluded ones."""
        return [joint, *(one for one in self.coupled_with(joint) if one not in self.excluded)]

    def _stop(
        self,
        joints: Sequence[int],
        text: str,
        joint: int,
        react: Callable[[Sequence[int]], None] | None = None,
        *,
        finding: str = "stopped",
    ) -> NoReturn:
        """Stop joints and raise GuardError with ``text``, even if the board refuses to stop them."""
        time = self.clock.now()
        self._stops[joint] += 1
        try:
            (react or self.halt)(joints)
        except RobotError as error:
            text = f"{text.rpartition('; ')[0]}; it could not be stopped: {error}"
        if self.on_stop is not None:
            self.on_stop(joint)
        raise GuardError(text, joint, self.excuse(), finding, time, self.name)

    def exclude_if_stopped_again(self, joint: int) -> bool:
        """Exclude a joint that had to be stopped more than once, with those that share its motors; return whether.

        The first stop may be an accident.
        """
        if self._stops[joint] <= 1:
            return False
        self.exclude(joint, "it had to be stopped again")
        self.exclude_coupled(joint, "which was left without power")
        return True

    # Afterwards ------------------------------------------------------------------------------------------------------

    def restore(self, seconds: float = RETURN_TIME, *, move_back: bool = True) -> None:
        """Restore the part as it was in the snapshot. Raises one RobotError for all problems.

        The order is: stop all motion, restore the settings, move the joints back within ``seconds`` (only with
        ``move_back``), and restore the modes. Unchanged settings are not written. A step that fails does not keep
        the following ones from being done.
        """
        self._restoration.run(seconds, move_back=move_back)

    def going(self) -> list[int]:
        """Return the joints that are driven, or move to a target, and go on without a client."""
        return self._restoration.going(self.board.control_modes())

    def secure(self) -> None:
        """Stop all joints that are driven or move. It needs no settings of the board.

        If states do not arrive all joints are held; RobotError is raised if they do not come back.
        """
        self._restoration.secure()
