"""A node at work: programs of all kinds, and those who ask for what cannot be done."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf import clock
from rtf.applications.run.access import RunAccess
from rtf.applications.run.client import RunClient
from rtf.applications.run.errors import NodeError, RunError
from rtf.applications.run.output import WAITING
from rtf.applications.run.protocol import Ask, Ending, Start
from rtf.applications.run.server import MAX_REQUEST, RunServer
from rtf.bottle import Bottle
from rtf.errors import RtfError
from rtf.logs.collector import Collector
from rtf.logs.record import Level
from rtf.logs.store import LogReader, LogStore
from rtf.middleware.errors import NameServerError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from waiting import alive, eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conftest import Node

HANGING = (
    "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); time.sleep(60)"
)


texts = st.text(max_size=10)
words = st.sampled_from(["cmd", "as", "on", "kill", "ps", "env", "log", "stdio", "workdir", "hold", "exit", "/quiet"])
values = st.recursive(st.integers() | st.floats() | texts | words, lambda inner: st.lists(inner, max_size=4))


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunServer]:
    """A node that may start the programs of an empty folder."""
    access = RunAccess.parse(programs=[str(tmp_path_factory.mktemp("empty"))])
    with RunServer("/quiet", network=Network(LocalNames()), access=access) as server:
        yield server


def script(folder: Path, text: str) -> str:
    """A file with a program; returns its path."""
    path = folder / "program"
    path.write_text(f"#!{sys.executable}\n{text}\n")
    path.chmod(0o755)
    return str(path)


def start(node: Node, tag: str, command: str, **more: object) -> int:
    """Start a program; returns its process."""
    reply = node.client.start(Start(tag, command, **more))  # type: ignore[arg-type]
    assert reply.pid > 0, reply.text
    return reply.pid


class TestPrograms:
    """How programs are started and end."""

    def test_end_is_reported_with_the_last_lines(self, node: Node):
        """Also those of the error output."""
        start(node, "t", 'sh -c "echo one; echo two >&2; exit 3"')
        assert node.said_of("t").partition("ended: ")[2] == "exit status 3\n  one\n  two"

    def test_end_can_be_asked_for(self, node: Node):
        """How the last program of a tag has ended, with its last lines; nothing of one that never ran."""
        pid = start(node, "t", 'sh -c "echo one; exit 3"')
        node.said_of("t")
        assert node.client.ending("t") == Ending(pid, "exit status 3", ("one",))
        assert node.client.ending("never") is None

    def test_folder_and_environment(self, node: Node, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
        """A program of the folder comes before one of PATH; variables are set, changed and removed; no shell reads."""
        monkeypatch.setenv("GONE", "1")
        monkeypatch.setenv("RTF_RUN_HELD", "the mark of a node that has started this one")
        program = tmp_path / "ls"
        program.write_text('#!/bin/sh\necho "$PWD|$A|$GONE$RTF_RUN_HELD|$YARP_IS_YARPRUN|$1"\n')
        program.chmod(0o755)
        start(node, "t", "ls $HOME", directory=str(tmp_path), environment="A=x y;GONE")
        assert node.said_of("t").splitlines()[1:] == [f"  {tmp_path}|x y||1|$HOME"]

    @pytest.mark.parametrize(
        ("request_", "reason"),
        [
            (Start("t", "no-such-program"), "because No such file or directory"),
            (Start("t", "/etc/passwd"), "because Permission denied"),
            (Start("t", "ls", directory="/no/folder"), ", cannot set working directory No such file or directory"),
            (Start("t", "ls", directory="/etc/passwd"), ", cannot set working directory Not a directory"),
            (Start("t", " "), "because it has no command"),
            (Start("", "ls"), "because it has no tag"),
            (Start("t", "ls " * 129), "because it has 129 words, and 128 are the most"),
        ],
    )
    def test_what_cannot_be_started(self, node: Node, request_: Start, reason: str):
        """The reply names the program and the reason, and so does the node, with who asked."""
        reply = node.client.start(request_)
        assert reply.pid == -1
        shown = f"ABORTED: server=/node1 alias={request_.tag} cmd={request_.command}\nCan't execute command"
        assert reply.text.startswith(shown)
        assert reason in reply.text
        assert node.said[-1].startswith("/tmp/port/1 at 127.0.0.1 cannot start")

    def test_file_that_is_no_program(self, node: Node, tmp_path: Path):
        """The kernel's reason is passed on."""
        path = Path(script(tmp_path, ""))
        path.write_bytes(b"\x00\x01")
        assert "Exec format error" in node.client.start(Start("t", str(path))).text

    def test_several_of_one_tag(self, node: Node):
        """All of them get a signal, as from the original."""
        pids = {start(node, "t", "sleep 60"), start(node, "t", "sleep 61")}
        assert {row.pid for row in node.client.running()} == pids
        assert node.client.terminate("t")
        node.said_of("t")
        assert not any(map(alive, pids))

    def test_program_that_forks_and_exits(self, node: Node):
        """Its tag runs as long as what it left, which gets the signals."""
        start(node, "t", 'sh -c "sleep 60 & echo $!"')
        child = node.server._children.running()[0]
        eventually(lambda: child.leader_ended and child.tail.lines(1), "the shell still runs")
        left = int(child.tail.lines(1)[0])
        assert node.client.is_running("t")
        assert alive(left)
        assert node.client.terminate("t")
        node.said_of("t")
        assert not alive(left)

    def test_program_that_leaves_its_group(self, node: Node):
        """It is found by its mark, and ends with its tag."""
        start(node, "t", 'sh -c "setsid sleep 60 & echo $!; sleep 60"')
        child = node.server._children.running()[0]
        eventually(lambda: child.tail.lines(1), "nothing was printed")
        left = int(child.tail.lines(1)[0])
        node.client.kill("t", 9)
        node.said_of("t")
        assert not alive(left)

    @pytest.mark.parametrize("signum", [0, -1, 65, 1 << 20])
    def test_signal_that_there_is_not(self, node: Node, signum: int):
        """It is refused, and the program runs on."""
        start(node, "t", "sleep 60")
        assert not node.client.kill("t", signum)
        assert node.client.is_running("t")


