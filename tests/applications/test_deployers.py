"""Deployers: what each of them promises, on this machine, on a node, and on a machine that is reached by ssh."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import asyncssh
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ssh_server import SshServer

from lab import application, lab, shell
from rtf.applications.deployer import Deployer, DeployerContext
from rtf.applications.deployers import LocalDeployer, NodeDeployer, find_deployer
from rtf.applications.errors import DeployerError
from rtf.applications.events import Kind, State
from rtf.applications.run.errors import StartError
from rtf.applications.run.protocol import Start, join_words
from rtf.applications.run.server import RunServer
from rtf.applications.ssh.connection import SshConnection
from rtf.applications.ssh.deployer import SshDeployer
from rtf.applications.ssh.scripts import list_script, read_list, start_script
from rtf.applications.xml.model import Module, Text
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from waiting import alive, eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Iterator
    from concurrent.futures import Future

SSH = "<deployer>ssh</deployer>"
#: What a shell would expand, and what ends a quoted word.
HOSTILE = ["$HOME", "*", "a  b", "'", "`id`", "$(id)", "\\", "; exit 7", "~", "&", "é", "-n", "{1,2}", "# no"]


class DeployerContract:
    """What every deployer does. Subclasses make one, with a network, at a place that is this machine."""

    @pytest.fixture
    def network(self) -> Network:
        """The network of the deployer."""
        return Network(LocalNames())

    @pytest.fixture
    def deployer(self, network: Network) -> Iterator[Deployer]:
        """A deployer; afterwards nothing of it runs."""
        raise NotImplementedError

    def test_started_program_runs_until_it_is_asked_to_end(self, deployer: Deployer):
        """It is listed by its tag, gets the signal, and is asked no more when it has ended."""
        pid = deployer.start(Start("/a tag's:0", "sleep 60"))
        assert deployer.running()["/a tag's:0"] == pid
        assert not deployer.signal("/a", signal.SIGTERM)
        assert deployer.signal("/a tag's:0", signal.SIGTERM)
        eventually(lambda: not deployer.running(), "it still runs")
        assert not deployer.signal("/a tag's:0", signal.SIGTERM)
        ending = deployer.ending("/a tag's:0")
        assert ending is not None
        assert (ending.pid, ending.how, ending.lines) == (pid, "killed by SIGTERM", ())

    def test_words_and_variables_come_as_they_are(self, deployer: Deployer, tmp_path: Path):
        """Nothing is expanded, neither in words nor in variables nor in the name of the folder."""
        folder = tmp_path / "it's $HOME"
        folder.mkdir()
        script = folder / "show"
        script.write_text('#!/bin/sh\nprintf "%s\\n" "$@" "$A" "${REMOVED-none}" "$PWD" > out\nmv out done\n')
        script.chmod(0o755)
        value = "$HOME '*' `id` \\"
        environment = f"REMOVED=1;REMOVED;A={value}"
        deployer.start(Start("show", join_words(["show", *HOSTILE]), directory=str(folder), environment=environment))
        eventually((folder / "done").exists, "it has written nothing")
        assert (folder / "done").read_text().splitlines() == [*HOSTILE, value, "none", str(folder)]

    def test_program_that_cannot_be_started(self, deployer: Deployer, tmp_path: Path):
        """The error names the program, the place, and the reason."""
        place = deployer.place
        for request, reason in (
            (Start("one", "no_such_program"), "No such file or directory"),
            (Start("one", "sleep 1", directory=str(tmp_path / "none")), "set working directory No such file"),
            (Start("one", " "), "it has no command"),
        ):
            with pytest.raises(DeployerError, match=f"cannot be started on {place}: .*{reason}"):
                deployer.start(request)
        assert deployer.running() == {}

    def test_output_and_status_are_kept(self, deployer: Deployer):
        """The last lines are there while it runs and afterwards, with both streams, and so is its exit status."""
        deployer.start(Start("one", 'sh -c "echo out; echo err >&2; read -r line; echo $line; sleep 60"'))
        eventually(lambda: [*deployer.output("one")] == ["out", "err", ""], "its output does not come")
        deployer.signal("one", signal.SIGKILL)
        deployer.start(Start("two", 'sh -c "echo no camera; exit 3"'))
        eventually(lambda: not deployer.running(), "they still run")
        endings = [deployer.ending(tag) for tag in ("one", "two", "three")]
        assert [one and (one.how, one.lines[-1]) for one in endings] == [
            ("killed by SIGKILL", ""),
            ("exit status 3", "no camera"),
            None,
        ]

    def test_signals_reach_all_processes(self, deployer: Deployer, tmp_path: Path):
        """A tag runs as long as any process of it does: children of one that has ended, and in another session, too."""
        (tmp_path / "fork.sh").write_text("sleep 60 & setsid sleep 61 & echo $$ $! > pids; mv pids done\n")
        deployer.start(Start("one", "sh fork.sh", directory=str(tmp_path)))
        eventually((tmp_path / "done").exists, "it has not begun")
        leader, child = map(int, (tmp_path / "done").read_text().split())
        eventually(lambda: not alive(leader), "it has not ended")
        assert [*deployer.running()] == ["one"]
        assert deployer.signal("one", signal.SIGKILL)
        eventually(lambda: not deployer.running(), "it still runs")
        assert not alive(child)

    def test_a_signal_comes_once(self, deployer: Deployer, tmp_path: Path):
        """A program that counts signals counts one."""
        (tmp_path / "count.py").write_text(
            "import os, signal\n"
            "signal.signal(signal.SIGTERM, lambda *_: os.write(1, b'term\\n'))\n"
            "os.write(1, b'ready\\n')\n"
            "signal.pause(); signal.pause()\n"
        )
        deployer.start(Start("one", join_words([sys.executable, str(tmp_path / "count.py")])))
        eventually(lambda: deployer.output("one"), "it is not ready")
        for most in (2, 3):
            assert deployer.signal("one", signal.SIGTERM)
            eventually(lambda: len(deployer.output("one")) >= most, "it got no signal")  # noqa: B023 - at once
        assert [*deployer.output("one")] == ["ready", "term", "term"]

    def test_lines_go_to_the_logger(self, deployer: Deployer, network: Network):
        """A program that is started with the port of a logger is logged from a port of its own."""
        with BufferedPort("/logger", strict=True, network=network) as logger:
            pid = deployer.start(Start("one", 'sh -c "echo hello; echo $YARPRUN_IS_FORWARDING_LOG"', log="/logger"))
            received = [logger.read(10.0) or [] for _ in range(2)]
        (sender, line), (_, forwarded) = received
        assert sender.endswith(f"/sh/{pid}]")
        assert (line, forwarded) == ("hello\n", "1\n")

    def test_figures_of_the_machine(self, deployer: Deployer):
        """Memory, processors and loads are measured."""
        figures = deployer.figures()
        assert figures is not None
        assert figures.siblings == os.cpu_count()
        assert 0 < figures.memory_free <= figures.memory_total
        assert figures.load_1 >= 0.0
        assert figures.architecture == os.uname().machine


class TestLocalDeployer(DeployerContract):
    """On this machine."""

    @pytest.fixture
    def deployer(self, network: Network) -> Iterator[Deployer]:
        """Its own node."""
        made = LocalDeployer("localhost", DeployerContext(network, network, "/app/lab"))
        yield made
        made.close()


class FoundAgainContract(DeployerContract):
    """What deployers of other machines do in addition."""

    def test_program_is_found_again_by_another_deployer(self, deployer: Deployer):
        """As after the manager was killed: it is listed with its number, and can be ended. Programs are looked up."""
        pid = deployer.start(Start("one", "sleep 60"))
        other = type(deployer)(deployer.place, deployer.context)
        try:
            assert other.running() == {"one": pid}
            assert other.ending("one") is None
            assert other.signal("one", signal.SIGTERM)
            eventually(lambda: not other.running(), "it still runs")
            assert other.which("sleep") == shutil.which("sleep")
            assert other.which("no_such_program") == ""
        finally:
            other.close()


class TestNodeDeployer(FoundAgainContract):
    """On a node."""

    @pytest.fixture
    def deployer(self, network: Network) -> Iterator[Deployer]:
        """A node in this process."""
        with RunServer("/node1", network=network):
            yield NodeDeployer("node1", DeployerContext(network, network, "/app/lab"))


# By ssh ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SshServer]:
    """An ssh server, and a home with the keys to it."""
    home = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(home))
        patch.delenv("SSH_AUTH_SOCK", raising=False)
        made = SshServer(home)
        yield made
        made.close()


@pytest.fixture
def ssh(server: SshServer) -> Iterator[SshDeployer]:
    """A deployer of that server; afterwards nothing runs there."""
    network = Network(LocalNames())
    yield from deployer_of(network)


def deployer_of(network: Network) -> Iterator[SshDeployer]:
    """Make a deployer, and end what runs afterwards."""
    made = SshDeployer("pc104", DeployerContext(network, network, "/app/lab"))
    yield made
    for tag in made.running():
        made.signal(tag, signal.SIGKILL)
    eventually(lambda: not made.running(), "a program is left")
    made.close()


class TestSshDeployer(FoundAgainContract):
    """On a machine that is reached by ssh."""

    @pytest.fixture
    def deployer(self, network: Network, server: SshServer) -> Iterator[Deployer]:
        """A deployer of the server."""
        yield from deployer_of(network)

    def test_variables_have_names(self, deployer: Deployer):
        """A name that would be more than a name is refused."""
        with pytest.raises(DeployerError, match="'A B' cannot be the name of a variable"):
            deployer.start(Start("one", "sleep 1", environment="A B=1"))
        with pytest.raises(DeployerError, match="is not the name of a machine"):
            SshDeployer("-oProxyCommand=id", deployer.context)


def test_connection_that_is_lost(server: SshServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The state of its modules is unknown until it is there again; they run on, though nobody reads their output."""
    monkeypatch.setattr("rtf.applications.ssh.lines._AGAIN", 0.1)
    content = shell(tmp_path, "talk", "while echo x; do sleep 0.05; done; touch heard", SSH, node="pc104")
    with lab(application(tmp_path, content)) as run:
        assert run.manager.start()
        eventually(lambda: run.manager.units[0].place.output(run.manager.units[0].module.tag), "it says nothing")
        server.cut()

        def watched(state: State) -> bool:
            run.manager.watch_once()
            return run.states() == [state]

        eventually(lambda: watched(State.UNKNOWN), "the loss is not noticed")
        server.open()
        eventually(lambda: watched(State.RUNNING), "it is not found again")
        assert run.texts(Kind.BACK) == ["pc104 answers again"]
        assert "pc104 is not watched: " in run.texts(Kind.LOST)[0]
        assert run.manager.stop()
        assert run.texts(Kind.STOPPED) == ["sh talk.sh on pc104 is stopped"]
    assert not (tmp_path / "heard").exists()


