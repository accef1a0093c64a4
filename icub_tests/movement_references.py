"""Movement references: commands can be read back, and a command in the wrong mode changes none of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot_testing import Limits, Safety, likely_causes
from rtf.robot_testing.joints_test import JointsTest
from rtf.robot_testing.judging.real_time_checks import loop_delay
from rtf.robot_testing.judging.statistics import line_end
from rtf.robot_testing.slides import converted, in_metres
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

#: Tolerance of a value that is read back (deg or deg/s): boards keep single precision.
_SAME = 0.01
#: The same for duty cycles, %: boards may quantize them to steps of their PWM.
_SAME_DUTY = 0.1
#: Time for a command to take effect, s; it is short because joints fall in PWM mode.
_TAKES = 0.05
#: Time for a board to change a mode, s: joints that change at once wait without power for those that do not.
_CHANGES = 0.3
#: Number and period (s) of velocity commands; boards stop a joint whose command is not repeated.
_REPEATS, _REPEATED = 4, 0.1
_PACE = 0.02
#: Tolerance of a move, deg.
_ARRIVED = 2.0
#: The time in which joints that have arrived come to rest, the duration of a move that is stopped in its middle, and
#: the time in which a joint that goes on would arrive, s; and the least way of it, deg.
_RESTS, _SLOWLY, _STANDS, _FAR = 0.5, 2.0, 1.5, 1.0
#: Share of that way that is gone then, and its tolerance, %: a joint lags behind its setpoint until the controller
#: overcomes its friction. The same tolerance holds for what it still goes after the stop.
_MIDDLE, _MISSES = 50.0, 25.0
#: The number of readings from which a position is known, 0.2 s of an iCub: a joint that is shaken is elsewhere in each.
_READINGS = 20


class MovementReferencesTest(JointsTest):
    """Commands positions, duty cycles, direct positions and velocities, and reads them back from the board.

    A position move in PWM mode and a direct position must not change the target; a joint has to follow a commanded
    velocity. A slow move has the reference speed, and a command to stop ends it where it is.
    """

    aliases = ("movementReferencesTest", "MovementReferences", "movementReferences")
    tags = ("references", "motion")
    safety = Safety.EFFORT
    limits = Limits(speed=5.0, current=None, contact=None)  # joints fall in PWM mode, light ones fast

    target = Parameter(list[float], "targets of the joints; none: near home", unit="deg", default=[])
    speed = Parameter(
        list[float], "reference speeds of the moves", unit="deg/s", default=[20.0], low=0.1, key="refVel",
        aliases=("refvel",),
    )  # fmt: skip
    acceleration = Parameter(
        list[float], "reference accelerations; none: as they are", unit="deg/s^2", default=[], low=0.001, key="refAcc",
        aliases=("refacc",),
    )  # fmt: skip
    duty = Parameter(float, "duty cycle that is commanded", unit="%", default=2.0, low=0.5, high=10.0)
    step = Parameter(float, "way of a direct position", unit="deg", default=0.1, low=0.02, high=2.0)
    velocity = Parameter(float, "commanded velocity", unit="deg/s", default=5.0, low=0.1, high=20.0)
    distance = Parameter(float, "distance of the default targets from home", unit="deg", default=5.0, low=1.0)
    with_duty = Parameter(bool, "whether the boards have duty cycles", key="withDuty", default=True)

    def setup(self) -> None:
        """Open the part, set speeds, and bring its joints home."""
        super().setup()
        part = self.robot_part
        self.speeds = self.robot_part.paced(self.by_joint("refVel", self.speed))
        self.accelerations = self.by_joint("refAcc", self.acceleration or [np.nan])
        self.way = self._inwards(part.home)
        if self.target:
            self.targets = self.by_joint("target", self.target)
        else:
            self.targets = np.clip(part.home + self.distance * self.way, part.low, part.high)
        self.bring_home(speed=float(np.nanmin(self.speeds)))

    def _inwards(self, positions: FloatArray) -> FloatArray:
        """Return for all joints the direction (1 or -1) from these positions away from the nearer limit."""
        part = self.robot_part
        ways: FloatArray = np.where(positions < (part.low + part.high) / 2, 1.0, -1.0)
        return ways

    def run(self) -> None:
        """One kind of reference after the other, all joints together."""
        duty = (self._duty,) if self.with_duty else ()
        steps = (self._settings, self._position, self._stop, *duty, self._direct, self._velocity)
        for number, step in enumerate(steps):
            self.progress(number / len(steps), step.__name__.strip("_"))
            with self.guarded():
                step()
                self.robot_part.set_mode(ControlMode.POSITION, self.chosen)
        with self.guarded():
            self.robot_part.go_home()

    def _settings(self) -> None:
        board, joints = self.robot_part.board, self.chosen
        speeds = self.speeds[joints]
        board.set_reference_speeds(speeds, joints)
        self._same("reference speed", joints, board.reference_speeds(joints), speeds, "deg/s")
        if self.acceleration:
            given = self.accelerations[joints]
            board.set_reference_accelerations(given, joints)
            self._same("reference acceleration", joints, board.reference_accelerations(joints), given, "deg/s^2")

    def _position(self) -> None:
        part, joints = self.robot_part, self.chosen
        targets = self.targets[joints]
        arrival = part.move(targets, joints, speed=self.speeds[joints], tolerance=_ARRIVED)
        self._same("target position", joints, part.board.target_positions(joints), targets, "deg")
        self._near("arrival", joints, arrival.positions, targets, _ARRIVED, "deg", "does not move", "weak")

    def _stop(self) -> None:
        """Move home slowly, and stop in the middle of the way."""
        part, board = self.robot_part, self.robot_part.board
        with part.recorded() as trace:
            part.wait(_RESTS, pace=_PACE)
        here = line_end(trace.positions[-_READINGS:])
        ways = part.home - here
        joints = [joint for joint in self.chosen if abs(ways[joint]) >= _FAR]
        if not joints:
            return
        start, way = here[joints], ways[joints]
        board.set_reference_speeds(np.abs(way) / _SLOWLY, joints)
        began = self.now()
        with part.recorded() as trace:
            part.command_move(part.home[joints], joints)
            part.wait(_SLOWLY / 2.0, pace=_PACE)
            before = len(trace)
            board.stop(joints)
            late = loop_delay([began, self.now()], _SLOWLY / 2.0)
            part.wait(_STANDS, pace=_PACE)
        positions = trace.positions[:, joints]
        middle, stood = line_end(positions[:before][-_READINGS:]), line_end(positions[-_READINGS:])
        board.set_reference_speeds(self.speeds[joints], joints)
        for joint in joints:
            course = part.column(joint, trace.positions[:, joint])
            self.record(f"stopped move of {part.names[joint]}", time=(trace.time - trace.time[0], "s"), position=course)
        half, gone = 100.0 * (middle - start) / way, 100.0 * (stood - middle) / way
        wanted = np.full(len(joints), _MIDDLE)
        self._near(
            "way at half the time of a slow move", joints, half, wanted, _MISSES, "%", "reference speed", late=late
        )
        self._near("way after a stop", joints, gone, 0.0 * wanted, _MISSES, "%", "stop", late=late)

    def _duty(self) -> None:
        part, board = self.robot_part, self.robot_part.board
        joints = self._enter(ControlMode.PWM)
        if not joints:
            return
        way = self.way[joints]
        duties = self.duty * way
        board.set_reference_duty_cycles(duties, joints)
        part.wait_to_arrive(
            lambda: np.allclose(board.reference_duty_cycles(joints), duties, atol=_SAME_DUTY), _TAKES, pace=_PACE
        )
        self._near(
            "reference duty cycle", joints, board.reference_duty_cycles(joints), duties, _SAME_DUTY, "%", "references"
        )
        before, home = board.target_positions(joints), part.home[joints]
        self.robot_part.command_move(np.where(np.abs(home - before) < 1.0, home + way, home), joints)
        part.wait(_TAKES, pace=_PACE)
        self._unchanged("target position after a move in PWM mode", joints, board.target_positions(joints), before)

    def _direct(self) -> None:
        part, board = self.robot_part, self.robot_part.board
        joints = self._enter(ControlMode.POSITION_DIRECT)
        if not joints:
            return
        before = board.target_positions(joints)
        asked = np.clip(board.encoders(joints) + self.step * self.way[joints], part.low[joints], part.high[joints])
        board.set_positions(asked, joints)
        part.wait_to_arrive(
            lambda: np.allclose(board.reference_positions(joints), asked, atol=_SAME), _TAKES, pace=_PACE
        )
        self._same("reference position", joints, board.reference_positions(joints), asked, "deg")
        self._unchanged("target position after a direct one", joints, board.target_positions(joints), before)

    def _velocity(self) -> None:
        """Command velocities; the velocity of a joint is the slope of a line through its positions and stamps."""
        part, board = self.robot_part, self.robot_part.board
        joints = self._enter(ControlMode.VELOCITY)
        if not joints:
            return
        if self.acceleration:  # those of a file may need longer for the velocity than the test lasts
            enough = np.maximum(self.accelerations[joints], self.velocity / _REPEATED)
            board.set_reference_accelerations(enough, joints)
        # From the current positions: in PWM mode light joints may have fallen to a limit.
        speeds = self.velocity * self._inwards(board.encoders())[joints]
        try:
            self._run_at(speeds, joints)
            self._same("reference velocity", joints, board.target_velocities(joints), speeds, "deg/s")
            with part.recorded() as trace:
                late = loop_delay(self._run_at(speeds, joints), _REPEATED)
        finally:
            board.velocity_move(np.zeros(len(joints)), joints)
            part.wait(_TAKES, pace=_PACE)
        time, positions = trace.time - trace.time[0], trace.positions[:, joints]
        taken = np.polyfit(time, positions, 1)[0]
        self._near("speed", joints, taken, speeds, _TAKEN * self.velocity, "deg/s", "does not move", "weak", late=late)
        commanded = positions[0] + np.multiply.outer(time, speeds)
        for place, joint in enumerate(joints):
            columns = {"position": part.column(joint, positions[:, place])}
            columns["commanded"] = part.column(joint, commanded[:, place])
            self.record(f"velocity of {part.names[joint]}", time=(time, "s"), **columns)

    def _run_at(self, speeds: FloatArray, joints: list[int]) -> list[float]:
        """Command velocities periodically, as boards stop a joint without commands. Return the times (s)."""
        ticks = [self.now()]
        for _ in range(_REPEATS):
            self.robot_part.board.velocity_move(speeds, joints)
            self.robot_part.wait(_REPEATED, pace=_PACE)
            ticks.append(self.now())
        return ticks

    def _enter(self, mode: ControlMode) -> list[int]:
        """Bring all joints into a mode; return those that enter it, and fail the others."""
        part = self.robot_part
        part.set_mode(mode, self.chosen, timeout=_CHANGES)
        there = []
        for joint, found in zip(self.chosen, part.board.control_modes(self.chosen), strict=True):
            name = part.names[joint]
            if found is mode:
                there.append(joint)
            with self.subresult(name):
                self.check_fail_if_false(
                    found is mode,
                    f"{name}: is in {found.word} after a request for {mode.word}; {likely_causes('mode')}",
                )
        return there

    def _same(self, what: str, joints: list[int], found: FloatArray, wanted: FloatArray, unit: str) -> None:
        self._near(what, joints, found, wanted, _SAME, unit, "references")

    def _unchanged(self, what: str, joints: list[int], found: FloatArray, before: FloatArray) -> None:
        """Judge a reference that a command must not change, as the mode does not accept that command."""
        self._near(what, joints, found, before, _SAME, "deg", "mode")

    def _near(
        self,
        what: str,
        joints: list[int],
        found: FloatArray,
        wanted: FloatArray,
        tolerance: float,
        unit: str,
        *findings: str,
        late: str = "",
    ) -> None:
        """Judge values of joints, with the causes of ``findings``; with ``late`` a wrong value is inconclusive."""
        for joint, value, expected in zip(joints, found, wanted, strict=True):
            name = self.robot_part.names[joint]
            with self.subresult(name):
                factor, symbol = converted(in_metres(self.robot_part.board, joint), unit)
                wrong = f"{name}: {what} is {value * factor:g} {symbol}, not {expected * factor:g}"
                if not abs(value - expected) <= tolerance:
                    if late:
                        self.inconclusive(f"{wrong}; but {late}")
                    if _MOVES.intersection(findings):  # no other joint disturbs what a board reports
                        self.end_if_disturbed(joint, wrong)
                hint = f"{wrong}; {likely_causes(*findings)}"
                self.measure(what, value, unit, low=expected - tolerance, high=expected + tolerance, hint=hint)


#: The findings about motion.
_MOVES = frozenset({"does not move", "reference speed", "stop"})
#: Tolerance of a velocity, as a share: the ramp at its begin, stiction and coupled joints are within it, and a velocity
#: that is halved, doubled or in another unit is not.
_TAKEN = 0.4
