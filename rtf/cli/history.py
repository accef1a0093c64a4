"""``testrunner history``: tests and measurements over the runs, and the maintenance of the file."""

from __future__ import annotations

import fcntl
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, count
from rtf.cli.project import project_value
from rtf.errors import RtfError
from rtf.testing.history import History, default_place, trends
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

_EPILOG = """\
Without NAME: the last runs, flaky tests, measurements that drift or are close to a limit. With NAME: all about the
tests and measurements whose test, subject or name contains it, or matches it as a pattern, such as 'arm/*' or
'*/left_knee/*' (in quotes).

  flaky        passed after a failure in one run, or went from passing to failing and back within the last runs
  passed 90 %  of the runs that judged it, with the interval (Wilson, 95 %) in which the true rate is expected
  drifts       rises or falls from run to run more than chance does (Mann-Kendall; false discoveries kept below 5 % of
               what is listed); the slope is the median of all (Theil-Sen); 'reaches' follows it to the limit
  bars         a bar a run between the limits, a cross for a value outside of them

examples:
  testrunner --suite suites/arm.xml --robot icub01 --history     run, and put the run into the history
  testrunner history                                             how it is going
  testrunner history knee --last 200                             all about what has 'knee' in its name
  testrunner history --robot '*' --json                          all robots together, for a program
  testrunner history --import rtf-runs/*                         take archived runs in
  testrunner history --prune 500                                 keep the last 500 runs of each robot and station

exit codes:
  0 done   4 no history, nothing of that name, or a run that cannot be taken in
"""


def history(words: Sequence[str]) -> ExitCode:
    """Show the history, or change its contents."""
    options = _parser().parse_args(words)
    (said,) = project_value("history") or ("",)
    chosen = options.history or said
    path = Path(chosen) if chosen else default_place()
    if options.runs:
        return _import(path, [Path(run) for run in options.runs])
    with History(path) as opened:
        if options.prune is not None:
            gone = opened.prune(options.prune)
            print(f"{_runs(gone)} taken out of {path}")
            return ExitCode.PASSED
        if options.forget:
            return _forget(opened, options.forget)
        return _show(opened, options)


def _parser() -> Parser:
    parser = Parser(
        prog="testrunner history",
        description="What became of tests and measurements over the runs of a robot.",
        epilog=_EPILOG,
    )
    shown = parser.add_argument_group("what is shown")
    shown.add_argument("names", metavar="NAME", nargs="*", help="part of a name, or a pattern")
    shown.add_argument("--history", metavar="FILE", help=f"the file (default: {default_place()})".replace("%", "%%"))
    shown.add_argument("--robot", metavar="NAME", help="the robot, or a pattern (default: that of the newest run)")
    shown.add_argument("--station", metavar="NAME", help="the station, or a pattern (default: that of the newest run)")
    shown.add_argument("--last", metavar="N", type=count, default=50, help="how many runs count (default 50)")
    shown.add_argument("--json", action="store_true", help="as JSON, for programs")
    shown.add_argument(
        "--color",
        "--colour",
        choices=("auto", "always", "never"),
        default="auto",
        help="colours (default: on a terminal)",
    )
    care = parser.add_argument_group("what is in it").add_mutually_exclusive_group()
    care.add_argument("--import", metavar="RUN", nargs="+", dest="runs", help="take in runs, by their folders")
    care.add_argument("--prune", metavar="N", type=count, help="keep only the last N runs of each robot and station")
    care.add_argument("--forget", metavar="RUN", action="append", help="take a run out, by its name or folder")
    return parser


# Showing -------------------------------------------------------------------------------------------------------------


def _show(opened: History, options: argparse.Namespace) -> ExitCode:
    found = trends(opened, names=options.names, robot=options.robot, station=options.station, last=options.last)
    if options.json:
        print(json.dumps(found, allow_nan=False, indent=1))
        return ExitCode.PASSED
    if not found["runs"]:
        asked = f"has {' or '.join(map(repr, options.names))} in it" if options.names else "is in it"
        who = "" if options.robot is None and options.station is None else " of that robot and station"
        print(f"testrunner history: {opened.path}: no run{who} {asked}", file=sys.stderr)
        return ExitCode.USAGE
    from rtf.cli import history_text
    from rtf.testing.report.text import wants_colour

    choice = {"auto": None, "always": True, "never": False}[options.color]
    sheet = history_text.Sheet(sys.stdout, coloured=wants_colour(sys.stdout, choice))
    newest = found["runs"][-1]
    mixed = any((run["robot"], run["station"]) != (newest["robot"], newest["station"]) for run in found["runs"])
    who = "several robots or stations" if mixed else history_text.where(newest["robot"], newest["station"])
    sheet.line(f"{who}, {_runs(len(found['runs']))}  ({opened.path})")
    if options.names:
        history_text.details(sheet, found)
    else:
        history_text.overview(sheet, found)
    return ExitCode.PASSED


def _runs(number: int) -> str:
    return f"{number} run{'s' if number != 1 else ''}"


# Taking in and out ---------------------------------------------------------------------------------------------------


def _import(path: Path, runs: list[Path]) -> ExitCode:
    code = ExitCode.PASSED
    with History(path, create=True) as opened:
        for run in dict.fromkeys(run.resolve() for run in runs):
            try:
                _import_one(opened, run)
            except RtfError as error:
                print(f"testrunner history: {error}", file=sys.stderr)
                code = ExitCode.USAGE
    return code


def _import_one(opened: History, path: Path) -> None:
    from rtf.testing import journal
    from rtf.testing.history.database import import_run
    from rtf.testing.report.text import counts

    folder = path if path.is_dir() else path.parent
    if _goes_on(folder / journal.FILE_NAME):
        raise journal.JournalError(f"{folder}: this run is still going on; take it in when it is over")
    print(f"{folder.name}: {counts(import_run(opened, path).counts())}")


def _goes_on(journal: Path) -> bool:
    """Return whether a runner is writing the journal; it holds a lock as long as it lives."""
    if not journal.exists():
        return False
    with journal.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False  # a file system without locks has to be trusted
    return False


def _forget(opened: History, names: list[str]) -> ExitCode:
    code = ExitCode.PASSED
    for name in names:
        gone = opened.forget(Path(name).resolve().name)
        if gone:
            print(f"{_runs(gone)} named {Path(name).resolve().name} taken out of {opened.path}")
        else:
            print(f"testrunner history: {opened.path}: there is no run {name}", file=sys.stderr)
            code = ExitCode.USAGE
    return code
