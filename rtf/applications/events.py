"""What is known of a module of a running application, and what is reported of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from rtf.applications.deployer import Deployer
    from rtf.applications.run.protocol import Ending
    from rtf.applications.xml.model import Module


class State(StrEnum):
    """The state of a module."""

    STOPPED = "stopped"
    WAITING = "waiting"
    STARTING = "starting"
    RUNNING = "running"
    ENDED = "ended"
    FAILED = "failed"
    MISSING = "not there"
    UNKNOWN = "unknown"


class Kind(StrEnum):
    """The kind of an event."""

    SUBSTITUTED = "substituted"
    IGNORED = "ignored"
    PLACED = "placed"
    WAITING = "waiting"
    STARTED = "started"
    FOUND = "found again"
    ENDED = "ended"
    FAILED = "failed"
    RESTARTED = "restarted"
    LOST = "lost"
    BACK = "back"
    CONNECTED = "connected"
    STOPPED = "stopped"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to an application: its kind, a sentence, the tag of the module, how its program ended."""

    kind: Kind
    text: str
    module: str = ""
    ending: Ending | None = None


@dataclass(slots=True, eq=False)
class Unit:
    """A module in the hands of a manager.

    ``key`` is its tag as the file has it, before a program was replaced or a node chosen.
    ``placed`` says why it is on its node, if that was chosen, ``since`` is when it was started, ``reason`` why it does
    not run, ``attempts`` how often it was restarted in a row, ``halted`` that it was asked to stop by itself, without
    the application, ``unnoticed`` that it was found not to run any more, which the manager has not dealt with yet.
    """

    index: int
    module: Module
    deployer: Deployer | None
    key: str
    state: State = State.STOPPED
    pid: int = 0
    reason: str = ""
    since: float = 0.0
    attempts: int = 0
    optional: bool = False
    placed: str = ""
    halted: bool = False
    unnoticed: bool = False

    @property
    def place(self) -> Deployer:
        """Its deployer. A module that is not there has none, and is never asked for it."""
        assert self.deployer is not None
        return self.deployer

    @property
    def active(self) -> bool:
        """Whether it runs, or may run, or is about to."""
        return self.state in (State.RUNNING, State.UNKNOWN, State.WAITING, State.STARTING)

    @property
    def up(self) -> bool:
        """Whether it runs, or has ended well, or the application goes without it."""
        return self.state in (State.RUNNING, State.ENDED) or self.optional

    @property
    def good(self) -> bool:
        """Whether nothing went wrong with it."""
        return self.state not in (State.FAILED, State.MISSING) or self.optional


Say: TypeAlias = Callable[[Event], None]
