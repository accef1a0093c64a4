"""Recorded conversations with YARP's name server, replayed with our server and with our client."""

from __future__ import annotations

import ast
import json
import re
import socket
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.pools import Numbers, group, group_slots
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.naming.server import NameServer

_DATA = Path(__file__).parents[2] / "data" / "yarp_wire"
_VERSIONS = ("3.12.3", "4.0.0")
_NUMBER = re.compile(rb"(?<=port )\d+|(?<=port_number )\d+|(?<=tcp 127\.0\.0\.1 )\d+")

Segments = list[tuple[str, bytes]]


def recorded(version: str, what: str) -> list[Segments]:
    """Return the conversations of a file."""
    text = (_DATA / version / f"name_server_{what}.json").read_text()
    return [[(way, said.encode("latin-1")) for way, said in segments] for segments in json.loads(text)]


def typed(version: str) -> Iterator[list[Segments]]:
    """Yield the conversations that were typed by hand, each with the answer to every line."""
    text = (_DATA / version / "name_server_probe.txt").read_text()
    for section in re.split(r"^===== .*$", text, flags=re.MULTILINE)[1:]:
        ways = [(line[:3], line[4:]) for line in section.strip().splitlines()]
        yield [(">" if way == ">>>" else "<", ast.literal_eval(said)) for way, said in ways if said != "EOF"]


def moved(said: bytes, server: NameServer) -> bytes:
    """Replace the recorded server's port numbers by those that our server assigns."""
    base = Numbers.beside(server.contact.port).cursor - 2

    def other(match: re.Match[bytes]) -> bytes:
        number = int(match[0])
        if number == 10000:
            return (
                match[0] if b"fallback" in said[: match.start()].rpartition(b"name")[2] else b"%d" % server.contact.port
            )
        return b"%d" % (number - 10000 + base) if 10000 < number < 20000 else match[0]

    return _NUMBER.sub(other, said).replace(b"224.1.1.3", group(group_slots(server.contact.port).last + 1).encode())


class TestServer:
    """Our server gets the recorded requests."""

    @pytest.mark.parametrize("version", _VERSIONS)
    @pytest.mark.parametrize("what", ["names", "carriers"])
    def test_answers_to_the_byte(self, server: NameServer, say: Callable[..., bytes], version: str, what: str):
        """Every answer has the recorded bytes."""
        conversations = recorded(version, what)
        assert len(conversations) == {"names": 20, "carriers": 162}[what]
        for segments in conversations:
            asked = b"".join(moved(said, server) for way, said in segments if way == ">")
            expected = b"".join(moved(said, server) for way, said in segments if way == "<")
            if asked == b"ping\n":
                continue  # it is no carrier: the recorded client left before the refusal
            assert say(server.contact, asked) == expected

    @pytest.mark.parametrize("version", _VERSIONS)
    def test_answers_what_was_typed(self, server: NameServer, version: str):
        """Requests that were typed at a robot's name server, in turn on one connection, have the recorded answers."""
        sections = [section for section in typed(version) if not section[0][1].startswith(b"GET")]
        assert [len(section) for section in sections] == [28, 2]
        listed = next(said for way, said in sections[0] if way == "<" and said.startswith(b"registration"))
        for name, number in re.findall(rb"name (/icub\S+) ip 127.0.0.1 port (\d+)", moved(listed, server)):
            server.names.command(f"register {name.decode()} tcp 127.0.0.1 {number.decode()}")
        for section in sections:
            with socket.create_connection((server.contact.host, server.contact.port), 10) as connection:
                for way, said in section:
                    if way == ">":
                        connection.sendall(said)
                    elif said:
                        expected = moved(said, server)
                        assert connection.recv(len(expected), socket.MSG_WAITALL) == expected


class Recording:
    """A server that expects the recorded requests in order, and sends the recorded answers."""

    def __init__(self, conversations: list[Segments]) -> None:
        self.missed: list[tuple[bytes, bytes]] = []
        self._conversations = conversations
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.contact = Contact("/root", *self._listening.getsockname()[:2], "tcp")
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        connection = self._listening.accept()[0]
        for segments in self._conversations:
            if not connection.recv(1, socket.MSG_PEEK):  # the next request does not come through the same connection
                connection.close()
                connection = self._listening.accept()[0]
            for way, said in segments:
                if way == "<":
                    connection.sendall(said)
                    continue
                heard = b""
                while not heard.endswith(b"\n"):
                    heard += connection.recv(65536)
                if _comparable(heard) != _comparable(said):
                    self.missed.append((said, heard))
        connection.close()

    def close(self) -> None:
        """Wait until the last request has come."""
        self._thread.join(10)
        self._listening.close()
        assert not self._thread.is_alive(), "not everything was asked"


def _comparable(line: bytes) -> bytes:
    """Blank those parts of a line that depend on the machine: carriers, addresses, the process."""
    return re.sub(rb"(set \S+ (offers|accepts|ips|process)) [^\r]*\r\n", rb"\1 ...\r\n", line)


class TestClient:
    """Our client gets the recorded answers."""

    @pytest.mark.parametrize("version", _VERSIONS)
    def test_asks_to_the_byte(self, version: str):
        """The client sends the bytes of ``yarp name``, and decodes the answers."""
        asked = [one for one in recorded(version, "names") if one[0][1].startswith(b"NAME_SERVER")]
        server = Recording(asked)
        names = RemoteNames(server.contact, watch=60)
        x = Contact("/x", "127.0.0.1", 10500, "tcp")
        root, fallback = Contact("/root", "127.0.0.1", 10000, "tcp"), Contact("fallback", "224.2.1.1", 10000, "mcast")
        try:
            assert names.list() == [root, fallback]
            assert names.register("/x", carrier="tcp", host="127.0.0.1", port=10500) == x
            assert names.query("/x") == x
            assert names.query("/nothere") is None
            assert names.command("set /x offers tcp udp")[0] == "port /x property offers = tcp udp"
            assert names.command("get /x offers")[0] == "port /x property offers = tcp udp"
            assert names.command("check /x offers tcp")[0].endswith("present true")
            assert names.command("route /x /x")[0] == "port /x route /x = tcp://x"
            names.unregister("/x")
            assert names.list() == [root, fallback]
            assert names.query("/x") is None
        finally:
            names.close()
            server.close()
        assert not server.missed

    @pytest.mark.parametrize("version", _VERSIONS)
    def test_registers_a_port_to_the_byte(self, version: str):
        """A port and a multicast sender register and unregister with the recorded bytes."""
        all_of_it = recorded(version, "carriers")
        reader = [one for one in all_of_it if re.search(rb"(register|set|announce) /rd_tcp\b", one[0][1])]
        reader.sort(key=lambda one: b"unregister" in one[0][1])
        group = [one for one in all_of_it if re.search(rb"(register \.\.\. mcast|/tmp/port/1\b)", one[0][1])]
        assert [len(reader), len(group)] == [7, 7]
        server = Recording([*reader, *group])
        names = RemoteNames(server.contact, watch=60)
        try:
            assert names.register("/rd_tcp").port == 10002
            names.announce("/rd_tcp")
            names.unregister("/rd_tcp")
            assert names.register("", carrier="mcast") == Contact("/tmp/port/1", "224.1.1.3", 10010, "mcast")
            names.set_property("/wr_mcast", "owns", ["/tmp/port/1"])
            names.unregister("/tmp/port/1")
        finally:
            names.close()
            server.close()
        assert not server.missed