class TestLimits:
    """What is bounded."""

    def test_number_of_programs(self):
        """One more is refused until one has ended."""
        network = Network(LocalNames())
        with RunServer("/small", network=network, most=1) as server:
            client = RunClient("/small", network=network)
            assert client.start(Start("a", "sleep 60")).pid > 0
            assert "1 programs run already" in client.start(Start("b", "sleep 60")).text
            client.kill("a", 9)
            eventually(lambda: not client.running(), "it still runs")
            assert client.start(Start("b", "true")).pid > 0
        assert server.name == "/small"

    def test_size_of_a_request(self, node: Node):
        """A larger one ends the connection, and that is reported."""
        with pytest.raises(NodeError, match="did not answer"):
            node.client.ask(Ask("which", "x" * MAX_REQUEST))
        assert any(f"at most {MAX_REQUEST} are accepted" in line for line in node.said)

    def test_message_that_asks_for_nothing(self, node: Node):
        """The client is not left waiting, as by the original, and the report says what can be asked for."""
        with pytest.raises(NodeError, match="did not answer"):
            node.client.ask(Ask("dance"))
        assert any("isrunning" in line for line in node.said)

    def test_flood(self, node: Node):
        """Endless output costs bounded memory, and the node answers meanwhile."""
        with BufferedPort("/slow", network=node.network) as logger:
            pid = start(node, "t", "yes", log="/slow")
            child = node.child(pid)
            (sender,) = child.sinks
            eventually(lambda: sender._left_out, "nothing was left out")
            began = clock.monotonic()
            assert node.client.is_running("t")
            assert clock.monotonic() - began < 5.0
            assert sender._size <= WAITING + (1 << 17)
            assert len(child.tail.lines(10**6)) <= 4096
            node.client.kill("t", 9)
            node.said_of("t")
            eventually(lambda: logger.pending, "nothing was logged")

    def test_program_that_does_not_end(self, tmp_path: Path):
        """It is killed after the grace when the node ends, and that is reported."""
        said: list[str] = []
        network = Network(LocalNames())
        with RunServer("/small", network=network, said=said.append, grace=0.2) as server:
            pid = RunClient("/small", network=network).start(Start("deaf", script(tmp_path, HANGING))).pid
            child = server._children.running()[0]
            eventually(lambda: child.tail.lines(1) == ["deaf"], "it did not begin")
        assert not alive(pid)
        assert said[-2:] == ["deaf: did not end within 0.2 s; killed", f"deaf ({pid}) ended: killed by SIGKILL\n  deaf"]

    def test_characters_that_steer_a_terminal(self, node: Node):
        """What others send is said without them."""
        node.client.start(Start("t\x1b[2J", "no-such-program"))
        assert "t?[2J" in node.said[-1]


