"""Archived pages for tests: made from events, and taken apart again."""

from __future__ import annotations

import base64
import gzip
import re
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rtf.page.archive import Extras, write_archive
from rtf.testing.events import to_line
from rtf.testing.journal import FILE_NAME

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from rtf.testing.events import Event

BLOCK = re.compile(rb'<script type="application/x-rtf"((?: [a-z-]+="[^"]*")+)>([A-Za-z0-9+/=]*)</script>\n')


def blocks(page: bytes) -> dict[str, bytes]:
    """The data in a page, unpacked, by attributes."""
    return {
        attributes.decode().strip(): gzip.decompress(base64.b64decode(data)) for attributes, data in BLOCK.findall(page)
    }


def put(folder: Path, *events: Event, torn: bytes = b"") -> Path:
    """Write a journal into a run's folder; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / FILE_NAME).write_bytes(b"".join(to_line(event) for event in events) + torn)
    return folder


def archive_of(folder: Path, extras: Extras | None = None) -> Path:
    """Write the archived page of a run's folder; returns the file."""
    path = folder / "report.html"
    with path.open("wb") as stream:
        write_archive(stream, folder, extras)
    return path


def numbered(events: Iterable[Event], start: float = 1_750_000_000.0) -> list[Event]:
    """Events in order, a tenth of a second apart, as a runner would have written them."""
    made = []
    for seq, event in enumerate(events, 1):
        made.append(replace(event, time=start + seq / 10, seq=seq))
    return made
