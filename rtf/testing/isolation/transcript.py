"""The messages of a test's process: each is decoded, checked, counted and emitted.

The process runs an author's code and is not trusted: it may send nonsense, send messages of other tests, begin a phase
again to have its time again, or send too much. Each of these becomes an event, and none stops the run.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import msgspec

from rtf.testing.events import (
    Answered,
    Asked,
    Attached,
    Event,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    PhaseStarted,
    Progressed,
    SeriesRecorded,
    SeriesSampled,
    SubResultEnded,
    TestRenamed,
)
from rtf.testing.isolation import messages
from rtf.testing.isolation.capture import Capture
from rtf.testing.isolation.messages import Case, Finished
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import UNDOING_PHASES, Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from rtf.testing.isolation.messages import Job

#: Beyond this many bytes of events, those that only inform are counted, not kept; beyond twice as many, failures too.
EVENT_BYTES = 64 << 20
#: So many protocol errors are reported, and as many late events; the rest are counted. So much is quoted of each.
_REPORTED = 20
_QUOTED = 300
_ORDER = (Phase.LOAD, Phase.SETUP, Phase.RUN, Phase.TEARDOWN, Phase.CLEANUP)

#: The events that a test may send; anything else on its channel is an error of the test.
_ALLOWED = (
    Message,
    Measured,
    SeriesRecorded,
    SeriesSampled,
    SubResultEnded,
    Attached,
    Progressed,
    PhaseStarted,
    ParametersResolved,
    TestRenamed,
    Asked,
    Answered,
    Case,
)


@dataclass(slots=True)
class Transcript:
    """The messages of one attempt so far.

    ``enter`` is called with each phase that begins and returns its limit in seconds; ``finish`` is called at the last
    message; ``ask`` takes a question to the operator; ``take_case`` keeps a case of a program, and returns False if
    there are too many. ``earlier`` are the tests that ran in the same process before.
    """

    job: Job
    emit: Callable[[Event], None]
    enter: Callable[[Phase], float | None]
    finish: Callable[[], None]
    ask: Callable[[Asked], None]
    take_case: Callable[[Case], bool]
    earlier: Collection[str] = ()
    phase: Phase = Phase.LOAD
    finished: Finished | None = None
    failures: int = 0
    errors: int = 0
    #: The first thing that went wrong, and whether something did while the test undid what it had done.
    first: str = ""
    undoing_failed: bool = False
    _repetition: int = 0
    _garbled: int = 0
    _late: int = 0
    _bytes: int = 0
    _left_out: int = 0
    _capture: Capture = field(init=False)

    def __post_init__(self) -> None:
        self._capture = Capture(self._written)

    def write(self, stream: str, data: bytes) -> None:
        """Take output of the process on one of its streams."""
        self._capture.feed(stream, data)

    def take(self, data: bytes) -> None:
        """Take one message."""
        try:
            message = messages.from_child(data)
        except (ValueError, RecursionError) as error:
            self._garble(f"said something unintelligible: {str(error)[:_QUOTED]}: {data[:_QUOTED]!r}")
            return
        if isinstance(message, Finished):
            self.finished = message
            self.finish()
        elif not isinstance(message, _ALLOWED):
            self._garble(f"may not say {message.kind if isinstance(message, Event) else 'that'}")
        elif message.test != self.job.id:
            if message.test in self.earlier:
                self._report_late(message, message.test)
            else:
                self._garble(f"may not say {_kind(message)} of {message.test[:_QUOTED]!r}")
        elif isinstance(message, Case):
            self._take_case(message, len(data))
        else:
            self._take_event(message, len(data))

    def note(self, severity: Severity, title: str, detail: str) -> None:
        """Emit a message in the name of the test, and count an error."""
        event = Message(severity=severity, title=title, detail=detail, test=self.job.id, phase=self.phase)
        if severity is Severity.ERROR:
            self.errors += 1
            self.first = self.first or detail
        self.emit(event)

    def close(self) -> None:
        """Hand on what was held back, and report how much was left out."""
        self._capture.close()
        if self._left_out:
            self.note(Severity.WARNING, "journal", f"{self._left_out} events left out: the test said too much")

    def _written(self, stream: str, text: str, omitted: int) -> None:
        self.emit(OutputCaptured(stream=stream, text=text, test=self.job.id, omitted=omitted))

    def _garble(self, what: str) -> None:
        self._garbled += 1
        if self._garbled <= _REPORTED:
            self.note(Severity.ERROR, "protocol", f"the test's process {what}")
        else:
            self._left_out += 1

    def _take_case(self, case: Case, size: int) -> None:
        """Keep a case. A bad case that cannot be kept makes the program fail."""
        self._bytes += size
        bad = not case.verdict.good
        if self._bytes > (2 * EVENT_BYTES if bad else EVENT_BYTES) or not self.take_case(case):
            self._left_out += 1
            self.failures += bad
            self.first = self.first or (f"{case.name}: {case.detail}" if bad else "")

    def _report_late(self, event: Event | Case, test: str) -> None:
        """Report an event from a thread of an earlier test in the same process."""
        self._late += 1
        if self._late > _REPORTED:
            self._left_out += 1
            return
        text = f"{event.title}: {event.detail}" if isinstance(event, Message) else _kind(event)
        detail = f"said by a thread of the test after the test was over: {text}"[:_QUOTED]
        self.emit(Message(severity=Severity.WARNING, title="late", detail=detail, test=test))

    def _take_event(self, event: Event, size: int) -> None:
        self._bytes += size
        bad = self._weigh(event)
        if isinstance(event, PhaseStarted):
            if not self._comes_next(event):
                self._garble(f"may not enter {event.phase} (repetition {event.repetition}) now")
                return
            self.phase, self._repetition = event.phase, event.repetition
            event = msgspec.structs.replace(event, limit=self.enter(event.phase))
        elif self._bytes > (2 * EVENT_BYTES if bad else EVENT_BYTES):
            self._left_out += 1
            return
        elif isinstance(event, Asked):
            self.ask(event)
        self.emit(event)

    def _weigh(self, event: Event) -> bool:
        """Count a failure or an error, whether it is kept or not; returns whether it is one."""
        if isinstance(event, Message) and event.severity in (Severity.FAILURE, Severity.ERROR):
            self.failures += event.severity is Severity.FAILURE
            self.errors += event.severity is Severity.ERROR
            self.first = self.first or event.detail or event.title
        elif isinstance(event, Measured) and event.verdict is MeasurementVerdict.FAILED:
            self.failures += 1
            self.first = self.first or event.name
        else:
            return False
        self.undoing_failed = self.undoing_failed or self.phase in UNDOING_PHASES
        return True

    def _comes_next(self, event: PhaseStarted) -> bool:
        """Return whether this phase may begin. Each begins once with one limit, so that no test outlives its limits."""
        if event.phase is Phase.RUN and self.phase is Phase.RUN:
            return self._repetition < event.repetition <= self.job.repetition + 1
        return _ORDER.index(event.phase) > _ORDER.index(self.phase) if event.phase in _ORDER else False


def _kind(message: Event | Case) -> str:
    return message.kind if isinstance(message, Event) else "case"
