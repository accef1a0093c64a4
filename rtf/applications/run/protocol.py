"""What is said to a node and what it answers, as bottles: the requests and replies of YARP's ``yarprun`` 3.12.3.

A request is a bottle of lists in any order, each a key with its values. The first key in the order of :data:`_READERS`
says what is asked for; other lists are ignored, as ``on`` is. Words are split, and the environment is read, by the
rules of the original, which are not those of a shell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from rtf.applications.run.errors import NodeError, RequestError
from rtf.bottle import Bottle, as_int, as_list, as_string, to_string

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

#: The most words of a command. The original forgets those beyond; here such a command is refused.
MAX_WORDS = 128
FAILED = -1


@dataclass(frozen=True, slots=True)
class Start:
    """Start a program. ``command`` is split by :func:`split_words`, ``environment`` by :func:`read_environment`.

    ``log`` is the port of the logger, empty for the node's own, None if nothing is to be logged. ``stdio`` is the node
    that opens a terminal for the program; ``uuid`` names the ports of its streams, and is set in the message to that
    node. ``geometry`` is that of the terminal's window.
    """

    tag: str
    command: str
    on: str = ""
    directory: str = ""
    environment: str = ""
    stdio: str = ""
    hold: bool = False
    log: str | None = None
    geometry: str = ""
    uuid: str = ""

    def to_bottle(self) -> Bottle:
        """Return the lists in the order of YARP's client."""
        with_terminal: list[list[object]] = [["stdio", self.stdio]] if self.stdio else []
        lists: list[list[object]] = [*with_terminal, ["cmd", self.command], ["as", self.tag]]
        if self.on:
            lists.append(["on", self.on])
        lists += [[key, value] for key, value in (("workdir", self.directory), ("geometry", self.geometry)) if value]
        lists += [["hold"]] if self.hold else []
        lists += [[key, value] for key, value in (("env", self.environment), ("stdiouuid", self.uuid)) if value]
        if self.log is not None:
            lists.append(["log", self.log] if self.log else ["log"])
        return Bottle(lists)


@dataclass(frozen=True, slots=True)
class Kill:
    """Send a signal to all programs of a tag."""

    tag: str
    signal: int

    def to_bottle(self) -> Bottle:
        """Return the message."""
        return Bottle([["kill", self.tag, self.signal]])


@dataclass(frozen=True, slots=True)
class Ask:
    """Any other request: its key, and the tag or name that it is about, where it is about one."""

    key: str
    about: str = ""

    def to_bottle(self) -> Bottle:
        """Return the message."""
        return Bottle([[self.key, self.about] if self.about else [self.key]])


Request: TypeAlias = Start | Kill | Ask


def read_request(message: Bottle) -> Request:
    """Return what a message asks for. Raises RequestError, which names all that can be asked for."""
    for key, read in _READERS.items():
        group = message.find_group(key)
        if group is not None:
            return read(message, key)
    raise RequestError(f"{message.to_text()[:100]!r} asks for nothing that a node does: {', '.join(_READERS)}")


def _read_start(message: Bottle, _key: str) -> Start:
    log = message.find_group("log")
    return Start(
        _text(message, "as"),
        _text(message, "cmd"),
        _text(message, "on"),
        _text(message, "workdir"),
        _text(message, "env"),
        _text(message, "stdio"),
        message.check("hold"),
        None if log is None else _text(message, "log"),
        _text(message, "geometry"),
        _text(message, "stdiouuid"),
    )


def _read_kill(message: Bottle, key: str) -> Kill:
    group = message.find_group(key)
    assert group is not None
    return Kill(_text(message, key), as_int(group.get(2), 32))


def _read_ask(message: Bottle, key: str) -> Ask:
    return Ask(key, _text(message, key))


_READERS: dict[str, Callable[[Bottle, str], Request]] = {
    "stdio": _read_start,
    "cmd": _read_start,
    "kill": _read_kill,
    **dict.fromkeys(
        ("sigterm", "sigtermall", "ps", "isrunning", "killstdio", "sysinfo", "which", "exit", "ended", "output"),
        _read_ask,
    ),
}


def _text(message: Bottle, key: str) -> str:
    """Return the first value of a list as text: a client that was given the tag 7 sends a number."""
    group = as_list(message.find_group(key))
    value = None if group is None else group.get(1)
    return "" if value is None else to_string(value)


