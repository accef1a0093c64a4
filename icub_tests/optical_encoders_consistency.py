"""Consistency of encoders: what the motors' encoders say agrees with the joints' through gearboxes and couplings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import RobotError
from rtf.robot_testing import Safety, fit_line, likely_causes
from rtf.robot_testing.joint_swings import JointSwinger, Outcome, ends_of
from rtf.robot_testing.joints_out_of_limits import exclude_joints_out_of_limits
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.parameter_checks import joint_count
from rtf.robot_testing.part import PACE
from rtf.robot_testing.routines import one_at_a_time, run_queues, until
from rtf.robot_testing.transmission import Transmission
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace
    from rtf.robot_testing.routines import Routine

#: A joint has swung when its encoder has seen so much of it, deg.
_SWUNG = 1.0
#: Speed beyond which a joint surely moves in one direction, as a share of its greatest in the swing.
_SURELY = 0.3
#: Torques, as shares of the greatest duty cycle, that surely push in one direction; and the fewest states of each side.
_PUSHING, _FEWEST = 0.1, 10
#: Gear ratios that were met with in the wrong place: an extra stage of 75/50.
_KNOWN_RATIOS = (1.5,)
#: By how much numbers of a matrix that went through texts may differ, and ratios be off a known one.
_SAME, _CLOSE = 1e-3, 0.01
#: What is left, as a share of the half swing, from which on the estimates of ratios are in doubt themselves.
_DOUBTFUL = 0.02
#: A delay shows best where a joint is fast, beyond this share of its greatest speed: there it has passed all play. Its
#: speed is taken over so many states to both sides, so that the ticks of encoders are no part of it.
_FAST, _ASIDE = 0.5, 5


class _Data(NamedTuple):
    """States of swings, one after the other: times (s), a row a state, a column an axis (deg, deg/s, %)."""

    time: FloatArray
    joints: FloatArray
    motors: FloatArray
    joint_speeds: FloatArray
    motor_speeds: FloatArray
    duties: FloatArray


class _Swing(NamedTuple):
    """How the swings of a joint went, and the states meanwhile."""

    outcome: Outcome
    trace: Trace


class OpticalEncodersConsistency(JointsTest):
    """Swings joints one by one, and compares every state of joints and motors.

    The row of each motor in gearboxes and couplings is estimated from all swings of its board by least squares: so a
    wrong ratio, a wrong sign and a wrong coupling show apart. What is left is noise and play. Joints that cannot meet
    each other, such as an arm and its hand, swing at the same time, but no two of a board.
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
    swing = Parameter(list[float], "width of the swings that are derived", unit="deg", default=[20.0], low=2.0)
    speed = Parameter(list[float], "speed of all moves", unit="deg/s", default=[20.0], low=0.1)
    cycles = Parameter(int, "half-swings of each joint", default=4, low=2)
    tolerance = Parameter(float, "how near is at an end of a swing", unit="deg", default=1.0, low=0.001)
    matrix_size = Parameter(int, "size of the coupling matrix that is expected; 0: that of the board", default=0, low=0)
    matrix = Parameter(list[float], "coupling matrix of the joints that is expected, row by row", default=[])
    # Gearboxes and resolutions are whole numbers of teeth and ticks: what differs at all differs by more.
    ratio_tolerance = Parameter(float, "error of a ratio", unit="%", default=2.0, low=0.01)
    velocity_tolerance = Parameter(float, "error of the speeds that are told", unit="%", default=10.0, low=0.1)
    # Absolute encoders of 12 bits have ticks of 0.09 deg; a tendon gives way by less than a degree.
    noise = Parameter(float, "greatest rms of the disagreement", unit="deg", default=0.25, low=0.001)
    backlash = Parameter(float, "greatest play", unit="deg", default=1.0, low=0.001)
    delay = Parameter(float, "greatest delay between joint and motor", unit="ms", default=20.0, low=0.1)
    plot_enabled = Parameter(bool, "taken and not needed: reports have plots", default=False)
    plot_string_1 = Parameter(str, "taken and not needed", default="", key="plotString1")
    plot_string_2 = Parameter(str, "taken and not needed", default="", key="plotString2")
    plot_string_3 = Parameter(str, "taken and not needed", default="", key="plotString3")
    plot_string_4 = Parameter(str, "taken and not needed", default="", key="plotString4")

    def parameter_problems(self) -> list[str]:
        """See the base; and a matrix has to be a square one of the joints."""
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
        """See how the part is geared, and where its joints swing."""
        super().setup()
        part = self.robot_part
        wrong = self._wrong_matrix(len(self.chosen))
        self.assert_error_if_true(wrong, "; ".join(wrong))
        try:
            self.transmission = Transmission.read(part.board)
        except RobotError as error:
            self.assert_error(f"{part.name}: {error}")
        self.speeds = self.per_joint("speed", self.speed, self.chosen)
        widths = self.per_joint("swing", self.swing, self.chosen)
        lows = self.per_joint("min", self.low, self.chosen) if self.low else None
        highs = self.per_joint("max", self.high, self.chosen) if self.high else None
        self.ends = [
            ends_of(part, joint, widths[place], lows and lows[place], highs and highs[place])
            for place, joint in enumerate(self.chosen)
        ]
        self.hold()
        self.swinger = JointSwinger(part, self.transmission, tolerance=self.tolerance)
        self.swinger.give_up(exclude_joints_out_of_limits(part))

    def run(self) -> None:
        """Swing joint by joint, then judge motor by motor."""
        part = self.robot_part
        self._swings: dict[int, _Swing] = {}
        self._moving = set[int]()
        run_queues(part, one_at_a_time(part.names, self.chosen), self._routine, pace=PACE)
        self._compare_with_expected()
        for joint in self.chosen:
            with self.subresult(part.names[joint]):
                self._judge(joint, *self._swings[joint])

    def _routine(self, joint: int) -> Routine[None]:
        """Swing a joint, when no other of its board moves: what its motors do is to be told apart."""
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
        """The states of all swings of the board of a joint."""
        block = self.transmission.blocks[joint]
        return _joined([self._swings[one].trace for one in self.chosen if one in block])

    def _compare_with_expected(self) -> None:
        """The matrix of the parameters against that of the board, joint by joint."""
        if not self.matrix:
            return
        count = len(self.chosen)
        told = self.transmission.coupling[np.ix_(self.chosen, self.chosen)]
        wrong = np.argwhere(np.abs(told - np.reshape(self.matrix, (count, count))) > _SAME)
        for row, column in wrong.tolist():
            self.warn(
                f"{self.robot_part.names[self.chosen[row]]}: the board's coupling with "
                f"{self.robot_part.names[self.chosen[column]]} is {told[row, column]:g}, not "
                f"{self.matrix[row * count + column]:g}"
            )

    def _judge(self, joint: int, outcome: Outcome, trace: Trace) -> None:
        name = self.robot_part.names[joint]
        if doubt := self.swinger.in_doubt(joint):
            self.inconclusive(f"{name} {doubt}: nothing can be said of it")
        if outcome.excuse:
            self.inconclusive(f"{name} {outcome.complaint}; but {outcome.excuse}")
        if outcome.complaint:
            self.check(condition=False, text=f"{name} {outcome.complaint}; {likely_causes(*outcome.findings)}")
        if not len(trace):
            self.assert_error_if_false(outcome.complaint, f"{name}: the board publishes no states")
            return
        data, own = self._of_board(joint), _joined([trace])
        if missing := self._missing(joint, data):
            self.assert_error_if_false(
                outcome.complaint,
                f"{name}: {missing} of {len(data.time)} states have no numbers for it; {likely_causes('frozen')}",
            )
            return
        travel = float(np.ptp(own.joints[:, joint]))
        turned = float(np.ptp(own.motors[:, joint])) / abs(self.transmission.factors[joint])
        self.assert_true(
            travel >= _SWUNG or turned < _SWUNG,
            f"{name}: its motor turns it by {turned:.1f} deg, its encoder shows {travel:.2f} deg; "
            f"{likely_causes('frozen')}",
        )
        if travel < _SWUNG:
            self.assert_error_if_false(outcome.complaint, f"{name}: {travel:.2f} deg of motion say nothing")
            return
        self.assert_true(
            turned >= 0.1 * travel or not self.transmission.coupling[joint, joint],  # then others turn it
            f"{name} moves by {travel:.1f} deg, its motor's encoder does not; {likely_causes('frozen')}",
        )
        ratios, left = self._estimate(joint, data)
        # What does not fit a line at all says less of its slope: a share of the half swing.
        doubt = float(left.std()) / (travel / 2)
        self._judge_ratios(joint, ratios, self.ratio_tolerance / 100.0 + (doubt if doubt > _DOUBTFUL else 0.0))
        if self._judge_residual(joint, data, left):
            self._judge_speeds(joint, own)
        self._keep(joint, own)

    def _missing(self, joint: int, data: _Data) -> int:
        """How many states lack a number that a joint is judged by: of its own, or of a joint that turns its motor."""
        turning = [*{joint, *np.flatnonzero(self.transmission.coupling[joint])}]
        own = np.column_stack([column[:, joint] for column in data[2:-1]])
        return int((~np.isfinite(np.column_stack([own, data.joints[:, turning]])).all(axis=1)).sum())

    def _estimate(self, joint: int, data: _Data) -> tuple[dict[int, float], FloatArray]:
        """How far the motor turns with each joint of its board, in units of its gear; and what is left (deg)."""
        factor = float(self.transmission.factors[joint])
        moved = [j for j in self.transmission.blocks[joint] if np.ptp(data.joints[:, j]) >= _SWUNG]
        expected = self.transmission.gearbox[joint] * self.transmission.coupling[joint]
        still = [j for j in range(len(expected)) if j not in moved and expected[j]]
        rest = data.motors[:, joint] - data.joints[:, still] @ expected[still]
        columns = np.column_stack([data.joints[:, moved], np.ones(len(rest))])
        estimate, *_ = np.linalg.lstsq(columns, rest, rcond=None)
        left: FloatArray = (rest - columns @ estimate) / factor
        return dict(zip(moved, (estimate[:-1] / factor).tolist(), strict=True)), left

    def _judge_ratios(self, joint: int, ratios: dict[int, float], limit: float) -> None:
        """The motor's row of the couplings against what is configured."""
        names, own = self.robot_part.names, self.transmission.coupling[joint]
        factor = float(self.transmission.factors[joint])
        expected = self.transmission.gearbox[joint] * own / factor
        ratio = ratios[joint]
        if own[joint]:
            hint = f"{names[joint]}: {_ratio_hint(ratio)}"
            self.measure("ratio to what is configured", ratio, low=1 - limit, high=1 + limit, hint=hint)
        errors = {other: found - float(expected[other]) for other, found in ratios.items() if other != joint}
        if errors:
            worst = max(errors, key=lambda other: abs(errors[other]))
            hint = (
                f"{names[joint]}: its motor turns {ratios[worst]:.3f} times with {names[worst]}, in units of its "
                f"own gear, and not {expected[worst]:.3f} times; {likely_causes('ratio')}"
            )
            self.measure("greatest error of a coupling", errors[worst], low=-limit, high=limit, hint=hint)

    def _judge_residual(self, joint: int, data: _Data, left: FloatArray) -> bool:
        """Play and noise; whether both are in order, so that finer things can be seen."""
        name = self.robot_part.names[joint]
        speeds, duties = data.joint_speeds[:, joint], data.duties[:, joint]
        play = max(_two_sided(left, speeds, _SURELY), _two_sided(left, duties, _PUSHING))
        hint = f"{name}: the motor leads by {play:.2f} deg from side to side; {likely_causes('backlash')}"
        self.measure("play", play, "deg", high=self.backlash, hint=hint)
        rms = float(np.sqrt(np.mean((left - np.median(left)) ** 2)))
        worst = float(np.abs(left).max())
        self.measure("largest disagreement", worst, "deg")
        if play > self.backlash:
            return False  # play is no noise: it shows in the rms, too, and has been judged
        high = self.noise + play / 2
        hint = f"{name}: joint and motor disagree by {rms:.2f} deg rms; {likely_causes('noise', 'drift')}"
        self.measure("rms of the disagreement", rms, "deg", high=high, hint=hint)
        return rms <= high

    def _judge_speeds(self, joint: int, own: _Data) -> None:
        """Speeds that are told against what the positions say by their stamps; and joint against motor in time.

        The motor of that number is looked at where it moves the joint.
        """
        self._judge_speed(joint, "joint", own.time, own.joints[:, joint], own.joint_speeds[:, joint])
        if not self.transmission.coupling[joint, joint]:
            return
        self._judge_speed(joint, "motor", own.time, own.motors[:, joint], own.motor_speeds[:, joint])
        apart = self._delay(joint, own) * 1e3
        hint = (
            f"{self.robot_part.names[joint]}: the motor's encoder shows {abs(apart):.0f} ms "
            f"{'after' if apart > 0 else 'before'} the joint's what it should at once; "
            f"{likely_causes('jitter', 'backlash')}"
        )
        self.measure("delay of the motor after the joint", apart, "ms", low=-self.delay, high=self.delay, hint=hint)

    def _judge_speed(self, joint: int, what: str, time: FloatArray, positions: FloatArray, speeds: FloatArray) -> None:
        name, limit = self.robot_part.names[joint], self.velocity_tolerance / 100.0
        agreement = fit_line(speeds[1:-1], _derived(time, positions)).slope
        hint = (
            f"{name}: the {what} turns {agreement:.2f} times as fast as the speed that is told, by its positions; "
            f"{likely_causes('ratio', 'frozen')}"
        )
        self.measure(f"speed of the {what}, derived by told", agreement, low=1 - limit, high=1 + limit, hint=hint)

    def _delay(self, joint: int, own: _Data) -> float:
        """By how many seconds the motor's encoder is behind the joint's; negative when it is the other way round.

        A delay puts the two apart in proportion to the speed, play by the same at all speeds, to either side.
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
    """The states of traces, one after the other, of those that have any."""
    traces = [trace for trace in traces if len(trace)]
    names = ("time", "positions", "motor_positions", "velocities", "motor_velocities", "duty_cycles")
    return _Data(*(np.concatenate([getattr(trace, name) for trace in traces]) for name in names))


def _derived(time: FloatArray, positions: FloatArray, aside: int = 1) -> FloatArray:
    """Speeds from positions so many states to both sides; as many less at each end."""
    gaps = time[2 * aside :] - time[: -2 * aside]
    speeds: FloatArray = (positions[2 * aside :] - positions[: -2 * aside]) / np.where(gaps > 0, gaps, np.inf)
    return speeds


def _two_sided(left: FloatArray, signal: FloatArray, share: float) -> float:
    """What is left where a signal is surely positive, less that where it is surely negative; 0 when it is never so."""
    level = share * float(np.abs(signal).max(initial=0.0))
    above, below = left[signal > level], left[signal < -level]
    return abs(float(above.mean() - below.mean())) if min(above.size, below.size) >= _FEWEST else 0.0


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
