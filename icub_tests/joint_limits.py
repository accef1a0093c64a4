"""Joint limits: every joint reaches its configured limits, and does not exceed them."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.interfaces import PidType
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.snapshot import answered
from rtf.robot_testing.joints_test import JointsTest, command_at
from rtf.robot_testing.motion.routines import run_queues
from rtf.robot_testing.parameter_checks import swapped_limits
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.slides import slides_of
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import Pid
    from rtf.robot_testing import Trace
    from rtf.robot_testing.motion.routines import Routine

#: A joint is at rest if it has moved by less than this (deg) for so long (s); the second time is for a joint short of
#: its target, whose integral may still be growing.
_STILL, _AT_REST, _STALLED = 0.05, 0.15, 1.0
#: Additional time of a move beyond twice the expected one, s; and the reaction time of a board, s.
_GRACE, _REACTION = 3.0, 0.15
#: A controller that follows a target beyond the limit adds its gain times the way to its output, and one that keeps the
#: limit adds nothing. It may add at most the first share of that, and always the second share of its greatest output,
#: as its integral may still be growing. The shares are chosen, between all and nothing.
_PUSH, _LEAST_PUSH = 0.4, 0.03
#: Tolerance between a configured and an expected limit, deg; chosen, as files have limits in whole degrees, or to a
#: tenth.
_SAME = 0.5


class _Side(NamedTuple):
    """One end of a joint's range; ``sign`` points outwards."""

    name: str
    limit: float
    sign: float


class _Stay(NamedTuple):
    """A joint at rest: its position (deg), and the output of its controller (in its unit), or NaN if it is unknown."""

    position: float
    output: float


