"""The process in which one test runs. It sends events and nothing else.

A worker is forked from the fork server or from a template of it, waits for a job on its socket, does it, says that it
is finished and ends. What it says last is only a claim: the verdict is the runner's, which also knows how it ended.

The way of a plain test through this module is kept short and flat. It runs in a process a moment old, in which every
function that is called and every object that is touched costs the copy of a page of memory (about 3 µs), which is more
than its work.
"""

from __future__ import annotations

import faulthandler
import importlib
import json
import os
import select
import signal
import sys
from _socket import socketpair  # the C type, see the fork server
from typing import TYPE_CHECKING, Any, NoReturn

from rtf import clock
from rtf.testing import plugins
from rtf.testing.case import TestCase
from rtf.testing.events import Event, Measured, ParametersResolved, PhaseStarted, line_of, to_line
from rtf.testing.isolation import processes
from rtf.testing.isolation.fork_server_protocol import DUMP_FD, DUMP_SIGNAL, NUDGE_SIGNAL, SOCKET_FD, STOP_SIGNAL
from rtf.testing.isolation.job import HEADER, JOB_MARK, Job
from rtf.testing.outcome import TestProblem, TestStopped
from rtf.testing.plugin_spec import may_move
from rtf.testing.plugins import PluginRef
from rtf.testing.session import Session, text_of
from rtf.testing.statistics import median, wilson_interval
from rtf.testing.verdict import Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType, ModuleType

#: What every test imports; loaded once in the fork server, because in each test it would take a hundred times as long
#: as the fork itself.
_WARM = ("rtf.testing.fixture", "importlib.machinery", "importlib.util")

#: Looking up a member of an enumeration runs Python code.
_LOAD, _SETUP, _RUN = Phase.LOAD, Phase.SETUP, Phase.RUN

_session: Session | None = None

#: In a template and its children: the file that is loaded already, as a module in which nothing has happened since.
_template: tuple[str, ModuleType] | None = None
#: The classes of that file that the template has looked up.
_template_classes: dict[PluginRef, type[TestCase]] = {}


#: The interpreter specialises code that has run some eight times.
_REHEARSALS = 20


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
    _rehearse(_REHEARSALS)


def _rehearse(times: int) -> None:
    """Do what every worker does, with a test of our own that nobody hears of.

    What the interpreter and the linker prepare when something is done for the first time (specialised instructions,
    attribute caches, addresses of C functions) is then inherited, instead of being made by every worker in pages that
    have to be copied for it.
    """

    class Rehearsal(TestCase):
        def run(self) -> None:
            self.check(True, "")

    ref = PluginRef("test", "", "", "python")
    job = Job(kind="test", id="", name="", plugin=ref, folder="", run_folder="").to_message()
    runner, worker = socketpair()
    nowhere = Wire(os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC))
    limit = processes.memory_limit()
    _template_classes[ref] = Rehearsal
    for _ in range(times):
        processes.tie_to_parent(0)
        processes.limit_memory(limit)
        runner.sendall(job)
        received = Wire(worker.fileno()).receive_job()
        assert received is not None
        _work(received, nowhere)
    del _template_classes[ref]


def _on_stop(_signum: int, _frame: FrameType | None) -> None:
    if _session is not None:
        _session.stop("stopped by the runner")


def _on_nudge(_signum: int, _frame: FrameType | None) -> None:
    """Nothing: to be woken is all, see ``NUDGE_SIGNAL``."""


