"""Files that a test keeps beside the journal: attachments, and series of numbers, given whole or row by row.

A series that grows while its test runs is kept whole for the report, and the journal has a preview of a few points at a
time for the live page. When the test's process is killed, only the preview is left.
"""

from __future__ import annotations

import re
from array import array
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.testing.events import Attached, SeriesRecorded, SeriesSampled
from rtf.testing.measurement import unit

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType

    from numpy.typing import ArrayLike

    from rtf.testing.measurement import Unit
    from rtf.testing.session import Session

#: Seconds between two batches, and the points of one: people cannot follow more, and the journal should not have to.
_PAUSE = 0.2
_POINTS = 40
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


def free_path(session: Session, stem: str, suffix: str) -> Path:
    """Return an unused path in the test's folder, which is made; the name cannot lead out of the folder."""
    folder = session.folder
    folder.mkdir(parents=True, exist_ok=True)
    stem = _UNSAFE.sub("_", stem).strip("._") or "file"
    suffix = _UNSAFE.sub("_", suffix)
    path = folder / f"{stem}{suffix}"
    count = 1
    while path.exists():
        count += 1
        path = folder / f"{stem}~{count}{suffix}"
    return path


def attach(session: Session, source: str | Path | bytes, name: str = "", media_type: str = "") -> Path:
    """Keep a copy of a file, or bytes, which need a ``name``. Returns the copy."""
    if isinstance(source, bytes):
        if not name:
            raise ValueError("attached bytes need a name")
        path = free_path(session, Path(name).stem, Path(name).suffix)
        path.write_bytes(source)
    else:
        import shutil

        name = name or Path(source).name
        path = free_path(session, Path(name).stem, Path(name).suffix)
        shutil.copyfile(source, path)
    emit_attached(session, path, name, media_type)
    return path


def emit_attached(session: Session, path: Path, name: str, media_type: str = "") -> None:
    """Emit the event of a file that is already in the run's folder."""
    import mimetypes

    session.emit(
        Attached(
            test=session.test,
            name=name,
            path=path.relative_to(session.run_folder).as_posix(),
            media_type=media_type or mimetypes.guess_type(name)[0] or "application/octet-stream",
            size=path.stat().st_size,
        ),
    )


class Series:
    """Columns of numbers over a common axis. Made by ``TestCase.series``; for one thread.

    Raises ValueError when there are no columns, or for a unit that is not known.
    """

    def __init__(self, session: Session, name: str, units: Mapping[str, str | Unit]) -> None:
        if not units:
            raise ValueError(f"series {name!r} has no columns")
        self.name = name
        self._session = session
        self._subject = session.subject
        self._units = tuple({"name": column, "unit": str(unit(symbol))} for column, symbol in units.items())
        self._columns = {column: array("d") for column in units}
        self._sent = 0
        self._next = clock.monotonic()
        self._path: Path | None = None

    def __len__(self) -> int:
        return len(next(iter(self._columns.values())))

    def append(self, *values: float) -> None:
        """Add one row: a number for each column, the axis first."""
        if len(values) != len(self._columns):
            raise ValueError(f"series {self.name!r} has {len(self._columns)} columns, not {len(values)}")
        row = [float(value) for value in values]  # all of them before the first is kept: columns stay of one length
        for column, value in zip(self._columns.values(), row, strict=True):
            column.append(value)
        if clock.monotonic() >= self._next:
            self._send_samples()

    def close(self) -> Path | None:
        """Keep the series; returns its file, or None when nothing was appended. Closing again changes nothing."""
        if self._path is None and len(self):
            self._path = self.keep(self._columns)
        return self._path

    def keep(self, columns: Mapping[str, ArrayLike]) -> Path:
        """Write whole columns to a file; returns it. They must be one-dimensional and of one length: ValueError."""
        import numpy as np

        arrays = {column: np.asarray(values, dtype=np.float64) for column, values in columns.items()}
        shapes = {array.shape for array in arrays.values()}
        if len(shapes) != 1 or any(array.ndim != 1 for array in arrays.values()):
            listed = ", ".join(f"{key} {array.shape}" for key, array in arrays.items())
            raise ValueError(f"the columns of series {self.name!r} must be one-dimensional and of one length: {listed}")
        session = self._session
        path = free_path(session, f"{self._subject}-{self.name}" if self._subject else self.name, ".npz")
        np.savez(path, allow_pickle=False, **arrays)
        session.recorded()
        session.emit(
            SeriesRecorded(
                test=session.test,
                name=self.name,
                path=path.relative_to(session.run_folder).as_posix(),
                columns=self._units,
                rows=len(next(iter(arrays.values()))),
                subject=self._subject,
            ),
        )
        return path

    def _send_samples(self) -> None:
        end = len(self)
        step = max(1, -(-(end - self._sent) // _POINTS))
        samples = tuple(tuple(column[self._sent : end : step]) for column in self._columns.values())
        self._sent = end
        self._next = clock.monotonic() + _PAUSE
        self._session.emit(
            SeriesSampled(
                test=self._session.test, name=self.name, subject=self._subject, columns=self._units, samples=samples
            ),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
