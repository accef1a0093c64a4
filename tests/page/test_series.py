"""Recorded series for plots: extremes are kept, nothing unsafe is loaded, and numbers are exact."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from harness import run_suite
from rtf.page import series
from rtf.page.errors import SeriesError
from rtf.page.series import Series, pack_file, read, thin_out
from rtf.testing.events import SeriesRecorded


def unpack(data: bytes) -> tuple[list[list[float]], bool]:
    """Return columns and flag of a packed series, as the browser reads it."""
    count, rows, thinned = struct.unpack_from("<III", data)
    assert len(data) == 12 + 8 * count * rows
    values = np.frombuffer(data, "<f8", offset=12).reshape(count, rows)
    return values.tolist(), bool(thinned)


def written(folder: Path, **columns: Any) -> Path:
    """Write an ``.npz`` file."""
    path = folder / "series.npz"
    np.savez(path, **columns)
    return path


def test_what_a_test_records_is_what_the_browser_gets(tmp_path: Path):
    """The browser gets the numbers that the test recorded, the axis first."""
    test = """
from rtf.testing import TestCase
class Recording(TestCase):
    def run(self):
        self.record("elbow", t=([0.0, 0.1, 0.2], "s"), position=([1, 2, float("nan")], "deg"))
"""
    outcome = run_suite(tmp_path, "<test>recording.py</test>", recording__py=test)
    (event,) = outcome.of(SeriesRecorded)
    assert isinstance(event, SeriesRecorded)
    columns, thinned = unpack(pack_file(outcome.folder / event.path))
    np.testing.assert_array_equal(columns, [[0.0, 0.1, 0.2], [1.0, 2.0, np.nan]])
    assert not thinned


FLOATS = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(1, 400),
    limit=st.integers(8, 60),
    data=st.data(),
)
def test_thinning_out_keeps_every_extreme_and_the_order(rows: int, limit: int, data: st.DataObject):
    """Thinning keeps the extremes of each column, and whole rows in order."""
    count = data.draw(st.integers(1, 3))
    columns = tuple(data.draw(hnp.arrays(np.float64, rows, elements=FLOATS)) for _ in range(count))
    axis = np.arange(rows, dtype=float)
    thinned = thin_out(Series(("t", "a", "b", "c")[: count + 1], (axis, *columns)), limit)
    kept = thinned.columns[0].astype(int)
    assert (np.diff(kept) > 0).all()
    assert len(kept) <= max(limit, 2 + 2 * count)
    assert (kept[0], kept[-1]) == (0, rows - 1)
    assert thinned.thinned == (rows > limit)
    for whole, few in zip(columns, thinned.columns[1:], strict=True):
        np.testing.assert_array_equal(whole[kept], few)
        numbers = whole[~np.isnan(whole)]
        if numbers.size:
            assert numbers.min() == np.nanmin(few)
            assert numbers.max() == np.nanmax(few)


def test_a_peak_of_one_sample_among_a_million_is_seen():
    """A peak of one sample among a million is kept."""
    position = np.zeros(1_000_000)
    position[765_432] = 5.0
    thinned = thin_out(Series(("t", "position"), (np.arange(1e6), position)))
    assert len(thinned.columns[0]) <= series.MAX_ROWS
    (place,) = np.nonzero(thinned.columns[1])
    assert thinned.columns[0][place] == [765_432]


class Evil:
    """An object whose pickle would run code."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (Path("/tmp/rtf-evil"),))


def lying(shape: str) -> bytes:
    """Return an array whose header claims a wrong size."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + b"\0" * 16


def zipped(**members: bytes) -> bytes:
    """Return an archive with these members."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"t": np.zeros((2, 2))}, "shape"),
        ({"t": np.zeros(2), "x": np.zeros(3)}, "different lengths"),
        ({"t": np.array(["a", "b"])}, "must be a row of floating-point"),
        ({"t": np.array([1, 2])}, "must be a row of floating-point"),
        ({"t": np.array([Evil()], dtype=object)}, "must be a row of floating-point"),
        ({}, "0 columns"),
        ({f"c{number}": np.zeros(1) for number in range(series.MAX_COLUMNS + 1)}, "columns"),
    ],
)
def test_what_is_no_series_is_refused(tmp_path: Path, columns: dict[str, Any], said: str):
    """Only rows of numbers are accepted, and pickles are not loaded."""
    with pytest.raises(SeriesError, match=said):
        read(written(tmp_path, **columns))
    assert not Path("/tmp/rtf-evil").exists()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "has no series"),
        (b"PK\x03\x04 not really", "has no series"),
        (zipped(t=b"words"), "has no series"),
        (zipped(t=lying("(1000000000000,)")), "shorter than its header says"),
        (zipped(t=lying("(-1,)")), "no series|shorter"),
        (zipped(t=lying("(1,)" + " " * 20000)), "has no series"),
        (zipped(t=lying("(3, 10**9)")), "has no series"),
        (zipped(t=b"\x93NUMPY\x09\x00" + b"\0" * 20), "version"),
    ],
)
def test_broken_files_are_refused_and_named(tmp_path: Path, content: bytes, said: str):
    """A damaged file raises SeriesError with its name, without using memory."""
    path = tmp_path / "broken.npz"
    path.write_bytes(content)
    with pytest.raises(SeriesError, match=said) as caught:
        read(path)
    assert "broken.npz" in str(caught.value)


def test_a_file_that_unfolds_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A file that unpacks beyond the limit is refused."""
    monkeypatch.setattr(series, "MAX_BYTES", 1 << 22)
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("t.npy", "w") as stream:
        for _ in range(series.MAX_BYTES // (1 << 20) + 1):
            stream.write(bytes(1 << 20))
    with pytest.raises(SeriesError, match="larger than"):
        read(path)


@settings(max_examples=100, deadline=None)
@given(place=st.integers(0, 10_000), byte=st.integers(0, 255))
def test_a_flipped_byte_is_refused_or_harmless(tmp_path_factory: pytest.TempPathFactory, place: int, byte: int):
    """A damaged file gives numbers, or raises SeriesError."""
    path = written(tmp_path_factory.mktemp("flip"), t=np.arange(20.0), x=np.arange(20.0))
    content = bytearray(path.read_bytes())
    content[place % len(content)] = byte
    path.write_bytes(content)
    try:
        data = pack_file(path)
    except SeriesError:
        return
    unpack(data)
