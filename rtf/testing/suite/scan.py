"""From the bytes of a suite file to a tree of elements that know their line and column.

The parser is expat, because it tells the place of every start tag and never opens anything by itself. What the files
of the past contain and a strict parser rejects (``--`` in comments) is fixed before, character for character, so that
places stay true. What has no business in a suite file is refused: document type definitions with a body, entities,
encodings nobody can name, files or nestings beyond reason.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from xml.parsers import expat

from rtf.errors import Location
from rtf.testing.suite.values import quote

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.suite.diagnostics import DiagnosticLog

MAX_BYTES = 16 * 1024 * 1024
MAX_DEPTH = 64
MAX_ELEMENTS = 400_000
MAX_ATTRIBUTES = 256  # of one element

_MARKUP = re.compile(
    r"""<!--(?P<comment>.*?)-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|(?P<unclosed><!--|<!\[CDATA\[|<\?)"""
    r"""|<!DOCTYPE(?P<bare>\s(?:[^\[\]<>"']|"[^"]*"|'[^']*')*+>)?|<[^!?]""",
    re.DOTALL,
)
_CLOSER = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
_ENCODING = re.compile(rb"""<\?xml\s[^>]*?\bencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_READABLE = re.compile(r"utf-?8|(us-)?ascii|iso-?8859-?\d{1,2}|latin-?1|(windows-|cp)125\d")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=<>/]+)\s*=\s*(?:"[^"]*"|'[^']*')""")
_LINE_END = re.compile("\r\n|\r|\n")
_NOT_LINE_END = re.compile(r"[^\r\n]")
_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_CONTAINERS = frozenset({"suite", "for"})


@dataclass(slots=True, eq=False)
class Element:
    """One element: its tag as written and in lower case, its attributes, its own text and its children."""

    tag: str
    name: str
    attributes: Mapping[str, str]
    location: Location
    offset: int
    source: bytes
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)
    _text: str | None = None
    _places: dict[bytes, Location] | None = None

    @property
    def text(self) -> str:
        """The text that stands directly in the element, comments and children left out, white space condensed."""
        if self._text is None:
            self._text = " ".join("".join(self.pieces).split())
        return self._text

    def attribute_location(self, name: str) -> Location:
        """Where an attribute's name stands; the element's place when that cannot be told."""
        if self._places is None:
            self._places = self._find_attributes()
        return self._places.get(name.encode(), self.location)

    def _find_attributes(self) -> dict[bytes, Location]:
        places: dict[bytes, Location] = {}
        place, told = self.location, self.offset
        position = self.offset + 1 + len(self.tag.encode())
        while match := _ATTRIBUTE.match(self.source, position):
            place = _advance(place, self.source[told : match.start(1)].decode())
            told, position = match.start(1), match.end()
            places[match[1]] = place
        return places


@dataclass(frozen=True, slots=True)
class Document:
    """A scanned file. ``complete`` is False when the parser had to give up; ``root`` then holds what came before."""

    root: Element | None
    complete: bool


class _Refused(Exception):
    def __init__(self, message: str, location: Location, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.location, self.hint = message, location, hint


def scan(data: bytes, file: str, problems: DiagnosticLog) -> Document:
    """Read a file's bytes into a tree; every problem goes to ``problems``, none is raised."""
    builder: _Builder | None = None
    try:
        text = _forgive(_decode(data, file), file, problems)
        builder = _Builder(text.encode(), file)
        builder.run()
    except _Refused as refusal:
        problems.error(refusal.message, refusal.location, refusal.hint)
        return Document(builder.partial() if builder else None, complete=False)
    return Document(builder.root, complete=True)


def _decode(data: bytes, file: str) -> str:
    """The text of a file, by its byte order mark or its declaration."""
    start = Location(file, 1, 1)
    if len(data) > MAX_BYTES:
        raise _Refused(f"the file is larger than {MAX_BYTES // 2**20} MiB", Location(file))
    mark, encoding = next(((mark, encoding) for mark, encoding in _BOMS if data.startswith(mark)), (b"", ""))
    if not mark:
        declared = _ENCODING.match(data[:256])
        encoding = declared[1].decode().lower() if declared else "utf-8"
        if not _READABLE.fullmatch(encoding):
            raise _Refused(f"the encoding {quote(encoding)} is not supported", start, "save the file as UTF-8")
    data = data.removeprefix(mark)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        place = _advance(start, data[: error.start].decode(encoding, "replace"))
        raise _Refused(f"this is not {encoding.upper()} text", place, "save the file as UTF-8") from None
    except LookupError:
        raise _Refused(f"there is no encoding {quote(encoding)}", start, "save the file as UTF-8") from None


def _forgive(text: str, file: str, problems: DiagnosticLog) -> str:
    """Blank out, character for character, what old files have and the parser refuses: '--' in comments, a bare DOCTYPE.

    A document type anywhere else, or with declarations in it, stays, and the parser refuses it with its place.
    """
    forgiven: list[int] = []
    in_prolog = True

    def mend(markup: re.Match[str]) -> str:
        nonlocal in_prolog
        start, whole, comment = markup.start(), markup[0], markup["comment"]
        if markup["unclosed"]:
            message = f"what begins here with {whole} is never closed"
            raise _Refused(message, _advance(Location(file, 1, 1), text[:start]), f"end it with {_CLOSER[whole]}")
        if comment is not None and ("--" in comment or comment.endswith("-")):
            forgiven.append(start)
            return f"<!--{comment.replace('-', ' ')}-->"
        if markup["bare"] and in_prolog:
            whole = _NOT_LINE_END.sub(" ", whole)
        in_prolog = in_prolog and whole.startswith(("<!--", "<?"))
        return whole

    mended = _MARKUP.sub(mend, text)
    if forgiven:
        more = f" (and {len(forgiven) - 1} more)" if len(forgiven) > 1 else ""
        problems.warning(
            f"this comment{more} contains '--', which other XML programs reject",
            _advance(Location(file, 1, 1), text[: forgiven[0]]),
            "write a single dash",
        )
    return mended


class _Builder:
    """The call-backs of one expat parser, and the tree they grow."""

    def __init__(self, data: bytes, file: str) -> None:
        self.root: Element | None = None
        self._data = data
        self._file = file
        self._stack: list[Element] = []
        self._count = 0
        parser = expat.ParserCreate("utf-8")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.StartDoctypeDeclHandler = self._doctype
        self._parser = parser

    def run(self) -> None:
        try:
            self._parser.Parse(self._data, True)
        except expat.ExpatError as error:
            message = f"this is not well-formed XML: {expat.ErrorString(error.code)}"
            raise _Refused(message, Location(self._file, error.lineno, error.offset + 1), self._open_hint()) from None

    def partial(self) -> Element | None:
        """What was read before the parser gave up, without the elements of which only a part is known."""
        while self._stack:
            element = self._stack.pop()
            if self._stack and element.name not in _CONTAINERS:
                del self._stack[-1].children[-1]
        return self.root

    def _open_hint(self) -> str:
        if not self._stack:
            return ""
        element = self._stack[-1]
        return f"<{quote(element.tag)[1:-1]}> of line {element.location.line} is still open here"

    def _here(self) -> Location:
        return Location(self._file, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        location = self._here()
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise _Refused(f"the file has more than {MAX_ELEMENTS} elements", location)
        if len(self._stack) >= MAX_DEPTH:
            raise _Refused(f"elements are nested more than {MAX_DEPTH} deep", location)
        if len(attributes) > MAX_ATTRIBUTES:
            raise _Refused(f"an element has more than {MAX_ATTRIBUTES} attributes", location)
        element = Element(tag, tag.lower(), attributes, location, self._parser.CurrentByteIndex, self._data)
        if self._stack:
            self._stack[-1].children.append(element)
            self._stack[-1].pieces.append(" ")
        else:
            self.root = element
        self._stack.append(element)

    def _end(self, _tag: str) -> None:
        self._stack.pop()

    def _text(self, text: str) -> None:
        self._stack[-1].pieces.append(text)

    def _doctype(self, _name: str, _system: str | None, _public: str | None, _subset: bool) -> None:
        raise _Refused(
            "a document type with declarations in it, or behind the first element, is refused",
            self._here(),
            "write the values out, or use <for> and ${name}; only a bare <!DOCTYPE suite> line is accepted",
        )


def _advance(location: Location, text: str) -> Location:
    """The place behind a text that begins at ``location``."""
    ends = [match.end() for match in _LINE_END.finditer(text)]
    if not ends:
        return Location(location.file, location.line, location.column + len(text))
    return Location(location.file, location.line + len(ends), len(text) - ends[-1] + 1)
