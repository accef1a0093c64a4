"""Motor test: position moves of single joints, of all at once and of a group arrive, and are reported as done."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.judging.real_time_checks import loop_delay
from rtf.robot_testing.judging.step_response import step_response
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace

#: Time for a board to begin a move, and to report it as done after its end, s.
_STARTS, _ENDS = 0.5, 1.0
#: Time for which joints are watched after a move, and period of the checks, s.
_AFTER, _PACE = 0.3, 0.02
#: The number of last states whose mean is the final position.
_LAST = 10
#: The shortest move whose beginning is judged, deg.
_SHORTEST = 1.0


class MotorTest(JointsTest):
    """Moves each joint to its target, all back home together, and all to their targets again as a group.

    Each joint has to start, to report the end of its motion, and to be near its target; rise time, settling time and
    overshoot are measured. The default targets are ten degrees from home, towards the middle of the range.
    """

    aliases = ("motorTest", "motor-test", "motor-tests", "MotorTests")
    tags = ("motion", "motors")
    safety = Safety.MOTION

    port = Parameter(str, "port of the part; instead of robot and part", default="", key="portname", aliases=("port",))
    # Existing parameter files give the number of joints here, not a list.
    joints = Parameter(int, "expected number of axes of the part; 0: any", default=0, low=0)  # type: ignore[assignment]
    target = Parameter(list[float], "targets of the joints; none: near home", unit="deg", default=[])
    below = Parameter(list[float], "tolerance below the target", unit="deg", default=[1.0], key="min")
    above = Parameter(list[float], "tolerance above the target", unit="deg", default=[1.0], key="max")
    speed = Parameter(list[float], "reference speeds", unit="deg/s", default=[20.0], low=0.1, key="refvel")
    acceleration = Parameter(
        list[float], "reference accelerations; none: as they are", unit="deg/s^2", default=[], low=0.0, key="refacc"
    )
    patience = Parameter(
        list[float], "time-out of each move; none: by its distance", unit="s", default=[], low=0.0, key="timeout"
    )
    overshoot = Parameter(float, "greatest overshoot", unit="deg", default=2.0, low=0.0)
    distance = Parameter(float, "distance of the default targets from home", unit="deg", default=10.0, low=1.0)

    def check_parameters(self, folder: str) -> None:
        """See Declared. A port determines robot and part; the fixture that restores the robot needs its name."""
        if self.port:
            self.robot, _, self.part = self.port.strip("/").rpartition("/")
        super().check_parameters(folder)

    def setup(self) -> None:
        """Open the part, bring it into position mode, and set speeds."""
        super().setup()
        part = self.robot_part
        self.targets = self._targets()
        self.low = self.targets - np.abs(self.by_joint("min", self.below))
        self.high = self.targets + np.abs(self.by_joint("max", self.above))
        self.speeds = self.robot_part.paced(self.by_joint("refvel", self.speed))
        with self.guarded():
            self.hold()
        part.board.set_reference_speeds(self.speeds[self.chosen], self.chosen)
        if self.acceleration:
            accelerations = self.per_joint("refacc", self.acceleration, self.chosen)
            part.board.set_reference_accelerations(accelerations, self.chosen)

    def wanted_joints(self) -> list[int]:
        """Return none, for all joints: the parameter ``joints`` is their number."""
        return []

    def _targets(self) -> FloatArray:
        part = self.robot_part
        if self.target:
            return self.by_joint("target", self.target)
        middle = (part.low + part.high) / 2
        return np.clip(part.home + np.where(part.home < middle, self.distance, -self.distance), part.low, part.high)

    def run(self) -> None:
        """Single moves, all together, and a group in reverse order."""
        part = self.robot_part
        if self.joints:
            self.check(part.axes == self.joints, f"{part.name} has {part.axes} axes, not {self.joints}")
        for joint in [*self.chosen]:
            self.progress(joint / (part.axes + 2), part.names[joint])
            if joint in self.chosen:
                self._try("single", [joint], self.targets)
        home = part.home
        self.progress(part.axes / (part.axes + 2), "all")
        self._try("all", None if len(self.chosen) == part.axes else self.chosen, home)
        self._try("group", self.chosen[::-1], self.targets)
        part.report_clock_offset(self.report)

    def teardown(self) -> None:
        """Go home; a joint that failed to arrive before need not arrive now."""
        if hasattr(self, "targets"):
            self.robot_part.go_home()

    def _try(self, kind: str, joints: list[int] | None, targets: FloatArray) -> None:
        """Move joints; one that the guard has to stop fails, and is left out from then on."""
        try:
            self._move(kind, joints, targets)
        except GuardError as error:
            self.exclude_stopped(error)

    def _move(self, kind: str, joints: list[int] | None, targets: FloatArray) -> None:
        """Move joints and judge each of them; None: all joints, by the request for the whole part."""
        part, board = self.robot_part, self.robot_part.board
        moved = self.chosen if joints is None else joints
        goal = targets[moved]
        start = board.encoders(moved)
        ways = np.abs(goal - start)
        limit = self._time_for(moved, ways)
        looks: list[float] = []

        def moves() -> bool:
            looks.append(self.now())
            return not board.motion_done(joints)

        with part.recorded() as trace:
            begin = self.now()
            part.command_move(goal, joints)
            begun = part.wait_until(moves, _STARTS, pace=_PACE)
            late = "" if begun else loop_delay([begin, *looks, self.now()], _PACE)
            part.wait_until(lambda: self._arrived(moved, targets), limit, pace=_PACE)
            done = part.wait_until(lambda: board.motion_done(joints), _ENDS, pace=_PACE)
            part.wait(_AFTER, pace=_PACE)
        if ways.max() < _SHORTEST:
            begun = True
        for joint, first in zip(moved, start, strict=True):
            with self.subresult(f"{part.names[joint]} {kind}"):
                self._judge(joint, float(first), float(targets[joint]), trace, begin, kind)
        with self.subresult(f"{self._who(moved)} {kind}"):
            self.check_fail_if_false(done, f"{self._who(moved)}: the motion is not done {limit + _ENDS:.1f} s later")
            none = f"{self._who(moved)}: no motion began within {_STARTS:g} s"
            if late and not begun:
                self.inconclusive(f"{none}; but {late}")  # it may have begun and ended meanwhile
            self.check_fail_if_false(begun, f"{none}; {likely_causes('does not start')}")

    def _who(self, joints: Sequence[int]) -> str:
        return self.robot_part.names[joints[0]] if len(joints) == 1 else self.robot_part.name

    def _time_for(self, joints: list[int], ways: FloatArray) -> float:
        if self.patience:
            return float(self.by_joint("timeout", self.patience)[joints].max())
        return float((2 * ways / self.speeds[joints]).max()) + 2.0

    def _arrived(self, joints: list[int], targets: FloatArray) -> bool:
        away = self.targets - targets  # home has the same tolerances as the targets
        here = self.robot_part.board.encoders(joints) + away[joints]
        return bool(((here >= self.low[joints]) & (here <= self.high[joints])).all())

    def _judge(self, joint: int, start: float, target: float, trace: Trace, begin: float, kind: str) -> None:
        name, way = self.robot_part.names[joint], abs(target - start)
        time, positions = trace.local_time - begin, trace.positions[:, joint]
        targets = np.full(time.shape, target)
        self.record(f"{kind} move", time=(time, "s"), position=(positions, "deg"), target=(targets, "deg"))
        low, high = self.low[joint] - self.targets[joint], self.high[joint] - self.targets[joint]
        if way >= _SHORTEST:
            found = step_response(time, positions, start, target, max(-low, high))
            if math.isfinite(found.rise_time):
                self.measure("rise", found.rise_time, "s")
            if math.isfinite(found.settling_time):
                self.measure("settling", found.settling_time, "s")
            beyond = found.overshoot / 100.0 * way
            text = f"{name} goes {self.shown(beyond)} beyond its target of {self.shown(target)}"
            if beyond > self.overshoot:
                self.end_if_disturbed(joint, text)
            hint = f"{text}; {likely_causes('overshoot')}"
            self.measure("overshoot", beyond, "deg", high=self.overshoot, hint=hint)
        error = float(positions[-_LAST:].mean()) - target
        moved = abs(float(positions[-1]) - start)
        finding = "does not move" if moved < _SHORTEST else "weak"
        text = (
            f"{name} ends {self.shown(error, '+.2f')} from its target of {self.shown(target)}, after it moved "
            f"{self.shown(moved)}"
        )
        if not low <= error <= high:
            self.end_if_disturbed(joint, text)
        hint = f"{text}; {likely_causes(finding)}"
        self.measure("final error", error, "deg", low=low, high=high, hint=hint)
