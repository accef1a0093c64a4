"""The runner: it decides what runs next, and what a collapse, a time-out or an interrupt does to the run.

A run has suite workers. Each suite worker is a thread with a fork server, a reactor and a supervisor of its own, and
works through suites that share a fixture, one after the other; without ``-j`` there is one suite worker, in the main
thread. A planned test always gets exactly one final :class:`~rtf.testing.events.TestEnded`, whatever happens to it, to
its fixtures or to the run.
"""

from __future__ import annotations

import contextlib
import getpass
import os
import platform
import signal
import sys
import threading
import traceback
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TYPE_CHECKING

import rtf
from rtf import clock
from rtf.testing.attempts import Attempts
from rtf.testing.cases import planned_case
from rtf.testing.dispatch import copies_of, groups_sharing_fixtures
from rtf.testing.events import (
    Diagnosed,
    InternalError,
    RunEnded,
    RunStarted,
    SuitePlanned,
    TestEnded,
    TestPlanned,
)
from rtf.testing.plan import fingerprint
from rtf.testing.run_control import alarm
from rtf.testing.run_state import RunOptions, RunState
from rtf.testing.secret_values import masked_command, masked_text
from rtf.testing.suite_worker import SuiteWorker
from rtf.testing.verdict import ExitCode, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rtf.testing.broadcast import Broadcast
    from rtf.testing.isolation.launch import Launched
    from rtf.testing.suite.model import TestEntry, TestSuite

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Seconds between two looks of the main thread at the suite workers; a signal handler runs between its waits only.
_LOOK = 0.2


