"""Consistency of encoders: motor and joint encoders agree through gearboxes and couplings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.judging.blame import Evidence, blame, settle
from rtf.robot_testing.judging.encoder_agreement import Motion, Tolerance, encoder_evidence
from rtf.robot_testing.judging.robust_line import slopes_between
from rtf.robot_testing.motion.joint_swings import JointSwinger, Outcome, ends_of
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_queues, until
from rtf.robot_testing.parameter_checks import joint_count
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace
    from rtf.robot_testing.judging.robust_line import Slopes
    from rtf.robot_testing.motion.routines import Routine

#: Least motion of a joint's encoder that counts as a swing, deg.
_SWUNG = 1.0
#: Share of the greatest speed above which a joint certainly moves in one direction.
_SURELY = 0.3
#: Share of the greatest effort above which a motor certainly pushes in one direction; and the fewest states of
#: each.
_PUSHING, _FEWEST = 0.1, 10
#: Ratios of known mistakes: an extra stage of 75/50.
_KNOWN_RATIOS = (1.5,)
#: Tolerances of matrix elements that were converted to text, and of a ratio that matches a known mistake.
_SAME, _CLOSE = 1e-3, 0.01
#: Residual, as a share of the half swing, from which on the estimated ratios are uncertain.
_DOUBTFUL = 0.02
#: Spikes are farther from the median than this number of quartile distances; no noise is, not even of few states. They
#: are reported when they are less than this share of the states.
_SPIKE, _RARE = 10.0, 0.1
#: A delay is estimated where a joint is faster than this share of its greatest speed: there it has passed all play. Its
#: speed is the slope over this number of states to either side, to smooth the resolution of encoders.
_FAST, _ASIDE = 0.5, 5
#: Speeds are compared as means of this number of states, or of fewer where there would be fewer groups.
_TOGETHER, _GROUPS = 20, 12


class _Data(NamedTuple):
    """The states of swings, one after the other: times (s), and arrays (states, axes) in deg and deg/s.

    See :attr:`rtf.robot_testing.motion.trace.Trace.efforts`.
    """

    time: FloatArray
    joints: FloatArray
    motors: FloatArray
    joint_speeds: FloatArray
    motor_speeds: FloatArray
    efforts: FloatArray


class _Swing(NamedTuple):
    """The outcome of a joint's swings, with the recorded states."""

    outcome: Outcome
    trace: Trace


