"""Tools that show a network and change it: exists, wait, ping, connect, disconnect, list, top, terminate."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf.cli.command_tree import RTF
from rtf.cli.tools import main

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conftest import Net, Tool


@pytest.fixture
def pair(net: Net) -> Iterator[tuple[Tool, Tool]]:
    """The ports ``/writer`` and ``/reader``, not connected."""
    reader = net.start("read", "/reader")
    writer = net.opened("/writer", "write", "/writer")
    writer.until(lambda: net.answers("/reader"), "the reader")
    yield writer, reader
    assert writer.end() == 0
    assert reader.end() == 0


class TestConnections:
    """``rtf connect``, ``disconnect``, ``exists`` and ``wait``."""

    def test_connect_and_disconnect(self, net: Net, pair: tuple[Tool, Tool]):
        """Connecting and disconnecting work, with YARP's messages; a second disconnection fails."""
        writer, reader = pair
        assert net.run("exists", "/writer", "/reader").process.returncode == 1
        assert net.run("connect", "/writer", "/reader").stdout == (
            "Success: Added connection from /writer to tcp://reader\n"
        )
        writer.type("hello")
        reader.until_printed("hello")
        assert net.run("exists", "/writer", "/reader").process.returncode == 0
        assert net.run("disconnect", "/writer", "/reader").stdout == (
            "Success: Removed connection from /writer to /reader\n"
        )
        again = net.run("disconnect", "/writer", "/reader")
        assert again.process.returncode == 1
        assert again.stderr.startswith("[ERROR] Failure: no such connection\n")

    @pytest.mark.parametrize(
        "words", [["fast_tcp://reader"], ["/reader", "fast_tcp"], ["/reader", "--carrier", "fast_tcp"]]
    )
    def test_the_carrier_can_be_said_in_three_ways(self, net: Net, pair: tuple[Tool, Tool], words: list[str]):
        """The carrier is before the name, after it, or an option; ``exists`` fails for another carrier."""
        assert net.run("connect", "/writer", *words).process.returncode == 0
        asked = net.run("exists", "/writer", "tcp://reader")
        assert asked.stdout == "Connection found from /writer to /reader using carrier fast_tcp\n"
        assert asked.process.returncode == 1

    @pytest.mark.parametrize(("source", "target", "role"), [("/no", "/reader", "source"), ("/writer", "/no", "destin")])
    def test_a_port_that_is_missing(self, net: Net, pair: tuple[Tool, Tool], source: str, target: str, role: str):
        """A missing port is named with YARP's message, and a hint to ``rtf list``."""
        done = net.run("connect", source, target)
        assert done.process.returncode == 1
        assert re.match(rf"\[ERROR\] Failure: could not find {role}\w* port /no\n.*rtf list", done.stderr)

    def test_a_port_that_refuses(self, net: Net, pair: tuple[Tool, Tool]):
        """The reason of the port that refuses a connection is printed."""
        done = net.run("connect", "/reader", "/writer")
        assert done.process.returncode == 1
        assert done.stderr.startswith("[ERROR] Failure: Outputs not allowed\n")

    def test_persistent_connections(self, net: Net):
        """A persistent connection is listed, made when both ports are open, and can be removed."""
        assert net.run("connect", "--persist", "/writer", "fast_tcp://reader").process.returncode == 0
        assert net.run("connect", "--list-subs").stdout == "/writer -> fast_tcp://reader\n"
        reader = net.start("read", "/reader", "once")
        writer = net.start("write", "/writer", "--await-reader", "20")
        waiting = net.run("wait", "/writer", "fast_tcp://reader", "--timeout", "20")
        assert waiting.process.returncode == 0, waiting.stderr
        writer.type("hello")
        assert reader.wait() == 0
        assert net.run("disconnect", "--persist", "/writer", "/reader").process.returncode in (0, 1)
        assert net.run("connect", "--list-subs").stdout == ""
        assert writer.wait() == 0

    def test_persistent_connection_of_absent_ports(self, net: Net):
        """A persistent connection of absent ports can be removed once; a second removal fails."""
        assert net.run("connect", "--persist", "/absent", "fast_tcp://gone").process.returncode == 0
        done = net.run("disconnect", "--persist", "/absent", "/gone")
        assert (done.process.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("Success: ")
        assert net.run("connect", "--list-subs").stdout == ""
        assert net.run("disconnect", "--persist", "/absent", "/gone").process.returncode == 1

    def test_waiting_in_vain(self, net: Net):
        """``rtf wait`` fails after its timeout, and names the port."""
        done = net.run("wait", "/never", "--timeout", "50ms")
        assert done.process.returncode == 1
        assert "waited 0.05 s for /never" in done.stderr

    def test_ctrl_c_ends_a_wait(self, net: Net):
        """Ctrl-C ends ``rtf wait`` without a message, with exit code 2."""
        waiting = net.start("wait", "/never")
        waiting.until(lambda: _looks(waiting), "the wait")
        assert waiting.end() == 2
        assert waiting.stderr == ""


def _looks(tool: Tool) -> bool:
    """Return whether a tool has installed its signal handler for SIGTERM."""
    with Path(f"/proc/{tool.process.pid}/status").open() as status:
        caught = next(int(line.split()[1], 16) for line in status if line.startswith("SigCgt"))
    return bool(caught & (1 << 14))


class TestLooking:
    """``rtf ping``, ``list`` and ``top``."""

    def test_ping(self, net: Net, pair: tuple[Tool, Tool]):
        """``rtf ping`` prints the port's description and the round-trip times."""
        net.run("connect", "/writer", "/reader", "udp")
        lines = net.run("ping", "/writer", "--count", "3").stdout.splitlines()
        assert re.fullmatch(r"This is /writer at tcp://127\.0\.0\.1:\d+/", lines[0])
        assert lines[1] == "There is an output connection from /writer to /reader using udp"
        assert re.fullmatch(r"Round trip of 3: min [\d.]+ ms, median [\d.]+ ms, max [\d.]+ ms", lines[-1])

    def test_ping_of_a_port_that_is_gone(self, net: Net):
        """A port that does not answer is reported with YARP's message, and a hint to ``rtf clean``."""
        net.run("name", "register", "/gone", "tcp", "127.0.0.1", "1")
        done = net.run("ping", "/gone")
        assert done.process.returncode == 1
        assert done.stderr.startswith("[ERROR] /gone is not responding.\n")
        assert "rtf clean" in done.stderr
        net.run("name", "unregister", "/gone")

    def test_list(self, net: Net, pair: tuple[Tool, Tool]):
        """``rtf list`` prints each port with address, answer and connections, as a tree, or the names only."""
        net.run("connect", "/writer", "/reader", "fast_tcp")
        net.run("name", "register", "/gone", "tcp", "127.0.0.1", "1")
        rows = [line.split() for line in net.run("list").stdout.splitlines()]
        assert rows[0] == ["PORT", "ADDRESS", "CARRIER", "ALIVE", "IN", "OUT"]
        found = {row[0]: row[2:] for row in rows[1:]}
        assert found == {
            "/gone": ["tcp", "no", "-", "-"],
            "/reader": ["tcp", "yes", "1", "0"],
            "/root": ["tcp", "yes", "0", "0"],
            "/writer": ["tcp", "yes", "0", "1"],
            "fallback": ["mcast", "-", "-", "-"],
        }
        tree = net.run("list", "--tree").stdout.splitlines()
        assert "/gone  (does not answer)" in tree
        assert tree[tree.index("/writer") + 1] == "└── /reader  (fast_tcp)"
        assert net.run("list", "/reader", "--names").stdout == "/reader\n"
        net.run("name", "unregister", "/gone")

    def test_top(self, net: Net, pair: tuple[Tool, Tool]):
        """``rtf top`` prints rates of tcp connections, and of any port by a tap, which is removed afterwards."""
        writer, _ = pair
        net.run("connect", "/writer", "/reader")
        looking = net.start("top", "--once", "--interval", "0.5", "--tap", "/writer")

        def is_done() -> bool:
            writer.type(*["1 2 3"] * 100)  # more than it sends at once: it works while this thread may not
            return looking.process.poll() is not None

        writer.until(is_done, "the end of top")
        assert looking.wait() == 0, looking.stderr
        ports, links, taps = (table.splitlines() for table in looking.stdout.split("\n\n"))
        (row,) = [line.split() for line in ports if line.startswith("/reader ")]
        assert row[1] == "yes"
        assert row[3] == "ms"
        assert float(row[6]) > 10  # messages in a second
        (link,) = [line.split() for line in links if line.startswith("/writer ")]
        assert link[:4] == ["/writer", "/reader", "tcp", row[6]]
        tapped = taps[1].split()
        assert tapped[0] == "/writer"
        assert float(tapped[1]) > 10
        assert not any(line.startswith("/tmp/") for line in ports)
        assert net.run("list", "--names").stdout.splitlines() == ["/reader", "/root", "/writer", "fallback"]
        assert writer.stderr == ""

    def test_terminate(self, net: Net, pair: tuple[Tool, Tool]):
        """``rtf terminate`` asks a program by its quit port; one that goes on is reported."""
        program = net.opened("/camera/quit", "read", "/camera/quit", "once")
        done = net.run("terminate", "/camera")
        assert done.process.returncode == 0, done.stderr
        assert done.stdout == "/camera/quit is gone\n"
        assert program.wait() == 0
        assert program.stdout == "quit\n"
        deaf = net.run("terminate", "/reader", "--timeout", "0.1")
        assert deaf.process.returncode == 1
        assert "/reader is still there after 0.1 s" in deaf.stderr


TOOLS = [command.name for command in RTF.commands if command.on_network]


class TestWords:
    """Help and errors of the command line."""

    @pytest.mark.parametrize("word", TOOLS)
    def test_each_tool_teaches(self, capsys: pytest.CaptureFixture[str], word: str):
        """The help of each tool has its usage, and an example for all but the server."""
        with pytest.raises(SystemExit) as end:
            main([word, "--help"])
        assert end.value.code == 0
        shown = capsys.readouterr().out
        assert f"usage: rtf {word}" in shown
        assert word == "nameserver" or f"example:\n  rtf {word}" in shown or "  echo " in shown

    @pytest.mark.parametrize(
        "words",
        [["exists"], ["ping", "reader"], ["read", "/a/"], ["read", "tcp://a"], ["read", "/a", "twice"], ["conf", "h"]],
    )
    def test_what_is_wrong_on_a_command_line(self, capsys: pytest.CaptureFixture[str], words: list[str]):
        """A wrong command line ends with 4, and a hint to the help."""
        with pytest.raises(SystemExit) as end:
            main(words)
        assert end.value.code == 4
        assert f"Try 'rtf {words[0]} --help'." in capsys.readouterr().err
