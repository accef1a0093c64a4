"""Torque control consistency: torque references can be read back, and joints stay in torque mode."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing import GuardError, RobotTest, Safety, likely_causes
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_to_end
from rtf.robot_testing.motion.start_position import bring, hold, starting_point
from rtf.robot_testing.torque_control import holding_torques, torque_joints
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part

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
        self.places = [
            starting_point(part, joint, zero, _TRAVEL / 2, both_sides=True)[0]
            for joint, zero in zip(self.chosen, zeros or [None] * len(self.chosen), strict=True)
        ]
        bring(self, part, self.chosen, self.places)

    def run(self) -> None:
        """Test the forms in turn; in the single form joint by joint."""
        part = self.robot_part
        for number, form in enumerate(_FORMS):
            self.progress(number / len(_FORMS), form)
            groups = [[joint] for joint in self.chosen] if form == "single" else [self.chosen]
            for group in groups:
                try:
                    try:
                        self._test(part, form, group)
                    finally:
                        hold(part, group)
                except GuardError as error:  # also on the way back
                    self.blame(part, error, "runs away", joints=group, during=form)
                part.wait(_MODE_TIME)
        bring(self, part, self.chosen, self.places)

    def _test(self, part: Part, form: str, joints: Sequence[int]) -> None:
        torques = run_to_end(part, holding_torques(self, part, joints, _HOLDING), pace=PACE)
        held, others = torques[list(joints)], self._others(joints)
        before = part.board.encoders()
        part.board.set_control_modes([ControlMode.TORQUE] * len(joints), joints)
        if others:  # joints in other modes ignore the command
            part.board.set_reference_torques(torques[others], others)
        self._tell(part, form, joints, held, torques)
        part.wait_until(lambda: bool(self._in_torque_mode(part, joints).all()), _MODE_TIME, pace=0.01)
        found = []
        for change in (self.change, 0.0, -self.change):
            wanted = held + change
            self._tell(part, form, joints, wanted, torques)
            part.wait_to_arrive(partial(self._has_arrived, part, joints, wanted), _ARRIVING, pace=0.01)
            measured, gone = self._measure(part, [*joints, *others], wanted, before)
            found.append((
                change, wanted, part.board.reference_torques(joints), measured,
                self._in_torque_mode(part, joints),
            ))  # fmt: skip
            if gone.max() > _TRAVEL:
                break
        excuse = part.guard.excuse() if part.guard is not None and gone.max() > _TRAVEL else ""
        if form == "single":
            self._stayed |= {joint for place, joint in enumerate(joints) if gone[place] <= _TRAVEL}
        hold(part, joints)
        for place, joint in enumerate([*joints, *others]):
            if place >= len(joints) and gone[place] <= _TRAVEL:
                continue
            with self.subresult(f"{part.names[joint]} {form}"):
                pulled = ""
                if gone[place] > _TRAVEL:
                    what = (
                        f"{part.names[joint]} moved by {part.shown(joint, gone[place], '.1f')} at torques within "
                        f"{part.shown_torque(joint, self.change, 'g')} of its holding torque; "
                        f"{part.shown(joint, _TRAVEL, 'g')} are allowed"
                    )
                    if excuse:  # they hold it for a moment only
                        self.inconclusive(f"{what}; but {excuse}")
                    if len(joints) > 1 and joint in self._stayed:
                        pulled = f"{what}; but it stays when it is tested alone: another joint moves it"
                    else:
                        self.check(False, f"{what}; {likely_causes('runs away')}")
                for change, wanted, reported, measured, kept in found if place < len(joints) else ():
                    self._judge(
                        part.names[joint],
                        change,
                        wanted[place],
                        reported[place],
                        measured[place],
                        kept=bool(kept[place]),
                    )
                if pulled:
                    self.inconclusive(pulled)

    def _has_arrived(self, part: Part, joints: Sequence[int], wanted: FloatArray) -> bool:
        """Whether the references at the board are those that were sent."""
        return bool((np.abs(part.board.reference_torques(joints) - wanted) <= self.tolerance).all())

    def _measure(
        self, part: Part, joints: Sequence[int], wanted: FloatArray, before: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean torques (Nm) of the first joints, for which some are wanted, and how far all moved (deg).

        Ends when the mean of the last states has settled at what is wanted, or a joint has moved too far.
        """

        def gone() -> FloatArray:
            return np.abs(part.board.encoders(joints) - before[joints])

        def torques() -> FloatArray:
            last = trace.time > trace.time[-1] - _MEASURING
            means: FloatArray = trace.torques[last][:, joints[: len(wanted)]].mean(axis=0)
            return means

        def settled() -> bool:
            full = len(trace) > 1 and trace.time[-1] - trace.time[0] >= _MEASURING
            return full and bool((np.abs(torques() - wanted) <= self.answer).all())

        with part.recorded() as trace:
            part.wait_until(lambda: settled() or bool(gone().max() > _TRAVEL), _SETTLING, pace=0.01)
        return torques() if len(trace) else part.board.torques(joints[: len(wanted)]), gone()

    def _others(self, joints: Sequence[int]) -> list[int]:
        """Return the joints that are coupled with some joints."""
        return sorted({other for joint in joints for other in self.transmission.coupled(joint)} - {*joints})

    def _tell(self, part: Part, form: str, joints: Sequence[int], torques: FloatArray, every: FloatArray) -> None:
        """Send torques in one form; ``every`` are those of all joints. Joints in other modes ignore the command."""
        if form == "single":
            part.board.set_reference_torques(float(torques[0]), joints[0])
        elif form == "group":
            part.board.set_reference_torques(torques, joints)
        else:
            whole = every.copy()
            whole[list(joints)] = torques
            part.board.set_reference_torques(whole)

    def _in_torque_mode(self, part: Part, joints: Sequence[int]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        return np.array([mode is ControlMode.TORQUE for mode in part.board.control_modes(joints)])

    def _judge(self, name: str, change: float, wanted: float, reported: float, measured: float, *, kept: bool) -> None:
        what = self.as_text(change, "Nm", "+g")
        if not self.check_fail_if_false(kept, f"{name} is not in torque mode at {what}; {likely_causes('mode')}"):
            return
        off = float(reported - wanted)
        told = f"{name} was commanded {self.as_text(wanted, 'Nm', '.3f')} and"
        hint = f"{told} reports {self.as_text(reported, 'Nm', '.3f')}; {likely_causes('lost commands')}"
        self.measure(f"reference that is read back, {what}", off, "Nm", -self.tolerance, self.tolerance, hint=hint)
        missing = float(measured - wanted)
        hint = f"{told} measures {self.as_text(measured, 'Nm', '.3f')}; {likely_causes('torque answer')}"
        self.measure(f"measured minus told, {what}", missing, "Nm", low=-self.answer, high=self.answer, hint=hint)