def test_many_programs_need_several_connections(server: SshServer, ssh: SshDeployer, monkeypatch: pytest.MonkeyPatch):
    """A server allows a number of sessions for each, and what asks has one of its own."""
    monkeypatch.setattr("rtf.applications.ssh.lines.SESSIONS", 2)
    before = server.connections
    for number in range(5):
        ssh.start(Start(f"t{number}", "sleep 60"))
    assert len(ssh.running()) == 5
    assert server.connections == before + 4


def refusal() -> str:
    """The error of a new connection."""
    network = Network(LocalNames())
    deployer = SshDeployer("pc104", DeployerContext(network, network, "/app/lab"))
    try:
        with pytest.raises(DeployerError) as caught:
            deployer.running()
    finally:
        deployer.close()
    return str(caught.value)


def test_machine_with_another_key_is_refused(server: SshServer):
    """So is an unknown one, and a configuration that would not look at keys. The message says what to do."""
    server.write_known_hosts(asyncssh.generate_private_key("ssh-ed25519"))
    try:
        assert "the key of pc104 is not the one in known_hosts" in refusal()
        assert "accept it once with 'ssh pc104'" in refusal()
        (server.files / "known_hosts").write_text("")
        assert "the key of pc104 is not the one in known_hosts, or there is none" in refusal()
        server.write_config("none")
        assert "as its key would not be checked" in refusal()
    finally:
        server.write_known_hosts()
        server.write_config()