class OpticalEncodersConsistency(JointsTest):
    """Swings joints one by one, and compares joint and motor encoders in every state.

    The row of each motor in gearboxes and couplings is estimated from the swings of all joints of its board, which
    separates a wrong ratio, a wrong sign and a wrong coupling. A ratio is wrong only if the motor by the joint and the
    joint by the motor both say so, without outliers. The residual is noise and play. Joints that cannot
    collide, such as an arm and its hand, swing at the same time, but never two of one board.
    """

    aliases = (
        "MotorEncodersConsistency",
        "motorEncodersConsistency",
        "opticalEncodersConsistency",
        "motorEncoders-consistency",
        "OpticalEncodersConst",
    )
    tags = ("motion", "encoders", "consistency")
    safety = Safety.MOTION
    not_per_joint = ("matrix",)

    high = Parameter(list[float], "upper ends of the swings; none: derived", unit="deg", default=[], key="max")
    low = Parameter(list[float], "lower ends of the swings; none: derived", unit="deg", default=[], key="min")
    swing = Parameter(list[float], "width of the derived swings", unit="deg", default=[20.0], low=2.0)
    speed = Parameter(list[float], "speed of all moves", unit="deg/s", default=[20.0], low=0.1)
    cycles = Parameter(int, "half-swings of each joint", default=4, low=2)
    tolerance = Parameter(float, "tolerance of the ends of a swing", unit="deg", default=1.0, low=0.001)
    matrix_size = Parameter(int, "size of the expected coupling matrix; 0: that of the board", default=0, low=0)
    matrix = Parameter(list[float], "expected coupling matrix of the joints, row by row", default=[])
    # Gear ratios and resolutions are quotients of whole numbers: a wrong one differs by more.
    ratio_tolerance = Parameter(float, "error of a ratio", unit="%", default=2.0, low=0.01)
    velocity_tolerance = Parameter(float, "error of the measured speeds", unit="%", default=10.0, low=0.1)
    # Absolute encoders of 12 bits have steps of 0.09 deg; a tendon yields by less than a degree.
    noise = Parameter(float, "greatest rms of the disagreement", unit="deg", default=0.25, low=0.001)
    backlash = Parameter(float, "greatest play", unit="deg", default=1.0, low=0.001)
    delay = Parameter(float, "greatest delay between joint and motor", unit="ms", default=20.0, low=0.1)
    plot_enabled = Parameter(bool, "accepted and ignored: reports have plots", default=False)
    plot_string_1 = Parameter(str, "accepted and ignored", default="", key="plotString1")
    plot_string_2 = Parameter(str, "accepted and ignored", default="", key="plotString2")
    plot_string_3 = Parameter(str, "accepted and ignored", default="", key="plotString3")
    plot_string_4 = Parameter(str, "accepted and ignored", default="", key="plotString4")

    _causes: Sequence[Evidence] = ()  # single encoders that explain the disagreement of motors
    _disagreeing: Sequence[int] = ()  # the motors that disagree with the joints

    def parameter_problems(self) -> list[str]:
        """Add the error of a matrix whose size does not fit the joints."""
        problems, size = super().parameter_problems(), joint_count(self) or self.matrix_size
        if self.matrix and size:
            problems += self._wrong_matrix(size)
        return problems

    def _wrong_matrix(self, count: int) -> list[str]:
        if len(self.matrix) in (0, count * count):
            return []
        source = self.parameter_source("matrix")
        return [f"matrix has {len(self.matrix)} numbers; {count} joints need {count * count} ({source})"]

    def setup(self) -> None:
        """Read the transmission of the part, and choose the ends of the swings."""
        super().setup()
        part = self.robot_part
        wrong = self._wrong_matrix(len(self.chosen))
        self.assert_error_if_true(wrong, "; ".join(wrong))
        self.transmission = self.read_transmission()
        self.speeds = self.per_joint("speed", self.speed, self.chosen)
        widths = self.per_joint("swing", self.swing, self.chosen)
        lows = self.per_joint("min", self.low, self.chosen) if self.low else [None] * len(self.chosen)
        highs = self.per_joint("max", self.high, self.chosen) if self.high else [None] * len(self.chosen)
        self.ends = [
            ends_of(part, joint, width, low, high)
            for joint, width, low, high in zip(self.chosen, widths, lows, highs, strict=True)
        ]
        self.swinger = JointSwinger(part, self.transmission, tolerance=self.tolerance)
        self.swinger.begin(self.hold)

    def run(self) -> None:
        """Swing joint by joint, then judge motor by motor."""
        part = self.robot_part
        self._swings: dict[int, _Swing] = {}
        self._moving = set[int]()
        run_queues(part, part.one_at_a_time(self.chosen), self._routine, pace=PACE)
        self._compare_with_expected()
        self._compare_all()
        for joint in self.chosen:
            with self.subresult(part.names[joint]):
                self._judge(joint, *self._swings[joint])
        self.fail_others(self.swinger.evidence, self.chosen)

    def _compare_all(self) -> None:
        """Find out from all swings together which encoders explain that several motors disagree with their joints.

        Exchanged encoders are evidence by themselves. A single wrong one is judged with its joint; of the others that
        it makes disagree it is the cause.
        """
        traces = [swing.trace for swing in self._swings.values() if len(swing.trace)]
        if not traces:
            return
        data = _joined(traces)
        motion = Motion.of(data.joints, data.motors, self.transmission.gearbox, self.transmission.coupling)
        bounds = Tolerance(2 * self.noise, self.ratio_tolerance / 100.0)
        obeyed = not any(swing.outcome.complaint for swing in self._swings.values())
        found = encoder_evidence(motion, self.robot_part.names, bounds, obeyed=obeyed)
        self.swinger.evidence += [one for one in found if len(one.joints) > 1]
        self._causes = [one for one in found if len(one.joints) == 1]
        self._disagreeing = motion.disagreeing(bounds)

    def _excuse_neighbour(self, joint: int) -> None:
        """End a joint as inconclusive whose encoders disagree because of the encoder of another one."""
        others = [one for one in self._causes if joint not in one.joints]
        if joint in self._disagreeing and len(others) == len(self._causes) > 0:
            text = f"{self.robot_part.names[joint]}: joint and motor encoder disagree"
            settle(self, blame(joint, Evidence.uncertain(joint, text), others))

    def _routine(self, joint: int) -> Routine[None]:
        """Swing a joint while no other joint of its board moves, so that the motions of the motors can be separated."""
        part, place = self.robot_part, self.chosen.index(joint)
        block = self.transmission.blocks[joint]
        yield from until(part.clock, lambda: self._moving.isdisjoint(block), math.inf)
        self._moving.add(joint)
        with part.recorded() as trace:
            outcome = yield from self.swinger.swinging(joint, self.ends[place], self.cycles, self.speeds[place])
        self._moving.remove(joint)
        self._swings[joint] = _Swing(outcome, trace)
        self.progress(0.9 * len(self._swings) / len(self.chosen), part.names[joint])

    def _of_board(self, joint: int) -> _Data:
        """Return the states of all swings of a joint's board."""
        block = self.transmission.blocks[joint]
        return _joined([self._swings[one].trace for one in self.chosen if one in block])

    def _compare_with_expected(self) -> None:
        """Warn about elements of the board's coupling matrix that differ from the expected one."""
        if not self.matrix:
            return
        count = len(self.chosen)
        found = self.transmission.coupling[np.ix_(self.chosen, self.chosen)]
        wrong = np.argwhere(np.abs(found - np.reshape(self.matrix, (count, count))) > _SAME)
        for row, column in wrong.tolist():
            self.warn(
                f"{self.robot_part.names[self.chosen[row]]}: the board's coupling with "
                f"{self.robot_part.names[self.chosen[column]]} is {found[row, column]:g}, not "
                f"{self.matrix[row * count + column]:g}"
            )

    def _judge(self, joint: int, outcome: Outcome, trace: Trace) -> None:
        name = self.robot_part.names[joint]
        if len(trace):
            self._keep(joint, _joined([trace]))
        if (verdict := self.swinger.verdict(joint, outcome)) is not None:
            settle(self, verdict)
        self._excuse_neighbour(joint)
        self.assert_error_if_false(len(trace), f"{name}: the board publishes no states")
        data, own = self._of_board(joint), _joined([trace])
        missing = self._missing(joint, data)
        self.assert_error_if_true(
            missing,
            f"{name}: {missing} of {len(data.time)} states have no finite values of it; {likely_causes('frozen')}",
        )
        travel = float(np.ptp(own.joints[:, joint]))
        turned = float(np.ptp(own.motors[:, joint])) / abs(self.transmission.factors[joint])
        self.assert_true(
            travel >= _SWUNG or turned < _SWUNG,
            f"{name}: its motor moves it by {self.shown(turned, '.1f')}, its encoder shows {self.shown(travel)}; "
            f"{likely_causes('frozen')}",
        )
        self.assert_error_if_true(travel < _SWUNG, f"{name}: {self.shown(travel)} of motion are too little to judge")
        self.assert_true(
            turned >= 0.1 * travel or not self.transmission.coupling[joint, joint],  # otherwise other motors turn it
            f"{name} moves by {self.shown(travel, '.1f')}, its motor's encoder does not; {likely_causes('frozen')}",
        )
        ratios, left = self._estimate(joint, data)
        # Play makes the motor turn farther than the joint; spikes do not.
        doubt = float(np.median(np.abs(left))) / (travel / 2)
        self._judge_ratios(joint, ratios, self.ratio_tolerance / 100.0 + (doubt if doubt > _DOUBTFUL else 0.0))
        if self._judge_residual(joint, data, left):
            self._judge_speeds(joint, own)

    def _missing(self, joint: int, data: _Data) -> int:
        """Return the number of states without a finite value of the joint, or of a joint that turns its motor."""
        turning = [*{joint, *np.flatnonzero(self.transmission.coupling[joint])}]
        own = np.column_stack([column[:, joint] for column in data[2:-1]])
        return int((~np.isfinite(np.column_stack([own, data.joints[:, turning]])).all(axis=1)).sum())

    def _estimate(self, joint: int, data: _Data) -> tuple[dict[int, Slopes], FloatArray]:
        """Return the ratios of the motor to each swung joint of its board, by its own ratio, and the residual (deg).

        Each ratio is estimated from the swings of that joint, as the others rest meanwhile.
        """
        factor = float(self.transmission.factors[joint])
        row = self.transmission.gearbox[joint] * self.transmission.coupling[joint] / factor
        ratios: dict[int, Slopes] = {}
        found = row.copy()
        for other in self._swung(joint):
            swing = _joined([self._swings[other].trace])
            rest = swing.joints @ np.where(np.arange(len(row)) == other, 0.0, row)
            ratios[other] = slopes_between(swing.joints[:, other], swing.motors[:, joint] / factor - rest)
            found[other] = ratios[other].nearest(row[other])
        left = data.motors[:, joint] / factor - data.joints @ found
        left -= np.median(left)
        return ratios, left

    def _swung(self, joint: int) -> list[int]:
        """Return the joints of a joint's board that have swung, in the order of their recordings.

        One whose swings were cut short says nothing about other motors: a count of its encoder is too much of its way.
        """
        of_board = {one: self._swings[one] for one in self.chosen if one in self.transmission.blocks[joint]}
        whole = {one: swing.trace for one, swing in of_board.items() if one == joint or not swing.outcome.complaint}
        return [one for one, trace in whole.items() if len(trace) and np.ptp(trace.positions[:, one]) >= _SWUNG]

    def _judge_ratios(self, joint: int, ratios: dict[int, Slopes], limit: float) -> None:
        """Judge the motor's row of the couplings against the configuration."""
        names, own = self.robot_part.names, self.transmission.coupling[joint]
        expected = self.transmission.gearbox[joint] * own / float(self.transmission.factors[joint])
        if own[joint]:
            ratio = ratios[joint].nearest(1.0)
            hint = f"{names[joint]}: {_ratio_hint(ratio)}"
            self.measure("ratio to what is configured", ratio, low=1 - limit, high=1 + limit, hint=hint)
        errors = {
            other: found.nearest(float(expected[other])) - float(expected[other])
            for other, found in ratios.items()
            if other != joint
        }
        if errors:
            worst = max(errors, key=lambda other: abs(errors[other]))
            if abs(errors[worst]) > limit:
                self._excuse_column(joint, worst, errors[worst] / float(expected[worst]) + 1.0)
            hint = (
                f"{names[joint]}: its motor turns {expected[worst] + errors[worst]:.3f} times with {names[worst]}, in "
                f"units of its own ratio, not {expected[worst]:.3f} times; {likely_causes('ratio')}"
            )
            self.measure("greatest error of a coupling", errors[worst], low=-limit, high=limit, hint=hint)

    def _excuse_column(self, joint: int, other: int, ratio: float) -> None:
        """End a joint as inconclusive whose motor disagrees with another joint as that joint's own motor does.

        ``ratio`` is the found coupling by the expected one. What two motors say alike is the encoder of the joint.
        """
        names, own = self.robot_part.names, self._estimate(other, self._of_board(other))[0]
        if other in own and abs(own[other].nearest(1.0) - ratio) < abs(ratio - 1.0) / 2.0:
            cause = f"by two motors the encoder of {names[other]} shows {1.0 / ratio:.3f} times its way"
            text = f"{names[joint]}: its motor and {names[other]} disagree"
            settle(self, blame(joint, Evidence.uncertain(joint, text), [Evidence(frozenset({other}), cause)]))

    def _judge_residual(self, joint: int, data: _Data, left: FloatArray) -> bool:
        """Judge play and noise; return whether both are small enough to judge speeds and delays."""
        name = self.robot_part.names[joint]
        speeds, efforts = data.joint_speeds[:, joint], data.efforts[:, joint]
        play = max(_two_sided(left, speeds, _SURELY), _two_sided(left, efforts, _PUSHING))
        hint = f"{name}: the motor leads by {self.shown(play)} from side to side; {likely_causes('backlash')}"
        self.measure("play", play, "deg", high=self.backlash, hint=hint)
        rms = float(np.sqrt(np.mean((left - np.median(left)) ** 2)))
        worst = float(np.abs(left).max())
        self.measure("largest disagreement", worst, "deg")
        if play > self.backlash:
            return False  # play also shows in the rms, and has been judged
        high = self.noise + play / 2
        causes = likely_causes("noise", "drift")
        hint = f"{name}: joint and motor disagree by {self.shown(rms)} rms{_spikes(left)}; {causes}"
        self.measure("rms of the disagreement", rms, "deg", high=high, hint=hint)
        return rms <= high

    def _judge_speeds(self, joint: int, own: _Data) -> None:
        """Judge the measured speeds against the derivatives of the positions, and the delay between joint and motor.

        The motor of the joint's number is judged only if it moves the joint.
        """
        self._judge_speed(joint, "joint", own.time, own.joints[:, joint], own.joint_speeds[:, joint])
        if not self.transmission.coupling[joint, joint]:
            return
        self._judge_speed(joint, "motor", own.time, own.motors[:, joint], own.motor_speeds[:, joint])
        apart = self._delay(joint, own) * 1e3
        hint = (
            f"{self.robot_part.names[joint]}: the motor encoder is {abs(apart):.0f} ms "
            f"{'behind' if apart > 0 else 'ahead of'} the joint encoder; "
            f"{likely_causes('jitter', 'backlash')}"
        )
        self.measure("delay of the motor after the joint", apart, "ms", low=-self.delay, high=self.delay, hint=hint)

    def _judge_speed(self, joint: int, what: str, time: FloatArray, positions: FloatArray, speeds: FloatArray) -> None:
        name, limit = self.robot_part.names[joint], self.velocity_tolerance / 100.0
        reported = _means(speeds[1:-1])
        self.assert_true(
            np.ptp(reported) > 0.0,
            f"{name}: the measured speed of the {what} is {reported[0]:.3g} deg/s all the time; "
            f"{likely_causes('frozen')}",
        )
        agreement = slopes_between(reported, _means(_derived(time, positions))).nearest(1.0)
        hint = (
            f"{name}: by its positions the {what} is {agreement:.2f} times as fast as its measured speed; "
            f"{likely_causes('ratio', 'frozen')}"
        )
        self.measure(f"speed of the {what}, derived by reported", agreement, low=1 - limit, high=1 + limit, hint=hint)

    def _delay(self, joint: int, own: _Data) -> float:
        """Return the delay (s) of the motor encoder behind the joint encoder; negative if it is ahead.

        The difference caused by a delay is proportional to the speed; that of play is constant for each direction.
        """
        motor = own.motors[:, joint]
        speeds = _derived(own.time, motor, _ASIDE)
        fast = np.abs(speeds) > _FAST * float(np.abs(speeds).max())
        inner = slice(_ASIDE, -_ASIDE)
        columns = np.column_stack([motor[inner], speeds, speeds > 0, speeds < 0])[fast]
        said = self.transmission.rotors(own.joints)[inner, joint][fast]
        (ratio, lead, *_), *_ = np.linalg.lstsq(columns, said, rcond=None)
        return float(lead / ratio)

    def _keep(self, joint: int, own: _Data) -> None:
        time = own.time - own.time[0]
        said = self.transmission.rotors(own.joints)[:, joint] / self.transmission.factors[joint]
        motor = own.motors[:, joint] / self.transmission.factors[joint]
        self.record(
            "joint and motor",
            time=(time, "s"),
            joint=(said - said[0], "deg"),
            motor=(motor - motor[0], "deg"),
            difference=(motor - motor[0] - said + said[0], "deg"),
        )


