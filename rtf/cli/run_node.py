"""``rtf run --server`` and ``rtf run --on``: the node of programs and its client, with the options of ``yarprun``.

``rtf run`` without either runs suites and tests, as ``testrunner`` does.
"""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from rtf.cli.parser import UsageError, count, make_parser, seconds
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rtf.applications.run.client import RunClient
    from rtf.cli.parser import Parser

_SERVER, _CLIENT, _TERMINAL = "--server", "--on", "--terminal"
_HELP = ("--help", "-h", "-?")


def run(words: Sequence[str]) -> int:
    """Run a node, ask one, or run suites; returns the exit code."""
    options = {word.partition("=")[0] for word in words}
    helped = options & {*_HELP}
    if _SERVER in options:
        return _run_server(words if not helped else _HELP[:1])
    if _CLIENT in options:
        words = words if not helped else _HELP[:1]
        from rtf.cli.network.terminal import run_to_its_end

        return run_to_its_end("rtf run", _ask, words)
    if _TERMINAL in options:
        from rtf.cli.network.terminal import run_to_its_end
        from rtf.cli.run_terminal import terminal

        return run_to_its_end("rtf run", terminal, words)
    from rtf.cli.run_command import run as run_suites

    if helped:
        print("Programs on other machines: 'rtf run --server --help' and 'rtf run --on --help'. Suites and tests:\n")
    return run_suites(words)


# The node --------------------------------------------------------------------------------------------------------


def _run_server(words: Sequence[str]) -> int:
    from rtf.applications.run.keeper import fork_server
    from rtf.cli.network.terminal import run_to_its_end

    options = _server_parser().parse_args(words)
    code = fork_server(options.grace)
    if code is not None:
        return code
    return run_to_its_end("rtf run", lambda _: _serve(options), words)


def _server_parser() -> Parser:
    from rtf.cli.network.options import own_name

    parser = make_parser(
        "run --server",
        "Be a node: start, list, signal and end programs of this machine for those who ask, as 'yarprun --server'. It"
        " ends them when it ends, except held ones. Without --ip and --allow only this machine can ask.",
        "rtf run --server /pc104\n"
        "rtf run --server /pc104 --ip 10.0.0.2 --allow 10.0.0.0/24 --allow-program /opt/robot/bin",
    )
    parser.add_argument(_SERVER, type=own_name, required=True, metavar="/NODE", help="the name of the node")
    parser.add_argument(
        "--log", nargs="?", const="/yarplogger", metavar="/LOGGER", help="send the output of all programs to the logger"
    )
    parser.add_argument("--ip", default="127.0.0.1", metavar="ADDRESS", help="serve at this address (127.0.0.1)")
    for option, metavar, text in (
        ("--allow", "ADDRESS", "who may ask, such as 10.0.0.7 or 10.0.0.0/24 (default: this machine)"),
        ("--allow-program", "NAME|FOLDER", "what may be started: a program on PATH, or all of a folder (default: all)"),
        ("--allow-variable", "NAME", "what requests may set for allowed programs, such as 'ROBOT_*'"),
    ):
        parser.add_argument(option, action="append", default=[], metavar=metavar, help=f"{text}; may be repeated")
    parser.add_argument("--limit", type=count, default=256, metavar="N", help="programs at a time (256)")
    parser.add_argument("--grace", type=seconds, default=5, metavar="S", help="from SIGTERM to SIGKILL at its end (5)")
    return parser


def _serve(options: argparse.Namespace) -> ExitCode:
    import platformdirs

    from rtf.applications.run.access import RunAccess
    from rtf.applications.run.record import NodeRecord, record_path
    from rtf.applications.run.server import RunServer
    from rtf.cli.network.terminal import Bell, opened, report, say
    from rtf.middleware.naming.configuration import find_network, read_place
    from rtf.middleware.ports.access import Access

    access = RunAccess.parse(options.allow, options.allow_program, options.allow_variable)
    network = find_network({**os.environ, "YARP_IP": options.ip})
    network.report = report
    if options.allow:
        network.admins = Access.parse(options.allow)
    place = read_place()
    folder = platformdirs.user_state_path("rtf", appauthor=False) / "nodes"
    record = NodeRecord(record_path(folder, options.server, str(place.contact) if place else ""))
    bell, lock = Bell(), threading.Lock()

    def line(text: str) -> None:
        with lock, suppress(BrokenPipeError):  # the reader of the output is gone; the programs are still needed
            say(text)

    make = partial(
        RunServer,
        options.server,
        network=network,
        access=access,
        log=options.log,
        said=line,
        most=options.limit,
        grace=options.grace,
        record=record,
        on_exit=bell.ring,
    )
    with suppress(KeyboardInterrupt), opened(make) as server:
        line(f"Node {server.name} is available at {server.address}")
        bell.wait()
    return ExitCode.PASSED


# The client ------------------------------------------------------------------------------------------------------


