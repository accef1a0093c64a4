"""The name server as a port: its carriers, bad callers, events and persistent connections."""

from __future__ import annotations

import random
import resource
import socket
import struct
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.bottle.binary import decode_from, encode
from rtf.middleware.carriers import name_ser
from rtf.middleware.errors import AddressError, ConnectError
from rtf.middleware.naming import server as module
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire import framing
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.name_server_lines import MAX_COMMAND

if TYPE_CHECKING:
    from collections.abc import Callable

END = b"*** end of message\r\n"
Say = "Callable[..., bytes]"


def own(server: NameServer) -> bytes:
    """Return the line of the server's own registration."""
    return f"registration name /root ip 127.0.0.1 port {server.contact.port} type tcp\r\n".encode()


class TestLines:
    """Lines that begin with ``NAME_SERVER``."""

    def test_several_on_one_connection(self, server: NameServer, say: Say):
        """Each line is answered, one without the prefix by the end line only; both kinds of line ends are accepted."""
        asked = (
            b"NAME_SERVER query /root\nNAME_SERVER query /root\r\nquery /root\n\nNAME_SERVER\nNAME_SERVER query /root\n"
        )
        expected = 2 * (own(server) + END) + 3 * END + own(server) + END
        assert say(server.contact, asked) == expected

    def test_in_pieces(self, server: NameServer, say: Say):
        """A line may arrive in any number of pieces."""
        asked = b"NAME_SERVER query /root\n"
        expected = own(server) + END
        assert say(server.contact, *(bytes([letter]) for letter in asked), size=len(expected)) == expected

    def test_too_long(self, server: NameServer, said: list[str], say: Say, wait_until: Callable[..., None]):
        """A caller whose line is too long is disconnected with a report, and others are served."""
        for ending in b"", b"\n":
            line = b"NAME_SERVER set /a k " + b"x" * MAX_COMMAND + ending
            with suppress(ConnectionResetError):  # it was cut off while it spoke
                assert say(server.contact, line) == b""
        wait_until(lambda: len(said) == 2, "nothing was reported")
        assert "a line of more than 16384 bytes" in said[0]
        assert say(server.contact, b"NAME_SERVER query /root\n") == own(server) + END

    def test_a_caller_that_says_nothing(self, server: NameServer, monkeypatch: pytest.MonkeyPatch):
        """A silent caller is disconnected after a time."""
        monkeypatch.setattr(name_ser, "_PATIENCE", 0.05)
        with socket.create_connection((server.contact.host, server.contact.port), 10) as connection:
            connection.sendall(b"NAME_SERVER query /root\n")
            expected = own(server) + END
            assert connection.recv(len(expected), socket.MSG_WAITALL) == expected
            assert connection.recv(1) == b""


class TestBinary:
    """Commands by the carrier tcp."""

    @staticmethod
    def _asked(server: NameServer, command: bytes, *messages: bytes) -> bytes:
        with socket.create_connection((server.contact.host, server.contact.port), 10) as connection:
            connection.sendall(framing.header(131) + framing.sender("/me"))
            assert framing.read_number(connection.recv(8, socket.MSG_WAITALL)) == server.contact.port
            for message in messages:
                connection.sendall(framing.index(len(command), len(message)) + command + message)
            heard = b""
            while heard.count(framing.ACK) < len(messages):
                part = connection.recv(4096)
                assert part
                heard += part
            return heard

    def test_a_plain_answer_is_text(self, server: NameServer):
        """The answer has the bytes of the answer in lines, and an acknowledgement."""
        question = bytes.fromhex("04010000 02000000 05000000 7175657279 05000000 2f726f6f74")
        assert self._asked(server, framing.command("d"), question) == own(server) + END + framing.ACK

    def test_an_answer_for_machines_is_a_bottle(self, server: NameServer):
        """Answers to ``bot``, ``announce`` and ``subscribe`` are bottles."""
        asked = [encode(Bottle(words.split())) for words in ("bot query /root", "announce /root", "subscribe")]
        heard = self._asked(server, framing.command("d"), *asked)
        port = server.contact.port
        for text in (
            f'port (name "/root") (ip "127.0.0.1") (port_number {port}) (carrier tcp)',
            "[ok]",
            "subscriptions",
        ):
            bottle, end = decode_from(heard)
            assert bottle.to_text() == text
            assert heard[end : end + 8] == framing.ACK
            heard = heard[end + 8 :]

    def test_without_a_reply(self, server: NameServer):
        """A command that wants no reply is executed and acknowledged."""
        assert self._asked(server, framing.command("D"), encode(Bottle(["register", "/a"]))) == framing.ACK
        assert server.names.query("/a") is not None

    def test_what_is_no_command(self, server: NameServer):
        """A bottle that is no command is answered by the end line."""
        assert self._asked(server, framing.command("d"), encode(Bottle([5, [1.5], b"x"]))) == END + framing.ACK


