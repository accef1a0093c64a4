"""Position direct: joints follow a streamed sine, in each form of the command."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import PidType
from rtf.robot_testing import GuardError, RobotTest, Safety, delay_between, likely_causes
from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.checked_values import CheckedValue, judge_values
from rtf.robot_testing.judging.friction_hold import held_by_friction
from rtf.robot_testing.judging.real_time_checks import loop_delay
from rtf.robot_testing.judging.sine import RampedSine, fit_sine
from rtf.robot_testing.motion.disturbance import disturbance
from rtf.robot_testing.motion.periodic_loop import ticks
from rtf.robot_testing.motion.start_position import bring, late_evidence, late_joints, starting_point
from rtf.robot_testing.slides import converted, in_metres
from rtf.testing import Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part, Trace

#: Forms of the command by the value of cmdMode.
_FORMS = {0: "single", 1: "all", 2: "group"}
#: The number of commands after which the references are read back from the board.
_LOOKS = 3
#: Greatest step between two commands, deg: larger ones are dangerous.
_LARGEST_STEP = 2.0
#: Probes for lost commands: their number, their size (deg), and the time for each to arrive (s).
_PROBES, _PROBE, _PROBE_TIME = 12, 0.2, 0.05
#: Friction holds a joint where it turns. That repeats with the sine: harmonics of it, so many, and none above (Hz).
_HARMONICS, _SLOW = 15, 8.0
#: Tolerance of the sine that was sent, as a share of its amplitude.
_STIMULUS = 0.05


class _Run(NamedTuple):
    """The commands sent and the references read back, a row each: times in s from the start, positions in deg."""

    sent_at: FloatArray
    sent: FloatArray
    looked_at: FloatArray
    taken: FloatArray
    trace: Trace
    begin: float


class PositionDirect(RobotTest):
    """All chosen joints follow a sine about their positions; it fades in and out.

    It is commanded in three forms, one after the other: joint by joint, to the whole part, and to the group of joints.
    Before each, small single steps show whether the board executes every command. If this machine is too busy to send
    the commands in time, values out of bounds are inconclusive.
    """

    aliases = ("positionDirect", "Position Direct")
    tags = ("motion", "control")
    safety = Safety.MOTION

    part = Parameter(str, "the part whose joints move", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all", default=[])
    zero = Parameter(list[float], "the middle of the sine; none: the current position", unit="deg", default=[])
    frequency = Parameter(float, "of the sine", unit="Hz", default=0.5, low=0.01, high=5.0)
    amplitude = Parameter(float, "of the sine; less where the limits are near", unit="deg", default=3.0, low=0.1)
    cycles = Parameter(
        float, "full periods, besides one that fades in and one that fades out; at least one", unit="count",
        default=1.0, low=0.001,
    )  # fmt: skip
    tolerance = Parameter(float, "greatest tracking error", unit="deg", default=1.5, low=0.001)
    sample_time = Parameter(
        float, "time between two commands", unit="s", default=0.02, low=0.001, high=0.1, key="sampleTime"
    )
    forms = Parameter(
        list[int], "0: joint by joint, 1: the whole part, 2: the group", default=[0, 1, 2], choices=(0, 1, 2),
        key="cmdMode",
    )  # fmt: skip
    delay = Parameter(float, "greatest delay of the joints", unit="s", default=0.1, low=0.0)
    shape = Parameter(
        float, "greatest deviation from a sine, root mean square", unit="deg", default=0.2, low=0.0, key="shapeError"
    )
    # 2 % in the models of robots, 30 % more at rest, 30 % more of another unit, whose motor may give 8 % less torque.
    friction = Parameter(
        float, "friction of a joint, as a share of the greatest output of its controller", unit="%", default=3.7,
        low=0.0, high=100.0,
    )  # fmt: skip
    ripple = Parameter(
        float, "the same of the speed, without what friction adds to it, as a share of the greatest", unit="%",
        default=25.0, low=0.0, key="speedRipple",
    )  # fmt: skip

    def setup(self) -> None:
        """Open the part, and choose a sine for each joint within its limits and its greatest speed."""
        super().setup()
        self.robot_part = part = self.open_part(self.part)
        self.chosen = self.select(part, self.joints)
        middle = [*self.per_joint("zero", self.zero, self.chosen)] if self.zero else [None] * len(self.chosen)
        amplitudes = [min(self.amplitude, 0.45 * float(part.high[j] - part.low[j])) for j in self.chosen]
        self.middle = np.array([
            starting_point(part, joint, where, amplitude, both_sides=True)[0]
            for joint, where, amplitude in zip(self.chosen, middle, amplitudes, strict=True)
        ])  # fmt: skip
        cycles = max(1.0, self.cycles)  # less than a period does not show a sine
        self.sine = RampedSine(np.array(amplitudes), self.frequency, cycles)
        self._refuse_fast_sines(part)

    def _refuse_fast_sines(self, part: Part) -> None:
        speed = self.sine.greatest_speed
        place = int(speed.argmax())
        joint = self.chosen[place]
        sine = f"a sine of {part.shown(joint, float(self.sine.amplitudes[place]), 'g')} at {self.frequency:g} Hz"
        self.assert_error_if_true(
            float(speed[place]) * self.sample_time >= _LARGEST_STEP,
            f"{sine}, sent every {self.sample_time:g} s, steps by "
            f"{part.shown(joint, float(speed[place]) * self.sample_time, '.1f')}; less than "
            f"{part.shown(joint, _LARGEST_STEP, 'g')} is safe",
        )
        fast = [part.names[j] for j, most in zip(self.chosen, speed, strict=True) if most > part.fastest[j]]
        self.assert_error_if_true(fast, f"{sine} is too fast for {', '.join(fast)}")

    def run(self) -> None:
        """Test the forms in turn."""
        part = self.robot_part
        self._exclude_late_joints(part)
        for place, form in enumerate(self.forms):
            name = _FORMS[form]
            self.progress(place / len(self.forms), name)
            bring(self, part, self.chosen, self.middle)
            try:
                try:
                    self._enter(part)
                    lost = self._probe(part, form)
                    run = self._follow(part, form)
                finally:
                    part.set_mode(ControlMode.POSITION)
            except GuardError as error:  # also on the way back
                self.blame(part, error, "runs away", joints=self.chosen, during=name)
            self._judge_stimulus(name, run)
            for column, joint in enumerate(self.chosen):
                with self.subresult(f"{part.names[joint]} {name}"):
                    self._judge_lost(part.names[joint], lost[column])
                    self._judge(part.names[joint], joint, column, run)
        bring(self, part, self.chosen, self.middle)
        part.report_clock_offset(self.report)

    def _exclude_late_joints(self, part: Part) -> None:
        """Fail and exclude joints that do not reach the middle of their sine."""
        late = late_joints(part, self.chosen, self.middle)
        found = late_evidence(part, late) if late else []
        for joint, text in late.items():
            complaint = Evidence.uncertain(joint, text, "does not move")
            self.judge_evidence(part, joint, complaint, found)
        left = [place for place, joint in enumerate(self.chosen) if joint not in late]
        self.chosen = [self.chosen[place] for place in left]
        self.middle = self.middle[left]
        self.sine = RampedSine(self.sine.amplitudes[left], self.sine.frequency, self.sine.cycles)
        if not self.chosen:
            self.assert_fail(f"no joint of {part.name} reached the start of its sine")

    def _enter(self, part: Part) -> None:
        """Put all joints into direct position mode, so that a command to the whole part holds those not chosen."""
        part.set_mode(ControlMode.POSITION_DIRECT)
        self.held = part.board.encoders()
        modes = part.board.control_modes()
        wrong = [
            f"{part.names[joint]} is in {modes[joint].word}"
            for joint in part.select(())  # prismatic joints are not moved
            if modes[joint] is not ControlMode.POSITION_DIRECT
        ]
        self.assert_fail_if_true(wrong, f"not in direct position mode: {', '.join(wrong)}; {likely_causes('mode')}")

    def _send(self, part: Part, form: int, positions: FloatArray) -> None:
        if form == 0:
            for joint, position in zip(self.chosen, positions, strict=True):
                part.board.set_positions(float(position), joint)
        elif form == 1:
            every = self.held.copy()
            every[self.chosen] = positions
            part.board.set_positions(every)
        else:
            part.board.set_positions(positions, self.chosen)

    def _probe(self, part: Part, form: int) -> FloatArray:
        """Send small steps; return the number of lost ones for each joint."""
        lost = np.zeros(len(self.chosen))
        for probe in range(_PROBES):
            wanted = self.middle + (_PROBE if probe % 2 else -_PROBE)
            self._send(part, form, wanted)
            part.wait_to_arrive(partial(self._have_arrived, part, wanted), _PROBE_TIME, pace=_PROBE_TIME)
            lost += self._missing(part, wanted)
        self._send(part, form, self.middle)
        part.wait(_PROBE_TIME, pace=_PROBE_TIME)
        return lost

    def _have_arrived(self, part: Part, wanted: FloatArray) -> bool:
        return not self._missing(part, wanted).any()

    def _missing(self, part: Part, wanted: FloatArray) -> NDArray[np.bool_]:
        """Return which joints have another reference at the board."""
        missing: NDArray[np.bool_] = np.abs(part.board.reference_positions(self.chosen) - wanted) > _PROBE / 4
        return missing

    def _follow(self, part: Part, form: int) -> _Run:
        sent_at, sent, looked_at, taken = [], [], [], []
        with part.recorded() as trace:
            begin = self.now()
            for elapsed in ticks(part, self.sample_time, self.sine.duration):
                positions = self.middle + self.sine.at(elapsed)
                self._send(part, form, positions)
                sent_at.append(elapsed)
                sent.append(positions)
                if len(sent) % _LOOKS == 0:
                    taken.append(part.board.reference_positions(self.chosen))
                    looked_at.append(self.now() - begin)
        return _Run(np.array(sent_at), np.array(sent), np.array(looked_at), np.array(taken), trace, begin)

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge_stimulus(self, form: str, run: _Run) -> None:
        """End with an error if the test itself did not send the sine."""
        first, last = self.sine.plateau
        whole = (run.sent_at >= first) & (run.sent_at <= last)
        for column, joint in enumerate(self.chosen):
            part, fit = self.robot_part, fit_sine(run.sent_at[whole], run.sent[whole, column], self.frequency)
            wanted = float(self.sine.amplitudes[column])
            self.assert_error_if_false(
                abs(fit.amplitude - wanted) <= _STIMULUS * wanted and fit.rms <= _STIMULUS * wanted,
                f"{form}: the commands to {part.names[joint]} are not a sine of {part.shown(joint, wanted, 'g')}: "
                f"their amplitude is {part.shown(joint, fit.amplitude, '.3g')}, the residual "
                f"{part.shown(joint, fit.rms, '.3g')}",
            )

    def _judge_lost(self, name: str, lost: float) -> None:
        hint = (
            f"{name} has lost {lost:.0f} of {_PROBES} commands, sent every {_PROBE_TIME:g} s; "
            f"{likely_causes('lost commands')}"
        )
        self.measure("commands lost", lost, "", high=0.0, hint=hint)

    def _judge(self, name: str, joint: int, column: int, run: _Run) -> None:
        """Judge the tracking error over the whole run, delay and shape at full amplitude."""
        time = run.trace.local_time - run.begin
        position, speed = run.trace.positions[:, joint], run.trace.velocities[:, joint]
        during = (time >= 0) & (time <= self.sine.duration)
        time, position, speed = time[during], position[during], speed[during]
        self.assert_true(
            time.size > _FEWEST_A_SWING * self.frequency * self.sine.duration,
            f"{name}: {time.size} states were published in {self.sine.duration:g} s, too few to judge",
        )
        reference = self.middle[column] + self.sine.at(time)[:, column]
        self.record("following", time=(time, "s"), reference=(reference, "deg"), position=(position, "deg"))
        error = position - reference
        first, last = self.sine.plateau
        whole = (time >= first) & (time <= last)
        grid = np.arange(time[whole][0], time[whole][-1], _GRID)
        delay = delay_between(
            np.interp(grid, time, reference), np.interp(grid, time, position), _GRID, 0.5 / self.frequency
        )
        fit = fit_sine(time[whole], position[whole], self.frequency)
        harmonics = min(_HARMONICS, max(1, int(_SLOW / self.frequency)))
        of_speed = fit_sine(time[whole], speed[whole], self.frequency, harmonics=harmonics)
        amplitude = float(self.sine.amplitudes[column])
        gain = fit.amplitude / amplitude
        ripple = 100 * of_speed.rms / (2 * math.pi * self.frequency * amplitude)
        values = (
            CheckedValue("tracking error", float(np.abs(error).max()), "deg", self.tolerance, "lag"),
            CheckedValue("delay", delay, "s", self.delay, "lag"),
            CheckedValue("shape error", fit.rms, "deg", self._most_shape(joint, time, reference, whole), "irregular"),
            CheckedValue("speed ripple", ripple, "%", self.ripple, "noise"),
            CheckedValue("tracking error, root mean square", float(np.sqrt(np.mean(error**2))), "deg", finding="lag"),
            self._gain(name, "amplitude", gain, "weak" if gain < 1 else "overshoot"),
            *(self._taken(name, column, run) if len(run.taken) else ()),
        )
        metres = in_metres(self.robot_part.board, joint)
        scaled = [value.scaled(*converted(metres, value.symbol)) for value in values]
        excuse = loop_delay(run.sent_at, self.sample_time)
        if not excuse and any(value.wrong for value in scaled):
            excuse = disturbance(self.robot_part, joint) or self._shaken(column, run)
        judge_values(self, name, scaled, excuse)

    def _shaken(self, column: int, run: _Run) -> str:
        """Return which other joint was the first one that did not move in a sine, and so shook this one; "" if none."""
        time, positions = run.trace.local_time - run.begin, run.trace.positions[:, self.chosen]
        during = (time >= 0) & (time <= self.sine.duration)
        commanded, time = self.sine.at(time[during]), time[during]
        first, last = self.sine.plateau
        whole, left, beyond = (time >= first) & (time <= last), [], []
        for joint, one, reference in zip(self.chosen, positions[during].T, commanded.T, strict=True):
            left.append(np.abs(_unlike(one, reference, time)))
            beyond.append(left[-1] > _SHAKEN * self._most_shape(joint, time, reference, whole))
        begins = [int(one.argmax()) if one.any() else len(time) for one in beyond]
        cause = min(range(len(begins)), key=begins.__getitem__)
        if begins[cause] >= begins[column]:
            return ""
        part, joint = self.robot_part, self.chosen[cause]
        away = part.shown(joint, float(left[cause].max()))
        return f"it was disturbed: before it {part.names[joint]} did not move in a sine, by up to {away}"

    def _most_shape(self, joint: int, time: FloatArray, reference: FloatArray, whole: NDArray[np.bool_]) -> float:
        """Return the greatest shape error: that of the parameter, and what friction adds to it, as variances add up."""
        try:
            pid = self.robot_part.board.pid(PidType.POSITION, joint)
        except NotSupportedError:
            return self.shape
        held = held_by_friction(time, reference, pid, self.friction)
        return math.hypot(self.shape, fit_sine(time[whole], held[whole], self.frequency).rms)

    def _gain(self, name: str, what: str, gain: float, finding: str) -> CheckedValue:
        low, high = 1 - _GAIN, 1 + _GAIN
        hint = f"{name}: {what} is {gain:.3g}, not {low:g} to {high:g}; {likely_causes(finding)}"
        return CheckedValue(what, gain, "", high, finding, low, hint)

    def _taken(self, name: str, column: int, run: _Run) -> tuple[CheckedValue, CheckedValue]:
        """Return the checks of the references that were read back: they have to be the sine, too."""
        first, last = self.sine.plateau
        whole = (run.looked_at >= first) & (run.looked_at <= last)
        amplitude = float(self.sine.amplitudes[column])
        fit = fit_sine(run.looked_at[whole], run.taken[whole, column], self.frequency)
        lost = "lost commands"
        hint = f"{name}: the references at the board are not the commands sent; {likely_causes(lost)}"
        return (
            self._gain(name, "amplitude of the references at the board", fit.amplitude / amplitude, lost),
            CheckedValue("shape error of the references at the board", fit.rms, "deg", self.shape, lost, hint=hint),
        )


#: A joint that deviates by so many times the greatest shape error shakes the others.
_SHAKEN = 2.0
#: Time grid on which signals are compared, s; least number of states in a period.
_GRID, _FEWEST_A_SWING = 0.002, 20
#: Tolerance of an amplitude ratio: a critically damped loop of 2 Hz follows a sine of 1 Hz with 0.8 of its amplitude; a
#: slower one is too slow for the streams of commands that the mode is for.
_GAIN = 0.2


def _unlike(positions: FloatArray, commanded: FloatArray, time: FloatArray) -> FloatArray:
    """Return what a joint did beside following its commands, with any lag and gain (deg)."""
    columns = np.column_stack([commanded, np.gradient(commanded, time), np.ones(len(commanded))])
    left: FloatArray = positions - columns @ np.linalg.lstsq(columns, positions, rcond=None)[0]
    return left
