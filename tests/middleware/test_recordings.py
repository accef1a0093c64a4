"""Conversations between ports of YARP 3.12.3 and 4.0.0, replayed in both roles.

Port numbers, process ids and help texts differ between machines and implementations; all other bytes are the same.
"""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest

from replaying import VERSIONS, playing, receive, recordings, segments
from rtf.bottle import Bottle, Dialect, same
from rtf.bottle.binary import decode_from
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.wire import framing
from rtf.middleware.wire.contact import Contact
from waiting import eventually

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network

TALK = '1 2.5 hello "two words" (1 2 3) [pos] {10 20 30} -7 "say \\"hi\\"" (1.5 2.5) (a (b c) [ok]) true 3000000000'
MESSAGES = (TALK, "[get] [encs]", "end")

version = pytest.mark.parametrize("version", VERSIONS)


def recorded(version: str, name: str) -> list[tuple[str, bytes]]:
    """Return a conversation: directions and bytes."""
    return segments(recordings(version, "ports.json")[name])


@version
@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "text", "text_ack"])
class TestWriterAndReader:
    """The recorded conversations of a writer and a reader."""

    def test_reader_answers_as_recorded(self, network: Network, version: str, carrier: str):
        """Our reader gets the recorded messages, and sends the recorded bytes."""
        network.dialect = VERSIONS[version]
        with BufferedPort(f"/rd_{carrier}", strict=True, network=network) as reader:
            with socket.create_connection((reader.contact.host, reader.contact.port), timeout=10) as connection:
                for number, (way, data) in enumerate(recorded(version, carrier)):
                    if way == ">":
                        connection.sendall(data)
                        continue
                    answer = receive(connection, len(data))
                    if number == 1 and carrier.endswith("tcp"):
                        assert answer == framing.yarp_number(reader.contact.port)
                    else:
                        assert answer == data
                assert connection.recv(1) == b"", "the connection is still open after its end was asked for"
            for text in MESSAGES:
                assert same(reader.read(timeout=5), Bottle.parse(text))

    def test_writer_sends_as_recorded(self, network: Network, version: str, carrier: str):
        """Our writer gets the recorded bytes, and sends the recorded ones."""
        network.dialect = VERSIONS[version]
        with (
            socket.create_server(("127.0.0.1", 0)) as listening,
            playing(listening, recorded(version, carrier)) as sent,
            Port(f"/wr_{carrier}", network=network) as writer,
        ):
            writer.add_output(Contact(f"/rd_{carrier}", *listening.getsockname(), carrier))
            for text in MESSAGES:
                assert writer.write(Bottle.parse(text)) == 1
        assert len(sent) == sum(way == ">" for way, _ in recorded(version, carrier))
        for expected, got in sent:
            assert got == expected


@version
def test_datagrams_arrive_as_recorded(network: Network, version: str):
    """Our reader gets the recorded datagrams, and ends the connection at the recorded text command."""
    network.dialect = VERSIONS[version]
    with BufferedPort("/rd_udp", strict=True, network=network) as reader:
        address = (reader.contact.host, reader.contact.port)
        with socket.create_connection(address, timeout=10) as connection:
            connection.sendall(recorded(version, "udp")[0][1])
            number = framing.read_number(receive(connection, 8))
            own = connection.getsockname()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
            sending.bind(own)
            for (_, datagram), text in zip(recorded(version, "udp datagrams"), MESSAGES, strict=True):
                sending.sendto(datagram, (address[0], number))
                assert same(reader.read(timeout=5), Bottle.parse(text))
        assert [caller.peer for caller in reader.inputs] == ["/wr_udp"]
        with socket.create_connection(address, timeout=10) as connection:
            (_, question), (_, answer) = recorded(version, "udp end")
            connection.sendall(question)
            assert receive(connection, len(answer)) == answer
        eventually(lambda: not reader.inputs, "the input is still there")


@version
def test_datagrams_are_sent_as_recorded(network: Network, version: str):
    """Our writer sends the recorded datagrams."""
    network.dialect = VERSIONS[version]
    with (
        socket.create_server(("127.0.0.1", 0)) as listening,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiving,
        Port("/wr_udp", network=network) as writer,
    ):
        receiving.bind(("127.0.0.1", 0))
        receiving.settimeout(10)
        answer = [*recorded(version, "udp")]
        answer[1] = ("<", framing.yarp_number(receiving.getsockname()[1]))
        with playing(listening, answer) as sent:
            writer.add_output(Contact("/rd_udp", *listening.getsockname(), "udp"))
        assert sent[0][0] == sent[0][1]
        for text in MESSAGES:
            writer.write(Bottle.parse(text))
        assert [receiving.recv(1 << 16) for _ in MESSAGES] == [data for _, data in recorded(version, "udp datagrams")]
        with playing(listening, recorded(version, "udp end")) as end:
            writer.remove_output("/rd_udp")
        assert end[0][0] == end[0][1]


@version
def test_administration_is_answered_as_recorded(network: Network, version: str):
    """Replies have the recorded bytes, or the same keys in the same order where values vary."""
    network.dialect = dialect = VERSIONS[version]
    segments = recorded(version, "admin")
    with (
        BufferedPort("/rd", network=network) as port,
        socket.create_connection((port.contact.host, port.contact.port), timeout=10) as connection,
    ):
        answers = []
        for way, data in segments:
            if way == ">":
                connection.sendall(data)
            else:
                answers.append((data, read_answer(connection, dialect)))
    handshake, help_of_word, help_of_vocab, version_of, inputs, about, set_process, end = answers
    assert handshake[1] == framing.yarp_number(port.contact.port)
    for expected, got in (help_of_word, help_of_vocab):
        assert shape(got, dialect)[0] == shape(expected, dialect)[0] == "[many]"
    for expected, got in (version_of, inputs, set_process, end):
        assert got == expected
    assert keys(decode_from(about[1], 0, dialect)[0]) == keys(decode_from(about[0], 0, dialect)[0])


def read_answer(connection: socket.socket, dialect: Dialect) -> bytes:
    """Read a handshake or an acknowledgement, or a bottle and the acknowledgement after it."""
    data = receive(connection, 8)
    while not data.startswith(b"YA"):
        try:
            _, end = decode_from(data, 0, dialect)
        except ValueError:
            data += connection.recv(1)
            continue
        return data + receive(connection, end + 8 - len(data))
    return data


def shape(answer: bytes, dialect: Dialect) -> list[str]:
    """Return the words of an answer."""
    return decode_from(answer, 0, dialect)[0].to_text().split(" ")


def keys(value: object) -> object:
    """Return the keys of groups, and the type of each value."""
    if isinstance(value, Bottle):
        return [keys(item) for item in value]
    if hasattr(value, "to_bottle"):
        return ("dict", [(group[0], [type(item).__name__ for item in group.tail()]) for group in value.to_bottle()])
    return value if isinstance(value, str) else type(value).__name__
