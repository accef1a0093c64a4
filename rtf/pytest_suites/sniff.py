"""Recognition of suites by the first bytes of an XML file, without loading the runner."""

from __future__ import annotations

import codecs
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

#: What may stand before the root element has to end within so many bytes.
_LIMIT = 64 * 1024
_BEFORE = re.compile(r"\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>\[]*>", re.DOTALL)
_ROOT = re.compile(r"<suite(?![\w:.-])", re.IGNORECASE)
_MARKS = ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"), (codecs.BOM_UTF8, "utf-8"))


def is_suite(path: Path) -> bool:
    """Whether the root element of a file is ``suite``. A file that cannot be read is none."""
    try:
        if not path.is_file():  # opening a pipe would wait
            return False
        with path.open("rb") as stream:
            data = stream.read(_LIMIT)
    except OSError:
        return False
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), "latin-1")
    text = data.decode(encoding, "replace").lstrip("\ufeff")
    position = 0
    while before := _BEFORE.match(text, position):
        position = before.end()
    return _ROOT.match(text, position) is not None
