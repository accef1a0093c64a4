"""Has the runner run one test at a time, when pytest asks for it, in a thread of its own.

The thread is there because fixtures are watched over also while pytest is busy with something else, and because
Ctrl-C, or a time-out of pytest, then strikes where it may: pytest's thread only waits, and hands on what struck it.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Generic, TypeVar

from rtf.testing.attempts import Attempts
from rtf.testing.run_control import KILL_STAGE, NOW_STAGE
from rtf.testing.runner import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.testing.broadcast import Broadcast
    from rtf.testing.events import Diagnosed
    from rtf.testing.run_state import RunOptions
    from rtf.testing.suite.model import TestEntry, TestSuite
    from rtf.testing.suite_worker import SuiteWorker

_T = TypeVar("_T")


class RunOverError(RuntimeError):
    """The run was aborted by an error, which the journal and the summary report."""


@dataclass(slots=True)
class _Order(Generic[_T]):
    """A call to be executed in the thread of the run."""

    work: Callable[[SuiteWorker], _T]
    result: _T | None = None
    error: BaseException | None = None
    done: threading.Event = field(default_factory=threading.Event)

    def carry_out(self, worker: SuiteWorker) -> None:
        try:
            self.result = self.work(worker)
        except BaseException as error:  # noqa: BLE001 - raised by who waits for it
            self.error = error


class Conductor:
    """One run, from :meth:`start` to :meth:`close`. All methods are called by pytest's thread.

    What happened to that thread while something was being done is raised when it is done, or has been cut short.
    """

    def __init__(
        self,
        suites: Sequence[TestSuite],
        options: RunOptions,
        broadcast: Broadcast,
        diagnostics: Sequence[Diagnosed],
    ) -> None:
        self._run = Run(suites, replace(options, handle_signals=False), broadcast, conduct=self._conduct)
        self._diagnostics = diagnostics
        self._lock = threading.Lock()
        self._worker: SuiteWorker | None = None
        self._order: _Order[object] | None = None
        self._closing = False
        self._over = False
        self._suite = ExitStack()
        self._thread = threading.Thread(target=self._execute, name="rtf-run", daemon=True)

    def start(self) -> None:
        """Start the run."""
        self._thread.start()

    def begin_suite(self, suite: TestSuite) -> None:
        """Prepare the run for tests of a suite."""

        def work(worker: SuiteWorker) -> None:
            self._run.plan(replace(suite, tests=()))
            self._suite.enter_context(worker.suite(suite))

        self._have_done(work)

    def end_suite(self) -> None:
        """Tear down the fixtures of the present suite."""
        self._have_done(lambda _worker: self._suite.close())

    def bring_up(self, suite: TestSuite, test: TestEntry) -> bool:
        """Start the fixtures of a test.

        Returns False if the test cannot be started; :meth:`run` then reports the reason.
        """

        def work(worker: SuiteWorker) -> bool:
            self._run.plan(replace(suite, tests=(test,)))
            return Attempts(worker, test).bring_up()

        return self._have_done(work)

    def run(self, test: TestEntry) -> None:
        """Run a test to its final verdict, retries included."""
        self._have_done(lambda worker: self._run.run_test(worker, test))

    @property
    def interrupted(self) -> bool:
        """Whether the run was asked to stop, for example at the live page."""
        return self._run.control.stage > 0

    def close(self) -> None:
        """End the run: tear down fixtures, close the journal, write reports. May be called repeatedly."""
        with self._lock:
            self._closing = True
            self._wake()
        problem: BaseException | None = None
        while self._thread.is_alive():
            try:
                self._thread.join()
            except BaseException as error:  # noqa: BLE001 - raised below
                problem = problem or error
                self._cut_short(error)
        if problem is not None:
            raise problem

    # pytest's thread ---------------------------------------------------------------------------------------------

    def _have_done(self, work: Callable[[SuiteWorker], _T]) -> _T:
        order = _Order(work)
        problem: BaseException | None = None
        with self._lock:
            if self._over:
                raise RunOverError("the run of the robot tests broke and is over; the summary says why")
            self._order = order  # type: ignore[assignment]  # whatever it gives back
            self._wake()
        while not order.done.is_set():
            try:
                order.done.wait()
            except BaseException as error:  # noqa: BLE001 - raised below
                problem = problem or error
                self._cut_short(error)
        if problem is not None or order.error is not None:
            raise problem or order.error  # type: ignore[misc]  # one of them is
        return order.result  # type: ignore[return-value]  # there is one, if there was no error

    def _wake(self) -> None:
        if self._worker is not None and not self._over:
            self._worker.wake()

    def _cut_short(self, error: BaseException) -> None:
        """Ctrl-C ends the run at once, as in pytest, and pressed again kills; anything else ends the running test."""
        control = self._run.control
        if isinstance(error, KeyboardInterrupt):
            control.request("SIGINT", stage=NOW_STAGE if control.stage < NOW_STAGE else KILL_STAGE)
            return
        with self._lock:
            if self._order is not None and self._worker is not None:
                self._worker.abort(f"{type(error).__name__}: {error}")

    # The run's thread --------------------------------------------------------------------------------------------

    def _execute(self) -> None:
        try:
            self._run.execute(self._diagnostics)
        finally:
            with self._lock:
                self._over = True
                order, self._order = self._order, None
            if order is not None:
                order.error = RunOverError("the run of the robot tests broke; the summary says why")
                order.done.set()

    def _conduct(self, worker: SuiteWorker) -> None:
        with worker.at_work(), self._suite:
            self._worker = worker
            try:
                while True:
                    worker.wait(lambda: self._order is not None or self._closing)
                    if self._order is None:
                        return
                    self._carry_out(self._order, worker)
            finally:
                with self._lock:
                    self._worker = None  # what wakes it is about to be closed

    def _carry_out(self, order: _Order[object], worker: SuiteWorker) -> None:
        order.carry_out(worker)
        with self._lock:
            self._order = None
            worker.abort("")
        order.done.set()
