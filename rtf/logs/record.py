"""The record of a log, as YARP's programs forward it to ``/yarplogger``: a bottle of two strings.

The first string is the sender's port in brackets, the second is a list of groups in a fixed order, written as text::

    [/log/vm/yarprobotinterface/12469]
    (level DEBUG) (systemtime 1795212380.13) (filename "/x.cpp") (line 88) (function "f()") (hostname vm) (pid 12469)
    (cmd yarprobotinterface) (args "--config /x.xml") (thread_id 0x000030b5) (component yarp.yri) (message "Reading /x")

A program that knows nothing of records, and whose output ``yarprun`` forwards, sends its lines as the second string.
Everything can be read: what is no list of groups is the message itself.
"""

from __future__ import annotations

import math
import re
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, BottleError, as_float, to_string
from rtf.bottle.binary import decode_from
from rtf.bottle.tags import LIST, int32, pair
from rtf.bottle.values import Kind
from rtf.bottle.writing import float_text, quote

if TYPE_CHECKING:
    from rtf.bottle import Value

#: The port to which programs forward.
COLLECTOR = "/yarplogger"
#: The component of what the framework itself adds to a log.
COMPONENT = "rtf.logs"


class Level(IntEnum):
    """How serious a record is. ``UNKNOWN`` is that of a line that names none."""

    UNKNOWN = 0
    TRACE = 1
    DEBUG = 2
    INFO = 3
    WARNING = 4
    ERROR = 5
    FATAL = 6


class LogRecord(NamedTuple):
    """One record. ``time`` is the sender's system clock, in seconds since 1970.

    ``component`` and ``id`` say which part of the program speaks, as in ``yarp.yri`` and the name of a device.
    ``details`` are the groups between time and component as text, from the network time to the thread; see
    :meth:`detail` and :func:`details_text`.
    """

    sender: str
    level: Level
    time: float
    message: str
    component: str = ""
    id: str = ""
    details: str = ""
    backtrace: str = ""

    def detail(self, key: str) -> Value | None:
        """Return a value of ``details``, such as that of ``filename``, ``line``, ``pid`` or ``networktime``."""
        try:
            return Bottle.parse(self.details).find(key)
        except BottleError:
            return None

    def groups(self) -> dict[str, int | float | str]:
        """Return ``details`` by key; what cannot be read is under ``text``."""
        try:
            groups = [group for group in Bottle.parse(self.details) if isinstance(group, Bottle)]
        except BottleError:
            return {"text": self.details}
        found = [(to_string(group.get(0)), group.get(1)) for group in groups]
        return {key: value if isinstance(value, int | float | str) else to_string(value) for key, value in found}

    def to_text(self) -> str:
        """Return the second string of the message."""
        parts = [f"(level {self.level.name}) (systemtime {float_text(self.time)})"]
        if self.details:
            parts.append(self.details)
        if self.component:
            parts.append(f"(component {quote(self.component)})")
        if self.id:
            parts.append(f"(id {quote(self.id)})")
        parts.append(f"(message {quote(self.message)})")
        if self.backtrace:
            parts.append(f"(backtrace {quote(self.backtrace)})")
        return " ".join(parts)

    def to_bottle(self) -> Bottle:
        """Return the message."""
        return Bottle([f"[{self.sender}]", self.to_text()])

    def to_bytes(self) -> bytes:
        """Return the message as it travels. What UTF-8 does not have is a question mark."""
        return bytes_of(f"[{self.sender}]", self.to_text())

    def to_console(self) -> str:
        """Return the record as YARP's programs print it: ``[LEVEL] |component|id| message``."""
        if not self.component:
            return f"[{self.level.name}] {self.message}"
        of = f"|{self.component}|{self.id}|" if self.id else f"|{self.component}|"
        return f"[{self.level.name}] {of} {self.message}"


def details_text(**groups: str | float) -> str:
    """Return groups as ``details``: strings quoted where necessary, the thread's number as YARP writes it."""
    return " ".join([f"({key} {_group_text(key, value)})" for key, value in groups.items()])


def _group_text(key: str, value: str | float) -> str:
    if isinstance(value, str):
        return quote(value)
    if type(value) is float:
        return float_text(value)
    return f"0x{int(value):08x}" if key == "thread_id" else str(value)


def bytes_of(sender: str, text: str) -> bytes:
    """Return a bottle of two strings as bytes, which are the same in YARP 3 and YARP 4."""
    first, second = _utf8(sender), _utf8(text)
    return b"".join((_TWO_STRINGS, int32.pack(len(first)), first, int32.pack(len(second)), second))


def _utf8(text: str) -> bytes:
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        return text.encode("utf-8", "replace")


_TWO_STRINGS = pair.pack(LIST | Kind.STRING, 2)
_HEAD = len(_TWO_STRINGS)


# Reading -------------------------------------------------------------------------------------------------------------


