"""Files of a run: which path leads to one inside the run's folder, and as what it may be shown.

Names in a journal come from tests, and those in a request from anywhere; neither is believed.
"""

from __future__ import annotations

import mimetypes
from typing import TYPE_CHECKING

from rtf.page.errors import FileRefusedError

if TYPE_CHECKING:
    from pathlib import Path

#: What a browser may show. None of it can carry a script that the page's origin would have to answer for.
SHOWN = frozenset(
    {
        *("image/png", "image/jpeg", "image/gif", "image/webp", "image/avif", "image/bmp"),
        *("application/json", "text/plain", "text/csv", "text/markdown"),
    }
)
#: What keeps its type and is downloaded: a browser would show it with a program of its own, outside all bounds.
KEPT = frozenset({"application/pdf"})
#: Files of plain text whose names no table of media types knows.
_TEXT = frozenset({".log", ".ini", ".jsonl", ".yaml", ".yml", ".toml", ".conf"})
OPAQUE = "application/octet-stream"


def inside(folder: Path, name: str) -> Path:
    """The ordinary file that a relative path means inside a folder, links resolved.

    Raises FileRefusedError when it leads outside, to something hidden, or to none.
    """
    parts = name.split("/")
    if "\0" in name or any(part.startswith(".") or not part for part in parts):
        raise FileRefusedError(f"{name!r} is no path inside the run's folder")
    try:
        root = folder.resolve(strict=True)
        path = root.joinpath(*parts).resolve(strict=True)
        if not path.is_relative_to(root) or not path.is_file():
            raise FileRefusedError(f"{name!r} is no file inside the run's folder")
    except (OSError, RuntimeError) as error:  # not there, not readable, a loop of links, a name that is too long
        if isinstance(error, FileRefusedError):
            raise
        raise FileRefusedError(f"{name!r} is no file inside the run's folder") from None
    return path


def media_type(path: Path) -> str:
    """As what a file may be shown: a type of the short list, or the one that is only ever downloaded."""
    if path.suffix.lower() in _TEXT:
        return "text/plain"
    guessed, encoding = mimetypes.guess_type(path.name, strict=True)
    return guessed if guessed in SHOWN | KEPT and encoding is None else OPAQUE


def is_shown(kind: str) -> bool:
    """Whether a browser may show it; it is downloaded otherwise."""
    return kind in SHOWN