@given(st.lists(values, max_size=5))
def test_any_message_is_answered_or_refused(quiet: RunServer, message: list[object]):
    """The node raises nothing but the errors that end a connection, and starts nothing that is not allowed."""
    with suppress(RtfError):
        assert quiet.answer(Bottle(message)) is not None
    assert quiet.answer(Bottle([["ps"]])) == Bottle()


class TestAccess:
    """Who is answered."""

    def test_node_that_others_would_reach(self, monkeypatch: pytest.MonkeyPatch):
        """It does not open without a list of addresses."""
        network = Network(LocalNames(host="0.0.0.0"))
        with pytest.raises(RunError, match="--allow"):
            RunServer("/open", network=network)
        assert network.names.query("/open") is None

    def test_peer_that_is_not_listed(self):
        """It is cut off before its request is read."""
        said: list[str] = []
        network = Network(LocalNames(), report=said.append)
        with (
            RunServer("/node", network=network, access=RunAccess.parse(["10.0.0.0/24"])),
            pytest.raises(NodeError, match="did not answer"),
        ):
            RunClient("/node", network=network).start(Start("t", "true"))
        assert any("not among the allowed addresses" in line for line in said)

    def test_program_that_is_not_listed(self):
        """The reply says why, and a listed one is started."""
        network = Network(LocalNames())
        with RunServer("/node", network=network, access=RunAccess.parse(programs=["sleep"])):
            client = RunClient("/node", network=network)
            assert "not among the allowed programs" in client.start(Start("t", "ls")).text
            assert "variable LD_PRELOAD" in client.start(Start("t", "sleep 1", environment="LD_PRELOAD=/x")).text
            assert client.start(Start("t", "sleep 60")).pid > 0

    def test_node_is_listed_among_the_runners(self, node: Node):
        """By the property that the name server's ``runners`` looks for."""
        assert [*node.network.names.get_property("/node1", "yarprun")] == ["true"]


