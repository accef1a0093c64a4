"""Torque control stiffness and damping check: a compliant joint moves by its stiffness and its damping."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import InteractionMode
from rtf.robot_testing import GuardError, RobotTest, Safety, fit_line, likely_causes
from rtf.robot_testing.guard.simulated import is_simulated
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.start_position import bring, hold, starting_point
from rtf.robot_testing.torque_control import greatest_torque, torque_joints
from rtf.robot_testing.torque_disturbance import motors_by_torques, torque_disturbance, weak_motor
from rtf.simulator.control_client import SimulatorControl
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part, Trace
    from rtf.robot_testing.judging.blame import Evidence

#: Time at rest before a joint is moved, and time for a board to show its mode, s.
_REST, _MODE_TIME = 0.3, 0.5
#: Displacement after which a joint is held at once, deg.
_TRAVEL = 25.0
#: The speed to which a push brings a joint with damping only (deg/s), and the deflection of one with stiffness only
#: (deg), which overshoots to twice as much; the greatest deflection (deg) and duration (s) of a push; and the time for
#: which the joint swings freely (s).
_SPEED, _WAY, _REACH, _PUSH_TIME, _SWING_OUT = 25.0, 2.5, 6.0, 0.3, 0.4
#: The speed (deg/s) below which it has swung out at its home, for how long, the longest time for that and the pace of
#: a push (s).
_SLOW, _STILL, _SWING_TIME, _PACE = 20.0, 0.2, 3.0, 0.01
#: Friction that a push has to overcome beyond spring and damper, as a share of the greatest torque.
_FRICTION = 0.03
#: The ratio of the variance of second differences of noise to that of the noise: 1 + 4 + 1.
_OF_SECOND_DIFFERENCES = 6.0
#: The least share of motion in the measured variance of the motion.
_LEAST_MOTION = 0.5


class TorqueControlStiffDampCheck(RobotTest):
    """Makes each joint compliant, first with stiffness only, then with damping only, and has it pushed.

    The slope of the torque over the deflection is the stiffness, that over the speed is the damping. The simulator
    pushes a simulated robot; on a real one the operator is asked to push, before the joint becomes compliant. A joint
    with neither stiffness nor damping is not tested.
    """

    aliases = ("torqueControl-stiffDampCheck", "torqueControlStiffDampCheck")
    tags = ("motion", "torque", "impedance")
    safety = Safety.EFFORT
    torque_control = True

    part = Parameter(str, "the part whose joints are pushed", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all with torque control", default=[])
    home = Parameter(list[float], "positions in which they are pushed; none: the current ones", unit="deg", default=[])
    stiffness = Parameter(
        list[float], "its stiffness during the test; none: that of the robot", unit="Nm/deg", default=[], low=0.0
    )
    damping = Parameter(
        list[float], "its damping; none: that of the robot, 0: not tested", unit="Nm*s/deg", default=[], low=0.0
    )
    duration = Parameter(float, "how long the operator moves a joint", unit="s", default=10.0, low=1.0)
    # Friction and the scale of the torque sensing cause less; a wrong factor causes more.
    slope = Parameter(float, "greatest relative error of a slope", unit="%", default=20.0, low=0.1)
    # With less, a fifth of the torque's variance is unexplained, and the slope is uncertain.
    correlation = Parameter(
        float, "least correlation of torque with deflection or speed", default=0.9, low=0.0, high=1.0
    )
    # Many times the play and the resolution of an encoder.
    excursion = Parameter(float, "least deflection of a joint", unit="deg", default=1.0, low=0.01)
    # Likewise for the noise of a speed that a board derives from its encoder.
    fastest = Parameter(float, "least speed of a joint", unit="deg/s", default=5.0, low=0.01)
    plot_enabled = Parameter(bool, "accepted and ignored: reports have plots", default=True)

    def setup(self) -> None:
        """Open the part and bring its joints home."""
        super().setup()
        self.robot_part = part = self.open_part(self.part)
        self.pushed = is_simulated(self.network, self.robot_name, self.part)
        self.chosen = torque_joints(self, part, self.joints)
        self.transmission = Transmission.read_couplings(part.board)
        self.transmission.warn_if_unknown(self, part.name)
        homes: list[float | None] = [*self.per_joint("home", self.home, self.chosen)] if self.home else []
        self.homes = [
            starting_point(part, joint, home, _TRAVEL, both_sides=True)[0]
            for joint, home in zip(self.chosen, homes or [None] * len(self.chosen), strict=True)
        ]
        own = [part.board.impedance(joint) for joint in self.chosen]
        self.springs = [k for k, _ in own]
        self.dampers = [d for _, d in own]
        if self.stiffness:
            self.springs = self.per_joint("stiffness", self.stiffness, self.chosen)
        if self.damping:
            self.dampers = self.per_joint("damping", self.damping, self.chosen)

    def run(self) -> None:
        """Test joint by joint."""
        part = self.robot_part
        if max(*self.springs, *self.dampers) <= 0:
            self.skip(f"no joint of {part.name} has stiffness or damping: give stiffness or damping")
        for place, joint in enumerate(self.chosen):
            self.progress(place / len(self.chosen), part.names[joint])
            if not self.judge_if_lost(part, joint):
                self._test_joint(part, joint, place)

    def _test_joint(self, part: Part, joint: int, place: int) -> None:
        stopped = None
        with self.subresult(part.names[joint]):
            try:
                self._test(part, joint, place)
            except GuardError as error:  # also on the way back
                stopped = error
        if stopped is not None:
            known = motors_by_torques(part, self.transmission, joint)
            self.judge_stop(part, joint, stopped, "runs away", "impedance", known=known)

    def _test(self, part: Part, joint: int, place: int) -> None:
        spring, damper = self.springs[place], self.dampers[place]
        if spring <= 0 and damper <= 0:
            self.skip(f"{part.names[joint]} has neither stiffness nor damping: give stiffness or damping")
        before = {one: part.board.impedance(one) for one in self.transmission.coupled(joint)}
        self._require_springs(part, joint, before, spring)
        try:
            self._give_way_twice(part, joint, place, before)
        finally:
            hold(part, [joint])
            for one, impedance in before.items():
                if part.board.impedance(one) != impedance:
                    part.board.set_impedance(one, *impedance)
        bring(self, part, [joint], [self.homes[place]])

    def _give_way_twice(
        self, part: Part, joint: int, place: int, impedances: Mapping[int, tuple[float, float]]
    ) -> None:
        """Make a joint a spring, then a damper, and judge each; joints that share its motors get the same impedance."""
        spring, damper = self.springs[place], self.dampers[place]
        for other, (stiffness, _) in impedances.items():
            if other != joint and stiffness <= 0:
                part.board.set_impedance(other, spring, damper)
        if spring > 0:
            trace = self._give_way(part, joint, self.homes[place], spring, 0.0)
            self._judge(part, joint, "stiffness", spring, trace.positions[:, joint], trace.torques[:, joint])
        if damper > 0:
            trace = self._give_way(part, joint, self.homes[place], 0.0, damper)
            self._judge(part, joint, "damping", damper, trace.velocities[:, joint], trace.torques[:, joint])

    def _require_springs(
        self, part: Part, joint: int, impedances: Mapping[int, tuple[float, float]], spring: float
    ) -> None:
        """End as inconclusive if a coupled joint would fall: many boards make coupled joints compliant together."""
        loose = [part.names[one] for one, (stiffness, _) in impedances.items() if one != joint and stiffness <= 0]
        if loose and spring <= 0:
            self.inconclusive(
                f"{part.names[joint]} shares motors with {', '.join(loose)}, which may become compliant with it and "
                "would fall without any stiffness: give stiffness"
            )

    # Moving ------------------------------------------------------------------------------------------------------

    def _give_way(self, part: Part, joint: int, home: float, spring: float, damper: float) -> Trace:
        """Make a joint compliant, have it moved, and return the recorded states."""
        bring(self, part, [joint], [home])
        part.wait(_REST)
        if not self.pushed:
            self._ask_operator_to_hold(part, joint)
        self._set_impedance(part, joint, spring, damper)
        part.board.set_interaction_modes([InteractionMode.COMPLIANT], [joint])
        entered = part.wait_until(
            lambda: part.board.interaction_modes(joint)[0] is InteractionMode.COMPLIANT, _MODE_TIME
        )
        self.assert_true(entered, f"{part.names[joint]} does not become compliant; {likely_causes('mode')}")
        with part.recorded() as trace:
            if self.pushed:
                self._push(part, joint, home, spring, damper)
            else:
                part.wait_until(lambda: self._is_far(part, joint, home), self.duration)
                self._look_after(part, joint, home)
        hold(part, [joint])
        return trace

    def _set_impedance(self, part: Part, joint: int, spring: float, damper: float) -> None:
        part.board.set_impedance(joint, spring, damper)
        kept = part.board.impedance(joint)
        self.assert_true(
            np.allclose(kept, (spring, damper), rtol=0.01, atol=1e-6),
            f"{part.names[joint]} was given a stiffness of {self.as_text(spring, 'Nm/deg', 'g')} and a damping of "
            f"{self.as_text(damper, 'Nm/deg s', 'g')}, and has {self.as_text(kept[0], 'Nm/deg', 'g')} and "
            f"{self.as_text(kept[1], 'Nm/deg s', 'g')}",
        )

    def _push(self, part: Part, joint: int, home: float, spring: float, damper: float) -> None:
        """Push to both sides in turn, with the torque that spring and damper need; not a joint that swings still."""
        most = greatest_torque(part.board, joint)
        torque = spring * _WAY + damper * _SPEED + _FRICTION * (most or 0.0)
        with SimulatorControl(self.robot_name) as control:
            for sign in self._pushes():
                if spring > 0 and not self._comes_to_rest(part, joint, home):
                    continue  # it still swings, which is motion enough: another push would add to it
                number = control.inject("push", part.names[joint], {"torque": sign * torque})
                try:
                    part.wait_until(partial(self._is_pushed, part, joint, home, sign), _PUSH_TIME, pace=_PACE)
                finally:
                    control.clear(number)
                self._look_after(part, joint, home)
                part.wait(_SWING_OUT)

    @staticmethod
    def _is_pushed(part: Part, joint: int, home: float, sign: float) -> bool:
        """Whether a joint has been pushed far enough in a direction."""
        return sign * (part.board.encoder(joint) - home) > _REACH

    def _comes_to_rest(self, part: Part, joint: int, home: float) -> bool:
        """Wait until a joint has swung out in its spring: pushes in time with its swing would add up.

        It is slow where it turns, too, so it has to be slow and near its home for longer than it turns.
        """
        board, moved = part.board, self.now()

        def rests() -> bool:
            nonlocal moved
            if abs(board.encoder(joint) - home) >= _WAY or abs(float(board.encoder_speeds(joint)[0])) >= _SLOW:
                moved = self.now()
            return self.now() - moved >= _STILL

        return part.wait_until(rests, _SWING_TIME, pace=_PACE)

    def _pushes(self) -> Iterator[float]:
        yield from (1.0, -1.0, -1.0, 1.0)

    def _ask_operator_to_hold(self, part: Part, joint: int) -> None:
        """Ask the operator to hold a joint; it becomes compliant only after the answer."""
        name = part.names[joint]
        if not self.confirm(
            f"{name} becomes compliant after your yes, and may sink: hold it now, and move it to and fro for "
            f"{self.duration:g} s from then on, by less than {part.shown(joint, _TRAVEL, 'g')} to either side. "
            "Do you hold it?"
        ):
            self.inconclusive(f"{name} was not moved")

    def _is_far(self, part: Part, joint: int, home: float) -> bool:
        return abs(part.board.encoder(joint) - home) > _TRAVEL

    def _look_after(self, part: Part, joint: int, home: float) -> None:
        if self._is_far(part, joint, home):
            text = (
                f"{part.names[joint]} is at {part.shown(joint, part.board.encoder(joint), '.1f')}, more than "
                f"{part.shown(joint, _TRAVEL, 'g')} from home"
            )
            if not self.pushed:
                self.inconclusive(
                    f"{text}: move it less; {likely_causes('runs away', 'impedance')} if it was not moved"
                )
            raise GuardError(text)

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge(self, part: Part, joint: int, what: str, wanted: float, moved: FloatArray, torques: FloatArray) -> None:
        name = part.names[joint]
        symbol, least = ("deg", self.excursion) if what == "stiffness" else ("deg/s", self.fastest)
        self.record(what, moved=(moved, symbol), torque=(torques, "Nm"))
        reach = float(np.ptp(moved)) / 2
        self._require_motion(part, joint, what, reach, least, symbol)
        line = fit_line(moved, torques)
        slope = -line.slope / self._share_of_motion(name, what, moved)
        low, high = 1.0 - self.slope / 100.0, 1.0 + self.slope / 100.0
        unit = "Nm/deg" if what == "stiffness" else "Nm/deg s"
        text = (
            f"{name}: {what} is {self.as_text(slope, unit, '.4g')}, and was set to {self.as_text(wanted, unit, '.4g')}"
        )
        correlation = abs(line.correlation) if math.isfinite(line.correlation) else 0.0
        known = ""
        if not low <= slope / wanted <= high or correlation < self.correlation:
            known = weak_motor(joint, self._end_if_disturbed(part, joint, text))
        hint = f"{text}; {known or likely_causes('impedance')}"
        self.measure(f"{what}, share of what was set", slope / wanted, "", low, high, hint=hint)
        course = "how far" if what == "stiffness" else "how fast"
        hint = (
            f"{name}: the torque does not follow {course} it gives way; "
            f"{likely_causes('torque dead', 'impedance', 'irregular')}"
        )
        self.measure(f"correlation of torque, {what}", correlation, "", low=self.correlation, hint=hint)

    def _share_of_motion(self, name: str, what: str, moved: FloatArray) -> float:
        """Return the share of motion in the variance: the rest is noise, which makes the slope too flat."""
        share = 1.0 - float(np.var(np.diff(moved, 2))) / _OF_SECOND_DIFFERENCES / float(np.var(moved))
        if share < _LEAST_MOTION:
            self.inconclusive(
                f"{name}: {100.0 * (1.0 - share):.0f} % of the measured motion for the {what} is noise: "
                "move it further and faster"
            )
        return share

    def _require_motion(self, part: Part, joint: int, what: str, reach: float, least: float, symbol: str) -> None:
        """Fail a joint that does not move when it is pushed; end as inconclusive if the operator did not move it."""
        self.measure(f"moved, {what}", reach, symbol)
        if reach >= least:
            return
        text = (
            f"{part.names[joint]} was moved by {self.as_text(reach, symbol, '.2g')} to either side, "
            f"{self.as_text(least, symbol, 'g')} are needed to judge its {what}"
        )
        if self.pushed:
            self._end_if_disturbed(part, joint, text)
            self.assert_fail(f"{text}: it does not give way; {likely_causes('does not move')}")
        self.inconclusive(text)

    def _end_if_disturbed(self, part: Part, joint: int, text: str) -> Sequence[Evidence]:
        """End as inconclusive if another joint or motor explains what the text says of a joint.

        Return the evidence of the torques on the motors otherwise.
        """
        motors = motors_by_torques(part, self.transmission, joint)
        if cause := self.explained(part, joint) or torque_disturbance(part, joint, motors):
            self.inconclusive(f"{text}; but {cause}")
        return motors
