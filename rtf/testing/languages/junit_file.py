"""Read the JUnit file that a program wrote about itself, as GoogleTest and most other frameworks do.

The file comes from a program under test and is trusted with nothing: its size and number of cases are bounded, it may
have no document type, no entity is expanded and nothing is fetched. Writing such files is the reporters' work.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.errors import Location
from rtf.testing.outcome import TestingError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from lxml import etree

MAX_SIZE = 32 << 20  # bytes
MAX_CASES = 100_000
MAX_TEXT = 64 * 1024  # characters of one failure

_ROOTS = frozenset({"testsuites", "testsuite"})
_PROBLEMS = frozenset({"failure", "error"})
#: GoogleTest begins the text of a failure with the place, as compilers do.
_PLACE = re.compile(r"\s*([^\s:][^:\n]*):([0-9]{1,9})(?::[0-9]+)?\s*(?:\n|:|$)")


class JunitFileError(TestingError, ValueError):
    """A file that is no usable JUnit file; the sentence names file, line and what is wrong."""


@dataclass(frozen=True, slots=True)
class JunitProblem:
    """One ``<failure>`` or ``<error>`` of a case; ``file`` and ``line`` are known where the text names them."""

    kind: str
    message: str = ""
    text: str = ""
    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        """Message and text; often the text repeats the message, then only the text."""
        return self.text if self.message in self.text else f"{self.message}\n{self.text}".strip()

    @property
    def detail(self) -> str:
        """Message and text without the place, where they begin with it."""
        text = str(self)
        return (_PLACE.sub("", text, count=1).strip() if self.file else text) or text


@dataclass(frozen=True, slots=True)
class JunitCase:
    """One ``<testcase>``. ``skipped`` is the reason, None when it was not skipped; ``time`` is in seconds."""

    name: str
    classname: str = ""
    suite: str = ""
    problems: tuple[JunitProblem, ...] = ()
    skipped: str | None = None
    time: float | None = None
    file: str = ""
    line: int = 0

    @property
    def subject(self) -> str:
        """What the case is called in a report: ``classname.name``, or with the suite's name where it has no class."""
        return ".".join(part for part in (self.classname or self.suite, self.name) if part) or "unnamed"


def read_junit(path: Path) -> list[JunitCase]:
    """Read all cases of a file in their order. Raises JunitFileError, and OSError when it cannot be opened."""
    with path.open("rb") as stream:
        data = stream.read(MAX_SIZE + 1)
    if len(data) > MAX_SIZE:
        raise JunitFileError(f"{path}: larger than {MAX_SIZE >> 20} MiB")
    if not data.strip():
        raise JunitFileError(f"{path}: is empty; did the program end before it wrote its results?")
    root = _parse(path, data)
    name = _local(root)
    if name not in _ROOTS:
        raise JunitFileError(f"{Location(str(path), _line(root))}: <{name}> is no root of a JUnit file")
    cases = [_case(element) for element in _cases(path, root)]
    del root
    return cases


def _parse(path: Path, data: bytes) -> etree._Element:
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        line, column = error.position
        raise JunitFileError(f"{Location(str(path), line, column)}: no XML: {error.msg}") from None
    except ValueError as error:
        raise JunitFileError(f"{path}: no XML: {error}") from None
    if root.getroottree().docinfo.doctype:  # type: ignore[union-attr]  # the stubs lack it
        raise JunitFileError(f"{path}: has a document type; results need none, and it may hide anything")
    return root


def _cases(path: Path, root: etree._Element) -> Iterator[etree._Element]:
    for count, element in enumerate(root.iter("{*}testcase")):
        if count >= MAX_CASES:
            raise JunitFileError(f"{path}: more than {MAX_CASES} test cases")
        yield element


def _case(element: etree._Element) -> JunitCase:
    children = [child for child in element if isinstance(child.tag, str)]
    skipped = [child for child in children if _local(child) == "skipped"]
    reason: str | None = None
    if skipped:
        reason = _attribute(skipped[0], "message") or _text(skipped[0]) or "skipped"
    elif element.get("status") == "notrun" or element.get("result") == "suppressed":
        reason = "disabled"  # GoogleTest's DISABLED_ tests
    return JunitCase(
        name=_attribute(element, "name"),
        classname=_attribute(element, "classname"),
        suite=_suite_name(element),
        problems=tuple(_problem(child) for child in children if _local(child) in _PROBLEMS),
        skipped=reason,
        time=_seconds(element.get("time")),
        file=_attribute(element, "file"),
        line=_number(element.get("line")),
    )


def _problem(element: etree._Element) -> JunitProblem:
    text = _text(element)
    message = _attribute(element, "message") or _attribute(element, "type")
    match = _PLACE.match(text or message)
    file, line = (match[1].strip(), int(match[2])) if match else ("", 0)
    return JunitProblem(_local(element), message, text, file, line)


def _suite_name(element: etree._Element) -> str:
    for above in element.iterancestors():
        if _local(above) == "testsuite":
            return _attribute(above, "name")
    return ""


def _local(element: etree._Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _line(element: etree._Element) -> int:
    line: object = element.sourceline
    return line if isinstance(line, int) else 0


def _attribute(element: etree._Element, name: str) -> str:
    return str(element.get(name, "")).strip()[:MAX_TEXT]


def _text(element: etree._Element) -> str:
    return "".join(str(part) for part in element.itertext()).strip()[:MAX_TEXT]


def _number(text: str | None) -> int:
    return int(text) if text and text.isascii() and text.isdigit() and len(text) < len("1000000000") else 0


def _seconds(text: str | None) -> float | None:
    try:
        value = float((text or "").replace(",", ""))
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0 else None
