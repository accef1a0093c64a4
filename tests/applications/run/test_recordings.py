"""Conversations of ``yarprun`` and ``yarpmanager`` 3.12.3, replayed in both roles.

Process ids differ, and four answers do on purpose: a program that cannot be started is reported, a message that asks
for nothing ends the connection, no terminal is opened, and the figures of the machine are without its environment.
"""

from __future__ import annotations

import re
import socket
import struct
from typing import TYPE_CHECKING

import pytest

from replaying import VERSIONS, playing, receive, recordings, segments
from rtf.applications.run.client import RunClient
from rtf.applications.run.errors import NodeError
from rtf.applications.run.protocol import Start
from rtf.applications.run.server import RunServer
from rtf.applications.run.sysinfo import SystemInfo
from rtf.bottle import Bottle, Dialect
from rtf.bottle.binary import decode_from, encode
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.wire.contact import Contact
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Node

RECORDED = {name: segments(talk) for name, talk in recordings("3.12.3", "nodes.json").items()}
ACK = b"YA\0\0\0\0RP"
NO_WINDOW = "ABORTED: server=/node2 alias=io cmd=xterm\nCan't execute command because No such file or directory\n"
SM1 = "yarp sample /sm1 --period 0.5"
TAG_SM1, TAG_RD1 = ":node2yarpsample::sm1:--period:0.5A=1;B=20", ":node1yarpread::rd10"

#: What the client does in each conversation, and what comes of it. ``node2`` talks to the second node.
CLIENT: dict[str, tuple[Callable[[RunClient], object], object]] = {
    "start": (lambda node: node.start(Start("s1", "sleep 30")).pid, 15651),
    "start of no program": (lambda node: node.start(Start("bad", "nosuchcmd x")).pid, 15699),
    "ps": (
        lambda node: [(row.tag, row.status, row.command) for row in node.running()],
        [("s1", "running", "sleep 30")],
    ),
    "isrunning": (lambda node: node.is_running("s1"), True),
    "isrunning of none": (lambda node: node.is_running("nothere"), False),
    "which": (lambda node: node.which("ls"), "/usr/bin/ls"),
    "which of none": (lambda node: node.which("nosuchcmd"), "nosuchcmd"),
    "sysinfo": (lambda node: node.system_info().cores, 2),
    "kill": (lambda node: node.kill("s1", 15), True),
    "kill of none": (lambda node: node.kill("nothere", 9), False),
    "sigterm of one that has ended": (lambda node: node.terminate("s2"), False),
    "sigterm of none": (lambda node: node.terminate("nothere"), False),
    "start with log": (lambda node: node.start(Start("l1", "echo hello world", log="")).pid, 15971),
    "start with stdio": (
        lambda node: node.start(Start("io", "cat", "/node1", stdio="/node2", hold=True)).terminal[:2],
        ("/node1/15582/io-0", -1),
    ),
    "terminal": (
        lambda node: node.start(Start("io", "cat", "/node1", "", "", "/node2", True, uuid="/node1/15582/io-0")).pid,
        -1,
    ),
    "ps of none": (lambda node: node.running(), []),
    "sigtermall": (lambda node: node.terminate_all(), None),
    "killstdio": (lambda node: node.close_terminal("io"), None),
    "exit": (lambda node: node.exit(), None),
    "manager start": (lambda node: node.start(Start(TAG_RD1, "yarp read /rd1")).pid, 17900),
    "manager start with environment": (lambda node: node.start(Start(TAG_SM1, SM1, "", "/", "A=1;B=2")).pid, 17970),
}


@pytest.mark.parametrize("name", CLIENT)
def test_client_asks_as_recorded(name: str):
    """Our client in the place of YARP's: it sends the same bytes, and understands the answers of a real node."""
    ask, expected = CLIENT[name]
    network = Network(LocalNames(), dialect=VERSIONS["3.12.3"])
    if name in ("terminal", "killstdio"):  # it was the other node that asked, while a client waited for its answer
        network.names.register("/tmp/port/1")
    with socket.create_server(("127.0.0.1", 0)) as listening, playing(listening, RECORDED[name]) as sent:
        client = RunClient(Contact("/node1", *listening.getsockname(), "tcp"), network=network)
        assert ask(client) == expected
    assert len(sent) == sum(way == ">" for way, _ in RECORDED[name])
    for recorded, got in sent:
        assert got == recorded


