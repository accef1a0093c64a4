"""A series that grows while its test runs: kept whole for the report, and thinned out for those who watch.

What is watched is a preview in the journal, a few points a batch; it is also all that is left of the series when the
test's process is killed. The series itself becomes a file when it is closed.
"""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.testing.events import SeriesSampled

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import TracebackType

    from rtf.testing.session import Session

#: Seconds between two batches, and the points of one: people cannot follow more, and the journal should not have to.
_PAUSE = 0.2
_POINTS = 40


class Series:
    """Columns of numbers over a common axis, given row by row. Made by ``TestCase.series``; for one thread.

    ``keep`` stores the columns at the end and returns the file.
    """

    def __init__(
        self,
        session: Session,
        name: str,
        units: dict[str, str],
        keep: Callable[[dict[str, array[float]]], Path],
    ) -> None:
        self.name = name
        self._session = session
        self._subject = session.subject
        self._units = units
        self._keep = keep
        self._columns = {column: array("d") for column in units}
        self._appenders = [column.append for column in self._columns.values()]
        self._told = 0
        self._next = clock.monotonic()
        self._path: Path | None = None

    def __len__(self) -> int:
        return len(next(iter(self._columns.values())))

    def append(self, *values: float) -> None:
        """Add one row: a number for each column, the axis first."""
        if len(values) != len(self._appenders):
            raise ValueError(f"series {self.name!r} has {len(self._appenders)} columns, not {len(values)}")
        row = [float(value) for value in values]  # all of them before the first is kept: columns stay of one length
        for add, value in zip(self._appenders, row, strict=True):
            add(value)
        if clock.monotonic() >= self._next:
            self._tell()

    def close(self) -> Path | None:
        """Keep the series; returns its file, or None when nothing was appended. Closing again changes nothing."""
        if self._path is None and len(self):
            self._path = self._keep(self._columns)
        return self._path

    def _tell(self) -> None:
        end = len(self)
        step = max(1, -(-(end - self._told) // _POINTS))
        samples = tuple(tuple(column[self._told : end : step]) for column in self._columns.values())
        self._told = end
        self._next = clock.monotonic() + _PAUSE
        self._session.emit(
            SeriesSampled(
                test=self._session.test,
                name=self.name,
                subject=self._subject,
                columns=tuple({"name": name, "unit": symbol} for name, symbol in self._units.items()),
                samples=samples,
            ),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
