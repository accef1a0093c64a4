"""The event classes, which tests, runner, journal and reporters share.

An event is a frozen record of something that happened, at a time. A test emits events in its own process, the runner
adds its own, the journal appends them all in one order, and reporters consume them; whatever a report shows can be
rebuilt from them. On the wire and in the journal an event is one JSON object whose ``event`` member is the kind and in
which members that have their default value are left out. ``docs/events.md`` is the reference for readers.
"""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, ClassVar, Self, Union

import msgspec

from rtf import clock
from rtf.errors import Location, RtfError
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict

#: Version of the vocabulary. It grows when an event or member changes meaning, not when one is added.
FORMAT = 1

#: No count or time of RTF is larger; every reader can hold it, those with 64-bit integers too.
_BIGGEST = (1 << 63) - 1
Count = Annotated[int, msgspec.Meta(ge=-_BIGGEST, le=_BIGGEST)]
Moment = Annotated[float, msgspec.Meta(ge=-_BIGGEST, le=_BIGGEST)]
#: Numbers that JSON lacks are written as words.
_NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


class EventError(RtfError, ValueError):
    """A record that is no event: not an object, an unknown kind, a missing member or one of the wrong type."""


class UnknownEventError(EventError):
    """A record of a kind that this version does not know; a newer version may have written it."""


class Event(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="event"):
    """Base of all events. ``time`` is in seconds since 1970; ``seq`` counts the events of a run from 1."""

    __test__: ClassVar[bool] = False  # pytest is not to collect those whose names begin with Test
    time: Moment = msgspec.field(default_factory=clock.now)
    seq: Count = 0

    @property
    def kind(self) -> str:
        """The word that stands for the class in a journal."""
        return str(self.__struct_config__.tag)

    def with_seq(self, seq: int) -> Self:
        """Return the event with this place in the run's order. An event that has none yet is changed, not copied."""
        if self.seq:
            return msgspec.structs.replace(self, seq=seq)
        msgspec.structs.force_setattr(self, "seq", seq)  # its maker has handed it over, and no other code has it
        return self


class RunStarted(Event, tag="run_started", frozen=True, kw_only=True):
    """The run begins; the first event of a journal. ``environment`` says where, with what and by whom.

    ``device`` is the record of the device under test, by key: ``serial``, ``part``, ``firmware``, ``operator``,
    ``batch``, and any other key that the station uses.
    """

    run: str
    version: str
    format: Count = FORMAT
    command: tuple[str, ...] = ()
    environment: dict[str, str] = msgspec.field(default_factory=dict)
    robot: str = ""
    station: str = ""
    device: dict[str, str] = msgspec.field(default_factory=dict)
    seed: Count | None = None
    resumed: bool = False


class Diagnosed(Event, tag="diagnosed", frozen=True, kw_only=True):
    """A problem of a suite, a plug-in or the command line; not of one test's run."""

    severity: Severity
    text: str
    file: str = ""
    line: Count = 0
    column: Count = 0
    hint: str = ""
    suite: str = ""

    def __str__(self) -> str:
        """Write the problem the way compilers do, such as ``suite.xml:12:5: error: … (hint)``."""
        place = str(Location(self.file, self.line, self.column)) if self.file else "command line"
        hint = f" ({self.hint})" if self.hint else ""
        return f"{place}: {self.severity}: {self.text}{hint}"


class SuitePlanned(Event, tag="suite_planned", frozen=True, kw_only=True):
    """A suite will run. All plans come before the first start, so that a page shows everything from the beginning."""

    suite: str
    name: str
    file: str = ""
    description: str = ""
    environment: str = ""
    fixtures: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()


