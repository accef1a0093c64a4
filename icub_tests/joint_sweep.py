"""Sweep of each joint over its range, slowly and fast: errors of its encoders, and its friction in every place."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.judging.encoder_errors import Spikes, errors_of, spikes_of
from rtf.robot_testing.judging.friction_profile import friction_profile
from rtf.robot_testing.motion.joint_swings import JointSwinger, Outcome, ends_of
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import run_queues
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace
    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.judging.encoder_errors import Mask
    from rtf.robot_testing.judging.friction_profile import FrictionProfile
    from rtf.robot_testing.motion.routines import Routine

#: The least range of a sweep that is judged, deg.
_LEAST = 5.0
#: The fewest states of a sweep that are judged.
_FEWEST = 50


class _Sweep(NamedTuple):
    """A joint's sweep: its outcome, and when each of its moves began and ended (s of the robot's clock)."""

    outcome: Outcome
    moves: tuple[tuple[float, float], ...]


class JointSweep(JointsTest):
    """Moves each joint over its range, slowly and fast; compares its encoders, and its friction in all places.

    Every place is passed in both directions, at two speeds. What the motors' encoders show of a joint, through the
    inverse of gearboxes and couplings, is compared with its own encoder in every state: spikes, delays, and an error
    that grows over the range, as that of an eccentric magnet, of lost counts, or of a drift. Joints that cannot collide
    sweep at the same time.

    The duty cycle is compared with that of a pendulum with friction: more in one place in both directions is a sticky
    place, more in a single move a joint that was blocked for a moment.
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

    def setup(self) -> None:
        """Read the transmission of the part, choose the ends of the sweeps, and hold the joints."""
        super().setup()
        part = self.robot_part
        self.transmission = self.read_transmission()
        self.transmission.warn_if_unknown(self, part.name)
        self.slow_speeds = self.by_joint("speed", self.speed)
        self.fast_speeds = self.by_joint("fast", self.fast)
        self.ends = {joint: ends_of(part, joint, np.inf) for joint in self.chosen}
        self.swinger = JointSwinger(part, self.transmission, tolerance=self.tolerance)
        self.swinger.begin(self.hold)

    def run(self) -> None:
        """Sweep all queues in parallel, then judge joint by joint."""
        part = self.robot_part
        self._sweeps: dict[int, _Sweep] = {}
        with part.recorded() as trace:
            run_queues(part, part.queues(self.chosen), self._routine, pace=PACE)
        self.assert_error_if_false(len(trace), f"{part.name}: the board publishes no states")
        states = _States.of(trace, self.transmission)
        for joint in self.chosen:
            with self.subresult(part.names[joint]):
                self._judge(joint, self._sweeps[joint], states)
        self.fail_others(self.swinger.evidence, self.chosen)

    def _routine(self, joint: int) -> Routine[None]:
        """Move a joint to its lower end and to its upper one slowly, back to the lower one and home fast."""
        low, high = self.ends[joint]
        home, slow, fast = self.robot_part.home[joint], self.slow_speeds[joint], self.fast_speeds[joint]
        moves: list[tuple[float, float]] = []
        outcome = Outcome()
        for target, speed in ((low, slow), (high, slow), (low, fast), (home, fast)):
            begin = self.now()
            outcome = yield from self.swinger.visiting(joint, [(float(target), float(speed))])
            moves.append((begin, self.now()))
            if outcome.complaint:
                break
        self._sweeps[joint] = _Sweep(outcome, tuple(moves))
        self.progress(0.9 * len(self._sweeps) / len(self.chosen), self.robot_part.names[joint])

    def _judge(self, joint: int, sweep: _Sweep, states: _States) -> None:
        name, outcome = self.robot_part.names[joint], sweep.outcome
        verdict = self.swinger.verdict(joint, outcome)
        if verdict is not None and not verdict.failed:
            self.inconclusive(verdict.text)
        if verdict is not None:
            self.check(condition=False, text=verdict.text)
        own = states.between(sweep.moves[0][0], sweep.moves[-1][1])
        joints, motors = own.joints[:, joint], own.motors[:, joint]
        finite = np.isfinite(joints) & np.isfinite(motors)
        if (missing := int((~finite).sum())) or len(finite) < _FEWEST or np.ptp(joints) < _LEAST:
            why = f"{missing} of {len(finite)} states have no finite values" if missing else "its sweep is too short"
            self.assert_error_if_false(outcome.complaint, f"{name}: {why}; {likely_causes('frozen')}")
            return
        of_joint, of_motor, near = spikes_of(joints, motors, self.spike)
        for whose, spikes in (("joint", of_joint), ("motor", of_motor)):
            self._judge_spikes(name, whose, spikes)
        self._judge_encoders(name, own.time, joints, motors, near)
        duties = self.transmission.joint_duties(own.duties, joint)
        if np.isfinite(duties).all():
            self._judge_friction(name, friction_profile(own.local[~near], joints[~near], duties[~near], sweep.moves))

    def _judge_encoders(self, name: str, time: FloatArray, joints: FloatArray, motors: FloatArray, near: Mask) -> None:
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

    def _judge_friction(self, name: str, found: FrictionProfile | None) -> None:
        if found is None:
            return
        self.measure("dry friction", found.friction, "%")
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

    def _judge_spikes(self, name: str, whose: str, spikes: Spikes) -> None:
        hint = (
            f"{name}: {spikes.number} readings of the {whose} encoder jump, by up to {self.shown(spikes.largest)}; "
            f"{likely_causes('spikes')}"
        )
        self.measure(f"spikes of the {whose} encoder", spikes.number, "count", high=0, hint=hint)


class _States(NamedTuple):
    """Recorded states: times (s), positions of joints by their own and by motor encoders (deg), duty cycles (%)."""

    time: FloatArray
    local: FloatArray
    joints: FloatArray
    motors: FloatArray
    duties: FloatArray

    @classmethod
    def of(cls, trace: Trace, transmission: Transmission) -> _States:
        motors = transmission.joints(trace.motor_positions)
        return cls(trace.time, trace.local_time, trace.positions, motors, trace.duty_cycles)

    def between(self, begin: float, end: float) -> _States:
        """Return the states of a time by the test's clock."""
        rows = (self.local >= begin) & (self.local <= end)
        return _States(*(column[rows] for column in self))
