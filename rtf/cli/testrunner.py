"""``testrunner``: run suites and tests, or one of the commands beside it."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.testing.permission import give_permission
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rtf.testing.runner import RunOptions

#: The commands beside running, and the module of each.
COMMANDS = {
    **dict.fromkeys(("validate", "report", "where"), "commands"),
    "describe": "describe",
    "history": "history",
    "page": "page",
}

_WHICH_TESTS = "'testrunner describe' says which tests there are"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code. Nothing is imported that the command does not need."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if words and words[0] in COMMANDS:
            module = import_module(f"rtf.cli.{COMMANDS[words[0]]}")
            return int(getattr(module, words[0])(words[1:]))
        return _run(words)
    except RtfError as error:
        print(f"testrunner: {error}", file=sys.stderr)
        return int(ExitCode.USAGE)
    except KeyboardInterrupt:  # before the run takes the signals over, or in a command that only reads
        print("testrunner: interrupted", file=sys.stderr)
        return int(ExitCode.INTERRUPTED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nobody reads; do not complain at exit
        return int(ExitCode.INTERNAL)


def _run(words: list[str]) -> int:
    from rtf.cli.arguments import build_parser

    parser = build_parser()
    options, extra = parser.parse_known_args(words)
    unknown = [word for word in extra if word.startswith("-")]
    if unknown:
        parser.error(f"unknown option {unknown[0]}{_near_option(parser, unknown[0])}")
    if extra and not (options.test or options.tests or options.suite or options.suites or options.resume):
        parser.error(f"what is {extra[0]!r}? Suites are named with --suite, tests with --test")
    if options.isolation == "none":
        print("testrunner: isolation 'none': a test that hangs or crashes takes the run with it", file=sys.stderr)
    give_permission(given=options.allow_motion)
    if options.resume:
        return _resume(options)
    if not (options.test or options.tests or options.suite or options.suites):
        if options.list:
            parser.error(f"--list needs --suite, --suites, --test or --tests; {_WHICH_TESTS}")
        parser.print_help()
        return int(ExitCode.USAGE)
    return _execute(options, words)


def _near_option(parser: argparse.ArgumentParser, word: str) -> str:
    import difflib

    known = [name for action in parser._actions for name in action.option_strings]  # noqa: SLF001 - no public way
    near = difflib.get_close_matches(word.partition("=")[0], known, n=1)
    return f"; did you mean {near[0]}?" if near else ""


def _execute(options: argparse.Namespace, words: list[str]) -> int:
    launched = None
    if not (options.list or options.dry_run or options.isolation == "none"):
        from rtf.testing.isolation.launch import launch

        launched = launch()  # first of all: it gets ready while the suites are read, and ends with us if nothing is run
    from rtf.cli import running

    planned = running.make_plan(options)
    if options.list:
        return int(running.list_plan(planned))
    if planned.refused:
        return int(running.refuse(planned))
    if options.dry_run:
        from rtf.cli.dry_run import dry_run

        return int(dry_run(planned, options))
    folder = running.make_run_folder(options, planned)
    return int(running.execute(planned, running.run_options(options, folder, words), options, launched))


#: What a resumed run takes from the new command line, where it is given there.
_OF_REPORTING = (
    *("junit", "json", "ctrf", "html", "report", "quiet", "verbose"),
    *("style", "color", "output", "output_type", "no_output", "compare", "history"),
    *("web_reporter", "web_port", "web_host", "web_keep", "answer"),
)


def _resume(options: argparse.Namespace) -> int:
    """Go on with a run: its own command line decides what it consists of; reporting follows the new one."""
    from dataclasses import replace

    from rtf.cli import running
    from rtf.cli.arguments import build_parser
    from rtf.robot_testing.ledger import MotionLedger
    from rtf.testing import journal, replay
    from rtf.testing.events import RunStarted

    folder = Path(options.resume).resolve()
    started: RunStarted | None = None
    for event in journal.read(folder):
        if isinstance(event, RunStarted):
            started = event
            break
    if started is None:
        print(f"testrunner: {folder} holds no run that was begun", file=sys.stderr)
        return int(ExitCode.USAGE)
    if started.command[:1] == ("pytest",):
        print(f"testrunner: {folder} was made by pytest, which goes on with it by --last-failed", file=sys.stderr)
        return int(ExitCode.USAGE)
    done = replay.finished_tests(journal.read(folder))
    original = build_parser().parse_args(list(started.command))
    original.device, original.device_file, original.device_ask = [*started.device.items()], None, False
    original.planned = replay.planned_tests(journal.read(folder))  # whatever it was that selected them then
    for name in _OF_REPORTING:
        if getattr(options, name) != build_parser().get_default(name):
            setattr(original, name, getattr(options, name))
    here = Path.cwd()
    _absolute_targets(original, here, given=options)
    os.chdir(started.environment.get("folder", here))
    planned = running.make_plan(original)
    if planned.refused:
        return int(running.refuse(planned))
    MotionLedger(folder).resumed()
    run: RunOptions = running.run_options(original, folder, list(started.command))
    run = replace(run, done=done, resumed=True, seed=started.seed)
    return int(running.execute(planned, run, original))


def _absolute_targets(original: argparse.Namespace, here: Path, *, given: argparse.Namespace) -> None:
    """Report files named now are relative to where the user is now, not to where the run was begun."""
    for name in ("junit", "json", "ctrf", "html", "output", "compare", "history"):
        if getattr(given, name):
            setattr(original, name, str(here / getattr(given, name)))


if __name__ == "__main__":
    sys.exit(main())
