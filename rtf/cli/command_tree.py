"""The tree of all commands, how a command is found in it, and the exit codes that all of them share.

A command is a function of its words that returns an exit code; its module is imported when it is run.
"""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import rtf
from rtf.errors import RtfError, did_you_mean
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

EXIT_CODES = """\
exit codes of all commands:
  0 passed, done, or yes   1 failures, not done, or no   2 interrupted   3 internal error, or no standard output
  4 usage or suite file    5 nothing ran                 6 a fixture is not usable (the rig is broken, not the robot)
"""
_HELP = ("-?", "-h", "--help")


@dataclass(frozen=True, slots=True)
class Command:
    """A command: its name, its usage and purpose for the help, its function as ``module:function``, and what is below.

    Without ``home`` it has only commands below. A command ``on_network`` talks to ports, see
    :mod:`rtf.cli.network.terminal`.
    """

    name: str
    usage: str
    summary: str
    home: str = ""
    commands: tuple[Command, ...] = ()
    group: str = ""
    on_network: bool = False

    def find(self, words: Sequence[str]) -> tuple[Command, list[str], list[str]]:
        """Return the command that these words begin with, the names on the way to it, and the words that are left."""
        for command in self.commands:
            if words and words[0] == command.name:
                found, names, rest = command.find(words[1:])
                return found, [self.name, *names], rest
        return self, [self.name], [*words]

    def leaves(self, *above: str) -> Iterator[tuple[tuple[str, ...], Command]]:
        """Yield all commands with a function, each with the words that lead to it."""
        if self.home:
            yield above, self
        for command in self.commands:
            yield from command.leaves(*above, command.name)

    def load(self) -> Callable[[Sequence[str]], int]:
        """Import the function of the command."""
        module, _, function = self.home.partition(":")
        loaded: Callable[[Sequence[str]], int] = getattr(import_module(module), function)
        return loaded

    def listing(self) -> str:
        """Return the commands below, a line each, under the headings of their groups."""
        lines: list[str] = []
        group = ""
        for command in self.commands:
            if command.group != group:
                group = command.group
                lines += ["", f"{group}:"]
            lines.append(f"  {f'{command.name} {command.usage}':<24} {command.summary}".rstrip())
        return "\n".join(lines).strip("\n")


_TESTS = "tests (the first six are commands of testrunner, too)"
_BESIDE_RUNNING = (
    Command("describe", "[NAME]", "what tests and fixtures there are, and are for", "rtf.cli.describe:describe"),
    Command("validate", "[SUITE ...]", "what is wrong in suite files; nothing moves", "rtf.cli.check_plan:validate"),
    Command("report", "RUN ...", "write reports of a run that is over", "rtf.cli.commands:report"),
    Command("page", "RUN", "serve the page of a run that is over, or still going on", "rtf.cli.page:page"),
    Command("history", "[NAME ...]", "trends of tests and measurements over the runs", "rtf.cli.history:history"),
    Command("where", "[FILE]", "where a parameter file is found; alone: the name server", "rtf.cli.commands:where"),
)
TESTRUNNER = Command(
    "testrunner", "[SUITE ...]", "run suites and tests", "rtf.cli.run_command:run", commands=_BESIDE_RUNNING
)


def _network(name: str, usage: str, summary: str, home: str) -> Command:
    return Command(name, usage, summary, f"rtf.cli.network.{home}", group="network", on_network=True)


