"""Position control accuracy with an external controller: the test closes the loop itself, by duty cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.clock import SystemClock
from rtf.robot.control_modes import ControlMode
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import PidType
from rtf.robot_testing import Safety
from rtf.robot_testing.coupled_step_test import CoupledStepTest
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.simulated import is_simulated
from rtf.robot_testing.judging.checked_values import CheckedValue
from rtf.robot_testing.judging.real_time_checks import command_delay
from rtf.robot_testing.motion.pid import DiscretePid
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part, Trace
    from rtf.robot_testing.motion.routines import Routine
    from rtf.robot_testing.step_test import Cycle

#: Ratio of the bandwidth of the board's loop to that of the loop over the network, whose period is 10 ms. A slower loop
#: would be too weak for the friction of some joints.
_SLOWER = 4.0
#: The integral, as a share of the proportional gain (1/s).
_INTEGRAL = 3.0
#: Share of the setpoint in the derivative. With all of it a healthy joint overshoots by 30 %, and by 40 to 70 % if
#: states or commands come 10 ms late; with this share by 30 % at most in either case.
_KICK = 0.4
#: Least duty cycle that a step has to cause, so that it does more than overcome friction, %.
_STICTION = 3.0
#: Distance beyond the step at which the test aborts a joint, deg.
_RUNAWAY = 10.0
#: Quantile of the ages of states that is judged: a single delay does not make a loop unstable.
_JUDGED = 0.9
#: Greater gains cannot be in per cent of duty cycle: Kp (%/deg), Ki (%/(deg s)), Kd (% s/deg). With them the whole duty
#: cycle would be used 5 deg from the target, after a second at 1 deg, and at 20 deg/s.
_MOST_GAINS = (20.0, 100.0, 5.0)
#: Default limits of the duty cycle, of real parts and of simulated ones, %.
_MOST, _MOST_SIMULATED = 25.0, 100.0


class PositionControlAccuracyExternalPid(CoupledStepTest):
    """Steps each joint with a PID controller of the test's own, which drives the motor by duty cycle.

    The default gains are those of the board, for a slower loop; a real board has units of its own, so Kp has to be
    given there. The controller starts with the duty cycle that has held the joint (bumpless transfer). It uses the
    stamps of the states; the ages of the states and their order are judged, too. Joints that a board puts into PWM mode
    together with the tested one, as they share motors, are held by such controllers. If this machine is too busy to
    keep the period of the loop, values out of bounds are inconclusive.
    """

    aliases = (
        "positionControl-accuracy-ExternalPid",
        "PositionControlAccuracyExernalPid",
        "positionControlAccuracyExternalPid",
    )
    tags = ("motion", "control", "pwm")
    safety = Safety.EFFORT

    step = Parameter(float, "height of the step; on the robot 5 at most", unit="deg", default=4.0, low=0.1, high=20.0)
    cycles = Parameter(int, "steps of each joint", default=2, low=1)
    step_duration = Parameter(
        float, "when a cycle ends, counted from the beginning of the rest before the step", unit="s", default=3.0
    )
    kp = Parameter(
        list[float], "proportional gain, % of duty cycle a deg; none: from a simulated board's", default=[], key="Kp"
    )
    ki = Parameter(list[float], "integral gain, %/(deg s)", default=[], key="Ki")
    kd = Parameter(list[float], "derivative gain, % s/deg", default=[], key="Kd")
    max_value = Parameter(
        float, "greatest output; 0: 25 for a real part, 100 for a simulated one", unit="%", default=0.0, low=0.0,
        high=100.0, key="MaxValue",
    )  # fmt: skip
    pid_vup = Parameter(float, "stiction compensation for motion upwards", unit="%", default=1.5)
    pid_vdown = Parameter(float, "the same for motion downwards", unit="%", default=-1.5)
    delay = Parameter(float, "until a tenth is reached, at most", unit="s", default=0.2, low=0.001)
    # Friction may hold a joint just short of nine tenths until the integral has grown.
    rise_time = Parameter(float, "from a tenth to nine tenths, at most", unit="s", default=1.0, low=0.001)
    overshoot = Parameter(float, "beyond the target, at most", unit="%", default=40.0, low=0.0)
    band = Parameter(
        float, "settling band about the target; a quarter of the step at most", unit="deg", default=0.5, low=0.001
    )
    settling_time = Parameter(float, "until it stays in the band, at most", unit="s", default=2.4, low=0.001)
    steady_error = Parameter(
        float, "at the end, at most; no more than a quarter of the step", unit="deg", default=0.5, low=0.0
    )
    ripple = Parameter(float, "deviation at the end, at most", unit="deg", default=0.15, low=0.0)
    repeatability = Parameter(
        float, "deviation of the steps from each other, at most", unit="deg", default=0.8, low=0.0
    )
    state_age = Parameter(
        float, "greatest age of nine of ten states that the controller uses, if robot and test share a clock",
        unit="ms", default=35.0, low=0.0, key="stateAge",
    )  # fmt: skip
    overtaken = Parameter(
        float, "greatest share of states that arrive after later ones", unit="%", default=1.0, low=0.0
    )

    def setup(self) -> None:
        """Open the part, and create a controller for each joint."""
        super().setup()
        part, gears = self.robot_part, self.transmission
        # The effect of the motor's duty cycle on its joint: its sign, and the coupling.
        diagonal = np.diagonal(gears.coupling)
        self.effects = effects = np.sign(gears.gearbox) * np.where(diagonal, diagonal, 1.0)
        gains = np.array([self._gains(part, joint, float(effects[joint])) for joint in self.chosen])
        for place, (name, given) in enumerate((("Kp", self.kp), ("Ki", self.ki), ("Kd", self.kd))):
            if given:
                gains[:, place] = self.per_joint(name, given, self.chosen)
        for joint, one in zip(self.chosen, gains, strict=True):
            self._require_plausible(part.names[joint], one)
        self.ways = np.sign(effects)
        self.pids = {joint: self._controller(one) for joint, one in zip(self.chosen, gains, strict=True)}
        #: By joint: the controllers that hold the joints coupled with it, with equal stiffness.
        self.holders = {
            joint: {
                other: self._controller(one * effects[joint] / effects[other])
                for other in gears.coupled(joint)
                if other != joint
            }
            for joint, one in zip(self.chosen, gains, strict=True)
        }
        self.homes = {joint: start for joint, (start, _) in self.starts.items()}
        #: By joint: the commands of its cycle, as pairs of time (s) and duty cycle (%).
        self.sent: dict[int, list[tuple[float, float]]] = {joint: [] for joint in self.chosen}

    def _controller(self, gains: FloatArray) -> DiscretePid:
        return DiscretePid(*map(float, gains), limit=self.most, kick=_KICK)

    def _require_plausible(self, name: str, gains: FloatArray) -> None:
        wrong = [
            f"{key} {value:g}, more than {most:g}"
            for key, value, most in zip(("Kp", "Ki", "Kd"), gains, _MOST_GAINS, strict=True)
            if not abs(value) <= most
        ]
        self.assert_error_if_true(
            wrong,
            f"{name}: {'; '.join(wrong)}: gains have to be in per cent of duty cycle and deg; give Kp, Ki and Kd",
        )

    def _gains(self, part: Part, joint: int, effect: float) -> tuple[float, float, float]:
        """Return the default gains: the board's for a slower loop; of a real board only Ki, in proportion to Kp."""
        if not self._knows_units:
            kp = self.per_joint("Kp", self.kp, self.chosen)[self.chosen.index(joint)]
            return kp, _INTEGRAL * kp, 0.0
        pid = part.board.pid(PidType.POSITION, joint)
        kp = pid.kp / _SLOWER**2 / effect
        return kp, _INTEGRAL * kp, pid.kd / _SLOWER / effect

    def choose(self, part: Part) -> list[int]:
        """Return the chosen joints; by default those whose gains are high enough for a step to overcome friction."""
        chosen = super().choose(part)
        self._knows_units = is_simulated(self.network, self.robot_name, self.part)
        self.most = self.max_value or (_MOST_SIMULATED if self._knows_units else _MOST)
        if not self.kp and not self._knows_units:
            self.skip(
                f"{part.name} is not simulated, and the units of its board's gains are unknown; give Kp, in % of duty "
                "cycle a deg"
            )
        if self.joints or self.kp:
            return chosen
        gains = {joint: part.board.pid(PidType.POSITION, joint).kp / _SLOWER**2 for joint in chosen}
        strong = [joint for joint in chosen if abs(gains[joint]) * self.step >= _STICTION]
        if not strong:
            self.skip(f"the gains of {part.name} are too small for a step of {self.step:g} deg; give Kp")
        if len(strong) < len(chosen):
            left = ", ".join(
                f"{part.names[joint]} by {part.shown(joint, self.step, 'g')}" for joint in chosen if joint not in strong
            )
            self.report(f"not stepped: {left}; such a step gives less than {_STICTION:g} %: give Kp")
        return strong

    def room(self, joint: int) -> float:
        return min(self.step, 0.5 * float(self.robot_part.high[joint] - self.robot_part.low[joint]))

    def begin(self, joint: int) -> Routine[tuple[float, float]]:
        part, (home, sign) = self.robot_part, self.starts[joint]
        duties = part.board.duty_cycles()
        held = self.transmission.holding_duty(duties, joint)
        least = min(abs(held), abs(float(duties[joint])))
        self.assert_error_if_false(
            least <= self.most,
            f"{part.names[joint]} is held by {least:.1f} % of duty cycle, MaxValue allows {self.most:g} %",
        )
        self.sent[joint] = []
        entered = yield from self.entering(joint, ControlMode.PWM, held, duties)
        self.pids[joint].start(held)
        for other, holder in self.holders[joint].items():
            holder.start(self.transmission.holding_duty(duties, other))
        self.assert_true(
            entered,
            f"{part.names[joint]} does not enter PWM mode: it stays in {part.board.control_modes(joint)[0].word}",
        )
        return home, home + sign * self.room(joint)

    def drive(self, joint: int, command: float) -> None:
        """Send the output of the controller; abort a joint that moves far beyond its step."""
        part = self.robot_part
        stamp, state = part.history.newest
        position = float(state.values(Field.JOINT_POSITIONS)[joint])
        if abs(position - self.homes[joint]) > self.step + _RUNAWAY:
            raise GuardError(
                f"{part.names[joint]} is at {part.shown(joint, position, '.1f')}, more than "
                f"{part.shown(joint, _RUNAWAY, 'g')} beyond a step of {part.shown(joint, self.step, 'g')} from "
                f"{part.shown(joint, self.homes[joint], '.1f')}",
                joint,
            )
        duty = self.pids[joint].output(command, position, stamp)
        duty += (self.pid_vup if command > position else self.pid_vdown) * float(self.ways[joint])
        duty, *others = self._shared(joint, duty, stamp, state.values(Field.JOINT_POSITIONS))
        self.sent[joint].append((self.now(), duty))
        self.give(joint, duty, others)

    def _shared(self, joint: int, duty: float, stamp: float, positions: FloatArray) -> list[float]:
        """Return the duty cycles of a motor and of the coupled ones that have the wanted effect on each joint."""
        along = self.along[joint]
        stood, holders, group = self.stood[joint], self.holders[joint], [joint, *along]
        wanted = [duty, *(holders[one].output(stood[one], positions[one], stamp) for one in along)]
        if along:
            gears = self.transmission
            effects = (np.sign(gears.gearbox)[:, None] * gears.coupling)[np.ix_(group, group)]
            wanted = np.linalg.lstsq(effects.T, self.effects[group] * wanted)[0].tolist()
        return [max(-self.most, min(self.most, one)) for one in wanted]

    def command(self, joints: list[int], efforts: list[float]) -> None:
        if len(joints) > 1:
            self.robot_part.board.set_reference_duty_cycles(efforts, joints)
        else:
            self.robot_part.board.set_reference_duty_cycles(efforts[0], joints[0])

    def late_commands(self, joint: int, trace: Trace) -> str:
        """See StepTest: by the duty cycles in the states, if these have the clock of the test."""
        if isinstance(self.clock, SystemClock):
            return ""
        return command_delay(self.sent[joint], trace.local_time, trace.duty_cycles[:, joint], self.sample_time)

    def measured(self, trace: Trace, joint: int) -> FloatArray:
        return trace.positions[:, joint]

    def values(self, joint: int, cycles: list[Cycle]) -> list[CheckedValue]:
        """See StepTest: add the order and the ages of the states that the controller used."""
        values = super().values(joint, cycles)
        states = sum(one.time.size for one in cycles)
        behind = 100.0 * sum(one.overtaken for one in cycles) / states
        values.append(CheckedValue("states that came behind later ones", behind, "%", self.overtaken, "jitter"))
        # The stamps of a real robot are by another clock, whose offset looks like age.
        if not isinstance(self.clock, SystemClock):
            age = 1e3 * float(np.quantile(np.concatenate([one.ages for one in cycles]), _JUDGED))
            values.append(CheckedValue("age of nine of ten states", age, "ms", self.state_age, "lag"))
        return values
