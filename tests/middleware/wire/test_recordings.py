"""Recorded conversations of YARP 3.12.3 and 4.0.0 through the wire floor alone, without sockets and ports."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from replaying import VERSIONS, recordings, segments
from rtf.bottle import Bottle, same, to_string
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire import framing, name_server_lines
from rtf.middleware.wire.datagrams import Assembler, split
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from replaying import Segment

TALK = '1 2.5 hello "two words" (1 2 3) [pos] {10 20 30} -7 "say \\"hi\\"" (1.5 2.5) (a (b c) [ok]) true 3000000000'
MESSAGES = (TALK, "[get] [encs]", "end")
_DATA = Path(__file__).parents[2] / "data" / "yarp_wire"

version = pytest.mark.parametrize("version", VERSIONS)


def port_talk(version: str, carrier: str) -> list[Segment]:
    """Return a conversation of two ports."""
    return segments(recordings(version, "ports.json")[carrier])


def said(talk: list[Segment], way: str) -> bytes:
    """Return all bytes of one direction."""
    return b"".join(data for direction, data in talk if direction == way)


@version
def test_datagrams(version: str):
    """Each recorded datagram decodes to one message, which encodes to the same datagram."""
    assembler = Assembler()
    for (_, datagram), text in zip(port_talk(version, "udp datagrams"), MESSAGES, strict=True):
        received = assembler.feed(datagram)
        assert received is not None
        key, envelope, data = received
        assert (key, envelope) == ("D", "")
        assert same(BOTTLE.decode(data, VERSIONS[version]), Bottle.parse(text))
        message = OutgoingMessage("D", Bottle.parse(text), BOTTLE, VERSIONS[version])
        assert split(framing.front("D", "", message.size) + b"".join(message.blocks)) == [datagram]


@version
def test_text_command_ends_datagrams(version: str):
    """The recorded text command of a sender of datagrams has its name."""
    _, command, end, _ = said(port_talk(version, "udp end"), ">").decode().split("\r\n")
    assert framing.text_command(command) == framing.Command("~", "~/wr_udp", 0)
    assert framing.text_command(end).key == "q"


def name_server_lines_of(version: str, way: str) -> list[str]:
    """Return all lines that clients sent to the name server, or that it answered."""
    found = []
    for what in ("names", "carriers"):
        for talk in json.loads((_DATA / version / f"name_server_{what}.json").read_text("utf-8")):
            found += "".join(text for direction, text in talk if direction == way).splitlines()
    return found


@version
def test_registrations(version: str):
    """Every recorded registration is read, and written again."""
    described = [line for line in name_server_lines_of(version, "<") if line.startswith("registration")]
    assert len(described) == 49
    for line in described:
        contact = name_server_lines.read_registration(line)
        assert contact is not None
        assert name_server_lines.registration(contact) == line


@version
def test_commands_to_a_name_server(version: str):
    """Every recorded command is written again from its words."""
    prefix = f"{name_server_lines.PREFIX} "
    asked = [line.removeprefix(prefix) for line in name_server_lines_of(version, ">") if line.startswith(prefix)]
    assert len(asked) > 100
    for line in asked:
        assert name_server_lines.command(*map(to_string, Bottle.parse(line))) == line.strip()
