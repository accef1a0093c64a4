"""Time the path to the motors over CAN: ``python tests/benchmarks/run_can_benchmarks.py``.

Codec: microseconds a frame. Robot: the whole iCub in lockstep through control board, driver, bus and firmware, beside
the same robot without buses. Start: five boards, from the configuration to position mode. All times are those of the
processor, medians of several turns; ``--seconds`` is the simulated time of a turn.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.codec import decode
from rtf.robot.model import load_robot
from rtf.simulator.robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Callable

_TURNS = 5
_FRAMES = 20_000
#: Parts with five boards together.
_START = ("head", "torso")


def codec() -> None:
    """Print the times of encoding and decoding of a frame with positions, and of one with a status."""
    status = (0, 1, 0, 1, 0, 0, 0, 0)
    for message, values in ((motor.BROADCAST_POSITION, (123456, -98765)), (motor.STATUS, status)):
        identifier, data = message.frame(3, *values)
        encoding = _each(lambda message=message, values=values: message.frame(3, *values))  # type: ignore[misc]
        decoding = _each(lambda identifier=identifier, data=data: decode(identifier, data))  # type: ignore[misc]
        print(f"{message.name}: encode {encoding:.2f} us, decode {decoding:.2f} us")


def _each(function: Callable[[], object]) -> float:
    """Return the microseconds of a call."""
    turns = []
    for _ in range(_TURNS):
        begin = time.process_time()
        for _ in range(_FRAMES):
            function()
        turns.append((time.process_time() - begin) / _FRAMES * 1e6)
    return statistics.median(turns)


def robot(name: str, seconds: float, turns: int) -> None:
    """Print how many times faster than real time a robot is in lockstep, with and without buses, in turn."""
    with ExitStack() as opened:
        robots = {can: opened.enter_context(_robot(name, can=can)) for can in (False, True)}
        firmware = robots[True].firmware
        times: dict[bool, list[float]] = {False: [], True: []}
        frames = 0
        for turn in range(turns + 1):
            for can, made in robots.items():
                sent = _passed(made)
                begin = time.process_time()
                made.simulation.advance(made.simulation.now + seconds)
                taken = time.process_time() - begin
                if turn:  # the first one fills caches
                    times[can].append(taken)
                    frames += _passed(made) - sent
        plain, buses = (statistics.median(times[can]) for can in (False, True))
        assert firmware is not None
        loads = {wire.name: wire.bits / 1e6 / robots[True].simulation.now for wire in firmware.wires.values()}
    rate = frames / (turns * seconds)
    print(
        f"{name}: {seconds / plain:.1f} x real time without buses, {seconds / buses:.2f} x with {len(loads)} buses, "
        f"{rate:.0f} frames a simulated second, {rate * seconds / buses:.0f} a second of the processor"
    )
    print("load: " + ", ".join(f"{bus} {share:.0%}" for bus, share in loads.items()))


def _robot(name: str, *, can: bool, parts: tuple[str, ...] = ()) -> SimulatedRobot:
    network = Network(LocalNames())
    network.report = lambda sentence: print(sentence, file=sys.stderr)
    return SimulatedRobot(load_robot(name), network=network, parts=parts, lockstep=True, can=can)


def _passed(made: SimulatedRobot) -> int:
    """Return the frames that have passed the buses of a robot."""
    if made.firmware is None:
        return 0
    return sum(wire.frames for wire in made.firmware.wires.values())


def start(turns: int) -> None:
    """Print the time from the construction of a robot with five boards to position mode, beside one without buses."""
    times: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(turns):
        for can in (False, True):
            begin = clock.monotonic()
            with _robot("icub", can=can, parts=_START) as made:
                times[can].append(clock.monotonic() - begin)
                boards = len(made.firmware.boards) if made.firmware is not None else 0
    plain, buses = (statistics.median(times[can]) for can in (False, True))
    print(f"start: {buses - plain:.2f} s for {boards} boards, beside {plain:.2f} s of the robot")


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmarks."""
    parser = argparse.ArgumentParser(description="The path to the motors over CAN.")
    parser.add_argument("--robot", default="icub", help="default: icub")
    parser.add_argument("--seconds", type=float, default=1.0, help="simulated seconds of a turn")
    parser.add_argument("--turns", type=int, default=_TURNS)
    options = parser.parse_args(arguments)
    codec()
    robot(options.robot, options.seconds, options.turns)
    start(options.turns)
    return 0


if __name__ == "__main__":
    sys.exit(main())
