"""Events by which monitors arbitrate, and the constraints that are expressions of them.

Events are known in the whole process. An event is set by a monitor for some seconds or for ever; a constraint such as
``e_reflex or not e_reach`` is true or false by the events that are set at a moment.
"""

from __future__ import annotations

import math
import re
import threading
from typing import TYPE_CHECKING

from rtf.middleware.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Callable
    from collections.abc import Set as AbstractSet

#: Words that are no events.
WORDS = frozenset({"and", "or", "not", "true", "false"})
#: A longer constraint is refused, in characters; events beyond the number are not set.
MAX_CONSTRAINT, MAX_EVENTS = 1000, 1000
_TOKEN = re.compile(r"\s*(?:([()])|([A-Za-z_][A-Za-z0-9_\-/]*)|(\S))")


class Events:
    """The events that are set. Any thread. Times are those of the process's clock, in s."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ends: dict[str, dict[object, float]] = {}  # by name and owner

    def set(self, name: str, owner: object, now: float, lifetime: float | None = None) -> None:
        """Set an event; without a lifetime, or with a negative one, until it is unset."""
        forever = lifetime is None or not lifetime >= 0
        with self._lock:
            if name not in WORDS and (name in self._ends or len(self._ends) < MAX_EVENTS):
                self._ends.setdefault(name, {})[owner] = math.inf if forever else now + lifetime  # type: ignore[operator]

    def unset(self, name: str, owner: object) -> None:
        """End an event of this owner."""
        with self._lock:
            self._drop(name, owner)

    def forget(self, owner: object) -> None:
        """End all events of an owner."""
        with self._lock:
            for name in [*self._ends]:
                self._drop(name, owner)

    def active(self, now: float) -> AbstractSet[str]:
        """Return the names of the events that are set."""
        with self._lock:
            for name, owners in [*self._ends.items()]:
                for owner in [owner for owner, end in owners.items() if end <= now]:
                    self._drop(name, owner)
            return set(self._ends)

    def _drop(self, name: str, owner: object) -> None:
        owners = self._ends.get(name, {})
        owners.pop(owner, None)
        if not owners:
            self._ends.pop(name, None)


#: The events of this process.
EVENTS = Events()


class Constraint:
    """An expression of events with ``and``, ``or``, ``not``, brackets, ``true`` and ``false``; an empty one is true.

    As usual ``not`` binds more than ``and``, and that more than ``or``. Raises ProtocolError for anything else.
    """

    def __init__(self, text: str = "") -> None:
        if len(text) > MAX_CONSTRAINT:
            raise ProtocolError(f"a constraint has at most {MAX_CONSTRAINT} characters")
        self.text = text.strip()
        self._tokens = self._read()
        self._at = 0
        self._holds: Callable[[AbstractSet[str]], bool] = self._any() if self._tokens else lambda _: True
        if self._at < len(self._tokens):
            raise self._wrong()

    def holds(self, events: AbstractSet[str]) -> bool:
        """Return whether it is true while these events are set."""
        return self._holds(events)

    def _read(self) -> list[str]:
        tokens = []
        for bracket, word, other in _TOKEN.findall(self.text):
            if other:
                raise ProtocolError(
                    f"the constraint {self.text!r} has {other!r} in it; it is made of events, and, or, not"
                )
            tokens.append(bracket or word)
        return tokens

    def _next(self) -> str:
        token = self._tokens[self._at] if self._at < len(self._tokens) else ""
        self._at += 1
        return token

    def _peeks(self, word: str) -> bool:
        found = self._at < len(self._tokens) and self._tokens[self._at] == word
        self._at += found
        return found

    def _any(self) -> Callable[[AbstractSet[str]], bool]:
        parts = [self._all()]
        while self._peeks("or"):
            parts.append(self._all())
        return parts[0] if len(parts) == 1 else lambda events: any(part(events) for part in parts)

    def _all(self) -> Callable[[AbstractSet[str]], bool]:
        parts = [self._one()]
        while self._peeks("and"):
            parts.append(self._one())
        return parts[0] if len(parts) == 1 else lambda events: all(part(events) for part in parts)

    def _one(self) -> Callable[[AbstractSet[str]], bool]:
        negated = False
        while self._peeks("not"):
            negated = not negated
        word = self._next()
        if word == "(":
            part = self._any()
            if self._next() != ")":
                raise self._wrong()
        elif word in ("true", "false"):
            part = _Fixed(value=word == "true")
        elif word and word not in WORDS and word != ")":
            part = _Event(word)
        else:
            raise self._wrong()
        return (lambda events: not part(events)) if negated else part

    def _wrong(self) -> ProtocolError:
        return ProtocolError(f"the constraint {self.text!r} cannot be read; write it as in 'e_reflex or not e_reach'")


class _Fixed:
    def __init__(self, *, value: bool) -> None:
        self._value = value

    def __call__(self, _events: AbstractSet[str]) -> bool:
        return self._value


class _Event:
    def __init__(self, name: str) -> None:
        self._name = name

    def __call__(self, events: AbstractSet[str]) -> bool:
        return self._name in events