_NETWORK = (
    _network("nameserver", "", "keep the names of a network's ports", "name_server:nameserver"),
    _network("list", "[/PREFIX]", "the ports of the network, and which of them answer", "ports:list_ports"),
    _network("top", "[/PREFIX]", "rates, bandwidth and latency of ports and connections", "ports:top"),
    _network("read", "/PORT ...", "open a port and print what comes to it", "read_write:read"),
    _network("write", "/PORT ...", "open a port and send it the lines that are typed", "read_write:write"),
    _network("rpc", "/PORT ...", "put questions to a port and print the answers", "rpc:rpc"),
    _network("yarp-check", "", "our ports against the 'yarp' that is installed", "yarp_check:yarp_check"),
    _network("rpcserver", "/PORT", "open a port and type the answers to its questions", "rpc:rpcserver"),
    _network("admin", "/PORT ...", "put questions of administration to a port", "rpc:admin"),
    _network("connect", "/FROM /TO", "have a port send to another one", "connect:connect"),
    _network("disconnect", "/FROM /TO", "end that again", "connect:disconnect"),
    _network("exists", "/PORT [/TO]", "whether a port answers, or two are connected", "exists:exists"),
    _network("wait", "/PORT [/TO]", "wait until a port answers, or two are connected", "exists:wait"),
    _network("ping", "/PORT", "connections of a port, and how fast it answers", "exists:ping"),
    _network("terminate", "/PORT", "ask the program of a port to end", "exists:terminate"),
    _network("record", "/PORT ...", "record what ports send: yarpdatadumper's folders, MCAP", "recording:record"),
    _network("play", "FOLDER|FILE", "send what was recorded, at its times", "recording:play"),
    _network("logger", "", "store what the programs of the network log", "logs:logger"),
    _network("log", "", "show what was logged, and follow it", "logs:log"),
    _network("name", "WORD ...", "give the name server a command", "name_server:name"),
    _network("clean", "", "forget the names of ports that are gone", "name_server:clean"),
    _network("conf", "[HOST PORT]", "the file that says where the name server is", "name_server:conf"),
    _network("detect", "", "look for a name server", "name_server:detect"),
    _network("namespace", "[/NAME]", "the name of the name server", "name_server:namespace"),
)
_SIMULATOR = (
    Command("faults", "[KIND]", "the kinds of faults", "rtf.cli.simulator:faults"),
    Command("status", "", "the state of a simulator, and its faults", "rtf.cli.simulator:status"),
    Command("inject", "KIND [TARGET]", "inject a fault", "rtf.cli.simulator:inject"),
    Command("clear", "[NUMBER]", "clear this fault, or all faults", "rtf.cli.simulator:clear"),
)
_ROBOT = (
    Command("list", "", "the robots that can be tested", "rtf.cli.robot:list_robots"),
    Command("check", "ROBOT", "its joints and drives, and what is wrong or assumed", "rtf.cli.robot:check_robot"),
    Command("new", "FILE.urdf|.xml", "a draft for a new robot", "rtf.cli.robot:new_robot"),
    Command("test", "ROBOT", "the suites for any robot, on a simulated one", "rtf.cli.robot:test_robot"),
)


def _app(name: str, summary: str, *, on_network: bool = True) -> Command:
    return Command(name, "FILE", summary, f"rtf.cli.app:{name}", on_network=on_network)


_APP = (
    _app("check", "what is wrong in it; nothing is started"),
    _app("show", "what would be run", on_network=False),
    _app("run", "start it, connect its ports, watch, and stop it", on_network=False),
    _app("stop", "stop its modules in reverse"),
    _app("kill", "kill its modules"),
    _app("connect", "make its connections"),
    _app("disconnect", "end its connections"),
    _app("status", "how its modules and connections are"),
    Command("list", "[FOLDER ...]", "those in files and folders", "rtf.cli.app:list_applications"),
    Command("page", "FILE ...", "run, watch and build them in a browser", "rtf.cli.app_page:page"),
)


def _can(name: str, usage: str, summary: str, home: str) -> Command:
    return Command(name, usage, summary, f"rtf.cli.can.{home}", on_network=True)


