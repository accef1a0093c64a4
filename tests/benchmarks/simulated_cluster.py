"""A cluster of many workers whose runs sleep: a scheduler, and workers that share two processes.

``python simulated_cluster.py SCHEDULER WORKERS`` is one of these processes: each worker has connections, heartbeats and
a thread of its own, as one of a real cluster has, but no process of its own, for which this machine is too small.
"""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
import zlib
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import psutil

from rtf import clock
from rtf.campaigns.backends.dask import DaskBackend
from rtf.campaigns.file import BackendTable
from rtf.campaigns.task_run import Job, Status, TaskResult

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Future

#: Processes that the workers share, and seconds until all of them have registered.
_PROCESSES, _START = 2, 60.0


def pretend(job: bytes, journal: bytes, key: str, seconds: float) -> bytes:
    """Sleep, and return a copy of the result of another run. Called in a worker."""
    clock.sleep(seconds)
    wanted = msgspec.msgpack.decode(job, type=Job).key
    packed = zlib.compress(zlib.decompress(journal).replace(key.encode(), wanted.encode()))
    return msgspec.msgpack.encode(TaskResult(Status.DONE, "", packed, seconds))


class SleepingBackend(DaskBackend):
    """A backend whose workers sleep instead of running a task."""

    def __init__(self, address: str, result: TaskResult, key: str, seconds: float) -> None:
        super().__init__(BackendTable(kind="dask", address=address))
        self._arguments = result.journal, key, seconds

    def submit(self, job: bytes, robot: str) -> Future[bytes]:
        if robot not in self._executors:
            self._executors[robot] = self._client.get_executor(pure=False, retries=0)
        return self._executors[robot].submit(pretend, job, *self._arguments)


@dataclass
class Cluster:
    """A running cluster: its address, and its processes."""

    address: str
    scheduler: psutil.Process
    workers: list[psutil.Process]

    def processor(self) -> tuple[float, float]:
        """Return the seconds of the processor that the scheduler, and the workers, have used."""
        seconds = [sum(one.cpu_times()[:2]) for one in (self.scheduler, *self.workers)]
        return seconds[0], sum(seconds[1:])


@contextmanager
def simulated_cluster(workers: int) -> Iterator[Cluster]:
    """Start a cluster of so many workers, and end it after the block."""
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
    words = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard"]
    shares = [workers // _PROCESSES + (number < workers % _PROCESSES) for number in range(_PROCESSES)]
    places = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    knowing = {**os.environ, "PYTHONPATH": os.pathsep.join(places)}  # a scheduler imports what workers call
    processes = [subprocess.Popen(words, stderr=subprocess.DEVNULL, env=knowing)]
    processes += [
        subprocess.Popen([sys.executable, __file__, address, str(share)], stderr=subprocess.DEVNULL)
        for share in shares
        if share
    ]
    try:
        _await_workers(address, workers)
        scheduler, *others = (psutil.Process(process.pid) for process in processes)
        yield Cluster(address, scheduler, others)
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait()


def _await_workers(address: str, workers: int) -> None:
    from distributed import Client

    with Client(address, timeout=_START, set_as_default=False) as client:
        client.wait_for_workers(workers, timeout=_START)


async def work(address: str, count: int) -> None:
    """Be so many workers, until this process is ended."""
    from distributed import Worker

    made = [Worker(address, nthreads=1, dashboard=False) for _ in range(count)]
    await asyncio.gather(*made)
    await asyncio.gather(*(worker.finished() for worker in made))


if __name__ == "__main__":
    import dask

    # What Dask measures of each worker is as much for a hundred workers in one process as for one.
    dask.config.set({"distributed.worker.profile.enabled": False, "distributed.admin.tick.interval": "1s"})
    asyncio.run(work(sys.argv[1], int(sys.argv[2])))
