"""Measure the guard of robot tests: ``python tests/benchmarks/run_guard_benchmarks.py``.

The blocks, the contacts and the CPU time are measured on a simulated robot in lockstep in this process, so that what
the motors and the links really do is known; the killed and the stopped test on one in real time. Pressing begins and
ends at 15 % of the greatest torque of a joint, beyond that of gravity: ``breakaway`` of the robot's profile.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from guarded_robot import GuardedRobot, energy
from measuring import TESTRUNNER

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RobotError
from rtf.robot_testing.guard.planned_moves import RefusedMoveError
from rtf.testing.events import Message
from rtf.testing.journal import read

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from guarded_robot import Sample

    from rtf.robot_testing.motion.part import Part

MODES = (ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.POSITION_DIRECT, ControlMode.TORQUE)
PLACES = (0.25, 0.5, 0.75)
#: The goals: seconds until pressing and contacts end, the peak force of a contact (N), and the share of CPU time.
PRESSING, CONTACT, FORCE, CPU = 0.5, 0.3, 60.0, 0.05
_STEP, _SPEED = 10.0, 20.0  # deg, deg/s
#: Time after which the change of the place is no contact any more, s: the window of the contact watch, and the states.
_SETTLED = 0.4


class Blocked(NamedTuple):
    """A trial with a block: how long the joint pressed (s), its peak torque (Nm), and the energy of its motor (J)."""

    joint: str
    mode: str
    pressed: float
    torque: float
    energy: float
    stopped: str  # what the guard said; "" if it did nothing


def block(robot: GuardedRobot, part: Part, joint: int, mode: ControlMode, place: float) -> Blocked | None:
    """Block a joint at a place of its range, and command it in a mode; None if its board refuses that mode."""
    robot.reset()
    name = part.names[joint]
    axis = robot.model.index[name]
    most = robot.model.axes[axis].max_torque
    robot.place(part, {name: part.within(joint, place)})
    robot.faults.inject("jam", name)
    part.board.set_reference_speeds([_SPEED], [joint])
    robot.watch(part, _SETTLED)
    try:
        part.board.set_control_modes([mode], [joint])
    except RobotError:
        return None
    robot.watch(part, 0.2)
    here, held = part.board.encoder(joint), float(part.board.torques()[joint])
    way = _STEP if place < 0.6 else -_STEP
    commands: dict[ControlMode, Callable[[float], None]] = {
        ControlMode.POSITION: lambda elapsed: part.command_move([here + way], [joint]) if elapsed == 0.0 else None,
        ControlMode.VELOCITY: lambda _: part.board.velocity_move([np.sign(way) * _SPEED], [joint]),
        ControlMode.POSITION_DIRECT: lambda elapsed: part.board.set_positions(
            [here + np.sign(way) * min(abs(way), _SPEED * elapsed)], [joint]
        ),
        ControlMode.TORQUE: lambda _: part.board.set_reference_torques([held + np.sign(way) * most / 2], [joint]),
    }
    robot.truth.samples.clear()
    error = robot.watch(part, 2.5, commands[mode])
    samples = robot.truth.samples
    pressures = np.array([_pressure(one, axis) for one in samples])
    times = np.array([one.time for one in samples])
    pressing = times[pressures > robot.model.guard.breakaway * most]
    return Blocked(
        name, mode.word, float(np.ptp(pressing)) if pressing.size else 0.0, float(pressures.max()),
        energy(samples, axis), "" if error is None else str(error),
    )  # fmt: skip


def _pressure(sample: Sample, axis: int) -> float:
    """Return the torque of a drive beyond what holds its joint (Nm). With less, the block carries the weight."""
    torque, weight = float(sample.torques[axis]), float(sample.gravity[axis])
    return max(0.0, torque - max(0.0, weight), min(0.0, weight) - torque)


def blocks(robot: GuardedRobot, parts: Sequence[str], joints: int, places: Sequence[float]) -> list[Blocked]:
    """Block all axes of some parts in all modes at some places; at most ``joints`` of each part."""
    found: list[Blocked] = []
    for name in parts:
        part = robot.part(name)
        for joint in range(min(part.axes, joints)):
            for mode in MODES:
                trials = [block(robot, part, joint, mode, place) for place in places]
                found += [trial for trial in trials if trial is not None]
        robot.leave(part)
    return found


def show_blocks(found: Sequence[Blocked]) -> bool:
    """Print a row for each part and mode; return whether all of them pressed for a short time only."""
    print("Blocked joints: time for which they pressed, peak torque beyond gravity, energy of the motor")
    print(
        f"  {'mode':<6}{'trials':>7}{'median':>9}{'worst':>9}{'of':>22}{'torque':>10}{'energy':>9}{'not stopped':>13}"
    )
    for mode in MODES:
        rows = [one for one in found if one.mode == mode.word]
        if not rows:
            continue
        worst = max(rows, key=lambda one: one.pressed)
        missed = sum(not one.stopped for one in rows)
        print(
            f"  {mode.word:<6}{len(rows):7}{statistics.median(one.pressed for one in rows):7.2f} s"
            f"{worst.pressed:7.2f} s"
            f"{worst.joint:>22}{max(one.torque for one in rows):7.1f} Nm{max(one.energy for one in rows):7.1f} J"
            f"{missed:13}"
        )
    late = [one for one in found if one.pressed > PRESSING]
    for one in late:
        print(f"  late: {one.joint} in {one.mode}: {one.pressed:.2f} s: {one.stopped or 'not stopped'}")
    for one in found:
        if not one.stopped and one.pressed <= PRESSING:
            print(f"  not stopped: {one.joint} in {one.mode}: {one.pressed:.2f} s, {one.torque:.2f} Nm at most")
    print(f"  goal: {PRESSING:g} s; {len(found) - len(late)} of {len(found)} reach it")
    return not late


class Strike(NamedTuple):
    """A way of the left arm into the robot: start of its first four joints, moving joint, and where that is sent."""

    target: str
    start: tuple[float, float, float, float]
    joint: int
    end: float


#: Found by a search for poses from which one joint meets the target, without anything else before.
STRIKES = (
    Strike("torso", (-5.0, 10.0, 45.0, 55.0), 2, 79.0),
    Strike("hip", (-5.0, 95.0, 55.0, 70.0), 1, 1.0),
    Strike("other arm", (-25.0, 0.0, 25.0, 80.0), 2, 79.0),
    Strike("head", (-20.0, 125.0, -25.0, 100.0), 1, 159.0),
)
SPEEDS = (10.0, 30.0, 60.0)


def strike(
    robot: GuardedRobot, part: Part, way: Strike, speed: float, *, commanded: ControlMode
) -> tuple[float, float]:
    """Drive the arm into the robot; return the peak force (N), and for how long the links touched (s)."""
    robot.reset()
    robot.place(part, dict(zip(part.names, way.start, strict=False)))
    robot.watch(part, 0.3)
    part.board.set_reference_speeds([speed], [way.joint])
    part.board.set_control_modes([commanded], [way.joint])
    robot.watch(part, 0.1)
    robot.truth.samples.clear()
    sign = float(np.sign(way.end - way.start[way.joint]))

    def command(elapsed: float) -> None:
        if commanded is ControlMode.VELOCITY:
            part.board.velocity_move([sign * speed], [way.joint])
        elif elapsed == 0.0:
            part.board.position_move([way.end], [way.joint])  # past the check of planned moves

    robot.watch(part, abs(way.end - way.start[way.joint]) / speed + 2.0, command)
    touched = [one for one in robot.truth.samples if one.contact > 1.0]
    duration = touched[-1].time - touched[0].time if touched else 0.0
    return max((one.contact for one in touched), default=0.0), duration


def strikes(robot: GuardedRobot) -> bool:
    """Drive the arm into the robot with each protection; print a row for each target and speed."""
    print("Contacts of the left arm: peak force, and for how long links touched")
    heads = ("by the sensor", "ahead, position", "ahead, velocity")
    print(f"  {'target':<11}{'speed':>9}   {'planned':<9}{''.join(f'{head:>20}' for head in heads)}")
    good = True
    refused: dict[str, bool] = {}
    results: dict[tuple[str, float, str], tuple[float, float]] = {}
    for ahead in (False, True):
        part = robot.part("left_arm", check_moves=ahead)
        for way in STRIKES:
            if ahead:
                refused[way.target] = _refused(robot, part, way)
            for speed in SPEEDS:
                for mode in (ControlMode.POSITION, ControlMode.VELOCITY) if ahead else (ControlMode.POSITION,):
                    key = way.target, speed, f"{ahead} {mode.word}"
                    results[key] = strike(robot, part, way, speed, commanded=mode)
        robot.leave(part)
    for way in STRIKES:
        for speed in SPEEDS:
            cells = [results[way.target, speed, key] for key in ("False pos", "True pos", "True vel")]
            good &= all(force <= FORCE and seconds <= CONTACT for force, seconds in cells)
            text = "".join(f"{force:12.0f} N{seconds:5.2f} s" for force, seconds in cells)
            print(
                f"  {way.target:<11}{speed:3.0f} deg/s   {'refused' if refused[way.target] else 'let through':<9}{text}"
            )
    print(f"  goal: {FORCE:g} N, {CONTACT:g} s")
    return good and all(refused.values())


def _refused(robot: GuardedRobot, part: Part, way: Strike) -> bool:
    robot.reset()
    robot.place(part, dict(zip(part.names, way.start, strict=False)))
    robot.watch(part, 0.3)
    try:
        part.command_move([way.end], [way.joint])
    except RefusedMoveError:
        return True
    return False


def _thread_time() -> float:
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return used.ru_utime + used.ru_stime


def cpu(robot: GuardedRobot) -> bool:
    """Measure the CPU time of a moving arm with and without its guard, in one process with the simulator."""
    print("CPU time of the guard, as a share of that of the simulator and the test together")
    good = True
    for check in (False, True):
        part = robot.part("left_arm", check_moves=check)
        robot.reset()
        guarded = 0.0
        watch = part.guard.watch if part.guard is not None else lambda: None
        begin = os.times()
        for target in (0.4, 0.6, 0.4):
            part.board.set_reference_speeds([20.0] * 4, range(4))
            part.board.position_move([part.within(joint, target) for joint in range(4)], range(4))
            for _ in range(100):
                robot.clock.sleep(0.02)
                before = _thread_time()
                watch()
                guarded += _thread_time() - before
        end = os.times()
        used = end.user + end.system - begin.user - begin.system
        share = guarded / used
        robot.leave(part)
        print(f"  {'with' if check else 'without'} the check of moves: {100 * share:.1f} %   goal: {100 * CPU:g} %")
        good &= share <= CPU
    return good


#: A suite as for a real robot: the fixture ``robot`` beside a simulated one, in real time.
SUITE = """<suite name="s"><fixture name="names"> yarpserver </fixture>
<fixture name="simulated" depends="names"> <parameter name="realtime_factor">1</parameter> simulator </fixture>
<fixture name="supervised" depends="simulated"> <parameter name="parts">*</parameter> robot </fixture>
<test name="moves" timeout="20"> moves </test></suite>"""
MOVES = '''"""A long move, during which the process of the test ends."""
import os
import signal
from pathlib import Path

from rtf import clock
from rtf.robot_testing import RobotTest, Safety


class Moves(RobotTest):
    """Moves the head for twenty seconds, and kills or stops itself after a second."""

    safety = Safety.MOTION

    def run(self) -> None:
        part = self.open_part("head")
        part.board.set_reference_speeds([2.0], [2])
        part.board.position_move([-40.0], [2])
        part.wait(1.0)
        Path("began").write_text(str(clock.now()))
        os.kill(os.getpid(), signal.{signal})
'''


def deaths() -> bool:
    """Kill, and stop, the process of a test in the middle of a long move; print after how long the robot stood."""
    print("Death of a test in a move of twenty seconds: until the supervisor of the fixture robot has stopped it")
    good = True
    for name in ("SIGKILL", "SIGSTOP"):
        with tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as folder:
            Path(folder, "suite.xml").write_text(SUITE, encoding="utf-8")
            Path(folder, "moves.py").write_text(MOVES.replace("{signal}", name), encoding="utf-8")
            subprocess.run([*TESTRUNNER, "--suite", "suite.xml"], cwd=folder, capture_output=True, check=False)
            began = float(Path(folder, "began").read_text(encoding="utf-8"))
            (journal,) = Path(folder, "rtf-runs").glob("[0-9]*/journal.jsonl")
            stops = [
                event for event in read(journal) if isinstance(event, Message) and "neck_yaw stopped" in event.detail
            ]
            took = stops[0].time - began if stops else float("inf")
        print(f"  {name}: {took:.2f} s   goal: {PRESSING:g} s")
        good &= took <= PRESSING
    return good


def main(arguments: list[str] | None = None) -> int:
    """Run what was asked for; 1 if a goal was missed."""
    parser = argparse.ArgumentParser(description="How the guard stops what presses; all of it takes some minutes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="blocks, contacts, cpu, deaths (default: all)")
    parser.add_argument("--parts", nargs="+", metavar="PART", help="parts whose axes are blocked (default: all)")
    parser.add_argument("--joints", type=int, default=1000, help="at most so many of each part")
    parser.add_argument("--places", type=int, default=len(PLACES), help="how many places of the range")
    options = parser.parse_args(arguments)
    names = options.names or ["blocks", "contacts", "cpu", "deaths"]
    good = True
    with GuardedRobot() as robot:
        if "blocks" in names:
            parts = options.parts or list(robot.model.parts)
            good &= show_blocks(blocks(robot, parts, options.joints, PLACES[: options.places]))
        if "contacts" in names:
            good &= strikes(robot)
        if "cpu" in names:
            good &= cpu(robot)
    if "deaths" in names:
        good &= deaths()
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
