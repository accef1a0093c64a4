"""The page of a finished run as a single file: page, journal, series and attachments.

Everything is read from the run folder and written in pieces, so the memory does not grow with the length of the run.
Files that would make the page too large to open are omitted, and the page shows which. The data of a running run come
from the server.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rtf.page import files, series
from rtf.page.errors import FileRefusedError, SeriesError
from rtf.page.single_file import page_in_pieces, write_block
from rtf.testing import journal
from rtf.testing.events import to_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path
    from typing import BinaryIO

#: The greatest size of an attachment, and of all together, in bytes.
MAX_ATTACHMENT = 2 << 20
MAX_ATTACHMENTS = 64 << 20
#: The greatest size of all series, in bytes as unpacked by the page. If there are many, each gets fewer points.
MAX_SERIES = 128 << 20
#: The least number of rows of a plot.
_MIN_ROWS = 1000

_NOT_THERE = "there is no such file in the run folder"
_PIECE = 1 << 18
_STARTED, _ENDED = b'{"event":"run_started"', b'{"event":"run_ended"'
_SAMPLED, _RECORDED = b'{"event":"series_sampled"', b'{"event":"series_recorded"'
_ATTACHED, _ASKED = b'{"event":"attached"', b'{"event":"asked"'


@dataclass(frozen=True, slots=True)
class Extras:
    """Data of other runs: the records of an earlier run, the trends of many, and the reasons why they are missing."""

    compare: list[dict[str, Any]] | None = None
    history: dict[str, Any] | None = None
    missing: Mapping[str, str] = field(default_factory=dict)  # path -> reason


@dataclass(slots=True)
class _References:
    """The files that a journal refers to, found in one pass over its lines."""

    run: str = ""
    starts: int = 0
    ended: bool = False
    recorded: dict[str, int] = field(default_factory=dict)  # series -> the last line that names its file
    series: dict[str, tuple[int, int]] = field(default_factory=dict)  # path -> columns, rows
    attached: dict[str, None] = field(default_factory=dict)  # paths in order, without duplicates


@dataclass(slots=True)
class _Omitted:
    """The files that are omitted, for the page to show."""

    files: list[dict[str, object]] = field(default_factory=list)

    def add(self, path: str, size: int, reason: str) -> None:
        self.files.append({"path": path, "size": size, "reason": reason})


def write_archive(stream: BinaryIO, folder: Path, extras: Extras | None = None) -> None:
    """Write the page of the run in a folder. Raises JournalError, EventError and OSError."""
    extras = extras or Extras()
    head, tail = page_in_pieces()
    with _one_run(folder / journal.FILE_NAME) as (lines, references):
        stream.write(head)
        omitted = _Omitted()
        for path, reason in extras.missing.items():
            omitted.add(path, 0, reason)
        _write_series(stream, folder, references, omitted)
        _write_attachments(stream, folder, references, omitted)
        facts = {
            "mode": "archive",
            "control": False,
            "compare": extras.compare is not None,
            "history": extras.history is not None,
            "run": references.run,
            "left_out": omitted.files,
        }
        _write_json(stream, "rtf-facts", facts)
        if extras.compare is not None:
            _write_json(stream, "rtf-compare", extras.compare)
        if extras.history is not None:
            _write_json(stream, "rtf-history", extras.history)
        write_block(stream, {"id": "rtf-journal"}, _without_superseded(lines, references))
        stream.write(tail)


def _write_json(stream: BinaryIO, element: str, value: object) -> None:
    write_block(stream, {"id": element}, [json.dumps(value, separators=(",", ":"), allow_nan=False).encode()])


# The journal -----------------------------------------------------------------------------------------------------


@contextmanager
def _one_run(path: Path) -> Iterator[tuple[BinaryIO, _References]]:
    """Yield the lines of a journal as one complete run, and their references.

    Usually these are the lines of the file. If the runner was killed or the run was resumed, repaired lines are written
    to an unnamed temporary file.
    """
    try:
        stream = path.open("rb")
    except OSError as error:
        raise journal.JournalError(error.errno, f"cannot read the journal {path}: {error.strerror}") from None
    with stream:
        references = _references_of(stream)
        if references is not None and references.ended and references.starts == 1:
            yield stream, references
            return
    with tempfile.TemporaryFile() as repaired:
        repaired.writelines(to_line(event) for event in journal.as_one_run(path))
        yield repaired, _references_of(repaired) or _References()


def _references_of(stream: BinaryIO) -> _References | None:
    """Return the references of the lines; None unless all lines are complete and in the format of the runner."""
    references = _References()
    stream.seek(0)
    for number, line in enumerate(stream):
        if not (line.startswith(b'{"event":"') and line.endswith(b"}\n")):
            return None
        if line.startswith(_NOTED):
            try:
                _note(references, number, json.loads(line))
            except (ValueError, KeyError, TypeError):
                return None
    stream.seek(0)
    return references


_NOTED = (_STARTED, _ENDED, _RECORDED, _ATTACHED, _ASKED)


def _note(references: _References, number: int, record: Mapping[str, Any]) -> None:
    kind = record["event"]
    references.ended = kind == "run_ended" or (references.ended and kind != "run_started")
    if kind == "run_started":
        references.run = references.run or record["run"]
        references.starts += 1
    elif kind == "series_recorded":
        references.recorded[_series_key(record)] = number
        references.series[record["path"]] = (len(record["columns"]), record["rows"])
    elif kind == "attached":
        references.attached[record["path"]] = None
    elif record.get("picture"):
        references.attached[record["picture"]] = None


def _series_key(record: Mapping[str, Any]) -> str:
    return "\n".join((record["test"], record.get("subject", ""), record["name"]))


def _without_superseded(lines: BinaryIO, references: _References) -> Iterator[bytes]:
    """Yield the lines, without the growing parts of series that were recorded completely later."""
    for number, line in enumerate(lines):
        if line.startswith(_SAMPLED) and references.recorded.get(_series_key(json.loads(line)), -1) > number:
            continue
        yield line


# Series and attachments ------------------------------------------------------------------------------------------


def _write_series(stream: BinaryIO, folder: Path, references: _References, omitted: _Omitted) -> None:
    columns = sum(count for count, _ in references.series.values())
    rows = min(series.MAX_ROWS, max(_MIN_ROWS, MAX_SERIES // (8 * max(1, columns))))
    room = MAX_SERIES
    for name in references.series:
        try:
            path = files.inside(folder, name)
            packed = series.pack_file(path, rows)
        except (FileRefusedError, UnicodeError):
            omitted.add(name, 0, _NOT_THERE)
            continue
        except SeriesError as error:
            omitted.add(name, path.stat().st_size, str(error))
            continue
        if len(packed) > room:
            omitted.add(name, path.stat().st_size, f"all series together are larger than {MAX_SERIES >> 20} MiB")
            continue
        room -= len(packed)
        write_block(stream, {"data-series": name}, [packed])


def _write_attachments(stream: BinaryIO, folder: Path, references: _References, omitted: _Omitted) -> None:
    found: list[tuple[str, Path, str]] = []
    for name in references.attached:
        try:
            path = files.inside(folder, name)
        except (FileRefusedError, UnicodeError):
            omitted.add(name, 0, _NOT_THERE)
            continue
        found.append((name, path, files.media_type(path)))
    room = MAX_ATTACHMENTS
    for name, path, media_type in sorted(found, key=lambda item: not item[2].startswith("image/")):
        size = path.stat().st_size
        if size > MAX_ATTACHMENT:
            omitted.add(name, size, f"larger than {MAX_ATTACHMENT >> 20} MiB")
        elif size > room:
            omitted.add(name, size, f"all attachments together are larger than {MAX_ATTACHMENTS >> 20} MiB")
        else:
            room -= size
            write_block(stream, {"data-file": name, "data-type": media_type}, _pieces(path))


def _pieces(path: Path) -> Iterable[bytes]:
    with path.open("rb") as stream:
        while piece := stream.read(_PIECE):
            yield piece
