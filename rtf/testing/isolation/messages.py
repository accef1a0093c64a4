"""The messages between a runner, its fork servers and the processes that these fork.

A message is a :class:`msgspec.Struct`, written as msgpack behind its length in bytes. A test sends events, as in the
journal. Signals stop a test and have it write its stacks.
"""

from __future__ import annotations

import signal
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Union

import msgspec

from rtf import clock
from rtf.testing.events import KINDS, Attached, Count, FixtureIncident, Moment, OutputCaptured
from rtf.testing.events import Message as TestMessage
from rtf.testing.plugins import PluginRef
from rtf.testing.verdict import TestingError, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.testing.suite.model import FixtureEntry, TestEntry

#: Asks a test to end, and makes any process of RTF write the stacks of its threads into its dump file.
STOP_SIGNAL = signal.SIGINT
DUMP_SIGNAL = signal.SIGQUIT
#: Does nothing but wake a process that was asked to end. The interpreter does not notice a signal that comes between
#: its last look for one and the system call in which it then waits, until another comes: so it is sent repeatedly.
NUDGE_SIGNAL = signal.SIGURG
NUDGE_PERIOD = 0.1

#: Seconds in which a fixture must have entered its safe state: a robot may have some way to go.
SAFE_STATE_LIMIT = 45.0
#: Seconds that all fixtures together have to come down after SIGTERM or SIGHUP, unless one declares that it needs more.
STOP_LIMIT = 4.0
#: The name of a fixture's process meanwhile (at most 15 bytes); its fork server knows it by that without the runner.
SAFE_STATE_NAME = "rtf safe state"

#: The exit status of a process of RTF that cannot reach its runner any more.
CUT_OFF = 71

#: No case of a program takes longer, in seconds; a program may write anything.
LONGEST_CASE = 1e9

#: A longer message is not valid.
MESSAGE_LIMIT = 32 << 20


class MessageError(TestingError, ValueError):
    """Bytes that are no message."""


