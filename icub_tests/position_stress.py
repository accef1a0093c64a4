"""Position stress: joints get new targets at random times, and have to stay in position mode."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode, mode_word
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.joints_test import JointsTest, command_at
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.routines import pause, run_queues
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace
    from rtf.robot_testing.motion.routines import Routine


class PositionStress(JointsTest):
    """Commands each joint up, down and back, often before it has arrived; it must neither fault nor go idle.

    At the end the joint has to arrive, too. The times of the commands are random, and equal for equal seeds. Meant to
    be repeated; ``cycles`` repeats it within a test.
    """

    plugin_name = "position-stress"
    aliases = ("position-stress.lua", "PositionStress", "positionStress", "posiotion-stress")
    tags = ("motion", "stress")
    safety = Safety.MOTION

    low = Parameter(list[float], "lower ends of the moves; none: near home", unit="deg", default=[], key="min")
    high = Parameter(list[float], "upper ends of the moves; none: near home", unit="deg", default=[], key="max")
    speed = Parameter(list[float], "reference speeds", unit="deg/s", default=[40.0], low=0.1)
    distance = Parameter(float, "distance of the default ends from home", unit="deg", default=10.0, low=1.0)
    shortest = Parameter(float, "the shortest wait between commands", unit="s", default=0.2, low=0.01)
    longest = Parameter(float, "the longest wait between commands", unit="s", default=0.6, low=0.01)
    cycles = Parameter(int, "moves of each joint up and down", default=2, low=1)
    tolerance = Parameter(float, "tolerance of the home position at the end", unit="deg", default=1.0, low=0.01)
    seed = Parameter(int, "seed of the random waits", default=0, low=0)

    def setup(self) -> None:
        """Open the part, bring it home, and set speeds."""
        super().setup()
        part = self.robot_part
        self.bottom = self._ends("min", self.low, part.home - self.distance)
        self.top = self._ends("max", self.high, part.home + self.distance)
        self.speeds = self.robot_part.paced(self.by_joint("speed", self.speed))
        self.assert_error_if_false(
            self.shortest <= self.longest, f"shortest, {self.shortest:g} s, is longer than longest, {self.longest:g} s"
        )
        self.bring_home()
        part.board.set_reference_speeds(self.speeds[self.chosen], self.chosen)

    def _ends(self, name: str, given: list[float], otherwise: FloatArray) -> FloatArray:
        ends = self.by_joint(name, given) if given else otherwise
        return np.clip(ends, self.robot_part.low, self.robot_part.high)

    def run(self) -> None:
        """Test joint by joint, so that none collides with another; an arm and its hand at the same time."""
        self._done = 0
        run_queues(
            self.robot_part,
            self.robot_part.one_at_a_time(self.chosen),
            self._routine,
            pace=PACE,
        )

    def _routine(self, joint: int) -> Routine[None]:
        part = self.robot_part
        home = float(part.home[joint])
        chance = random.Random(self.seed + joint)  # noqa: S311 - times, not secrets
        lost: list[str] = []
        commanded: list[tuple[float, float]] = []
        stopped: GuardError | None = None
        if self.judge_if_lost(part, joint):
            return
        with part.recorded() as trace:
            try:
                for end in (float(self.bottom[joint]), float(self.top[joint]), home) * self.cycles:
                    commanded.append((self.now(), end))
                    lost += yield from self._go(joint, end, chance.uniform(self.shortest, self.longest))
                yield from part.moving([home], [joint], speed=[self.speeds[joint]], tolerance=self.tolerance / 2)
            except GuardError as error:
                stopped = error
        self._done += 1
        self.progress(self._done / len(self.chosen), part.names[joint])
        if stopped is not None:
            self.judge_own_stop(joint, stopped)
            return
        self._judge_modes(joint, trace.control_modes)
        with self.subresult(part.names[joint]):
            self.end_if_explained(joint)
            for text in lost:
                self.check(False, text)
            self._judge(joint, trace, commanded)

    def _judge(self, joint: int, trace: Trace, commanded: list[tuple[float, float]]) -> None:
        name, home = self.robot_part.names[joint], float(self.robot_part.home[joint])
        positions, currents = trace.positions[:, joint], trace.currents[:, joint]
        self.record(
            "stress",
            time=(trace.time - trace.time[0], "s"),
            position=(positions, "deg"),
            target=(command_at(trace.local_time, commanded), "deg"),
            current=(currents, "A"),
        )
        self.measure("greatest current", float(np.abs(currents).max()), "A")
        reach = float(positions.max() - positions.min())
        # The way at full speed in the shortest wait; half of that time is for the board to begin.
        least = 0.5 * min(self.shortest * self.speeds[joint], float(self.top[joint] - self.bottom[joint]))
        hint = f"{name} moves by {self.shown(reach)} only; {likely_causes('does not move')}"
        self.measure("range", reach, "deg", low=least, hint=hint)
        away = float(positions[-1]) - home
        hint = f"{name} is {self.shown(away, '+.2f')} from its start position; {likely_causes('weak')}"
        self.measure("away from where it began", away, "deg", -self.tolerance, self.tolerance, hint=hint)

    def _go(self, joint: int, end: float, wait: float) -> Routine[list[str]]:
        """Send one target and wait; return the error if the board does not report that target."""
        part = self.robot_part
        part.command_move([end], [joint])
        yield from pause(part.clock, wait)
        found = float(part.board.target_positions(joint)[0])
        if abs(found - end) <= _SAME:
            return []
        where = f"the target is {part.shown(joint, found)}, not {part.shown(joint, end)}"
        return [f"{part.names[joint]}: {where}; {likely_causes('does not start')}"]

    def _judge_modes(self, joint: int, modes: np.ndarray[tuple[int, ...], np.dtype[np.int32]]) -> None:
        """Fail each axis of the part that was not in position mode all the time; the excluded ones are left out."""
        part = self.robot_part
        for other in part.held():
            name = part.names[other]
            wrong = modes[:, other] != ControlMode.POSITION
            if wrong.any():
                word = mode_word(int(modes[int(np.flatnonzero(wrong)[0]), other]))
                code, text = part.board.last_joint_fault(other)
                why = f" (fault {code}: {text})" if code else ""
                with self.subresult(name):
                    self.check(False, f"{name} went into {word} while {part.names[joint]} moved{why}")


#: Tolerance of a target that is read back, deg.
_SAME = 0.01
