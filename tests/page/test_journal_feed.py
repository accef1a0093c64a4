"""The journal as a stream of messages: each line once, in order, for any sizes and times."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf.page import journal_feed
from rtf.page.journal_feed import BATCH, Feed, Position, message

if TYPE_CHECKING:
    from pathlib import Path


def content(message: bytes) -> tuple[int, list[Any]]:
    """Return id and records of a message, and check its form."""
    head, data, *rest = message.split(b"\n")
    assert rest == [b"", b""]
    assert head.startswith(b"id: ")
    assert data.startswith(b"data: ")
    return int(head[4:]), json.loads(data[6:])


def rest(journal: Feed, position: Position) -> tuple[list[Any], Position]:
    """Return all records from a position on."""
    records: list[Any] = []
    while position.offset < journal.end.offset:
        said, position = journal.read(position)
        number, more = content(said)
        records += more
        assert number == position.line
    return records, position


#: Mostly short lines; now and then one that is longer than a message, or than a block that is read at once.
SIZES = st.lists(
    st.sampled_from([1, 5, 80, 1000, 30_000, BATCH, 3 * BATCH, journal_feed._BLOCK + 5]), min_size=1, max_size=60
)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sizes=SIZES, cuts=st.lists(st.integers(1, 200_000), min_size=1), data=st.data())
def test_every_line_comes_once_and_in_order(tmp_path: Path, sizes: list[int], cuts: list[int], data: st.DataObject):
    """Clients at any position get all lines once, however the file grows."""
    path = tmp_path / "journal"
    lines = [json.dumps({"n": number, "text": "x" * size}).encode() + b"\n" for number, size in enumerate(sizes)]
    whole = b"".join(lines)
    journal, position, seen = Feed(path), Position(), []
    written = 0
    with path.open("wb", 0) as stream:
        for step in [*cuts, len(whole)]:
            stream.write(whole[written : written + step])
            written = min(len(whole), written + step)
            journal.grow()
            more, position = rest(journal, position)
            seen += more
            assert position.offset == whole.rfind(b"\n", 0, written) + 1
    assert [record["n"] for record in seen] == [*range(len(lines))]
    after = data.draw(st.integers(0, len(lines)))
    again, _ = rest(journal, journal.position(after))
    assert [record["n"] for record in again] == [*range(after, len(lines))]
    path.unlink()


def test_a_torn_line_waits_for_its_end(tmp_path: Path):
    """An incomplete line is sent when it is complete."""
    path = tmp_path / "journal"
    path.write_bytes(b'{"n":0}\n{"n":')
    journal = Feed(path)
    assert journal.grow()
    assert rest(journal, Position()) == ([{"n": 0}], Position(1, 8))
    with path.open("ab") as stream:
        stream.write(b"1}\n")
    assert journal.grow()
    assert rest(journal, Position(1, 8)) == ([{"n": 1}], Position(2, 16))
    assert not journal.grow()


def test_a_journal_that_does_not_exist_yet_is_an_empty_one(tmp_path: Path):
    """A missing journal counts as empty."""
    journal = Feed(tmp_path / "journal")
    assert not journal.grow()
    (tmp_path / "journal").write_bytes(b"{}\n")
    assert journal.grow()


def test_the_same_bytes_serve_all_clients_at_the_same_position(tmp_path: Path):
    """Clients at the same position share one message."""
    path = tmp_path / "journal"
    path.write_bytes(b'{"n":0}\n')
    journal = Feed(path)
    journal.grow()
    assert journal.read(Position())[0] is journal.read(Position())[0]


def test_more_lines_than_there_are_means_the_end(tmp_path: Path):
    """A position beyond the end is the end."""
    path = tmp_path / "journal"
    path.write_bytes(b'{"n":0}\n')
    journal = Feed(path)
    journal.grow()
    assert journal.position(10**12) == Position(1, 8)


def test_a_journal_that_shrinks_is_an_error_and_no_endless_loop(tmp_path: Path):
    """A journal that becomes shorter raises EOFError."""
    path = tmp_path / "journal"
    path.write_bytes(b'{"n":0}\n')
    journal = Feed(path)
    journal.grow()
    path.write_bytes(b"")
    with pytest.raises(EOFError, match="shorter"):
        journal.read(Position())


@pytest.mark.parametrize(
    "line",
    [b"", b"\0\0\0\0", b"words", b"[1]", b'{"a":1}x', b'{"a":', b"data: x", b'{"a":"\r"}', b"\xff\xfe", b'{"a":NaN'],
)
def test_damaged_lines_damage_nothing_else(line: bytes):
    """A damaged line becomes a record of no kind, and its neighbours stay."""
    number, records = content(message(b'{"n":0}\n' + line + b'\n{"n":1}\n', 3))
    assert number == 3
    assert len(records) == 3
    assert (records[0], records[2]) == ({"n": 0}, {"n": 1})


@given(st.binary(max_size=200))
def test_no_bytes_break_the_form_of_a_message(data: bytes):
    """No bytes of a journal can add fields or events to the stream."""
    lines = data.replace(b"\n", b"") + b"\n"
    said = message(lines, 1)
    assert said.count(b"\n") == 3
    assert b"\r" not in said
