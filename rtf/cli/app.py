"""``rtf app``: applications described by YARP's XML files, checked, started, watched and stopped."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import key_value, make_parser, seconds
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Sequence

    from rtf.applications.events import Event, Say
    from rtf.applications.links import Links
    from rtf.applications.manager import Manager
    from rtf.applications.xml.model import Application
    from rtf.applications.xml.reader import Loaded
    from rtf.cli.parser import Parser
    from rtf.middleware.ports.network import Network
    from rtf.testing.events import Diagnosed

#: Seconds for a manager that was asked to stop, and for what a killed one has left on this machine.
_STOPPING, GRACE = 120.0, 5.0


def _parser(word: str, description: str, example: str = "lab.xml") -> Parser:
    parser = make_parser(f"app {word}", description, f"rtf app {word} {example}")
    parser.add_argument("file", metavar="FILE", help="the application: its file, or the name of one that YARP finds")
    parser.add_argument(
        "--var", action="append", type=key_value, default=[], metavar="NAME=VALUE", help="a variable, over the file's"
    )
    return parser


def add_run_options(parser: Parser) -> None:
    """Add the options of commands that run applications: ``--log`` and ``--timeout``."""
    parser.add_argument(
        "--log", nargs="?", const="/yarplogger", metavar="/LOGGER", help="send the output of modules to the logger"
    )
    parser.add_argument(
        "--timeout", type=seconds, default=60.0, metavar="S", help="for ports without a timeout of their own (60)"
    )


def _load(options: argparse.Namespace) -> Loaded:
    from rtf.applications.xml.reader import find_application, read_application

    path = Path(options.file)
    if not path.exists():
        found = find_application(options.file, Path.cwd())
        if found is None:
            print(f"rtf app: there is no application {options.file}; 'rtf app list' shows those here", file=sys.stderr)
            raise SystemExit(int(ExitCode.USAGE))
        path = found
    return read_application(path, dict(options.var))


def _show(problems: Iterable[Diagnosed]) -> int:
    """Print problems to stderr, and return the number of errors."""
    found = [*problems]
    for one in found:
        print(one, file=sys.stderr)
    return sum(one.severity is Severity.ERROR for one in found)


def _sound(options: argparse.Namespace) -> Application:
    """Read an application. If its files have errors they are printed, and the command ends."""
    loaded = _load(options)
    if _show(loaded.diagnostics):
        raise SystemExit(int(ExitCode.USAGE))
    return loaded.application


# Without starting anything -----------------------------------------------------------------------------------------


def check(words: Sequence[str]) -> ExitCode:
    """Report all problems of an application; nothing is started."""
    from rtf.applications.check import check_application
    from rtf.testing.suite.diagnostics import DiagnosticLog

    parser = _parser("check", "Everything that is wrong in an application, before anything is started.")
    parser.add_argument("--strict", action="store_true", help="warnings count as errors")
    parser.add_argument("--offline", action="store_true", help="do not ask the network for nodes and external ports")
    options = parser.parse_args(words)
    loaded = _load(options)
    problems = DiagnosticLog()
    if not loaded.has_errors:
        network = None if options.offline else _network_if_there()
        for choice in check_application(loaded.application, problems, network):
            print(choice)
    found = [*loaded.diagnostics, *problems]
    errors = _show(found)
    warnings = len(found) - errors
    application = loaded.application
    size = f"{_counted(len(application.modules), 'module')}, {_counted(len(application.connections), 'connection')}"
    print(f"{size}: {_counted(errors, 'error')}, {_counted(warnings, 'warning')}")
    return ExitCode.USAGE if errors or (options.strict and warnings) else ExitCode.PASSED


def _network_if_there() -> Network | None:
    from rtf.cli.network.options import make_network
    from rtf.middleware.errors import MiddlewareError

    network = make_network(2.0)
    try:
        network.names.query("/root")
    except MiddlewareError as error:
        print(f"rtf app check: nodes and external ports are not looked at: {error}", file=sys.stderr)
        return None
    return network


def show(words: Sequence[str]) -> ExitCode:
    """Print an application as it would be run, or its file as it would be written."""
    from rtf.applications.placement import shown_node
    from rtf.applications.substitutions import substitute, table_of
    from rtf.applications.xml.descriptions import find_computers
    from rtf.applications.xml.tree import read_tree, to_bytes
    from rtf.testing.suite.diagnostics import DiagnosticLog

    parser = _parser("show", "An application as it would be run: with what it embeds, and its variables replaced.")
    parser.add_argument("--xml", action="store_true", help="print its file in order, with all that it has")
    options = parser.parse_args(words)
    application = _sound(options)
    if options.xml:
        print(to_bytes(read_tree(Path(application.file))).decode(), end="")
        return ExitCode.PASSED
    print(f"{application.name} {application.version}".rstrip())
    if application.description:
        print(f"  {application.description}")
    folder = Path(application.file).parent
    table, computers = table_of(folder), find_computers(folder, DiagnosticLog())
    for module in application.modules:
        print(f"module {module.command}  [{shown_node(module, computers)}]")
        for dependency in module.dependencies:
            print(f"  waits for {dependency.port}")
        if message := substitute(module, table).message:
            print(f"  {message}")
    for connection in application.connections:
        print(f"connection {connection}  [{connection.carrier}{' persist' if connection.persist else ''}]")
    return ExitCode.PASSED


def list_applications(words: Sequence[str]) -> ExitCode:
    """Print the applications of files and folders, a line each."""
    from rtf.applications.xml.reader import name_in
    from rtf.resources import ResourceFinder
    from rtf.resources.finder import Policy

    parser = make_parser("app list", "The applications of files and folders.", "rtf app list\nrtf app list lab/")
    help_ = "files and folders (default: the current one, and the folders 'applications' where YARP looks)"
    parser.add_argument("places", nargs="*", type=Path, metavar="FILE|FOLDER", help=help_)
    places = parser.parse_args(words).places
    if not places:
        found = ResourceFinder().search("applications", policy=Policy.ALL, directory=True)
        places = [Path(), *found.paths]
    files = [file for place in places for file in (sorted(place.glob("*.xml")) if place.is_dir() else [place])]
    listed = [(name, file) for file in files if (name := name_in(file))]
    width = max((len(name) for name, _ in listed), default=0)
    for name, file in listed:
        print(f"{name:<{width}}  {file}")
    if not listed:
        print(f"rtf app list: there is no application in {', '.join(map(str, places))}", file=sys.stderr)
    return ExitCode.PASSED if listed else ExitCode.FAILURES


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


# With the network --------------------------------------------------------------------------------------------------


def session_path(application: Application, folder: str = "apps") -> Path:
    """Return the file of an application's session, or in another ``folder`` that of its node."""
    import platformdirs

    from rtf.applications.run.record import record_path
    from rtf.middleware.naming.configuration import read_place

    place = read_place()
    state = platformdirs.user_state_path("rtf", appauthor=False) / folder
    return record_path(state, f"app_{application.name}", str(place.contact) if place else "")


