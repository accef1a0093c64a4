"""The run command: its words and a project's defaults become options, and a run is begun or resumed."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing.permission import give_permission
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rtf.testing.run_state import RunOptions

_WHICH_TESTS = "'testrunner describe' says which tests there are"


def run(words: Sequence[str]) -> int:
    """Run suites and tests; returns the exit code."""
    from rtf.cli.arguments import build_parser, parse_run

    options = parse_run(words)
    if not (options.no_config or options.resume):
        from rtf.cli.project import find_project, show_config

        project = find_project(Path.cwd())
        if options.show_config:
            print("\n".join(show_config(project, words)))
            return int(ExitCode.PASSED)
        if project is not None:
            words = project.in_front_of(words)
            options = parse_run(words)
    if options.isolation == "none":
        print("testrunner: isolation 'none': a test that hangs or crashes takes the run with it", file=sys.stderr)
    give_permission(given=options.allow_motion, wait=options.wait)
    if options.resume:
        return _resume(options, words)
    if not (options.targets or options.test or options.tests or options.suite or options.suites):
        if options.list:
            build_parser().error(f"--list of what? Name suites or tests; {_WHICH_TESTS}")
        build_parser().print_help()
        return int(ExitCode.USAGE)
    return _execute(options, words)


def _execute(options: argparse.Namespace, words: Sequence[str]) -> int:
    launched = None
    if not (options.list or options.dry_run or options.isolation == "none"):
        from rtf.testing.isolation.launch import launch

        launched = launch()  # first: it starts while the suites are read, and ends with this process
    from rtf.cli import running
    from rtf.cli.planning import make_plan

    planned = make_plan(options)
    if options.list or options.dry_run or planned.has_errors:
        from rtf.cli import check_plan

        if options.list:
            return int(check_plan.list_plan(planned))
        return int(check_plan.refuse(planned) if planned.has_errors else check_plan.dry_run(planned, options))
    folder = running.make_run_folder(options, planned)
    return int(running.execute(planned, running.run_options(options, folder, words), options, launched))


#: Options that a resumed run takes from the new command line, if they are there.
_OF_REPORTING = (
    *("junit", "junit_family", "json", "ctrf", "html", "report", "quiet", "verbose", "detail", "no_summary"),
    *("style", "color", "output", "output_type", "no_output", "compare", "history"),
    *("web_reporter", "web_port", "web_host", "web_keep", "answer"),
)


#: Other options that are allowed with ``--resume``; values of ``--set`` are those of secret parameters.
_OF_RESUMING = ("resume", "overrides", "allow_motion", "wait", "no_config")


def _refuse_others(words: Sequence[str]) -> None:
    """Refuse options that a resumed run would ignore. Raises UsageError."""
    from rtf.cli.arguments import blank_options, build_parser
    from rtf.cli.parser import UsageError

    given = vars(blank_options(words))
    names = {action.dest: action.option_strings for action in build_parser()._actions}  # noqa: SLF001 - no public way
    for name, value in given.items():
        if value not in (None, []) and name not in (*_OF_REPORTING, *_OF_RESUMING):
            shown = names[name][-1] if names[name] else " ".join(value)
            raise UsageError(f"{shown}: a run that is resumed consists of what it was begun with; start a new run")


def _resume(options: argparse.Namespace, words: Sequence[str]) -> int:
    """Continue a run: its own command line decides what it consists of; reporting follows the new one."""
    _refuse_others(words)
    from dataclasses import replace

    from rtf.cli import running
    from rtf.cli.arguments import build_parser, parse_run
    from rtf.cli.planning import fingerprints, make_plan, said_of_changes
    from rtf.robot_testing.guard.motion_record import MotionRecord
    from rtf.testing.journal import results_of

    folder = Path(options.resume).resolve()
    before = results_of(folder)
    started = before.started
    if started is None:
        print(f"testrunner: {folder} holds no run that was begun", file=sys.stderr)
        return int(ExitCode.USAGE)
    if started.command[:1] == ("pytest",):
        print(f"testrunner: {folder} was made by pytest, which goes on with it by --last-failed", file=sys.stderr)
        return int(ExitCode.USAGE)
    original = parse_run(started.command)
    _give_secrets_again(original, options)
    original.device, original.device_file, original.device_ask = [*started.device.items()], None, False
    original.planned = before.programs() if before.plan_is_whole else None  # whichever options selected them then
    original.limited = before.limited() if before.plan_is_whole else {}
    for name in _OF_REPORTING:
        if getattr(options, name) != build_parser().get_default(name):
            setattr(original, name, getattr(options, name))
    here = Path.cwd()
    _absolute_targets(original, here, given=options)
    os.chdir(started.environment.get("folder", here))
    planned = make_plan(original)
    if planned.has_errors:
        from rtf.cli.check_plan import refuse

        return int(refuse(planned))
    MotionRecord(folder).record_resume()
    run: RunOptions = running.run_options(original, folder, list(started.command))
    changes = before.plan_changes([suite.id for suite in planned.suites], fingerprints(planned))
    done = before.finished()
    if changes is not None:
        planned = replace(planned, diagnostics=(*planned.diagnostics, said_of_changes(changes)))
        done = done.difference(changes.removed, changes.changed)
    run = replace(run, done=done, changes=changes, resumed=True, seed=started.seed)
    return int(running.execute(planned, run, original))


def _give_secrets_again(original: argparse.Namespace, given: argparse.Namespace) -> None:
    """Fill in the secret values, which are not written down. Raises SuiteError with those that are still missing."""
    from rtf.testing.secret_values import MASK
    from rtf.testing.suite.model import SuiteError

    values = dict(given.overrides)
    hidden = [name for name, value in original.overrides if value == MASK]
    for name in values:
        if name not in hidden:
            raise SuiteError(
                f"--set {name}: a run that is resumed keeps its parameters; only secret ones are given again"
            )
    missing = [name for name in hidden if name not in values]
    if missing:
        again = " ".join(f"--set {name}=VALUE" for name in missing)
        raise SuiteError(f"--resume: {', '.join(missing)} is secret and was not written down; give it again: {again}")
    original.overrides = [(name, values.get(name, value)) for name, value in original.overrides]
    if MASK in original.param or any(value == MASK for _, value in original.define):
        raise SuiteError("--resume: a secret value in --param or --define was not written down; start a new run")


def _absolute_targets(original: argparse.Namespace, here: Path, *, given: argparse.Namespace) -> None:
    """Make report files of the new command line relative to the present folder, not to that of the run's start."""
    for name in ("junit", "json", "ctrf", "html", "output", "compare", "history"):
        if getattr(given, name):
            setattr(original, name, str(here / getattr(given, name)))
