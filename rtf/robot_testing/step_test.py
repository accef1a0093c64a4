"""Base class of step response tests: home, rest, step, hold, several cycles for each joint; then judge.

A subclass of :class:`StepTest` chooses what is stepped, in which mode and by which command. Responses are timed by the
stamps of the states. A cycle with which the loop of the test did not keep up is evaluated, too, but does not fail the
robot: the other cycles count, and without any the joint ends as inconclusive.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from rtf.errors import RtfError
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.simulated import is_simulated
from rtf.robot_testing.judging.checked_values import CheckedValue, judge_values
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.judging.real_time_checks import loop_delay, state_delay
from rtf.robot_testing.judging.step_response import (
    EXPLAINED,
    FEWEST,
    largest,
    noise_before,
    spread_of,
    step_response,
    with_noise,
)
from rtf.robot_testing.judging.swaying import moved_farthest
from rtf.robot_testing.motion.disturbance import disturbance
from rtf.robot_testing.motion.routines import pause, run_queues
from rtf.robot_testing.motion.start_position import bringing, holding, starting_point
from rtf.robot_testing.robot_test import RobotTest
from rtf.robot_testing.slides import converted, in_metres
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.routines import Routine
    from rtf.robot_testing.motion.trace import Trace

#: Longest period of a board's states, s: the time grid on which repetitions are compared.
_GRID = 0.01
#: The greatest bands, as a share of the step; larger parameters are reduced.
_NEAREST = 0.25


class Cycle(NamedTuple):
    """One step: times of the states (s, the step is at 0), with the measured and the commanded values.

    The states are in the order of their times; ``overtaken`` of them arrived after a later one. ``ages`` (s) are those
    of the newest state at each command. ``late`` is the delay that this machine caused, as text, and ``shaken`` which
    joint, that was only held, moved farther than the stepped one after its step; "" if none.
    """

    time: FloatArray
    measured: FloatArray
    commanded: FloatArray
    start: float
    target: float
    overtaken: int
    ages: FloatArray
    late: str
    shaken: str = ""


class StepTest(RobotTest):
    """Steps of single joints, one at a time in each queue; ``symbol`` is the unit of the stepped quantity.

    All bounds are parameters, so that each board and robot can be judged by its own limits.
    """

    symbol: ClassVar[str] = "deg"
    highest: ClassVar[float] = 5.0  # in that unit; a higher step is dangerous on a real robot
    shortest: ClassVar[float] = 0.3  # s after the step that are needed to judge it
    rest: ClassVar[float] = 0.5  # s at home before a cycle
    late_finding: ClassVar[str] = "lag"  # the findings that a late and a wrong response point to
    wrong_finding: ClassVar[str] = "weak"
    both_signs: ClassVar[bool] = False  # whether every other step goes the other way

    part = Parameter(str, "the part whose joints are stepped", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all that can be", default=[])
    step = Parameter(float, "height of the step; on the robot 5 at most", unit="deg", default=2.0, low=0.1, high=20.0)
    zeros = Parameter(list[float], "where they start from; none: where they are", unit="deg", default=[])
    cycles = Parameter(int, "steps of each joint", default=3, low=1)
    sample_time = Parameter(
        float, "time between two commands", unit="s", default=0.01, low=0.001, high=0.1, key="sampleTime"
    )
    home_tolerance = Parameter(float, "how near is home", unit="deg", default=0.5, low=0.001)
    lead = Parameter(float, "time at rest before the step", unit="s", default=0.5, low=0.1)
    step_duration = Parameter(
        float, "when a cycle ends, counted from the beginning of the rest before the step", unit="s", default=2.5
    )
    filename = Parameter(str, "name of the recording; auto: of joint and cycle", default="auto")
    # There are no published limits. These are chosen: a loop of 1 Hz rises in 0.35 s and is settled after three times
    # its time constant, in 0.5 s; an overshoot of 20 % is a damping ratio of 0.45, the least that is usual; the errors
    # are an eighth of the usual step.
    delay = Parameter(float, "until a tenth is reached, at most", unit="s", default=0.1, low=0.001)
    rise_time = Parameter(float, "from a tenth to nine tenths, at most", unit="s", default=0.5, low=0.001)
    overshoot = Parameter(float, "beyond the target, at most", unit="%", default=20.0, low=0.0)
    band = Parameter(
        float, "settling band about the target; a quarter of the step at most", unit="deg", default=0.25, low=0.001
    )
    settling_time = Parameter(float, "until it stays in the band, at most", unit="s", default=1.0, low=0.001)
    steady_error = Parameter(
        float, "at the end, at most; no more than a quarter of the step", unit="deg", default=0.25, low=0.0
    )
    ripple = Parameter(float, "deviation at the end, at most", unit="deg", default=0.05, low=0.0)
    repeatability = Parameter(
        float, "deviation of the steps from each other, at most", unit="deg", default=0.2, low=0.0
    )

    def setup(self) -> None:
        """Open the part, and choose the start positions of its joints."""
        super().setup()
        self.assert_error_if_false(
            self.step_duration > self.lead + self.shortest,
            f"step_duration is {self.step_duration:g} s: it has to exceed lead, which is {self.lead:g} s, by more than "
            f"{self.shortest:g} s",
        )
        self.robot_part = part = self.open_part(self.part)
        self._refuse_high_steps()
        self.chosen = self.choose(part)
        zeros: list[float | None] = [*self.per_joint("zeros", self.zeros, self.chosen)] if self.zeros else []
        self.starts = {
            joint: starting_point(part, joint, zero, self.room(joint), both_sides=self.both_signs)
            for joint, zero in zip(self.chosen, zeros or [None] * len(self.chosen), strict=True)
        }
        self._done = 0
        self._ends: dict[int, float] = {}  # when the routines of joints ended, s; inf: not yet

    def _refuse_high_steps(self) -> None:
        self.assert_error_if_true(
            self.step > self.highest and not is_simulated(self.network, self.robot_name, self.part),
            f"step is {self.step:g} {self.symbol} ({self.parameter_source('step')}): this is dangerous for a real "
            f"part; give {self.highest:g} {self.symbol} or less",
        )

    # What a test says ------------------------------------------------------------------------------------------------

    def choose(self, part: Part) -> list[int]:
        """Return the joints that are stepped."""
        return self.select(part, self.joints)

    def room(self, joint: int) -> float:
        """Return the free way that a step of the joint needs (deg)."""
        raise NotImplementedError

    def begin(self, joint: int) -> Routine[tuple[float, float]]:
        """Bring a joint that is at home into the mode; return start and target of the step."""
        raise NotImplementedError

    def drive(self, joint: int, command: float) -> None:
        """Command a joint; called at every tick. A GuardError ends the cycle as a failure."""
        raise NotImplementedError

    def begins(self, joint: int, elapsed: float) -> bool:
        """Return whether the step begins now, ``elapsed`` seconds after the joint entered its mode."""
        del joint
        return elapsed >= self.lead - _ROUNDING

    def enough(self, joint: int, after: float) -> bool:
        """Return whether to end the cycle now, ``after`` seconds after the step (NaN before it).

        It is no failure if the step has lasted long enough to be judged.
        """
        del joint, after
        return False

    def measured(self, trace: Trace, joint: int) -> FloatArray:
        """Return the stepped quantity of all states."""
        raise NotImplementedError

    def disturbed(self, joint: int) -> str:
        """Return what disturbs a joint whose values are out of bounds; "" if nothing does."""
        return disturbance(self.robot_part, joint)

    def late_commands(self, joint: int, trace: Trace) -> str:
        """Return by how much commands of this cycle reached the board late, if the states show it; else ""."""
        del joint, trace
        return ""

    # Running -----------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Test joint by joint."""
        run_queues(
            self.robot_part,
            self.robot_part.one_at_a_time(self.chosen),
            self._routine,
            pace=self.sample_time,
        )
        self.robot_part.report_clock_offset(self.report)

    def _routine(self, joint: int) -> Routine[None]:
        part, problem = self.robot_part, None
        cycles: list[Cycle] = []
        if self.judge_if_lost(part, joint):
            return
        self._ends[joint] = math.inf
        try:
            while len(cycles) < self.cycles:
                cycles.append((yield from self._cycle(joint)))
                if self.both_signs:
                    home, sign = self.starts[joint]
                    self.starts[joint] = home, -sign
        except RtfError as error:
            problem = error
        try:
            yield from holding(part, [joint])
            if problem is None:
                yield from self._bring(joint)
        except RtfError as error:
            problem = problem or error
        self._done += 1
        self._ends[joint] = self.now()
        self.progress(self._done / len(self.chosen), part.names[joint])
        with self.subresult(part.names[joint]):
            self._record(joint, cycles)
            if len(cycles) == self.cycles:
                self.judge(joint, cycles)
            if problem is not None and not isinstance(problem, GuardError):
                raise problem
        if isinstance(problem, GuardError):
            self.judge_stop(part, joint, problem, "runs away")

    def _bring(self, joint: int) -> Routine[None]:
        home, _ = self.starts[joint]
        return bringing(self, self.robot_part, [joint], [home], tolerance=self.home_tolerance)

    def _cycle(self, joint: int) -> Routine[Cycle]:
        part = self.robot_part
        yield from self._bring(joint)
        yield from pause(part.clock, self.rest)
        times: list[float] = []
        ages: list[float] = []
        try:
            with part.recorded() as trace:
                start, target = yield from self.begin(joint)
                mode = part.board.control_modes(joint)[0]
                commands, stepped = yield from self._step(joint, start, target, times, ages)
        except GuardError as error:
            late = self._late(joint, [*times, self.now()], [*ages, part.state_age()], trace)
            if late:
                self.inconclusive(f"{error}; but {late}")
            error.time = min(error.time, self.now())
            raise
        now = part.board.control_modes(joint)[0]
        if now is not mode and (cause := self.explained(part, joint)):  # the other one was released, and it as well
            self.inconclusive(f"{part.names[joint]} left {mode.word} for {now.word}: {cause}")
        self.assert_true(now is mode, f"{part.names[joint]} left {mode.word} for {now.word} in the middle of a step")
        late = self._late(joint, times, ages, trace)
        stamps = trace.local_time
        came = stamps[stamps >= times[0]]
        self._judge_number_of_states(joint, came - stepped, late)
        order = np.argsort(stamps, kind="stable")
        order = order[stamps[order] >= times[0]]
        stamps = stamps[order]
        taken = np.searchsorted(times, stamps, side="right") - 1
        return Cycle(
            time=stamps - stepped,
            measured=self.measured(trace, joint)[order],
            commanded=np.array(commands)[taken],
            start=start,
            target=target,
            overtaken=int((came < np.maximum.accumulate(came)).sum()),
            ages=np.array(ages),
            late=late,
            shaken=self._shaken(joint, trace, stepped),
        )

    def _shaken(self, joint: int, trace: Trace, stepped: float) -> str:
        """Return which joint that was only held moved in the second half of the time after a step; "" if none."""
        part, time = self.robot_part, trace.local_time
        later = time > (stepped + time.max()) / 2.0
        held = [one for one in range(part.axes) if self._ends.get(one, -math.inf) < stepped]
        found = moved_farthest(time[later], trace.positions[later], joint, held) if later.any() else None
        if found is None:
            return ""
        return f"it was disturbed: {part.names[found[0]]}, which was only held, moved by {part.shown(*found)}"

    def _judge_number_of_states(self, joint: int, came: FloatArray, late: str) -> None:
        """Check that there are enough states to judge a step; ``came`` are their times, relative to it."""
        behind, last = int((came >= 0).sum()), float(came.max(initial=-math.inf))
        if came.size > _FEWEST_STATES and behind >= FEWEST and last > self.shortest:
            return
        part = self.robot_part
        span = float(np.ptp(came)) if came.size > 1 else 0.0
        rate = (came.size - 1) / span if span > 0 else 0.0
        until = f", up to {last:.2f} s after it" if behind else ""
        text = (
            f"/{self.robot_name}/{part.name}/stateExt:o: {came.size} states came, {rate:.0f} a second, {behind} of "
            f"them after the step of {part.names[joint]}{until}; {FEWEST} are needed, over {self.shortest:g} s"
        )
        if late:
            self.inconclusive(f"{text}; but {late}")
        # Without states the controller cannot be judged.
        self.assert_error(f"{text}; {likely_causes('slow')}")

    def _late(self, joint: int, times: list[float], ages: list[float], trace: Trace) -> str:
        """Return the delay of a cycle that this machine caused; "" if there was none, as always in lockstep."""
        if isinstance(self.clock, LockstepClock):
            return ""
        period = self.sample_time
        return loop_delay(times, period) or state_delay(ages, period) or self.late_commands(joint, trace)

    def _step(
        self, joint: int, start: float, target: float, times: list[float], ages: list[float]
    ) -> Routine[tuple[list[float], float]]:
        """Command the step. Return the commands and the time of the step.

        The times of the commands are appended to ``times``, the ages of the newest states then to ``ages``.
        """
        commands: list[float] = []
        stepped, begin = math.nan, self.now()
        while (elapsed := self.now() - begin) < self.step_duration - _ROUNDING:
            if math.isnan(stepped) and self.begins(joint, elapsed):
                stepped = self.now()
            times.append(self.now())
            ages.append(self.robot_part.state_age())
            commands.append(start if math.isnan(stepped) else target)
            self.drive(joint, commands[-1])
            if self.enough(joint, after := self.now() - stepped):
                self._judge_early_end(joint, after)
                break
            yield None
        return commands, stepped

    def _judge_early_end(self, joint: int, after: float) -> None:
        """Fail a joint that has moved too far before its step could be judged."""
        here = self.robot_part.shown(joint, self.robot_part.board.encoder(joint), ".1f")
        self.assert_true(
            after >= self.shortest,
            f"{self.robot_part.names[joint]} moved too far "
            f"{'before the step' if math.isnan(after) else f'{after:.2f} s after the step'}: it is at "
            f"{here}; {likely_causes('torque answer')}",
        )

    def _record(self, joint: int, cycles: list[Cycle]) -> None:
        name = self.robot_part.names[joint] if self.filename == "auto" else self.filename
        for number, cycle in enumerate(cycles, 1):
            columns = {
                "time": (cycle.time, "s"),
                "measured": (cycle.measured, self.symbol),
                "commanded": (cycle.commanded, self.symbol),
            }
            self.record(f"{name} step {number}", **columns)

    # Judging -----------------------------------------------------------------------------------------------------

    def judge(self, joint: int, cycles: list[Cycle]) -> None:
        """Measure all values that have limits; the worst of the cycles counts."""
        name = self.robot_part.names[joint]
        self._require_numbers(name, cycles)
        values, late = self.values(joint, cycles), [one.late for one in cycles if one.late]
        punctual = [one for one in cycles if not one.late]
        if late and punctual and any(value.wrong for value in values):
            self.report(f"{name}: {late[0]}: {len(late)} of {len(cycles)} steps are not judged")
            values, late = self.values(joint, punctual), []
        metres = in_metres(self.robot_part.board, joint)
        values = [value.scaled(*converted(metres, value.symbol)) for value in values]
        excuse = late[0] if late else self.explained(self.robot_part, joint)
        if not excuse and any(value.wrong for value in values):
            excuse = self.disturbed(joint) or next((one.shaken for one in cycles if one.shaken), "")
        judge_values(self, name, values, excuse)
        self._require_visible_step(name, cycles)

    def _require_numbers(self, name: str, cycles: list[Cycle]) -> None:
        measured = np.concatenate([one.measured for one in cycles])
        if missing := int((~np.isfinite(measured)).sum()):
            self.inconclusive(f"{name}: {missing} of {measured.size} measured values are not finite")

    def _require_visible_step(self, name: str, cycles: list[Cycle]) -> None:
        """End as inconclusive if noise hides the step, unless a value was out of bounds all the same."""
        noise, height = _noise(cycles), _lowest(cycles)
        if EXPLAINED * noise > height:
            self.inconclusive(
                f"{name}: a step of {self.as_text(height, self.symbol, '.3g')} is not visible in a noise of "
                f"{self.as_text(noise, self.symbol, '.2g')}; {likely_causes('noise')}"
            )

    def values(self, joint: int, cycles: list[Cycle]) -> list[CheckedValue]:
        """Return the values of some cycles of a joint, with their limits."""
        sensor = self.sensor_noise(joint)
        near, noise = _NEAREST * _lowest(cycles), max(_noise(cycles), sensor)  # few points show less than there is
        band, off = min(self.band, near), min(self.most_error(joint), near) + noise
        answers = [step_response(one.time, one.measured, one.start, one.target, band, noise) for one in cycles]
        late, wrong, symbol = self.late_finding, self.wrong_finding, self.symbol
        errors = [abs(one.steady_error) for one in answers]
        ripple = with_noise(self.ripple, sensor, min(one.steady_points for one in answers))
        values = [
            CheckedValue("delay", largest([one.delay for one in answers]), "s", self.delay, late),
            CheckedValue("rise time", largest([one.rise_time for one in answers]), "s", self.most_rise(joint), wrong),
            CheckedValue("overshoot", largest([one.overshoot for one in answers]), "%", self.overshoot, "overshoot"),
            CheckedValue(
                "settling time", largest([one.settling_time for one in answers]), "s", self.most_settling(joint), wrong
            ),
            CheckedValue("steady error", largest(errors), symbol, off, wrong),
            CheckedValue("ripple", largest([one.ripple for one in answers]), symbol, ripple, "noise"),
        ]
        if spreads := _spreads(cycles):
            most = with_noise(self.most_spread(joint, cycles), sensor, min(len(one.time) for one in cycles))
            values.append(CheckedValue("repeatability", largest(spreads), symbol, most, "irregular"))
        widths = [one.bandwidth for one in answers]
        if all(map(math.isfinite, widths)):
            values.append(CheckedValue("bandwidth", min(widths), "Hz"))
        return values

    def sensor_noise(self, joint: int) -> float:
        """Return the noise (standard deviation) that the robot's description gives to what is measured; 0 for none."""
        del joint
        return 0.0

    def most_rise(self, joint: int) -> float:
        """Return the greatest rise time of a joint (s)."""
        del joint
        return self.rise_time

    def most_settling(self, joint: int) -> float:
        """Return the greatest settling time of a joint (s)."""
        del joint
        return self.settling_time

    def most_error(self, joint: int) -> float:
        """Return the greatest steady error of a joint, without noise."""
        del joint
        return self.steady_error

    def most_spread(self, joint: int, cycles: list[Cycle]) -> float:
        """Return the greatest deviation of a joint's steps from each other, without noise."""
        del joint, cycles
        return self.repeatability


def alike(cycles: list[Cycle]) -> list[list[Cycle]]:
    """Return the steps of each direction that has several.

    What both directions have in common, such as an offset, makes them different, and is judged by other values.
    """
    groups = ([one for one in cycles if (one.target - one.start) * sign > 0] for sign in (1.0, -1.0))
    return [group for group in groups if len(group) > 1]


def _spreads(cycles: list[Cycle]) -> list[float]:
    """Return how much the steps of each direction deviate from each other, where there are several."""
    return [
        spread_of([one.time for one in group], [one.measured - one.start for one in group], _GRID)
        for group in alike(cycles)
    ]


def _lowest(cycles: list[Cycle]) -> float:
    """Return the height of the lowest step."""
    return min(abs(one.target - one.start) for one in cycles)


def _noise(cycles: list[Cycle]) -> float:
    """Return the root mean square noise before the steps, of those with enough points before; 0 if none has."""
    known = [found for one in cycles if not math.isnan(found := noise_before(one.time, one.measured))]
    return math.sqrt(np.mean(np.square(known))) if known else 0.0


#: Least number of states of a cycle.
_FEWEST_STATES = 20
_ROUNDING = 1e-4  # s
