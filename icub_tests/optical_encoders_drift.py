"""Drift of encoders: after many swings motor and joint encoders agree at home as they did at the beginning."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing import Safety, fit_line, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.judging.blame import accused, settle
from rtf.robot_testing.judging.encoder_agreement import Motion, Tolerance, encoder_evidence
from rtf.robot_testing.motion.joint_swings import JointSwinger, Outcome, ends_of
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.testing.recording import Series

#: Time for joints to settle at home, and time of measurement, s.
_SETTLING, _MEASURING = 0.5, 0.2
#: The least share of a swing that the motor encoder has to show.
_LEAST_TURN = 0.5
#: The least expected turn of a motor to judge it, in deg of the joint: motors of several joints may hardly turn.
_LEAST_EXPECTED = 1.0
#: Factor of the derived width of every other joint, so that the motors of couplings do not stand still.
_LESS = 0.6
#: A jump is a step that is greater than this multiple of the median step.
_OUTSTANDING = 8.0
#: Visits of home that are needed to judge a trend.
_FEWEST = 6
_HUNDRED = 100.0


@dataclass
class _Visits:
    """The encoders at home, a row for each visit: half-swings so far, joint and rotor positions (deg)."""

    swings: list[float] = field(default_factory=list)
    joints: list[FloatArray] = field(default_factory=list)
    motors: list[FloatArray] = field(default_factory=list)


class OpticalEncodersDrift(JointsTest):
    """Swings joints many times, and measures the difference of motor and joint encoders at rest at home.

    The joints swing together, and visit home after every few half-swings, at the beginning and at the end. The exact
    position there does not matter, as both encoders are compared. The joints always come from their lower ends, so that
    play does not matter either.
    """

    aliases = ("opticalEncodersDrift", "OpticalEncodersDrift", "motorEncodersDrift", "opticalEncoders-drift")
    tags = ("motion", "encoders", "drift", "long")
    safety = Safety.MOTION

    high = Parameter(list[float], "upper ends of the swings; none: derived", unit="deg", default=[], key="max")
    low = Parameter(list[float], "lower ends of the swings; none: derived", unit="deg", default=[], key="min")
    swing = Parameter(list[float], "width of the derived swings", unit="deg", default=[10.0], low=1.0)
    speed = Parameter(list[float], "speed of all moves", unit="deg/s", default=[20.0], low=0.1)
    cycles = Parameter(int, "half-swings", default=60, low=2)
    every = Parameter(int, "half-swings between two visits of home", default=6, low=1)
    tolerance = Parameter(float, "tolerance of the ends of a swing", unit="deg", default=1.0, low=0.001)
    # Two steps of absolute encoders of 12 bits, 0.09 deg each.
    drift = Parameter(float, "greatest drift, of the joint", unit="deg", default=0.2, low=0.001)
    plot_enabled = Parameter(bool, "accepted and ignored: reports have plots", default=False)

    def setup(self) -> None:
        """Read the transmission of the part, choose the ends of the swings, and hold the joints."""
        super().setup()
        part = self.robot_part
        self.transmission = self.read_transmission()
        self.speeds = self.per_joint("speed", self.speed, self.chosen)
        widths = self.per_joint("swing", self.swing, self.chosen)
        widths = [width * (_LESS if place % 2 else 1.0) for place, width in enumerate(widths)]
        lows = self.per_joint("min", self.low, self.chosen) if self.low else [None] * len(self.chosen)
        highs = self.per_joint("max", self.high, self.chosen) if self.high else [None] * len(self.chosen)
        rows = zip(self.chosen, widths, lows, highs, strict=True)
        self.ends = [ends_of(part, joint, width, low, high) for joint, width, low, high in rows]
        self.swinger = JointSwinger(part, self.transmission, tolerance=self.tolerance)
        self.complaints: dict[int, Outcome] = {}
        self.swinger.begin(self.hold)

    def run(self) -> None:
        """Swing, and judge joint by joint the measurements at home."""
        visits = _Visits()
        self._half_swings(2)
        self._visit(visits, 0)
        with self._growing() as series:
            travel = self._swing(visits, series)
        motors = np.array(visits.motors)
        drift = self.transmission.disagreement(np.array(visits.joints), motors)
        for place, joint in enumerate(self.chosen):
            with self.subresult(self.robot_part.names[joint]):
                self._judge(joint, visits, drift[:, joint], travel[place])
        self.fail_others(self.swinger.evidence, self.chosen)

    def _growing(self) -> Series:
        part = self.robot_part
        units = {part.names[joint]: part.column(joint, np.empty(0))[1] for joint in self.chosen}
        return self.series("drift at home", half_swings="count", **units)

    def _swing(self, visits: _Visits, series: Series) -> FloatArray:
        """Swing until the end, or a clear failure; return the shares of the swings that the motor encoders showed."""
        turned = np.full(len(self.chosen), np.nan)
        done = 0
        while done < self.cycles:
            count = min(self.every, self.cycles - done)
            turned = np.fmax(turned, self._half_swings(count))
            done += count
            self._visit(visits, done)
            apart = self._apart(visits)
            columns = zip(self.chosen, apart, strict=True)
            series.append(done, *(float(self.robot_part.column(joint, drift)[0]) for joint, drift in columns))
            largest = float(np.fmax.reduce(np.abs(apart)))  # of the finite values
            self.progress(done / self.cycles, f"largest drift {largest:.3f} deg")
            if self._hopeless(largest):
                self.report(f"the test ends after {done} half-swings: its failure is certain")
                break
        return turned

    def _hopeless(self, largest: float) -> bool:
        """Whether the failure of the test is certain, so that more swings cannot change it."""
        return largest > _CLEARLY * self.drift or len(self.complaints) == len(self.chosen)

    def _half_swings(self, count: int) -> FloatArray:
        """Make half-swings, the last one to the lower ends.

        Return the greatest shares of them that the motor encoders showed; NaN for motors that should not turn.
        """
        factors = np.abs(self.transmission.factors)[self.chosen]
        shares = np.full(len(self.chosen), np.nan)
        for left in reversed(range(count)):
            before = self._expected_and_found()
            self._go([ends.high if left % 2 else ends.low for ends in self.ends])
            expected, found = np.abs(self._expected_and_found() - before) / factors
            enough = expected > _LEAST_EXPECTED
            shares = np.fmax(shares, np.where(enough, found / np.where(enough, expected, 1.0), np.nan))
        return shares

    def _expected_and_found(self) -> FloatArray:
        """Return the rotor positions expected by the joint encoders, and the measured ones (deg), a row each."""
        joints, motors = self.robot_part.board.encoders_together()
        return np.array([self.transmission.rotors(joints), motors])[:, self.chosen]

    def _go(self, targets: Sequence[float]) -> None:
        """Move all joints without a complaint; again without those that are to blame for a stop by the guard."""
        while going := [place for place, joint in enumerate(self.chosen) if joint not in self.complaints]:
            chosen = [self.chosen[place] for place in going]
            try:
                outcomes = self.swinger.go(
                    [targets[place] for place in going], chosen, [self.speeds[place] for place in going]
                )
            except GuardError as error:
                self.complaints.update(self.swinger.stopped(error))
                continue
            self.complaints.update(outcomes)
            return

    def _visit(self, visits: _Visits, done: int) -> None:
        """Go home, and measure the mean positions there at rest."""
        part = self.robot_part
        self._go([part.home[joint] for joint in self.chosen])
        part.wait(_SETTLING, pace=_SETTLING)
        with part.recorded() as trace:
            part.wait_to_arrive(lambda: len(trace) > 0, _MEASURING, pace=_MEASURING)
        self.assert_error_if_false(len(trace), f"{part.name} publishes no states: nothing to measure")
        visits.swings.append(done)
        visits.joints.append(trace.positions.mean(axis=0))
        visits.motors.append(trace.motor_positions.mean(axis=0))

    def _apart(self, visits: _Visits) -> FloatArray:
        """Return the drift of the chosen joints so far (deg)."""
        now, first = (self.transmission.disagreement(visits.joints[index], visits.motors[index]) for index in (-1, 0))
        apart: FloatArray = (now - first)[self.chosen]
        return apart

    def _judge(self, joint: int, visits: _Visits, apart: FloatArray, share: float) -> None:
        """Judge a joint by the differences of its encoders (deg) at the visits of home."""
        name, swings = self.robot_part.names[joint], np.array(visits.swings)
        if (verdict := self.swinger.verdict(joint, self.complaints.get(joint, Outcome()))) is not None:
            settle(self, verdict)
        missing = int((~np.isfinite(apart)).sum())
        self.assert_error_if_true(
            missing,
            f"{name}: at {missing} of {apart.size} visits of home its encoders, or those of joints that its motor "
            f"turns, have no finite values; {likely_causes('frozen')}",
        )
        drift = apart - apart[0]
        self.record("drift", half_swings=(swings, "count"), drift=(drift, "deg"))
        self.assert_error_if_true(np.isnan(share), f"{name}: no half-swing turns its motor, so it cannot be judged")
        hint = f"{name} swings, but its motor encoder does not; {likely_causes('frozen')}"
        self.measure("turn of the motor by the joint's", share, low=_LEAST_TURN, hint=hint)
        last, jump = float(drift[-1]), _greatest_jump(drift)
        how = f"in one jump, at half-swing {swings[jump]:.0f}" if jump else "gradually"
        text = (
            f"{name}: motor and joint encoder differ by {self.shown(last, '+.3f')} more than at the beginning "
            f"({last * self.transmission.factors[joint]:+.1f} deg of the rotor), {how}"
        )
        if float(np.ptp(drift)) > self.drift and (cause := self._cause(joint, visits)):
            self.inconclusive(f"{text}; explained by: {cause}")
        hint = f"{text}; {likely_causes('drift')}"
        self.measure("drift at the end", last, "deg", low=-self.drift, high=self.drift, hint=hint)
        if len(drift) >= _FEWEST:
            self._judge_trend(name, swings, drift)

    def _cause(self, joint: int, visits: _Visits) -> str:
        """Return which encoder explains the drift of a joint that shares a motor with another one; "" if its own do."""
        names, transmission = self.robot_part.names, self.transmission
        sharing = {*transmission.coupled(joint)} - {joint}
        if not sharing:
            return ""
        positions, motors = np.array(visits.joints), np.array(visits.motors)
        motion = Motion.of(positions, motors, transmission.gearbox, transmission.coupling)
        wrong = accused(encoder_evidence(motion, names, Tolerance(self.drift, share=0.0)))
        if joint in wrong or sharing.isdisjoint(wrong):
            return ""
        return f"the encoder of {names[min(sharing & {*wrong})]} drifts, which shares a motor with it"

    def _judge_trend(self, name: str, swings: FloatArray, drift: FloatArray) -> None:
        """Judge the lower confidence bound of the linear trend of the drift."""
        line = fit_line(swings, drift)
        self.measure("trend in 100 half-swings", _HUNDRED * line.slope, "deg")
        self.measure("interval of the trend (99 %)", _HUNDRED * line.slope_interval, "deg")
        swung = max(self.cycles, _HUNDRED)
        surely = max(0.0, abs(line.slope) - line.slope_interval) * swung
        hint = (
            f"{name} drifts by at least {self.shown(surely, '.3f')} in {swung:.0f} half-swings, with a confidence of "
            f"99 %; {likely_causes('drift')}"
        )
        self.measure("drift by the trend, at least", surely, "deg", high=self.drift, hint=hint)


#: Multiple of the allowed drift at which the test ends early.
_CLEARLY = 5.0


def _greatest_jump(drift: FloatArray) -> int:
    """Return the visit at which most of the drift appeared at once; 0 for a gradual drift."""
    steps = np.abs(np.diff(drift))
    most = int(steps.argmax())
    others = float(np.median(steps))
    return most + 1 if steps[most] > max(_OUTSTANDING * others, 0.5 * abs(drift[-1])) else 0
