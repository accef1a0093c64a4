"""Tools that exchange messages, each in a process: read, write, connect, rpc; and how they end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import idl
from rtf.bottle import Bottle, BottleError, Dialect
from rtf.bottle.binary import encode
from rtf.cli.network import rpc
from rtf.middleware.errors import PortClosedError
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import Function, Service
from rtf.middleware.types.codecs import RAW

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conftest import Net, Tool

DATA = Path(__file__).parents[2] / "data" / "yarp_wire" / "3.12.3"


@pytest.fixture
def reader(net: Net) -> Iterator[Tool]:
    """``rtf read /reader``; Ctrl-C must end it without an error and without a registered name."""
    tool = net.opened("/reader", "read", "/reader")
    yield tool
    assert tool.end() == 0
    assert "Traceback" not in tool.stderr
    assert net.names.query("/reader") is None


class TestReadAndWrite:
    """``rtf read`` and ``rtf write``."""

    def test_lines_arrive_as_yarp_prints_them(self, net: Net, reader: Tool):
        """``rtf read`` prints every type of value as YARP did in a recording."""
        recorded = (DATA / "tools_read.console.txt").read_text(encoding="utf-8")
        assert net.run("write", "/writer", "/reader", lines=tuple(recorded.splitlines())).process.returncode == 0
        reader.until_printed(recorded.splitlines()[-1])
        assert reader.stdout == recorded

    @pytest.mark.parametrize("carrier", ["fast_tcp", "udp", "mcast", "text", "text_ack", "unix_stream"])
    def test_by_each_carrier(self, net: Net, reader: Tool, carrier: str):
        """``rtf write`` uses the carrier before the name, and ends with its input."""
        writer = net.start("write", "/writer", f"{carrier}://reader")
        writer.until(lambda: net.answers("/writer"), "the writer")

        def heard() -> bool:
            writer.type(f"by {carrier}")  # datagrams may be lost, the first ones above all
            return f"by {carrier}" in reader.stdout.splitlines()

        writer.until(heard, "a message")
        found = net.run("exists", "/writer", "/reader")
        assert found.stdout == f"Connection found from /writer to /reader using carrier {carrier}\n"
        assert writer.wait() == 0
        assert writer.stderr == ""

    @pytest.mark.parametrize(("dialect", "expected"), [("3", Dialect.YARP3), ("4", Dialect.YARP4)])
    def test_the_dialect_is_that_of_the_option(self, net: Net, dialect: str, expected: Dialect):
        """``--dialect`` sets the encoding of numbers, also for a reader that knows both."""
        heard: list[bytes] = []
        with Port("/raw", lambda delivery: heard.append(delivery.read(RAW)), network=Network(net.names)):
            assert net.run("write", "...", "/raw", "--dialect", dialect, lines=("1.5",)).process.returncode == 0
        assert heard == [encode(Bottle([1.5]), expected)]

    def test_lines_are_joined_while_something_is_open(self, net: Net, reader: Tool):
        """Lines are joined while a bracket is open."""
        net.run(
            "write",
            "/writer",
            "/reader",
            lines=(
                "(1",
                "2) 3",
            ),
        )
        reader.until_printed("(1 2) 3")

    def test_bytes_that_are_no_text_come_through(self, net: Net, reader: Tool):
        """Bytes that are not UTF-8 are sent and printed unchanged, in any locale."""
        writer = net.start("write", "/writer", "/reader", LC_ALL="C")
        writer.process.stdin.write(b'"\xff\xfe" \xc3\xa4\n')
        assert writer.wait() == 0
        reader.until(lambda: reader._out.read_bytes() == b'"\xff\xfe" "\xc3\xa4"\n', "the bytes")

    def test_once_and_envelope_and_trim(self, net: Net):
        """``rtf read`` can end after one message, print its stamp as YARP does, and cut the text."""
        once = net.opened("/once", "read", "/once", "envelope", "trim", "5", "once")
        line = "CONNECT x\r\nd 7 99.5\r\n1 2 3 4 5\r\n"
        _send(net, "/once", line)
        assert once.wait() == 0
        assert once.stdout == "7 99.5000 1 2 3\n"

    def test_messages_to_people(self, net: Net):
        """Of a message of 0 or 1 and a text only the text is printed; 1 ends the reader."""
        tool = net.opened("/people", "read", "/people")
        net.run("write", "/writer", "/people", lines=('0 "good morning"', "0 7", '1 "good night"'))
        assert tool.wait() == 0
        assert tool.stdout == "good morning\n0 7\n"

    def test_reading_from_a_source(self, net: Net):
        """``rtf read`` connects a source to its port, by the carrier before the name."""
        writer = net.opened("/writer", "write", "/writer", "--await-reader", "20")
        reader = net.start("read", "...", "fast_tcp://writer", "once")
        writer.type("[set] 1")
        assert reader.wait() == 0
        assert reader.stdout == "[set] 1\n"
        assert writer.wait() == 0

    def test_a_port_that_is_there_already(self, net: Net, reader: Tool):
        """A tool refuses to take the name of a port that answers."""
        second = net.run("read", "/reader")
        assert second.process.returncode == 1
        assert "There is a port /reader already" in second.stderr
        assert net.run("exists", "/reader").process.returncode == 0

    def test_a_target_that_is_missing(self, net: Net):
        """A missing target is named with a hint, and no port stays open."""
        done = net.run("write", "/writer", "/nowhere")
        assert done.process.returncode == 1
        assert "/nowhere" in done.stderr
        assert "rtf list" in done.stderr

    def test_a_prefix(self, net: Net):
        """``YARP_PORT_PREFIX`` is put before the names of opened ports, not of targets."""
        tool = net.start("read", "/in", "once", YARP_PORT_PREFIX="/lab")
        tool.until(lambda: net.answers("/lab/in"), "the port")
        second = net.run("read", "/in", YARP_PORT_PREFIX="/lab")
        assert "There is a port /lab/in already" in second.stderr
        net.run("write", "/out", "/lab/in", lines=("hello",))
        assert tool.wait() == 0
        assert tool.stdout == "hello\n"


class TestEnds:
    """The ends of tools, and their effects on others."""

    @pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
    def test_other_signals(self, net: Net, number: int):
        """SIGTERM and SIGHUP end a tool as Ctrl-C does, without a registered name left."""
        tool = net.opened("/writer", "write", "/writer")
        assert tool.end(number) == 0
        assert tool.stderr == ""

    def test_a_closed_output(self, net: Net):
        """A closed output ends the tool without a message, with exit code 3."""
        out, into = os.pipe()
        tool = net.opened("/piped", "read", "/piped")
        tool.end()
        process = subprocess.Popen(
            [sys.executable, "-m", "rtf", "read", "/piped"],
            env=net.environment,
            stdin=subprocess.DEVNULL,
            stdout=into,
            stderr=subprocess.PIPE,
        )
        os.close(into)
        os.close(out)
        tool.until(lambda: net.answers("/piped"), "the port")
        net.run("write", "/writer", "/piped", lines=("one", "two"))
        assert process.communicate(timeout=30) == (None, b"")
        assert process.returncode == 3

    def test_a_reader_that_is_killed(self, net: Net, reader: Tool):
        """The writer names a killed reader, and writes to the others."""
        victim = net.opened("/victim", "read", "/victim")
        writer = net.opened("/writer", "write", "/writer", "/victim", "fast_tcp://reader")
        writer.type("before")
        victim.until_printed("before")
        victim.process.kill()
        victim.process.wait()

        def noticed() -> bool:
            writer.type("after")
            return "/victim" in writer.stderr

        writer.until(noticed, "a word about the reader")
        writer.type("last")
        reader.until_printed("last")
        assert writer.wait() == 0
        assert "Traceback" not in writer.stderr
        assert net.run("clean", "--timeout", "5").stdout.count("removing port /victim") == 1

    def test_a_writer_that_is_killed(self, net: Net, reader: Tool):
        """After its writer is killed, the reader gets the messages of the next one."""
        writer = net.opened("/writer", "write", "/writer", "/reader")
        writer.type("first")
        reader.until_printed("first")
        writer.process.kill()
        writer.process.wait()
        assert net.run("write", "/writer", "/reader", lines=("second",)).process.returncode == 0
        reader.until_printed("second")

    def test_without_a_name_server(self, net: Net, tmp_path: Path):
        """Without a name server every tool ends with 1, and a hint how to start one."""
        (tmp_path / "yarp.conf").write_text("127.0.0.1 1 yarp\n")
        for words in (["list"], ["read", "/r"], ["name", "list"], ["where"]):
            done = net.run(*words, YARP_CONFIG_HOME=str(tmp_path))
            assert done.process.returncode == 1
            assert "rtf nameserver" in done.stderr
            assert "Traceback" not in done.stderr


class TestAsking:
    """``rtf rpc``, ``rtf rpcserver`` and ``rtf admin rpc``."""

    def test_answers_are_printed_as_yarp_prints_them(self, net: Net):
        """``rtf rpc`` prints replies as in a recording; a list of lines begins with ``Responses:``."""
        recorded = (DATA / "tools_rpc.console.txt").read_text(encoding="utf-8")
        many = "[many] " + " ".join(f'"{line.strip()}"' for line in recorded.splitlines()[1:10])
        doc = (
            '[many] "bool yarprobotinterfaceRpc::is_ready()" "Returns true if yarprobotinterface is ready'
            r' (all startup actions\nperformed and no interrupt called)."'
        )
        server = net.opened("/oracle", "rpcserver", "/oracle")
        server.type(many, "run", "0", "icubSim", "[ok]", doc, "[fail]")
        questions = ("help", "get_phase", "get_level", "get_robot", "is_ready", "help is_ready", "bogus")
        asked = net.run("rpc", "/oracle", lines=questions)
        assert asked.process.returncode == 0, asked.stderr
        assert asked.stdout == recorded
        assert server.stdout == "".join(f"Message: {question}\n" for question in questions)
        assert server.end() == 0
        assert server.stderr == ""

    def test_one_question_on_the_command_line(self, net: Net, reader: Tool):
        """A request on the command line is sent, and the input is not read."""
        assert net.run("admin", "rpc", "/reader", "[ver]").stdout == "Response: [ver] 1 2 3\n"
        inputs = net.run("admin", "/reader", "[list]", "[in]").stdout.split()
        assert inputs[:2] == ["Response:", "anon_rpc"]
        assert inputs[2:] in ([], ["admin"])  # the connection that asked for the dialect may just be ending

    def test_a_server_without_answers_left(self, net: Net):
        """A server whose input ends closes, and the client reports the missing reply."""
        server = net.opened("/oracle", "rpcserver", "/oracle")
        asking = net.start("rpc", "/oracle", "why")
        server.until_printed("Message: why")
        assert server.wait() == 0
        assert asking.wait() == 1
        assert "/oracle did not answer 'why'" in asking.stderr

    def test_an_answer_that_takes_too_long(self, net: Net):
        """A request fails after its timeout."""
        server = net.opened("/oracle", "rpcserver", "/oracle")
        asking = net.run("rpc", "/oracle", "why", "--timeout", "100ms")
        assert asking.process.returncode == 1
        assert server.end(signal.SIGTERM) == 0

    def test_ctrl_c_while_it_waits(self, net: Net):
        """Ctrl-C ends the wait for a reply without a message."""
        server = net.opened("/oracle", "rpcserver", "/oracle")
        asking = net.start("rpc", "/oracle", "why")
        server.until_printed("Message: why")
        assert asking.end() == 2
        assert asking.stderr == ""
        assert server.end() == 0


def test_no_caller_waits_for_an_answer_that_is_none(monkeypatch: pytest.MonkeyPatch):
    """It has no reply, as the server ends with what was typed in its place."""
    monkeypatch.setattr(rpc, "typed", lambda _: iter(["(" * 200]))
    desk = rpc._Desk()

    def ask() -> None:
        with pytest.raises(PortClosedError, match="no more answers are given here"):
            desk.bring(Bottle(["why"]))

    caller = threading.Thread(target=ask, daemon=True)
    caller.start()
    with rpc.ENDING, pytest.raises(BottleError):
        desk.serve()
    desk.close()
    caller.join(10.0)
    assert not caller.is_alive()


def _send(net: Net, name: str, text: str) -> None:
    """Send a text to a port, as a person with telnet does."""
    contact = net.names.query(name)
    assert contact is not None
    with socket.create_connection((contact.host, contact.port), 10) as connection:
        connection.sendall(text.encode())
        connection.recv(100)


class TestInterfaceFiles:
    """Calls and messages that an interface file describes."""

    def test_calls_are_checked_and_messages_have_names(self, net: Net, tmp_path: Path):
        """A wrong call is not sent; results and messages are shown by their types."""
        file = tmp_path / "adder.thrift"
        file.write_text(
            "struct Place { 1: double x, 2: string name }\nservice Adder { double add(1: double a); Place place() }"
        )
        place, network = idl.load(file).Place(1.5, "here"), Network(net.names)
        functions = {"add": Function(lambda a: a + 1), "place": Function(lambda: (1.5, "here"))}
        with RpcServer("/adder", Service(functions).answer, network=network) as server:
            words = ("rpc", "--idl", str(file), server.name)
            assert net.run(*words, "add", "2").stdout == "3.0\n"
            assert net.run(*words, "place").stdout == "Place(x=1.5, name='here')\n"
            wrong = net.run(*words, "ad", "2")
            assert (wrong.process.returncode, "there is no function ad; did you mean add?" in wrong.stderr) == (1, True)
            wrong = net.run(*words, "add", "two")
            assert "'two' is not of the type double; the call is double add(double a)" in wrong.stderr
        reader = net.opened("/reader", "read", "/reader", "once", "--idl", f"{file}:Place")
        with Port("/writer", network=network, inputs=False) as writer:
            writer.add_output("/reader")
            assert writer.write(place) == 1
        reader.until_printed("Place(x=1.5, name='here')")
        assert reader.wait() == 0
