"""The records of an earlier run for a comparison, for ``GET /compare`` and the archive."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from rtf.testing.events import Measured, RunEnded, RunStarted, TestEnded, TestPlanned, TestStarted, to_line
from rtf.testing.journal import FILE_NAME, JournalError, as_one_run
from rtf.testing.suite.ids import renewed

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.testing.events import Event

    Record = dict[str, Any]


def journal_of(run: Path) -> Path:
    """Return the journal of a run given by its folder or by the journal itself. Raises JournalError."""
    path = run / FILE_NAME if run.is_dir() else run
    if not path.is_file():
        raise JournalError(f"there is no run in {run}: {path} is missing")
    return path


def records(run: Path) -> Iterator[Record]:
    """Return ``run_started``, each ``test_planned``, then by test ``measured`` and ``test_ended``, and ``run_ended``.

    Only the last attempt at each test counts, and of a resumed run the final results. Tests have their present ids.
    """
    ends: dict[type[Event], Record] = {}
    ids: dict[str, str] = {}
    planned: dict[str, Record] = {}
    measured: dict[str, list[Record]] = {}
    ended: dict[str, list[Record]] = {}
    for event in as_one_run(journal_of(run)):
        if isinstance(event, RunStarted | RunEnded):
            ends[type(event)] = _record(event)
        elif isinstance(event, TestPlanned):
            ids[event.test] = event.test if event.fingerprint else renewed(event.test, event.suite, event.name)
            planned[event.test] = {**_record(event), "test": ids[event.test]}
        elif isinstance(event, TestStarted):
            measured[event.test] = []
        elif isinstance(event, Measured | TestEnded) and event.test in ids:
            measured.setdefault(event.test, []).append({**_record(event), "test": ids[event.test]})
            if isinstance(event, TestEnded) and event.final:
                ended[event.test] = measured.pop(event.test)
    yield from (ends[kind] for kind in (RunStarted,) if kind in ends)
    yield from planned.values()
    for of_test in ended.values():
        yield from of_test
    yield from (ends[kind] for kind in (RunEnded,) if kind in ends)


def _record(event: Event) -> Record:
    record: Record = json.loads(to_line(event))
    return record
