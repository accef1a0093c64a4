"""What a collector of logs can take: ``python tests/benchmarks/run_log_benchmarks.py``.

``rtf logger`` collects from programs on this machine. *Rate*: twenty programs log for some seconds; every record must
be in the file. *Flood*: one of them logs without a pause; the others must lose nothing. *Python*: what a record costs a
program that logs by the handler. It ends with an error if a record is lost that must not be.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import psutil

from rtf import clock
from rtf.logs.query import Query
from rtf.logs.store import LogReader
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer

SENDER = Path(__file__).with_name("log_sender.py")
_LIMIT = 120.0
_MEBI = 1 << 20
#: Seconds without a new record after which none is expected.
_QUIET = 15.0


class Sender(NamedTuple):
    """What a program logs: records in all, and records a second, 0 for as fast as it can."""

    how: str
    count: int
    rate: float


@dataclass(frozen=True)
class Result:
    """What became of it: records in the file by sender, and what it took."""

    stored: dict[int, int]
    #: Seconds from the first to the last arrival.
    seconds: float
    #: CPU seconds of the collector, and of each sender.
    cpu: float
    senders: list[float]
    #: Largest memory of the collector in the first and in the second half, in MiB.
    memory: tuple[float, float]
    #: How often it was reported that records were dropped.
    warnings: int

    @property
    def total(self) -> int:
        """All records in the file."""
        return sum(self.stored.values())


def measure(folder: Path, senders: list[Sender], environment: dict[str, str]) -> Result:
    """Start a collector and the senders, let them log, and read the file."""
    file = folder / "logs.sqlite"
    words = [sys.executable, "-m", "rtf", "logger", "--file", str(file), "--max-size", "2G"]
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True) as collector:
        assert collector.stdout is not None
        assert "is open" in collector.stdout.readline()
        programs = [_start(one, number, environment) for number, one in enumerate(senders)]
        for program in programs:
            assert program.stdout is not None
            assert program.stdout.readline() == "ready\n"
        process = psutil.Process(collector.pid)
        before = _cpu(process)
        for program in programs:
            assert program.stdin is not None
            program.stdin.write("\n")
            program.stdin.flush()
        samples = [process.memory_info().rss]
        deadline = clock.Deadline.after(_LIMIT)
        while any(program.poll() is None for program in programs) and not deadline.expired:
            clock.sleep(0.1)
            samples.append(process.memory_info().rss)
        took = [float(program.communicate()[0]) for program in programs]
        _await_records(file, sum(one.count for one in senders))
        cpu = _cpu(process) - before
        collector.send_signal(signal.SIGTERM)
    half = len(samples) // 2
    memory = (max(samples[: half + 1]) / _MEBI, max(samples[half:]) / _MEBI)
    return _read(file, len(senders), cpu, took, memory)


def _start(one: Sender, number: int, environment: dict[str, str]) -> subprocess.Popen[str]:
    words = [sys.executable, str(SENDER), one.how, str(one.count), str(one.rate), str(number)]
    return subprocess.Popen(words, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _await_records(file: Path, count: int) -> None:
    """Wait until the collector has written all records, or nothing for some time."""
    written, since = -1, clock.monotonic()
    while written < count and clock.monotonic() - since < _QUIET:
        with LogReader(file) as reader:
            newest = reader.newest()
        if newest != written:
            written, since = newest, clock.monotonic()
        clock.sleep(0.1)


def _read(file: Path, count: int, cpu: float, took: list[float], memory: tuple[float, float]) -> Result:
    stored: dict[int, int] = {}
    arrivals = []
    with LogReader(file) as reader:
        for number in range(count):
            query = Query(process=f"/log/bench/sender/{number}", text="joint")
            found = [arrived for _, arrived, _ in reader.read(query)]
            stored[number] = len(found)
            arrivals += [found[0], found[-1]] if found else []
        warnings = sum(1 for _ in reader.read(Query(component="rtf.logs", text="dropped")))
    return Result(stored, max(arrivals, default=0.0) - min(arrivals, default=0.0), cpu, took, memory, warnings)


def rate(folder: Path, programs: int, wanted: float, seconds: float, environment: dict[str, str]) -> bool:
    """Programs that log at a rate; returns whether nothing was lost."""
    count = int(wanted * seconds / programs)
    result = measure(folder, [Sender("port", count, wanted / programs)] * programs, environment)
    lost = count * programs - result.total
    print(
        f"rate   {programs} programs, {wanted:.0f} records/s wanted:"
        f" {result.total / result.seconds:.0f} records/s stored, {lost} of {count * programs} lost;"
        f" {1e6 * result.cpu / max(1, result.total):.1f} us of CPU a record in the collector,"
        f" {1e6 * sum(result.senders) / count / programs:.1f} us in the senders;"
        f" memory {result.memory[0]:.0f} MiB, then {result.memory[1]:.0f} MiB"
    )
    return lost == 0


def flood(folder: Path, programs: int, flooding: int, seconds: float, environment: dict[str, str]) -> bool:
    """One that floods and others that do not; returns whether only the flood lost records and it was reported."""
    calm = Sender("port", int(100 * seconds), 100.0)
    flooder = Sender("port", flooding, 0.0)
    result = measure(folder, [flooder] + [calm] * (programs - 1), environment)
    lost = calm.count * (programs - 1) - sum(result.stored[number] for number in range(1, programs))
    of_flood = flooder.count - result.stored[0]
    print(
        f"flood  1 program with {flooder.count} records at once, {programs - 1} with 100 records/s: these lost {lost},"
        f" the first {of_flood}, warned {result.warnings} times;"
        f" memory {result.memory[0]:.0f} MiB, then {result.memory[1]:.0f} MiB"
    )
    return lost == 0 and (of_flood == 0 or result.warnings > 0)


def python(folder: Path, environment: dict[str, str]) -> bool:
    """What the handler costs."""
    sender = Sender("logging", 50_000, 10_000)
    result = measure(folder, [sender], environment)
    print(
        f"python {1e6 * result.senders[0] / sender.count:.1f} us of CPU a record in a program that logs by the handler"
    )
    return True


def main() -> int:
    """Run all; returns 1 if a record was lost that must not be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=20)
    parser.add_argument("--rate", type=float, default=50_000.0, help="records a second of all programs")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--flood", type=int, default=600_000, help="records of the program that floods")
    parser.add_argument("--only", choices=("rate", "flood", "python"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, NameServer() as server:
        environment = {**os.environ, "YARP_CONFIG_HOME": folder}
        configuration.write_place(server.contact, environment=environment)
        fine = []
        for name in ("rate", "flood", "python"):
            if options.only in (None, name):
                place = Path(folder, name)
                place.mkdir()
                if name == "rate":
                    fine.append(rate(place, options.programs, options.rate, options.seconds, environment))
                elif name == "flood":
                    fine.append(flood(place, options.programs, options.flood, options.seconds, environment))
                else:
                    fine.append(python(place, environment))
    return 0 if all(fine) else 1


if __name__ == "__main__":
    sys.exit(main())