class TestText:
    """Commands by the text carriers."""

    def test_data_and_administration(self, server: NameServer, say: Say):
        """Data are commands of the name server, administration is that of any port."""
        asked = b"CONNACK me\r\nd\r\nquery /root\r\na\r\n[ver]\r\nd\r\nannounce /root\r\nq\r\n"
        expected = (
            b"Welcome me\r\n" + own(server) + END + b"<ACK>\r\n[ver] 1 2 3\r\n<ACK>\r\n[ok]\r\n<ACK>\r\n<ACK>\r\n"
        )
        assert say(server.contact, asked, size=len(expected)) == expected

    def test_describes_itself(self, server: NameServer, say: Say):
        """The server describes itself as any port does."""
        asked = b"CONNECT me\r\n*\r\n"
        first = f"Welcome me\r\nThis is /root at tcp://127.0.0.1:{server.contact.port}/\r\n".encode()
        assert say(server.contact, asked, size=len(first)).startswith(first)


class TestOrigin:
    """The default address of a port."""

    @pytest.mark.parametrize("asked", [b"NAME_SERVER register /a\n", b"CONNECT x\r\nd\r\nregister /a\r\n"])
    def test_the_address_of_the_caller(self, server: NameServer, asked: bytes, wait_until: Callable[..., None]):
        """A port registered without a host is at the address of the caller, by every carrier."""
        with socket.create_connection(
            (server.contact.host, server.contact.port), 10, source_address=("127.0.0.7", 0)
        ) as caller:
            caller.sendall(asked)
            wait_until(lambda: server.names.query("/a"), "it was not registered")
            assert server.names.query("/a").host == "127.0.0.7"


class TestAddress:
    """The address of a server."""

    def test_is_one_servers(self, server: NameServer):
        """A second server at an address is an error that says how to find the first."""
        with pytest.raises(
            ConnectError, match=r"cannot listen on 127\.0\.0\.1:\d+: Address already in use; .*rtf where"
        ):
            NameServer(port=server.contact.port)

    @pytest.mark.parametrize("host", ["0.0.0.0", "::", ""])
    def test_of_all_interfaces(self, host: str):
        """An address that stands for all interfaces is refused."""
        with pytest.raises(AddressError, match="give an address of this machine"):
            NameServer(host)

    def test_of_another_machine(self):
        """An address of another machine is refused."""
        with pytest.raises(ConnectError, match=r"192\.0\.2\.77"):
            NameServer("192.0.2.77")

    def test_is_free_again_at_once(self, server: NameServer):
        """The address of a closed server is free at once, also if callers were connected."""
        with NameServer() as first, socket.create_connection((first.contact.host, first.contact.port)) as caller:
            caller.sendall(b"NAME_SERVER list\n")
            assert caller.recv(1)
            first.close()
            with NameServer(port=first.contact.port) as second:
                assert second.contact == first.contact

    def test_registers_itself(self, server: NameServer):
        """The server registers itself, and the group of discovery."""
        assert server.names.query("/root") == server.contact
        assert list(server.names.get_property("/root", "nameserver")) == ["true"]
        assert server.names.query("fallback") == Contact("fallback", "224.2.1.1", 10000, "mcast")


