"""What a campaign costs beyond its runs: overhead of a task, throughput, and memory of the client.

``python tests/benchmarks/run_campaign_benchmarks.py --rounds 5 --runs 20 --results 10000``

Runs of a trivial test are made by hand, one runner after the other, and by a campaign with one worker, in turn; the
overhead is the median of the differences. What the client itself uses of the processor does not depend on what else the
machine does. Memory is that of a client which takes in so many results; these are copies of the result of one real run,
because ten thousand real ones take an hour and change nothing for the client.

``--scaling 1,8,64,256 --sleep 4`` runs a campaign on a simulated cluster instead: of so many workers, whose runs sleep.
The efficiency is the share of the workers' time in which they sleep. With few workers fewer tasks are run, or it would
take hours.
"""

from __future__ import annotations

import argparse
import math
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import zlib
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from measuring import TESTRUNNER, TRIVIAL

from rtf import clock
from rtf.campaigns.backends.backend import Backend
from rtf.campaigns.backends.dask import DaskBackend
from rtf.campaigns.backends.local import LocalBackend
from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.conductor import Conductor
from rtf.campaigns.designs import make_design
from rtf.campaigns.file import BackendTable
from rtf.campaigns.store import CampaignStore, State
from rtf.campaigns.task_run import Job, Status, TaskResult, decode_result, encode_job, run_task

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

#: What is wanted: seconds a task, the share of two runners' throughput, and bytes.
LOCAL, CLUSTER, THROUGHPUT, MEMORY = 0.030, 0.060, 0.9, 300 << 20
#: Runs for each worker of a simulated cluster, if these are not more than are asked for.
_WAVES = 25
_SUITE = '<suite name="campaign"><test name="trivial" timeout="60">trivial.py</test></suite>'


@dataclass
class Taken:
    """Seconds by the clock, of the processor in this process, and in the runners that it has started."""

    clock: float
    processor: float
    runners: float

    @property
    def whole(self) -> float:
        """Seconds of the processor altogether."""
        return self.processor + self.runners


class Stopwatch:
    """Measures from its making."""

    def __init__(self) -> None:
        self._began, self._own, self._runners = clock.monotonic(), _used(resource.RUSAGE_SELF), _used(_CHILDREN)

    def taken(self) -> Taken:
        """Return what was taken since then."""
        return Taken(
            clock.monotonic() - self._began, _used(resource.RUSAGE_SELF) - self._own, _used(_CHILDREN) - self._runners
        )


_CHILDREN = resource.RUSAGE_CHILDREN


def _used(who: int) -> float:
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 0 in any case, because a busy machine says nothing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=1, help="comparisons; the median counts")
    parser.add_argument("--runs", type=int, default=4, help="runs of each side of a comparison")
    parser.add_argument("--results", type=int, default=200, help="results that the client takes in")
    parser.add_argument("--memory", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--scaling", metavar="N,...", help="only measure clusters of so many workers")
    parser.add_argument("--sleep", type=float, default=4.0, help="seconds of a run there")
    parser.add_argument("--tasks", type=int, default=2000, help="runs there, at most")
    options = parser.parse_args(arguments)
    if options.scaling:
        for workers in map(int, options.scaling.split(",")):
            measure_scaling(workers, min(options.tasks, _WAVES * workers), options.sleep)
        return 0
    if options.memory:
        print(take_in(options.memory, options.results))
        return 0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "trivial.py").write_text(TRIVIAL)
        (folder / "suite.xml").write_text(_SUITE)
        measure_overhead(folder, options.rounds, options.runs)
        measure_throughput(folder, options.rounds, options.runs)
        measure_memory(folder, options.results)
    return 0


def measure_overhead(folder: Path, rounds: int, runs: int) -> None:
    """Print the overhead of a task with one worker."""
    cluster = BackendTable(kind="dask", workers=1)
    backends: dict[str, tuple[Callable[[], Backend], float]] = {
        "local": (lambda: LocalBackend(1), LOCAL),
        "LocalCluster": (lambda: DaskBackend(cluster), CLUSTER),
    }
    for name, (make, wanted) in backends.items():
        backend = make()
        try:
            run_campaign(folder, backend, 1)  # everything is imported
            pairs = [(by_hand(folder, runs, 1), run_campaign(folder, backend, runs)) for _ in range(rounds)]
        finally:
            backend.close()
        over = statistics.median(campaign.clock - hand.clock for hand, campaign in pairs) / runs
        processor = statistics.median(campaign.processor for _, campaign in pairs) / runs
        print(
            f"a task on {name}: {1e3 * over:.0f} ms over the run itself (wanted: {1e3 * wanted:.0f} ms), "
            f"{1e3 * processor:.1f} ms of the processor in the client"
        )
        if name == "local":  # whose runners are children of this process
            more = statistics.median(campaign.whole - hand.whole for hand, campaign in pairs) / runs
            run = statistics.median(hand.whole for hand, _ in pairs) / runs
            print(f"  by the processor: {1e3 * more:.0f} ms over the run's {1e3 * run:.0f} ms")


