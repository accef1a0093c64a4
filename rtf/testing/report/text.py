"""Texts for reports: texts of tests made safe to show, and places, durations and counts in words.

The texts of a test, a fixture or a suite file are untrusted: they must not move a terminal's cursor, hide a line or
break a file's encoding. Here such characters are made visible instead. XML and JSON have rules of their own, which
their reporters keep.
"""

from __future__ import annotations

import math
import os
import re
from typing import TYPE_CHECKING

from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TextIO

    from rtf.testing.events import FixtureIncident, Measured, Message

#: Control characters but tab and line feed, characters that turn the direction of writing, and lone surrogates.
_UNSAFE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")

_PLURALS = {
    Verdict.ERROR: "errors",
    Verdict.UNEXPECTED_PASS: "unexpected passes",
    Verdict.EXPECTED_FAILURE: "expected failures",
}


def joined(text: str) -> str:
    """Return the text with each pair of surrogates as the one character that it stands for, as JSON readers read it."""
    return text if text.isascii() else text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "surrogatepass")


def without_surrogates(text: str) -> str:
    """Return the text with pairs of surrogates joined and lone ones escaped, for formats of Unicode alone."""
    return encodable(joined(text), "utf-8")


def _escaped(match: re.Match[str]) -> str:
    code = ord(match.group())
    return f"\\x{code:02x}" if code <= 0xFF else f"\\u{code:04x}"  # noqa: PLR2004 - one byte


def shown(text: str) -> str:
    r"""Return the text with what would harm a terminal escaped, such as ``\x1b``; line feeds and tabs stay."""
    if text.isascii() and text.isprintable():
        return text
    return _UNSAFE.sub(_escaped, joined(text).replace("\r\n", "\n"))


def encodable(text: str, encoding: str | None) -> str:
    """Return the text with what this encoding has no bytes for escaped, so that printing it never fails."""
    encoding = encoding or "utf-8"
    return text if text.isascii() else text.encode(encoding, "backslashreplace").decode(encoding)


def wants_colour(stream: TextIO, choice: bool | None = None) -> bool:
    """Return whether to use colours: by the caller's choice, ``NO_COLOR``, ``FORCE_COLOR``, or the terminal."""
    if choice is not None:
        return choice
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR", "0") not in ("", "0"):
        return True
    return capable_terminal(stream)


def capable_terminal(stream: TextIO) -> bool:
    """Return whether the stream is a terminal that understands escape sequences."""
    return stream.isatty() and os.environ.get("TERM", "dumb") not in ("", "dumb", "unknown")


def one_line(text: str) -> str:
    """Return the text safe to show and in one line: its first, and a mark if there is more."""
    first, separator, _ = shown(text).strip("\n").partition("\n")
    return f"{first} …" if separator else first


def near_path(file: str) -> str:
    """Return a file's path, relative if it is below the working folder, as editors and terminals link it."""
    if not file.startswith("/"):
        return file
    here = f"{os.getcwd()}/"  # noqa: PTH109 - called for every line of a report
    return file.removeprefix(here)


def place(file: str, line: int = 0, column: int = 0) -> str:
    """Return a place as compilers write it, ``path:line:column``, as far as it is known."""
    parts = [shown(near_path(file)), *(str(number) for number in ((line, column) if line else ()) if number)]
    return ":".join(parts) if file else ""


def cut(text: str, limit: int) -> str:
    """Return the two ends of a text that is too long, with a note between them."""
    if len(text) <= limit:
        return text
    half = limit // 2
    return f"{text[:half]}\n… {len(text) - 2 * half} characters left out; the journal has them …\n{text[-half:]}"


def duration(seconds: float) -> str:
    """Write a duration for people, such as ``12 ms``, ``3.4 s``, ``2 min 05 s`` or ``1 h 02 min``."""
    if not math.isfinite(seconds) or seconds < 0:
        return "? s"
    if seconds < 0.9995:  # noqa: PLR2004 - less than that is written in milliseconds
        return f"{seconds * 1000:.0f} ms"
    if seconds < 59.95:  # noqa: PLR2004 - less than that is written in seconds
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:  # noqa: PLR2004 - an hour
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def counts(numbers: Mapping[Verdict, int]) -> str:
    """Write how many tests ended how, such as ``2 failed, 1 error, 4 passed``."""
    parts = []
    for verdict in Verdict:
        number = numbers.get(verdict, 0)
        if number:
            parts.append(f"{number} {_PLURALS.get(verdict, verdict) if number > 1 else verdict}")
    return ", ".join(parts) or "no tests"


def sentence(message: Message) -> str:
    """Return a message as its author wrote it: ``subject: title: detail``."""
    return ": ".join(part for part in (message.subject, message.title, message.detail) if part)


def problem_text(message: Message) -> str:
    """Return a failure or error in full: the sentence, the place on a line of its own, the traceback."""
    lines = [sentence(message)]
    where = place(message.file, message.line)
    if where:
        lines.append(f"  at {where}")
    if message.traceback:
        lines.append(message.traceback.rstrip("\n"))
    return "\n".join(lines)


def measurement(event: Measured) -> str:
    """Return a measurement with its name, limits, margin and verdict in one sentence."""
    name = f"{event.subject}: {event.name}" if event.subject else event.name
    return f"{name} = {measured(event)}"


def measured(event: Measured) -> str:
    """Return a measured value with its limits, margin and verdict; the number comes first."""
    from rtf.testing.measurement import limits_text, quantity

    text = quantity(event.value, event.unit)
    if event.low is None and event.high is None:
        return text
    text += f", expected {limits_text(event.low, event.high, event.unit)}"
    if event.margin is not None:
        text += f", margin {quantity(event.margin, event.unit)}"
    return f"{text}, {event.verdict}"


def parameter(row: Mapping[str, str]) -> str:
    """Return the value of a parameter with its unit and its source."""
    value = " ".join(part for part in (row.get("value", ""), row.get("unit", "")) if part)
    return f"{value} ({row['source']})" if row.get("source") else value


def incident(event: FixtureIncident) -> str:
    """Return the incident of a fixture in one sentence."""
    status = "" if event.exit_status is None else f"exit status {event.exit_status}"
    ends = [end for end in (status, event.signal) if end and end not in event.cause]
    text = f"{event.fixture} #{event.generation} in {event.phase}: {event.cause}"
    if ends:
        text += f" ({', '.join(ends)})"
    return f"{text}, during {event.test}" if event.test else text