def make_manager(
    application: Application,
    said: Say | None = None,
    *,
    hold: bool = False,
    log: str | None = None,
    patience: float | None = None,
    attached: bool = False,
) -> Manager:
    """Return a manager with the node of this machine, or ``attached`` to that of the process that runs it.

    What happens is printed, or given to ``said``.
    """
    import re
    import socket

    from rtf.applications.deployer import DeployerContext
    from rtf.applications.events import Event, Kind
    from rtf.applications.manager import PATIENCE, Manager
    from rtf.applications.run.record import NodeRecord
    from rtf.cli.network.options import make_network
    from rtf.middleware.naming.configuration import find_network

    report = said or _print_event
    word = re.sub(r"[^0-9A-Za-z._-]", "_", application.name)
    context = DeployerContext(
        make_network(),
        find_network({**os.environ, "YARP_IP": "127.0.0.1"}),
        f"/app/{word}/{socket.gethostname()}",
        lambda: NodeRecord(session_path(application, "nodes")),
        hold=hold,
        log=log,
        attached=attached,
        report=lambda text: report(Event(Kind.FOUND, text)),
    )
    return Manager(application, context, report, patience=PATIENCE if patience is None else patience)


def _print_event(event: Event) -> None:
    from rtf.applications.events import Kind

    _say(event.text, wrong=event.kind in (Kind.FAILED, Kind.LOST))


def _say(text: str, *, wrong: bool = False) -> None:
    """Print a line, from any thread. That nobody reads it any more is no reason to end programs."""
    from rtf.cli.network.terminal import complain, say

    with _saying, suppress(BrokenPipeError):
        (complain if wrong else say)(text)


_saying = threading.Lock()


def run(words: Sequence[str]) -> int:
    """Run an application until its modules have ended, or a signal comes; returns the exit code."""
    from rtf.cli.network.terminal import run_to_its_end

    parser = _parser(
        "run",
        "Start the modules of an application, connect their ports, and watch both until all modules have ended. The"
        " first SIGINT or SIGTERM stops the modules in reverse, and so does the end of this command however it comes.",
        "lab.xml --var robot=icubSim\nrtf app run lab.xml --detach; rtf app status lab.xml; rtf app stop lab.xml",
    )
    parser.add_argument("--detach", action="store_true", help="leave when all is up; the modules run on")
    add_run_options(parser)
    options = parser.parse_args(words)
    application = _sound(options)
    if not options.detach:
        from rtf.applications.run.keeper import fork_server

        code = fork_server(GRACE)
        if code is not None:
            return run_to_its_end("rtf app run", lambda _: clean_up(application, code), words)
    return run_to_its_end("rtf app run", lambda _: _run(application, options), words)


