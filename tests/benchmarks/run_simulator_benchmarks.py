"""Run the benchmarks of the simulated robot: ``python tests/benchmarks/run_simulator_benchmarks.py``.

The robot is a process of its own, whoever uses it is this one. What it takes is held against what the physics alone
take for the same motion, measured in turn in the same process: a machine that is slow for a while is so for both.
"""

from __future__ import annotations

import argparse
import itertools
import os
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING

import simulator_peer as peer
from run_middleware_benchmarks import late

from rtf import clock
from rtf.bottle import Bottle, Property, as_float
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import Stamp
from rtf.middleware.wire.contact import Contact
from rtf.robot.boards.client import connect
from rtf.robot.sensors.analog import AnalogClient
from rtf.robot.sensors.analog_sensors import AnalogSensorsClient
from rtf.robot.sensors.inertial import InertialClient

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.device import Device

PARTS = ("head", "torso", "left_arm", "right_arm", "left_leg", "right_leg")
SENSED = ("left_arm", "right_arm", "left_leg", "right_leg", "left_foot", "right_foot")
#: Seconds of the sleeps of a client, and of one turn, in which each joint goes there and back.
STEP, TURN = 0.1, 2.0
_SPEED, _WAY = 20.0, 8.0  # deg/s, deg
_PERIOD = 0.01  # s, of states
_ALONE = 5  # s, of a robot that nobody listens to


class Client:
    """A client of the whole robot that lives in its time: all boards, all sensors, everything by tcp."""

    def __init__(self, network: Network, stack: ExitStack) -> None:
        self.network = network
        self._rpc = stack.enter_context(RpcClient("", "/peer", network=network))
        self.clock = LockstepClock("/clock", "benchmark", network=network)
        stack.enter_context(clock.use(self.clock))
        self.boards = {
            part: stack.enter_context(connect(f"/icubSim/{part}", carrier="tcp", network=network)) for part in PARTS
        }
        for part in SENSED:
            self._sense(stack, AnalogClient(part, network=network), f"/icubSim/{part}/analog:o")
        self._sense(stack, AnalogSensorsClient("FTs", network=network), "/icubSim/FTs")
        self._sense(stack, InertialClient("inertial", network=network), "/icubSim/inertial")
        self._sense(stack, AnalogSensorsClient("imu", network=network), "/icubSim/inertial")
        self.clock.sleep(STEP)
        self._home = {part: board.encoders() for part, board in self.boards.items()}
        for board in self.boards.values():
            board.set_reference_speeds([_SPEED] * board.axes())

    def _sense(self, stack: ExitStack, device: Device, remote: str) -> None:
        device.open(Property({"remote": remote, "carrier": "tcp"}))
        stack.callback(device.close)

    def ask(self, *words: object) -> list[float]:
        """Ask the other process."""
        return [*map(as_float, self._rpc.call(Bottle(words)) or ())]

    def turn(self, moved: Sequence[str]) -> None:
        """Move these parts there and back, and look where they are, as a test does."""
        for way in (_WAY, -_WAY):
            for part in moved:
                self.boards[part].position_move(self._home[part] + way)
            for _ in range(round(TURN / 2 / STEP)):
                self.clock.sleep(STEP)
                for part in moved:
                    self.boards[part].encoders()


def speed(turns: int) -> None:
    """How fast the robot's time passes while a client in lockstep moves one part, or all of them."""
    with ExitStack() as stack:
        client = Client(stack.enter_context(peer.running("lockstep")), stack)
        for name, moved, wanted in (("one part", PARTS[2:3], 15), ("all 53 joints", PARTS, 10)):
            client.turn(moved)
            client.ask("record")
            client.turn(moved)
            client.ask("raw")
            raw, taken = [], []
            for _ in range(turns):
                raw.append(client.ask("raw"))
                (before,), began = client.ask("processor"), clock.monotonic()
                client.turn(moved)
                duration, (after,) = clock.monotonic() - began, client.ask("processor")
                taken.append([duration / TURN * 1e3, (after - before) / TURN * 1e3])
            _say_speed(name, raw, taken, wanted)