_CAN = (
    _can("scan", "", "the boards that answer: addresses, types, firmware", "boards:scan"),
    _can("monitor", "", "the messages on a bus, by name, with rates", "watching:monitor"),
    _can("load", "", "the load of a bus, by identifier", "watching:load"),
    _can("log", "FILE", "record a bus", "files:log"),
    _can("replay", "FILE", "send what was recorded", "files:replay"),
    _can("get", "BOARD NAME", "ask a board for a parameter", "boards:get"),
    _can("set", "BOARD NAME ...", "set a parameter of a board", "boards:set_parameter"),
    _can("dbc", "[FILE]", "a DBC file of the messages, for other tools", "files:dbc"),
    _can("messages", "", "all messages, in Markdown", "files:messages"),
)
_RED_BALL = (
    Command("track", "", "find it in the pictures of the eyes", "rtf.cli.red_ball:track"),
    Command("demo", "", "look at it and reach for it, on request", "rtf.cli.red_ball:demo"),
)
_CARTESIAN = (
    Command("control", "LIMB", "the controller of a robot in the network", "rtf.cli.cartesian:control"),
    Command("solver", "LIMB", "a solver, for this controller or that of the iCub", "rtf.cli.cartesian:solver"),
)
_CAMPAIGN = (
    Command("run", "FILE", "run it, or go on with it", "rtf.cli.campaign:run"),
    Command("plan", "FILE", "how many runs, how long, how much disk", "rtf.cli.campaign:plan"),
    Command("status", "FILE", "how far it is", "rtf.cli.campaign:status"),
    Command("certs", "FOLDER", "key and certificate of a cluster", "rtf.cli.campaign:certs"),
    Command("report", "FILE", "what the runs teach: a page and tables", "rtf.cli.campaign_report:report"),
    Command("compare", "FILE FILE", "what differs between two campaigns", "rtf.cli.campaign_report:compare"),
)
_IDL = (
    Command("check", "FILE", "what is in it, or what is wrong", "rtf.cli.idl:check"),
    Command("py", "FILE", "a Python module of its messages and services", "rtf.cli.idl:py"),
    Command("md", "FILE", "its documentation as Markdown", "rtf.cli.idl:md"),
    Command("html", "FILE", "its documentation as a page", "rtf.cli.idl:html"),
)
#: Runs suites; with --server or --on programs on other machines, as YARP's command of this name does.
_RUN = "rtf.cli.run_node:run"
RTF = Command(
    "rtf",
    "COMMAND ...",
    "the tools of the framework",
    commands=(
        *(Command(one.name, one.usage, one.summary, one.home, group=_TESTS) for one in _BESIDE_RUNNING),
        Command("run", "[SUITE ...]", "run suites and tests: the same as testrunner", _RUN, group=_TESTS),
        Command("new", "KIND NAME", "write a new test, fixture, suite or robot", "rtf.cli.new:new", group=_TESTS),
        Command("proof", "", "run robot tests on the faults they should find", "rtf.cli.proof:proof", group=_TESTS),
        Command(
            "campaign",
            "FILE",
            "many runs over robots, faults and seeds",
            "rtf.cli.campaign:run",
            commands=_CAMPAIGN,
            group=_TESTS,
        ),
        Command("demo", "", "run the demonstration and check every verdict", "rtf.cli.demo:demo", group=_TESTS),
        *_NETWORK,
        Command("idl", "COMMAND", "interface files: check, Python, documentation", commands=_IDL, group="network"),
        Command("app", "COMMAND", "applications: check, run, stop, status …", commands=_APP, group="network"),
        Command(
            "robotinterface",
            "--config FILE",
            "start a robot from its configuration, and end it in order",
            "rtf.cli.robotinterface:robotinterface",
            group="robot",
        ),
        Command(
            "simulator",
            "",
            "start a simulated robot, and break it on purpose",
            "rtf.cli.simulator:simulator",
            commands=_SIMULATOR,
            group="robot",
        ),
        Command("can", "COMMAND", "CAN buses: scan, monitor, log, get, set …", commands=_CAN, group="robot"),
        Command(
            "can-boards",
            "",
            "run the emulated boards of a robot on CAN buses",
            "rtf.cli.can_boards:can_boards",
            group="robot",
        ),
        Command("robot", "COMMAND", "robots as data: list, check, new, test", commands=_ROBOT, group="robot"),
        Command(
            "cartesian",
            "COMMAND",
            "move the hand of a robot in space: controller, solver",
            commands=_CARTESIAN,
            group="robot",
        ),
        Command("gaze", "", "turn neck and eyes of a robot to a point", "rtf.cli.gaze:gaze", group="robot"),
        Command(
            "red-ball", "COMMAND", "see a red ball, look at it and reach for it", commands=_RED_BALL, group="robot"
        ),
        Command(
            "ros1",
            "--parts A,B",
            "publish a robot on topics of ROS 1: joint states, pictures, forces",
            "rtf.cli.ros1:ros1",
            group="robot",
        ),
        Command(
            "ros2",
            "--parts A,B",
            "publish a robot on topics of ROS 2: joint states, pictures, forces",
            "rtf.cli.ros2:ros2",
            group="robot",
        ),
        Command("version", "", "the version of the framework", "rtf.cli.commands:version", group="other"),
    ),
)


