"""An earlier run in the few records a comparison needs, as ``GET /compare`` and the archive give them to the page."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from rtf.testing.journal import FILE_NAME, JournalError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    Record = dict[str, Any]

_KINDS = frozenset({"run_started", "test_planned", "test_started", "measured", "test_ended", "run_ended"})
_WORDS = tuple(f'"{kind}"'.encode() for kind in sorted(_KINDS))
#: A kind stands at the beginning of its line; what a test said may hold the same word, further on.
_BEGINNING = 40


def journal_of(run: Path) -> Path:
    """The journal of a run that is named by its folder or by the journal itself. Raises JournalError."""
    path = run / FILE_NAME if run.is_dir() else run
    if not path.is_file():
        raise JournalError(f"there is no run in {run}: {path} is missing")
    return path


def records(run: Path) -> Iterator[Record]:
    """``run_started``, each ``test_planned``, then by test ``measured`` and ``test_ended``, and ``run_ended``.

    Only the last attempt at each test counts, and of a run that was resumed what it came to in the end.
    """
    first: Record | None = None
    last: Record | None = None
    planned: dict[str, Record] = {}
    measured: dict[str, list[Record]] = {}
    ended: dict[str, list[Record]] = {}
    for record in _read(journal_of(run)):
        kind, test = record["event"], record.get("test", "")
        if kind == "run_started":
            first = first or record
        elif kind == "run_ended":
            last = record
        elif kind == "test_planned":
            planned.setdefault(test, record)
        elif kind == "test_started":
            measured[test] = []
        elif kind == "measured":
            measured.setdefault(test, []).append(record)
        elif record.get("final", True):
            ended[test] = [*measured.pop(test, []), record]
    yield from (first,) if first is not None else ()
    yield from planned.values()
    for of_test in ended.values():
        yield from of_test
    yield from (last,) if last is not None else ()


def _read(path: Path) -> Iterator[Record]:
    with path.open("rb") as stream:
        for line in stream:
            if line.endswith(b"\n") and any(word in line[:_BEGINNING] for word in _WORDS):
                record = json.loads(line)
                if record["event"] in _KINDS:
                    yield record
