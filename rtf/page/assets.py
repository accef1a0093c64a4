"""The files of the page in ``reports/page``, read once, with their media types.

The live server sends them unchanged; the archive puts their texts into one file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

#: The page itself, the response to ``GET /``.
INDEX = "index.html"

#: The media types of the served files, by suffix. No other file in the folder is served.
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Asset:
    """A file of the page."""

    name: str
    media_type: str
    content: bytes

    @property
    def text(self) -> str:
        """The content as text."""
        return self.content.decode()


def page_folder() -> Path:
    """Return the folder of the page's files: inside the package, or beside it in a checkout."""
    return shipped_folder("report") / "page"


def read_assets(folder: Path | None = None) -> Mapping[str, Asset]:
    """Return all files of the page by name, sorted."""
    found = sorted((folder or page_folder()).iterdir())
    return {
        path.name: Asset(path.name, _TYPES[path.suffix], path.read_bytes()) for path in found if path.suffix in _TYPES
    }