class TestPlanned(Event, tag="test_planned", frozen=True, kw_only=True):
    """A test will run. ``test`` is its stable id, ``suite/test``; ``run_timeout`` is in seconds.

    ``fingerprint`` is another one when the suite says something else of the test: parameters, environment, fixtures.

    The cases that a program reports are tests, too. Each is planned when the program first reports it, or in advance
    where only some are run: then ``cases`` of the program has their ids. ``parent`` is the id of the case's program and
    ``case`` the name that this gives the case.
    """

    test: str
    suite: str
    name: str
    plugin: str = ""
    type: str = ""
    param: str = ""
    tags: tuple[str, ...] = ()
    file: str = ""
    line: Count = 0
    repetition: Count = 0
    retries: Count = 0
    expected: str = "pass"
    run_timeout: float | None = None
    fingerprint: str = ""
    parent: str = ""
    case: str = ""
    cases: tuple[str, ...] = ()


class PlanChanged(Event, tag="plan_changed", frozen=True, kw_only=True):
    """The suites were edited between two parts of a run: the ids of tests that are new, removed or changed.

    What earlier parts report of a removed or changed test is void. ``removed`` also holds suites of which nothing is
    left.
    """

    added: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()


class SuiteStarted(Event, tag="suite_started", frozen=True, kw_only=True):
    """The suite's fixtures are about to be set up."""

    suite: str


class SuiteEnded(Event, tag="suite_ended", frozen=True, kw_only=True):
    """The suite's fixtures are down. ``counts`` maps a verdict to the number of tests that ended with it."""

    suite: str
    verdict: Verdict
    duration: float
    counts: dict[str, Count] = msgspec.field(default_factory=dict)


class FixtureChanged(Event, tag="fixture_changed", frozen=True, kw_only=True):
    """A fixture went over to another state. ``generation`` counts its starts in this run from 1."""

    fixture: str
    suite: str
    generation: Count
    state: FixtureState
    detail: str = ""
    pid: Count = 0


class FixtureIncident(Event, tag="fixture_incident", frozen=True, kw_only=True):
    """A fixture went wrong: in which phase and generation, why, and during which test.

    ``exit_status`` and ``signal`` are those of the program that ended, where one did; ``output`` holds its last lines.
    """

    fixture: str
    suite: str
    generation: Count
    phase: Phase
    cause: str
    exit_status: Count | None = None
    signal: str = ""
    output: str = ""
    test: str = ""
    traceback: str = ""


class TestStarted(Event, tag="test_started", frozen=True, kw_only=True):
    """An attempt at a test begins in process ``pid``. ``fixtures`` maps its fixtures to their generations."""

    test: str
    attempt: Count = 1
    pid: Count = 0
    fixtures: dict[str, Count] = msgspec.field(default_factory=dict)


class PhaseStarted(Event, tag="phase_started", frozen=True, kw_only=True):
    """A test enters a phase. ``repetition`` counts the runs of the body from 1, ``limit`` is the limit in seconds."""

    test: str
    phase: Phase
    repetition: Count = 0
    limit: float | None = None


class TestRenamed(Event, tag="test_renamed", frozen=True, kw_only=True):
    """A test gave itself a name or a description; its id stays."""

    test: str
    name: str
    description: str = ""


class ParametersResolved(Event, tag="parameters_resolved", frozen=True, kw_only=True):
    """The values of a test's parameters: rows of ``name``, ``value`` (text form), ``unit`` and ``source``."""

    test: str
    parameters: tuple[dict[str, str], ...]


class Message(Event, tag="message", frozen=True, kw_only=True):
    """A test, suite or fixture says something.

    ``title`` is the short kind (``reports``, ``checks``, ``asserts failure on (x > 3)``), ``detail`` the author's text.
    A comparison fills ``value``, ``low``, ``high``, ``margin`` (distance to the nearest limit, negative outside) and
    ``unit``. ``subject`` names the sub-result (joint, port, repetition) it belongs to.
    """

    severity: Severity
    title: str
    detail: str = ""
    test: str = ""
    suite: str = ""
    fixture: str = ""
    subject: str = ""
    phase: Phase | None = None
    file: str = ""
    line: Count = 0
    traceback: str = ""
    value: float | str | None = None
    low: float | None = None
    high: float | None = None
    margin: float | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.value, str) and self.value in _NOT_FINITE:
            msgspec.structs.force_setattr(self, "value", _NOT_FINITE[self.value])


