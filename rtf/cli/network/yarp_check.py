"""``rtf yarp-check``: our ports, name server, tools and clients of devices against the ``yarp`` that is installed.

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
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle
from rtf.cli.network.options import make_parser
from rtf.cli.network.terminal import complain, progress, say
from rtf.cli.network.yarp_bench import (
    PATIENCE,
    Bench,
    CheckError,
    NotApplicableError,
    await_that,
    with_our_server,
    with_yarpserver,
)
from rtf.cli.network.yarp_device_checks import device_checks
from rtf.errors import RtfError
from rtf.middleware.errors import WaitTimeoutError
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.contact import Contact
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

#: Seconds after which a message is sent again.
_AGAIN = 2.0
#: A line of YARP's log, which goes to stdout, too.
_LOG = re.compile(r"\[(?:TRACE|DEBUG|INFO|WARNING|ERROR|FATAL)\] ?\|")
#: The width of the table where the output is no terminal.
_WIDTH = 160
_CARRIERS = ("tcp", "fast_tcp", "udp", "mcast", "text", "text_ack", "unix_stream")
#: The messages that are sent: values that the two versions encode differently, and others.
_MESSAGE = '[set] 3 1.5 (0.25 2.5 3.5) "two words" -7'


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
        deadline = clock.Deadline.after(PATIENCE)
        while not deadline.expired:  # the first datagrams of a multicast group may be lost
            _type(writer, _MESSAGE)
            with contextlib.suppress(WaitTimeoutError):
                _expect(reader.read(_AGAIN).to_text(), _MESSAGE, "what arrived")
                return ""
        raise CheckError(f"nothing arrived within {PATIENCE:g} s")


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
    thread.join(PATIENCE)
    if not lines:
        raise CheckError(f"it printed nothing within {PATIENCE:g} s")
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
        reply = client.call(Bottle(["get", 1.5]), timeout=PATIENCE)
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
            reader.wait(PATIENCE)
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
    yield from device_checks()


# The command -----------------------------------------------------------------------------------------------------


def yarp_check(words: Sequence[str]) -> ExitCode:
    """Check that ports of YARP and ours understand each other."""
    parser = make_parser(
        "yarp-check",
        "Try our ports, name server, tools and clients of devices against the 'yarp' that is installed, in both"
        " directions, on this machine alone. Prints a table; exits with 1 if something differs.",
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
    for title, make in (("our name server", with_our_server), ("yarpserver", with_yarpserver)):
        if make is with_yarpserver and shutil.which("yarpserver") is None:
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
    done = subprocess.run(["yarp", "version"], capture_output=True, text=True, timeout=PATIENCE, check=False)
    return (done.stdout or done.stderr).strip().removeprefix("YARP version").strip()


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
