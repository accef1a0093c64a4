"""The process in which one test runs. It sends events and nothing else.

A worker is forked from the fork server or from a plug-in server, waits for a job on its socket, does it, reports that
it is finished and ends. The result that it reports is only a claim: the runner decides the verdict, because it also
knows how the process ended.
"""

from __future__ import annotations

import faulthandler
import importlib
import os
import select
import signal
import sys
from _thread import allocate_lock  # ``threading`` has hooks that cost each fork, see docs/decisions/0010
from collections import deque
from typing import TYPE_CHECKING, NoReturn

from msgspec.structs import asdict

from rtf import clock
from rtf.testing import plugins
from rtf.testing.case import TestCase
from rtf.testing.events import Measured, ParametersResolved
from rtf.testing.isolation import messages
from rtf.testing.isolation.messages import (
    DUMP_SIGNAL,
    NUDGE_SIGNAL,
    STOP_SIGNAL,
    Answer,
    Command,
    Finished,
    Frames,
    Inspect,
    Job,
)
from rtf.testing.isolation.processes import DUMP_FD
from rtf.testing.measurement import require_limits, wilson_interval
from rtf.testing.plugin_makers import test_maker
from rtf.testing.plugin_spec import may_move
from rtf.testing.session import Session, text_of
from rtf.testing.verdict import Phase, Severity, TestProblem, TestStopped

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    import msgspec

    from rtf.testing.plugins import PluginRef

#: What every test imports; loaded once in the fork server, because in each test it would take a hundred times as long
#: as the fork itself.
_WARM = (
    "importlib.machinery",
    "importlib.util",
    "random",
    "rtf.testing.fixture",
    "rtf.testing.languages.legacy_python",
    "rtf.testing.parameters",
)
_CHUNK = 1 << 16

_session: Session | None = None

#: In a plug-in server and its children: what makes the tests of the file that is loaded.
_makers: dict[PluginRef, Callable[[], TestCase]] = {}


def prepare() -> None:
    """Set up, once in the fork server, what every worker inherits: modules, the stop signal, and stack dumps."""
    for module in _WARM:
        importlib.import_module(module)
    signal.signal(STOP_SIGNAL, _on_stop)
    signal.signal(NUDGE_SIGNAL, _on_nudge)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    faulthandler.enable(file=DUMP_FD, all_threads=True)
    faulthandler.register(DUMP_SIGNAL, file=DUMP_FD, all_threads=True, chain=False)
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(line_buffering=True)  # type: ignore[union-attr]


def _on_stop(_signum: int, _frame: FrameType | None) -> None:
    if _session is not None:
        _session.stop("stopped by the runner")


def _on_nudge(_signum: int, _frame: FrameType | None) -> None:
    """Do nothing: the signal only wakes the process, see ``NUDGE_SIGNAL``."""


class Channel:
    """A child's end of the socket to its runner. Any thread may send; one receives."""

    def __init__(self, descriptor: int) -> None:
        #: Called when the runner is gone: a test ends; a fixture still has something to tear down.
        self.on_lost: Callable[[], object] = _end_without_runner
        self._descriptor = descriptor
        self._frames = Frames()
        self._received: deque[Job | Inspect | Answer | Command] = deque()
        self._lock = allocate_lock()

    def send(self, message: msgspec.Struct) -> None:
        """Send one message, or event, whole."""
        data = messages.pack(message)
        try:
            with self._lock:
                sent = os.write(self._descriptor, data)
                while sent < len(data):
                    data = data[sent:]
                    sent = os.write(self._descriptor, data)
        except OSError:
            self.on_lost()

    def receive(self, timeout: float | None = None) -> Job | Inspect | Answer | Command | None:
        """Return one message; None if none came in ``timeout`` seconds (None: for ever), or if the runner is gone."""
        while not self._received:
            if timeout is not None and not select.select([self._descriptor], [], [], timeout)[0]:
                return None
            try:
                data = os.read(self._descriptor, _CHUNK)
            except ConnectionError:
                data = b""
            if not data:
                self.on_lost()
                return None
            self._received.extend(map(messages.to_child, self._frames.feed(data)))
        return self._received.popleft()

    def receive_answer(self, timeout: float) -> tuple[str, str | None, str] | None:
        """Return the answer to a question: its id, the answer, and its source."""
        received = self.receive(timeout)
        return (received.question, received.answer, received.source) if isinstance(received, Answer) else None


def _end_without_runner() -> NoReturn:
    os._exit(messages.CUT_OFF)


def work(job: Job, channel: Channel) -> None:
    """Do one attempt at a test, and report that it is finished."""
    global _session  # noqa: PLW0603 - a signal handler has no other way to reach it
    session = Session(
        job.id,
        channel.send,
        folder=job.folder,
        run_folder=job.run_folder,
        receive=channel.receive_answer if job.can_ask else None,
    )
    _session = session
    os.environ["RTF_RUN_FOLDER"] = job.run_folder  # for what a test and its fixtures leave for one another
    if job.variables:  # an update with nothing costs a fork 50 pages
        os.environ.update(job.variables)
    session.core_dumps = job.core_dumps
    if job.terminal:
        from rtf.testing.isolation import debugger

        debugger.take_terminal(job.terminal)
        session.examine = debugger.examine
    outcome = run_test(job, session)
    _session = None
    channel.send(outcome)
    sys.stdout.flush()
    sys.stderr.flush()


