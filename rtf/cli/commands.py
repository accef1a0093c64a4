"""The commands beside running: validate, report, where."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import rtf
from rtf.cli.arguments import add_lenient_option
from rtf.cli.parser import Parser, key_value
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.events import Diagnosed
    from rtf.testing.plan import Loaded
    from rtf.testing.suite.model import TestSuite


def validate(words: Sequence[str]) -> ExitCode:
    """Say everything that is wrong in suite files, their plug-ins and their parameters; run nothing."""
    from rtf.cli.check_plan import problems_of
    from rtf.cli.project import project_value
    from rtf.cli.running import Plan, show_diagnostics
    from rtf.testing.plan import Planner
    from rtf.testing.suite.model import number_suites

    parser = Parser(
        prog="testrunner validate", description="Everything that is wrong in suite files, before anything moves."
    )
    parser.add_argument(
        "suites", nargs="*", metavar="SUITE", help="suite files, or folders of them (default: those of rtf.toml)"
    )
    parser.add_argument(
        "--define", metavar="NAME=VALUE", type=key_value, action="append", default=[], help="replace ${NAME}"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        type=key_value,
        action="append",
        default=[],
        dest="overrides",
        help="as for running",
    )
    parser.add_argument("--strict", action="store_true", help="warnings count as errors")
    add_lenient_option(parser)
    options = parser.parse_args(words)
    suites: list[TestSuite] = []
    found: list[Diagnosed] = []
    names = options.suites or project_value("suites")
    if not names:
        parser.error("which suites? Name files or folders, here or in rtf.toml")
    for name in names:
        loaded = _loaded(Path(name), dict(options.define), lenient=options.lenient)
        suites += loaded.suites
        found += loaded.diagnostics
    planner = Planner(options.overrides)
    plan = Plan(planner.plan(planner.complete(number_suites(suites))), (), refused=False)
    found += problems_of(plan, options.overrides)
    show_diagnostics(tuple(found))
    errors = sum(item.severity is Severity.ERROR for item in found)
    warnings = len(found) - errors
    tests = sum(len(planned.tests) for planned in plan.suites)
    size = f"{_counted(len(plan.suites), 'suite')}, {_counted(tests, 'test')}"
    print(f"{size}: {_counted(errors, 'error')}, {_counted(warnings, 'warning')}")
    return ExitCode.USAGE if errors or (options.strict and warnings) else ExitCode.PASSED


def _loaded(path: Path, variables: dict[str, str], *, lenient: bool) -> Loaded:
    """The suite of a file, or all suites of a folder, where there has to be one."""
    from rtf.testing.events import Diagnosed
    from rtf.testing.plan import Loaded, load_files, suite_files

    if not path.is_dir():
        return load_files([(path, True)], variables, lenient=lenient)
    loaded = load_files([(file, False) for file in suite_files(path, recursive=True)], variables, lenient=lenient)
    if loaded.suites or loaded.diagnostics:
        return loaded
    text = "there is no suite in this folder"
    return Loaded((), (Diagnosed(severity=Severity.ERROR, text=text, file=str(path)),))


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


def report(words: Sequence[str]) -> ExitCode:
    """Write reports of a run that is over, from its journal alone; exits as the run did."""
    from rtf.cli.arguments import add_report_options
    from rtf.cli.running import open_reporters
    from rtf.testing.journal import as_one_run
    from rtf.testing.reporting import Broadcast

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
