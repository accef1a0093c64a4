"""TCPROS on bytes: what is written is read, at any cut, and any bytes are a header or an error."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.middleware.wire.inbox import Inbox
from rtf.ros1.errors import PeerError
from rtf.ros1.tcpros import (
    MAX_HEADER,
    decode_header,
    encode_header,
    encode_response,
    frame,
    read_header,
    read_message,
    read_response,
)

if TYPE_CHECKING:
    from rtf.middleware.wire.inbox import Reading

T = TypeVar("T")


def fed(inbox: Inbox, steps: Reading[T], data: bytes, size: int = 1 << 20) -> T:
    """The result of reading data that arrives in pieces."""
    pieces = [data[start : start + size] for start in range(0, len(data), size)]
    try:
        while True:
            next(steps)
            inbox.feed(pieces.pop(0))
    except StopIteration as end:
        return end.value


_text = st.text(st.characters(codec="utf-8", exclude_characters="="), min_size=1)
_fields = st.dictionaries(_text, st.text(st.characters(codec="utf-8")))


def test_a_header_is_that_of_yarp_and_ros():
    """Fields in the order of their keys, lengths little-endian."""
    assert encode_header({"topic": "/a", "md5sum": "*"}) == b"\x18\0\0\0\x08\0\0\0md5sum=*\x08\0\0\0topic=/a"


@given(fields=_fields, size=st.integers(1, 9))
def test_what_is_written_is_read(fields: dict[str, str], size: int):
    """However it arrives."""
    inbox = Inbox()
    assert fed(inbox, read_header(inbox), encode_header(fields), size) == fields


@given(st.binary(max_size=80))
@pytest.mark.fuzz
def test_any_bytes_are_a_header_or_an_error(data: bytes):
    """It raises nothing else."""
    try:
        fields = decode_header(data)
    except PeerError:
        return
    assert all(fields)


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        (b"\1\0", "ends in the length"),
        (b"\xff\xff\xff\xffa=b", "a field of 4294967295 bytes in a header with 3 left"),
        (b"\3\0\0\0abc", "is key=value"),
        (b"\2\0\0\0=b", "is key=value"),
        (b"\3\0\0\0a=\xff", "is no text"),
    ],
)
def test_what_is_wrong_in_a_header_is_reported(body: bytes, complaint: str):
    """A length is not believed."""
    with pytest.raises(PeerError, match=complaint):
        decode_header(body)


def test_hostile_lengths_are_refused():
    """Before anything is allocated."""
    inbox = Inbox()
    with pytest.raises(PeerError, match="a header of 4294967295 bytes; at most"):
        fed(inbox, read_header(inbox), b"\xff" * 4)
    inbox = Inbox()
    with pytest.raises(PeerError, match="a message of 1001 bytes; at most 1000"):
        fed(inbox, read_message(inbox, 1000), struct.pack("<I", 1001))
    assert MAX_HEADER == 1 << 20


@given(st.binary(max_size=100), st.booleans(), st.integers(1, 9))
def test_messages_and_responses_are_read(body: bytes, succeeded: bool, size: int):
    """One behind the other."""
    inbox = Inbox()
    assert bytes(fed(inbox, read_message(inbox, 1000), frame(body), size)) == body
    assert fed(inbox, read_response(inbox, 1000), encode_response(succeeded, body), size) == (succeeded, body)
