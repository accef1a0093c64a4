"""Administration of a port: the exact reply to each request of the protocol, by text and in binary."""

from __future__ import annotations

import os
import platform
import socket
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf.bottle import Bottle, Dialect, Property
from rtf.middleware.carriers.stream_carrier import TCP
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire import framing
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.outgoing_message import OutgoingMessage
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

_WAY = ("text_ack", "tcp")


def ask(port: Port, request: str, way: str) -> Bottle:
    """Send a request to a port, as a program without a port does."""
    network = port.network
    if way == "text_ack":
        return remote.administer(network, port.contact, Bottle.parse(request))
    stream = network.reach(port.contact)
    try:
        link = TCP.call(stream, "admin")
        link.send(OutgoingMessage("a", Bottle.parse(request), BOTTLE, Dialect.YARP3))
        reply = link.receive_reply(BOTTLE, Dialect.YARP3)
        link.finish()
        assert isinstance(reply, Bottle)
        return reply
    finally:
        stream.close()


def said_to(port: Port, *lines: str, header: str = "CONNACK tester") -> list[str]:
    """Return the lines with which the port answers these lines."""
    with socket.create_connection((port.contact.host, port.contact.port), 10) as connection:
        connection.sendall("".join(f"{line}\r\n" for line in (header, *lines, "q")).encode())
        heard = b""
        while part := connection.recv(1 << 16):
            heard += part
    return heard.decode().split("\r\n")[:-1]


@pytest.fixture(params=_WAY)
def way(request: pytest.FixtureRequest) -> str:
    """The carrier of the request."""
    return str(request.param)


@pytest.fixture
def port(network: Network) -> Iterator[Port]:
    """The port under test."""
    with Port("/port", network=network) as made:
        yield made


@pytest.fixture
def reader(network: Network) -> Iterator[BufferedPort[Bottle]]:
    """A port with inputs."""
    with BufferedPort("/reader", network=network) as made:
        yield made


@contextmanager
def sending(network: Network, target: str, carrier: str = "tcp") -> Iterator[Port]:
    """Yield a port with an output to the target."""
    with Port("/writer", network=network) as writer:
        writer.add_output(target, carrier)
        yield writer


class TestWords:
    """The words of requests: vocabs, strings, and unknown ones."""

    @pytest.mark.parametrize("word", ["[ver]", "ver", '"ver"', "version"])
    def test_version(self, port: Port, way: str, word: str):
        """The version is a constant; a word counts by its first four letters, so a longer one is unknown."""
        wanted = "[ver] 1 2 3" if "version" not in word else '[fail] "send [help] for list of valid commands"'
        assert ask(port, word, way).to_text() == wanted

    @pytest.mark.parametrize("request_", ["[nope]", "nonsense 1 2", "", "5", "(ver)"])
    def test_anything_else(self, port: Port, way: str, request_: str):
        """An unknown request is refused with a hint."""
        assert ask(port, request_, way).to_text() == '[fail] "send [help] for list of valid commands"'

    def test_help(self, port: Port, way: str):
        """Help has a line for each command after the vocab ``many``."""
        reply = ask(port, "[help]", way)
        assert Bottle([reply[0]]).to_text() == "[many]"
        words = {str(line).split("]")[0][1:] for line in [*reply][1:]}
        assert words == {"help", "ver", "add", "del", "list", "set", "get", "atch", "dtch", "prop"}

    def test_words_of_four_letters_are_enough(self, port: Port, way: str):
        """``property`` is understood as ``prop``."""
        assert ask(port, "property get nothing", way) == Bottle()