def test_error_without_a_key_names_the_agent(server: SshServer):
    """A key that the machine does not accept, and a machine that does not answer."""
    keep = (server.files / "id_ed25519").read_bytes()
    asyncssh.generate_private_key("ssh-ed25519").write_private_key(server.files / "id_ed25519")
    try:
        assert "does not let" in refusal()
        assert "ssh-add" in refusal()
    finally:
        (server.files / "id_ed25519").write_bytes(keep)
    server.cut()
    try:
        assert refusal().startswith("pc104 cannot be reached by ssh: ")
    finally:
        server.open()


def error_of(asking: Callable[[], object]) -> Callable[[], str]:
    """Ask in a thread of its own. Returns a function that waits for the error of that, and returns its text."""
    reported: list[str] = []

    def ask() -> None:
        with pytest.raises(DeployerError) as caught:
            asking()
        reported.append(str(caught.value))

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()

    def text() -> str:
        thread.join(5.0)
        assert not thread.is_alive()
        return reported[0]

    return text


def test_requests_end_with_the_connection(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """One that waits for a machine that says nothing, and one that comes later."""
    (tmp_path / ".ssh").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path))
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        (tmp_path / ".ssh" / "config").write_text(f"Host pc104\n  HostName 127.0.0.1\n  Port {port}\n")
        connection = SshConnection("pc104")
        error = error_of(lambda: connection.run(str))
        with silent.accept()[0]:
            connection.close()
            assert error() == "the connection to pc104 was closed"
    with pytest.raises(DeployerError, match="the connection to pc104 was closed"):
        connection.run(str)
    connection.close()


