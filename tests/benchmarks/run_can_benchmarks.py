"""Time the path to the motors over CAN: ``python tests/benchmarks/run_can_benchmarks.py``.

Codec: microseconds a frame. Robot: the whole robot in lockstep through control board, driver, bus and firmware, beside
the same robot without buses. Virtual: its boards and drivers in one process, as fast as they can, on the interface
``virtual`` of python-can. Arm: one part in real time by ``udp_multicast``, the driver here and the boards with their
simulated robot in another process. Latency: from a command on a bus to the motor. Start: five boards, from the
configuration to position mode.

Times are those of the processor, medians of several turns, but for the start; ``--seconds`` is the simulated time of a
turn. On a busy machine, compare with another run at the same time.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.bus import CanBus, provide
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.interfaces import MULTICAST_GROUP
from rtf.robot.devices.can.motion_control import CanMotionControl
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.devices.motor_board import MotorBoard
from rtf.robot.errors import DeviceError
from rtf.robot.model import load_robot
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.bridge import Bridge
from rtf.simulator.firmware.configuration import can_configuration
from rtf.simulator.plant import Options, build
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.bottle import Property
    from rtf.robot.devices.can.messages import Frame

_TURNS = 5
_FRAMES = 20_000
#: Seconds of a cycle of drivers.
_CYCLE = 0.01
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
    network.report = _warn
    return SimulatedRobot(load_robot(name), network=network, parts=parts, lockstep=True, can=can)


def _warn(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def _passed(made: SimulatedRobot) -> int:
    """Return the frames that have passed the buses of a robot."""
    if made.firmware is None:
        return 0
    return _frames(made.firmware)


def virtual(name: str, seconds: float, turns: int) -> None:
    """Print the frames a second of the processor through firmware, ``virtual`` and driver, in one thread."""
    with ExitStack() as opened:
        simulation = Simulation(build(load_robot(name), Options()))
        firmware = Firmware(simulation)
        boards, buses = [], []
        with _running(simulation):
            for wire in firmware.wires.values():
                settings = BusSettings("virtual", f"benchmark-{wire.name}")
                opened.callback(Bridge(wire, settings, simulation, _warn).close)
                buses.append(CanBus(settings, report=_warn, threaded=False))
                provide(buses[-1])
                boards.append(_connected(can_configuration(firmware, wire.name, settings), opened))
        for bus in buses:
            while bus.poll():  # what has come since its board was connected
                pass
        rates = []
        for turn in range(turns + 1):
            before, begin = _frames(firmware), time.process_time()
            for _ in range(round(seconds / _CYCLE)):
                simulation.advance(simulation.now + _CYCLE)
                for board in boards:
                    _cycle(board)
            if turn:  # the first one has the setting of the modes
                rates.append((_frames(firmware) - before) / (time.process_time() - begin))
    print(f"virtual: {statistics.median(rates):.0f} frames a second of the processor, its simulated robot included")


def _cycle(board: MotorBoard) -> None:
    """Run a cycle; on a busy machine it may find that positions are old."""
    try:
        board.cycle(clock.now())
    except DeviceError as error:
        _warn(str(error))


def _connected(configuration: Property, opened: ExitStack) -> MotorBoard:
    """Return a board over the driver, whose cycles nobody runs."""
    driver = CanMotionControl()
    driver.report = _warn
    board = driver.board = MotorBoard(driver)
    axes = driver.connect(configuration)
    opened.callback(driver.disconnect)
    board.start(axes)
    return board


def _frames(firmware: Firmware) -> int:
    return sum(wire.frames for wire in firmware.wires.values())


@contextmanager
def _running(simulation: Simulation) -> Iterator[None]:
    """Let the simulated time pass in another thread."""
    ended = threading.Event()

    def run() -> None:
        while not ended.is_set():
            simulation.advance(simulation.now + 0.01)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _open(firmware: Firmware, wire: str, settings: BusSettings, opened: ExitStack) -> ControlBoard:
    network = Network(LocalNames())
    network.report = _warn
    board = ControlBoard.over(CanMotionControl)(wire, network=network)
    board.open(can_configuration(firmware, wire, settings))
    opened.callback(board.close)
    return board


def arm(name: str, part: str, seconds: float, turns: int) -> None:
    """Print the shares of a core of the driver of a part in real time, and of its boards in another process."""
    port = _free_port()
    firmware = Firmware(Simulation(build(load_robot(name), Options())), (part,))  # for the configuration
    with ExitStack() as opened:
        boards = opened.enter_context(_boards_program(name, part, port))
        devices = [
            _open(
                firmware,
                wire,
                BusSettings("udp_multicast", MULTICAST_GROUP, options=(("port", port + number),)),
                opened,
            )
            for number, wire in enumerate(firmware.wires)
        ]
        shares = []
        for _ in range(turns):
            begin, before = clock.monotonic(), (time.process_time(), _processor_time(boards), _received(devices))
            clock.sleep(seconds)
            after = time.process_time(), _processor_time(boards), _received(devices)
            took = clock.monotonic() - begin
            shares.append([(new - old) / took for new, old in zip(after, before, strict=True)])
        axes = sum(device.axes() for device in devices)
    driver, program, frames = map(statistics.median, zip(*shares, strict=True))
    print(
        f"{part}: {axes} axes in real time, {frames:.0f} frames/s, take {driver:.0%} of a core for the driver, and "
        f"{program:.0%} for the boards with their simulated robot"
    )


def _received(devices: list[ControlBoard]) -> float:
    """Return the frames that the buses of devices have had."""
    found = 0.0
    for device in devices:
        pairs = device.board.driver.variables()["canBus"]
        found += next(float(pair[1]) for pair in pairs if pair[0] == "received")  # type: ignore[index,arg-type]
    return found


@contextmanager
def _boards_program(name: str, part: str, port: int) -> Iterator[int]:
    """Run the boards of a part in another process; yield its number."""
    words = [sys.executable, "-m", "rtf", "can-boards", "--model", name, "--parts", part, "--port", str(port)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            if not any("READY" in line for line in iter(process.stderr.readline, "")):
                raise RuntimeError("the boards have not started")
            yield process.pid
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def _processor_time(process: int) -> float:
    """Return the time of the processor (s) that a process has taken."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def latency() -> None:
    """Print the simulated time from a command of a host to the end of its frame, and to the motor."""
    with _robot("bench", can=True) as made:
        assert made.firmware is not None
        (wire,), boards, ends = made.firmware.wires.values(), made.simulation.boards, dict[str, float]()
        made.parts["arm"].set_control_modes(ControlMode.PWM, 0)  # type: ignore[union-attr]  # it is a control board
        clock.current().sleep(0.5)
        command = motor.OPEN_LOOP.set.frame(made.firmware.boards[0].address or 0, 3200)

        def passes(frame: Frame, now: float) -> list[Frame]:
            if frame == command:
                ends["bus"] = now
            return [frame]

        def step(now: float) -> None:
            if boards.output[0] > 1.0:
                ends.setdefault("motor", now)

        wire.filters.append(passes)
        boards.each_step.append(step)
        begin = made.simulation.now
        wire.attach(_Host()).send(command)
        made.simulation.advance(begin + 0.01)
    bus, driven = ((ends[what] - begin) * 1e3 for what in ("bus", "motor"))
    print(
        f"latency: the frame of a command has passed after {bus:.2f} ms, and the motor is driven after {driven:.2f} ms"
    )


class _Host:
    """A host that only sends."""

    address: int | None = None

    def receive(self, frame: Frame, time: float) -> None:
        """Ignore what others send."""


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
    parser.add_argument("--part", help="the part in real time (default: the first one)")
    parser.add_argument("--seconds", type=float, default=1.0, help="simulated seconds of a turn")
    parser.add_argument("--turns", type=int, default=_TURNS)
    options = parser.parse_args(arguments)
    codec()
    robot(options.robot, options.seconds, options.turns)
    virtual(options.robot, options.seconds, options.turns)
    arm(options.robot, options.part or next(iter(load_robot(options.robot).parts)), options.seconds, options.turns)
    latency()
    start(options.turns)
    return 0


if __name__ == "__main__":
    sys.exit(main())