class SurroundingsError(RtfError):
    """The process lacks something that every command needs: a standard output, or a working folder."""


def main(root: Command, arguments: Sequence[str] | None = None) -> int:
    """Run a command of a tree; returns the exit code. Without arguments those of the process, which then ends."""
    code = _run_guarded(root, sys.argv[1:] if arguments is None else arguments)
    if arguments is None:  # the exit code is settled, and nothing is left that could be interrupted
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if code == ExitCode.INTERRUPTED:
            # An interrupt that strikes code made by exec(), as dataclasses are, makes Python die of SIGINT at its end.
            sys.stderr.flush()
            os._exit(code)
    return code


def _run_guarded(root: Command, words: Sequence[str]) -> int:
    program = root.name
    try:
        try:
            _check_surroundings()
            command, names, rest = root.find(words)
            program = " ".join(names)
            return _run(command, program, rest)
        finally:
            sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 - 1, Python's own exit code, would mean failures
        return int(_report_error(program, error))


def _run(command: Command, program: str, words: Sequence[str]) -> int:
    if "YARP_FORWARD_LOG_ENABLE" in os.environ and command.name != "logger":  # which would forward to itself
        from rtf.logs import forward_if_enabled

        forward_if_enabled(program)
    if command.home and not command.on_network:
        return int(command.load()(words))
    if command.home:
        from rtf.cli.network.terminal import run_to_its_end

        return run_to_its_end(program, command.load(), words)
    if words and words[0] in _HELP:
        print(f"usage: {program} {command.usage}\n\n{command.listing()}\n\n{EXIT_CODES}\nEach has its own --help.")
        return int(ExitCode.PASSED)
    if words and words[0] == "--version":
        print(f"{program} version {rtf.__version__}")
        return int(ExitCode.PASSED)
    if words:
        hint = did_you_mean(words[0], [one.name for one in command.commands])
        print(f"{program}: there is no {words[0]!r}{hint}", file=sys.stderr)
    else:
        print(f"usage: {program} {command.usage}\n\n{command.listing()}", file=sys.stderr)
    print(f"Try '{program} --help'.", file=sys.stderr)
    return int(ExitCode.USAGE)


def _report_error(program: str, error: BaseException) -> ExitCode:
    """Report what ended a command, and return the exit code."""
    if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):  # a class was being made
        print(f"{program}: interrupted", file=sys.stderr)
        return ExitCode.INTERRUPTED
    if isinstance(error, RtfError):
        print(f"{program}: {error}", file=sys.stderr)
        return ExitCode.INTERNAL if isinstance(error, SurroundingsError) else ExitCode.USAGE
    if isinstance(error, OSError):
        if not isinstance(error, BrokenPipeError):  # whose reader has enough
            print(f"{program}: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Python flushes once more at its end, and must not complain
    else:
        import traceback

        traceback.print_exception(error)
    return ExitCode.INTERNAL


def _check_surroundings() -> None:
    """Check that the standard streams are open, so that no file takes their numbers, and that there is a folder."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stdin is None:
        sys.stdin = open(0, closefd=False)  # noqa: SIM115 - for as long as the process lives
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
    if sys.stdout is None:
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        raise SurroundingsError("the standard output is closed; send it to a file, or to /dev/null")
    try:
        os.getcwd()  # noqa: PTH109 - an object is not needed
    except OSError as error:
        raise SurroundingsError(f"the working folder cannot be used: {error.strerror}; change to another one") from None