def _ask(words: Sequence[str]) -> ExitCode:
    from rtf.applications.run.client import RunClient
    from rtf.cli.network.options import make_network

    parser = _client_parser()
    options = parser.parse_args(words)
    if options.cmd and not options.tag:
        parser.error("--cmd needs a tag by which the program is found again: --as TAG")
    client = RunClient(options.on, network=make_network(), timeout=options.timeout)
    return _start(client, options) if options.cmd else _request(client, options)


def _client_parser() -> Parser:
    from rtf.applications.run.client import TIMEOUT
    from rtf.cli.network.options import add_timeout, contact

    parser = make_parser(
        "run --on",
        "Ask a node, one of 'rtf run --server' or of yarprun: start a program there, or see and end those that run.",
        'rtf run --on /pc104 --as arm --cmd "yarpdev --from arm.ini" --env "A=1;B=2"\n'
        "rtf run --on /pc104 --ps\nrtf run --on /pc104 --kill arm TERM",
    )
    parser.add_argument(_CLIENT, type=contact, required=True, metavar="/NODE", help="the node")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--cmd", nargs="+", metavar="WORD", help="start this; quote it if it has options")
    what.add_argument("--ps", action="store_true", help="list the programs that run")
    what.add_argument("--isrunning", metavar="TAG", help="whether a program runs")
    what.add_argument("--kill", nargs=2, metavar=("TAG", "SIGNAL"), help="send a signal, such as 15 or TERM")
    what.add_argument("--sigterm", metavar="TAG", help="ask a program to end")
    what.add_argument("--sigtermall", action="store_true", help="ask all programs to end")
    what.add_argument("--which", metavar="PROGRAM", help="where a program is")
    what.add_argument("--sysinfo", action="store_true", help="the figures of the machine")
    what.add_argument("--exit", action="store_true", help="end the node")
    parser.add_argument("--as", dest="tag", default="", metavar="TAG", help="the name of the program from now on")
    parser.add_argument("--workdir", default="", metavar="FOLDER", help="run it there")
    parser.add_argument("--env", default="", metavar="'A=1;B=2'", help="variables of its environment")
    parser.add_argument("--stdio", default="", metavar="/NODE", help="have this node open a terminal for it")
    parser.add_argument("--geometry", default="", metavar="WxH+X+Y", help="the window of the terminal")
    parser.add_argument("--hold", action="store_true", help="let it outlive the node, of ours; the next one finds it")
    parser.add_argument("--log", nargs="?", const="", metavar="/LOGGER", help="send its output to the logger")
    add_timeout(parser, TIMEOUT, "how long the node may take to answer")
    return parser


def _start(client: RunClient, options: argparse.Namespace) -> ExitCode:
    from rtf.applications.run.protocol import Start, join_words
    from rtf.bottle import to_string
    from rtf.cli.network.terminal import complain, say

    command = options.cmd[0] if len(options.cmd) == 1 else join_words(options.cmd)
    reply = client.start(
        Start(
            options.tag,
            command,
            client.name if options.stdio else "",
            options.workdir,
            options.env,
            options.stdio,
            options.hold,
            options.log,
            options.geometry,
        )
    )
    if reply.pid <= 0:
        complain(reply.text.rstrip())
        return ExitCode.FAILURES
    say(reply.text.rstrip())
    for value in reply.terminal:
        say(to_string(value).rstrip())  # type: ignore[arg-type]  # elements of a bottle
    return ExitCode.PASSED


def _request(client: RunClient, options: argparse.Namespace) -> ExitCode:
    from rtf.bottle import Bottle
    from rtf.cli.network.terminal import say

    if options.kill:
        tag, signum = options.kill
        return _report_outcome("kill", done=client.kill(tag, _signal(signum)))
    if options.sigterm:
        return _report_outcome("sigterm", done=client.terminate(options.sigterm))
    if options.isrunning:
        runs = client.is_running(options.isrunning)
        say("running" if runs else "not running")
        return ExitCode.PASSED if runs else ExitCode.FAILURES
    if options.ps:
        for row in client.running():
            say(Bottle(row.to_list()).to_text())
    elif options.which:
        say(client.which(options.which))
    elif options.sysinfo:
        found = client.system_info()
        for name in found.__slots__:
            say(f"{name.replace('_', ' '):<14} {getattr(found, name)}".rstrip())
    elif options.exit:
        client.exit()
        say("exit OK")
    else:
        client.terminate_all()
        say("sigtermall OK")
    return ExitCode.PASSED


def _report_outcome(what: str, *, done: bool) -> ExitCode:
    from rtf.cli.network.terminal import say

    say(f"{what} {'OK' if done else 'FAILED'}")
    return ExitCode.PASSED if done else ExitCode.FAILURES


def _signal(text: str) -> int:
    """Read a signal: its number, or its name with or without SIG."""
    if text.isdecimal():
        return int(text)
    name = text.upper()
    try:
        return signal.Signals[name if name.startswith("SIG") else f"SIG{name}"]
    except KeyError:
        raise UsageError(f"{text!r} is no signal; write a number, or a name such as TERM") from None