# Commands --------------------------------------------------------------------------------------------------------


def split_words(command: str) -> list[str]:
    """Split a command at blanks, except inside double quotes. A quote is a border between words, too.

    Nothing else is special: no other quotes, no backslash, no variables, no tabs.
    """
    words: list[str] = []
    for number, piece in enumerate(command.split('"')):
        words += filter(None, piece.split(" ") if number % 2 == 0 else [piece])
    return words


def join_words(words: Sequence[str]) -> str:
    """Return the command that is split into these words. Raises RequestError for a word that cannot be one."""
    for word in words:
        if '"' in word or not word:
            raise RequestError(f"{word!r} cannot be a word of a command: it is empty, or has a double quote in it")
    return " ".join(f'"{word}"' if " " in word else word for word in words)


def read_environment(text: str) -> dict[str, str | None]:
    """Read ``A=1;B=2``. A name without ``=`` removes the variable, which is None."""
    found: dict[str, str | None] = {}
    for entry in filter(None, text.split(";")):
        name, separator, value = entry.partition("=")
        if name:
            found[name] = value if separator else None
    return found


# Replies ---------------------------------------------------------------------------------------------------------


def started(node: str, request: Start, pid: int, command: str | None = None) -> list[object]:
    """The beginning of the reply to a start; ``command`` is named instead of that of the request."""
    shown = request.command if command is None else command
    return [pid, f"STARTED: server={node} alias={request.tag} cmd={shown} pid={pid}\n"]


def aborted(node: str, request: Start, reason: str, command: str | None = None) -> list[object]:
    """The reply to a start that failed; ``command`` is named instead of that of the request."""
    shown = request.command if command is None else command
    return [FAILED, f"ABORTED: server={node} alias={request.tag} cmd={shown}\n{reason}\n"]


@dataclass(frozen=True, slots=True)
class StartReply:
    """The process id, or :data:`FAILED`; the sentence; and what follows about the terminal."""

    pid: int
    text: str
    terminal: tuple[object, ...] = ()

    @classmethod
    def read(cls, reply: Bottle) -> StartReply:
        """Read the reply of a node. Raises NodeError."""
        if not isinstance(reply.get(0), int):
            raise NodeError(f"a node answers a start with a process id, but this one with {reply.to_text()[:100]!r}")
        return cls(as_int(reply.get(0)), as_string(reply.get(1)), tuple(reply[2:]))


@dataclass(frozen=True, slots=True)
class Running:
    """A program that a node has started."""

    pid: int
    tag: str
    status: str
    command: str
    environment: str

    def to_list(self) -> list[object]:
        """Return the list as it is sent."""
        fields = (self.pid, self.tag, self.status, self.command, self.environment)
        return [[key, value] for key, value in zip(("pid", "tag", "status", "cmd", "env"), fields, strict=True)]

    @classmethod
    def read(cls, row: object) -> Running:
        """Read a list of the reply to ``ps``. Raises NodeError."""
        if not isinstance(row, Bottle):
            raise NodeError(f"a node lists a program as (pid …) (tag …) …, but this one as {row!r}")
        pid = as_int(row.find("pid"))
        return cls(pid, _text(row, "tag"), _text(row, "status"), _text(row, "cmd"), _text(row, "env"))


@dataclass(frozen=True, slots=True)
class Ending:
    """How the last program of a tag ended, such as ``exit status 3``, with its last lines. A request of RTF's nodes."""

    pid: int
    how: str
    lines: tuple[str, ...] = ()

    @property
    def exit_status(self) -> int | None:
        """The exit status; None for a program that was killed, or whose end is not known."""
        word = self.how.removeprefix("exit status ")
        return int(word) if word.isdigit() else None

    @property
    def signal(self) -> str:
        """The signal that killed the program; empty without."""
        return self.how.partition("killed by ")[2]

    def to_bottle(self) -> Bottle:
        """Return the reply as it is sent."""
        return Bottle([self.pid, self.how, *self.lines])

    @classmethod
    def read(cls, reply: Bottle) -> Ending | None:
        """Read a reply; None if the node knows of no such program."""
        return cls(as_int(reply.get(0)), as_string(reply.get(1)), tuple(map(as_string, reply[2:]))) if reply else None
