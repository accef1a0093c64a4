"""The commands beside running: report, where, version."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import rtf
from rtf.cli.parser import Parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence


def report(words: Sequence[str]) -> ExitCode:
    """Write reports of a run that is over, from its journal alone; exits as the run did."""
    from rtf.cli.arguments import add_report_options
    from rtf.cli.running import open_reporters
    from rtf.testing.broadcast import Broadcast
    from rtf.testing.journal import as_one_run

    parser = Parser(
        prog="testrunner report",
        description="Write reports of a run that is over, from its journal alone.",
    )
    parser.add_argument("run", metavar="RUN", help="the folder of a run, such as rtf-runs/latest, or its journal")
    add_report_options(parser.add_argument_group("what is said and written"))
    parser.set_defaults(no_output=True)
    options = parser.parse_args(words)
    if options.output:
        options.no_output = False
    path = Path(options.run)
    folder = (path if path.is_dir() else path.parent).resolve()
    events = as_one_run(path)
    first = next(events, None)
    if first is None:
        print(f"testrunner report: {path} holds no event", file=sys.stderr)
        return ExitCode.USAGE
    broadcast = Broadcast(None, open_reporters(options, folder))
    broadcast.replay([first])
    broadcast.replay(events)
    broadcast.close()
    results = broadcast.results
    if broadcast.broken:
        return ExitCode.INTERNAL
    return ExitCode(results.ended.exit_code) if results.ended is not None else results.exit_code()


def where(words: Sequence[str]) -> int:
    """Print every place where a file is looked for, in order, and which one wins; without a file the name server's."""
    from rtf.resources import ResourceFinder
    from rtf.testing.plugins import shipped_folder

    parser = Parser(
        prog="testrunner where",
        description="Where a parameter file is looked for, and which one wins. Without FILE: where the name server is.",
        epilog="example:\n  rtf where left_arm.ini --robot icubSim\n  rtf where",
    )
    parser.add_argument("file", nargs="?", metavar="FILE", help="the file, as --from names it")
    parser.add_argument("--context", default="RobotTesting", help="the context (default: RobotTesting)")
    parser.add_argument("--robot", default=None, help="the robot (default: YARP_ROBOT_NAME)")
    parser.add_argument("--suite", type=Path, default=None, metavar="XML", help="the suite beside which to look, too")
    options = parser.parse_args(words)
    if options.file is None:
        if words:
            parser.error("these options are about a FILE, and there is none")
        from rtf.cli.network.name_server import where as name_server
        from rtf.cli.network.terminal import run_to_its_end

        return run_to_its_end("rtf where", name_server, [])
    roots = [*([options.suite.parent] if options.suite else []), shipped_folder("suites")]
    search = ResourceFinder(contexts=[options.context], robot=options.robot, roots=roots).search(options.file)
    print("\n".join(search.lines()))
    return ExitCode.PASSED if search.path is not None else ExitCode.FAILURES


def version(words: Sequence[str]) -> ExitCode:
    """Print the version of the framework."""
    Parser(prog="rtf version", description="The version of the framework.").parse_args(words)
    print(f"rtf version {rtf.__version__}")
    return ExitCode.PASSED