def _joined(traces: list[Trace]) -> _Data:
    """Concatenate the states of traces; empty traces are left out."""
    traces = [trace for trace in traces if len(trace)]
    names = ("time", "positions", "motor_positions", "velocities", "motor_velocities", "efforts")
    return _Data(*(np.concatenate([getattr(trace, name) for trace in traces]) for name in names))


def _derived(time: FloatArray, positions: FloatArray, aside: int = 1) -> FloatArray:
    """Return speeds from the positions ``aside`` states to either side; the result is shorter by that at each end."""
    gaps = time[2 * aside :] - time[: -2 * aside]
    speeds: FloatArray = (positions[2 * aside :] - positions[: -2 * aside]) / np.where(gaps > 0, gaps, np.inf)
    return speeds


def _means(values: FloatArray) -> FloatArray:
    """Return the means of groups of states, one after the other; what is left over at the end does not count.

    Boards report speeds in steps of a count in their window, which can be as large as the speed itself.
    """
    group = max(1, min(_TOGETHER, len(values) // _GROUPS))
    rows = len(values) // group
    means: FloatArray = values[: rows * group].reshape(rows, group).mean(axis=1)
    return means


def _two_sided(left: FloatArray, signal: FloatArray, share: float) -> float:
    """Return the difference of the mean residuals for clearly positive and clearly negative signal; 0 without both."""
    level = share * float(np.abs(signal).max(initial=0.0))
    above, below = left[signal > level], left[signal < -level]
    return abs(float(above.mean() - below.mean())) if min(above.size, below.size) >= _FEWEST else 0.0


def _spikes(left: FloatArray) -> str:
    """Return how many residuals (deg) are spikes, as a part of a sentence; "" if they are not few."""
    away = np.abs(left)
    spikes = away > _SPIKE * float(np.median(away))
    share = float(spikes.mean())
    return f", by spikes in {spikes.sum()} of {left.size} states" if 0 < share < _RARE else ""


def _ratio_hint(ratio: float) -> str:
    if ratio < 0:
        return f"joint and motor turn in opposite directions (ratio {ratio:.3f}); {likely_causes('sign')}"
    for known in _KNOWN_RATIOS:
        for factor in (known, 1 / known):
            if abs(ratio / factor - 1) < _CLOSE:
                where = "too many" if factor > 1 else "too few"
                return (
                    f"the motor turns {ratio:.3f} times as far as configured: a stage of {known:g} {where} in the "
                    f"mechanics; {likely_causes('ratio')}"
                )
    return f"the motor turns {ratio:.3f} times as far as configured; {likely_causes('ratio')}"
