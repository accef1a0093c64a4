"""``rtf app`` as a user calls it: applications of real programs, whose manager is stopped, killed and restarted."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from lab import module, needs, shell
from rtf.cli.command_tree import RTF, main
from rtf.testing.isolation.processes import children_of
from waiting import alive, eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Net, Tool

CONNECTION = "<connection><from>/app/source</from><to>/app/sink</to></connection>"


@pytest.fixture
def app(net: Net, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable:
    """Run ``rtf app`` in this process; returns its exit code and what it printed."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(net.config))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setitem(net.environment, "XDG_STATE_HOME", str(tmp_path / "state"))

    def run(*words: str) -> tuple[int, str]:
        capfd.readouterr()
        try:
            code = main(RTF, ["app", *words])
        except SystemExit as error:
            code = int(error.code or 0)
        return code, "".join(capfd.readouterr())

    return run


def write(folder: Path, content: str) -> str:
    """Write an application; returns its file."""
    path = folder / "lab.xml"
    path.write_text(f"<application><name>lab</name>{content}</application>")
    return str(path)


def pair(folder: Path) -> str:
    """Write an application of a program here and one on a node."""
    return write(folder, module("sleep", "60") + module("sleep", "61", node="node1"))


def manager(folder: Path) -> int:
    """Return the process of the manager that runs the application; 0 without one."""
    files = [*(folder / "state" / "rtf" / "apps").glob("*.json")]
    return int(files[0].read_text() or 0) if files else 0


def up(net: Net, file: str, *words: str) -> Tool:
    """Start an application, and wait until it is up."""
    tool = net.start("app", "run", file, *words)
    tool.until(lambda: "is up" in tool.stdout or tool.process.poll() is not None, "the application")
    assert "lab is up" in tool.stdout, tool.stderr
    return tool


@pytest.fixture
def node(net: Net) -> Tool:
    """A node as a process."""
    tool = net.start("run", "--server", "/node1", "--grace", "2")
    tool.until(lambda: "is available" in tool.stdout, "the node")
    return tool


def pids(status: str) -> list[int]:
    """Return the processes in the status of an application."""
    return [int(line.rpartition("(")[2].rstrip(")")) for line in status.splitlines() if line.endswith(")")]


def test_checked_shown_and_listed(tmp_path: Path, app: Callable):
    """Without a manager: the exit codes and the form of messages are those of ``testrunner validate``."""
    file = write(tmp_path, module("sleep", "${time}") + "<modul/>")
    code, said = app("check", file, "--offline")
    assert code == 4
    assert f"{file}:1:" in said
    assert "error: there is no variable 'time' (write <var name=\"time\">…</var>)" in said
    assert "1 module, 0 connections: 1 error, 1 warning" in said
    code, said = app("check", file, "--offline", "--var", "time=60")
    assert (code, said.splitlines()[0]) == (0, "1 module, 0 connections: 0 errors, 1 warning")
    assert app("check", file, "--offline", "--var", "time=60", "--strict")[0] == 4
    assert app("run", file)[0] == 4
    code, said = app("show", file, "--var", "time=60")
    assert "module sleep 60  [localhost]" in said
    code, said = app("show", file, "--var", "time=60", "--xml")
    assert "<parameters>${time}</parameters>" in said
    assert app("list", str(tmp_path)) == (0, f"lab  {file}\n")
    assert app("list", str(tmp_path / "state"))[0] == 1


def test_run_and_status_until_an_interrupt(net: Net, node: Tool, tmp_path: Path, app: Callable):
    """An application is up, other processes learn so, a second manager is refused; Ctrl-C stops all in reverse."""
    reader = module(sys.executable, "-m rtf read /app/sink") + module("sleep", "60", needs("/app/sink"), node="node1")
    file = write(tmp_path, reader)
    tool = up(net, file)
    code, said = app("status", file)
    assert code == 0
    running = pids(said)
    assert [alive(pid) for pid in running] == [True] * 2
    second = net.start("app", "run", file)
    assert second.wait() == 1
    assert f"the application is run by process {manager(tmp_path)}; 'rtf app stop' stops it" in second.stderr
    assert tool.end(signal.SIGINT) == 0
    assert "sleep 60 on node1 is stopped" in tool.stdout
    assert not any(map(alive, running))
    assert manager(tmp_path) == 0
    assert app("status", file)[0] == 1
    node.end()