class TestAdd:
    """``[add]``: adding an output; the reply has a status and a text."""

    def test_a_name(self, port: Port, reader: Port, way: str):
        """A name is connected by tcp."""
        assert ask(port, "[add] /reader", way) == Bottle([0, "Added connection from /port to /reader\r\n"])
        assert [(output.peer, output.carrier) for output in port.outputs] == [("/reader", "tcp")]

    @pytest.mark.parametrize("contact", ["fast_tcp:/reader", "fast_tcp://reader"])
    def test_a_contact(self, port: Port, reader: Port, way: str, contact: str):
        """A contact is connected by its carrier, and the reply has it as it was asked."""
        assert ask(port, f'[add] "{contact}"', way) == Bottle([0, f"Added connection from /port to {contact}\r\n"])
        assert [(output.peer, output.carrier) for output in port.outputs] == [("/reader", "fast_tcp")]

    def test_a_carrier_of_its_own(self, port: Port, reader: Port, way: str):
        """A carrier after the name is used, and the reply has it before the name."""
        reply = ask(port, "[add] /reader fast_tcp", way)
        assert reply == Bottle([0, "Added connection from /port to fast_tcp://reader\r\n"])
        assert [output.carrier for output in port.outputs] == ["fast_tcp"]

    def test_an_address(self, port: Port, reader: Port, way: str):
        """An address is connected without a look-up of the name."""
        address = reader.contact.by("tcp")
        reply = ask(port, f'[add] "{address}reader"', way)
        assert reply == Bottle([0, f"Added connection from /port to {address}reader\r\n"])

    def test_again(self, port: Port, reader: Port, way: str):
        """A second connection to the same port replaces the first, also by another carrier."""
        for carrier in ("tcp", "tcp", "fast_tcp", "udp"):
            reply = ask(port, f"[add] /reader {carrier}", way)
            assert reply == Bottle([0, f"Added connection from /port to {carrier}://reader\r\n"])
        assert [(output.peer, output.carrier) for output in port.outputs] == [("/reader", "udp")]
        eventually(lambda: [one.carrier for one in reader.inputs] == ["udp"], "older inputs are left")

    def test_a_missing_port(self, port: Port, network: Network, said: list[str], way: str):
        """A port that is unknown or gone gives an error, whose cause the asked port reports."""
        assert ask(port, "[add] /nosuch", way) == Bottle([-1, "Do not know how to connect to /nosuch\r\n"])
        network.names.register("/gone", host="127.0.0.1", port=free_port())
        assert ask(port, "[add] /gone", way) == Bottle([-1, "Cannot connect to /gone\r\n"])
        assert said == ["Cannot connect to /gone: Connection refused"]

    @pytest.mark.parametrize("wrong", ["[add]", "[add] reader", "[add] 5", "[add] /reader nocarrier"])
    def test_what_is_no_port(self, port: Port, reader: Port, way: str, wrong: str):
        """An invalid request is refused with the reason, and nothing is connected."""
        status, text = ask(port, wrong, way)
        assert status == -1
        assert str(text).endswith("\r\n")
        assert not port.outputs

    def test_ports_that_send_nothing(self, network: Network, reader: Port, way: str):
        """Input-only ports and servers refuse outputs; a client has one at most."""
        refused = Bottle([-1, "Outputs not allowed\r\n"])
        with Port("/in", network=network, outputs=False) as port:
            assert ask(port, "[add] /reader", way) == refused
        with RpcServer("/server", lambda question: question, network=network) as server:
            assert ask(server, "[add] /reader", way) == refused
            with RpcClient("/client", network=network) as client:
                added = Bottle([0, "Added connection from /client to /server\r\n"])
                assert ask(client, "[add] /server", way) == added
                second = Bottle([-1, "RPC output already connected\r\n"])
                assert ask(client, "[add] /server", way) == second


@pytest.mark.parametrize("carrier", ["", "fast_tcp"])
def test_a_port_is_asked_to_connect_to_an_address(port: Port, reader: Port, carrier: str):
    """A port can be asked to connect to an address, by which it then lists the reader, as in YARP."""
    target = Contact("/reader", reader.contact.host, reader.contact.port, carrier)
    where = f"{carrier or 'tcp'}://{reader.contact.host}:{reader.contact.port}/"
    assert remote.connect(port.network, Contact("/port"), target) == f"Added connection from /port to {where}"
    assert [output.carrier for output in port.outputs] == [carrier or "tcp"]
    assert "/port" in [caller.sender for caller in reader.inputs]