class TestBadCallers:
    """Bad callers cost little, and do not affect others."""

    def test_many_that_say_nothing(self, server: NameServer, say: Say, monkeypatch: pytest.MonkeyPatch):
        """With too many silent callers the oldest are disconnected, and the server answers."""
        monkeypatch.setattr(module, "MAX_CALLERS", 20)
        with ExitStack() as stack:
            callers = [
                stack.enter_context(socket.create_connection((server.contact.host, server.contact.port), 10))
                for _ in range(100)
            ]
            assert say(server.contact, b"NAME_SERVER query /root\n") == own(server) + END
            for caller in callers[:70]:
                assert caller.recv(1) == b""

    def test_many_names(self, server: NameServer, say: Say):
        """A flood of registrations on one connection is answered in full."""
        count = 2000
        asked = b"".join(b"NAME_SERVER register /%d\n" % index for index in range(count))
        assert say(server.contact, asked).count(END) == count
        assert len(server.names.list()) == count + 2

    def test_one_that_does_not_listen(
        self, server: NameServer, said: list[str], say: Say, wait_until: Callable[..., None], monkeypatch
    ):
        """A caller that reads no answers is disconnected with a report; others are served meanwhile."""
        monkeypatch.setattr(name_ser, "_PATIENCE", 0.2)
        for index in range(300):
            server.names.register(f"/{index}", host="127.0.0.1", port=20001)
        with socket.create_connection((server.contact.host, server.contact.port), 10) as deaf:
            deaf.setblocking(False)
            with suppress(BlockingIOError, ConnectionError):  # it may be cut off while it speaks
                for _ in range(10_000):
                    deaf.send(b"NAME_SERVER list\n")
            assert say(server.contact, b"NAME_SERVER query /root\n") == own(server) + END
            wait_until(lambda: said, "it was not cut off")
            assert "does not read what is sent" in said[0]

    @pytest.mark.fuzz
    def test_random_bytes(self, server: NameServer, say: Say):
        """After any garbage the server answers the next request, and its memory does not grow."""
        chance = random.Random(7)
        starts = [
            b"NAME_SER",
            b"NAME_SERVER ",
            b"CONNACK x\r\nd\r\n",
            b"CONNECT ",
            framing.header(131),
            framing.header(3),
            b"",
        ]
        starts += [
            framing.header(131) + framing.sender("/x") + framing.index(8, 40) + framing.command("d"),
            b"GET / HTTP/1.1\r\n\r\n",
        ]
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for _ in range(300):
            noise = chance.randbytes(chance.choice((0, 3, 40, 3000)))
            lines = b"\n".join(
                chance.choice((b"register /a", b"bot list", b"d", b"a", b"[", b'"', b"subscribe /a /b", noise[:50]))
                for _ in range(chance.randint(0, 6))
            )
            with suppress(ConnectionResetError):  # it was cut off while it spoke
                say(server.contact, chance.choice(starts) + chance.choice((noise, lines + b"\n")))
        assert say(server.contact, b"NAME_SERVER query /root\n") == own(server) + END
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000, "kilobytes"

    @pytest.mark.fuzz
    @settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
    @given(st.lists(st.binary(max_size=60).map(lambda data: b"NAME_SERVER " + data + b"\n"), min_size=1, max_size=5))
    def test_random_lines(self, server: NameServer, say: Say, lines: list[bytes]):
        """Every line is answered."""
        heard = say(server.contact, *lines)
        assert heard.endswith(b"\r\n")

    def test_one_that_is_gone_before_the_answer(self, server: NameServer, say: Say):
        """A caller that resets its connection does not affect the next one."""
        for _ in range(20):
            caller = socket.create_connection((server.contact.host, server.contact.port), 10)
            caller.sendall(b"NAME_SERVER list\n")
            caller.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            caller.close()
        assert say(server.contact, b"NAME_SERVER query /root\n") == own(server) + END