class Measured(Event, tag="measured", frozen=True, kw_only=True):
    """A quantity was measured: value, unit, limits, and where it lies between them."""

    test: str
    name: str
    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    marginal: float | None = None
    margin: float | None = None
    verdict: MeasurementVerdict = MeasurementVerdict.RECORDED
    subject: str = ""
    file: str = ""
    line: Count = 0


class SeriesRecorded(Event, tag="series_recorded", frozen=True, kw_only=True):
    """Columns of numbers over a common axis, kept in ``path`` (an ``.npz`` file inside the run's folder).

    ``columns`` are rows of ``name`` and ``unit``; the first is the axis, in ascending order.
    """

    test: str
    name: str
    path: str
    columns: tuple[dict[str, str], ...]
    rows: Count
    subject: str = ""


class SeriesSampled(Event, tag="series_sampled", frozen=True, kw_only=True):
    """A series grows: ``samples`` holds some of the newest points of each column, in the order of ``columns``.

    It is a preview of a few points at a time; ``SeriesRecorded`` has the whole series.
    """

    test: str
    name: str
    columns: tuple[dict[str, str], ...]
    samples: tuple[tuple[float, ...], ...]
    subject: str = ""


class SubResultEnded(Event, tag="subresult_ended", frozen=True, kw_only=True):
    """One part of a test (joint, port, repetition) has its own verdict; one bad part does not hide the others."""

    test: str
    subject: str
    verdict: Verdict
    reason: str = ""
    duration: float = 0.0


class Attached(Event, tag="attached", frozen=True, kw_only=True):
    """A file was put into the run's folder at ``path`` (relative to it)."""

    test: str
    name: str
    path: str
    media_type: str = "application/octet-stream"
    size: Count = 0
    fixture: str = ""


class Progressed(Event, tag="progressed", frozen=True, kw_only=True):
    """How far a test has come, from 0 to 1."""

    test: str
    fraction: float
    text: str = ""


class Asked(Event, tag="asked", frozen=True, kw_only=True):
    """A test asks the operator. ``form`` is ``confirm``, ``choice``, ``text`` or ``number``; ``timeout`` in seconds."""

    test: str
    question: str
    text: str
    form: str = "confirm"
    choices: tuple[str, ...] = ()
    unit: str = ""
    picture: str = ""
    timeout: float = 60.0
    default: str | None = None


class Answered(Event, tag="answered", frozen=True, kw_only=True):
    """A question got its answer, from ``source``: ``console``, ``web``, ``automatic`` or ``timeout`` (no answer)."""

    test: str
    question: str
    answer: str | None = None
    source: str = ""


class OutputCaptured(Event, tag="output_captured", frozen=True, kw_only=True):
    """What a test or fixture wrote to ``stdout`` or ``stderr``. ``omitted`` bytes before the text were not kept."""

    stream: str
    text: str
    test: str = ""
    fixture: str = ""
    suite: str = ""
    omitted: Count = 0


class StackDumped(Event, tag="stack_dumped", frozen=True, kw_only=True):
    """The stacks of all threads of a process that hung or crashed, innermost call first."""

    text: str
    cause: str
    test: str = ""
    fixture: str = ""


class TestEnded(Event, tag="test_ended", frozen=True, kw_only=True):
    """An attempt is over and its process gone.

    ``outcome`` is the verdict of this attempt. When ``final``, ``verdict`` is that of the test: it differs from the
    outcome for a flaky test and an expected failure. ``reason`` is a short machine word (``timeout``, ``crash``,
    ``assertion`` …), ``detail`` the sentence for people. A test that never started has attempt 0.
    """

    test: str
    verdict: Verdict
    outcome: Verdict
    attempt: Count = 1
    final: bool = True
    reason: str = ""
    detail: str = ""
    duration: float = 0.0
    exit_status: Count | None = None
    signal: str = ""
    cpu_time: float = 0.0
    max_rss: Count = 0


class Interrupted(Event, tag="interrupted", frozen=True, kw_only=True):
    """The run was asked to stop. ``stage`` 1: after the running test; 2: now; 3: kill."""

    source: str
    stage: Count