def test_connection_that_is_closed_when_a_request_begins(monkeypatch: pytest.MonkeyPatch):
    """The request fails as one that was under way."""
    connection, submit = SshConnection("pc104"), asyncio.run_coroutine_threadsafe
    closing = threading.Thread(target=connection.close)

    def closed_meanwhile(work: Coroutine[None, None, object], loop: asyncio.AbstractEventLoop) -> Future[object]:
        if not closing.ident:
            closing.start()
            closing.join(0.3)  # unless it waits for the request
        return submit(work, loop)

    monkeypatch.setattr(asyncio, "run_coroutine_threadsafe", closed_meanwhile)
    assert error_of(lambda: connection.run(str))() == "the connection to pc104 was closed"
    closing.join()


WORD = st.text(st.characters(codec="utf-8", exclude_characters='\0"\n'), min_size=1).filter(lambda one: " " not in one)


@given(words=st.lists(WORD | st.sampled_from(HOSTILE), min_size=1, max_size=6), value=WORD)
@settings(max_examples=20, deadline=None)
def test_words_survive_the_shell(words: list[str], value: str):
    """Whatever a word has in it comes to the program as it is, through a real shell."""
    shown = 'printf "%s\\0" "$A" "$@"'
    value = value.replace(";", ":")
    request = Start("one", join_words(["sh", "-c", "SHOW", "sh", *words]), environment=f"A={value}")
    script = start_script(request, "TOKEN").replace("SHOW", quote(shown))
    done = subprocess.run(["sh", "-s"], input=script.encode(), capture_output=True, check=True)
    assert done.stdout.decode() == "TOKEN\n" + "".join(f"{one}\0" for one in (value, *words))
    assert b"TOKEN ended 0" in done.stderr


def test_lists_are_read_whatever_is_in_them():
    """A line of a login file, a tag with strange characters, and several processes of a tag."""
    rows = [
        b"/proc/12/environ:RTF_RUN_SSH=a:b=c",
        b"/proc/7/environ:RTF_RUN_SSH=a:b=c",
        b"/proc/9/environ:RTF_RUN_SSH=\xff",
    ]
    assert read_list(b"\0".join([*rows, b"", b"grep: no", b"/proc/x/environ:RTF_RUN_SSH=no"])) == {
        "a:b=c": 7,
        "\udcff": 9,
    }
    assert list_script("TOKEN").startswith("echo TOKEN\n")


@given(st.binary(max_size=200))
def test_lists_of_others_do_no_harm(output: bytes):
    """Anything else is no list."""
    assert all(pid < 1 << 40 for pid in read_list(output).values())


def test_scripts_refuse_what_is_no_start():
    """A command without words, and a program without a tag."""
    for request in (Start("", "sleep 1"), Start("one", "")):
        with pytest.raises(StartError):
            start_script(request, "TOKEN")


def test_missing_package_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """The error has the line that installs it."""
    monkeypatch.delitem(sys.modules, "rtf.applications.ssh.deployer")
    monkeypatch.delitem(sys.modules, "rtf.applications.ssh.connection")
    monkeypatch.delitem(sys.modules, "rtf.applications.ssh.lines")
    monkeypatch.setitem(sys.modules, "asyncssh", None)
    with pytest.raises(DeployerError, match=r"the deployer ssh needs asyncssh: pip install 'rtf\[ssh\]'"):
        find_deployer(Module(Text("sleep"), deployer=Text("ssh")), tmp_path)