class TestDelete:
    """``[del]``: removing a connection, an output before an input."""

    def test_an_output(self, port: Port, reader: Port, way: str):
        """Removing an output ends the connection at both ends."""
        port.add_output("/reader")
        assert ask(port, "[del] /reader", way) == Bottle([0, "Removed connection from /port to /reader\r\n"])
        assert port.outputs == ()
        eventually(lambda: not reader.inputs, "the reader was not told")

    def test_an_input(self, port: Port, network: Network, way: str):
        """Removing an input ends the connection of the writer."""
        with sending(network, "/port"):
            eventually(lambda: port.inputs, "the writer has not come")
            assert ask(port, "[del] /writer", way) == Bottle([0, "Removed connection from /writer to /port\r\n"])
            eventually(lambda: all(one.peer != "/writer" for one in port.inputs), "the input is left")

    def test_none(self, port: Port, way: str):
        """The reply about an unknown connection names both directions."""
        wanted = "Could not find an outgoing connection to /x\r\nCould not find an incoming connection from /x\r\n"
        assert ask(port, "[del] /x", way) == Bottle([-1, wanted])


class TestList:
    """``[list]``: the names of connected ports, or one connection."""

    def test_names(self, port: Port, reader: Port, network: Network, way: str):
        """The reply lists outputs, or inputs on request, the asking peer among them."""
        port.add_output("/reader")
        asking = "admin"
        with sending(network, "/port", "fast_tcp"):
            for request in ("[list]", "[list] [out]", "list out", "[list] [nonsense]"):
                assert ask(port, request, way) == Bottle(["/reader"])
            assert {"/writer", asking} == set(ask(port, "[list] [in]", way))

    @pytest.mark.parametrize(("carrier", "more"), [("tcp", ""), ("fast_tcp", ""), ("udp", " (connectionless 1)")])
    def test_one(self, port: Port, reader: Port, way: str, carrier: str, more: str):
        """The reply about one connection has both names and the carrier, and marks datagrams."""
        port.add_output("/reader", carrier)
        wanted = f'(from "/port") (to "/reader") (carrier {carrier}){more}'
        assert ask(port, "[list] [out] /reader", way).to_text() == wanted
        assert ask(reader, "[list] [in] /port", way).to_text() == wanted

    def test_unknown(self, port: Port, way: str):
        """The reply about an unknown connection is empty."""
        assert ask(port, "[list] [out] /x", way) == Bottle()
        assert ask(port, "[list] [in] /x", way) == Bottle()


class TestModify:
    """``[set]``, ``[get]``, ``[atch]`` and ``[dtch]`` of connections without modifiers."""

    @pytest.mark.parametrize("word", ["set", "get"])
    def test_errors(self, port: Port, way: str, word: str):
        """The errors have YARP's texts; an unknown output, too, is called an incoming connection."""
        nameless = Bottle([-1, "target port is not specified.\r\n"])
        assert ask(port, f"[{word}]", way) == ask(port, f"[{word}] [in]", way) == nameless
        wanted = Bottle([-1, "Could not find an incoming connection from /x\r\n"])
        assert ask(port, f"[{word}] [in] /x (a 1)", way) == wanted
        wanted = Bottle([-1, "Could not find an incoming connection to /x\r\n"])
        assert ask(port, f"[{word}] [out] /x", way) == wanted

    @pytest.mark.parametrize("word", ["set", "get"])
    def test_the_port_itself(self, port: Port, way: str, word: str):
        """The port has no modifier, and the reply says so."""
        for direction, name in (("in", "input"), ("out", "output")):
            wanted = f'[fail] "No port modifier is attached to the {name}"'
            assert ask(port, f"[{word}] [{direction}] /port", way).to_text() == wanted

    def test_a_connection(self, port: Port, reader: Port, way: str):
        """Settings of a connection without modifiers are accepted, and reading gives none."""
        port.add_output("/reader")
        assert ask(port, "[set] [out] /reader (a 1)", way) == Bottle([0, "Configured connection to /reader\r\n"])
        assert ask(reader, "[set] [in] /port (a 1)", way) == Bottle([0, "Configured connection from /port\r\n"])
        for reply in (ask(port, "[get] [out] /reader", way), ask(reader, "[get] [in] /port", way)):
            assert reply.to_text() == "()"
            assert way == "text_ack" or reply == Bottle([Property()])

    def test_monitors(self, port: Port, way: str):
        """A request about monitors needs a direction; with it the reply says that there are none."""
        for word, name in (("atch", "attach"), ("dtch", "detach")):
            wanted = f'[fail] "{name} command must be followed by [out] or [in]"'
            assert ask(port, f"[{word}]", way).to_text() == wanted
            assert ask(port, f"[{word}] [up]", way).to_text() == wanted
        assert (
            ask(port, '[atch] [in] "(type lua) (file x)"', way).to_text()
            == '[fail] "the port monitor x.lua is neither in the contexts nor among the shipped ones"'
        )
        assert ask(port, "[dtch] [out]", way).to_text() == "[fail]"


