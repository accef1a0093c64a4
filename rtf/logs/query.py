"""What is asked of a log: the filters of ``rtf log``, as a condition of SQLite."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from rtf import clock
from rtf.logs.record import Level


def read_level(text: str) -> Level:
    """Return a level by its name in any case. Raises ValueError, which names all of them."""
    try:
        return Level[text.upper()]
    except KeyError:
        names = ", ".join(level.name.lower() for level in Level)
        raise ValueError(f"{text!r} is no level; the levels are {names}") from None


def read_moment(text: str) -> float:
    """Return seconds since 1970: how long ago, such as ``10min``, or a time such as ``2026-11-25T14:00`` of this place.

    Raises ValueError.
    """
    try:
        return clock.now() - clock.read_duration(text)
    except ValueError:
        pass
    try:
        return datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError):
        raise ValueError(
            f"{text!r} is no time; write how long ago, such as 10min, or a time such as 2026-11-25T14:00"
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """Which records are wanted; an empty field wants all.

    ``level`` is the least serious one. ``process`` is a program's name, as at the end of its port's name, its process
    number, or the whole name of its port; ``host`` is the first part of that name, a computer or a server of yarprun.
    ``component`` includes those below it: ``yarp.os`` is ``yarp.os.Port``, too. In these three ``*`` and ``?`` stand
    for any characters. ``text`` is a part of the message, in any case of the letters a to z. ``since`` and ``until``
    are seconds since 1970 at which the record arrived at the collector.
    """

    level: Level = Level.UNKNOWN
    process: str = ""
    host: str = ""
    component: str = ""
    text: str = ""
    since: float | None = None
    until: float | None = None

    def condition(self) -> tuple[str, list[object]]:
        """Return the condition on ``records`` joined with ``senders``, and the values of its question marks."""
        terms: list[tuple[str, list[object]]] = []
        if self.level > Level.UNKNOWN:
            terms.append(("level >= ?", [int(self.level)]))
        if self.process:
            one = _pattern(self.process)
            terms.append((_any("name GLOB ?", 3), [one, f"/log/*/{one}", f"/log/*/{one}/*"]))
        if self.host:
            terms.append(("name GLOB ?", [f"/log/{_pattern(self.host)}/*"]))
        if self.component:
            one = _pattern(self.component)
            terms.append((_any("component GLOB ?", 2), [one, f"{one}.*"]))
        if self.text:
            terms.append(("instr(lower(message), lower(?)) > 0", [self.text]))
        if self.since is not None:
            terms.append(("arrived >= ?", [self.since]))
        if self.until is not None:
            terms.append(("arrived <= ?", [self.until]))
        return " AND ".join(text for text, _ in terms) or "TRUE", [value for _, values in terms for value in values]


def _any(term: str, count: int) -> str:
    return f"({' OR '.join([term] * count)})"


def _pattern(text: str) -> str:
    """Return a pattern of GLOB in which only ``*`` and ``?`` are special; programs have labels in brackets."""
    return text.replace("[", "[[]")
