"""The event classes: the one vocabulary shared by tests, runner, journal and reporters.

An event is a frozen record of something that happened, at a time. A test emits events in its own process, the runner
adds its own, the journal appends them all in one order, and reporters consume them; whatever a report shows can be
rebuilt from them. On the wire and in the journal an event is one JSON object whose ``event`` member is the kind and in
which members that have their default value are left out. ``docs/events.md`` is the reference for readers.
"""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, ClassVar, Self

from rtf import clock
from rtf.errors import RtfError
from rtf.testing.verdict import FixtureState, MeasurementVerdict, Phase, Severity, Verdict

#: Version of the vocabulary. It grows when an event or member changes meaning, not when one is added.
FORMAT = 1


class EventError(RtfError, ValueError):
    """A record that is no event: not an object, an unknown kind, a missing member or one of the wrong type."""


class UnknownEventError(EventError):
    """A record of a kind that this version does not know; a newer one may have written it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Base of all events. ``time`` is in seconds since 1970; ``seq`` counts the events of a run from 1."""

    kind: ClassVar[str] = "event"

    time: float = field(default_factory=clock.now)
    seq: int = 0

    def with_seq(self, seq: int) -> Self:
        """The same event at its place in the run's one order. An event that has none yet is given it, not copied."""
        if self.seq:
            return replace(self, seq=seq)
        object.__setattr__(self, "seq", seq)  # its maker has handed it over, and nobody else has seen it
        return self