class TestProperties:
    """``[prop]``: stored properties, and those of ports and connections."""

    @pytest.mark.parametrize("value", ["10", "0.5", "text", '"two words"', "(1 2 (3 four))", "[ok]"])
    def test_values(self, port: Port, way: str, value: str):
        """Any value can be stored, and is returned unchanged."""
        assert ask(port, f"[prop] [set] foo {value}", way).to_text() == "[ok]"
        assert ask(port, "[prop] [get] foo", way).to_text() == Bottle.parse(value).to_text()
        assert ask(port, "[prop] [get]", way).to_text() == f"(foo {Bottle.parse(value).to_text()})"
        assert port.properties.find("foo") == Bottle.parse(value)[0]

    def test_several(self, port: Port, way: str):
        """Properties are listed in the order of their keys, each with its last value."""
        for key, value in (("b", 1), ("a", 2), ("b", 3)):
            ask(port, f"[prop] [set] {key} {value}", way)
        assert ask(port, "[prop] [get]", way).to_text() == "(a 2) (b 3)"

    def test_nothing(self, port: Port, way: str):
        """The reply about no, an unknown or an empty property is empty."""
        assert ask(port, "[prop] [get]", way) == Bottle()
        assert ask(port, "[prop] [get] foo", way) == Bottle()
        assert ask(port, "[prop] [set] foo", way).to_text() == "[ok]"
        assert ask(port, "[prop] [get] foo", way) == Bottle()

    @pytest.mark.parametrize("word", ["", "[put]", "5"])
    def test_unknown_action(self, port: Port, way: str, word: str):
        """An unknown action is refused."""
        assert ask(port, f"[prop] {word}", way).to_text() == '[fail] "property action not known"'

    def test_own_name(self, port: Port, way: str):
        """The properties of the port's own name describe thread, process, machine and port."""
        reply = ask(port, "[prop] [get] /port", way)
        assert [group[0] for group in reply] == ["sched", "process", "platform", "port"]
        facts = {str(group[0]): _facts(group[1], way) for group in reply}
        assert facts["sched"].keys() == {"policy", "priority", "tid"}
        assert int(facts["sched"]["tid"]) > 0
        process = facts["process"]
        assert (process["pid"], process["policy"], process["priority"]) == (os.getpid(), 0, 0)
        assert process["name"] == sys.argv[0]
        assert facts["platform"] == {"hostname": "127.0.0.1", "os": platform.system()}
        assert Bottle([reply[3]]).to_text() == '(port ((is_input 1) (is_output 1) (is_rpc 0) (type "")))'

    def test_flags(self, network: Network, way: str):
        """The port's description has its directions, whether it is for requests, and its type."""
        wanted = {
            "/in": (1, 0, 0, ""),
            "/image": (1, 1, 0, "yarp/image"),
            "/server": (1, 0, 1, ""),
            "/client": (0, 1, 1, ""),
        }
        ports = [
            Port("/in", network=network, outputs=False),
            Port("/image", network=network, promise="yarp/image"),
            RpcServer("/server", lambda question: question, network=network),
            RpcClient("/client", network=network),
        ]
        for port in ports:
            facts = _facts(ask(port, f"[prop] [get] {port.name}", way)[3][1], way)
            assert tuple(facts[key] for key in ("is_input", "is_output", "is_rpc", "type")) == wanted[port.name]
            port.close()

    def test_a_connection(self, port: Port, reader: Port, way: str):
        """The properties of a connection are its thread, 0 for outputs of a writer, and its quality of service."""
        port.add_output("/reader")
        wanted = "(sched ((policy 0) (priority 0) (tid 0))) (qos ((tos 0)))"
        assert ask(port, "[prop] [get] /reader", way).to_text() == wanted
        text = ask(reader, "[prop] [get] /port", way).to_text()
        assert text == f"(sched ((policy 0) (priority 0) (tid {reader.inputs[0].thread}))) (qos ((tos 0)))"

    def test_both_ways(self, port: Port, reader: Port, way: str):
        """With connections in both directions the reply has both."""
        port.add_output("/reader")
        reader.add_output("/port")
        eventually(lambda: len(port.inputs) == 1, "the other way has not come")
        reply = ask(port, "[prop] [get] /reader", way)
        assert [group[0] for group in reply] == ["sched", "qos", "sched", "qos"]

    def test_no_connection(self, port: Port, way: str):
        """A name with a slash is read as a connection, also if a property of that name is stored."""
        wanted = '[fail] "cannot find any connection to/from /x"'
        assert ask(port, "[prop] [get] /x", way).to_text() == wanted
        assert ask(port, "[prop] [set] /x 5", way).to_text() == "[ok]"
        assert ask(port, "[prop] [get] /x", way).to_text() == wanted
        assert ask(port, "[prop] [get]", way).to_text() == '("/x" 5)'
        assert ask(port, "[prop] [set] /x (qos ((tos 40)))", way).to_text() == "[fail]"