class JointLimits(JointsTest):
    """Moves each joint to both limits, commands it beyond them, and measures what it reaches.

    The outputs of the position controllers are reduced first, if these are known, so that a contact does no harm. A
    joint at its mechanical stop cannot move beyond it, but its controller must not push against it either. Joints that
    cannot collide with each other move at the same time, the others in turn. Reachable limits that belong to another
    robot, or are too narrow, are only found if the right ones are known: from ``lower`` and ``upper``, or from the
    robot's model.
    """

    aliases = ("jointsLimits", "jointLimits", "JointsLimits")
    tags = ("motion", "limits")
    safety = Safety.MOTION

    speed = Parameter(list[float], "speed of all moves", unit="deg/s", default=[50.0], low=0.1)
    out_of_bound = Parameter(
        list[float], "distance of the commands beyond a limit", unit="deg", default=[2.0], low=0.001,
        key="outOfBoundPosition",
    )  # fmt: skip
    output_percent = Parameter(
        list[float], "share of the controller's greatest output during the test", unit="%", default=[60.0],
        low=1.0, high=100.0, key="outputLimitPercent",
    )  # fmt: skip
    tolerance = Parameter(float, "tolerance of the limits", unit="deg", default=0.5, low=0.001)
    tolerances = Parameter(list[float], "the same for each joint", unit="deg", default=[], key="toleranceList")
    lower = Parameter(list[float], "expected lower limits; none: any", unit="deg", default=[])
    upper = Parameter(list[float], "expected upper limits; none: any", unit="deg", default=[])
    modelled = Parameter(
        bool, "whether limits without a value in lower and upper have to be those of the robot's model", default=False
    )

    def parameter_problems(self) -> list[str]:
        """Add errors of expected limits without a range between them."""
        return [*super().parameter_problems(), *swapped_limits(self, "lower", "upper")]

    def setup(self) -> None:
        """Open the part, reduce the outputs of its controllers, and move it home."""
        super().setup()
        self.speeds = self.robot_part.paced(self.by_joint("speed", self.speed))
        self.beyond = self.by_joint("outOfBoundPosition", self.out_of_bound)
        self.near = self.by_joint("toleranceList", self.tolerances or [self.tolerance])
        self.wanted = {
            "lower": self.by_joint("lower", self.lower or self._modelled_limits(0)),
            "upper": self.by_joint("upper", self.upper or self._modelled_limits(1)),
        }
        percents = self.by_joint("outputLimitPercent", self.output_percent)
        self._exclude_joints_without_range()
        self.outputs_known = answered(partial(self.robot_part.board.pid_outputs, PidType.POSITION)) is not None
        if self.outputs_known:
            self.gains = {joint: self._weaken(joint, percents[joint]) for joint in self.chosen}
        else:
            self.warn(f"{self.robot_part.name} reports no outputs: whether joints push at limits is not judged")
        self.bring_home(speed=float(np.nanmin(self.speeds)))
        self.robot_part.board.set_reference_speeds(self.speeds[self.chosen], self.chosen)

    def _modelled_limits(self, side: int) -> list[float]:
        """Return the lower (0) or the upper (1) limits of the chosen joints by the model; NaN for unknown ones."""
        robot, part = robot_model(self), self.robot_part
        if not self.modelled:
            return [math.nan]
        slides = slides_of(robot, part.name)
        found = []
        for name in (part.names[joint] for joint in self.chosen):
            axis = robot.axis(name) if name in robot.index else None
            limits = (math.nan, math.nan) if axis is None else (axis.minimum, axis.maximum)
            found.append(limits[side] / slides.get(name, 1.0))
        return found

    def _exclude_joints_without_range(self) -> None:
        """Exclude joints with swapped or missing limits before any motion: they are out of limits at any position."""
        part = self.robot_part
        for joint in [joint for joint in self.chosen if not part.low[joint] < part.high[joint]]:
            limits = (
                f"the limits {part.shown(joint, part.low[joint], 'g')} and {part.shown(joint, part.high[joint], 'g')} "
                "leave no range"
            )
            self.fail_and_exclude(joint, f"{part.names[joint]}: {limits}; {likely_causes('no range')}", "has no range")

    def _weaken(self, joint: int, percent: float) -> Pid:
        board, share = self.robot_part.board, percent / 100.0
        pid = board.pid(PidType.POSITION, joint)
        weak = pid._replace(max_output=pid.max_output * share, max_integral=pid.max_integral * share)
        board.set_pid(PidType.POSITION, joint, weak)
        self.assert_error_if_false(
            abs(board.pid(PidType.POSITION, joint).max_output - weak.max_output) < 1e-3 * abs(pid.max_output) + 1e-6,
            f"{self.robot_part.names[joint]}: the board does not accept an output limit of {weak.max_output:g}, "
            f"{percent:g} % of {pid.max_output:g} (in its own units)",
        )
        return weak

    def run(self) -> None:
        """Run all queues in parallel; each joint is judged when it is home again."""
        part = self.robot_part
        self._spans: dict[int, tuple[float, float]] = {}
        self._heading: dict[int, _Side] = {}  # the limits to which joints are on their way
        self._commanded: dict[int, list[tuple[float, float]]] = {joint: [] for joint in self.chosen}
        with part.recorded() as trace:
            run_queues(part, part.queues(self.chosen), self._routine, pace=_PACE)
        self._keep(trace)

    def _routine(self, joint: int) -> Routine[None]:
        """Test one joint; a joint that the guard stops fails, and the others go on."""
        begin, name = self.now(), self.robot_part.names[joint]
        if self.judge_if_lost(self.robot_part, joint):
            return
        try:
            yield from self._visit_limits(joint)
        except GuardError as error:
            self._spans[joint] = begin, self.now()
            self.judge_own_stop(joint, error, partial(self._judge_block, joint, error))
        self.progress(len(self._spans) / len(self.chosen), name)

    def _visit_limits(self, joint: int) -> Routine[None]:
        part = self.robot_part
        begin = self.now()
        low, high = float(part.low[joint]), float(part.high[joint])
        found: list[tuple[_Side, _Stay, _Stay]] = []
        for side in (_Side("upper", high, 1.0), _Side("lower", low, -1.0)):
            self._heading[joint] = side
            yield from self._travel(joint, side.limit)
            del self._heading[joint]
            reached = self._stay(joint)
            yield from self._travel(joint, side.limit + side.sign * self.beyond[joint], beyond=True)
            found.append((side, reached, self._stay(joint)))
        yield from self._travel(joint, float(part.home[joint]))
        self._spans[joint] = begin, self.now()
        with self.subresult(part.names[joint]):
            for side, reached, kept in found:
                self._judge(joint, side, reached, kept)
            self._judge_return(joint)

    def _stay(self, joint: int) -> _Stay:
        board = self.robot_part.board
        output = float(board.pid_outputs(PidType.POSITION, joint)[0]) if self.outputs_known else math.nan
        return _Stay(board.encoder(joint), output)

    def _travel(self, joint: int, target: float, *, beyond: bool = False) -> Routine[None]:
        """Move a joint until it is at rest after the expected time of the move, or the time is up."""
        board, speed = self.robot_part.board, self.speeds[joint]
        here = board.encoder(joint)
        expected = abs(target - here) / speed
        self.robot_part.command_move([target], [joint])
        self._commanded[joint].append((self.now(), target))
        begin = since = self.now()
        while (now := self.now()) < begin + 2 * expected + _GRACE:
            position = board.encoder(joint)
            if abs(position - here) > _STILL:
                here, since = position, now
            arrived = beyond or abs(position - target) <= self.near[joint]
            if now >= begin + expected + _REACTION and now - since >= (_AT_REST if arrived else _STALLED):
                return
            yield None

    def _judge(self, joint: int, side: _Side, reached: _Stay, asked: _Stay) -> None:
        """Judge one limit: ``reached`` is the rest at the limit, ``asked`` that after the command beyond it.

        A motion inwards is no excess.
        """
        name, tolerance, sign = self.robot_part.names[joint], self.near[joint], side.sign
        wanted = float(self.wanted[side.name][joint])
        if not np.isnan(wanted):
            hint = (
                f"the {side.name} limit of {name} is {self.shown(side.limit, 'g')} in its configuration, not "
                f"{self.shown(wanted, 'g')}; "
                f"{likely_causes('wrong limit')}"
            )
            self.measure(f"{side.name} limit", side.limit, "deg", low=wanted - _SAME, high=wanted + _SAME, hint=hint)
        missing = self._judge_missing(joint, side, reached.position)
        excess = sign * (asked.position - side.limit)
        hint = (
            f"{name} goes {self.shown(excess)} beyond its {side.name} limit of {self.shown(side.limit, 'g')}; "
            f"{likely_causes('beyond limit')}"
        )
        self.measure(f"beyond the {side.name} limit", excess, "deg", high=tolerance, hint=hint)
        if missing <= tolerance and self.outputs_known:
            way = math.copysign(sign, sign * self.gains[joint].kp)  # an inverted motor has inverted gains
            self._judge_push(joint, side, way * (asked.output - reached.output))

    def _judge_missing(self, joint: int, side: _Side, position: float) -> float:
        """Judge how far a joint at rest is short of a limit (deg), and return that."""
        name, missing = self.robot_part.names[joint], side.sign * (side.limit - position)
        text = (
            f"{name} stops at {self.shown(position)}, {self.shown(missing)} short of its {side.name} limit of "
            f"{self.shown(side.limit, 'g')}"
        )
        if missing > self.near[joint]:
            self.end_if_disturbed(joint, text)
        hint = f"{text}; {likely_causes('short of limit')}"
        self.measure(f"short of the {side.name} limit", missing, "deg", high=self.near[joint], hint=hint)
        return missing

    def _judge_block(self, joint: int, error: GuardError) -> None:
        """Judge the limit to which a joint was on its way when the guard found it blocked: it cannot be reached."""
        side = self._heading.pop(joint, None)
        if side is not None and error.joint == joint and error.finding == "blocked":
            with self.subresult(self.robot_part.names[joint]):
                self._judge_missing(joint, side, self.robot_part.board.encoder(joint))

    def _judge_push(self, joint: int, side: _Side, push: float) -> None:
        """Judge the additional output for a command beyond the limit: none, if the board clips the setpoint."""
        pid = self.gains[joint]
        full = abs(pid.max_output)
        if full <= 0:
            return
        allowed = _PUSH * min(abs(pid.kp) * self.beyond[joint], full) / full
        percent = 100.0 * push / full
        high = 100.0 * max(allowed, _LEAST_PUSH)
        hint = (
            f"{self.robot_part.names[joint]} pushes beyond its {side.name} limit of "
            f"{self.shown(side.limit, 'g')} with "
            f"{percent:.0f} % of its output when commanded there; {likely_causes('beyond limit')}"
        )
        self.measure(f"push beyond the {side.name} limit", percent, "%", high=high, hint=hint)

    def _judge_return(self, joint: int) -> None:
        part = self.robot_part
        here, home = part.board.encoder(joint), float(part.home[joint])
        where = f"{part.names[joint]} comes back to {self.shown(here)}, not to {self.shown(home)}"
        hint = f"{where}; {likely_causes('weak')}"
        self.measure("away from home afterwards", abs(here - home), "deg", high=max(self.near[joint], _HOME), hint=hint)

    def _keep(self, trace: Trace) -> None:
        """Record positions, targets and currents of each joint during its test, with its limits."""
        part = self.robot_part
        time, positions, currents = trace.local_time, trace.positions, trace.currents
        for joint, (begin, end) in self._spans.items():
            rows = (time >= begin) & (time <= end)
            low, high = part.low[joint], part.high[joint]
            self.record(
                f"{part.names[joint]}: position",
                time=(time[rows] - begin, "s"),
                position=part.column(joint, positions[rows, joint]),
                target=part.column(joint, command_at(time[rows], self._commanded[joint])),
                lower_limit=part.column(joint, np.full(rows.sum(), low)),
                upper_limit=part.column(joint, np.full(rows.sum(), high)),
                current=(currents[rows, joint], "A"),
            )


#: Period of the checks while joints move, s.
_PACE = 0.02
#: Least tolerance of the home position at the end, deg.
_HOME = 1.0