def _say_speed(name: str, raw: list[list[float]], taken: list[list[float]], wanted: float) -> None:
    """By the clock and by the processor: ``raw`` in us a step, ``taken`` in ms a second, which is the same."""
    lines = []
    for kind, by in enumerate(("", ", of the processor")):
        alone, whole = ([times[kind] for times in what] for what in (raw, taken))
        typical, least = statistics.median(alone) / statistics.median(whole), min(alone) / min(whole)
        lines.append(
            f"  {name} moves, a step{by}: {statistics.median(whole):.1f} us (best {min(whole):.1f}), the physics alone "
            f"{statistics.median(alone):.1f} us (best {min(alone):.1f}): {typical:.0%}, best {least:.0%} (wanted: 70%)"
        )
    by_clock = [times[0] for times in taken]
    lines.append(
        f"  {name} moves: {1e3 / statistics.median(by_clock):.1f} times real time, "
        f"best {1e3 / min(by_clock):.1f} (wanted: {wanted:g})"
    )
    print("\n".join(lines), flush=True)


@contextmanager
def _on_one_processor() -> Iterator[None]:
    """Have all that is begun meanwhile, here and in other processes, run on one processor.

    Whether a call wakes another processor is else up to the scheduler, differently for each connection, and costs more
    than all that is measured.
    """
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def calls(turns: int) -> None:
    """What a client's calls take."""
    with ExitStack() as stack:
        stack.enter_context(_on_one_processor())
        client = Client(stack.enter_context(peer.running("lockstep")), stack)
        arm = client.boards["left_arm"]
        echo = stack.enter_context(RpcClient("", "/peer", network=client.network))
        rows: dict[str, Callable[[], object]] = {
            "encoders from the last state": arm.encoders,
            "one encoder from the last state": partial(arm.encoders, 3),
            "round trip of the middleware": partial(echo.call, Bottle.parse("echo [get] [don] 3")),
            "RPC: motion_done of a joint": partial(arm.motion_done, 3),
            "RPC: control_modes of all joints": arm.control_modes,
        }
        times: dict[str, list[float]] = {name: [] for name in rows}
        now = clock.monotonic
        for _ in range(turns):
            for name, call in rows.items():
                for _ in range(100):
                    began = now()
                    call()
                    times[name].append((now() - began) * 1e6)
        trip = statistics.median(times["round trip of the middleware"])
        goals = ("(wanted: 5 us)", "(wanted: 5 us)", "", "(wanted: 1.2)", "")
        for (name, taken), goal in zip(times.items(), goals, strict=True):
            median = statistics.median(taken)
            taken.sort()
            by_trip = f"{median / trip:5.2f} round trips"
            print(f"  {name:36}p50 {median:7.1f} us   p99 {late(taken):7.1f} us   {by_trip} {goal}", flush=True)


class _Arrivals(Port):
    """Notes when messages come, and what their stamps say."""

    def __init__(self, name: str, network: Network) -> None:
        self.came: list[tuple[float, float]] = []
        super().__init__(name, self._take, network=network, outputs=False)

    def _take(self, delivery: IncomingMessage) -> None:
        at = clock.monotonic()
        stamp = Stamp.parse(delivery.envelope)
        self.came.append((at, stamp.time if stamp else 0.0))


def jitter(turns: int) -> None:
    """How regularly a state comes in real time, beside how regularly this machine wakes whoever sleeps."""
    with ExitStack() as stack:
        network = stack.enter_context(peer.running())
        port = stack.enter_context(_Arrivals("/reader", network))
        remote.connect(network, Contact("/icubSim/left_arm/state:o"), Contact("/reader"), "tcp")
        clock.sleep(1.0)
        first = len(port.came)
        woken = _sleeps(50 * turns)
        came = port.came[first:]
        offset = statistics.median(at - stamped for at, stamped in came)
        shifts = [abs(at - stamped - offset) * 1e3 for at, stamped in came]
        gaps = [abs(after - before - _PERIOD) * 1e3 for (before, _), (after, _) in itertools.pairwise(came)]
        for name, times, wanted in (
            ("state:o off its time", shifts, "(wanted: p99 of 2 ms)"),
            ("between two messages, off 10 ms", gaps, ""),
            ("a bare sleep of 10 ms, too long", woken, ""),
        ):
            times.sort()
            print(
                f"  {name:36}p50 {statistics.median(times):6.2f} ms   p99 {late(times):6.2f} ms   "
                f"most {times[-1]:6.2f} ms   {wanted}",
                flush=True,
            )


