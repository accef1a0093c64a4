"""``rtf nameserver``: the server as a program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf.cli.network.name_server import nameserver
from rtf.middleware.naming import configuration
from rtf.middleware.naming.client import RemoteNames
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable

_PROGRAM = "import sys; from rtf.cli.network.name_server import nameserver; sys.exit(nameserver(sys.argv[1:]))"


@pytest.fixture
def start(tmp_path: Path):
    """Return a function that starts the program, with pipes for its output."""
    started: list[subprocess.Popen[str]] = []

    def run(*words: str) -> subprocess.Popen[str]:
        environment = {name: value for name, value in os.environ.items() if not name.startswith("YARP")}
        environment["YARP_CONFIG_HOME"] = str(tmp_path / "yarp")
        process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        started.append(process)
        return process

    yield run
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_serves_until_it_is_told_to_stop(start: Callable[..., subprocess.Popen[str]], tmp_path: Path, how: int):
    """The program stores its address, serves names, and ends with 0 on SIGINT or SIGTERM."""
    process = start("--socket", "0", "--write", "--namespace", "/lab")
    environment = {"YARP_CONFIG_HOME": str(tmp_path / "yarp"), "YARP_NAMESPACE": "/lab"}
    assert process.stdout.readline() == f"Stored in {tmp_path / 'yarp' / '_lab.conf'}\n"
    assert process.stdout.readline().startswith("Name server /lab is available at ip 127.0.0.1 port ")
    names = configuration.find_names(environment)
    assert [contact.name for contact in names.list()] == ["/lab", "fallback"]
    process.send_signal(how)
    assert process.communicate(timeout=20) == ("", "")
    assert process.returncode == ExitCode.PASSED


def test_serves_where_the_file_says(start: Callable[..., subprocess.Popen[str]], tmp_path: Path):
    """With ``--read`` the program uses the stored address; ``--portdb`` keeps names across a kill."""
    words = "--socket", "0", "--write", "--silent", "--portdb", str(tmp_path / "names.db")
    first = start(*words)
    first.stdout.readline()
    place = configuration.read_place("/root", {"YARP_CONFIG_HOME": str(tmp_path / "yarp")})
    first.stdout.readline()
    names = RemoteNames(place.contact)
    names.command("register /a tcp 127.0.0.1 5")
    first.kill()
    first.wait()
    second = start("--read", "--portdb", str(tmp_path / "names.db"))
    assert second.stdout.readline().endswith(f"port {place.contact.port}\n")
    assert names.query("/a").port == 5


def test_says_what_is_wrong(start: Callable[..., subprocess.Popen[str]], server):
    """An address in use is an error of one line, with an exit code."""
    process = start("--socket", str(server.contact.port))
    out, err = process.communicate(timeout=20)
    assert (out, process.returncode) == ("", ExitCode.FAILURES)
    assert err.startswith(f"rtf nameserver: the name server cannot listen on 127.0.0.1:{server.contact.port}: ")


@pytest.mark.parametrize("words", [["--socket", "x"], ["--socket", "70000"], ["--socket", "-1"], ["--what"]])
def test_options_that_are_none(words: list[str], capsys: pytest.CaptureFixture[str]):
    """Invalid options are usage errors, with a hint to the help."""
    with pytest.raises(SystemExit) as ended:
        nameserver(words)
    assert ended.value.code == ExitCode.USAGE
    assert "rtf nameserver --help" in capsys.readouterr().err


def test_does_not_answer_multicast_unless_it_is_the_standard_one(start: Callable[..., subprocess.Popen[str]]):
    """A server at another port than the standard one opens no socket for discovery."""
    process = start("--socket", "0")
    process.stdout.readline()
    facts = Path("/proc", str(process.pid))
    datagrams = {f"socket:[{line.split()[9]}]" for line in (facts / "net" / "udp").read_text().splitlines()[1:]}
    assert not datagrams & {str(path.readlink()) for path in (facts / "fd").iterdir()}