def measure_throughput(folder: Path, rounds: int, runs: int) -> None:
    """Print the throughput of two workers, as a share of that of two runners started by hand."""
    backend = LocalBackend(2)
    try:
        shares = [by_hand(folder, runs, 2).clock / run_campaign(folder, backend, runs).clock for _ in range(rounds)]
    finally:
        backend.close()
    print(f"throughput of two workers: {statistics.median(shares):.2f} of two runners' (wanted: {THROUGHPUT})")


def by_hand(folder: Path, runs: int, workers: int) -> Taken:
    """Return what so many runs took, by so many shells that start one runner after the other."""

    def one(number: int) -> None:
        words = [*TESTRUNNER, "--suite", "suite.xml", "--run-folder", f"run-{number}-{clock.monotonic()}"]
        words += [
            "--no-config",
            "--no-output",
            "--quiet",
            "--no-summary",
            "--answer",
            "default",
            "--run-timeout",
            "180",
        ]
        subprocess.run(words, cwd=folder, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)

    watch = Stopwatch()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(one, range(runs)))
    return watch.taken()


def run_campaign(folder: Path, backend: Backend, runs: int) -> Taken:
    """Run a campaign of so many runs, and return what it took."""
    file = folder / "campaign.toml"
    file.write_text(f'schema = 1\nname = "bench"\nseeds = {runs}\n[[tests]]\nname = "trivial.py"\n')
    campaign = load_campaign(file)
    state = folder / "campaign.sqlite"
    with CampaignStore(state, create=True, exclusive=True) as store:
        store.begin()
        watch = Stopwatch()
        Conductor(campaign, make_design(campaign), store, backend).run()
        taken = watch.taken()
        assert store.counts() == {State.DONE: runs}, store.endings()[:1]
    for path in folder.glob("campaign.sqlite*"):
        path.unlink()
    return taken


# Memory --------------------------------------------------------------------------------------------------------------


class Copies(Backend):
    """Answers each job at once with a copy of one result."""

    def __init__(self, journal: bytes, key: str) -> None:
        self._journal, self._key = journal, key.encode()

    @property
    def slots(self) -> int:
        return 64

    @property
    def described(self) -> str:
        return "copies of one result"

    def submit(self, job: bytes, robot: str) -> Future[bytes]:
        key = msgspec.msgpack.decode(job, type=Job).key.encode()
        future: Future[bytes] = Future()
        packed = zlib.compress(self._journal.replace(self._key, key))
        future.set_result(msgspec.msgpack.encode(TaskResult(Status.DONE, "", packed, 0.2)))
        return future

    def drop(self) -> None:
        pass

    def close(self) -> None:
        pass


def one_result(folder: Path) -> tuple[TaskResult, str]:
    """Return the result of a real run, and the key of its task."""
    file = folder / "campaign.toml"
    file.write_text('schema = 1\nname = "bench"\nseeds = 1\n[[tests]]\nname = "trivial.py"\n')
    campaign = load_campaign(file)
    task = next(iter(make_design(campaign).tasks({})))
    return decode_result(run_task(encode_job(Job(task.key, task, campaign.files, 60.0)))), task.key


def take_in(folder: Path, results: int) -> str:
    """Take in so many results, and return the figures of this process."""
    result, key = one_result(folder)
    taken = run_campaign(folder, Copies(zlib.decompress(result.journal), key), results)
    # Not that of getrusage: it begins with what the process had that has started this one.
    (peak,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text(encoding="ascii"))
    return (
        f"{results} results: {int(peak) / 1024:.0f} MiB at most in the client (wanted: {MEMORY >> 20} MiB), "
        f"{1e3 * taken.processor / results:.1f} ms of the processor for each"
    )


def measure_memory(folder: Path, results: int) -> None:
    """Print the memory of a client in a process of its own."""
    words = [sys.executable, __file__, "--memory", str(folder), "--results", str(results)]
    print(subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout.strip())


# Scaling -------------------------------------------------------------------------------------------------------------


def measure_scaling(workers: int, tasks: int, seconds: float) -> None:
    """Print how well a cluster of so many workers is used, whose runs sleep for so long."""
    from simulated_cluster import SleepingBackend, simulated_cluster

    with tempfile.TemporaryDirectory() as place, simulated_cluster(workers) as cluster:
        folder = Path(place)
        (folder / "trivial.py").write_text(TRIVIAL)
        backend = SleepingBackend(cluster.address, *one_result(folder), seconds)
        before = cluster.processor()
        try:
            taken = run_campaign(folder, backend, tasks)
        finally:
            backend.close()
        scheduler, others = (after - first for after, first in zip(cluster.processor(), before, strict=True))
    least = math.ceil(tasks / workers) * seconds  # the last wave may be a part of one
    print(
        f"{workers} workers, {tasks} runs of {seconds:g} s: {taken.clock:.1f} s, efficiency "
        f"{tasks * seconds / workers / taken.clock:.3f} (of {tasks * seconds / workers / least:.3f}); a run costs "
        f"{1e3 * taken.processor / tasks:.1f} ms of the processor in the client, {1e3 * scheduler / tasks:.1f} ms in "
        f"the scheduler, {1e3 * others / tasks:.1f} ms in the workers"
    )


if __name__ == "__main__":
    sys.exit(main())