def load_plugin(ref: PluginRef) -> None:
    """Load a test's file for all the tests that will be forked from this process; raises what the file raises."""
    from rtf.testing.parameters import Declared

    maker = _makers[ref] = test_maker(ref)
    plugins.share_module(ref)
    if isinstance(maker, type) and issubclass(maker, Declared):
        maker.declarations()  # which looks at everything in the class, once


def run_test(job: Job, session: Session) -> Finished:
    """Carry out one attempt at a test and return its result."""
    made: list[TestCase] = []
    _step(session, Phase.LOAD, lambda: made.append(_load(job, session)))
    if made and not session.tally.errors:
        _life(made[0], job, session)
    return _conclusion(session)


def _load(job: Job, session: Session) -> TestCase:
    case = (_makers.get(job.plugin) or test_maker(job.plugin))()
    case.attach_to(session, job.use.environment)
    session.cases = job.cases
    require_limits(timeout=case.timeout)
    case.take_fixture_values(job.values)
    rows = case.resolve_parameters(**asdict(job.use))
    for warning in case.parameter_warnings:
        session.message(Severity.WARNING, "parameters", warning, ("", 0))
    if rows:
        session.emit(ParametersResolved(test=job.id, parameters=tuple(rows)))
    if case.name:
        case.rename(case.name, case.description)
    return case


def _life(case: TestCase, job: Job, session: Session) -> None:
    cls = type(case)
    fine = cls.setup is TestCase.setup or _step(session, Phase.SETUP, lambda: _set_up(case), announce=True)
    if fine and not session.stopped:
        if job.repetition:
            _repeat(case, job, session)
        else:
            _step(session, Phase.RUN, case.run, announce=True)
    if cls.teardown is not TestCase.teardown:
        _step(session, Phase.TEARDOWN, case.teardown, announce=True)
    stack = case.cleanup_stack()
    if stack:
        session.enter(Phase.CLEANUP)
    while stack:
        function, args, kwargs = stack.pop()
        _step(session, Phase.CLEANUP, lambda f=function, a=args, k=kwargs: f(*a, **k))  # type: ignore[misc]


def _set_up(case: TestCase) -> None:
    if case.setup() is False:
        raise TestProblem("", title="setup() failed!")


def _repeat(case: TestCase, job: Job, session: Session) -> None:
    total = job.repetition + 1
    passed = 0
    durations = []
    for count in range(1, total + 1):
        session.enter(Phase.RUN, count)
        began = clock.monotonic()
        before = _bad(session)

        def body(count: int = count) -> None:
            with session.part(f"repetition {count}/{total}"):
                case.run()

        _step(session, Phase.RUN, body)
        durations.append(clock.monotonic() - began)
        bad = _bad(session) > before
        passed += not bad and not session.stopped
        if session.stopped:
            break
        if bad and count < total and may_move(getattr(case, "safety", "")):
            text = f"{total - count} left out: it moves something, and what has gone wrong is not to be made worse"
            session.message(Severity.WARNING, "repetitions", text, ("", 0))
            break
    _report_repetitions(session, passed, durations)


def _bad(session: Session) -> int:
    return session.tally.failures + session.tally.errors + session.bad_cases


def _report_repetitions(session: Session, passed: int, durations: list[float]) -> None:
    from statistics import median

    ran = len(durations)
    low, high = wilson_interval(passed, ran)
    figures = {"min": min(durations), "median": median(durations), "max": max(durations)}
    session.message(
        Severity.INFO,
        "repetitions",
        f"{passed} of {ran} passed, {100 * passed / ran:.4g}% (95% confidence {100 * low:.3g}% to {100 * high:.3g}%); "
        + ", ".join(f"{name} {value:.4g} s" for name, value in figures.items()),
        ("", 0),
    )
    rows = {"repetition pass rate": (100 * passed / ran, "%"), "repetitions": (float(ran), "count")}
    rows |= {f"repetition duration {name}": (value, "s") for name, value in figures.items()}
    for name, (value, symbol) in rows.items():
        session.emit(Measured(test=session.test, name=name, value=value, unit=symbol))


def _step(session: Session, phase: Phase, function: Callable[[], object], *, announce: bool = False) -> bool:
    """Run one piece of author's code; each exception becomes data. Returns whether the code came to its end."""
    if session.stopped and phase in (Phase.SETUP, Phase.RUN):
        return False
    if announce:
        session.enter(phase)
    session.phase = phase
    try:
        session.run_stoppable(function)
    except TestStopped:
        return False
    except Exception as error:  # noqa: BLE001 - it is recorded: this is where exceptions end
        if session.examine is not None:
            session.examine(error)
        session.raised(error)
        return False
    except BaseException as error:  # noqa: BLE001 - sys.exit() in a test must not end the process unseen
        session.raised(TestProblem(f"the test raised {type(error).__name__}({text_of(error)})", title="exception"))
        return False
    return True


def _conclusion(session: Session) -> Finished:
    tally = session.tally
    detail = tally.first or tally.skipped or tally.inconclusive or ""
    reason = "failure" if tally.failures else "error" if tally.errors else ""
    return Finished(tally.verdict(), reason, detail[:2000], session.stopped)
