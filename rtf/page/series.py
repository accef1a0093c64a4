"""Recorded series for plots: read safely, thinned out so that no peak is lost, packed for the browser.

The format is that of ``docs/page.md``. Nothing is changed on the disk. NumPy is imported when a series is asked for.
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

#: A plot has no more pixels than this by far; more rows are thinned out.
MAX_ROWS = 20_000
#: What a file may unfold to, and how many columns it may have.
MAX_BYTES = 1 << 28
MAX_COLUMNS = 256
#: How long the description of a column may be in a file; NumPy's are a line.
_MAX_HEADER = 4096
_HEAD = struct.Struct("<III")


@dataclass(frozen=True, slots=True)
class Series:
    """Columns of one length, the axis first. ``thinned`` says that peaks were kept but samples left out."""

    names: tuple[str, ...]
    columns: tuple[Column, ...]
    thinned: bool = False

    def packed(self) -> bytes:
        """As ``GET /series`` sends it."""
        rows = len(self.columns[0])
        head = _HEAD.pack(len(self.columns), rows, int(self.thinned))
        return b"".join([head, *(column.astype("<f8").tobytes() for column in self.columns)])


def pack_file(path: Path, max_rows: int = MAX_ROWS) -> bytes:
    """A recorded series as ``GET /series`` sends it. Raises SeriesError."""
    return thin_out(read(path), max_rows).packed()


def read(path: Path) -> Series:
    """The series in an ``.npz`` file. Raises SeriesError for anything that is none."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _unpack(path.name, archive)
    except SeriesError:
        raise
    except Exception as error:  # noqa: BLE001 - a broken file may raise anything: zipfile, each decompressor, NumPy
        raise SeriesError(f"{path.name} holds no series: {type(error).__name__}: {error}") from None


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
        raise SeriesError(f"{name}: the columns are of different lengths")
    return Series(tuple(member.filename.removesuffix(".npy") for member in members), tuple(columns))


def _column(stream: IO[bytes], size: int, place: str) -> Column:
    """One column; its description is held against the size of the file before any memory is taken for it."""
    import numpy as np
    from numpy.lib import format as npy

    version = npy.read_magic(stream)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read_header is None:
        raise SeriesError(f"{place}: version {version} of the format is not known")
    shape, _, dtype = read_header(stream, max_header_size=_MAX_HEADER)
    if dtype.kind != "f" or dtype.itemsize > np.dtype(np.float64).itemsize or len(shape) != 1:
        raise SeriesError(f"{place}: not one row of floating-point numbers but {dtype} of shape {shape}")
    data = stream.read(min(size, shape[0] * dtype.itemsize))
    if len(data) != shape[0] * dtype.itemsize:
        raise SeriesError(f"{place}: shorter than it says")
    return np.frombuffer(data, dtype).astype(np.float64)


def thin_out(series: Series, max_rows: int = MAX_ROWS) -> Series:
    """Leave rows out where there are more than ``max_rows``: of each stretch the extremes of every column stay.

    Rows keep their order, and with it the axis stays ascending. The first and the last row stay.
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
    """The rows of the least and the greatest value of each stretch, column by column; what is no number is neither."""
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
