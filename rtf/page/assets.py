"""What the browser gets: the files of ``reports/page``, read once, with the type each is served as.

The live server answers with them as they are; the archive puts their texts into one file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

#: The page itself, which ``GET /`` answers with.
INDEX = "index.html"

#: What is served, and as what. Nothing else that may lie in the folder is.
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Asset:
    """One file of the page."""

    name: str
    media_type: str
    content: bytes

    @property
    def text(self) -> str:
        """The content of a file that people write."""
        return self.content.decode()


def page_folder() -> Path:
    """Where the page's files are: inside the package, or beside it in a checkout."""
    return shipped_folder("report") / "page"


def read_assets(folder: Path | None = None) -> Mapping[str, Asset]:
    """All files of the page by name, in sorted order."""
    found = sorted((folder or page_folder()).iterdir())
    return {
        path.name: Asset(path.name, _TYPES[path.suffix], path.read_bytes()) for path in found if path.suffix in _TYPES
    }