def _sleeps(count: int) -> list[float]:
    """By how many ms sleeps of 10 ms are too long."""
    found = []
    for _ in range(count):
        began = clock.monotonic()
        clock.sleep(_PERIOD)
        found.append((clock.monotonic() - began - _PERIOD) * 1e3)
    return found


def cameras(turns: int) -> None:
    """How many pictures of 320 by 240 a second the eyes make."""
    with ExitStack() as stack:
        network = stack.enter_context(peer.running("lockstep", "cameras"))
        rpc = stack.enter_context(RpcClient("", "/peer", network=network))
        taken = [as_float((rpc.call(Bottle(["pictures", 10])) or Bottle()).get(0)) / 20 for _ in range(turns)][1:]
        print(
            f"  pictures: {1 / statistics.median(taken):.0f} a second, best {1 / min(taken):.0f} (wanted: 60)",
            flush=True,
        )


def two(turns: int) -> None:
    """What two simulators on two processors bring, of what one does."""
    with ExitStack() as stack:
        robots = [stack.enter_context(peer.start("alone")) for _ in range(2)]
        for robot in robots:
            peer.hear(robot)
        gains = []
        for turn in range(turns + 1):
            (single,) = _advance([robots[turn % 2]])
            both = _advance(robots)
            gains.append([sum(single[kind] / taken[kind] for taken in both) for kind in (0, 1)])
        by_clock, by_processor = ([gain[kind] for gain in gains[1:]] for kind in (0, 1))
        print(
            f"  two simulators: {statistics.median(by_clock):.2f} times what one does, best {max(by_clock):.2f}, "
            f"by the processor {statistics.median(by_processor):.2f} (wanted: 1.8)",
            flush=True,
        )
        for robot in robots:
            assert robot.stdin is not None
            robot.stdin.close()


def _advance(robots: Sequence[subprocess.Popen[str]]) -> list[list[float]]:
    """Let time pass in all of them at the same time; the seconds that it took each."""
    for robot in robots:
        assert robot.stdin is not None
        robot.stdin.write(f"{_ALONE}\n")
        robot.stdin.flush()
    return [peer.hear(robot) for robot in robots]


def start(turns: int) -> None:
    """From the start of the program until its ports answer."""
    taken = []
    for _ in range(min(turns, 5) + 1):
        with tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as folder:
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
            environment |= {"YARP_CONF": folder, "YARP_CONFIG_HOME": folder, "YARP_RUNTIME_DIR": folder}
            began = clock.monotonic()
            ready = _until_ready(folder, environment)
            taken.append(clock.monotonic() - began)
    taken = taken[1:]
    print(
        f"  start to ready: {statistics.median(taken):.2f} s, best {min(taken):.2f} s (wanted: 1.5 s)\n  {ready}",
        flush=True,
    )


def _until_ready(folder: str, environment: dict[str, str]) -> str:
    command = [sys.executable, "-m", "rtf", "simulator", "--nameserver", "--lockstep"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment, cwd=folder) as program:
        assert program.stderr is not None
        said: list[str] = []
        try:
            for line in program.stderr:
                said.append(line.strip())
                if line.startswith("READY"):
                    return said[-1]
        finally:
            program.terminate()
    raise RuntimeError(f"the simulator did not start: {' / '.join(said)}")


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description="Benchmarks of the simulated robot; all of them take about a minute.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="speed, calls, jitter, cameras, two, start (all)")
    parser.add_argument("--turns", type=int, default=20, help="how often each thing has its turn")
    options = parser.parse_args()
    known: dict[str, Callable[[int], None]] = {
        "speed": speed,
        "calls": calls,
        "jitter": jitter,
        "cameras": cameras,
        "two": two,
        "start": start,
    }
    for name in options.names or known:
        print(f"{name}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors", flush=True)
        known[name](options.turns)


if __name__ == "__main__":
    main()
