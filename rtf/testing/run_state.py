"""The options and the state of a run, which its suite workers share."""

from __future__ import annotations

import threading
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from rtf.testing.dispatch import Dispatcher
from rtf.testing.isolation.attempt import GRACE, Limits
from rtf.testing.run_control import Control
from rtf.testing.suite.model import Isolation, Timeouts

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rtf.testing.broadcast import Broadcast
    from rtf.testing.events import PlanChanged
    from rtf.testing.isolation.launch import Launched
    from rtf.testing.results import RunResult
    from rtf.testing.suite.model import TestEntry, TestSuite

#: The default limit of a test in seconds, if neither suite, plug-in nor command line has one.
DEFAULT_LIMITS = Timeouts(setup=60.0, run=300.0, teardown=30.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """The options of a run beside its plan. Times in seconds, memory in bytes (0: no limit).

    After ``maxfail`` tests that did not pass no further test is started (0: no limit). ``device`` is the record of the
    device under test.

    ``grace`` is how long a test that is asked to stop may take to begin its teardown before it is killed. Through
    ``control`` people stop the run and answer its questions. Without ``plan_ahead`` a test is announced by a call of
    ``Run.plan``, and not before anything runs. ``terminal`` is the device at which tests are debugged, without limits;
    with ``core_dumps`` those of programs are kept.
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
    plan_ahead: bool = True
    control: Control = field(default_factory=Control)
    terminal: str = ""
    core_dumps: bool = False
    facts: Mapping[str, str] = field(default_factory=dict)


class RunState:
    """What holds for all tests of a run, and whether it goes on."""

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
        self._launched = launched
        self.emit = broadcast.emit
        broadcast.control = options.control

    @property
    def results(self) -> RunResult:
        """The results so far."""
        return self._broadcast.results

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