class InternalError(Event, tag="internal_error", frozen=True, kw_only=True):
    """RTF itself, or a reporter, broke. The run goes on where it can, and its exit code says so."""

    text: str
    traceback: str = ""


class RunEnded(Event, tag="run_ended", frozen=True, kw_only=True):
    """The run is over; the last event of a journal that was closed in order."""

    verdict: Verdict
    exit_code: Count
    duration: float
    counts: dict[str, Count] = msgspec.field(default_factory=dict)


KINDS: dict[str, type[Event]] = {str(cls.__struct_config__.tag): cls for cls in Event.__subclasses__()}

#: The members of each kind that are numbers with a fraction, and may be one that JSON lacks.
_NUMBERS = {
    kind: frozenset(member.name for member in msgspec.structs.fields(cls) if "float" in str(member.type))
    for kind, cls in KINDS.items()
}
_LONGEST_REASON = 250
#: The names of members in earlier journals, and their present names.
_FORMER_NAMES = {"incarnation": "generation"}


def _builtin(value: object) -> str | float:
    """Return the text or number that an object of an author's class stands for, such as a number of numpy."""
    if isinstance(value, str):
        return str.__str__(value)
    if isinstance(value, float | int):
        return float.__float__(value) if isinstance(value, float) else int.__int__(value)
    raise TypeError(f"an event cannot hold a {type(value).__name__}")


_encode = msgspec.json.Encoder(enc_hook=_builtin).encode
_decode = msgspec.json.Decoder(Union[tuple(KINDS.values())]).decode  # noqa: UP007 - there is no other way to say it


def to_line(event: Event) -> bytes:
    """Write an event as one line of strict JSON, with its line end.

    Numbers that JSON lacks become the strings ``NaN``, ``Infinity`` and ``-Infinity``, so that every reader, a browser
    too, can parse the line. Half a surrogate pair, which the name of a file may hold, is escaped.
    """
    try:
        line = _encode(event)
        if b"null" not in line:  # which msgspec writes for a number that JSON lacks; members that are None are left out
            return line + b"\n"
    except UnicodeEncodeError:
        pass
    return json.dumps(_finite(to_record(event)), separators=(",", ":"), allow_nan=False).encode() + b"\n"


def _finite(value: Any) -> Any:
    """Return a value with words for the numbers that JSON lacks."""
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value


def from_line(line: bytes | str) -> Event:
    """Read one line of a journal. Raises EventError when the line is no event.

    Members that are not known are dropped, so that newer journals can be read.
    """
    try:
        event: Event = _decode(line)
    except (msgspec.DecodeError, UnicodeError, RecursionError):  # it is none, or has what JSON lacks, or is old
        return _read_slowly(line)
    return event


def _read_slowly(line: bytes | str) -> Event:
    try:
        text = line if isinstance(line, str) else line.decode()
        record = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise EventError(f"not JSON: {error}"[:_LONGEST_REASON]) from None
    return _from_record(record)


def _refuse(word: str) -> None:
    raise ValueError(f"{word} is no number")


def to_record(event: Event) -> dict[str, Any]:
    """Turn an event into a JSON-able object; members at their default are left out."""
    record: dict[str, Any] = msgspec.to_builtins(event, enc_hook=_builtin)
    return record


def _from_record(record: object) -> Event:
    if not isinstance(record, dict):
        raise EventError(f"an event is a JSON object, not {type(record).__name__}")
    kind = record.get("event")
    if not isinstance(kind, str) or kind not in KINDS:
        raise UnknownEventError(f"unknown event {str(kind)[:80]!r}")
    members = {
        _FORMER_NAMES.get(name, name): _number(value) if name in _NUMBERS[kind] else value
        for name, value in record.items()
    }
    try:
        event = msgspec.convert(members, KINDS[kind])
    except (msgspec.ValidationError, UnicodeError, RecursionError) as error:
        raise EventError(f"{kind}: {error}"[:_LONGEST_REASON]) from None
    return event


def _number(value: Any) -> Any:
    if isinstance(value, str):
        return _NOT_FINITE.get(value, value)
    return [_number(item) for item in value] if isinstance(value, list) else value
