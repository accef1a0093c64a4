"""What recording a robot takes: ``python tests/benchmarks/run_recording_benchmarks.py``.

``rtf record`` records thirty streams at 100 Hz and two cameras at 30 Hz, of a program on this machine, into each
format.
Every message must be in the recording, in order. It prints the share of a core that the recorder needed, and the load
of the machine; with ``--most`` it ends with an error if the share is greater.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import psutil

from rtf import clock
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.recording import open_recording

SENDER = Path(__file__).with_name("recording_sender.py")
_MEBI = 1 << 20


class Robot(NamedTuple):
    """What is sent."""

    streams: int
    rate: float
    cameras: int
    frames: float
    seconds: float

    @property
    def ports(self) -> list[str]:
        """The names of the ports."""
        arms = [f"/bench/stream{number}" for number in range(self.streams)]
        return arms + [f"/bench/camera{number}" for number in range(self.cameras)]


def measure(place: Path, robot: Robot, carrier: str, environment: dict[str, str]) -> tuple[bool, float]:
    """Record the robot; print what it took, and return whether nothing was lost and the share of a core."""
    send = [sys.executable, str(SENDER), *map(str, robot)]
    record = [sys.executable, "-m", "rtf", "record", *robot.ports, "-o", str(place), "--carrier", carrier]
    with subprocess.Popen(send, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sender:
        assert sender.stdin is not None
        assert sender.stdout is not None
        assert sender.stdout.readline() == "ready\n"
        with subprocess.Popen(record, env=environment, stdout=subprocess.PIPE, text=True) as recorder:
            assert recorder.stdout is not None
            assert recorder.stdout.readline().startswith("recording")
            process = psutil.Process(recorder.pid)
            before, began = _cpu(process), clock.monotonic()
            sender.stdin.write("\n")
            sender.stdin.flush()
            sent, shown = map(int, sender.stdout.readline().split())
            share = (_cpu(process) - before) / (clock.monotonic() - began)
            memory = process.memory_info().rss / _MEBI
            recorder.send_signal(signal.SIGTERM)
            recorder.stdout.read()
        sender.stdin.write("\n")
    found, ordered = _count(place)
    expected = {name: shown if "camera" in name else sent for name in robot.ports}
    lost = sum((Counter(expected) - found).values())
    size = sum(file.stat().st_size for file in ([place] if place.is_file() else place.rglob("*"))) / _MEBI
    print(
        f"{place.name:8} {carrier:8} {robot.streams} streams, {sent / robot.seconds:.0f} Hz, {robot.cameras} cameras,"
        f" {shown / robot.seconds:.0f} Hz, {robot.seconds:g} s: {lost} of {sum(expected.values())} lost,"
        f" {'in order' if ordered else 'NOT IN ORDER'}; {100 * share:.1f} % of a core, {memory:.0f} MiB of memory,"
        f" {size:.0f} MiB of disk, load {os.getloadavg()[0]:.1f}"
    )
    return not lost and ordered, share


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _count(place: Path) -> tuple[Counter[str], bool]:
    """The messages of each stream in a recording, and whether their numbers follow each other."""
    found: Counter[str] = Counter()
    ordered = True
    recording = open_recording(place)
    for sample in recording.samples([stream.source for stream in recording.streams]):
        ordered = ordered and sample.stamp.count == found[sample.source]
        found[sample.source] += 1
    return found, ordered


def main() -> int:
    """Record into each format; return 1 if a message was lost, or the share of a core is too great."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streams", type=int, default=30)
    parser.add_argument("--rate", type=float, default=100.0, help="messages a second of each stream")
    parser.add_argument("--cameras", type=int, default=2)
    parser.add_argument("--frames", type=float, default=30.0, help="images a second of each camera")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--carrier", nargs="+", default=["fast_tcp"])
    parser.add_argument("--most", type=float, default=100.0, help="greatest share of a core, in percent")
    options = parser.parse_args()
    robot = Robot(options.streams, options.rate, options.cameras, options.frames, options.seconds)
    fine = []
    with NameServer() as server:
        for carrier in options.carrier:
            for name in ("run", "run.mcap"):
                with tempfile.TemporaryDirectory() as folder:
                    environment = {**os.environ, "YARP_CONFIG_HOME": folder}
                    configuration.write_place(server.contact, environment=environment)
                    whole, share = measure(Path(folder, name), robot, carrier, environment)
                    fine.append(whole and 100 * share <= options.most)
    return 0 if all(fine) else 1


if __name__ == "__main__":
    sys.exit(main())
