"""From the bytes of an XML file to a tree of elements that know their line and column: suites and robots are read so.

The parser is expat, because it reports the place of every start tag and never opens anything by itself. What the files
of the past contain and a strict parser rejects (``--`` in comments) is fixed before, character for character, so that
places stay true. Refused are entities, encodings nobody can name, and files or nestings beyond reason.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from xml.parsers import expat

from rtf.errors import Location, RtfError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

COMMENT = "!--"
MAX_BYTES = 16 * 1024 * 1024
MAX_DEPTH = 64
MAX_ELEMENTS = 400_000
MAX_ATTRIBUTES = 256  # of one element

_MARKUP = re.compile(
    r"""<!--(?P<comment>.*?)-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|(?P<unclosed><!--|<!\[CDATA\[|<\?)"""
    r"""|<!DOCTYPE(?P<bare>\s(?:[^\[\]<>"']|"[^"]*"|'[^']*')*+>)?|<[^!?]""",
    re.DOTALL,
)
_BARE = re.compile(r"""\s+(?P<name>[^\s>]+)(?:\s+PUBLIC\s+["'](?P<public>[^"']*)["'])?""")
_CLOSER = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
_ENCODING = re.compile(rb"""<\?xml\s[^>]*?\bencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_READABLE = re.compile(r"utf-?8|(us-)?ascii|iso-?8859-?\d{1,2}|latin-?1|(windows-|cp)125\d")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=<>/]+)\s*=\s*(?:"[^"]*"|'[^']*')""")
_LINE_END = re.compile("\r\n|\r|\n")
_NOT_LINE_END = re.compile(r"[^\r\n]")
_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_LONGEST_SHOWN = 60
_WRITE_CHARACTER = "write the character, or &amp;, &lt;, &gt;"


class XmlError(RtfError):
    """A file that cannot be read: the message, its place, a hint, and the elements that were read ``before``."""

    def __init__(self, message: str, location: Location, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.location, self.hint = message, location, hint
        self.before: tuple[Element, ...] = ()


@dataclass(slots=True, eq=False)
class Element:
    """An element: its tag as written and in lower case, its attributes, the text directly in it, and its children."""

    tag: str
    name: str
    attributes: Mapping[str, str]
    location: Location
    offset: int
    source: bytes
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)
    _places: dict[bytes, Location] | None = None

    @property
    def text(self) -> str:
        """The text directly in the element, stripped; comments and children are left out."""
        return "".join(self.pieces).strip()

    def attribute_location(self, name: str) -> Location:
        """Where an attribute's name stands; the element's place when that is unknown."""
        if self._places is None:
            self._places = {}
            place, counted = self.location, self.offset
            position = self.offset + 1 + len(self.tag.encode())
            while match := _ATTRIBUTE.match(self.source, position):
                place = self._places[match[1]] = _advance(place, self.source[counted : match.start(1)].decode())
                counted, position = match.start(1), match.end()
        return self._places.get(name.encode(), self.location)


@dataclass(slots=True)
class Document:
    """A file: its root, the number of its elements, and its document type (empty without one)."""

    root: Element | None = None
    elements: int = 0
    doctype: str = ""
    public_id: str = ""
    doctype_location: Location = field(default_factory=Location)


def parse(
    data: bytes,
    file: str,
    warn: Callable[[str, Location, str], None] | None = None,
    *,
    declarations: bool = False,
    comments: bool = False,
) -> Document:
    """Read a file's bytes into a tree. Raises XmlError; ``warn`` is given what other programs would reject.

    With ``declarations`` a document type may have some; they are not heeded, and entities are refused all the same.
    With ``comments`` those inside the root are children, too, with the tag :data:`COMMENT` and their text.
    """
    document = Document()
    text = _without_oddities(_decoded(data, file), file, document, warn)
    builder = _Builder(text.encode(), file, document, declarations=declarations)
    if comments:
        builder.keep_comments()
    builder.run()
    return document


def quote(text: str) -> str:
    """Write a text from a file into a message: in quotes, control characters escaped, cut where it gets long."""
    return repr(text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 1] + "…")


def _decoded(data: bytes, file: str) -> str:
    """The text of a file, by its byte order mark or its declaration."""
    start = Location(file, 1, 1)
    if len(data) > MAX_BYTES:
        raise XmlError(f"the file is larger than {MAX_BYTES >> 20} MiB", Location(file), "take it apart")
    mark, encoding = next(((mark, encoding) for mark, encoding in _BOMS if data.startswith(mark)), (b"", ""))
    if not mark:
        declared = _ENCODING.match(data[:256])
        encoding = declared[1].decode().lower() if declared else "utf-8"
        if not _READABLE.fullmatch(encoding):
            raise XmlError(f"the encoding {quote(encoding)} is not supported", start, "save the file as UTF-8")
    data = data.removeprefix(mark)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        place = _advance(start, data[: error.start].decode(encoding, "replace"))
        raise XmlError(f"this is not {encoding.upper()} text", place, "save the file as UTF-8") from None
    except LookupError:
        raise XmlError(f"there is no encoding {quote(encoding)}", start, "save the file as UTF-8") from None


def _without_oddities(
    text: str, file: str, document: Document, warn: Callable[[str, Location, str], None] | None
) -> str:
    """Blank out, character for character, ``--`` in comments and the document type line, which the document has then.

    A document type anywhere else, or with declarations in it, stays for the parser.
    """
    start = Location(file, 1, 1)
    dashed: list[int] = []
    in_prolog = True

    def blank(markup: re.Match[str]) -> str:
        nonlocal in_prolog
        at, whole, comment, bare = markup.start(), markup[0], markup["comment"], markup["bare"]
        if markup["unclosed"]:
            message = f"what begins here with {whole} is never closed"
            raise XmlError(message, _advance(start, text[:at]), f"end it with {_CLOSER[whole]}")
        if comment is not None and ("--" in comment or comment.endswith("-")):
            dashed.append(at)
            return f"<!--{comment.replace('-', ' ')}-->"
        if bare and in_prolog and (said := _BARE.match(bare)):
            document.doctype, document.public_id = said["name"], said["public"] or ""
            document.doctype_location = _advance(start, text[:at])
            whole = _NOT_LINE_END.sub(" ", whole)
        in_prolog = in_prolog and whole.startswith(("<!--", "<?"))
        return whole

    blanked = _MARKUP.sub(blank, text)
    if dashed and warn is not None:
        more = f" (and {len(dashed) - 1} more)" if len(dashed) > 1 else ""
        message = f"this comment{more} contains '--', which other XML programs reject"
        warn(message, _advance(start, text[: dashed[0]]), "write a single dash")
    return blanked


class _Builder:
    """The callbacks of one expat parser, and the tree that they build."""

    def __init__(self, data: bytes, file: str, document: Document, *, declarations: bool) -> None:
        self._data = data
        self._declarations = declarations
        self._file = file
        self._document = document
        self._stack: list[Element] = []
        parser = self._parser = expat.ParserCreate("utf-8")
        parser.buffer_text = True
        parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.StartDoctypeDeclHandler = self._doctype
        parser.EntityDeclHandler = self._entity
        parser.SkippedEntityHandler = self._skipped

    def keep_comments(self) -> None:
        self._parser.CommentHandler = self._comment

    def run(self) -> None:
        try:
            self._parser.Parse(self._data, True)
        except expat.ExpatError as error:
            place = Location(self._file, error.lineno, error.offset + 1)
            why = expat.ErrorString(error.code)
            hint = _WRITE_CHARACTER if why == expat.errors.XML_ERROR_UNDEFINED_ENTITY else self._open()
            refusal = XmlError(f"this is not well-formed XML: {why}", place, hint)
            refusal.before = tuple(self._stack)
            raise refusal from None
        except XmlError as refusal:
            refusal.before = tuple(self._stack)
            raise

    def _open(self) -> str:
        if not self._stack:
            return ""
        element = self._stack[-1]
        return f"<{quote(element.tag)[1:-1]}> of line {element.location.line} is still open here"

    def _here(self) -> Location:
        return Location(self._file, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        location = self._here()
        document = self._document
        document.elements += 1
        if document.elements > MAX_ELEMENTS:
            raise XmlError(f"the file has more than {MAX_ELEMENTS} elements", location, "take it apart")
        if len(self._stack) >= MAX_DEPTH:
            raise XmlError(f"elements are nested deeper than {MAX_DEPTH}", location)
        if len(attributes) > MAX_ATTRIBUTES:
            raise XmlError(f"an element has more than {MAX_ATTRIBUTES} attributes", location)
        element = Element(tag, tag.lower(), attributes, location, self._parser.CurrentByteIndex, self._data)
        if self._stack:
            self._stack[-1].children.append(element)
            self._stack[-1].pieces.append(" ")
        else:
            document.root = element
        self._stack.append(element)

    def _end(self, _tag: str) -> None:
        self._stack.pop()

    def _comment(self, text: str) -> None:
        if self._stack:
            self._start(COMMENT, {})
            self._text(text)
            self._end(COMMENT)

    def _text(self, text: str) -> None:
        self._stack[-1].pieces.append(text)

    def _doctype(self, name: str, _system: str | None, public: str | None, _internal: int) -> None:
        if not self._declarations:
            message = "a document type with declarations in it, or behind the first element, is refused"
            hint = "write the values out, or use <for> and ${name}; only a bare <!DOCTYPE suite> line is accepted"
            raise XmlError(message, self._here(), hint)
        before = self._data[: max(0, self._data.find(b"<!DOCTYPE"))].decode()  # the parser only knows its end
        self._document.doctype, self._document.public_id = name, public or ""
        self._document.doctype_location = _advance(Location(self._file, 1, 1), before)

    def _entity(self, name: str, *_rest: object) -> None:
        message = f"the file declares the entity {quote(name)}"
        raise XmlError(message, self._here(), "write what it stands for")

    def _skipped(self, name: str, _parameter: int) -> None:
        raise XmlError(f"there is no entity {quote(name)}", self._here(), _WRITE_CHARACTER)


def _advance(location: Location, text: str) -> Location:
    """The place behind a text that begins at ``location``."""
    ends = [match.end() for match in _LINE_END.finditer(text)]
    if not ends:
        return Location(location.file, location.line, location.column + len(text))
    return Location(location.file, location.line + len(ends), len(text) - ends[-1] + 1)