def test_nothing_is_left_when_the_manager_is_killed(net: Net, node: Tool, tmp_path: Path, app: Callable):
    """Its keeper stops all, on nodes, too, and says so."""
    file = pair(tmp_path)
    tool = up(net, file)
    running = pids(app("status", file)[1])
    assert len(running) == 2
    os.kill(manager(tmp_path), signal.SIGKILL)
    assert tool.wait() == 1
    assert "the manager of lab was killed; what it has left is stopped" in tool.stderr
    assert not any(map(alive, running))
    assert manager(tmp_path) == 0
    node.end()


def test_modules_left_by_a_manager_and_its_keeper_are_found(net: Net, node: Tool, tmp_path: Path, app: Callable):
    """The next manager finds those on a node by their tags, and ends those here; ``stop`` stops it and them."""
    file = pair(tmp_path)
    tool = up(net, file)
    running = pids(app("status", file)[1])
    tool.process.send_signal(signal.SIGSTOP)
    os.kill(manager(tmp_path), signal.SIGKILL)
    tool.process.kill()
    tool.wait()
    again = up(net, file)
    assert f"sleep 61 on node1 runs already ({running[1]})" in again.stdout
    assert "which a node before has left" in again.stdout
    assert [alive(pid) for pid in running] == [False, True]
    assert app("stop", file)[0] == 0
    assert again.wait() == 0
    assert not alive(running[1])
    node.end()


def test_detached_application_outlives_its_manager(net: Net, tmp_path: Path, app: Callable):
    """Its modules are found again by their tags, asked after, and killed; an interrupted start leaves nothing."""
    file = write(tmp_path, module("sleep", "61") + shell(tmp_path, "one", "trap '' TERM; while :; do sleep 0.1; done"))
    tool = net.start("app", "run", file, "--detach")
    assert tool.wait() == 0
    assert "lab runs on; 'rtf app stop" in tool.stdout
    assert children_of(tool.process.pid) == []
    code, said = app("status", file)
    assert code == 0, said
    running = pids(said)
    assert [alive(pid) for pid in running] == [True, True]
    code, said = app("kill", file)
    assert (code, said.count("is killed")) == (0, 2), said
    eventually(lambda: not any(map(alive, running)), "a module is left")
    waiting = write(tmp_path, module("sleep", "62") + module("sleep", "63", needs("/app/never")))
    tool = net.start("app", "run", waiting, "--detach")
    tool.until(lambda: "waits" in tool.stdout and "is started" in tool.stdout, "the start")
    assert tool.end(signal.SIGINT) == 1
    assert "sleep 62 is stopped" in tool.stdout


def test_start_that_fails_leaves_nothing(net: Net, tmp_path: Path, app: Callable):
    """What was up is stopped again, and the exit code is 1."""
    file = write(
        tmp_path,
        module("sleep", "62")
        + shell(tmp_path, "broken", "echo no robot; sleep 0.3; exit 3", "<ensure><wait>5</wait></ensure>"),
    )
    tool = net.run("app", "run", file)
    assert tool.process.returncode == 1
    assert "[ERROR] sh broken.sh ended: exit status 3\n    no robot" in tool.stderr
    assert "sleep 62 is stopped" in tool.stdout
    assert "lab is up" not in tool.stdout


def test_connections_are_made_and_ended(net: Net, tmp_path: Path, app: Callable):
    """Also without running the application."""
    file = write(tmp_path, CONNECTION)
    sink = net.opened("/app/sink", "read", "/app/sink")
    assert app("connect", file) == (
        1,
        "[ERROR] /app/source -> /app/sink is not connected: /app/source is not open\n",
    )
    source = net.opened("/app/source", "write", "/app/source")
    assert app("connect", file) == (0, "/app/source -> /app/sink is connected by tcp\n")
    source.type("hello")
    sink.until_printed("hello")
    assert app("status", file) == (0, "connected    /app/source -> /app/sink\n")
    assert app("disconnect", file) == (0, "/app/source -> /app/sink is disconnected\n")
    source.end()
    sink.end()
