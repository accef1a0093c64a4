"""An application file as a tree of elements: read safely, and written back with all that it has.

Kept are elements and attributes, known or not, texts, and comments inside the root, in their order. White space around
texts is not, and a text between elements is written before them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from rtf.errors import Location
from rtf.xml_tree import COMMENT, XmlError, parse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rtf.xml_tree import Element

#: The largest file. An application of a thousand modules has less than a megabyte.
MAX_BYTES = 10 * 1024 * 1024


def read_tree(path: Path, warn: Callable[[str, Location, str], None] | None = None) -> Element:
    """Return the root of a file. Raises XmlError; ``warn`` is given what other programs would reject."""
    return parse_tree(read_bytes(path), str(path), warn)


def read_bytes(path: Path) -> bytes:
    """Return a file, or its beginning if it is larger than :data:`MAX_BYTES`. Raises XmlError."""
    try:
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise XmlError(f"the file cannot be read: {error.strerror}", Location(str(path))) from None


def parse_tree(data: bytes, file: str, warn: Callable[[str, Location, str], None] | None = None) -> Element:
    """Return the root of a file's bytes, as :func:`read_tree`."""
    if len(data) > MAX_BYTES:
        raise XmlError(f"the file is larger than {MAX_BYTES >> 20} MiB", Location(file), "take it apart")
    root = parse(data, file, warn, comments=True).root
    assert root is not None  # a document without elements is not well-formed
    return root


def to_bytes(root: Element) -> bytes:
    """Return the file of a tree, in UTF-8, indented."""
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *_lines(root, ""), ""]).encode()


def _lines(element: Element, indent: str) -> Iterator[str]:
    text = escape(element.text, {"\r": "&#13;"})
    if element.tag == COMMENT:
        yield f"{indent}<!-- {element.text} -->"
        return
    start = " ".join([element.tag, *(f"{name}={quoteattr(value)}" for name, value in element.attributes.items())])
    if not element.children:
        yield f"{indent}<{start}>{text}</{element.tag}>" if text else f"{indent}<{start}/>"
        return
    yield f"{indent}<{start}>{text}"
    for child in element.children:
        yield from _lines(child, f"{indent}    ")
    yield f"{indent}</{element.tag}>"
