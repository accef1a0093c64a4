"""Recorded series for plots: safe reading, reduction that keeps the peaks, and encoding for the browser.

The format is in ``docs/page.md``. Files are not changed. NumPy is imported for the first series.
"""

from __future__ import annotations

import struct
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rtf.page.errors import SeriesError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import IO

    from numpy.typing import NDArray

    Column = NDArray[Any]

#: The greatest number of rows, far more than a plot has pixels; others are left out.
MAX_ROWS = 20_000
#: The greatest unpacked size of a file, in bytes, and number of its columns.
MAX_BYTES = 1 << 28
MAX_COLUMNS = 256
#: The greatest size of a column's header in a file; NumPy's is a line.
_MAX_HEADER = 4096
_HEAD = struct.Struct("<III")


@dataclass(frozen=True, slots=True)
class Series:
    """Columns of equal length, the axis first. ``thinned``: samples were left out, and peaks kept."""

    names: tuple[str, ...]
    columns: tuple[Column, ...]
    thinned: bool = False

    def packed(self) -> bytes:
        """Encode the series for ``GET /series``."""
        rows = len(self.columns[0])
        head = _HEAD.pack(len(self.columns), rows, int(self.thinned))
        return b"".join([head, *(column.astype("<f8").tobytes() for column in self.columns)])


def pack_file(path: Path, max_rows: int = MAX_ROWS) -> bytes:
    """Read a recorded series and encode it for ``GET /series``. Raises SeriesError."""
    return thin_out(read(path), max_rows).packed()


def read(path: Path) -> Series:
    """Read the series in an ``.npz`` file. Raises SeriesError for any other file."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _unpack(path.name, archive)
    except SeriesError:
        raise
    except Exception as error:  # noqa: BLE001 - a broken file may raise anything: zipfile, each decompressor, NumPy
        raise SeriesError(f"{path.name} has no series: {type(error).__name__}: {error}") from None


def _unpack(name: str, archive: zipfile.ZipFile) -> Series:
    members = archive.infolist()
    if not 0 < len(members) <= MAX_COLUMNS:
        raise SeriesError(f"{name}: {len(members)} columns; a series has 1 to {MAX_COLUMNS}")
    if sum(member.file_size for member in members) > MAX_BYTES:
        raise SeriesError(f"{name}: larger than {MAX_BYTES >> 20} MiB")
    columns = []
    for member in members:
        with archive.open(member) as stream:
            columns.append(_column(stream, member.file_size, f"{name}: {member.filename}"))
    if len({len(column) for column in columns}) != 1:
        raise SeriesError(f"{name}: the columns have different lengths")
    return Series(tuple(member.filename.removesuffix(".npy") for member in members), tuple(columns))


def _column(stream: IO[bytes], size: int, place: str) -> Column:
    """Read a column; its header is compared with the size of the file before memory is allocated."""
    import numpy as np
    from numpy.lib import format as npy

    version = npy.read_magic(stream)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read_header is None:
        raise SeriesError(f"{place}: unknown version {version} of the format")
    shape, _, dtype = read_header(stream, max_header_size=_MAX_HEADER)
    if dtype.kind != "f" or dtype.itemsize > np.dtype(np.float64).itemsize or len(shape) != 1:
        raise SeriesError(f"{place}: a column must be a row of floating-point numbers, not {dtype} of shape {shape}")
    data = stream.read(min(size, shape[0] * dtype.itemsize))
    if len(data) != shape[0] * dtype.itemsize:
        raise SeriesError(f"{place}: shorter than its header says")
    return np.frombuffer(data, dtype).astype(np.float64)


def thin_out(series: Series, max_rows: int = MAX_ROWS) -> Series:
    """Reduce a series to ``max_rows`` rows: of each interval the extremes of every column are kept.

    Rows keep their order, so the axis stays ascending. The first and the last row are kept.
    """
    import numpy as np

    rows = len(series.columns[0])
    if rows <= max_rows:
        return series
    plotted = series.columns[1:] or series.columns
    stretches = max(1, (max_rows - 2) // (2 * len(plotted)))
    kept = np.unique(np.concatenate([[0, rows - 1], *_extremes(plotted, rows, stretches)]))
    return Series(series.names, tuple(column[kept] for column in series.columns), thinned=True)


def _extremes(columns: Sequence[Column], rows: int, stretches: int) -> list[Column]:
    """Return the rows of the least and the greatest value of each interval, by column; NaN is neither."""
    import numpy as np

    length = -(-rows // stretches)
    index = np.minimum(np.arange(-(-rows // length) * length), rows - 1).reshape(-1, length)
    starts = index[:, 0]
    found = []
    for column in columns:
        values = column[index]
        unknown = np.isnan(values)
        found += [
            index[np.arange(len(starts)), np.where(unknown, np.inf, values).argmin(axis=1)],
            index[np.arange(len(starts)), np.where(unknown, -np.inf, values).argmax(axis=1)],
        ]
    return found
