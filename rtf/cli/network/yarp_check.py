"""``rtf yarp-check``: our ports, name server and tools against the ``yarp`` that is installed, in both directions.

Everything happens on loopback, with name servers of its own at free numbers and a configuration folder that is removed
at the end: a running network is neither used nor disturbed.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle
from rtf.cli.network.options import make_parser
from rtf.cli.network.terminal import complain, progress, say
from rtf.errors import RtfError
from rtf.middleware.errors import WaitTimeoutError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.contact import Contact
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

#: Seconds that a program of YARP may take for one step; it looks up names, and this machine may be busy.
_PATIENCE = 20.0
_LOOK_AGAIN = 0.05
#: Seconds after which a message is sent again.
_AGAIN = 2.0
#: Where the plug-ins of YARP are, and the sockets of unix_stream, which both ends have to find.
_SHARED = ("YARP_DATA_DIRS", "YARP_RUNTIME_DIR")
#: A line of YARP's log, which goes to stdout, too.
_LOG = re.compile(r"\[(?:TRACE|DEBUG|INFO|WARNING|ERROR|FATAL)\] ?\|")
#: The width of the table where the output is no terminal.
_WIDTH = 160
_CARRIERS = ("tcp", "fast_tcp", "udp", "mcast", "text", "text_ack", "unix_stream")
#: What is sent: all that the two versions encode differently, and what they do not.
_MESSAGE = '[set] 3 1.5 (0.25 2.5 3.5) "two words" -7'


class CheckError(RtfError):
    """A check has found a difference; the text says which."""


class NotApplicableError(RtfError):
    """A check is about something that the installed YARP does not have."""


@dataclass
class Bench:
    """A name server, ours or YARP's, with our network and the environment of YARP's programs that use it."""

    network: Network
    environment: dict[str, str]
    programs: list[subprocess.Popen[str]] = field(default_factory=list)

    def run(self, *words: str, text: str = "") -> str:
        """Run a ``yarp`` command to its end and return what it printed. Raises CheckError if it fails."""
        try:
            done = subprocess.run(
                ["yarp", *words],
                input=text,
                capture_output=True,
                text=True,
                timeout=_PATIENCE,
                env=self.environment,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise CheckError(f"'yarp {' '.join(words)}' did not end within {_PATIENCE:g} s") from None
        if done.returncode:
            raise CheckError(f"'yarp {' '.join(words)}' ended with {done.returncode}: {done.stderr.strip()[-300:]}")
        return done.stdout

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start a ``yarp`` command that goes on; it ends with the check."""
        program = subprocess.Popen(
            ["yarp", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=self.environment,
        )
        self.programs.append(program)
        return program

    def await_port(self, name: str) -> None:
        """Wait until a port is registered and answers."""
        await_that(lambda: remote.exists(self.network, Contact(name)), f"the port {name} of YARP is not there")

    def end_programs(self) -> None:
        """Kill the programs that still run."""
        for program in self.programs:
            program.kill()
            program.communicate()
        self.programs.clear()


def await_that(condition: Callable[[], object], complaint: str) -> None:
    """Wait until a condition holds. Raises CheckError with the complaint if it does not in time."""
    deadline = clock.Deadline.after(_PATIENCE)
    while not condition():
        if deadline.expired:
            raise CheckError(f"{complaint}, {_PATIENCE:g} s later")
        clock.sleep(_LOOK_AGAIN)


def _expect(got: str, wanted: str, what: str) -> None:
    if got.strip() != wanted:
        raise CheckError(f"{what} is {got.strip()!r} instead of {wanted!r}")


# The checks ------------------------------------------------------------------------------------------------------


def _writes_to_us(bench: Bench, carrier: str) -> str:
    """A program of YARP sends to our port; every value arrives."""
    with BufferedPort("/rtf/reader", BOTTLE, network=bench.network, strict=True) as reader:
        writer = bench.start("write", "/yarp/writer")
        bench.await_port("/yarp/writer")
        _connect(bench, "/yarp/writer", "/rtf/reader", carrier)
        deadline = clock.Deadline.after(_PATIENCE)
        while not deadline.expired:  # the first datagrams of a multicast group may be lost
            _type(writer, _MESSAGE)
            with contextlib.suppress(WaitTimeoutError):
                _expect(reader.read(_AGAIN).to_text(), _MESSAGE, "what arrived")
                return ""
        raise CheckError(f"nothing arrived within {_PATIENCE:g} s")


def _reads_from_us(bench: Bench, carrier: str) -> str:
    """Our port sends to a program of YARP, which prints every value."""
    reader = bench.start("read", "/yarp/reader")
    bench.await_port("/yarp/reader")
    with Port("/rtf/writer", network=bench.network) as writer:
        _connect(bench, "/rtf/writer", "/yarp/reader", carrier)
        if writer.write(Bottle.parse(_MESSAGE)) != 1:
            raise CheckError("the connection was lost")
        assert reader.stdout is not None
        _expect(_line(reader), _MESSAGE, "what was printed")
        dialect = writer.outputs[0].dialect
    return f"dialect {dialect.value}" if dialect is not None else ""


def _connect(bench: Bench, source: str, target: str, carrier: str) -> None:
    try:
        remote.connect(bench.network, Contact(source), Contact(target), carrier)
    except RtfError as error:
        if "carrier" in str(error).lower():
            raise NotApplicableError(str(error)) from None
        raise


def _type(program: subprocess.Popen[str], line: str) -> None:
    """Give a program a line. Raises CheckError if it has ended."""
    assert program.stdin is not None
    try:
        program.stdin.write(f"{line}\n")
        program.stdin.flush()
    except OSError:
        raise CheckError(f"it has ended with {program.poll()}") from None


def _line(program: subprocess.Popen[str]) -> str:
    """Return the next line of a program that is no log. Raises CheckError if none comes in time."""
    lines: list[str] = []
    output = program.stdout
    assert output is not None

    def read() -> None:
        lines.extend(itertools.islice((line for line in output if not _LOG.match(line)), 1))

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    thread.join(_PATIENCE)
    if not lines:
        raise CheckError(f"it printed nothing within {_PATIENCE:g} s")
    return lines[0]


def _asks_us(bench: Bench) -> str:
    """A program of YARP asks our server and prints the reply."""
    with RpcServer("/rtf/server", lambda question: Bottle([*question, 2.5]), network=bench.network):
        _expect(bench.run("rpc", "/rtf/server", text="get 1.5\n"), "Response: get 1.5 2.5", "the reply")
    return ""


def _is_asked_by_us(bench: Bench) -> str:
    """Our client asks a program of YARP."""
    server = bench.start("rpcserver", "/yarp/server")
    bench.await_port("/yarp/server")
    with RpcClient("/rtf/client", "/yarp/server", network=bench.network) as client:
        _type(server, "[ok] 0.5")
        reply = client.call(Bottle(["get", 1.5]), timeout=_PATIENCE)
    _expect("" if reply is None else reply.to_text(), "[ok] 0.5", "the reply")
    return ""


def _administers_us(bench: Bench) -> str:
    """``yarp exists``, ``ping``, ``connect`` and ``disconnect`` work with our ports."""
    with Port("/rtf/a", network=bench.network) as source, Port("/rtf/b", lambda _: None, network=bench.network):
        bench.run("exists", "/rtf/a")
        bench.run("ping", "/rtf/a")
        bench.run("connect", "/rtf/a", "/rtf/b")
        if [output.peer for output in source.outputs] != ["/rtf/b"]:
            raise CheckError("'yarp connect' did not connect our ports")
        bench.run("disconnect", "/rtf/a", "/rtf/b")
        await_that(lambda: not source.outputs, "'yarp disconnect' did not disconnect our ports")
    return ""


def _survives_a_kill(bench: Bench) -> str:
    """A reader of YARP is killed; our writer loses that connection only, and a new reader gets the next message."""
    with Port("/rtf/writer", network=bench.network) as writer:
        for _ in range(2):
            reader = bench.start("read", "/yarp/killed")
            bench.await_port("/yarp/killed")
            writer.add_output("/yarp/killed")
            if writer.write(Bottle([1.5])) != 1:
                raise CheckError("the reader did not get its message")
            _expect(_line(reader), "1.5", "what was printed")
            reader.send_signal(signal.SIGKILL)
            reader.wait(_PATIENCE)
            await_that(lambda: not writer.write(Bottle([2.5])), "the loss of the reader is not noticed")
    return ""


def _lists_our_names(bench: Bench) -> str:
    """``yarp name`` finds our ports."""
    with Port("/rtf/named", network=bench.network) as port:
        if f"port {port.contact.port}" not in bench.run("name", "query", "/rtf/named"):
            raise CheckError("'yarp name query' does not print the address of our port")
    return ""


def _checks() -> Iterator[tuple[str, Callable[[Bench], str]]]:
    yield "name server: yarp finds our ports", _lists_our_names
    yield "tools: exists, ping, connect, disconnect", _administers_us
    for carrier in _CARRIERS:
        yield f"{carrier}: yarp writes, we read", lambda bench, carrier=carrier: _writes_to_us(bench, carrier)  # type: ignore[misc]  # bound now
        yield f"{carrier}: we write, yarp reads", lambda bench, carrier=carrier: _reads_from_us(bench, carrier)  # type: ignore[misc]  # bound now
    yield "rpc: yarp asks, we reply", _asks_us
    yield "rpc: we ask, yarp replies", _is_asked_by_us
    yield "kill -9 of a reader", _survives_a_kill


# The command -----------------------------------------------------------------------------------------------------


def yarp_check(words: Sequence[str]) -> ExitCode:
    """Check that ports of YARP and ours understand each other."""
    parser = make_parser(
        "yarp-check",
        "Try our ports, name server and tools against the 'yarp' that is installed, in both directions, on this machine"
        " alone. Prints a table; exits with 1 if something differs.",
        "rtf yarp-check\nPATH=/opt/yarp-4/bin:$PATH rtf yarp-check",
    )
    parser.add_argument("--only", metavar="TEXT", default="", help="only the checks with this text, such as udp or rpc")
    options = parser.parse_args(words)
    if shutil.which("yarp") is None:
        complain("there is no 'yarp' on PATH", "install YARP, or put its bin folder on PATH")
        return ExitCode.USAGE
    rows = []
    if "YARP_RUNTIME_DIR" not in os.environ:  # YARP finds no default where USER is not set, as in a container
        os.environ["YARP_RUNTIME_DIR"] = f"/tmp/runtime-{os.getuid()}/yarp"  # noqa: S108 - the folder is its user's
    for title, make in (("our name server", _with_our_server), ("yarpserver", _with_yarpserver)):
        if make is _with_yarpserver and shutil.which("yarpserver") is None:
            continue
        with tempfile.TemporaryDirectory(prefix="rtf-yarp-check-") as folder, make(Path(folder)) as bench:
            for name, check in _checks():
                if options.only in name:
                    progress(f"{title}: {name}")
                    rows.append((title, name, *_outcome(bench, check)))
    say(f"yarp {_version()}")
    _print(rows)
    failed = sum(verdict == "FAILED" for _, _, verdict, _ in rows)
    say(f"{len(rows)} checks, {failed} failed" if rows else "no check has this text in its name")
    return ExitCode.FAILURES if failed or not rows else ExitCode.PASSED


def _outcome(bench: Bench, check: Callable[[Bench], str]) -> tuple[str, str]:
    try:
        return "passed", check(bench)
    except NotApplicableError as error:
        return "skipped", str(error)
    except RtfError as error:
        return "FAILED", str(error)
    finally:
        bench.end_programs()


def _version() -> str:
    done = subprocess.run(["yarp", "version"], capture_output=True, text=True, timeout=_PATIENCE, check=False)
    return (done.stdout or done.stderr).strip().removeprefix("YARP version").strip()


def _environment(folder: Path) -> dict[str, str]:
    """Return the environment of YARP's programs: a configuration of their own."""
    own = dict.fromkeys(("YARP_CONFIG_HOME", "YARP_DATA_HOME", "YARP_CONF"), str(folder))
    kept = {key: value for key, value in os.environ.items() if not key.startswith("YARP_") or key in _SHARED}
    return {**kept, **own, "YARP_COLORED_OUTPUT": "0"}


@contextlib.contextmanager
def _with_our_server(folder: Path) -> Iterator[Bench]:
    with NameServer() as server:
        bench = Bench(Network(server.names), _environment(folder))
        bench.run("conf", server.contact.host, str(server.contact.port))
        yield bench


@contextlib.contextmanager
def _with_yarpserver(folder: Path) -> Iterator[Bench]:
    environment = _environment(folder)
    with NameServer() as free:  # a number that nothing uses now
        number = free.contact.port
    server = subprocess.Popen(
        ["yarpserver", "--ip", "127.0.0.1", "--socket", str(number), "--write"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    try:
        names = RemoteNames(Contact("/root", "127.0.0.1", number, "tcp"))
        await_that(lambda: _answers(names), "yarpserver does not answer")
        yield Bench(Network(names), environment)
    finally:
        server.kill()
        server.wait()


def _answers(names: RemoteNames) -> bool:
    try:
        return names.query("/root") is not None
    except RtfError:
        return False


def _print(rows: Sequence[tuple[str, str, str, str]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table("NAMES", "CHECK", "RESULT", "", box=None, pad_edge=False)
    for title, name, verdict, detail in rows:
        style = {"passed": "green", "FAILED": "bold red"}.get(verdict, "yellow")
        table.add_row(title, name, Text(verdict, style), Text(detail))
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    console.print(table)
