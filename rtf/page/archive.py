"""The page of a run that is over, as one file: the page itself, the journal, the series, the attachments.

Everything is read from the run's folder and written in pieces, so that the length of a run costs no memory. What would
make the file too large to be opened is left out, and the page is told. Where the page gets its data while the run goes
on is the server's business.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rtf.page import files, series
from rtf.page.errors import FileRefusedError, SeriesError
from rtf.page.onefile import page_in_pieces, write_block
from rtf.testing import journal, replay
from rtf.testing.events import to_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path
    from typing import BinaryIO

#: The largest attachment that is put in, and all of them together, in bytes.
MAX_ATTACHMENT = 2 << 20
MAX_ATTACHMENTS = 64 << 20
#: All series together, in bytes as the page unfolds them. When there are many, each gets fewer points.
MAX_SERIES = 128 << 20
#: So many rows a plot needs to be worth looking at.
_MIN_ROWS = 1000

_NOT_THERE = "no such file is in the run's folder"
_PIECE = 1 << 18
_STARTED, _ENDED = b'{"event":"run_started"', b'{"event":"run_ended"'
_SAMPLED, _RECORDED = b'{"event":"series_sampled"', b'{"event":"series_recorded"'
_ATTACHED, _ASKED = b'{"event":"attached"', b'{"event":"asked"'


@dataclass(frozen=True, slots=True)
class Extras:
    """What the page shows beside the run: an earlier run's records, the trends of many, and why they are missing."""

    compare: list[dict[str, Any]] | None = None
    history: dict[str, Any] | None = None
    missing: Mapping[str, str] = field(default_factory=dict)  # path -> reason


@dataclass(slots=True)
class _Survey:
    """What a journal refers to; made in one pass over its lines."""

    run: str = ""
    starts: int = 0
    ended: bool = False
    recorded: dict[str, int] = field(default_factory=dict)  # a series, and the last line that tells of its file
    series: dict[str, tuple[int, int]] = field(default_factory=dict)  # path -> columns, rows
    attached: dict[str, None] = field(default_factory=dict)  # paths in order, each once


@dataclass(slots=True)
class _LeftOut:
    """What is not in the file, for the page to say."""

    files: list[dict[str, object]] = field(default_factory=list)

    def add(self, path: str, size: int, reason: str) -> None:
        self.files.append({"path": path, "size": size, "reason": reason})


def write_archive(stream: BinaryIO, folder: Path, extras: Extras | None = None) -> None:
    """Write the page of the run in this folder. Raises JournalError, EventError and OSError."""
    extras = extras or Extras()
    head, tail = page_in_pieces()
    with _one_run(folder / journal.FILE_NAME) as (lines, survey):
        stream.write(head)
        left_out = _LeftOut()
        for path, reason in extras.missing.items():
            left_out.add(path, 0, reason)
        _write_series(stream, folder, survey, left_out)
        _write_attachments(stream, folder, survey, left_out)
        facts = {
            "mode": "archive",
            "control": False,
            "compare": extras.compare is not None,
            "history": extras.history is not None,
            "run": survey.run,
            "left_out": left_out.files,
        }
        _write_json(stream, "rtf-facts", facts)
        if extras.compare is not None:
            _write_json(stream, "rtf-compare", extras.compare)
        if extras.history is not None:
            _write_json(stream, "rtf-history", extras.history)
        write_block(stream, {"id": "rtf-journal"}, _without_superseded(lines, survey))
        stream.write(tail)


def _write_json(stream: BinaryIO, element: str, value: object) -> None:
    write_block(stream, {"id": element}, [json.dumps(value, separators=(",", ":"), allow_nan=False).encode()])


# The journal -----------------------------------------------------------------------------------------------------


@contextmanager
def _one_run(path: Path) -> Iterator[tuple[BinaryIO, _Survey]]:
    """The lines of a journal as one whole run, and what they refer to.

    Mostly these are the lines as they are. Where the runner was killed, or the run was resumed, they are written anew,
    into a file without a name.
    """
    try:
        stream = path.open("rb")
    except OSError as error:
        raise journal.JournalError(error.errno, f"cannot read the journal {path}: {error.strerror}") from None
    with stream:
        survey = _surveyed(stream)
        if survey is not None and survey.ended and survey.starts == 1:
            yield stream, survey
            return
    with tempfile.TemporaryFile() as repaired:
        repaired.writelines(to_line(event) for event in replay.with_ends(replay.as_one_run(path)))
        yield repaired, _surveyed(repaired) or _Survey()