class TestOutput:
    """Where the output of programs goes."""

    def test_lines_go_to_the_logger(self, node: Node):
        """Each with the name of the port before it, as from yarprun, in order, also those before the end."""
        with BufferedPort("/yarplogger", strict=True, network=node.network) as logger:
            pid = start(node, "t", 'sh -c "echo one; echo two >&2; printf three"', log="")
            records = [logger.receive(10) for _ in range(3)]
        name = f"/log/node1/sh/{pid}"
        assert [[*record.value] for record in records] == [
            [f"[{name}]", f"{text}\n"] for text in ("one", "two", "three")
        ]
        assert {record.sender for record in records} == {name}

    def test_collector_understands_lines(self, node: Node, tmp_path: Path):
        """Levels and components that a program prints are those of its records, and the port's name says whose."""
        with LogStore(tmp_path / "log") as store, Collector(store, network=node.network) as collector:
            pid = start(node, "t", 'sh -c "echo [WARNING] \\|motor\\| hot; echo plain"', log="")
            eventually(lambda: collector.written == 2, "the records did not arrive")
            with LogReader(tmp_path / "log") as reader:
                records = [record for _, _, record in reader.read()]
        assert {record.sender for record in records} == {f"/log/node1/sh/{pid}"}
        assert [(record.level, record.component, record.message) for record in records] == [
            (Level.WARNING, "motor", "hot"),
            (Level.UNKNOWN, "", "plain"),
        ]

    def test_lines_wait_for_the_logger(self, node: Node, monkeypatch: pytest.MonkeyPatch):
        """A logger that is started later gets them, and that it is missing is reported once."""
        monkeypatch.setattr("rtf.applications.run.output._AGAIN", 0.05)
        start(node, "t", 'sh -c "echo early; exec sleep 60"', log="/later")
        eventually(lambda: any("can be reached" in line for line in node.said), "nothing was said")
        with BufferedPort("/later", strict=True, network=node.network) as logger:
            assert logger.read(10)[1] == "early\n"
        assert sum("can be reached" in line for line in node.said) == 1

    def test_name_server_that_is_away(self, node: Node, monkeypatch: pytest.MonkeyPatch):
        """The port of the output is opened when the name server is back; what was said until then is kept."""
        monkeypatch.setattr("rtf.applications.run.output._AGAIN", 0.05)
        register, away = node.network.names.register, [True]

        def refuse(name: str, **more: object) -> Contact:
            if away and name.startswith("/log/"):
                raise NameServerError("the name server does not answer")
            return register(name, **more)  # type: ignore[arg-type]

        monkeypatch.setattr(node.network.names, "register", refuse)
        with BufferedPort("/yarplogger", strict=True, network=node.network) as logger:
            start(node, "t", 'sh -c "echo early; exec sleep 60"', log="")
            eventually(lambda: any("cannot be opened" in line for line in node.said), "nothing was said")
            away.clear()
            assert logger.read(10)[1] == "early\n"

    def test_node_that_logs_all(self):
        """A request for another logger goes there."""
        network = Network(LocalNames())
        with (
            BufferedPort("/all", strict=True, network=network) as everything,
            BufferedPort("/other", strict=True, network=network) as other,
            RunServer("/node", network=network, log="/all"),
        ):
            client = RunClient("/node", network=network)
            client.start(Start("a", "echo here"))
            client.start(Start("b", "echo there", log="/other"))
            assert everything.read(10)[1] == "here\n"
            assert other.read(10)[1] == "there\n"

    @pytest.mark.usefixtures("no_window")
    def test_streams_of_a_program(self, node: Node):
        """Lines that are sent to its input come back from its output, once somebody reads."""
        reply = node.client.start(Start("io", "cat", "/node1", stdio="/node1"))
        uuid = str(reply.terminal[0])
        with (
            Port("/keys", network=node.network) as keys,
            BufferedPort("/screen", network=node.network, strict=True) as screen,
        ):
            keys.add_output(f"{uuid}/stdin")
            keys.write(Bottle(["hello\n"]))
            keys.write(Bottle([1, "two"]))
            output = next(one for one in node.child(reply.pid).sinks if one.name == f"{uuid}/stdout")
            eventually(lambda: len(output._lines) == 2, "the lines did not come back")
            source = node.network.names.query(output.name)
            assert source is not None
            remote.connect(node.network, source, Contact("/screen"))
            assert [[*screen.read(10)] for _ in range(2)] == [["hello\n"], ["1 two\n"]]


def test_five_starts_from_five_clients(node: Node):
    """Requests of different clients are served at the same time, and none is lost."""
    with ThreadPoolExecutor(5) as pool:
        pids = [*pool.map(lambda number: start(node, f"t{number}", "sleep 60"), range(10))]
    assert sorted(row.pid for row in node.client.running()) == sorted(pids)
    node.client.terminate_all()
    eventually(lambda: not node.client.running(), "a program still runs")


#: A node that is asked to end before its keeper has begun to wait.
KEPT = """
import os, signal, time
from rtf.applications.run import keeper

def asked_to_end():
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])  # so that it comes when the keeper waits
    signal.raise_signal(signal.SIGTERM)

keeper.processes.adopt_orphans = asked_to_end
status = keeper.fork_server(1.0)
if status is None:
    time.sleep(60)
os._exit(10 + status)
"""


def test_keeper_that_gets_a_signal_at_once():
    """A signal that is there when the keeper begins to wait is passed on, and the node ends by it."""
    assert subprocess.run([sys.executable, "-c", KEPT], timeout=10, check=False).returncode == 11