class TestByItself:
    """Events, and persistent connections."""

    def test_reports_ports_that_come_and_go(
        self, server: NameServer, names: RemoteNames, wait_until: Callable[..., None]
    ):
        """The server sends registrations and removals to the readers of its port."""
        network, heard = Network(names), []
        with Port("/listener", lambda delivery: heard.append(delivery.read().to_text()), network=network):
            remote.connect(network, Contact("/root"), Contact("/listener"))
            with Port("/a", network=network):
                pass
            wait_until(lambda: '[del] "/a"' in heard, f"heard {heard}")
            # A number that is assigned may be in use on this machine: then the port registers once more.
            assert [*dict.fromkeys(heard)] == ['[add] "/a"', '[del] "/a"']

    def test_connects_ports_whenever_both_are_there(
        self, server: NameServer, names: RemoteNames, wait_until: Callable[..., None]
    ):
        """A subscription connects its ports, by its carrier, each time both are open."""
        network = Network(names)
        names.command('subscribe "/writer" "fast_tcp://reader"')

        def connected(writer: Port) -> bool:
            return [(output.peer, output.carrier) for output in writer.outputs] == [("/reader", "fast_tcp")]

        with Port("/writer", network=network) as writer:
            for _ in range(2):
                with Port("/reader", network=network):
                    wait_until(lambda: connected(writer), "not connected")
                wait_until(lambda: not writer.outputs, "not disconnected")
        with Port("/reader", network=network) as reader:
            for _ in range(2):
                with Port("/writer", network=network) as writer:
                    wait_until(lambda writer=writer: connected(writer), "not connected")
                wait_until(lambda: not reader.inputs, "not disconnected")

    def test_says_what_cannot_be_connected(
        self, server: NameServer, names: RemoteNames, said: list[str], wait_until: Callable[..., None]
    ):
        """A subscription of a port that does not answer is reported."""
        names.command("register /dead tcp 127.0.0.1 1")
        names.command("register /b tcp 127.0.0.1 2")
        for name in "/dead", "/b":
            names.announce(name)
        names.command("subscribe /dead /b")
        wait_until(lambda: said, "nothing was said")
        assert "Cannot connect to /dead" in said[0]

    def test_a_reader_that_hangs_delays_no_other(self, server: NameServer, names: RemoteNames):
        """A reader of the events that hangs does not delay answers."""
        with socket.create_server(("127.0.0.1", 0)) as deaf:
            names.command(f"register /deaf tcp 127.0.0.1 {deaf.getsockname()[1]}")
            names.command("announce /deaf")
            with ExitStack() as stack:
                ours = socket.create_connection((server.contact.host, server.contact.port), 10)
                stack.enter_context(ours)
                ours.sendall(b'CONNECT me\r\na\r\n[add] "tcp://deaf"\r\n')
                theirs, _ = deaf.accept()
                stack.enter_context(theirs)
                theirs.recv(8 + 4 + 6, socket.MSG_WAITALL)
                theirs.sendall(framing.yarp_number(1))
                said = b""
                while b"Added" not in said:
                    part = ours.recv(200)
                    assert part, said
                    said += part
                for index in range(50):
                    assert names.register(f"/a{index}").port
                    names.unregister(f"/a{index}")


def test_survives_in_a_file(tmp_path, say: Say):
    """With ``portdb`` another server knows the registered ports, and itself as the only server."""
    with NameServer(portdb=tmp_path / "names.db") as first:
        first.names.command("register /a")
        there = first.names.query("/a")
    with NameServer(namespace="/other", portdb=tmp_path / "names.db") as second:
        assert second.names.query("/a") == there
        assert second.names.query("/root") is None
        assert [contact.name for contact in second.names.list()] == ["/a", "/other", "fallback"]


def test_a_server_answers_though_another_one_had_its_descriptor(network: Network):
    """A server answers although a closed one had the same descriptor."""
    with Port("/keeps/the/listener", network=network):
        for _ in range(3):
            with NameServer() as server:
                assert RemoteNames(server.contact, patience=5).query("/root") is not None
