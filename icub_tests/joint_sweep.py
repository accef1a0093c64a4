"""Sweep of each joint over its range, slowly and fast: its encoders, its friction in every place, its motor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode, mode_word
from rtf.robot.extended_state import Field
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.judging.encoder_errors import Spikes, errors_of, spikes_of
from rtf.robot_testing.judging.friction_profile import friction_profile
from rtf.robot_testing.judging.motor_model import TOLERANCE, UNEVEN, MotorRun, interruption, motor_model
from rtf.robot_testing.judging.statistics import jitter
from rtf.robot_testing.judging.step_response import with_noise
from rtf.robot_testing.motion.disturbance import limpness
from rtf.robot_testing.motion.joint_queues import one_motor_at_a_time
from rtf.robot_testing.motion.joint_swings import JointSwinger, Outcome, ends_of
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_queues
from rtf.robot_testing.motion.trace import wrong_stamps
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace
    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.judging.encoder_errors import Mask
    from rtf.robot_testing.judging.friction_profile import FrictionProfile
    from rtf.robot_testing.judging.motor_model import MotorModel
    from rtf.robot_testing.motion.routines import Routine

#: The least range of a sweep that is judged, deg.
_LEAST = 5.0
#: The least speed of a move, deg/s.
_SLOWEST = 5.0
#: The fewest states of a sweep that are judged.
_FEWEST = 50
#: The least current of a motor whose winding is not known, in per cent: it has the sign of its duty cycle.
_SIGN = 1.0
#: The share of the states that are slower than the greatest speed, which noise exceeds now and then.
_FASTEST = 0.98
#: A current of less than this share of what the duty cycle drives does not follow it.
_FOLLOWS = 0.1
#: The duty cycle of a joint that is shaken by its controller, while it is only held, jumps by so much from state to
#: state (%), and by so many times that of the joint that moves. Of a healthy one it jumps by 1 % at most.
_SHAKES, _MORE = 10.0, 3.0


class _Sweep(NamedTuple):
    """A joint's sweep: its outcome, and when each of its moves began and ended (s of the robot's clock)."""

    outcome: Outcome
    moves: tuple[tuple[float, float], ...]


class JointSweep(JointsTest):
    """Moves each joint over its range, slowly and fast; compares its encoders, its friction in all places, its current.

    Every place is passed in both directions, at two speeds. What the motors' encoders show of a joint, through the
    inverse of gearboxes and couplings, is compared with its own encoder in every state: spikes, delays, and an error
    that grows over the range, as that of an eccentric magnet, of lost counts, or of a drift. Joints that cannot collide
    and share no motor sweep at the same time.

    The duty cycle is compared with that of a pendulum with friction: more in one place in both directions is a sticky
    place, more in a single move a joint that was blocked for a moment. What the current of an own motor adds with the
    speed is viscous friction.

    The current of the joint's motor is compared with that of a winding at the same duty cycle and speed: its sensor may
    show nothing, noise, the wrong sign, scale or zero, the amplifier may be weak in one direction, the magnets may be.
    Without resistance and torque constant in robot.toml, a real motor has to have a current of the right sign only.

    In all states of its sweep a joint has to be in position mode: a board that shows another one for a moment lets
    clients believe that they have lost the joint.
    """

    aliases = ("jointSweep", "joint-sweep")
    tags = ("motion", "encoders")
    safety = Safety.MOTION

    speed = Parameter(list[float], "speed of the slow moves", unit="deg/s", default=[40.0], low=0.1)
    fast = Parameter(list[float], "speed of the fast moves, at most what the joint can do", unit="deg/s",
                     default=[100.0], low=0.1)  # fmt: skip
    tolerance = Parameter(float, "tolerance of the ends of a sweep", unit="deg", default=1.0, low=0.001)
    # Five steps of an absolute encoder of 12 bits.
    spike = Parameter(float, "greatest jump of a single reading", unit="deg", default=0.5, low=0.001)
    delay = Parameter(float, "greatest delay between joint and motor encoder", unit="ms", default=5.0, low=0.1)
    # What tendons and gears yield by under the load of a limb is less.
    error = Parameter(float, "greatest change of the disagreement over the range", unit="deg", default=0.5, low=0.001)

    # Half of what MotorStiction allows over the whole range.
    friction = Parameter(float, "greatest additional duty cycle in one place", unit="%", default=5.0, low=0.01)
    viscous = Parameter(
        float, "greatest torque of viscous friction at the greatest speed, of that by the peak current", unit="%",
        default=10.0, low=0.01,
    )  # fmt: skip
    current = Parameter(
        float, "greatest deviation of the current, and of the torque constant, from those of the motor in robot.toml",
        unit="%", default=100.0 * TOLERANCE, low=0.1,
    )  # fmt: skip
    zero = Parameter(float, "greatest offset of the current, of the peak current", unit="%", default=3.0, low=0.01)
    # Six times what a current sensor has that robot.toml says nothing of.
    noise = Parameter(
        float, "greatest noise of the current, of the peak current, beyond what the duty cycle explains", unit="%",
        default=3.0, low=0.01,
    )  # fmt: skip
    uneven = Parameter(
        float, "greatest difference of the currents of both directions at equal duty cycles", unit="%",
        default=100.0 * UNEVEN, low=0.1,
    )  # fmt: skip

    def setup(self) -> None:
        """Read the transmission of the part, choose the ends of the sweeps, and hold the joints."""
        super().setup()
        part = self.robot_part
        self.transmission = self.read_transmission()
        self.transmission.warn_if_unknown(self, part.name)
        self.slow_speeds = self.by_joint("speed", self.speed)
        self.fast_speeds = self.by_joint("fast", self.fast)
        self.ends = {joint: ends_of(part, joint, np.inf) for joint in self.chosen}
        self.motors = part.motors
        self.swinger = JointSwinger(part, self.transmission, tolerance=self.tolerance)
        self.swinger.begin(self.hold)

    def run(self) -> None:
        """Sweep all queues in parallel, then judge joint by joint."""
        part = self.robot_part
        self._sweeps: dict[int, _Sweep] = {}
        with part.recorded() as trace:
            queues = one_motor_at_a_time(part.queues(self.chosen), self.transmission.sharing)
            run_queues(part, queues, self._routine, pace=PACE)
        self.assert_error_if_false(len(trace), f"{part.name}: the board publishes no states")
        self._states = _States.of(trace, self.transmission)
        self._shows_modes = trace.newest[1].valid[Field.CONTROL_MODES]
        for joint in self.chosen:
            with self.subresult(part.names[joint]):
                self._judge(joint, self._sweeps[joint])
        self.fail_others(self.swinger.evidence, self.chosen)

    def _routine(self, joint: int) -> Routine[None]:
        """Move a joint to its lower end and to its upper one slowly, back to the lower one and home fast."""
        low, high = self.ends[joint]
        slow, (fast,) = float(self.slow_speeds[joint]), self.robot_part.paced(self.fast_speeds[[joint]], [joint])
        here = home = float(self.robot_part.home[joint])
        moves: list[tuple[float, float]] = []
        outcome = Outcome()
        for target, speed in ((low, slow), (high, slow), (low, fast), (home, fast)):
            begin = self.now()
            # The acceleration of a move goes with the square of its speed, divided by its way: none is greater than
            # that of the fast move over the whole range, as a controller that gives all it has shows no friction.
            gentle = float(fast) * math.sqrt(abs(target - here) / (high - low))
            here = target
            outcome = yield from self.swinger.visiting(joint, [(target, min(float(speed), max(gentle, _SLOWEST)))])
            moves.append((begin, self.now()))
            if outcome.complaint:
                break
        self._sweeps[joint] = _Sweep(outcome, tuple(moves))
        self.progress(0.9 * len(self._sweeps) / len(self.chosen), self.robot_part.names[joint])

    def _broken(self, joint: int) -> str:
        """Return what the sensors of a joint say against it; "" if nothing. It disturbs those that share its motors."""
        name, own = self.robot_part.names[joint], self._own(joint)
        joints, motors = own.joints[:, joint], own.motors[:, joint]
        if len(joints) < _FEWEST or not np.isfinite(joints).all() or not np.isfinite(motors).all():
            return ""
        if self._disagree(own.time, joints, motors) and self._disagree(own.time, joints, own.alone[:, joint]):
            return f"joint and motor encoder of {name} disagree"
        return self._interruption(joint, own)

    def _own(self, joint: int) -> _States:
        """Return the states of a joint's sweep."""
        moves = self._sweeps[joint].moves
        return self._states.between(moves[0][0], moves[-1][1])

    def _disagree(self, time: FloatArray, joints: FloatArray, motors: FloatArray) -> bool:
        """Whether a joint's encoder and what motors say of the joint (deg) differ by more than is allowed.

        Motors do not agree with it where what they say depends on an encoder that shows nothing, and is not finite.
        """
        if not np.isfinite(motors).all():
            return True
        *spikes, near = spikes_of(joints, motors, self.spike)
        if np.ptp(motors) < _LEAST or any(one.number for one in spikes):
            return True
        found = errors_of(time, joints, motors, near)
        return found.error > self.error or abs(1e3 * found.delay) > self.delay

    def _end_if_another_motor(self, joint: int, own: _States) -> None:
        """End a joint as inconclusive that disagrees with all of its motors together, and agrees with its own one."""
        joints, motors, alone = own.joints[:, joint], own.motors[:, joint], own.alone[:, joint]
        shares = self.transmission.sharing(joint) != {joint}
        if shares and self._disagree(own.time, joints, motors) and not self._disagree(own.time, joints, alone):
            name = self.robot_part.names[joint]
            self.inconclusive(
                f"the encoder of {name} agrees with that of its own motor, and not with all that it shares; but "
                f"{self._shared(joint) or 'none of these is known'}"
            )

    def _judge(self, joint: int, sweep: _Sweep) -> None:
        name, outcome = self.robot_part.names[joint], sweep.outcome
        verdict = self.swinger.verdict(joint, outcome)
        if verdict is not None and not verdict.failed:
            self.inconclusive(verdict.text)
        if verdict is not None:
            self.check(condition=False, text=verdict.text)
        own = self._own(joint)
        joints, motors = own.joints[:, joint], own.motors[:, joint]
        finite = np.isfinite(joints) & np.isfinite(motors)
        if (missing := int((~finite).sum())) or len(finite) < _FEWEST or np.ptp(joints) < _LEAST:
            why = f"{missing} of {len(finite)} states have no finite values" if missing else "its sweep is too short"
            self.assert_error_if_false(outcome.complaint, f"{name}: {why}; {likely_causes('frozen')}")
            return
        if verdict is None and self._shows_modes:
            self._judge_modes(name, own.modes[:, joint])
        self._end_if_another_motor(joint, own)
        if np.ptp(motors) < _LEAST:
            way = self.shown(float(np.ptp(joints)))
            text = f"{name}: its motor encoder stands still while the joint moves by {way}; {likely_causes('frozen')}"
            self.check(condition=False, text=text)
            return
        of_joint, of_motor, near = spikes_of(joints, motors, self.spike)
        for whose, spikes in (("joint", of_joint), ("motor", of_motor)):
            self._judge_spikes(name, whose, spikes)
        agree = self._judge_encoders(name, own.time, joints, motors, near)
        text = self._interruption(joint, own)
        if not self.check_fail_if_true(text, f"{text}; {likely_causes('loose contact')}"):
            return  # what it needs more then is no friction
        duties = self.transmission.joint_duties(own.duties, joint)
        if np.isfinite(duties).all():
            self._judge_friction(
                name, joint, friction_profile(own.local[~near], joints[~near], duties[~near], sweep.moves)
            )
        if agree and not near.any() and joint in self.motors and np.isfinite(own.currents[:, joint]).all():
            if disturbed := self._shared(joint) or self._shaking(joint):
                self.report(f"the motor of {name} is not judged: {disturbed}")
                return
            self._judge_motor(name, joint, own)
            self._judge_viscous_friction(name, joint, own, sweep.moves)

    def _judge_modes(self, name: str, modes: NDArray[np.int32]) -> None:
        """Judge whether the board has shown another mode than position, in which it has moved the joint to the end."""
        others = modes[modes != ControlMode.POSITION]
        shown = ", ".join(mode_word(int(mode)) for mode in np.unique(others))
        hint = f"{name} was in {shown} in {len(others)} of {len(modes)} states; {likely_causes('mode for moments')}"
        self.measure("states in another mode", len(others), "count", high=0, hint=hint)

    def _judge_encoders(self, name: str, time: FloatArray, joints: FloatArray, motors: FloatArray, near: Mask) -> bool:
        """Judge what the encoders disagree about over the range; return whether they agree."""
        found = errors_of(time, joints, motors, near)
        late, first, second = 1e3 * found.delay, *(("joint", "motor") if found.delay > 0 else ("motor", "joint"))
        hint = (
            f"{name}: the {first} encoder is {abs(late):.1f} ms behind the {second} encoder; "
            f"{likely_causes('late encoder')}"
        )
        self.measure("delay of the joint encoder", late, "ms", low=-self.delay, high=self.delay, hint=hint)
        self.measure("play", found.play, "deg")
        how = f", {found.cause}" if found.cause else ""
        hint = (
            f"{name}: joint and motor encoder disagree by {self.shown(found.error)} more in one place than in "
            f"another{how}; {likely_causes('encoder error')}"
        )
        self.measure("error over the range", found.error, "deg", high=self.error, hint=hint)
        kept = found.kept
        self.record(
            "disagreement of the encoders",
            time=(time[kept] - time[0], "s"),
            joint=(joints[kept], "deg"),
            disagreement=(found.left, "deg"),
        )
        return found.error <= self.error

    def _shared(self, joint: int) -> str:
        """Return what is wrong with a joint that shares motors with one, and so disturbs it; "" if nothing is."""
        sharing = (self.transmission.sharing(joint) - {joint}) & self._sweeps.keys()
        return next((f"it shares motors: {text}" for one in sharing if (text := self._broken(one))), "")

    def _disturbance(self, joint: int) -> str:
        """Return what disturbs a joint: wrong times, one that shares its motors, any that shakes, or jerks."""
        times = wrong_stamps(self._states.time)
        if found := times or limpness(self.robot_part, joint) or self._shared(joint) or self._shaking(joint):
            return found
        return next(filter(None, map(self._interrupted, sorted(self._sweeps.keys() - {joint}))), "")

    def _shaking(self, joint: int) -> str:
        """Return that another joint is shaken by its controller while one is swept; "" if none is."""
        moves, duties = self._sweeps[joint].moves, self._own(joint).duties
        begin, end = moves[0][0], moves[-1][1]
        swept = {one for one, sweep in self._sweeps.items() if sweep.moves[0][0] < end and sweep.moves[-1][1] > begin}
        jumps = {one: jitter(duties[:, one]) for one in range(self.robot_part.axes) if one not in swept}
        least = max(_SHAKES, _MORE * jitter(duties[:, joint]))
        jump, worst = max(((jumps[one], one) for one in jumps if jumps[one] > least), default=(0.0, -1))
        text = f"{self.robot_part.names[worst]} is shaken by its controller: its duty cycle jumps by {jump:.0f} %"
        return f"{text} from state to state" if jump else ""

    def _judge_friction(self, name: str, joint: int, found: FrictionProfile | None) -> None:
        if found is None:
            return
        self.measure("dry friction", found.friction, "%")
        most = max(found.sticky.more, found.blocked.more)
        if most > self.friction and (excuse := self._disturbance(joint)):
            self.inconclusive(f"{name} needed {most:.1f} % of duty cycle more in one place; but {excuse}")
        more, where = found.sticky.more, self.shown(found.sticky.position, ".0f")
        hint = (
            f"{name} needs {more:.1f} % of duty cycle more at {where} than elsewhere, in both directions; "
            f"{likely_causes('sticky')}"
        )
        self.measure("additional friction in one place", more, "%", high=self.friction, hint=hint)
        more, where = found.blocked.more, self.shown(found.blocked.position, ".0f")
        hint = (
            f"{name} needed {more:.1f} % of duty cycle more at {where} in one of its moves, and not in the others; "
            f"{likely_causes('blocked at times')}"
        )
        self.measure("additional effort in one move", more, "%", high=self.friction, hint=hint)
        self.record(
            "duty cycle",
            time=(found.time - found.time[0], "s"),
            position=(found.positions, "deg"),
            duty=(found.duties, "%"),
            model=(found.model, "%"),
        )

    def _interrupted(self, joint: int) -> str:
        """Return that the motor of a joint had no current for moments of its sweep; "" if it had."""
        return self._interruption(joint, self._own(joint))

    def _interruption(self, joint: int, own: _States) -> str:
        """Return that the own motor of a joint has no current for moments; "" if it has, or is not known."""
        motor = self.motors.get(joint)
        columns = (own.duties[:, joint], own.currents[:, joint], own.speeds[:, joint])
        if motor is None or not motor.known or not all(np.isfinite(column).all() for column in columns):
            return ""
        found = interruption(MotorRun(*columns, motor.drive, motor.supply))
        return f"the motor of {self.robot_part.names[joint]}: {found.text}" if found else ""

    def _judge_motor(self, name: str, joint: int, own: _States) -> None:
        """Compare the current of the joint's own motor with its duty cycle and its speed."""
        motor, duties, currents = self.motors[joint], own.duties[:, joint], own.currents[:, joint]
        found = motor_model(MotorRun(duties, currents, own.speeds[:, joint], motor.drive, motor.supply))
        # Where the duty cycle jumps, as for a noisy encoder, the current does so, too.
        driven = duties * motor.supply / (100.0 * motor.drive.resistance)
        noise = min(jitter(currents), jitter(currents - driven))
        most = with_noise(self.noise / 100.0 * motor.peak, motor.drive.current_noise, max(2, len(currents)))
        hint = f"{name}: the current jumps by {noise:.2g} A from state to state; {likely_causes('noise')}"
        self.measure("noise of the current", noise, "A", high=most if motor.known else None, hint=hint)
        if math.isnan(found.gain):
            return
        near = self.current if motor.known else math.inf
        least, most = max(100.0 - near, _SIGN), 100.0 + near
        self.measure(
            "current for its duty cycle", 100.0 * found.gain, "%", low=least, high=most if motor.known else None,
            hint=f"{name}: {_wrong_current(found)}",
        )  # fmt: skip
        if not math.isnan(found.offset):
            zero = self.zero / 100.0 * motor.peak
            hint = f"{name}: the current is {found.offset:.2g} A where none flows; {likely_causes('current zero')}"
            self.measure("offset of the current", found.offset, "A", low=-zero, high=zero, hint=hint)
        if not math.isnan(found.uneven):
            way = "positive" if found.uneven < 0.0 else "negative"
            less = 100.0 * abs(found.uneven)
            hint = f"{name}: a {way} duty cycle drives {less:.0f} % less current; {likely_causes('uneven amplifier')}"
            self.measure(
                "difference of the directions", 100.0 * found.uneven, "%", low=-self.uneven, high=self.uneven, hint=hint
            )
        if not math.isnan(found.constant):
            share = 100.0 * found.constant
            hint = (
                f"{name}: the torque constant is {share:.0f} % of that in robot.toml; {likely_causes('weak magnets')}"
            )
            bounds = {"low": least, "high": most} if motor.known else {}
            self.measure("torque constant", share, "%", hint=hint, **bounds)
        self.record(
            "current",
            time=(own.time - own.time[0], "s"),
            duty=(duties, "%"),
            current=(currents, "A"),
            speed=(own.speeds[:, joint], "deg/s"),
        )

    def _judge_viscous_friction(
        self, name: str, joint: int, own: _States, moves: Sequence[tuple[float, float]]
    ) -> None:
        """Judge the torque of friction at the greatest speed by the motor's current, of a joint with one of its own."""
        if self.transmission.sharing(joint) != {joint}:
            return
        shares = 100.0 * np.sign(self.transmission.factors[joint]) * own.currents[:, joint] / self.motors[joint].peak
        found = friction_profile(own.local, own.joints[:, joint], shares, moves)
        if found is not None:
            fastest = float(np.quantile(np.abs(np.gradient(found.positions, found.time)), _FASTEST))
            more, speed = found.viscous * fastest, self.shown(fastest, ".0f")
            if more > self.viscous and (excuse := self._disturbance(joint)):
                self.inconclusive(f"{name} needed {more:.0f} % of its torque more at {speed}/s; but {excuse}")
            hint = f"{name} needs {more:.0f} % of its torque more at {speed}/s than slowly; {likely_causes('viscous')}"
            self.measure("viscous friction", more, "%", high=self.viscous, hint=hint)

    def _judge_spikes(self, name: str, whose: str, spikes: Spikes) -> None:
        hint = (
            f"{name}: {spikes.number} readings of the {whose} encoder jump, by up to {self.shown(spikes.largest)}; "
            f"{likely_causes('spikes')}"
        )
        self.measure(f"spikes of the {whose} encoder", spikes.number, "count", high=0, hint=hint)


