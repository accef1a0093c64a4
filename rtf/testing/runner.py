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
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import rtf
from rtf import clock
from rtf.testing.cases import planned_case
from rtf.testing.dispatch import Dispatcher, copies_of, groups_sharing_fixtures
from rtf.testing.events import (
    Diagnosed,
    InternalError,
    RunEnded,
    RunStarted,
    SuitePlanned,
    TestEnded,
    TestPlanned,
)
from rtf.testing.isolation.attempt import GRACE, Limits
from rtf.testing.plan import fingerprint
from rtf.testing.run_control import Control, alarm
from rtf.testing.secret_values import masked_command, masked_text
from rtf.testing.suite.model import Isolation, Timeouts
from rtf.testing.suite_worker import SuiteWorker
from rtf.testing.verdict import ExitCode, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from rtf.testing.broadcast import Broadcast
    from rtf.testing.events import PlanChanged
    from rtf.testing.isolation.launch import Launched
    from rtf.testing.results import RunResult
    from rtf.testing.suite.model import TestEntry, TestSuite

#: The default limit of a test in seconds, if neither suite, plug-in nor command line has one.
DEFAULT_LIMITS = Timeouts(setup=60.0, run=300.0, teardown=30.0)
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Seconds between two looks of the main thread at the suite workers; a signal handler runs between its waits only.
_LOOK = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """The options of a run beside its plan. Times in seconds, memory in bytes (0: no limit).

    After ``maxfail`` tests that did not pass no further test is started (0: no limit). ``device`` is the record of the
    device under test.

    ``grace`` is how long a test that is asked to stop may take to begin its teardown before it is killed. Through
    ``control`` people stop the run and answer its questions. ``conduct`` says, instead of the order of the plan, what
    the run's one suite worker does next. Without ``plan_ahead`` a test is announced by a call of :meth:`Run.plan`, and
    not before anything runs. ``terminal`` is the device at which tests are debugged, without limits; with
    ``core_dumps`` those of programs are kept.
    """

    run_folder: Path
    jobs: int = 1
    limits: Timeouts = DEFAULT_LIMITS
    run_timeout: float | None = None
    grace: float = GRACE
    memory: int = 0
    overrides: tuple[tuple[str, str], ...] = ()
    features: frozenset[str] = frozenset()
    isolation: Isolation | None = None
    repetition: int | None = None
    retries: int | None = None
    maxfail: int = 0
    allow_empty: bool = False
    done: frozenset[str] = frozenset()
    resumed: bool = False
    changes: PlanChanged | None = None
    robot: str = ""
    station: str = ""
    device: Mapping[str, str] = field(default_factory=dict)
    seed: int | None = None
    command: tuple[str, ...] = ()
    handle_signals: bool = True
    conduct: Callable[[SuiteWorker], None] | None = None
    plan_ahead: bool = True
    control: Control = field(default_factory=Control)
    terminal: str = ""
    core_dumps: bool = False
    facts: Mapping[str, str] = field(default_factory=dict)


class Run:
    """One run of a plan, from its first event to its last."""

    def __init__(
        self,
        suites: Sequence[TestSuite],
        options: RunOptions,
        broadcast: Broadcast,
        launched: Launched | None = None,
    ) -> None:
        self.suites = suites
        self.options = options
        self.control = options.control
        self.dispatcher = Dispatcher(suites, options.done)
        self._failures = 0
        self._lock = threading.Lock()
        self._broadcast = broadcast
        self._secrets = {name for suite in suites for test in suite.tests for name in test.spec.secrets}
        self._launched = launched
        self.emit = broadcast.emit
        broadcast.control = options.control

    @property
    def results(self) -> RunResult:
        """The results so far."""
        return self._broadcast.results

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
        groups = self._groups() if self.options.jobs > 1 and self.options.conduct is None else []
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
            conduct = self.options.conduct or SuiteWorker.run
            conduct(SuiteWorker(self, suites))
        except Exception as error:  # noqa: BLE001 - reported; the other suite workers go on
            self._broke(error)

    # What holds for a test ---------------------------------------------------------------------------------------

    def limits_of(self, suite: TestSuite, test: TestEntry) -> Limits:
        """Return the limits of a test: its own, its suite's, its author's, the command line's or the defaults."""
        if self.options.terminal:  # a person is debugging
            return Limits(setup=None, run=None, teardown=None, grace=self.options.grace)
        chosen = suite.timeouts_of(test).inherit(Timeouts(run=test.spec.timeout))
        chosen = chosen.inherit(self.options.limits).inherit(DEFAULT_LIMITS)
        return Limits(**asdict(chosen), grace=self.options.grace)

    def take_launched(self) -> Launched | None:
        """Return the fork server that was started before the run, for the first suite worker that asks."""
        with self._lock:
            launched, self._launched = self._launched, None
        return launched

    def repetition_of(self, entry: TestEntry) -> int:
        """Return the number of additional runs of the body."""
        return entry.repetition if self.options.repetition is None else self.options.repetition

    def retries_of(self, entry: TestEntry) -> int:
        """Return the number of additional attempts after a failure."""
        return entry.retries if self.options.retries is None else self.options.retries

    def stop_reason(self) -> str:
        """Return why no further test may be started, or an empty text."""
        if self.control.stage:
            self.control.announce(self.emit)
            return "the run was interrupted"
        if 0 < self.options.maxfail <= self._failures:
            return f"{self._failures} test{'s' if self._failures != 1 else ''} failed before (--maxfail)"
        return ""

    def count_failures(self, number: int) -> None:
        """Count tests that did not pass, for ``maxfail``. From any thread."""
        with self._lock:
            self._failures += number


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
