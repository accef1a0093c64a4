"""Drift of encoders: after many swings a motor's encoder shows at home what it showed there at the beginning."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RobotError
from rtf.robot_testing import Safety, fit_line, likely_causes
from rtf.robot_testing.joint_swings import JointSwinger, Outcome, ends_of
from rtf.robot_testing.joints_out_of_limits import exclude_joints_out_of_limits
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.transmission import Transmission
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.testing.series import Series

#: How long joints settle at home before they are measured, and how long they are, s.
_SETTLING, _MEASURING = 0.5, 0.2
#: The least share of a swing that the motor has to turn the joint, by its encoder's account.
_LEAST_TURN = 0.5
#: The least turn of a motor that is looked at, in deg of the joint: motors of several joints may hardly turn.
_TELLING = 1.0
#: Of the joints whose swings are derived every other one swings less, lest the motors of couplings stand still.
_LESS = 0.6
#: Jumps are told apart from the spread of their neighbours by so many times that spread (of the median).
_OUTSTANDING = 8.0
#: Visits of home that a trend needs to be judged.
_FEWEST = 6
_HUNDRED = 100.0


@dataclass
class _Visits:
    """What joint and motor encoders showed at home, a row a visit: half-swings so far, deg of joints, deg of rotors."""

    swings: list[float] = field(default_factory=list)
    joints: list[FloatArray] = field(default_factory=list)
    motors: list[FloatArray] = field(default_factory=list)


class OpticalEncodersDrift(JointsTest):
    """Swings joints to and fro many times, and measures at home, at rest, how far motor and joint encoders are apart.

    The joints swing together. Every so many half-swings they come home; the first and the last time, too. Where the
    joints stop exactly is no matter, for both encoders are compared there. They always come from their lower ends, so
    that play is none either.
    """

    aliases = ("opticalEncodersDrift", "OpticalEncodersDrift", "motorEncodersDrift", "opticalEncoders-drift")
    tags = ("motion", "encoders", "drift", "long")
    safety = Safety.MOTION

    high = Parameter(list[float], "upper ends of the swings; none: derived", unit="deg", default=[], key="max")
    low = Parameter(list[float], "lower ends of the swings; none: derived", unit="deg", default=[], key="min")
    swing = Parameter(list[float], "width of the swings that are derived", unit="deg", default=[10.0], low=1.0)
    speed = Parameter(list[float], "speed of all moves", unit="deg/s", default=[20.0], low=0.1)
    cycles = Parameter(int, "half-swings", default=60, low=2)
    every = Parameter(int, "half-swings between two visits of home", default=6, low=1)
    tolerance = Parameter(float, "how near is at an end of a swing", unit="deg", default=1.0, low=0.001)
    # Absolute encoders of 12 bits have ticks of 0.09 deg: two of them.
    drift = Parameter(float, "greatest drift, of the joint", unit="deg", default=0.2, low=0.001)
    plot_enabled = Parameter(bool, "taken and not needed: reports have plots", default=False)

    def setup(self) -> None:
        """See how the part is geared, where its joints swing, and bring them home."""
        super().setup()
        part = self.robot_part
        try:
            self.transmission = Transmission.read(part.board)
        except RobotError as error:
            self.assert_error(f"{part.name}: {error}")
        self.speeds = self.per_joint("speed", self.speed, self.chosen)
        widths = self.per_joint("swing", self.swing, self.chosen)
        widths = [width * (_LESS if place % 2 else 1.0) for place, width in enumerate(widths)]
        lows = self.per_joint("min", self.low, self.chosen) if self.low else [None] * len(self.chosen)
        highs = self.per_joint("max", self.high, self.chosen) if self.high else [None] * len(self.chosen)
        rows = zip(self.chosen, widths, lows, highs, strict=True)
        self.ends = [ends_of(part, joint, width, low, high) for joint, width, low, high in rows]
        self.hold()
        self.swinger = JointSwinger(part, self.transmission, tolerance=self.tolerance)
        self.complaints: dict[int, Outcome] = {}
        self.swinger.give_up(exclude_joints_out_of_limits(part))

    def run(self) -> None:
        """Swing, and judge joint by joint what was seen at home."""
        visits = _Visits()
        self._half_swings(2)
        self._visit(visits, 0)
        with self._growing() as series:
            travel = self._swing(visits, series)
        motors = np.array(visits.motors)
        drift = self.transmission.disagreement(np.array(visits.joints), motors)
        for place, joint in enumerate(self.chosen):
            with self.subresult(self.robot_part.names[joint]):
                self._judge(joint, np.array(visits.swings), drift[:, joint], travel[place])

    def _growing(self) -> Series:
        names = [self.robot_part.names[joint] for joint in self.chosen]
        return self.series("drift at home", half_swings="count", **dict.fromkeys(names, "deg"))

    def _swing(self, visits: _Visits, series: Series) -> FloatArray:
        """Swing until the end, or a clear failure; returns the shares of the swings that the motors have turned."""
        turned = np.full(len(self.chosen), np.nan)
        done = 0
        while done < self.cycles:
            count = min(self.every, self.cycles - done)
            turned = np.fmax(turned, self._half_swings(count))
            done += count
            self._visit(visits, done)
            apart = self._apart(visits)
            series.append(done, *apart)
            largest = float(np.fmax.reduce(np.abs(apart)))  # of those that show numbers
            self.progress(done / self.cycles, f"largest drift {largest:.3f} deg")
            if self._hopeless(largest):
                self.report(f"it has become clear after {done} half-swings, and ends here")
                break
        return turned

    def _hopeless(self, largest: float) -> bool:
        """Whether a joint has failed so clearly that more swings say nothing more."""
        return largest > _CLEARLY * self.drift or len(self.complaints) == len(self.chosen)

    def _half_swings(self, count: int) -> FloatArray:
        """Some half-swings, of which the last ends low.

        Returns the greatest shares of them that the motors turned their joints, NaN without any.
        """
        factors = np.abs(self.transmission.factors)[self.chosen]
        shares = np.full(len(self.chosen), np.nan)
        for left in reversed(range(count)):
            before = self._expected_and_found()
            self._go([ends.high if left % 2 else ends.low for ends in self.ends])
            expected, found = np.abs(self._expected_and_found() - before) / factors
            enough = expected > _TELLING
            shares = np.fmax(shares, np.where(enough, found / np.where(enough, expected, 1.0), np.nan))
        return shares

    def _expected_and_found(self) -> FloatArray:
        """Where the rotors should be by the joints' account, and where they are (deg); a row each."""
        joints, motors = self.robot_part.board.encoders_together()
        return np.array([self.transmission.rotors(joints), motors])[:, self.chosen]

    def _go(self, targets: Sequence[float]) -> None:
        going = [place for place, joint in enumerate(self.chosen) if joint not in self.complaints]
        if not going:
            return
        outcomes = self.swinger.go(
            [targets[place] for place in going],
            [self.chosen[place] for place in going],
            [self.speeds[place] for place in going],
        )
        self.complaints.update(outcomes)

    def _visit(self, visits: _Visits, done: int) -> None:
        """Go home, and measure at rest there: the mean of some states."""
        part = self.robot_part
        self._go([part.home[joint] for joint in self.chosen])
        part.wait(_SETTLING, pace=_SETTLING)
        with part.recorded() as trace:
            part.wait_to_arrive(lambda: len(trace) > 0, _MEASURING, pace=_MEASURING)
        self.assert_error_if_false(len(trace), f"{part.name} publishes no states: nothing can be measured")
        visits.swings.append(done)
        visits.joints.append(trace.positions.mean(axis=0))
        visits.motors.append(trace.motor_positions.mean(axis=0))

    def _apart(self, visits: _Visits) -> FloatArray:
        """The drift so far of the chosen joints (deg)."""
        now, first = (self.transmission.disagreement(visits.joints[index], visits.motors[index]) for index in (-1, 0))
        apart: FloatArray = (now - first)[self.chosen]
        return apart

    def _judge(self, joint: int, swings: FloatArray, apart: FloatArray, share: float) -> None:
        """Judge by how far both encoders were apart (deg) after so many half-swings."""
        name = self.robot_part.names[joint]
        if doubt := self.swinger.in_doubt(joint):
            self.inconclusive(f"{name} {doubt}: nothing can be said of it")
        complaint = self.complaints.get(joint)
        if complaint is not None:
            self.assert_fail(f"{name} {complaint.complaint}; {likely_causes(*complaint.findings)}")
        missing = int((~np.isfinite(apart)).sum())
        self.assert_error_if_true(
            missing,
            f"{name}: at {missing} of {apart.size} visits of home its encoders, or those of joints that its motor "
            f"turns, show no numbers; {likely_causes('frozen')}",
        )
        drift = apart - apart[0]
        self.assert_error_if_true(np.isnan(share), f"{name}: no half-swing turns its motor, so it says nothing")
        hint = f"{name} swings, its motor's encoder does not; {likely_causes('frozen')}"
        self.measure("turn of the motor by the joint's", share, low=_LEAST_TURN, hint=hint)
        last, jump = float(drift[-1]), _greatest_jump(drift)
        how = f"in one jump, at half-swing {swings[jump]:.0f}" if jump else "little by little"
        hint = (
            f"{name}: motor and joint encoder are {last:+.3f} deg further apart than in the beginning "
            f"({last * self.transmission.factors[joint]:+.1f} deg of the rotor), {how}; {likely_causes('drift')}"
        )
        self.measure("drift at the end", last, "deg", low=-self.drift, high=self.drift, hint=hint)
        if len(drift) >= _FEWEST:
            self._judge_trend(name, swings, drift)
        self.record("drift", half_swings=(swings, "count"), drift=(drift, "deg"))

    def _judge_trend(self, name: str, swings: FloatArray, drift: FloatArray) -> None:
        """Judge whether the line through the drift surely leads beyond what is allowed."""
        line = fit_line(swings, drift)
        self.measure("trend in 100 half-swings", _HUNDRED * line.slope, "deg")
        self.measure("interval of the trend (99 %)", _HUNDRED * line.slope_interval, "deg")
        swung = max(self.cycles, _HUNDRED)
        surely = max(0.0, abs(line.slope) - line.slope_interval) * swung
        hint = (
            f"{name} drifts by {surely:.3f} deg or more in {swung:.0f} half-swings, with a confidence of 99 %; "
            f"{likely_causes('drift')}"
        )
        self.measure("drift by the trend, at least", surely, "deg", high=self.drift, hint=hint)


#: So many times the allowed drift is beyond doubt.
_CLEARLY = 5.0


def _greatest_jump(drift: FloatArray) -> int:
    """The visit by which most of the drift came at once; 0 when it came little by little."""
    steps = np.abs(np.diff(drift))
    most = int(steps.argmax())
    others = float(np.median(steps))
    return most + 1 if steps[most] > max(_OUTSTANDING * others, 0.5 * abs(drift[-1])) else 0