def test_node_answers_as_recorded(node: Node):
    """Our node in the place of the first one, from the start of a program to the end of all."""
    assert replay(node, "start") == "STARTED: server=/node1 alias=s1 cmd=sleep 30 pid=…\n"
    assert replay(node, "start with words and a folder") == "STARTED: server=/node1 alias=s2 cmd=sleep pid=…\n"
    assert "missing operand" in node.said_of("s2")
    expected = (
        "ABORTED: server=/node1 alias=bad cmd=nosuchcmd x\nCan't execute command because No such file or directory\n"
    )
    assert answer(node, "start of no program") == encode(Bottle([-1, expected])) + ACK
    for name in ("ps", "isrunning", "isrunning of none", "which", "which of none", "kill"):
        replay(node, name)
    for name in ("sigterm of one that has ended", "sigterm of none", "kill of none", "start with log"):
        replay(node, name)
    node.said_of("l1")
    info, size = SystemInfo.codec.decode_from(got := answer(node, "sysinfo"), Dialect.YARP3)
    assert (got[size:], info.environment) == (ACK, "")
    assert answer(node, "unknown") == b""
    replay(node, "manager isrunning of none")


@pytest.mark.usefixtures("no_window")
def test_program_with_streams(node: Node):
    """It is started, its ports are named, and the terminal is refused, as by the recorded node without one.

    The recorded one gives its reason twice.
    """
    refused = Bottle([-1, NO_WINDOW])
    with RunServer("/node2", network=node.network) as second:
        recorded = bottle(RECORDED["start with stdio"][3][1])
        got = bottle(answer(node, "start with stdio"))
        assert normal(got[:3]) == normal(recorded[:3])
        assert got[3:] == refused
        assert recorded[3:] == Bottle([-1, NO_WINDOW * 2])
        assert replay(node, "ps with stdio")
        assert bottle(answer(second, "terminal")) == refused
        replay(second, "killstdio")
        replay(second, "ps of none")
    replay(node, "sigtermall")
    eventually(lambda: not node.client.running(), "the program still runs")
    replay(node, "ps of none")


def test_node_answers_the_manager_as_recorded(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """A module is started with its environment, asked for, and ended."""
    program = tmp_path / "yarp"
    program.write_text("#!/bin/sh\nexec sleep 30\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    network = Network(LocalNames())
    with RunServer("/node1", network=network) as first, RunServer("/node2", network=network) as second:
        replay(first, "manager start")
        replay(first, "manager isrunning")
        replay(second, "manager start with environment")
        assert [row.environment for row in RunClient("/node2", network=network).running()] == ["A=1;B=2"]
        replay(first, "manager sigterm")


def test_node_ends_as_recorded():
    """The answer arrives although the node ends."""
    ended = []
    network = Network(LocalNames())
    with RunServer("/node2", network=network, on_exit=lambda: ended.append(True)) as server:
        replay(server, "exit")
    assert ended
    with pytest.raises(NodeError, match="no node /node2"):
        RunClient("/node2", network=network).running()


def replay(node: Node | RunServer, name: str) -> str:
    """Ask as recorded; the answer is the recorded one but for process ids. Returns its sentence, or its text."""
    recorded, got = RECORDED[name][3][1], answer(node, name)
    if b"pid" not in recorded:
        assert got == recorded
        return ""
    assert (got[:8], got[-8:]) == (recorded[:8], recorded[-8:])
    found = normal(bottle(got))
    assert found == normal(bottle(recorded))
    return str(found[1] if len(found) > 1 else found[0])


def answer(node: Node | RunServer, name: str) -> bytes:
    """Send what the client sent; what came back to its request, until the end of the connection."""
    server = node if isinstance(node, RunServer) else node.server
    contact = server._port.contact
    (_, head), _, (_, request), *rest = RECORDED[name]
    with socket.create_connection((contact.host, contact.port), timeout=10) as connection:
        connection.sendall(head)
        (number,) = struct.unpack("<i", receive(connection, 8)[2:6])
        assert number == contact.port
        connection.sendall(request)
        sent = [data for way, data in rest if way == ">"]
        if sent:
            connection.sendall(sent[0])
        data = receive(connection, 1 << 20)
    return data.removesuffix(ACK) if sent else data


def bottle(data: bytes) -> Bottle:
    """The bottle at the beginning."""
    return decode_from(data)[0]


def normal(value: object) -> object:
    """The same without process ids."""
    if isinstance(value, Bottle | list):
        items = [normal(item) for item in value]
        return ["pid", "…"] if items[:1] == ["pid"] else items
    if isinstance(value, str):
        return re.sub(r"(pid=|/node\d/)\d+", r"\1…", value)
    return "…" if isinstance(value, int) and value > 0 else value
