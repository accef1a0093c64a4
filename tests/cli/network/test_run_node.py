"""``rtf run --server`` as a process, ``rtf run --on`` in this one, and what is left of a node that is killed."""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest

from rtf.cli.command_tree import RTF, main
from rtf.testing.isolation.processes import children_of
from waiting import alive, eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from conftest import Net, Tool

FAMILY = 'sh -c "sleep 60 & setsid sleep 60 & wait"'


class Said(NamedTuple):
    """What a command printed, and its exit code."""

    code: int
    out: str
    err: str


@pytest.fixture
def ask(
    net: Net, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Callable[..., Said]]:
    """Run ``rtf run`` with these words in this process; nodes keep their records in the folder of the test."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(net.config))
    monkeypatch.setitem(net.environment, "XDG_STATE_HOME", str(tmp_path))

    def run(*words: str) -> Said:
        capsys.readouterr()
        try:
            code = main(RTF, ["run", *words])
        except SystemExit as error:
            code = int(error.code or 0)
        return Said(code, *capsys.readouterr())

    return run


def opened(net: Net) -> Tool:
    """Start a node, and wait until it can be asked."""
    node = net.start("run", "--server", "/node", "--grace", "3")
    node.until(lambda: "is available" in node.stdout, "the node")
    return node


def start(ask: Callable[..., Said], tag: str, *words: str) -> int:
    """Start a program; returns its process."""
    said = ask("--on", "/node", "--as", tag, *words)
    assert said.code == 0, said.err
    return int(said.out.rpartition("pid=")[2])


def family_of(pid: int) -> list[int]:
    """A process, and all below it."""
    return [pid, *(one for child in children_of(pid) for one in family_of(child))]


def test_conversation(net: Net, ask: Callable[..., Said]):
    """The node starts, lists and ends programs on request, and logs who asked."""
    node = opened(net)
    assert "property yarprun = true" in "".join(net.names.command("get /node yarprun"))
    pid = start(ask, "s", "--cmd", "sleep", "60", "--env", "A=1")
    for words, expected in (
        (("--ps",), Said(0, f'(pid {pid}) (tag s) (status running) (cmd "sleep 60") (env "A=1")\n', "")),
        (("--isrunning", "s"), Said(0, "running\n", "")),
        (("--isrunning", "nothing"), Said(1, "not running\n", "")),
        (("--kill", "s", "term"), Said(0, "kill OK\n", "")),
        (("--sigterm", "nothing"), Said(1, "sigterm FAILED\n", "")),
        (("--sigtermall",), Said(0, "sigtermall OK\n", "")),
        (("--which", "no-such-program"), Said(0, "no-such-program\n", "")),
    ):
        assert ask("--on", "/node", *words) == expected
    refused = ask("--on", "/node", "--as", "t", "--cmd", "no-such-program")
    assert (refused.code, refused.out) == (1, "")
    assert refused.err.endswith("Can't execute command because No such file or directory\n")
    assert re.search(r"^memory total +\d+$", ask("--on", "/node", "--sysinfo").out, re.MULTILINE)
    second = net.run("run", "--server", "/node")
    assert (second.process.returncode, "runs on this machine already" in second.stderr) == (1, True)
    assert ask("--on", "/node", "--exit") == Said(0, "exit OK\n", "")
    assert node.wait() == 0
    assert re.search(r"^/tmp/port/\d at 127.0.0.1 sends SIGTERM to s \(", node.stdout, re.MULTILINE)
    gone = ask("--on", "/node", "--ps")
    assert (gone.code, "there is no node /node; 'rtf name runners'" in gone.err) == (1, True)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--on", "/node", "--cmd", "ls"), "--as TAG"),
        (("--on", "/node"), "one of the arguments"),
        (("--on", "/node", "--as", "t", "--cmd", "say", 'a"b'), "double quote"),
        (("--on", "/node", "--kill", "t", "GONE"), "'GONE' is no signal"),
    ],
)
def test_mistakes(ask: Callable[..., Said], words: tuple[str, ...], complaint: str):
    """A mistake of the user is reported before a node is asked."""
    said = ask(*words)
    assert (said.code in (1, 4), said.out) == (True, "")
    assert complaint in said.err


@pytest.mark.parametrize(
    ("words", "usage"),
    [(("--server", "--help"), "--allow-program"), (("--on", "-h"), "--isrunning"), (("-h",), "--junit")],
)
def test_help(ask: Callable[..., Said], words: tuple[str, ...], usage: str):
    """Of the node, of its client, and of what runs suites, which names the other two."""
    said = ask(*words)
    assert (said.code, said.err, usage in said.out) == (0, "", True)


def test_terminal(net: Net, ask: Callable[..., Said], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A node opens a window for a program: it shows what is written, sends what is typed, and ends with the program."""
    keyboard, screen, window = tmp_path / "keyboard", tmp_path / "screen", tmp_path / "xterm"
    os.mkfifo(keyboard)
    window.write_text(f'#!/bin/sh\nwhile [ "$1" != -e ]; do shift; done\nshift\nexec "$@" < {keyboard} > {screen}\n')
    window.chmod(0o755)
    monkeypatch.setitem(net.environment, "PATH", f"{tmp_path}:{os.environ['PATH']}")
    node = opened(net)
    said = ask("--on", "/node", "--as", "io", "--stdio", "/node", "--cmd", 'sh -c "echo begun; exec cat"')
    program, opener = (int(pid) for pid in re.findall(r"pid=(\d+)", said.out))
    with keyboard.open("w") as keys:
        keys.write("hello\n")
        keys.flush()
        eventually(lambda: screen.exists() and screen.read_text() == "begun\nhello\n", "the screen is empty", 20.0)
        assert ask("--on", "/node", "--ps").out.startswith(f"(pid {program}) (tag io)")
        assert ask("--on", "/node", "--sigterm", "io").code == 0
        eventually(lambda: not any(map(alive, (program, opener))), "the terminal is left")
    assert node.end() == 0


def test_killed_nodes(net: Net, ask: Callable[..., Said]):
    """Programs end with their node, whatever they forked and whatever was killed; the next one finds a held one."""
    node = opened(net)
    held = start(ask, "held", "--cmd", "sleep 60", "--hold")
    for victims in ("server", "keeper", "server and keeper"):
        program = start(ask, "family", "--cmd", FAMILY)
        eventually(lambda program=program: len(family_of(program)) == 3, "the family is not complete")
        (server,) = children_of(node.process.pid)
        ending = [server, *family_of(program)]
        for name, pid in (("keeper", node.process.pid), ("server", server)):
            if name in victims:
                os.kill(pid, signal.SIGKILL)
        node.wait()
        if victims != "server and keeper":
            eventually(lambda ending=ending: not any(map(alive, ending)), f"the {victims} left something")
        assert alive(held)
        node = opened(net)
        eventually(lambda ending=ending: not any(map(alive, ending)), "the next node left something")
        assert f"found held ({held}) again: sleep 60" in node.stdout.splitlines()
        assert ask("--on", "/node", "--ps").out.startswith(f"(pid {held}) (tag held) (status running)")
    program = start(ask, "family", "--cmd", FAMILY)
    eventually(lambda: len(family_of(program)) == 3, "the family is not complete")
    ending = family_of(program)
    assert node.end(signal.SIGTERM) == 0
    assert ([*filter(alive, ending)], alive(held)) == ([], True)
    os.kill(held, signal.SIGKILL)