def from_bytes(data: bytes, port: str = "", arrival: float = 0.0) -> LogRecord:
    """Read a message that arrived from ``port`` at ``arrival``, which stand for what it does not say.

    Any bytes give a record; those of no bottle are shown.
    """
    if data.startswith(_TWO_STRINGS) and len(data) >= _HEAD + 8:
        middle = _HEAD + 4 + int.from_bytes(data[_HEAD : _HEAD + 4], "little", signed=True)
        if _HEAD + 4 <= middle <= len(data) - 4:
            end = middle + 4 + int.from_bytes(data[middle : middle + 4], "little", signed=True)
            if middle + 4 <= end <= len(data):
                first = data[_HEAD + 4 : middle].decode("utf-8", "surrogateescape")
                return from_strings(first, data[middle + 4 : end].decode("utf-8", "surrogateescape"), port, arrival)
    try:
        return from_bottle(decode_from(data)[0], port, arrival)
    except BottleError as error:
        return LogRecord(port, Level.UNKNOWN, arrival, f"{data[:200]!r} is no record: {error}")


def from_bottle(bottle: Bottle, port: str = "", arrival: float = 0.0) -> LogRecord:
    """Read a message; see :func:`from_bytes`."""
    first, second = bottle.get(0), bottle.get(1)
    if len(bottle) == 2 and isinstance(first, str) and isinstance(second, str):  # noqa: PLR2004 - sender and text
        return from_strings(first, second, port, arrival)
    return LogRecord(port, Level.UNKNOWN, arrival, bottle.to_text())


def from_strings(first: str, text: str, port: str = "", arrival: float = 0.0) -> LogRecord:
    """Read the two strings of a message; see :func:`from_bytes`."""
    sender = first[1:-1] if first.startswith("[/") and first.endswith("]") else port or first
    usual = _USUAL.fullmatch(text)
    if usual is None:
        return _read_other(sender, text, arrival)
    level, moment, details, component, identity, plain, message, backtrace = usual.groups()
    return LogRecord(
        sender,
        _LEVELS.get(level, _UNKNOWN),
        float(moment),
        plain if message is None else _unquoted(message),
        _unquoted(component) if component else "",
        _unquoted(identity) if identity else "",
        details[1:],
        _unquoted(backtrace) if backtrace else "",
    )


_STRING = r'"[^"\\]*+(?:\\.[^"\\]*+)*+"|[A-Za-z_][A-Za-z0-9_.\-]*+'
#: The usual groups in their order; anything else is left to the reader of bottles. Those of ``details`` are strings,
#: decimal and hexadecimal numbers. A message without escapes, as most are, is a group of its own.
_USUAL = re.compile(
    rf"""\(level\ ([A-Z]++)\)\ \(systemtime\ ([0-9]{{1,15}}+(?:\.[0-9]*+)?+)\)
    ((?:\ \((?!component\ |id\ |message\ )[a-z_]++\ (?:{_STRING}|[0-9.a-fx+-]++)\))*+)
    (?:\ \(component\ ({_STRING})\))?+
    (?:\ \(id\ ({_STRING})\))?+
    \ \(message\ (?:"([^"\\]*+)"|({_STRING}))\)
    (?:\ \(backtrace\ ({_STRING})\))?+\s*+""",
    re.VERBOSE | re.DOTALL,
)
_LEVELS = {level.name: level for level in Level}
_UNKNOWN = Level.UNKNOWN
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPED = {"n": "\n", "r": "\r", "0": "\0"}


def _unquoted(word: str) -> str:
    if word[0] != '"':
        return word
    word = word[1:-1]
    if "\\" not in word:
        return word
    return _ESCAPE.sub(lambda found: _ESCAPED.get(found[1], found[1]), word)


def _read_other(sender: str, text: str, arrival: float) -> LogRecord:
    """Read groups in another order, or of other forms; else a line of output."""
    if text.startswith("("):
        try:
            groups = Bottle.parse(text)
        except BottleError:
            groups = Bottle()
        if groups.check("level") and groups.check("message"):
            return _read_groups(sender, groups, arrival)
    return _read_line(sender, text, arrival)


def _read_groups(sender: str, groups: Bottle, arrival: float) -> LogRecord:
    own = ("level", "systemtime", "message", "component", "id", "backtrace")
    others = [group for group in groups if not (isinstance(group, Bottle) and group.get(0) in own)]
    return LogRecord(
        sender,
        _LEVELS.get(to_string(groups.find("level")), Level.UNKNOWN),
        _finite(as_float(groups.find("systemtime")) or arrival, arrival),
        to_string(groups.find("message")),
        to_string(groups.find("component")),
        to_string(groups.find("id")),
        Bottle(others).to_text(),
        to_string(groups.find("backtrace")),
    )


def _finite(moment: float, arrival: float) -> float:
    return moment if math.isfinite(moment) else arrival


_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_LINE = re.compile(
    rf"\[({'|'.join(_LEVELS)})\]\ ?(?:\|([^|\n]*)\|(?:([^|\n]*)\|)?\ ?)?(.*)",
    re.VERBOSE | re.DOTALL,
)


def _read_line(sender: str, text: str, arrival: float) -> LogRecord:
    """Read a line as programs print it, with the level and the component that it may begin with."""
    line = _COLOUR.sub("", text).rstrip("\r\n")
    found = _LINE.fullmatch(line)
    if found is None:
        return LogRecord(sender, Level.UNKNOWN, arrival, line)
    level, component, identity, message = found.groups()
    return LogRecord(sender, _LEVELS[level], arrival, message, component or "", identity or "")