def _facts(value: object, way: str) -> dict[str, object]:
    """Return a property as a dictionary; as text it is a list of lists."""
    assert isinstance(value, Bottle if way == "text_ack" else Property)
    groups = value if isinstance(value, Bottle) else value.to_bottle()
    keys = [str(group[0]) for group in groups]
    assert keys == sorted(keys)
    return {str(group[0]): group[1] for group in groups}


class TestTyped:
    """Commands that a person types, each with its acknowledgement."""

    def test_frames(self, port: Port):
        """A reply is a line, which may be empty; without acknowledgements nothing follows it."""
        assert said_to(port, "a", "[ver]", "a", "[list] [out]") == [
            "Welcome tester",
            "[ver] 1 2 3",
            "<ACK>",
            "",
            "<ACK>",
            "<ACK>",
        ]
        assert said_to(port, "a", "[ver]", header="CONNECT tester") == ["Welcome tester", "[ver] 1 2 3"]

    def test_description(self, port: Port, reader: Port):
        """The description has the port's address, and the connections in each direction."""
        here = f"This is /port at tcp://127.0.0.1:{port.contact.port}/"
        asked = "There is an input connection from tester to /port using text_ack"
        assert said_to(port, "*")[1:-2] == [here, "There are no outgoing connections", asked]
        port.add_output("/reader", "udp")
        line = "There is an output connection from /port to /reader using udp"
        assert said_to(port, "*")[1:-2] == [here, line, asked]
        there = f"This is /reader at tcp://127.0.0.1:{reader.contact.port}/"
        line = "There is an input connection from /port to /reader using udp"
        assert said_to(reader, "*")[1:4] == [there, "There are no outgoing connections", line]

    @pytest.mark.parametrize("key", ["?", "h"])
    def test_help(self, port: Port, key: str):
        """Help has every command."""
        text = "\n".join(said_to(port, key))
        assert all(f"\n  {word} " in text for word in ("d", "D", "a", "/name", "!/name", "~/name", "r", "*", "q", "?"))

    def test_connecting(self, port: Port, reader: Port, network: Network):
        """Typed commands add an output, also by another carrier, and remove outputs and inputs."""
        for line in ("/reader", "fast_tcp:/reader"):
            assert said_to(port, line)[1] == f"Added connection from /port to {line}"
        assert [output.carrier for output in port.outputs] == ["fast_tcp"]
        assert said_to(port, "!/reader")[1] == "Removed connection from /port to /reader"
        assert said_to(port, "!/reader")[1] == "Could not find an outgoing connection to /reader"
        assert said_to(port, "/nosuch")[1] == "Do not know how to connect to /nosuch"
        with sending(network, "/port"):
            assert said_to(port, "~/writer")[1] == "Removing connection from /writer to /port"
            eventually(lambda: not port.inputs, "the input is left")
        assert said_to(port, "~/writer")[1] == "Could not find an incoming connection from /writer"

    @pytest.mark.parametrize("line", ["x", "register /a", "", "5"])
    def test_nonsense(self, port: Port, line: str):
        """An unknown line is answered with three lines of advice, and the connection stays."""
        advice = ["Port command not understood.", "Type d to send data to the port's owner.", "Type ? for help."]
        assert said_to(port, line, "a", "[ver]")[1:] == [*advice, "<ACK>", "[ver] 1 2 3", "<ACK>", "<ACK>"]

    def test_binary_callers_get_no_lines(self, port: Port, reader: Port):
        """A typed command of a binary caller is executed and acknowledged, without lines."""
        stream = port.network.reach(port.contact)
        stream.send(framing.header(131) + framing.sender("tester"))
        stream.run(stream.take(8))
        for text in ("*", "?", "/reader", "nonsense"):
            command = framing.command_text(text)
            stream.send(framing.index(len(command)) + command)
            assert stream.run(stream.take(8)) == framing.ACK
        assert [output.peer for output in port.outputs] == ["/reader"]
        stream.close()