def _wrong_current(found: MotorModel) -> str:
    if abs(found.gain) < _FOLLOWS:
        return f"the current does not follow the duty cycle; {likely_causes('current sensor')}"
    if found.gain < 0.0:
        return f"the current has the sign opposite to the duty cycle; {likely_causes('current sign')}"
    return f"the current is {100.0 * found.gain:.0f} % of what the duty cycle drives; {likely_causes('current sensor')}"


class _States(NamedTuple):
    """Recorded states: times (s), positions of joints by their own and by motor encoders (deg).

    ``motors`` are by all motors of a joint together, ``alone`` by its own motor and the encoders of other joints. Of
    motors: duty cycles (%), currents (A), NaN if the board does not measure them, and speeds of rotors (deg/s).
    ``modes`` are the control modes of joints.
    """

    time: FloatArray
    local: FloatArray
    joints: FloatArray
    motors: FloatArray
    alone: FloatArray
    duties: FloatArray
    currents: FloatArray
    speeds: FloatArray
    modes: NDArray[np.int32]

    @classmethod
    def of(cls, trace: Trace, transmission: Transmission) -> _States:
        motors = transmission.joints(trace.motor_positions)
        alone = trace.positions + transmission.disagreement(trace.positions, trace.motor_positions)
        currents = trace.currents if trace.newest[1].valid[Field.CURRENTS] else np.full_like(motors, np.nan)
        return cls(
            time=trace.time,
            local=trace.local_time,
            joints=trace.positions,
            motors=motors,
            alone=alone,
            duties=trace.duty_cycles,
            currents=currents,
            speeds=trace.motor_velocities,
            modes=trace.control_modes,
        )

    def between(self, begin: float, end: float) -> _States:
        """Return the states of a time by the test's clock."""
        rows = (self.local >= begin) & (self.local <= end)
        return _States(**{name: column[rows] for name, column in self._asdict().items()})
