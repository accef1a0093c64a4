"""Files of a run: resolution of paths inside the run folder, and the media types by which they may be shown.

Names in a journal come from tests, and those in a request from anywhere; neither is trusted.
"""

from __future__ import annotations

import mimetypes
from typing import TYPE_CHECKING

from rtf.page.errors import FileRefusedError

if TYPE_CHECKING:
    from pathlib import Path

#: The types that a browser may show. None of them can contain a script, which would run with the page's origin.
SHOWN = frozenset(
    {
        *("image/png", "image/jpeg", "image/gif", "image/webp", "image/avif", "image/bmp"),
        *("application/json", "text/plain", "text/csv", "text/markdown"),
    }
)
#: The types that are kept for a download: a browser would show them with another program.
KEPT = frozenset({"application/pdf"})
#: Suffixes of plain text that tables of media types do not have.
_TEXT = frozenset({".log", ".ini", ".jsonl", ".yaml", ".yml", ".toml", ".conf"})
OPAQUE = "application/octet-stream"


def inside(folder: Path, name: str) -> Path:
    """Return the regular file of a relative path inside a folder, with links resolved.

    Raises FileRefusedError if it leads outside or to a hidden file, or if there is no such file.
    """
    parts = name.split("/")
    if "\0" in name or any(part.startswith(".") or not part for part in parts):
        raise FileRefusedError(f"{name!r} is not a path inside the run folder")
    try:
        root = folder.resolve(strict=True)
        path = root.joinpath(*parts).resolve(strict=True)
        if not path.is_relative_to(root) or not path.is_file():
            raise FileRefusedError(f"{name!r} is not a file inside the run folder")
    except (OSError, RuntimeError) as error:  # missing, unreadable, a loop of links, or a name that is too long
        if isinstance(error, FileRefusedError):
            raise
        raise FileRefusedError(f"{name!r} is not a file inside the run folder") from None
    return path


def media_type(path: Path) -> str:
    """Return the media type of a file: one that may be shown, or one that is always downloaded."""
    if path.suffix.lower() in _TEXT:
        return "text/plain"
    guessed, encoding = mimetypes.guess_type(path.name, strict=True)
    return guessed if guessed in SHOWN | KEPT and encoding is None else OPAQUE


def is_shown(kind: str) -> bool:
    """Return whether a browser may show the file; otherwise it is downloaded."""
    return kind in SHOWN
