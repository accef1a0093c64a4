"""Torque control consistency: torque references can be read back, and joints stay in torque mode."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing import GuardError, RobotTest, Safety, likely_causes
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_to_end
from rtf.robot_testing.motion.start_position import bring, hold, starting_point
from rtf.robot_testing.torque_control import holding_torques, torque_joints
from rtf.robot_testing.torque_disturbance import motors_by_torques, torque_disturbance, weak_motor
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part
    from rtf.robot_testing.judging.blame import Evidence

#: Forms of the command: a single joint, a group of joints, the whole part.
_FORMS = ("single", "group", "all")
#: Time of measuring the torques that hold the joints, and time for a board to show its mode, s.
_HOLDING, _MODE_TIME = 0.2, 0.2
#: Time for a reference to arrive, and time of measuring its effect, s: several states average the noise.
_ARRIVING, _MEASURING = 0.03, 0.05
#: Longest time for the loop to settle, s: the change to torque mode is a step of its own.
_SETTLING = 0.3
#: Greatest displacement of a joint during the test, deg.
_TRAVEL = 10.0


class TorqueControlConsistency(RobotTest):
    """Commands torques a little above, at and below the one that holds a joint, and reads the references back.

    It uses all forms of the command: a single joint, a group, and the whole part. Joints that share motors with the
    tested ones are commanded the torques that hold them, as many boards put them into torque mode, too.
    """

    aliases = ("torqueControl-consistency", "torqueControlConsistency", "TorqueControl-consistency")
    tags = ("motion", "torque", "interfaces")
    safety = Safety.EFFORT
    torque_control = True

    part = Parameter(str, "the part whose joints are tested", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all with torque control", default=[])
    zero = Parameter(list[float], "positions of the joints; none: the current ones", unit="deg", default=[])
    change = Parameter(
        float, "difference of the torques from the holding ones", unit="Nm", default=0.1, low=0.001, high=1.0
    )
    tolerance = Parameter(
        float, "tolerance of a reference that is read back", unit="Nm", default=0.005,
        low=0.0,
    )  # fmt: skip
    answer = Parameter(float, "tolerance of the measured torque", unit="Nm", default=0.3, low=0.0)

    def setup(self) -> None:
        """Open the part and move its joints to their start positions."""
        super().setup()
        self.robot_part = part = self.open_part(self.part)
        self.chosen = torque_joints(self, part, self.joints)
        self._stayed = set[int]()  # the joints that did not move away when they were tested alone
        self.transmission = Transmission.read_couplings(part.board)
        self.transmission.warn_if_unknown(self, part.name)
        zeros: list[float | None] = [*self.per_joint("zero", self.zero, self.chosen)] if self.zero else []
        self.places = {
            joint: starting_point(part, joint, zero, _TRAVEL / 2, both_sides=True)[0]
            for joint, zero in zip(self.chosen, zeros or [None] * len(self.chosen), strict=True)
        }
        try:
            bring(self, part, self.chosen, [*self.places.values()])
        except GuardError as error:
            self.blame(part, error, joints=self.chosen, ends=True)

    def run(self) -> None:
        """Test the forms in turn; in the single form joint by joint."""
        part = self.robot_part
        for number, form in enumerate(_FORMS):
            self.progress(number / len(_FORMS), form)
            if form == "single":
                for joint in self.chosen:
                    self._test_alone(part, joint)
            else:
                self._test_together(part, form)
        kept = {joint: place for joint, place in self.places.items() if joint in part.held()}
        bring(self, part, [*kept], [*kept.values()])

    def _test_alone(self, part: Part, joint: int) -> None:
        if self.judge_if_lost(part, joint):
            return
        try:
            self._test(part, "single", [joint])
        except GuardError as error:
            known = motors_by_torques(part, self.transmission, joint)
            self.judge_stop(part, joint, error, "runs away", known=known)
        part.wait(_MODE_TIME)

    def _test_together(self, part: Part, form: str) -> None:
        joints = part.held(self.chosen)
        self.assert_fail_if_false(joints, "no joint is left to test")
        try:
            self._test(part, form, joints)
        except GuardError as error:
            self.blame(part, error, "runs away", joints=joints, during=form, ends=True)
        part.wait(_MODE_TIME)

    def _test(self, part: Part, form: str, joints: Sequence[int]) -> None:
        """Test joints at a time. Raises GuardError, also for a stop on the way back."""
        try:
            found, ways = self._answers(part, form, joints)
        finally:
            hold(part, joints)
        moved = {joint: float(way) for joint, way in ways.items() if way > _TRAVEL}
        excuse = part.guard.excuse() if part.guard is not None and moved else ""
        if form == "single":
            self._stayed |= {*joints} - {*moved}
        for joint in [*joints, *sorted({*moved} - {*joints})]:
            with self.subresult(f"{part.names[joint]} {form}"):
                pulled = self._judge_way(part, joint, moved[joint], excuse) if joint in moved else ""
                for one in found if joint in joints else ():
                    self._judge(part, joint, one)
                if pulled:
                    self.inconclusive(pulled)

    def _answers(self, part: Part, form: str, joints: Sequence[int]) -> tuple[list[_Answer], dict[int, float]]:
        """Command the torques in turn; return the answers, and how far each joint moved in the end (deg)."""
        torques = run_to_end(part, holding_torques(self, part, joints, _HOLDING), pace=PACE)
        chosen, others = [*joints], self._others(joints)
        commanded = np.full(part.axes, np.nan)
        commanded[chosen + others] = torques[chosen + others]
        before = part.median_positions()
        part.board.set_control_modes([ControlMode.TORQUE] * len(chosen), chosen)
        if others:  # joints in other modes ignore the command
            part.board.set_reference_torques(torques[others], others)
        self._command(part, form, chosen, torques[chosen], torques)
        part.wait_until(lambda: bool(self._in_torque_mode(part, chosen).all()), _MODE_TIME, pace=0.01)
        found = []
        for change in (self.change, 0.0, -self.change):
            commanded[chosen] = torques[chosen] + change
            self._command(part, form, chosen, commanded[chosen], torques)
            part.wait_to_arrive(partial(self._has_arrived, part, chosen, commanded[chosen]), _ARRIVING, pace=0.01)
            measured, ways = self._measure(part, chosen, commanded, before)
            reported = np.full(part.axes, np.nan)
            reported[chosen] = part.board.reference_torques(chosen)
            found.append(_Answer(change, commanded.copy(), reported, measured, self._in_torque_mode(part)))
            if ways[chosen + others].max() > _TRAVEL:
                break
        return found, {joint: ways[joint] for joint in chosen + others}

    def _has_arrived(self, part: Part, joints: Sequence[int], wanted: FloatArray) -> bool:
        """Whether the references at the board are those that were sent."""
        return bool((np.abs(part.board.reference_torques(joints) - wanted) <= self.tolerance).all())

    def _measure(
        self, part: Part, joints: Sequence[int], commanded: FloatArray, before: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean torques of all joints (Nm), and how far they moved (deg).

        Ends when the mean of the last states has settled at the setpoints of the ``joints``, or one with a new setpoint
        has moved too far.
        """
        known = np.isfinite(commanded)

        def ways() -> FloatArray:
            return np.abs(part.median_positions() - before)

        def torques() -> FloatArray:
            last = trace.time > trace.time[-1] - _MEASURING
            means: FloatArray = trace.torques[last].mean(axis=0)
            return means

        def settled() -> bool:
            full = len(trace) > 1 and trace.time[-1] - trace.time[0] >= _MEASURING
            return full and bool((np.abs(torques() - commanded)[joints] <= self.answer).all())

        with part.recorded() as trace:
            part.wait_until(lambda: settled() or bool(ways()[known].max() > _TRAVEL), _SETTLING, pace=0.01)
        return torques() if len(trace) else part.board.torques(), ways()

    def _others(self, joints: Sequence[int]) -> list[int]:
        """Return the joints that are coupled with some joints."""
        return sorted({other for joint in joints for other in self.transmission.coupled(joint)} - {*joints})

    def _command(self, part: Part, form: str, joints: Sequence[int], torques: FloatArray, every: FloatArray) -> None:
        """Send torques in one form; ``every`` are those of all joints. Joints in other modes ignore the command."""
        if form == "single":
            part.board.set_reference_torques(float(torques[0]), joints[0])
        elif form == "group":
            part.board.set_reference_torques(torques, joints)
        else:
            whole = every.copy()
            whole[list(joints)] = torques
            part.board.set_reference_torques(whole)

    def _in_torque_mode(self, part: Part, joints: Sequence[int] | None = None) -> NDArray[np.bool_]:
        return np.array([mode is ControlMode.TORQUE for mode in part.board.control_modes(joints)])

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge_way(self, part: Part, joint: int, way: float, excuse: str) -> str:
        """Judge a joint that moved too far; return what to say last of one that stayed when it was tested alone."""
        text = (
            f"{part.names[joint]} moved by {part.shown(joint, way, '.1f')} at torques within "
            f"{part.shown_torque(joint, self.change, 'g')} of its holding torque; "
            f"{part.shown(joint, _TRAVEL, 'g')} are allowed"
        )
        motors = motors_by_torques(part, self.transmission, joint)
        if reason := excuse or self._cause(part, joint, motors):  # the torques hold it for a moment only
            self.inconclusive(f"{text}; but {reason}")
        if joint in self._stayed:
            return f"{text}; but it stays when it is tested alone: another joint moves it"
        self.check(False, f"{text}; {likely_causes('runs away')}")
        return ""

    def _cause(self, part: Part, joint: int, motors: Sequence[Evidence]) -> str:
        """Return which other joint or motor explains that a joint moved, or that its torque is wrong; "" if none."""
        return self.explained(part, joint) or torque_disturbance(part, joint, motors)

    def _judge(self, part: Part, joint: int, answer: _Answer) -> None:
        name, what = part.names[joint], self.as_text(answer.change, "Nm", "+g")
        in_mode = bool(answer.in_mode[joint])
        if not self.check_fail_if_false(in_mode, f"{name} is not in torque mode at {what}; {likely_causes('mode')}"):
            return
        commanded, reported, measured = (
            float(each[joint]) for each in (answer.commanded, answer.reported, answer.measured)
        )
        given = f"{name} was commanded {self.as_text(commanded, 'Nm', '.3f')} and"
        hint = f"{given} reports {self.as_text(reported, 'Nm', '.3f')}; {likely_causes('lost commands')}"
        self.measure(
            f"reference that is read back, {what}",
            reported - commanded,
            "Nm",
            -self.tolerance,
            self.tolerance,
            hint=hint,
        )
        seen = f"{given} measures {self.as_text(measured, 'Nm', '.3f')}"
        known = ""
        if abs(measured - commanded) > self.answer:
            motors = motors_by_torques(part, self.transmission, joint)
            if cause := self._cause(part, joint, motors):
                self.inconclusive(f"{seen}; but {cause}")
            known = weak_motor(joint, motors)
        hint = f"{seen}; {known or likely_causes('torque answer')}"
        self.measure(
            f"measured minus commanded, {what}", measured - commanded, "Nm", -self.answer, self.answer, hint=hint
        )


class _Answer(NamedTuple):
    """What a board did at torques that differ by ``change`` (Nm) from the holding ones; arrays over all joints.

    ``commanded``, ``reported`` and ``measured`` are torques (Nm), the first two NaN for joints without a command.
    ``in_mode``: torque mode.
    """

    change: float
    commanded: FloatArray
    reported: FloatArray
    measured: FloatArray
    in_mode: NDArray[np.bool_]