class TestTurnedRound:
    """``r``: the caller becomes a reader of the port."""

    def test_a_person_reads(self, port: Port):
        """Messages of the port are sent to the person as text."""
        with socket.create_connection((port.contact.host, port.contact.port), 10) as connection:
            connection.sendall(b"CONNECT tester\r\nr\r\n")
            eventually(lambda: [output.peer for output in port.outputs] == ["tester"], "it was not turned round")
            assert not port.inputs
            assert port.write(Bottle([1, "two words"])) == 1
            wanted = b'Welcome tester\r\nD\r\n1 "two words"\r\n'
            heard = b""
            while len(heard) < len(wanted):
                heard += connection.recv(1000)
            assert heard == wanted

    def test_in_binary(self, port: Port):
        """A binary caller gets an acknowledgement, then messages, which it acknowledges."""
        stream = port.network.reach(port.contact)
        stream.send(framing.header(131) + framing.sender("/tester"))
        stream.run(stream.take(8))
        command = b"\0\0\0\0~r\0\1"
        stream.send(framing.index(len(command)) + command)
        assert stream.run(stream.take(8)) == framing.ACK
        eventually(lambda: port.outputs, "it was not turned round")
        stream.send(framing.ACK)
        assert port.write(Bottle([1])) == 1
        blocks, rest = framing.index_rest(bytes(stream.run(stream.take(framing.INDEX_SIZE))))
        size = framing.message_size(stream.run(stream.take(rest)), 0, blocks)
        assert framing.read_command(stream.run(stream.take(size))).key == "D"
        stream.close()
        port.write(Bottle([2]))
        assert not port.outputs

    def test_where_nothing_is_sent(self, network: Network, said: list[str]):
        """An input-only port ends the connection of a caller that wants to read."""
        with Port("/in", network=network, outputs=False) as port:
            assert said_to(port, "r") == ["Welcome tester", "<ACK>"]
            eventually(lambda: said == ["/in: tester was cut off: Outputs not allowed"], "nobody was told")
