"""Tools about names: the registered names, the address of the server, and dead names."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf.middleware.naming.discovery import PORT as DISCOVERY

if TYPE_CHECKING:
    from conftest import Net

DATA = Path(__file__).parents[2] / "data" / "yarp_wire"

#: The commands of the recorded console.
RECORDED_COMMANDS = (
    "where",
    "name list",
    "name register /x tcp 127.0.0.1 10500",
    "name query /x",
    "name query /nothere",
    "name set /x offers tcp udp",
    "name get /x offers",
    "name check /x offers tcp",
    "name route /x /x",
    "name unregister /x",
    "name list",
    "exists /x",
    "exists /root",
    "detect",
    "clean --timeout 0.3",
)
#: Recorded lines that are not printed here: hints, which only a terminal gets; an address for browsers, which does
#: not exist; and that the server could not be pinged while it was recorded.
LEFT_OUT = (
    "Looking for name server on ",
    "Checking for name server at ",
    "If there is a long delay, try:",
    "  yarp conf --clean",
    "== /root can be browsed at ",
    "/root is not responding.",
)


def test_the_console_of_yarp(net: Net):
    """The recorded commands print YARP's lines, but for the port of the server; errors go to stderr."""
    printed = []
    for command in RECORDED_COMMANDS:
        done = net.run(*command.split())
        errors = [line for line in done.stderr.splitlines() if line.startswith("[ERROR]")]
        assert done.process.returncode == int(command in ("name query /nothere", "exists /x")), done.stderr
        printed += [*done.stdout.splitlines(), *errors]
    recorded, newer = ((DATA / name / "tools_names.console.txt").read_text() for name in ("3.12.3", "4.0.0"))
    assert recorded == newer
    expected = recorded.splitlines()
    expected = [line for line in expected if not line.startswith(LEFT_OUT)]
    assert [line.replace(str(net.contact.port), "10000") for line in printed] == expected


def test_clean_forgets_only_what_is_gone(net: Net):
    """``rtf clean`` unregisters a port that does not answer, and no other."""
    reader = net.opened("/reader", "read", "/reader")
    net.run("name", "register", "/gone", "tcp", "127.0.0.1", str(free_port()))
    printed = net.run("clean").stdout.splitlines()
    assert "* No response, removing port /gone" in printed
    assert len([line for line in printed if "removing" in line]) == 1
    assert net.names.query("/gone") is None
    assert net.names.query("/reader") is not None
    assert reader.end() == 0


class TestPlace:
    """``rtf where``, ``conf``, ``detect`` and ``namespace``, with an empty folder of configuration."""

    @pytest.fixture
    def user(self, tmp_path: Path) -> dict[str, str]:
        """The environment with the empty folder."""
        return {"YARP_CONFIG_HOME": str(tmp_path / "mine")}

    def test_conf(self, net: Net, user: dict[str, str]):
        """``rtf conf`` prints the path of the file, writes it in YARP's format, and removes it."""
        file = Path(user["YARP_CONFIG_HOME"], "yarp.conf")
        assert net.run("conf", **user).stdout == f"{file}\n"
        assert net.run("conf", net.contact.host, str(net.contact.port), **user).process.returncode == 0
        assert file.read_text() == f"{net.contact.host} {net.contact.port} yarp\n"
        there = f"Name server /root is available at ip {net.contact.host} port {net.contact.port}\n"
        assert net.run("where", **user).stdout == there
        assert net.run("conf", "--clean", **user).process.returncode == 0
        assert not file.exists()

    def test_a_namespace(self, net: Net, user: dict[str, str]):
        """``rtf namespace`` stores a namespace, which names the contact file; an invalid one is refused."""
        assert net.run("namespace", **user).stdout == "YARP namespace: /root\n"
        assert net.run("namespace", "/lab", **user).stdout == "YARP namespace: /lab\n"
        assert net.run("conf", **user).stdout.endswith("/_lab.conf\n")
        assert net.run("namespace", "lab", **user).process.returncode == 4

    def test_detect(self, net: Net, user: dict[str, str]):
        """``rtf detect`` finds a server by multicast, without configuration, and stores its address."""
        try:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("224.2.1.1", DISCOVERY))
            with socket.create_server(("127.0.0.1", DISCOVERY)):
                pass
        except OSError:
            pytest.skip(f"somebody uses port {DISCOVERY} of this machine")
        server = net.start("nameserver", "--namespace", f"/{net.folder.name}")
        user["YARP_NAMESPACE"] = f"/{net.folder.name}"
        server.until(lambda: "is available" in server.stdout, "the server")
        found = net.run("detect", "--write", **user)
        assert f"== /{net.folder.name} is available at ip 127.0.0.1 port {DISCOVERY}" in found.stdout.splitlines()
        assert net.run("where", **user).process.returncode == 0
        assert server.end() == 0

    def test_detect_finds_none(self, net: Net, user: dict[str, str]):
        """If no server answers, ``rtf detect`` fails, with a hint."""
        done = net.run("detect", "--timeout", "0.2", YARP_NAMESPACE="/nobody_is_called_so", **user)
        assert done.process.returncode == 1
        assert "== NOT FOUND" in done.stdout.splitlines()
        assert "rtf conf HOST PORT" in done.stderr
