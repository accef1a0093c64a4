"""The file of a log: what is put in comes out, is filtered, and takes no more room than it may."""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.logs import store
from rtf.logs.query import Query
from rtf.logs.record import Level, LogRecord
from rtf.logs.store import LEAST_SIZE, LogFileError, LogReader, LogStore

from .conftest import stored

if TYPE_CHECKING:
    from pathlib import Path

YRI = LogRecord("/log/vm/yarprobotinterface/12", Level.INFO, 10.0, "Reading File", "yarp.yri.XMLReader", "", "(pid 12)")
DEV = LogRecord("/log/pc104/yarpdev/7", Level.ERROR, 11.0, "no camera\0", "yarp", "left", "", "main.cpp:1")
OWN = LogRecord("/log/vm/tool[two]/120", Level.WARNING, 12.0, "100% é", "")
RUN = LogRecord("/log/run/sleep/25963", Level.UNKNOWN, 13.0, "a line")


def put(file: Path, *records: LogRecord) -> None:
    """Write records that arrived when they were made."""
    with LogStore(file) as store:
        store.add([(record.time, record) for record in records])


def test_records_come_back_as_they_were(file: Path):
    """Every field survives, in the order of arrival, over two writers."""
    put(file, YRI, DEV)
    put(file, OWN, RUN)
    assert stored(file) == [YRI, DEV, OWN, RUN]


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        (Query(level=Level.WARNING), [DEV, OWN]),
        (Query(process="yarpdev"), [DEV]),
        (Query(process="12"), [YRI]),
        (Query(process="yarp*"), [YRI, DEV]),
        (Query(process="tool[two]"), [OWN]),
        (Query(process="/log/run/sleep/25963"), [RUN]),
        (Query(host="vm"), [YRI, OWN]),
        (Query(host="run"), [RUN]),
        (Query(component="yarp"), [YRI, DEV]),
        (Query(component="yarp.yri"), [YRI]),
        (Query(component="*XML*"), [YRI]),
        (Query(text="reading file"), [YRI]),
        (Query(text="100%"), [OWN]),
        (Query(since=12.0), [OWN, RUN]),
        (Query(since=11.0, until=12.0), [DEV, OWN]),
        (Query(level=Level.INFO, host="vm", text="é"), [OWN]),
        (Query(text="' OR 1 --"), []),
    ],
    ids=str,
)
def test_a_query_gives_what_it_names(file: Path, query: Query, wanted: list[LogRecord]):
    """Each filter wants what it says, and several filters want what all of them do."""
    put(file, YRI, DEV, OWN, RUN)
    assert stored(file, query) == wanted


def test_a_reader_continues_where_it_was(file: Path):
    """A reader beside the writer gets what is new, and the newest ones of what is there."""
    put(file, YRI, DEV)
    with LogStore(file) as store, LogReader(file) as reader:
        assert [one for *_, one in reader.read(last=1)] == [DEV]
        newest = reader.newest()
        store.add([(12.0, OWN)])
        assert [(arrived, one) for _, arrived, one in reader.read(after=newest)] == [(12.0, OWN)]


def test_a_full_file_loses_its_oldest_records(file: Path):
    """A file keeps the newest records within its size, and the names of their senders alone."""
    with LogStore(file, max_size=LEAST_SIZE) as store:
        for batch in range(30):
            sender = f"/log/vm/prog/{batch}"
            records = [LogRecord(sender, Level.INFO, batch, f"{number} {'x' * 100}") for number in range(500)]
            store.add([(float(batch), record) for record in records])
    assert file.stat().st_size <= LEAST_SIZE + (256 << 10)
    kept = stored(file)
    assert kept[-1].message.startswith("499 ")
    assert [record.time for record in kept] == sorted(record.time for record in kept)
    assert 2000 < len(kept) < 15000
    with sqlite3.connect(file) as connection:
        assert connection.execute("SELECT count(*) FROM senders").fetchone()[0] == len({one.sender for one in kept})
    connection.close()


def test_texts_that_are_no_utf8_are_kept(file: Path):
    """Bytes that are no UTF-8 do not keep their batch out of the file."""
    put(file, YRI, LogRecord("/log/a/b/1", Level.INFO, 11.0, "caf\udce9"), OWN)
    assert [record.message for record in stored(file)] == ["Reading File", "caf?", "100% é"]


def test_a_foreign_file_is_refused_untouched(file: Path):
    """The file of another program is named and left as it is, by the writer and by readers."""
    connection = sqlite3.connect(file)
    connection.execute("CREATE TABLE others (a)")
    connection.commit()
    connection.close()
    before = file.read_bytes()
    for make in (LogStore, LogReader):
        with pytest.raises(LogFileError, match=r"logs\.sqlite: it is a database of something else; name another file"):
            make(file)
    assert file.read_bytes() == before


def test_a_file_that_is_no_database_is_refused(file: Path):
    """A text in the place of the log is named and left as it is."""
    file.write_text("a text " * 100)
    for make in (LogStore, LogReader):
        with pytest.raises(LogFileError, match=r"it is no log; name another file with --file"):
            make(file)
    assert file.read_text().startswith("a text")


def test_a_log_of_a_newer_version_is_refused(file: Path):
    """A file of a newer RTF is not misread."""
    put(file, YRI)
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA user_version = 2")
    connection.close()
    with pytest.raises(LogFileError, match="use the newer RTF"):
        LogReader(file)


def test_what_cannot_be_a_log_says_what_to_do(tmp_path: Path, file: Path):
    """A missing log, a file for a folder and a size that is too small are errors with a hint."""
    with pytest.raises(LogFileError, match="'rtf logger' writes one"):
        LogReader(file)
    file.touch()
    with pytest.raises(LogFileError, match="it is empty"):
        LogReader(file)
    with pytest.raises(LogFileError, match="cannot make the folder"):
        LogStore(file / "logs.sqlite")
    with pytest.raises(LogFileError, match="the least is 1 MiB"):
        LogStore(tmp_path / "other", max_size=1000)


@settings(max_examples=40, deadline=None)
@given(
    levels=st.lists(st.sampled_from(Level), max_size=30),
    least=st.sampled_from(Level),
    count=st.integers(1, 7),
    scan=st.integers(1, 9),
    newest=st.booleans(),
)
def test_windows_side_by_side_are_the_whole_log(
    tmp_path_factory: pytest.TempPathFactory, levels: list[Level], least: Level, count: int, scan: int, *, newest: bool
):
    """Windows from one end to the other have every wanted record once, in order, and each looks through few numbers."""
    file = tmp_path_factory.mktemp("windows") / "logs.sqlite"
    put(file, *(LogRecord("/log/vm/one/1", level, float(index), "said") for index, level in enumerate(levels)))
    query = Query(level=least)
    parts: list[list[int]] = []
    with pytest.MonkeyPatch.context() as patch, LogReader(file) as reader:
        patch.setattr(store, "SCAN", scan)
        low, high = 0, reader.ends()[1]
        while low < high:
            window = reader.window(query, low, high, count, newest=newest)
            assert 0 < window.high - window.low <= scan
            assert len(window.records) <= count
            parts.append([number for number, _, _ in window.records])
            if newest:
                parts[-1].reverse()
                assert window.high == high
                high = window.low
            else:
                assert window.low == low
                low = window.high
        wanted = [number for number, _, _ in reader.read(query)]
    found = [number for part in parts for number in part]
    assert wanted == (found[::-1] if newest else found)
