"""The backend that runs tasks on this machine, each in a runner of its own.

The runner is the worker: one that is killed takes no other task with it. A thread waits for each.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from rtf.campaigns.backends.backend import Backend
from rtf.campaigns.task_run import TaskRun

if TYPE_CHECKING:
    from concurrent.futures import Future


class LocalBackend(Backend):
    """So many workers (0: one for each core), and one for each real robot, whose runs hardly use a processor."""

    def __init__(self, workers: int, robots: int = 0) -> None:
        self._workers = workers or os.cpu_count() or 1
        self._pool = ThreadPoolExecutor(self._workers + robots, "rtf-campaign")
        self._runs: set[TaskRun] = set()

    @property
    def slots(self) -> int:
        return self._workers

    @property
    def described(self) -> str:
        return f"{self._workers} local worker{'s' if self._workers != 1 else ''}"

    def submit(self, job: bytes, robot: str) -> Future[bytes]:  # noqa: ARG002 - the caller sees that it is free
        run = TaskRun(job)
        self._runs.add(run)
        future = self._pool.submit(run.result)
        future.add_done_callback(lambda _: self._runs.discard(run))
        return future

    def drop(self) -> None:
        for run in [*self._runs]:
            run.stop()

    def close(self) -> None:
        self._pool.shutdown()