@dataclass(frozen=True, slots=True, kw_only=True)
class RunStarted(Event):
    """The run begins; the first event of a journal. ``environment`` says where, with what and by whom.

    ``device`` is the record of the device under test, by key: ``serial``, ``part``, ``firmware``, ``operator``,
    ``batch``, and any other key that the station uses.
    """

    kind: ClassVar[str] = "run_started"
    run: str
    version: str
    format: int = FORMAT
    command: tuple[str, ...] = ()
    environment: dict[str, str] = field(default_factory=dict)
    robot: str = ""
    station: str = ""
    device: dict[str, str] = field(default_factory=dict)
    seed: int | None = None
    resumed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosed(Event):
    """Something about a suite, a plug-in or the command line that a person should know; not of one test's run."""

    kind: ClassVar[str] = "diagnosed"
    severity: Severity
    text: str
    file: str = ""
    line: int = 0
    column: int = 0
    hint: str = ""
    suite: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SuitePlanned(Event):
    """A suite will run. All plans come before the first start, so that a page shows everything from the beginning."""

    kind: ClassVar[str] = "suite_planned"
    suite: str
    name: str
    file: str = ""
    description: str = ""
    environment: str = ""
    fixtures: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TestPlanned(Event):
    """A test will run. ``test`` is its stable id, ``suite/test``; ``run_timeout`` is in seconds."""

    __test__: ClassVar[bool] = False
    kind: ClassVar[str] = "test_planned"
    test: str
    suite: str
    name: str
    plugin: str = ""
    type: str = ""
    param: str = ""
    tags: tuple[str, ...] = ()
    file: str = ""
    line: int = 0
    repetition: int = 0
    retries: int = 0
    expected: str = "pass"
    run_timeout: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SuiteStarted(Event):
    """The suite's fixtures are about to be set up."""

    kind: ClassVar[str] = "suite_started"
    suite: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SuiteEnded(Event):
    """The suite's fixtures are down. ``counts`` maps a verdict to the number of tests that ended with it."""

    kind: ClassVar[str] = "suite_ended"
    suite: str
    verdict: Verdict
    duration: float
    counts: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class FixtureChanged(Event):
    """A fixture went over to another state. ``generation`` counts its starts in this run from 1."""

    kind: ClassVar[str] = "fixture_changed"
    fixture: str
    suite: str
    generation: int
    state: FixtureState
    detail: str = ""
    pid: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FixtureIncident(Event):
    """Something went wrong with a fixture: what, in which phase and generation, and which test stood on it.

    ``exit_status`` and ``signal`` are those of the program that ended, where one did; ``output`` holds its last lines.
    """

    kind: ClassVar[str] = "fixture_incident"
    fixture: str
    suite: str
    generation: int
    phase: Phase
    cause: str
    exit_status: int | None = None
    signal: str = ""
    output: str = ""
    test: str = ""
    traceback: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestStarted(Event):
    """An attempt at a test begins in process ``pid``. ``fixtures`` maps a fixture to the generation it stands on."""

    __test__: ClassVar[bool] = False
    kind: ClassVar[str] = "test_started"
    test: str
    attempt: int = 1
    pid: int = 0
    fixtures: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseStarted(Event):
    """A test enters a phase. ``repetition`` counts the runs of the body from 1, ``limit`` is the limit in seconds."""

    kind: ClassVar[str] = "phase_started"
    test: str
    phase: Phase
    repetition: int = 0
    limit: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TestRenamed(Event):
    """A test gave itself a name or a description; its id stays."""

    __test__: ClassVar[bool] = False
    kind: ClassVar[str] = "test_renamed"
    test: str
    name: str
    description: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParametersResolved(Event):
    """The values a test runs with: rows of ``name``, ``value`` (text form), ``unit`` and ``source`` (whence it is)."""

    kind: ClassVar[str] = "parameters_resolved"
    test: str
    parameters: tuple[dict[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Message(Event):
    """A test, suite or fixture says something.

    ``title`` is the short kind (``reports``, ``checks``, ``asserts failure on (x > 3)``), ``detail`` the author's text.
    A comparison fills ``value``, ``low``, ``high``, ``margin`` (distance to the nearest limit, negative outside) and
    ``unit``. ``subject`` names the sub-result (joint, port, repetition) it belongs to.
    """

    kind: ClassVar[str] = "message"
    severity: Severity
    title: str
    detail: str = ""
    test: str = ""
    suite: str = ""
    fixture: str = ""
    subject: str = ""
    phase: Phase | None = None
    file: str = ""
    line: int = 0
    traceback: str = ""
    value: float | str | None = None
    low: float | None = None
    high: float | None = None
    margin: float | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured(Event):
    """A quantity was measured: value, unit, limits, and where it lies between them."""

    kind: ClassVar[str] = "measured"
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
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesRecorded(Event):
    """Columns of numbers over a common axis, kept in ``path`` (an ``.npz`` file inside the run's folder).

    ``columns`` are rows of ``name`` and ``unit``; the first is the axis, in ascending order.
    """

    kind: ClassVar[str] = "series_recorded"
    test: str
    name: str
    path: str
    columns: tuple[dict[str, str], ...]
    rows: int
    subject: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesSampled(Event):
    """A series grows: ``samples`` holds some points of each column since the last time, in the order of ``columns``.

    A preview for those who watch, a few points a batch; the whole follows in ``SeriesRecorded``.
    """

    kind: ClassVar[str] = "series_sampled"
    test: str
    name: str
    columns: tuple[dict[str, str], ...]
    samples: tuple[tuple[float, ...], ...]
    subject: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SubResultEnded(Event):
    """One part of a test (joint, port, repetition) has its own verdict; one bad part does not hide the others."""

    kind: ClassVar[str] = "subresult_ended"
    test: str
    subject: str
    verdict: Verdict
    reason: str = ""
    duration: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Attached(Event):
    """A file was put into the run's folder at ``path`` (relative to it)."""

    kind: ClassVar[str] = "attached"
    test: str
    name: str
    path: str
    media_type: str = "application/octet-stream"
    size: int = 0
    fixture: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progressed(Event):
    """How far a test has come, from 0 to 1."""

    kind: ClassVar[str] = "progressed"
    test: str
    fraction: float
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked(Event):
    """A test asks the operator. ``form`` is ``confirm``, ``choice``, ``text`` or ``number``; ``timeout`` in seconds."""

    kind: ClassVar[str] = "asked"
    test: str
    question: str
    text: str
    form: str = "confirm"
    choices: tuple[str, ...] = ()
    unit: str = ""
    picture: str = ""
    timeout: float = 60.0
    default: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Answered(Event):
    """A question got its answer, from ``source``: ``console``, ``web``, ``automatic`` or ``timeout`` (no answer)."""

    kind: ClassVar[str] = "answered"
    test: str
    question: str
    answer: str | None = None
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputCaptured(Event):
    """What a test or fixture wrote to ``stdout`` or ``stderr``. ``omitted`` bytes before the text were not kept."""

    kind: ClassVar[str] = "output_captured"
    stream: str
    text: str
    test: str = ""
    fixture: str = ""
    suite: str = ""
    omitted: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class StackDumped(Event):
    """The stacks of all threads of a process that hung or crashed, innermost call first."""

    kind: ClassVar[str] = "stack_dumped"
    text: str
    cause: str
    test: str = ""
    fixture: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestEnded(Event):
    """An attempt is over and its process gone.

    ``outcome`` is what this attempt came to. When ``final``, ``verdict`` is what is said of the test: it differs from
    the outcome for a flaky test and an expected failure. ``reason`` is a short machine word (``timeout``, ``crash``,
    ``assertion`` …), ``detail`` the sentence for people. A test that never started has attempt 0.
    """

    __test__: ClassVar[bool] = False
    kind: ClassVar[str] = "test_ended"
    test: str
    verdict: Verdict
    outcome: Verdict
    attempt: int = 1
    final: bool = True
    reason: str = ""
    detail: str = ""
    duration: float = 0.0
    exit_status: int | None = None
    signal: str = ""
    cpu_time: float = 0.0
    max_rss: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Interrupted(Event):
    """Somebody asked the run to stop. ``stage`` 1: after the running test; 2: now; 3: kill."""

    kind: ClassVar[str] = "interrupted"
    source: str
    stage: int


@dataclass(frozen=True, slots=True, kw_only=True)
class InternalError(Event):
    """The framework itself, or a reporter, broke. The run goes on where it can, and its exit code tells."""

    kind: ClassVar[str] = "internal_error"
    text: str
    traceback: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEnded(Event):
    """The run is over; the last event of a journal that was closed in order."""

    kind: ClassVar[str] = "run_ended"
    verdict: Verdict
    exit_code: int
    duration: float
    counts: dict[str, int] = field(default_factory=dict)


def _subclasses() -> dict[str, type[Event]]:
    return {cls.kind: cls for cls in Event.__subclasses__() if cls.kind != "event"}


# dataclass(slots=True) makes each class anew and leaves the first make behind among the subclasses; the one with a
# ``__slots__`` of its own fields is the real one.
KINDS: dict[str, type[Event]] = {kind: globals()[cls.__name__] for kind, cls in _subclasses().items()}

_NUMBER = (int, float)
#: No count or time of ours is larger; every reader can hold it, those with 64-bit integers too.
_BIGGEST = (1 << 63) - 1
_NONE = type(None)
_LISTS = (list, tuple)
_CHECKS: dict[str, tuple[type, ...]] = {
    "str": (str,),
    "int": (int,),
    "float": _NUMBER,
    "bool": (bool,),
    "str | None": (str, _NONE),
    "int | None": (int, _NONE),
    "float | None": (*_NUMBER, _NONE),
    "float | str | None": (*_NUMBER, str, _NONE),
    "tuple[str, ...]": _LISTS,
    "tuple[dict[str, str], ...]": _LISTS,
    "tuple[tuple[float, ...], ...]": _LISTS,
    "dict[str, str]": (dict,),
    "dict[str, int]": (dict,),
    "Severity": (str,),
    "Verdict": (str,),
    "FixtureState": (str,),
    "MeasurementVerdict": (str,),
    "Phase": (str,),
    "Phase | None": (str, _NONE),
}
_ENUMS: dict[str, type[Severity | Verdict | FixtureState | MeasurementVerdict | Phase]] = {
    "Severity": Severity,
    "Verdict": Verdict,
    "FixtureState": FixtureState,
    "MeasurementVerdict": MeasurementVerdict,
    "Phase": Phase,
    "Phase | None": Phase,
}


_PLAIN: dict[str, type] = {"str": str, "float": float, "bool": bool, "str | None": str, "float | None": float}


@dataclass(frozen=True, slots=True)
class _Schema:
    """How one class is written and read; computed once a class, because this is the hottest path of a run."""

    names: tuple[str, ...]
    defaults: dict[str, object]
    checks: dict[str, tuple[type, ...]]
    plain: dict[str, type]  # members for which the one look at the type is all there is to check
    words: dict[str, dict[str, object]]  # what the words of an enumeration stand for; faster than asking its class
    enums: dict[str, type]
    tuples: frozenset[str]
    required: frozenset[str]


def _schema(cls: type[Event]) -> _Schema:
    all_fields = [f for f in fields(cls) if f.name != "time"]
    annotations = {f.name: str(f.type) for f in all_fields}
    required = {f.name for f in all_fields if f.default is MISSING and f.default_factory is MISSING}
    defaults = {
        f.name: f.default if f.default_factory is MISSING else f.default_factory()
        for f in all_fields
        if f.name not in required
    }
    return _Schema(
        names=tuple(annotations),
        defaults=defaults,
        checks={name: _CHECKS[text] for name, text in annotations.items()},
        plain={name: _PLAIN[text] for name, text in annotations.items() if text in _PLAIN},
        words={
            name: {word.value: word for word in _ENUMS[text]} for name, text in annotations.items() if text in _ENUMS
        },
        enums={name: _ENUMS[text] for name, text in annotations.items() if text in _ENUMS},
        tuples=frozenset(name for name, text in annotations.items() if text.startswith("tuple")),
        required=frozenset(required),
    )


_SCHEMAS: dict[type[Event], _Schema] = {}


def schema_of(cls: type[Event]) -> _Schema:
    """The members of an event class, made when the class is first used."""
    found = _SCHEMAS.get(cls)
    if found is None:
        found = _SCHEMAS[cls] = _schema(cls)
    return found


def to_record(event: Event) -> dict[str, Any]:
    """Turn an event into a JSON-able object; members at their default are left out."""
    schema = schema_of(type(event))
    record: dict[str, Any] = {"event": event.kind, "time": round(event.time, 6)}
    defaults = schema.defaults
    for name in schema.names:
        value = getattr(event, name)
        if name in defaults and value == defaults[name]:
            continue
        record[name] = value
    return record


_encoder = json.JSONEncoder(ensure_ascii=True, separators=(",", ":"), check_circular=False, allow_nan=False)
_encode = _encoder.encode
_make_c_encoder: Any = getattr(json.encoder, "c_make_encoder", None)  # nameless in the stubs, and not in every Python
if _make_c_encoder is not None:
    # JSONEncoder.encode makes such an object anew for each call, which is half of what an event costs.
    _chunks = _make_c_encoder(
        None, _encoder.default, json.encoder.encode_basestring_ascii, None, ":", ",", False, False, False
    )

    def _encode(record: object) -> str:  # type: ignore[misc]  # the faster of two, where there is one
        return "".join(_chunks(record, 0))


_NOT_FINITE = {"NaN": float("nan"), "Infinity": float("inf"), "-Infinity": float("-inf")}


def to_line(event: Event) -> bytes:
    """Write an event as one line of strict JSON, with its line end.

    Numbers that JSON lacks become the strings ``NaN``, ``Infinity`` and ``-Infinity``, so that every reader, a browser
    too, can parse the line.
    """
    return line_of(to_record(event))


def line_of(record: dict[str, Any]) -> bytes:
    """Write a record as a line; see :func:`to_line`."""
    try:
        return _encode(record).encode("ascii") + b"\n"
    except ValueError:
        return _encode({name: _json_number(value) for name, value in record.items()}).encode("ascii") + b"\n"


def _json_number(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return [_json_number(item) for item in value] if isinstance(value, list | tuple) else value


def from_record(record: object) -> Event:
    """Make an event of a JSON object; unknown members are dropped, so that newer journals can be read.

    Raises EventError for anything that is no event.
    """
    if not isinstance(record, dict):
        raise EventError(f"an event is a JSON object, not {type(record).__name__}")
    kind = record.get("event")
    cls = KINDS.get(kind) if isinstance(kind, str) else None
    if cls is None:
        raise UnknownEventError(f"unknown event {str(kind)[:80]!r}")
    schema = schema_of(cls)
    members: dict[str, Any] = {}
    for name, value in record.items():
        if schema.plain.get(name) is value.__class__:
            members[name] = value
            continue
        if value.__class__ is str and name in schema.words and value in schema.words[name]:
            members[name] = schema.words[name][value]
            continue
        allowed = schema.checks.get(name)
        if allowed is None:
            if name == "time":
                members["time"] = _moment(kind, value)
            continue
        if value.__class__ is str and float in allowed:
            value = _NOT_FINITE.get(value, value)  # noqa: PLW2901 - the one normalisation of a member
        if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
            raise EventError(f"{kind}: {name} is {type(value).__name__}, expected {allowed[0].__name__}")
        if value.__class__ is int and not -_BIGGEST <= value <= _BIGGEST:
            raise EventError(f"{kind}: {name} is too large a number")
        members[name] = _member(kind, schema, name, value)
    missing = schema.required - members.keys()
    if missing:
        raise EventError(f"{kind}: {', '.join(sorted(missing))} missing")
    return cls(**members)


def _moment(kind: object, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, _NUMBER) or not abs(value) <= _BIGGEST:
        raise EventError(f"{kind}: time is no number of seconds")
    return value


def _member(kind: object, schema: _Schema, name: str, value: Any) -> Any:
    if value is not None and name in schema.enums:
        try:
            return schema.enums[name](value)
        except ValueError as error:
            raise EventError(f"{kind}: {name}: {error}") from None
    if name == "samples":
        return tuple(_numbers(kind, column) for column in value)
    if name in schema.tuples:
        if not all(_holds_text(item) if name in _ROWS else isinstance(item, str) for item in value):
            raise EventError(f"{kind}: {name} holds something else than {'rows of ' if name in _ROWS else ''}text")
        return tuple(value)
    if isinstance(value, dict) and not (_holds_counts(value) if name in _COUNTS else _holds_text(value)):
        raise EventError(f"{kind}: {name} holds something else than {'numbers' if name in _COUNTS else 'text'}")
    return value


def _numbers(kind: object, column: object) -> tuple[float, ...]:
    if not isinstance(column, _LISTS):
        raise EventError(f"{kind}: samples are lists of numbers, not {type(column).__name__}")
    numbers: list[float] = []
    for item in column:
        value = _NOT_FINITE.get(item) if isinstance(item, str) else item
        if type(value) is not float and (type(value) is not int or not abs(value) <= _BIGGEST):
            raise EventError(f"{kind}: samples hold something else than numbers")
        numbers.append(value)
    return tuple(numbers)


_ROWS = frozenset({"columns", "parameters"})
_COUNTS = frozenset({"counts", "fixtures"})


def _holds_text(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(item, str) for item in value.values())


def _holds_counts(value: dict[str, object]) -> bool:
    return all(type(item) is int and abs(item) <= _BIGGEST for item in value.values())


def from_line(line: bytes | str) -> Event:
    """Read one line of a journal. Raises EventError when it is no event."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise EventError(f"not JSON: {error}") from None
    return from_record(record)
