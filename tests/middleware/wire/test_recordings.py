"""Recorded conversations of YARP 3.12.3 and 4.0.0 through the wire floor alone: no socket and no port."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest

from replaying import VERSIONS, recordings, segments
from rtf.bottle import Bottle, Dialect, same, to_string
from rtf.bottle.binary import decode_from
from rtf.middleware.errors import ProtocolError
from rtf.middleware.types import VECTOR, Stamp
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire import framing, name_server_lines
from rtf.middleware.wire.incoming_message import IncomingMessage
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from replaying import Segment

TALK = '1 2.5 hello "two words" (1 2 3) [pos] {10 20 30} -7 "say \\"hi\\"" (1.5 2.5) (a (b c) [ok]) true 3000000000'
MESSAGES = (TALK, "[get] [encs]", "end")
_DATA = Path(__file__).parents[2] / "data" / "yarp_wire"
_SPECIFIERS = {"tcp": 131, "fast_tcp": 3, "udp": 0}

version = pytest.mark.parametrize("version", VERSIONS)
binary = pytest.mark.parametrize("carrier", ["tcp", "fast_tcp"])
lines = pytest.mark.parametrize("carrier", ["text", "text_ack"])


class Framed(NamedTuple):
    """A message as its index delimits it."""

    command: framing.Command
    data: bytes


def port_talk(version: str, carrier: str) -> list[Segment]:
    """A conversation of two ports."""
    return segments(recordings(version, "ports.json")[carrier])


def said(talk: list[Segment], way: str) -> bytes:
    """All bytes that went one way."""
    return b"".join(data for direction, data in talk if direction == way)


def greeting(stream: bytes) -> tuple[int, str, bytes]:
    """Read what a writer begins with: the carrier's number, its own name, and the bytes behind them."""
    size = int.from_bytes(stream[8:12], "little")
    return framing.specifier(stream[:8]), stream[12 : 12 + size].rstrip(b"\0").decode(), stream[12 + size :]


def messages(stream: bytes) -> Iterator[Framed]:
    """Read messages up to the end of the bytes."""
    while stream:
        blocks, rest = framing.index_rest(stream)
        begin = framing.INDEX_SIZE + rest
        end = begin + framing.message_size(stream, framing.INDEX_SIZE, blocks)
        assert end <= len(stream), "the last message is cut"
        command = framing.read_command(stream[begin:end])
        yield Framed(command, stream[begin + command.data : end])
        stream = stream[end:]


def read(framed: Framed, sender: str, dialect: Dialect) -> IncomingMessage:
    """Return a message as a port hands it to its owner."""
    wants_reply = framed.command.key == "d"
    return IncomingMessage(sender, framed.command.text, framed.data, dialect, wants_reply, text=False)


@version
@binary
class TestBinaryCarriers:
    """A writer and a reader by tcp and fast_tcp."""

    def test_reader_understands(self, version: str, carrier: str):
        """Header, name, indexes, commands and data."""
        number, name, rest = greeting(said(port_talk(version, carrier), ">"))
        assert (number, name) == (_SPECIFIERS[carrier], f"/wr_{carrier}")
        *data, end = messages(rest)
        assert [one.command.key for one in data] == ["D"] * len(MESSAGES)
        assert end == Framed(framing.Command("q", "q", end.command.data), b"")
        for one, text in zip(data, MESSAGES, strict=True):
            assert same(read(one, name, VERSIONS[version]).read(), Bottle.parse(text))

    def test_reader_answers(self, version: str, carrier: str):
        """The number of its port, and an acknowledgement for each message and for the end, or none."""
        answers = said(port_talk(version, carrier), "<")
        assert 10000 < framing.read_number(answers) < 20000
        assert answers[8:] == framing.ACK * (4 if carrier == "tcp" else 0)

    def test_writer_sends(self, version: str, carrier: str):
        """The same bytes are made from the same objects."""
        sent = framing.header(_SPECIFIERS[carrier]) + framing.sender(f"/wr_{carrier}")
        for text in MESSAGES:
            message = OutgoingMessage("D", Bottle.parse(text), BOTTLE, VERSIONS[version])
            sent += framing.front("D", "", message.size) + b"".join(message.blocks)
        end = framing.command_text("q")
        assert sent + framing.index(len(end)) + end == said(port_talk(version, carrier), ">")

    def test_bytes_out_of_step_are_refused(self, version: str, carrier: str):
        """A message that begins one byte late is an error."""
        rest = greeting(said(port_talk(version, carrier), ">"))[2]
        with pytest.raises(ProtocolError, match="expected a message"):
            list(messages(rest[1:]))


