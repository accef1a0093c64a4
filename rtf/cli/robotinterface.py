"""``rtf robotinterface``: start a robot from its configuration. It takes the options of yarprobotinterface."""

from __future__ import annotations

import io
import os
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import as_string
from rtf.cli.parser import Parser, add_dialect, seconds
from rtf.errors import RtfError
from rtf.resources import ResourceFinder, parse_arguments
from rtf.robot.interface.log import Level
from rtf.robot.interface.program import FINE, WRONG, ConsoleLog
from rtf.robot.interface.robot_reader import ReadResult, read_robot
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rtf.bottle import Property

_EPILOG = """\
what happens:
  startup      the devices are opened in the order of the file, then the actions of the phase startup are done, level by
               level; those that calibrate or park go on at the same time, the next level waits for them
  run          it is ready; nothing is done until a signal comes, or the port is asked to quit
  interrupt1   the first SIGINT, SIGTERM or SIGHUP, or quit: calibrators at work are aborted, the actions are done
  interrupt2   the second signal, interrupt3 the third: likewise, and what moves is not waited for
  shutdown     its actions are done, and the devices are closed in reverse order
A device that throws or hangs is named, with its place in the file; the others are still parked, detached and closed.

examples:
  rtf robotinterface --config icub_all.xml
  rtf robotinterface --config icub_all.xml --dry-run --svg plan.svg   # what would be done; nothing is opened
  rtf robotinterface --config icub_all.xml --portprefix /icubSim --enable_tags "(left_arm torso)"
  rtf robotinterface --config icub_all.xml --speed 20                 # for parameters with extern-name="speed"
  rtf rpc /icub/yarprobotinterface is_ready                           # get_phase, get_level, get_robot, quit, help

exit codes:
  0 all was done   1 the startup or an action failed   2 interrupted before anything was opened
  4 usage, or the files are wrong
"""


def robotinterface(words: Sequence[str]) -> int:
    """Run a robot, or draw its actions; returns the exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")  # whatever the locale
    options, others = _parser().parse_known_args(words)
    if options.svg is not None and not options.dry_run:
        _parser().error("--svg draws what would be done; it goes with --dry-run")
    log = ConsoleLog(verbose=options.verbose)
    try:
        given = _given(words, others)
        path = _file(words)
        reading = read_robot(path, given, allow_deprecated_dtd=options.allow_deprecated_dtd)
    except RtfError as error:
        for line in str(error).splitlines():
            log(Level.ERROR, line)
        return WRONG
    _warn(reading, others, log)
    if options.dry_run:
        return _draw(reading, options.svg, log)
    return _run(reading, options, log)


def _parser() -> Parser:
    from rtf.cli.network.options import add_access

    parser = Parser(
        prog="rtf robotinterface",
        usage="rtf robotinterface --config ROBOT.xml [options] [--KEY VALUE ...]",
        description="Start a robot from its configuration: open its devices, attach and calibrate them, run, and end in"
        " order.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--config",
        metavar="ROBOT.xml",
        help="the file, looked for where YARP looks, then among the robots of RTF, such as icubSim/icubSim.xml "
        "(default: what yarprobotinterface.ini says)",
    )
    parser.add_argument("--dry-run", "--dryrun", action="store_true", help="print what would be done, open nothing")
    parser.add_argument("--svg", metavar="FILE", type=Path, help="with --dry-run: draw it, too")
    parser.add_argument("--portprefix", metavar="/P", help="the beginning of the names of ports, instead of the file's")
    parser.add_argument("--enable_tags", metavar="(A B)", nargs="+", help="include what is enabled_by one of these")
    parser.add_argument("--disable_tags", metavar="(A B)", nargs="+", help="leave out what is disabled_by one of these")
    parser.add_argument("--allow-deprecated-dtd", action="store_true", help="read files of version 1")
    parser.add_argument("--allow-deprecated-devices", action="store_true", help="taken for granted")
    parser.add_argument("--autocloseAfterStart", action="store_true", help="end as soon as it is ready")
    parser.add_argument(
        "--patience",
        metavar="S",
        type=seconds,
        help="how long a device may take to open (default 60), close (15), act (30)",
    )
    parser.add_argument(
        "--move-patience", metavar="S", type=seconds, help="how long a calibration or parking may take (default 300)"
    )
    add_access(parser)
    parser.add_argument("--verbose", action="store_true", help="also say what is only for those who look for a mistake")
    add_dialect(parser)
    parser.add_argument(
        "--KEY", metavar="VALUE", dest="_key", help="any other: the value of parameters that ask for it by extern-name"
    )
    return parser


def _given(words: Sequence[str], others: Sequence[str]) -> Property:
    """Return what parameters can refer to: the whole command line."""
    if others and not others[0].startswith("--"):
        _parser().error(f"{others[0]!r} stands alone; write --KEY before a value")
    given = parse_arguments(words)
    given.remove("config")
    return given


def _file(words: Sequence[str]) -> Path:
    finder = ResourceFinder(contexts=["yarprobotinterface"])
    finder.configure(words, default_file="yarprobotinterface.ini")
    if not finder.properties.check("config"):
        _parser().error("there is no --config, and no yarprobotinterface.ini that has one")
    # A finder of its own: the folder of the robot is searched even if the file that names the configuration is in it.
    name = as_string(finder.properties.find("config"))
    path = ResourceFinder(contexts=finder.contexts, roots=[shipped_folder("suites") / "robots"]).find(name)
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _warn(reading: ReadResult, others: Sequence[str], log: ConsoleLog) -> None:
    for warning in reading.warnings:
        log(Level.WARNING, str(warning))
    for word in others:
        if word.startswith("--") and word[2:].partition("::")[0] not in reading.asked:
            log(Level.WARNING, f"{word}: no parameter of the robot asks for it by extern-name")


def _draw(reading: ReadResult, picture: Path | None, log: ConsoleLog) -> int:
    from rtf.robot.interface.plan import draw_svg, draw_text

    print(draw_text(reading.robot), end="", flush=True)
    if picture is not None:
        try:
            picture.write_text(draw_svg(reading.robot), encoding="utf-8")
        except OSError as error:
            log(Level.ERROR, f"--svg {picture}: {error.strerror}; write to a folder that is there")
            return WRONG
    return FINE


def _run(reading: ReadResult, options: argparse.Namespace, log: ConsoleLog) -> int:
    from rtf.cli.network.options import make_network
    from rtf.middleware.ports.access import Access
    from rtf.robot.interface.device_thread import Patience
    from rtf.robot.interface.program import run_program

    patience, given = Patience(), options.patience
    if given is not None:
        patience = replace(patience, open=given, close=given, action=given, hurry=min(given, patience.hurry))
    if options.move_patience is not None:
        patience = replace(patience, move=options.move_patience)
    try:
        network = make_network()
        network.writers, network.admins = Access.parse(options.allow), Access.parse(options.allow_admin)
        code, hanging = run_program(
            reading.robot,
            network=network,
            log=log,
            patience=patience,
            autoclose=options.autocloseAfterStart,
        )
    except RtfError as error:
        log(Level.ERROR, str(error))
        return WRONG
    main = threading.main_thread()
    if hanging or any(thread is not main and not thread.daemon for thread in threading.enumerate()):
        sys.stdout.flush()
        os._exit(code)  # threads that never end must not keep the process, or be met by the interpreter's end
    return code