class Wire:
    """The worker's end of the socket to its runner: jobs and answers come in, lines go out."""

    def __init__(self, descriptor: int) -> None:
        #: What to do when the runner is gone: for a test, to end; a fixture still has something to tear down.
        self.on_lost: Callable[[], object] = _end_without_runner
        self._descriptor = descriptor
        self._buffer = b""

    def send(self, line: bytes) -> None:
        """Send one line whole."""
        try:
            sent = os.write(self._descriptor, line)
            while sent < len(line):
                line = line[sent:]
                sent = os.write(self._descriptor, line)
        except OSError:
            self.on_lost()

    def send_event(self, event: Event) -> None:
        """Send one event."""
        self.send(to_line(event))

    def send_record(self, record: dict[str, Any]) -> None:
        """Send what an event's line is made of."""
        self.send(line_of(record))

    def receive_job(self) -> Job | None:
        """Wait for the next job; None when there is no runner any more."""
        buffer = self._buffer
        while True:
            if buffer[:1] == JOB_MARK and len(buffer) >= HEADER.size:
                end = HEADER.size + HEADER.unpack_from(buffer)[1]
                if len(buffer) >= end:
                    self._buffer = buffer[end:]
                    return Job.from_data(buffer[HEADER.size : end])
            elif buffer and buffer[:1] != JOB_MARK:  # a late answer to a question of the last job
                _, separator, rest = buffer.partition(b"\n")
                if separator:
                    buffer = rest
                    continue
            data = self._read()
            if not data:
                return None
            buffer += data

    def receive(self, timeout: float | None) -> dict[str, Any] | None:
        """Wait for one message; None when none came in ``timeout`` seconds (None: for ever), or without a runner."""
        while True:
            line, separator, rest = self._buffer.partition(b"\n")
            if separator:
                self._buffer = rest
                message: dict[str, Any] = json.loads(line)
                return message
            if timeout is not None and not select.select([self._descriptor], [], [], timeout)[0]:
                return None
            data = self._read()
            if not data:
                return None
            self._buffer += data

    def _read(self) -> bytes:
        try:
            data = os.read(self._descriptor, 8192)
        except ConnectionError:
            data = b""
        if not data:
            self.on_lost()
        return data

    def receive_answer(self, timeout: float) -> tuple[str, str | None, str] | None:
        """Wait for the answer to a question: its id, the answer, and who gave it."""
        message = self.receive(timeout)
        if message is None or "answer" not in message:
            return None
        question, answer, source = message["answer"]
        return question, answer, source


def _end_without_runner() -> NoReturn:
    os._exit(71)


def child_main(socket_fd: int, out_fd: int, err_fd: int) -> int:
    """Live as a worker: tie this fresh fork to its parent, then do jobs until the last. Returns the exit status."""
    os.setpgid(0, 0)
    processes.tie_to_parent()
    os.dup2(out_fd, 1)
    os.dup2(err_fd, 2)
    os.dup2(socket_fd, SOCKET_FD, inheritable=False)
    os.closerange(DUMP_FD + 1, 1 << 20)
    wire = Wire(SOCKET_FD)
    while True:
        job = wire.receive_job()
        if job is None:
            return 71
        if job.memory:
            processes.limit_memory(job.memory)
        if job.kind == "test":
            _work(job, wire)
            if job.last:
                return 0
        elif job.kind == "fixture":
            from rtf.testing.supervision import fixture_host

            return fixture_host.host(job, wire)
        else:
            from rtf.testing.isolation import fork_server

            return fork_server.be_template(job.plugin, SOCKET_FD)


def _work(job: Job, wire: Wire) -> None:
    global _session  # noqa: PLW0603 - a signal handler has no other way to reach it
    session = Session(
        job.id,
        wire.send_event,
        folder=job.folder,
        run_folder=job.run_folder,
        receive=wire.receive_answer if job.can_ask else None,
        send_record=wire.send_record,
    )
    _session = session
    os.environ["RTF_RUN_FOLDER"] = job.run_folder  # for what a test and its fixtures leave for one another
    if job.variables:
        os.environ.update(job.variables)
    outcome = run_test(job, session)
    _session = None
    wire.send_record({"finished": outcome})
    sys.stdout.flush()
    sys.stderr.flush()


def load_template(ref: PluginRef) -> None:
    """Load a test's file for all the tests that will be forked from this process; raises what the file raises.

    Scripts of the C++ framework are told apart by their class and refused: their module is prepared for each test.
    """
    global _template  # noqa: PLW0603 - what a process has loaded is a fact of the process
    from rtf.testing import parameters

    module = plugins.load_module(ref)
    old = getattr(module, "TestCase", None)
    if isinstance(old, type) and not issubclass(old, TestCase):
        raise plugins.PluginError("a script of the C++ framework")
    cls = plugins.choose_class(ref, module, TestCase)
    parameters.declarations_of(cls)  # which looks at everything in the class, once
    _template_classes[ref] = cls
    _template = (ref.path, module)