def _surveyed(stream: BinaryIO) -> _Survey | None:
    """What the lines refer to; None when they are not all whole and in the form that our writer gives them."""
    survey = _Survey()
    stream.seek(0)
    for number, line in enumerate(stream):
        if not (line.startswith(b'{"event":"') and line.endswith(b"}\n")):
            return None
        if line.startswith(_NOTED):
            try:
                _note(survey, number, json.loads(line))
            except (ValueError, KeyError, TypeError):
                return None
    stream.seek(0)
    return survey


_NOTED = (_STARTED, _ENDED, _RECORDED, _ATTACHED, _ASKED)


def _note(survey: _Survey, number: int, record: Mapping[str, Any]) -> None:
    kind = record["event"]
    survey.ended = kind == "run_ended" or (survey.ended and kind != "run_started")
    if kind == "run_started":
        survey.run = survey.run or record["run"]
        survey.starts += 1
    elif kind == "series_recorded":
        survey.recorded[_series_key(record)] = number
        survey.series[record["path"]] = (len(record["columns"]), record["rows"])
    elif kind == "attached":
        survey.attached[record["path"]] = None
    elif record.get("picture"):
        survey.attached[record["picture"]] = None


def _series_key(record: Mapping[str, Any]) -> str:
    return "\n".join((record["test"], record.get("subject", ""), record["name"]))


def _without_superseded(lines: BinaryIO, survey: _Survey) -> Iterator[bytes]:
    """The lines, but of a series that was recorded not what was seen of it while it grew."""
    for number, line in enumerate(lines):
        if line.startswith(_SAMPLED) and survey.recorded.get(_series_key(json.loads(line)), -1) > number:
            continue
        yield line


# Series and attachments ------------------------------------------------------------------------------------------


def _write_series(stream: BinaryIO, folder: Path, survey: _Survey, left_out: _LeftOut) -> None:
    columns = sum(count for count, _ in survey.series.values())
    rows = min(series.MAX_ROWS, max(_MIN_ROWS, MAX_SERIES // (8 * max(1, columns))))
    room = MAX_SERIES
    for name in survey.series:
        try:
            path = files.inside(folder, name)
            packed = series.pack_file(path, rows)
        except (FileRefusedError, UnicodeError):
            left_out.add(name, 0, _NOT_THERE)
            continue
        except SeriesError as error:
            left_out.add(name, path.stat().st_size, str(error))
            continue
        if len(packed) > room:
            left_out.add(name, path.stat().st_size, f"all series together are larger than {MAX_SERIES >> 20} MiB")
            continue
        room -= len(packed)
        write_block(stream, {"data-series": name}, [packed])


def _write_attachments(stream: BinaryIO, folder: Path, survey: _Survey, left_out: _LeftOut) -> None:
    found: list[tuple[str, Path, str]] = []
    for name in survey.attached:
        try:
            path = files.inside(folder, name)
        except (FileRefusedError, UnicodeError):
            left_out.add(name, 0, _NOT_THERE)
            continue
        found.append((name, path, files.media_type(path)))
    room = MAX_ATTACHMENTS
    for name, path, media_type in sorted(found, key=lambda item: not item[2].startswith("image/")):
        size = path.stat().st_size
        if size > MAX_ATTACHMENT:
            left_out.add(name, size, f"larger than {MAX_ATTACHMENT >> 20} MiB")
        elif size > room:
            left_out.add(name, size, f"all attachments together are larger than {MAX_ATTACHMENTS >> 20} MiB")
        else:
            room -= size
            write_block(stream, {"data-file": name, "data-type": media_type}, _pieces(path))


def _pieces(path: Path) -> Iterable[bytes]:
    with path.open("rb") as stream:
        while piece := stream.read(_PIECE):
            yield piece
