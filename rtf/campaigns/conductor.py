"""The conductor of a campaign: it gives tasks to the backend, and puts results into the file.

It runs in one thread. Whatever dies, the file says what is done; a campaign that is begun again goes on from there.
"""

from __future__ import annotations

from concurrent.futures import Future, wait
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from rtf import clock
from rtf.campaigns.backends.backend import BackendLostError
from rtf.campaigns.designs import Sequential
from rtf.campaigns.store import ResultError, State
from rtf.campaigns.task_run import Job, Status, encode_job

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.campaigns.backends.backend import Backend
    from rtf.campaigns.campaign import Campaign
    from rtf.campaigns.designs import Design
    from rtf.campaigns.store import CampaignStore, Row
    from rtf.campaigns.task_run import TaskResult

#: Seconds between two looks at what was asked meanwhile, and at the display.
_LOOK = 0.25


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a campaign is: tasks in each state, what is running, and seconds until the end (None: not known)."""

    counts: Mapping[State, int]
    running: tuple[str, ...]
    robots: Mapping[str, str]  # real robots, and the task of each
    workers: str
    dashboard: str
    remaining: float | None
    stopping: bool


class Conductor:
    """Runs a campaign. ``lost`` is called when the backend is lost, and returns a new one, or raises."""

    def __init__(
        self,
        campaign: Campaign,
        design: Design,
        store: CampaignStore,
        backend: Backend,
        lost: Callable[[BackendLostError], Backend] | None = None,
    ) -> None:
        self._campaign = campaign
        self._design = design
        self._store = store
        self._backend = backend
        self._lost = lost
        self._running: dict[Future[bytes], Row] = {}
        self._ended: SimpleQueue[Future[bytes] | None] = SimpleQueue()  # None: somebody asked for something
        self._found: dict[str, bool | None] = {}
        self._began = clock.monotonic()
        self._finished = 0
        self.stopping = self._dropping = False

    def stop(self, *, drop: bool = False) -> None:
        """Begin no further task; ``drop`` ends those that are running, too. From any thread, or a signal handler."""
        self._dropping = self._dropping or drop
        self.stopping = True
        self._ended.put(None)

    def run(self, show: Callable[[Progress], None] = lambda _: None) -> None:
        """Run all tasks that the design wants, or until it is stopped. Raises HistoryError, and BackendLostError."""
        self._found = self._store.found()
        self._store.add(self._design.tasks(self._found))
        next_look = clock.Deadline.after(0.0)
        while True:
            try:
                if not self._turn():
                    return
            except BackendLostError as error:
                self._put_all_back()
                if self._lost is None or self.stopping:
                    raise
                self._backend = self._lost(error)
            if next_look.expired:
                next_look = clock.Deadline.after(_LOOK)
                show(self.progress())

    def progress(self) -> Progress:
        """Return how far it is."""
        counts = self._store.counts()
        left = counts.get(State.WAITING, 0) + counts.get(State.RUNNING, 0)
        taken = clock.monotonic() - self._began
        return Progress(
            counts=counts,
            running=tuple(row.task.described for row in self._running.values()),
            robots={row.task.real.name: row.task.described for row in self._running.values() if row.task.real},
            workers=self._backend.described,
            dashboard=self._backend.dashboard,
            remaining=taken / self._finished * left if self._finished else None,
            stopping=self.stopping,
        )

    def _turn(self) -> bool:
        """Put results into the file and note what comes next, at once; then give it out. Returns whether more runs."""
        done = self._wait() if self._running else []
        results = [(self._running[future], self._backend.result(future)) for future in done]
        with self._store.transaction():
            for row, result in results:
                self._settle(row, result)
            for future in done:
                del self._running[future]
            rows = [] if self.stopping else self._take()
        for row in rows:
            self._submit(row)
        if self._dropping and self._running:
            self._drop()
        return bool(self._running)

    def _wait(self) -> list[Future[bytes]]:
        """Wait for results, until it is time for the display; return those that are there."""
        found: list[Future[bytes] | None] = []
        try:
            found.append(self._ended.get(timeout=_LOOK))
            while True:
                found.append(self._ended.get_nowait())
        except Empty:
            return [future for future in found if future in self._running]  # others are of a backend that was lost

    def _take(self) -> list[Row]:
        """Return the tasks that the backend has room for; each real robot has one at a time."""
        simulated = sum(row.task.real is None for row in self._running.values())
        count = max(0, self._backend.slots - simulated)
        rows = self._store.take(count)
        if len(rows) < count and isinstance(self._design, Sequential):
            self._store.add(self._design.tasks(self._found))
            rows += self._store.take(count - len(rows))
        busy = {row.task.real.name for row in self._running.values() if row.task.real}
        for robot in self._campaign.real_robots:
            if robot not in busy:
                rows += self._store.take(1, robot)
        return rows

    def _submit(self, row: Row) -> None:
        task = row.task
        job = Job(task.key, task, self._campaign.files, self._campaign.file.timeout, row.attempts + 1)
        future = self._backend.submit(encode_job(job), task.robot if task.real else "")
        self._running[future] = row
        future.add_done_callback(self._ended.put)

    def _settle(self, row: Row, result: TaskResult) -> None:
        """Put the result of a task into the file."""
        status, detail = result.status, result.detail
        if status is Status.DONE:
            try:
                self._found[row.task.key] = self._store.finish(row, result.journal, result.seconds)
            except ResultError as error:
                status, detail = Status.KILLED, str(error)
            else:
                self._finished += 1
                return
        last = row.attempts + 1 >= self._campaign.file.attempts
        if status is Status.KILLED and row.task.real is None and not last:
            self._store.retry(row, detail)
            return
        states = {Status.BROKEN: State.BROKEN, Status.REFUSED: State.REFUSED, Status.BEGUN: State.LOST}
        killed = State.LOST if row.task.real is not None else State.KILLED
        self._store.fail(row, states.get(status, killed), detail)
        self._found[row.task.key] = None
        self._finished += 1

    def _drop(self) -> None:
        """End what is running. A simulated run waits again; one on a real robot is lost."""
        self._backend.drop()
        wait(self._running)
        self._put_all_back()

    def _put_all_back(self) -> None:
        with self._store.transaction():
            for row in self._running.values():
                if row.task.real is None:
                    self._store.put_back(row)
                else:
                    self._store.fail(row, State.LOST, "it was dropped, or its worker was lost, during the run")
        self._running.clear()