def _run(application: Application, options: argparse.Namespace) -> int:
    from rtf.applications.session import Session
    from rtf.cli.network.terminal import opened

    make = partial(make_manager, application, hold=options.detach, log=options.log, patience=options.timeout)
    with Session(session_path(application)), opened(make) as manager:

        def run_watched() -> bool:
            if not manager.start():
                return False
            _say(f"{application.name} is up")
            return options.detach or manager.watch()

        good, interrupted = _until_interrupted(manager, run_watched)
        if options.detach and good and not interrupted:
            _say(f"{application.name} runs on; 'rtf app stop {options.file}' stops it")
            return ExitCode.PASSED
        return ExitCode.PASSED if _stop(manager) and good else ExitCode.FAILURES


def _until_interrupted(manager: Manager, work: Callable[[], bool]) -> tuple[bool, bool]:
    """Do something in a thread, as this one waits for signals. Return whether all is well, and if a signal came."""
    from rtf.cli.network.terminal import Bell

    bell, done, interrupted = Bell(), [False], False

    def do() -> None:
        try:
            done[0] = work()
        finally:
            bell.ring()

    thread = threading.Thread(target=do, name="rtf-app-run")
    thread.start()
    try:
        bell.wait()
    except KeyboardInterrupt:
        interrupted = True
        _say(f"{manager.application.name} is being stopped")
    manager.interrupt()
    thread.join()
    return all(unit.good for unit in manager.units) if interrupted else done[0], interrupted


def _stop(manager: Manager, *, kill: bool = False) -> bool:
    manager.links.disconnect()
    return manager.stop(kill=kill)


def clean_up(application: Application, code: int) -> int:
    """Stop what a manager has left on nodes that was killed. In its parent process, which has ended what was here."""
    from rtf.applications.errors import TakenError
    from rtf.applications.session import Session
    from rtf.cli.network.terminal import opened

    try:
        session = Session(session_path(application))
    except TakenError:  # another process cares for the application already
        return code
    with session:
        if session.unfinished:
            _say(f"the manager of {application.name} was killed; what it has left is stopped", wrong=True)
            with opened(partial(make_manager, application)) as manager:
                _stop(manager)
    return code


def stop(words: Sequence[str]) -> ExitCode:
    """Stop an application: its manager, if there is one, and its modules."""
    return _end(
        "stop", "Stop the modules of an application in reverse, also those that another manager has started.", words
    )


def kill(words: Sequence[str]) -> ExitCode:
    """Kill the modules of an application, and its manager if there is one."""
    return _end("kill", "Kill the modules of an application, also those that another manager has started.", words)


def _end(word: str, description: str, words: Sequence[str]) -> ExitCode:
    from rtf.applications.errors import TakenError
    from rtf.applications.session import Session, await_session
    from rtf.cli.network.terminal import opened, say
    from rtf.testing.isolation.processes import signal_process

    options = _parser(word, description).parse_args(words)
    application = _sound(options)
    path = session_path(application)
    try:
        session = Session(path)
    except TakenError as taken:
        say(f"process {taken.pid} runs {application.name}, and is asked to stop it")
        if taken.pid:  # else it has just begun, or is about to end
            signal_process(taken.pid, signal.SIGKILL if word == "kill" else signal.SIGTERM)
        session = await_session(path, _STOPPING)
    with session, opened(partial(make_manager, application)) as manager:
        return ExitCode.PASSED if _stop(manager, kill=word == "kill") else ExitCode.FAILURES


def connect(words: Sequence[str]) -> ExitCode:
    """Make the connections of an application."""
    options = _parser("connect", "Make the connections of an application whose ports are open.").parse_args(words)
    application = _sound(options)
    return ExitCode.PASSED if _links(application).connect() else ExitCode.FAILURES


def disconnect(words: Sequence[str]) -> ExitCode:
    """End the connections of an application."""
    options = _parser("disconnect", "End the connections of an application.").parse_args(words)
    application = _sound(options)
    return ExitCode.PASSED if _links(application).disconnect() else ExitCode.FAILURES


def _links(application: Application) -> Links:
    from rtf.applications.links import Links
    from rtf.cli.network.options import make_network

    return Links(application.connections, make_network(), _print_event)


def status(words: Sequence[str]) -> ExitCode:
    """Print how the modules and connections of an application are."""
    from rtf.applications.connections import Link
    from rtf.applications.errors import TakenError
    from rtf.applications.events import State
    from rtf.applications.session import Session
    from rtf.cli.network.terminal import opened, say

    options = _parser("status", "How the modules and connections of an application are.").parse_args(words)
    application = _sound(options)
    with ExitStack() as stack:
        try:
            stack.enter_context(Session(session_path(application)))
            attached = False
        except TakenError:
            attached = True
        manager = stack.enter_context(opened(partial(make_manager, application, attached=attached)))
        manager.look()
        connected = manager.links.states()
    for unit in manager.units:
        pid = f" ({unit.pid})" if unit.state is State.RUNNING else ""
        reason = f": {unit.reason}" if unit.reason else ""
        say(f"{unit.state:<12} {unit.module}{pid}{reason}")
    for connection, state in connected:
        say(f"{state:<12} {connection}")
    fine = all(unit.up for unit in manager.units) and all(state is Link.CONNECTED for _, state in connected)
    return ExitCode.PASSED if fine else ExitCode.FAILURES
