"""Recorded conversations with robots: a stream with envelopes, and requests with their replies."""

from __future__ import annotations

import socket
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from replaying import VERSIONS, playing, receive, recordings, segments
from rtf.bottle import Bottle, Dialect
from rtf.bottle.binary import decode_from
from rtf.cli.network.rpc import Caller
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.types import VECTOR, Stamp
from rtf.middleware.wire import framing
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network

RECORDED = {version: recordings(version, "robot.json") for version in VERSIONS}
QUESTIONS = [(version, number) for version in VERSIONS for number in range(len(RECORDED[version]["questions"]))]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("expected", [Dialect.YARP3, Dialect.YARP4])
def test_state_of_an_arm_streams_in(network: Network, version: str, expected: Dialect):
    """Our reader decodes the recorded vectors and stamps, also if it expects the other dialect."""
    network.dialect = expected
    talk = segments(RECORDED[version]["state"])
    with BufferedPort("/rd", VECTOR, strict=True, network=network) as reader:
        with socket.create_connection((reader.contact.host, reader.contact.port), timeout=10) as connection:
            for number, (way, data) in enumerate(talk):
                if way == ">":
                    connection.sendall(data)
                else:
                    wanted = data if number > 1 else framing.yarp_number(reader.contact.port)
                    assert receive(connection, len(data)) == wanted
        received = [reader.receive(timeout=5) for _ in range(reader.pending)]
    assert len(received) > 20
    stamps = [Stamp.parse(one.envelope) for one in received]
    assert [stamp.count for stamp in stamps] == [*range(stamps[0].count, stamps[0].count + len(stamps))]
    assert all(later.time > earlier.time for earlier, later in pairwise(stamps))
    assert {one.value.shape for one in received} == {(16,)}


@pytest.mark.parametrize(("version", "number"), QUESTIONS, ids=str)
def test_questions_are_put_as_recorded(network: Network, version: str, number: int):
    """Our client sends the recorded bytes, and decodes the recorded replies."""
    network.dialect = VERSIONS[version]
    talk = segments(RECORDED[version]["questions"][number])
    with (
        socket.create_server(("127.0.0.1", 0)) as listening,
        playing(listening, talk) as sent,
        Caller(network, Contact("/robot", *listening.getsockname())) as caller,
    ):
        for question, answer in pairs(talk, network.dialect):
            assert caller.ask("d", question, timeout=5) == answer
    for expected, got in sent:
        assert got == expected


def pairs(talk: list[tuple[str, bytes]], dialect: Dialect) -> list[tuple[Bottle, Bottle | None]]:
    """Return the requests of a conversation with their replies."""
    found = []
    for (way, question), (_, answer) in pairwise(talk):
        if way == ">" and question.startswith(framing.yarp_number(10)) and b"~d\0\1" in question[:42]:
            at = question.index(b"~d\0\1") + 4
            nothing = answer.startswith(framing.ACK)  # the service had no answer to give
            found.append(
                (decode_from(question, at, dialect)[0], None if nothing else decode_from(answer, 0, dialect)[0])
            )
    return found