def _make_case(ref: PluginRef) -> TestCase:
    """The test that a reference stands for, from the template's module where there is one."""
    cls = _template_classes.get(ref)
    if cls is None:
        if _template is None or _template[0] != ref.path or ref.language != "python":
            return plugins.load_test(ref)
        cls = plugins.choose_class(ref, _template[1], TestCase)
    return cls()


_plain_setup = TestCase.setup
_plain_teardown = TestCase.teardown


def run_test(job: Job, session: Session) -> dict[str, str]:
    """Carry out one attempt at a test and say what it came to: ``outcome``, ``reason`` and ``detail``."""
    made: list[TestCase] = []
    _step(session, _LOAD, lambda: made.append(_load(job, session)))
    if made and not session.tally.errors:
        _life(made[0], job, session)
    return _conclusion(session)


def _load(job: Job, session: Session) -> TestCase:
    case = _make_case(job.plugin)
    case.attach_to(session, job.environment)
    case.take_fixture_values(job.values)
    rows = case.resolve_parameters(
        param=job.param,
        parameters=job.parameters,
        overrides=job.overrides,
        environment=job.environment,
        place=job.suite_place,
        folder=job.suite_folder,
    )
    for warning in case.parameter_warnings:
        session.message(Severity.WARNING, "parameters", warning, ("", 0))
    if rows:
        session.emit(ParametersResolved(test=job.id, parameters=tuple(rows)))
    if case.name:
        case.rename(case.name, case.description)
    return case


def _life(case: TestCase, job: Job, session: Session) -> None:
    cls = type(case)
    fine = cls.setup is _plain_setup or _step(session, _SETUP, lambda: _set_up(case), announce=True)
    if fine and not session.stopped:
        if job.repetition:
            _repeat(case, job, session)
        else:
            _step(session, _RUN, case.run, announce=True)
    if cls.teardown is not _plain_teardown:
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
        session.emit(PhaseStarted(test=job.id, phase=Phase.RUN, repetition=count))
        began = clock.monotonic()
        before = session.tally.failures + session.tally.errors

        def body(count: int = count) -> None:
            with session.part(f"repetition {count}/{total}"):
                case.run()

        _step(session, Phase.RUN, body)
        durations.append(clock.monotonic() - began)
        bad = session.tally.failures + session.tally.errors > before
        passed += not bad and not session.stopped
        if session.stopped:
            break
        if bad and count < total and may_move(getattr(case, "safety", "")):
            text = f"{total - count} left out: it moves something, and what has gone wrong is not to be made worse"
            session.message(Severity.WARNING, "repetitions", text, ("", 0))
            break
    _report_repetitions(session, passed, durations)


def _report_repetitions(session: Session, passed: int, durations: list[float]) -> None:
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
    """Run one piece of author's code; whatever leaves it becomes data. Returns whether it came to its end."""
    if session.stopped and phase in (_SETUP, _RUN):
        return False
    if announce:
        session.enter(phase)
    session.phase = phase
    try:
        session.run_stoppable(function)
    except TestStopped:
        return False
    except Exception as error:  # noqa: BLE001 - it is recorded: this is where exceptions end
        session.raised(error)
        return False
    except BaseException as error:  # noqa: BLE001 - sys.exit() in a test must not end the process unseen
        session.raised(TestProblem(f"the test raised {type(error).__name__}({text_of(error)})", title="exception"))
        return False
    return True


def _conclusion(session: Session) -> dict[str, str]:
    tally = session.tally
    detail = tally.first or tally.skipped or tally.inconclusive or ""
    reason = "failure" if tally.failures else "error" if tally.errors else ""
    return {"outcome": tally.verdict(), "reason": reason, "detail": detail[:2000], "stopped": session.stopped}
