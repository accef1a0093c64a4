"""The modifier ``recv.priority``: of the connections to a port that have it, the most important one delivers.

A message stimulates its connection, which becomes active at the stimulation 1 and forgets it within ``tc`` seconds. Of
all active connections, that with the largest bias delivers its messages, and those of the others are dropped; of equal
ones, the oldest. Each may change the weight of others while it is active. So a controller that sends takes a robot over
from a controller of less bias, which gets it back ``tc`` seconds after the last message.

The settings and formulas are those of YARP's carrier of that name (3.12.3 and 4.0.0 do not differ). They are whole
numbers in the name of a carrier, and ``st``, ``bs`` and weights are given in tenths there:

- ``tc``: seconds until a stimulation is forgotten (1); ``st``: stimulation by one message (10);
- ``bs``: bias (10); ``ex``: weights by which it acts on other connections, as in ``(ex (/other -10))``;
- ``tr``: seconds of rest, without stimulation, that follow an active time of ``tc`` (0: none);
- ``virtual``: its messages are never delivered, but count.

YARP's ``debug`` and ``rate``, which open a port with the stimulation, are accepted and have no effect.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, as_bool, as_float, as_list, as_string
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.ports import monitoring
from rtf.middleware.wire import modifiers

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value

_NAME = "priority"
_THRESHOLD = 1.0
_TENTHS = 10.0
_NUMBERS = {"tc": 1.0, "tr": 0.0, "st": 10.0, "bs": 10.0}
_KNOWN = (*_NUMBERS, "ex", "virtual", "debug", "rate")
#: Modifiers of the sending side.
_OF_SENDERS = ("send", "log")
#: A part of the name ``unix_stream+ack``, which YARP's programs send as a modifier.
_OF_CARRIERS = ("ack",)


@dataclass(slots=True, eq=False)
class Priority:
    """The settings and the state of one connection. Times are in seconds."""

    sender: str
    reset: float
    resting: float
    stimulation: float
    bias: float
    virtual: bool = False
    weights: dict[str, float] = field(default_factory=dict)
    active: bool = False
    _level: float = 0.0
    _arrival: float = 0.0

    def stimulate(self, now: float) -> None:
        """Count a message that has arrived."""
        self._level = self.level(now)
        if self._rests(self._level):
            return
        self._level = min(self._level + self.stimulation, _THRESHOLD)
        self.active = self.active or self._level >= _THRESHOLD
        self._arrival = now

    def level(self, now: float) -> float:
        """Return the stimulation, from 0 to 1; negative in a rest. It ends ``active`` when there is none left."""
        since = now - self._arrival
        if self.resting > 0 and since >= self.reset and self._level >= _THRESHOLD:
            self._level = -self._level
        if not self._rests(self._level):
            level = self._level * _rest_of(since, self.reset)
        elif self._level > 0:
            level = self._level
        else:
            level = self._level * _rest_of(since - self.reset, self.resting)
        self.active = self.active and level > 0
        return level

    def _rests(self, level: float) -> bool:
        return self.resting > 0 and (level < 0 or level >= _THRESHOLD)

    def describe(self) -> Property:
        """Return the settings as the admin protocol reports them."""
        weights = [Bottle([name, weight * _TENTHS]) for name, weight in self.weights.items()]
        return Property(
            {
                "tc": self.reset,
                "tr": self.resting,
                "st": self.stimulation,
                "bs": self.bias,
                "virtual": int(self.virtual),
                "ex": Bottle(["ex", *weights]).to_text() if weights else "",
            }
        )

    def change(self, settings: Bottle) -> None:
        """Apply an admin request such as ``(tc 0.5) (bs 2.0)``: not in tenths, but for the weights."""
        self.reset, self.resting, self.stimulation = (
            abs(as_float(settings.find(key))) if settings.check(key) else current
            for key, current in (("tc", self.reset), ("tr", self.resting), ("st", self.stimulation))
        )
        if settings.check("bs"):
            self.bias = as_float(settings.find("bs"))
        if settings.check("virtual"):
            self.virtual = as_bool(settings.find("virtual"))
        if (group := settings.find_group("ex")) is not None:
            self.weights = _weights(group.tail())


def _rest_of(since: float, span: float) -> float:
    """Return which part of a stimulation is left: from 1 at first, slowly and then fast, to 0 after ``span``."""
    if since > span:
        return 0.0
    return 1.0 - math.exp((since - span) / span * 5.0) + math.exp(-5.0) if span else 1.0


def _weights(pairs: Bottle) -> dict[str, float]:
    named = [pair for value in pairs if (pair := as_list(value)) is not None and len(pair) > 1]
    return {as_string(pair[0]): as_float(pair[1]) / _TENTHS for pair in named}


def of_input(sender: str, text: str) -> Priority | None:
    """Return the priority of a connection with these modifiers, None if it has none. Raises ProtocolError."""
    found = modifiers.read(text)
    if "recv" not in found:
        return None
    wanted = as_string(found["recv"].get(0))
    if wanted == monitoring.NAME:
        return None
    if wanted != _NAME:
        raise ProtocolError(f"there is no modifier recv.{wanted}; there are recv.{_NAME} and recv.{monitoring.NAME}")
    unknown = [key for key in found if key not in ("recv", *_KNOWN, *_OF_CARRIERS)]
    if unknown and "send" not in found:  # whose settings these may be
        raise ProtocolError(f"recv.{_NAME} has no setting {unknown[0]!r}; its settings are {', '.join(_KNOWN)}")
    numbers = {key: _number(key, found[key]) if key in found else usual for key, usual in _NUMBERS.items()}
    return Priority(
        sender,
        reset=abs(numbers["tc"]),
        resting=abs(numbers["tr"]),
        stimulation=abs(numbers["st"] or _NUMBERS["st"]) / _TENTHS,
        bias=numbers["bs"] / _TENTHS,
        virtual="virtual" in found,
        weights=_weights(found.get("ex", Bottle())),
    )


def _number(key: str, values: Bottle) -> float:
    value: Value | None = values.get(0)
    if len(values) != 1 or not isinstance(value, int | float) or not math.isfinite(value):
        raise ProtocolError(f"recv.{_NAME}: {key} is one whole number, as in {key}.2, not {values.to_text()!r}")
    return as_float(value)


def check_output(carrier: str) -> None:
    """Check the modifiers of a connection that is to be made. Raises ConnectError for those that no one would apply.

    Modifiers of the receiving port are its own affair, as it may have others.
    """
    try:
        found = modifiers.read(modifiers.split(carrier)[1])
        for key in _OF_SENDERS:
            if key in found and (key, found[key]) != ("send", Bottle([monitoring.NAME])):
                raise ConnectError(
                    f"there is no modifier {key}.{found[key].to_text()}; there is send.{monitoring.NAME}"
                )
        if found and "recv" not in found and "send" not in found:
            known = f"recv.{_NAME}, recv.{monitoring.NAME} and send.{monitoring.NAME}"
            raise ConnectError(f"there is no modifier {next(iter(found))!r}; there are {known}")
        monitoring.of_connection(found, "send")
        if "recv" in found and as_string(found["recv"].get(0)) == _NAME:
            of_input("", modifiers.split(carrier)[1])
    except ProtocolError as error:
        raise ConnectError(str(error)) from None


class PriorityGroup:
    """The connections of a port that have a priority. Any thread. ``report`` is called when none can be chosen."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._lock = threading.Lock()
        self._members: dict[Priority, None] = {}
        self._solvable = True

    def add(self, member: Priority) -> None:
        """Add a connection."""
        with self._lock:
            self._members[member] = None

    def discard(self, member: Priority) -> None:
        """Remove a connection that has ended."""
        with self._lock:
            self._members.pop(member, None)

    def accepts(self, source: Priority, now: float) -> bool:
        """Count a message of ``source`` that arrives ``now``, and return whether it is to be delivered."""
        with self._lock:
            source.stimulate(now)
            for member in self._members:
                member.level(now)
            strengths = self._strengths(list(self._members))
            candidates = [(strength, member) for strength, member in strengths if strength > 0 and not member.virtual]
            return bool(candidates) and max(candidates, key=lambda one: one[0])[1] is source

    def _strengths(self, members: list[Priority]) -> list[tuple[float, Priority]]:
        """Return the strength of each member: ``y = x * (I - A)^-1 * (x * b)``.

        ``x`` is 1 for active ones, ``b`` are the biases, and ``A`` the weights of active ones from others, by column.
        """
        active = [float(member.active) for member in members]
        strengths = [on * member.bias for on, member in zip(active, members, strict=True)]
        if any(member.weights for member in members):
            weights = [
                [on * by.weights.get(member.sender, 0.0) for by in members]
                for on, member in zip(active, members, strict=True)
            ]
            strengths = self._solve(weights, strengths)
        return list(zip(strengths, members, strict=True))

    def _solve(self, weights: list[list[float]], strengths: list[float]) -> list[float]:
        """Return the strengths under the weights; all 0 if these contradict each other, which is reported once."""
        import numpy as np

        try:
            solved = np.linalg.solve(np.eye(len(weights)) - weights, strengths)
        except np.linalg.LinAlgError:
            if self._solvable:
                self._report("the weights of its connections contradict each other: their messages are dropped")
            self._solvable = False
            return [0.0] * len(strengths)
        self._solvable = True
        return [float(strength) for strength in solved]
