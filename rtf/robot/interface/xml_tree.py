"""Parsing of a robot's file to a tree of elements with line and column.

The parser is expat, which knows the position of every start tag and opens no files. The document type line is parsed
but never loaded; a file that declares entities is refused, and so is one beyond the limits. Double dashes in comments,
as in old files, are accepted.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NoReturn
from xml.parsers import expat

from rtf.errors import Location
from rtf.robot.interface.problems import RobotFileError

if TYPE_CHECKING:
    from collections.abc import Mapping

MAX_BYTES = 8 << 20  # of one file
MAX_DEPTH = 64
MAX_ELEMENTS = 200_000  # of one file
MAX_VALUE = 64 << 10  # characters of one attribute or text

_COMMENT = re.compile(r"<!\[CDATA\[.*?\]\]>|<!--(.*?)-->", re.DOTALL)


@dataclass(slots=True, eq=False)
class Element:
    """An element: its tag, its attributes, the text directly in it, and its children."""

    tag: str
    attributes: Mapping[str, str]
    location: Location
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The text directly in the element, stripped."""
        return "".join(self.pieces).strip()


@dataclass(frozen=True, slots=True)
class Document:
    """A file: its root element, and its document type line (empty without one)."""

    root: Element
    doctype: str = ""
    public_id: str = ""
    elements: int = 1
    doctype_location: Location = field(default_factory=Location)


def scan(data: bytes, file: str) -> Document:
    """Parse a file. Raises RobotFileError, with the location, for invalid XML or a file beyond the limits."""
    if len(data) > MAX_BYTES:
        _refuse(Location(file), f"the file is larger than {MAX_BYTES >> 20} MiB", "take files apart with xi:include")
    return _Builder(_repaired(data), file).run()


def _repaired(data: bytes) -> bytes:
    """Replace dashes in comments, which a strict parser rejects, by blanks; all positions stay the same."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data

    def blank(match: re.Match[str]) -> str:
        return match[0] if match[1] is None else f"<!--{match[1].replace('-', ' ')}-->"

    return _COMMENT.sub(blank, data.decode("latin-1")).encode("latin-1")


def _refuse(location: Location, sentence: str, hint: str = "") -> NoReturn:
    raise RobotFileError.of(location, sentence, hint)


class _Builder:
    """The callbacks of a parser, which build the tree."""

    def __init__(self, data: bytes, file: str) -> None:
        self._data = data
        self._file = file
        self._document = Document(Element("", {}, Location(file)))
        self._stack: list[Element] = []
        self._count = 0
        self._characters = 0
        parser = self._parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.StartDoctypeDeclHandler = self._doctype
        parser.EntityDeclHandler = self._entity
        parser.SkippedEntityHandler = self._skipped

    def run(self) -> Document:
        try:
            self._parser.Parse(self._data, True)
        except expat.ExpatError as error:
            place = Location(self._file, error.lineno, error.offset + 1)
            _refuse(place, f"this is not well-formed XML: {expat.ErrorString(error.code)}", "fix this")
        except RobotFileError:
            raise
        except (ValueError, LookupError) as error:
            _refuse(Location(self._file, 1, 1), f"this cannot be read: {error}", "save the file as UTF-8")
        return replace(self._document, elements=self._count)

    def _here(self) -> Location:
        return Location(self._file, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        here = self._here()
        self._count += 1
        if len(self._stack) >= MAX_DEPTH:
            _refuse(here, f"elements are nested deeper than {MAX_DEPTH}", "no robot needs that")
        if self._count > MAX_ELEMENTS:
            _refuse(here, f"the file has more than {MAX_ELEMENTS} elements", "take it apart with xi:include")
        for name, value in attributes.items():
            if len(name) + len(value) > MAX_VALUE:
                _refuse(here, f"an attribute of <{tag[:40]}> is longer than {MAX_VALUE >> 10} KiB", "shorten it")
        element = Element(tag, attributes, here)
        if self._stack:
            self._stack[-1].children.append(element)
        else:
            self._document = replace(self._document, root=element)
        self._stack.append(element)
        self._characters = 0

    def _end(self, _tag: str) -> None:
        self._stack.pop()
        self._characters = 0

    def _text(self, text: str) -> None:
        self._characters += len(text)
        if self._characters > MAX_VALUE:
            _refuse(self._here(), f"a text is longer than {MAX_VALUE >> 10} KiB", "shorten it")
        self._stack[-1].pieces.append(text)

    def _doctype(self, name: str, _system: str | None, public: str | None, _internal: int) -> None:
        self._document = replace(
            self._document, doctype=name, public_id=public or "", doctype_location=self._doctype_place()
        )

    def _doctype_place(self) -> Location:
        """Return the start of the document type; the parser only knows its end."""
        before = self._data[: max(0, self._data.find(b"<!DOCTYPE"))]
        return Location(self._file, before.count(b"\n") + 1, len(before) - before.rfind(b"\n"))

    def _entity(self, name: str, *_rest: object) -> None:
        _refuse(self._here(), f"the file declares the entity {name[:40]!r}", "write what it stands for")

    def _skipped(self, name: str, _parameter: int) -> None:
        _refuse(self._here(), f"there is no entity {name[:40]!r}", "write the character, or &amp;, &lt;, &gt;")
