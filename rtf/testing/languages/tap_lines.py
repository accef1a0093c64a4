"""The lines of the Test Anything Protocol, versions 12 to 14, each read on its own and without regard to indentation.

What lines mean together (plan, numbers, subtests) is :mod:`rtf.testing.languages.tap`. The protocol: https://testanything.org.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_VERSION = re.compile(r"TAP version ([0-9]{1,9})\s*$", re.IGNORECASE)
_PLAN = re.compile(r"1\.\.([0-9]{1,9})\s*(?:#\s*(.*))?$")
_POINT = re.compile(r"(not )?ok(?=\s|#|$)(?:\s+([0-9]{1,9})(?=\s|#|$))?")
_BAIL_OUT = re.compile(r"Bail out!\s*(.*)$", re.IGNORECASE)
_DIRECTIVE = re.compile(r"(?<!\\)#\s*(skip|todo)(\w*)[\s:]*", re.IGNORECASE)
_SKIP_WORD = re.compile(r"skip\w*[\s:]*", re.IGNORECASE)
_SUBTEST = re.compile(r"#\s*Subtest(?::\s*(.*))?$", re.IGNORECASE)
_ESCAPED = re.compile(r"\\([\\#])")


@dataclass(frozen=True, slots=True)
class VersionLine:
    """``TAP version 14``."""

    version: int


@dataclass(frozen=True, slots=True)
class PlanLine:
    """``1..7``; ``reason`` is what follows ``# SKIP`` (or the mere ``#``)."""

    count: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class PointLine:
    """``ok 3 - description # SKIP reason``; ``number`` is None where the line has none."""

    ok: bool
    number: int | None
    description: str
    directive: str = ""  # "skip", "todo" or none
    reason: str = ""


@dataclass(frozen=True, slots=True)
class BailOutLine:
    """``Bail out! reason``."""

    reason: str


@dataclass(frozen=True, slots=True)
class SubtestLine:
    """``# Subtest: name``: a nested document follows."""

    name: str


@dataclass(frozen=True, slots=True)
class CommentLine:
    """``# anything``."""

    text: str


Line = VersionLine | PlanLine | PointLine | BailOutLine | SubtestLine | CommentLine


def read_line(text: str) -> Line | None:
    """Read one line without its indentation and line end; None for a line that is not of the protocol."""
    first = text[:1]
    if first == "#":
        return _comment(text)
    if first in "on":
        return _point(text)
    if first == "1":
        match = _PLAN.match(text)
        return PlanLine(int(match[1]), _SKIP_WORD.sub("", match[2] or "", count=1).strip()) if match else None
    if first in "Tt":
        match = _VERSION.match(text)
        return VersionLine(int(match[1])) if match else None
    match = _BAIL_OUT.match(text)
    return BailOutLine(match[1].strip()) if match else None


def _comment(text: str) -> SubtestLine | CommentLine:
    match = _SUBTEST.match(text)
    return SubtestLine((match[1] or "").strip()) if match else CommentLine(text[1:].strip())


def _point(text: str) -> PointLine | None:
    match = _POINT.match(text)
    if match is None:
        return None
    rest = text[match.end() :]
    directive, reason = "", ""
    found = next((d for d in _DIRECTIVE.finditer(rest) if d[1].lower() == "skip" or not d[2]), None)
    if found is not None:
        directive, reason = found[1].lower(), rest[found.end() :].strip()
        rest = rest[: found.start()]
    description = _unescape(rest.strip().removeprefix("- ").strip())
    if description == "-":
        description = ""
    return PointLine(not match[1], int(match[2]) if match[2] else None, description, directive, _unescape(reason))


def _unescape(text: str) -> str:
    return _ESCAPED.sub(r"\1", text) if "\\" in text else text


def looks_like_tap(text: str) -> bool:
    """Whether a program whose first line that is not empty is ``text`` speaks the protocol.

    A version, a plan, or a test point that has more to it than the bare word ``ok``, which any program may print.
    """
    line = read_line(text.rstrip())
    if isinstance(line, PointLine):
        return line.number is not None or text.split("ok", 1)[1].lstrip().startswith(("- ", "#"))
    return isinstance(line, VersionLine | PlanLine)