@version
@lines
class TestTextCarriers:
    """A writer and a reader by text and text_ack."""

    def test_reader_understands(self, version: str, carrier: str):
        """A line for the command, and one for the data."""
        first, *rest = said(port_talk(version, carrier), ">").decode().split("\r\n")
        assert first == f"{'CONNECT' if carrier == 'text' else 'CONNACK'} /wr_{carrier}"
        assert rest[-2:] == ["q", ""]
        assert framing.text_command(rest[-2]).key == "q"
        for command, data, text in zip(rest[0:-2:2], rest[1:-2:2], MESSAGES, strict=True):
            assert framing.text_command(command) == framing.Command("D", "", 0)
            incoming = IncomingMessage("/wr", "", data.encode(), VERSIONS[version], False, text=True)
            assert same(incoming.read(), Bottle.parse(text))

    def test_writer_sends(self, version: str, carrier: str):
        """The text form of each object, as YARP writes it."""
        sent = [OutgoingMessage("D", Bottle.parse(text), BOTTLE, VERSIONS[version]).text for text in MESSAGES]
        assert said(port_talk(version, carrier), ">").decode().split("\r\n")[2:-2:2] == sent


@version
def test_datagrams(version: str):
    """Behind the checksum and the counter is one message, which is made the same way."""
    for (_, datagram), text in zip(port_talk(version, "udp datagrams"), MESSAGES, strict=True):
        (framed,) = messages(datagram[8:])
        assert same(read(framed, "/wr_udp", VERSIONS[version]).read(), Bottle.parse(text))
        message = OutgoingMessage("D", Bottle.parse(text), BOTTLE, VERSIONS[version])
        assert framing.front("D", "", message.size) + b"".join(message.blocks) == datagram[8:]


@version
def test_text_command_ends_datagrams(version: str):
    """A sender of datagrams names itself in a command on a text connection."""
    _, command, end, _ = said(port_talk(version, "udp end"), ">").decode().split("\r\n")
    assert framing.text_command(command) == framing.Command("~", "~/wr_udp", 0)
    assert framing.text_command(end).key == "q"


@version
def test_administration(version: str):
    """Questions are understood and made again; each answer is one bottle and an acknowledgement."""
    dialect = VERSIONS[version]
    talk = port_talk(version, "admin")
    number, name, rest = greeting(said(talk, ">"))
    assert (number, name) == (_SPECIFIERS["tcp"], "anon_rpc")
    *questions, end = messages(rest)
    assert [one.command.key for one in (*questions, end)] == ["a"] * 6 + ["q"]
    asked = [read(one, name, dialect).read() for one in questions]
    assert [one.to_text() for one in asked[:4]] == ["help", "[help]", "[ver]", "[list] [in]"]
    again = [OutgoingMessage("a", question, BOTTLE, dialect) for question in asked]
    made = b"".join(framing.front("a", "", one.size) + b"".join(one.blocks) for one in again)
    assert rest.startswith(made)
    answers = said(talk, "<")[8:]
    for _ in questions:
        _, size = decode_from(answers, 0, dialect)
        assert answers[size:].startswith(framing.ACK)
        answers = answers[size + len(framing.ACK) :]
    assert answers == framing.ACK


@version
def test_state_of_an_arm(version: str):
    """Each message of a stream has the next stamp beside a vector."""
    talk = segments(recordings(version, "robot.json")["state"])
    _, name, rest = greeting(said(talk, ">"))
    assert name == "/icubSim/left_arm/state:o"
    received = [read(one, name, VERSIONS[version]) for one in messages(rest) if one.command.key == "D"]
    assert len(received) > 20
    stamps = [Stamp.parse(one.envelope) for one in received]
    assert all(
        (later.count - earlier.count, later.time > earlier.time) == (1, True) for earlier, later in pairwise(stamps)
    )
    assert {one.read(VECTOR).shape for one in received} == {(16,)}


@version
def test_questions_to_a_robot(version: str):
    """Every question to every service is made again from what was understood."""
    dialect = VERSIONS[version]
    for conversation in recordings(version, "robot.json")["questions"]:
        _, name, rest = greeting(said(segments(conversation), ">"))
        asked = [one for one in messages(rest) if one.command.key == "d"]
        assert asked, "a conversation has a question"
        made = b""
        for one in asked:
            incoming = read(one, name, dialect)
            assert incoming.wants_reply
            again = OutgoingMessage("d", incoming.read(), BOTTLE, dialect)
            made += framing.front("d", "", again.size) + b"".join(again.blocks)
        assert rest.startswith(made)


def name_server_lines_of(version: str, way: str) -> list[str]:
    """All lines that clients of the name server said, or that it answered."""
    found = []
    for what in ("names", "carriers"):
        for talk in json.loads((_DATA / version / f"name_server_{what}.json").read_text("utf-8")):
            found += "".join(text for direction, text in talk if direction == way).splitlines()
    return found


@version
def test_registrations(version: str):
    """Every line that describes a port is understood, and made again."""
    described = [line for line in name_server_lines_of(version, "<") if line.startswith("registration")]
    assert len(described) == 49
    for line in described:
        contact = name_server_lines.read_registration(line)
        assert contact is not None
        assert name_server_lines.registration(contact) == line


@version
def test_commands_to_a_name_server(version: str):
    """Every command is made again from its words."""
    prefix = f"{name_server_lines.PREFIX} "
    asked = [line.removeprefix(prefix) for line in name_server_lines_of(version, ">") if line.startswith(prefix)]
    assert len(asked) > 100
    for line in asked:
        assert name_server_lines.command(*map(to_string, Bottle.parse(line))) == line.strip()