class Message(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Base of all messages but events."""


# From the runner to a fork server ------------------------------------------------------------------------------------


class Fork(Message, frozen=True):
    """Fork a child. Its channel, output, error output and the file for its stacks come with it, as descriptors."""


class Signal(Message, frozen=True):
    """Send a signal to a child, or to its process group."""

    pid: int
    signum: int
    group: bool = False


class MarkHost(Message, frozen=True):
    """A child hosts a fixture: it is given time to tear down when the runner is gone."""

    pid: int


class Preload(Message, frozen=True):
    """Import modules that the tests of the suites need."""

    modules: tuple[str, ...]


# From a fork server to the runner ------------------------------------------------------------------------------------


class Forked(Message, frozen=True):
    """The process of the oldest Fork that has not been answered."""

    pid: int


class Exited(Message, frozen=True):
    """A child and all that it started are gone. Wait status, seconds of CPU time, largest resident size in bytes."""

    pid: int
    status: int
    cpu_time: float
    max_rss: int


class Loaded(Message, frozen=True):
    """Modules, or the file of a plug-in server, are loaded; ``problems`` has the reasons of those that could not be."""

    problems: tuple[str, ...] = ()


# From the runner to a child ------------------------------------------------------------------------------------------


class Use(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """The values for a plug-in: the arguments of :meth:`~rtf.testing.parameters.Declared.resolve_parameters`."""

    param: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    overrides: tuple[tuple[str, str], ...] = ()
    environment: str = ""
    place: str = ""
    folder: str = ""

    @classmethod
    def of(cls, entry: TestEntry | FixtureEntry, overrides: Iterable[tuple[str, str]] = ()) -> Use:
        """Return the use of an entry of a suite."""
        file = entry.location.file
        return cls(
            param=entry.param,
            parameters=entry.parameters,
            overrides=tuple(overrides),
            environment=entry.environment,
            place=str(entry.location) if file else "",
            folder=str(Path(file).parent) if file else "",
        )


class Job(Message, frozen=True, kw_only=True):
    """One attempt at a test, the hosting of one fixture, or serving as the fork server of a plug-in's tests.

    ``attempt`` counts the attempts at a test, or the generations of a fixture, from 1. ``memory`` is the private memory
    in bytes a process may use, 0 for no limit. ``last`` says that no other job follows. ``variables`` are set in the
    environment of the process; ``values`` are those of its fixtures, as a JSON text. ``terminal`` is the device at
    which the test is debugged; ``core_dumps`` says whether those of programs are kept. ``cases`` are the names of the
    only cases that a program is to run.
    """

    plugin: PluginRef
    kind: str  # "test", "fixture" or "plugin server"
    id: str
    name: str
    folder: str
    run_folder: str
    use: Use = Use()
    repetition: int = 0
    attempt: int = 1
    memory: int = 0
    can_ask: bool = False
    check_period: float = 0.5
    last: bool = True
    variables: tuple[tuple[str, str], ...] = ()
    values: str = ""
    terminal: str = ""
    core_dumps: bool = False
    cases: tuple[str, ...] = ()


class Inspect(Message, frozen=True):
    """Load plug-ins, try each use of them, and ``ask`` tests which fixtures they need; see ``inspection``."""

    plugins: tuple[tuple[PluginRef, list[Use]], ...]
    ask: bool


class Answer(Message, frozen=True):
    """The answer to a test's question, and its source."""

    question: str
    answer: str | None
    source: str


class FailedTest(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """An attempt at a test that did not pass: its id, the folder of its files, and its time, in seconds since 1970."""

    test: str
    folder: str
    began: float
    ended: float


class Command(Message, frozen=True):
    """An order to a fixture's process: ``check``, ``enter_safe_state``, ``on_test_failure`` or ``teardown``.

    ``detail`` is the reason of the last, ``failed`` the test of ``on_test_failure``.
    """

    command: str
    detail: str = ""
    failed: FailedTest | None = None


# From a child to the runner ------------------------------------------------------------------------------------------


class Finished(msgspec.Struct, frozen=True, tag_field="event", tag="finished"):
    """The test is over; its result, as its process claims."""

    outcome: str
    reason: str = ""
    detail: str = ""
    stopped: str = ""


class Case(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="event", tag="case"):
    """One case of the program that ``test`` runs, when it is over; the runner makes a test of it.

    No two cases of one run of a program have one name. ``subject`` names the repetition. ``detail`` is the sentence for
    people, ``duration`` in seconds as far as the program reports it, ``file`` and ``line`` are those of the case.
    """

    test: str
    name: str
    verdict: Verdict
    detail: str = ""
    duration: Annotated[float, msgspec.Meta(ge=0, le=LONGEST_CASE)] = 0.0
    subject: str = ""
    file: str = ""
    line: Count = 0
    messages: tuple[TestMessage, ...] = ()
    time: Moment = msgspec.field(default_factory=clock.now)


class Found(msgspec.Struct, frozen=True, tag_field="event", tag="found"):
    """The result of an inspection, see ``inspection``."""

    inspections: list[Any]


# From a fixture's process to the runner, beside events; see ``supervision.fixture_process`` --------------------------


class Doing(msgspec.Struct, frozen=True, tag_field="event", tag="doing"):
    """The step that begins now, such as ``teardown()``; ``nothing`` when all is done."""

    step: str


class Provided(msgspec.Struct, frozen=True, tag_field="event", tag="provided"):
    """The variables and, by key, the values that this generation provides for the tests on it."""

    variables: dict[str, str] = {}
    values: dict[str, Any] = {}


class Ready(msgspec.Struct, frozen=True, tag_field="event", tag="ready"):
    """The fixture is set up. It may restore something, such as a robot; its ``stop_limit`` is in seconds.

    ``explains_failures``: its ``on_test_failure`` is to be called.
    """

    secures_robot: bool
    stop_limit: float
    explains_failures: bool = False


class Alive(msgspec.Struct, frozen=True, tag_field="event", tag="alive"):
    """A check has held, or a command has been carried out: ``answered``."""

    answered: bool = False


class Lost(msgspec.Struct, frozen=True, tag_field="event", tag="lost"):
    """The fixture is not usable any more; ``hopeless`` says that another try would not help."""

    incident: FixtureIncident
    hopeless: bool = False


# On the wire ---------------------------------------------------------------------------------------------------------

_LENGTH = struct.Struct("=I")


def _plain(value: object) -> object:
    """An author's subclass of a plain type, such as numpy's ``float64``, as that type."""
    if isinstance(value, str):
        return str.__str__(value)
    if isinstance(value, float | int):
        return float.__float__(value) if isinstance(value, float) else int.__int__(value)
    raise TypeError(f"{type(value).__name__} cannot be sent to the runner")


_encoder = msgspec.msgpack.Encoder(enc_hook=_plain)


def pack(message: msgspec.Struct) -> bytes:
    """Write a message or an event as it crosses the wire."""
    try:
        data = _encoder.encode(message)
    except UnicodeEncodeError:  # half a character, such as in the name of a file
        data = _encoder.encode(_without_halves(msgspec.to_builtins(message, enc_hook=_plain)))
    return _LENGTH.pack(len(data)) + data


def _without_halves(value: Any) -> Any:
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode()
    if isinstance(value, dict):
        return {_without_halves(name): _without_halves(item) for name, item in value.items()}
    return [_without_halves(item) for item in value] if isinstance(value, list | tuple) else value


class Frames:
    """The bytes of a stream that have come so far, of which whole messages are taken."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Add what was read; yields each message that is complete now, without its length. Raises MessageError."""
        buffer = self._buffer + data if self._buffer else data
        position, size = 0, len(buffer)
        try:
            while size - position >= _LENGTH.size:
                (length,) = _LENGTH.unpack_from(buffer, position)
                if length > MESSAGE_LIMIT:
                    raise MessageError(f"no message begins like this: {buffer[position : position + 300]!r}")
                end = position + _LENGTH.size + length
                if size < end:
                    break
                begin, position = position + _LENGTH.size, end
                yield buffer[begin:end]
        finally:
            self._buffer = buffer[position:]


to_fork_server = msgspec.msgpack.Decoder(Fork | Signal | MarkHost | Preload).decode
to_runner = msgspec.msgpack.Decoder(Forked | Exited | Loaded).decode
to_child = msgspec.msgpack.Decoder(Job | Inspect | Answer | Command).decode
from_child = msgspec.msgpack.Decoder(Union[(Finished, Case, Found, *KINDS.values())]).decode
from_fixture = msgspec.msgpack.Decoder(
    Doing | Provided | Ready | Alive | Lost | Attached | FixtureIncident | TestMessage | OutputCaptured
).decode
