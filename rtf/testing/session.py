"""The connection of a running test to its runner: its events, their sum, stops, and answers.

A session lives in the test's own process. Any thread of the test may emit; only the main thread is ever stopped.
"""

from __future__ import annotations

import sys
import traceback
from _thread import allocate_lock, get_ident  # ``threading`` has hooks that cost each fork, see docs/decisions/0010
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, NoReturn, TypeVar

from rtf import clock
from rtf.testing.events import Answered, Asked, Event, Message, PhaseStarted, SubResultEnded
from rtf.testing.isolation.messages import Case
from rtf.testing.plugins import PLUGINS
from rtf.testing.verdict import (
    UNDOING_PHASES,
    Inconclusive,
    Phase,
    Severity,
    SkipTest,
    TestFailure,
    TestProblem,
    TestStopped,
    Verdict,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

    from rtf.testing.measurement import Measurement

#: A text longer than this is cut in the middle, and says so: an event must stay something a page can show.
TEXT_LIMIT = 1 << 20

#: Frames of these files are not the author's; a failure is located and a traceback shown without them.
OWN_FOLDER = str(Path(__file__).parent)

M = TypeVar("M")  # what a process sends
T = TypeVar("T")


@dataclass(slots=True)
class Tally:
    """The sum of the events of a test, or of its part that is called ``subject``."""

    subject: str = ""
    failures: int = 0
    errors: int = 0
    judged: int = 0  # checks, assertions and limited measurements made
    recorded: int = 0  # measurements without limits, and series
    skipped: str | None = None
    inconclusive: str | None = None
    first: str = ""  # the first failure or error: the reason people want to read

    def verdict(self) -> Verdict:
        """Return the verdict. A failure is never hidden by a later event."""
        if self.failures:
            return Verdict.FAILED
        if self.errors:
            return Verdict.ERROR
        if self.skipped is not None:
            return Verdict.SKIPPED
        if self.inconclusive is not None:
            return Verdict.INCONCLUSIVE
        return Verdict.MEASURED if self.recorded and not self.judged else Verdict.PASSED

    def note(self, severity: Severity, text: str) -> None:
        """Count one failure or error."""
        if severity is Severity.FAILURE:
            self.failures += 1
        else:
            self.errors += 1
        self.first = self.first or text


def bounded(text: str) -> str:
    """Return the text, or its two ends if it is longer than an event may carry."""
    if len(text) <= TEXT_LIMIT:
        return text
    half = TEXT_LIMIT // 2
    return f"{text[:half]}\n… {len(text) - 2 * half} characters left out …\n{text[-half:]}"


def text_of(error: BaseException) -> str:
    """Return the text of an error, also of an error whose text cannot be made."""
    try:
        return str(error)
    except Exception as broken:  # noqa: BLE001 - an author's __str__ may do anything, and must not hide the error
        return f"(its text cannot be had: {type(broken).__name__})"


def named_text_of(error: BaseException) -> str:
    """Return the name of an error's class, and its text if it has one."""
    text = text_of(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def author_traceback(error: BaseException) -> str:
    """Return the traceback as Python prints it, from the first frame that is not RTF's own."""
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename.startswith(OWN_FOLDER):
        trace = trace.tb_next
    return bounded("".join(traceback.format_exception(type(error), error, trace or error.__traceback__)))


# Where it happened ---------------------------------------------------------------------------------------------------
#
# That is a line of the plug-in, also where a layer between it and the framework (that of robot tests, say) made the
# call or raised the error: a reader of "joint_limits.py:140" knows which step of the test it was.


def calling_place(own: str) -> tuple[str, int]:
    """Return file and line from which ``own``, a file of RTF, was called.

    That is the nearest frame of a plug-in, or without one the nearest outside of ``own``.
    """
    frame = sys._getframe(1)  # noqa: SLF001 - inspect.stack() reads source files and takes milliseconds
    while frame.f_back is not None and frame.f_code.co_filename in (own, __file__):
        frame = frame.f_back
    nearest = frame
    while not _of_plugin(frame):
        if frame.f_back is None:
            frame = nearest
            break
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def raised_place(error: BaseException) -> tuple[str, int]:
    """Return file and line of the innermost frame of a plug-in; without one, of the innermost that is not RTF's."""
    place, in_plugin = ("", 0), False
    for frame, line in traceback.walk_tb(error.__traceback__):
        file = frame.f_code.co_filename
        if _of_plugin(frame):
            place, in_plugin = (file, line), True
        elif not in_plugin and not file.startswith((OWN_FOLDER, "<frozen")):
            place = (file, line)
    return place


def _of_plugin(frame: FrameType) -> bool:
    name = frame.f_globals.get("__name__")
    return isinstance(name, str) and name.startswith(PLUGINS)


class Stoppable(Generic[M]):
    """Sends messages whole, from any thread, and stops the main thread while that runs an author's code.

    ``send`` sends one message and blocks while the runner is slower.
    """

    def __init__(self, send: Callable[[M], None]) -> None:
        self.phase: Phase | None = None
        self.stopped = ""  # why it was asked to end, once it was
        self._send = send
        self._lock = allocate_lock()
        self._sending = False
        self._stoppable = False
        self._stop: str | None = None
        self._main = get_ident()

    def emit(self, event: M) -> None:
        """Send one event. A stop that arrives meanwhile takes effect after the event is whole."""
        main = get_ident() == self._main
        if main:
            self._sending = True
        try:
            with self._lock:
                self._send(event)
        finally:
            if main:
                self._sending = False
        if main and self._stop is not None and self._stoppable:
            self._raise_stop()

    def stop(self, reason: str) -> None:
        """Ask the main thread to end; called from its signal handler, with :class:`TestStopped` as the effect.

        It takes effect at once in the author's code, or when the event that is being sent is whole; outside the
        author's code it keeps the body from being started.
        """
        self._stop = self.stopped = reason
        if self._stoppable and not self._sending:
            self._raise_stop()

    def _raise_stop(self) -> NoReturn:
        reason, self._stop = self._stop or "stopped", None
        raise TestStopped(reason)

    def run_stoppable(self, function: Callable[[], T]) -> T:
        """Return the result of an author's function, in which alone the main thread may be stopped.

        A stop that came just before keeps the function from being called, unless it undoes something.
        """
        if self.phase in UNDOING_PHASES:
            self._stop = None
        self._stoppable = True
        try:
            if self._stop is not None:
                self._raise_stop()
            return function()
        finally:
            self._stoppable = False


class Session(Stoppable[Event | Case]):
    """The one channel between a test and its runner.

    ``receive`` waits so many seconds for an answer (question, answer, source); it is None if questions cannot be
    answered. ``folder`` is the test's own inside ``run_folder``.
    """

    #: Returns what is recorded in the place of an exception, mostly itself: for kinds of tests that know more about
    #: what it proves.
    explain: Callable[[Exception], Exception] | None = None
    #: Opens a debugger where an exception was raised, if the test is debugged.
    examine: Callable[[Exception], None] | None = None
    #: Whether the core dumps of the programs that the test runs are kept.
    core_dumps = False
    #: The names of the only cases that a program is to run; none means all.
    cases: tuple[str, ...] = ()
    #: How many cases of a program, which are tests of their own, did not pass.
    bad_cases = 0
    #: Whether something went wrong in the teardown or a clean-up.
    undoing_failed = False

    def __init__(
        self,
        test: str,
        send: Callable[[Event | Case], None],
        *,
        folder: str | Path,
        run_folder: str | Path,
        receive: Callable[[float], tuple[str, str | None, str] | None] | None = None,
    ) -> None:
        super().__init__(send)
        self.test = test
        self.tally = Tally()
        self._folder = folder
        self._run_folder = run_folder
        self._tallies = [self.tally]  # of the test, and of the parts that the main thread is in
        self._receive = receive
        self._questions = 0

    @property
    def folder(self) -> Path:
        """The test's own folder, which need not exist yet."""
        return Path(self._folder)

    @property
    def run_folder(self) -> Path:
        """The folder of the run."""
        return Path(self._run_folder)

    def enter(self, phase: Phase, repetition: int = 0) -> None:
        """Emit the beginning of a phase, with which the runner's time-out begins."""
        self.phase = phase
        self.emit(PhaseStarted(test=self.test, phase=phase, repetition=repetition))

    @property
    def subject(self) -> str:
        """The sub-result of the main thread, outermost first, parts joined by ``/``."""
        return self._tallies[-1].subject

    def judged(self) -> None:
        """Count one judgement, whatever its result."""
        for tally in self._tallies:
            tally.judged += 1

    def check(
        self,
        holds: object,
        detail: str,
        place: tuple[str, int],
        *,
        title: str = "checks",
        quiet: bool = False,
        measurement: Measurement | None = None,
    ) -> bool:
        """Count a judgement, and report it as passed or failed; one that holds is not reported if ``quiet``."""
        self.judged()
        if not (holds and quiet):
            severity = Severity.PASS if holds else Severity.FAILURE
            self.message(severity, title, detail, place, measurement=measurement)
        return bool(holds)

    def recorded(self) -> None:
        """Count one value that was only recorded."""
        for tally in self._tallies:
            tally.recorded += 1

    def _note(self, severity: Severity, text: str) -> None:
        """Count a failure or an error. The reason of the whole test names the part in which it was found."""
        subject = self.subject
        self.undoing_failed = self.undoing_failed or self.phase in UNDOING_PHASES
        for tally in self._tallies[1:]:
            tally.note(severity, text)
        self.tally.note(severity, text if subject in text else f"{subject}: {text}")

    def message(
        self,
        severity: Severity,
        title: str,
        detail: str,
        place: tuple[str, int],
        *,
        traceback_text: str = "",
        measurement: Measurement | None = None,
    ) -> None:
        """Send a message and count it if it is a failure or an error.

        ``measurement`` fills value, low, high, margin and unit of the message.
        """
        if len(detail) > TEXT_LIMIT:
            detail = bounded(detail)
        if severity in (Severity.FAILURE, Severity.ERROR):
            self._note(severity, detail or title)
        file, line = place if place[0] else ("", 0)
        self.emit(
            Message(
                severity=severity,
                title=title,
                detail=detail,
                test=self.test,
                subject=self.subject,
                phase=self.phase,
                file=file,
                line=line,
                traceback=traceback_text,
                **(measurement.members() if measurement is not None else {}),
            )
        )

    def raised(self, error: Exception) -> None:
        """Turn an exception that left the author's code into an event; this is done nowhere else."""
        if self.explain is not None:
            error = self.explain(error).with_traceback(error.__traceback__)
        if isinstance(error, SkipTest | Inconclusive):
            self._set_aside(error)
            return
        place = raised_place(error)
        if isinstance(error, TestFailure):
            self.message(Severity.FAILURE, error.title, error.detail, place, measurement=error.measurement)
        elif isinstance(error, TestProblem):
            self.message(Severity.ERROR, error.title, error.detail, place)
        elif isinstance(error, AssertionError):
            self.judged()
            self.message(
                Severity.FAILURE,
                "asserts failure with exception",
                text_of(error) or "assertion failed",
                place,
                traceback_text=author_traceback(error),
            )
        else:
            trace = author_traceback(error)
            self.message(Severity.ERROR, "exception", named_text_of(error), place, traceback_text=trace)

    def _set_aside(self, error: SkipTest | Inconclusive) -> None:
        kind = "skipped" if isinstance(error, SkipTest) else "inconclusive"
        setattr(self._tallies[-1], kind, str(error))
        self.message(Severity.INFO, kind, str(error), raised_place(error))

    @contextmanager
    def part(self, subject: str) -> Iterator[None]:
        """Run a part of the test with its own verdict; an exception that ends the part does not end the test."""
        tally = Tally(f"{self.subject}/{subject}" if self.subject else subject)
        began = clock.monotonic()
        self._tallies.append(tally)
        try:
            yield
        except Exception as error:  # noqa: BLE001 - recorded, which is the point of a part
            self.raised(error)
        finally:
            self._tallies.pop()
            verdict = tally.verdict()
            if verdict is Verdict.INCONCLUSIVE and self.tally.inconclusive is None:
                self.tally.inconclusive = f"{tally.subject}: {tally.inconclusive}"
            self.emit(
                SubResultEnded(
                    test=self.test,
                    subject=tally.subject,
                    verdict=verdict,
                    reason=bounded(tally.first or tally.skipped or tally.inconclusive or ""),
                    duration=clock.monotonic() - began,
                ),
            )

    def ask(self, question: Asked) -> str | None:
        """Put a question to the operator and wait for the answer; None if there is none in time."""
        self._questions += 1
        self.emit(question)
        answer, source = question.default, "timeout"
        if self._receive is None:
            source = "automatic"
        else:
            deadline = clock.Deadline.after(question.timeout)
            while not deadline.expired:
                received = self._receive(deadline.remaining())
                if received is not None and received[0] == question.question:
                    answer, source = received[1], received[2]
                    break
        self.emit(Answered(test=self.test, question=question.question, answer=answer, source=source))
        return answer

    def next_question(self) -> str:
        """Return an identifier for the next question, unique within the run."""
        return f"{self.test}#{self._questions + 1}"
