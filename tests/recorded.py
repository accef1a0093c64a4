"""Runs written directly into a history."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.history import History, StoredRun
from rtf.testing.measurement import Measurement

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.verdict import Verdict

BEGAN = 1_750_000_000.0


def stored(index: int, *, robot: str = "icub01", station: str = "bench", verdict: str = "passed") -> StoredRun:
    """The run with this number, an hour after the one before."""
    started = BEGAN + 3600 * index
    return StoredRun(
        run=f"run-{index}",
        folder=f"/runs/run-{index}",
        started=started,
        ended=started + 12.5,
        duration=12.5,
        verdict=verdict,
        exit_code=0,
        robot=robot,
        station=station,
        version="0.1",
        seed=None,
        host="host",
        user="user",
        command="[]",
    )


def put(
    path: Path,
    run: StoredRun,
    tests: dict[str, Verdict | str] | None = None,
    measured: dict[tuple[str, str, str], Measurement | list[Measurement]] | None = None,
) -> None:
    """Store a run: the verdicts of its tests, and its measurements by test, subject and name."""
    rows = []
    for key, values in (measured or {}).items():
        for count, item in enumerate(values if isinstance(values, list) else [values]):
            limits = (item.low, item.high, item.marginal)
            rows.append((*key, count, item.value, None, str(item.unit), *limits, str(item.verdict)))
    verdicts = [
        (test, test.rpartition("/")[2], test.partition("/")[0], str(verdict), str(verdict), 1, 0.5, "", 0.1, None)
        for test, verdict in (tests or {}).items()
    ]
    with History(path, create=True) as history:
        history.record(run, verdicts, rows)