class Run(RunState):
    """One run of a plan, from its first event to its last.

    ``conduct`` says, instead of the order of the plan, what the run's one suite worker does next.
    """

    def __init__(
        self,
        suites: Sequence[TestSuite],
        options: RunOptions,
        broadcast: Broadcast,
        launched: Launched | None = None,
        conduct: Callable[[SuiteWorker], None] | None = None,
    ) -> None:
        super().__init__(suites, options, broadcast, launched)
        self._conduct = conduct
        self._secrets = {name for suite in suites for test in suite.tests for name in test.spec.secrets}

    def execute(self, diagnostics: Iterable[Diagnosed] = ()) -> ExitCode:
        """Run everything, tear everything down, report everything. Returns the exit code."""
        began = clock.monotonic()
        options = self.options
        with self._signals():
            try:
                with alarm(options.run_timeout, self._overdue):
                    self._begin(diagnostics)
                    self._run_workers()
            except Exception as error:  # noqa: BLE001 - reported, and everything else still ends in order
                self._broke(error)
            finally:
                code = self._end(began)
        return code

    def _overdue(self) -> None:
        self.control.request(f"time-out of the run after {self.options.run_timeout:g} s", stage=2)

    # Beginning and end -------------------------------------------------------------------------------------------

    def _begin(self, diagnostics: Iterable[Diagnosed]) -> None:
        options = self.options
        self.emit(
            RunStarted(
                run=options.run_folder.name,
                version=rtf.__version__,
                command=masked_command(options.command, self._secrets),
                environment={**_facts(), **options.facts},
                robot=options.robot,
                station=options.station or platform.node(),
                device=dict(options.device),
                seed=options.seed,
                resumed=options.resumed,
            ),
        )
        if options.changes is not None:
            self.emit(options.changes)
        for diagnosed in diagnostics:
            self.emit(diagnosed)
        if options.plan_ahead:
            for suite in self.suites:
                self.plan(suite)

    def plan(self, suite: TestSuite) -> None:
        """Emit the plan of a suite and its tests, unless that was done before."""
        known = self._broadcast.results
        if suite.id not in known.suites:
            self._plan_suite(suite)
        for test in suite.tests:
            if test.id not in known.tests:
                self._plan_test(suite, test)
            for case, name in test.cases:
                if case not in known.tests:
                    self.emit(planned_case(known.tests[test.id].planned, case, name))

    def _plan_suite(self, suite: TestSuite) -> None:
        self.emit(
            SuitePlanned(
                suite=suite.id,
                name=suite.name,
                file=suite.file,
                description=suite.description,
                environment=suite.environment,
                fixtures=tuple(entry.name for entry in suite.fixtures),
                tags=suite.tags,
            ),
        )

    def _plan_test(self, suite: TestSuite, entry: TestEntry) -> None:
        self.emit(
            TestPlanned(
                test=entry.id,
                suite=suite.id,
                name=entry.name,
                plugin=entry.plugin,
                type=entry.type or "",
                param=masked_text(entry.param, self._secrets),
                tags=entry.tags,
                file=entry.location.file,
                line=entry.location.line,
                repetition=self.repetition_of(entry),
                retries=self.retries_of(entry),
                expected=entry.expected,
                run_timeout=self.limits_of(suite, entry).run,
                fingerprint=fingerprint(suite, entry),
                cases=tuple(case for case, _ in entry.cases),
            ),
        )

    def _end(self, began: float) -> ExitCode:
        self.control.announce(self.emit)
        self._account_for_all()
        self._broadcast.flush(lambda: self.control.count)
        code = self._say_end(began)
        self._broadcast.close_reporters(lambda: self.control.count)
        if self._exit_code() is not code:  # a reporter broke while it was finishing
            code = self._say_end(began)
        self._broadcast.close()
        return code if code is ExitCode.INTERNAL else self._exit_code()

    def _say_end(self, began: float) -> ExitCode:
        code = self._exit_code()
        results = self._broadcast.results
        self.emit(
            RunEnded(
                verdict=results.verdict(allow_empty=self.options.allow_empty),
                exit_code=int(code),
                duration=clock.monotonic() - began,
                counts={str(verdict): count for verdict, count in results.counts().items()},
            ),
        )
        return code

    def _exit_code(self) -> ExitCode:
        return self._broadcast.results.exit_code(allow_empty=self.options.allow_empty)

    def _account_for_all(self) -> None:
        """Emit a final end for each planned test that has none."""
        for test in [*self._broadcast.results.tests.values()]:
            if test.verdict is None:
                verdict = Verdict.NOT_RUN
                detail = "the run was interrupted" if self.control.stage else "the run ended before it"
                self.emit(
                    TestEnded(
                        test=test.id, verdict=verdict, outcome=verdict, attempt=0, reason="not run", detail=detail
                    ),
                )

    def _broke(self, error: Exception) -> None:
        text = f"{type(error).__name__}: {error}"
        self.emit(InternalError(text=text, traceback="".join(traceback.format_exception(error))))

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        """Handle signals in the block: those that are not ignored, in the main thread, if the run may have them."""
        in_main = threading.current_thread() is threading.main_thread()
        wanted = _SIGNALS if self.options.handle_signals and in_main else ()
        before = {signum: signal.getsignal(signum) for signum in wanted}
        taken = [signum for signum, handler in before.items() if handler is not signal.SIG_IGN]
        for signum in taken:
            signal.signal(signum, lambda number, _frame: self.control.signalled(number))
        try:
            yield
        finally:
            for signum in taken:
                signal.signal(signum, before[signum])

    # Suite workers ----------------------------------------------------------------------------------------------------

    def _run_workers(self) -> None:
        groups = self._groups() if self.options.jobs > 1 and self._conduct is None else []
        if len(groups) <= 1:
            self._run_worker(self.suites)
            return
        with ThreadPoolExecutor(self.options.jobs, "rtf-worker") as pool:
            running = [pool.submit(self._run_worker, group) for group in groups]
            while wait(running, timeout=_LOOK).not_done:
                continue

    def _groups(self) -> list[list[TestSuite]]:
        """Return groups that may run at the same time: suites with a common fixture are one, copies of a suite many."""
        groups = []
        for suites in groups_sharing_fixtures(self.suites):
            copies = copies_of(suites[0], self.options.jobs) if len(suites) == 1 else []
            if any(suite.copies > 1 for suite in suites) and len(copies) <= 1:
                self._say_no_copies(suites)
            groups += [[copy] for copy in copies] or [suites]
        return groups

    def _say_no_copies(self, suites: list[TestSuite]) -> None:
        for suite in suites:
            if suite.copies > 1 and len(suite.tests) > 1:
                text = "copies has no effect: a fixture of its tests exists only once, or is used by another suite"
                hint = "write ${copy} in the param of each fixture, such as --namespace /bench${copy}"
                self.emit(Diagnosed(severity=Severity.WARNING, text=text, hint=hint, suite=suite.id, file=suite.file))

    def _run_worker(self, suites: Sequence[TestSuite]) -> None:
        try:
            worker = SuiteWorker(self, suites)
            if self._conduct is not None:
                self._conduct(worker)
            else:
                self._run_suites(worker, suites)
        except Exception as error:  # noqa: BLE001 - reported; the other suite workers go on
            self._broke(error)

    def _run_suites(self, worker: SuiteWorker, suites: Sequence[TestSuite]) -> None:
        """Run suites; afterwards all processes of the suite worker are gone."""
        done = self.options.done
        with worker.at_work():
            for index, suite in enumerate(suites):
                if suite.tests and all(test.id in done for test in suite.tests):
                    worker.end_suite(suite, 0.0)
                elif not suite.tests or not self.dispatcher.is_empty(suite.id):
                    with worker.suite(suite, suites[index + 1 :]):
                        self._run_tests(worker, suite)

    def _run_tests(self, worker: SuiteWorker, suite: TestSuite) -> None:
        """Run the tests of a suite that no other worker runs."""
        tests = {test.id: test for test in suite.tests}
        while not self.dispatcher.is_empty(suite.id):
            taken = self.dispatcher.take(suite.id, stopping=bool(worker.stop_reason()))
            if not taken:
                worker.supervisor.watch()
                worker.reactor.run_once(worker.next_tick())
                continue
            try:
                self.run_test(worker, tests[taken])
            finally:
                self.dispatcher.ended(suite.id, taken)

    def run_test(self, worker: SuiteWorker, test: TestEntry) -> None:
        """Run a test of the worker's suite, up to its final end."""
        self.count_failures(Attempts(worker, test).run())


def most_memory() -> int:
    """Return the default limit of a test's private memory in bytes: three quarters of the machine's."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") * 3 // 4


def _facts() -> dict[str, str]:
    """Return the facts of the run: its machine, user and software."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = str(os.getuid())
    return {
        "host": platform.node(),
        "user": user,
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "executable": sys.executable,
        "folder": str(Path.cwd()),
    }
