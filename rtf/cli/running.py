"""From a plan to a run: the run's folder, its options, the reporters, and the run itself."""

from __future__ import annotations

import os
import resource
import signal
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.device import device_record
from rtf.cli.profiles import profiles_of
from rtf.testing import journal
from rtf.testing.suite.model import Isolation, SuiteError, Timeouts
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from rtf.testing.isolation.launch import Launched
    from rtf.testing.plan import Plan
    from rtf.testing.reporting import Reporter
    from rtf.testing.run_control import Control
    from rtf.testing.run_state import RunOptions

#: Open files that a run needs: the runner with its reports, and each suite worker with its fork server.
_FILES, _FILES_OF_WORKER = 48, 16
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def make_run_folder(options: argparse.Namespace, plan: Plan) -> Path:
    """Make the folder of a new run, named by time, robot and suite."""
    if options.run_folder:
        folder = Path(options.run_folder).absolute()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SuiteError(f"--run-folder {folder}: {error.strerror}") from None
        return folder
    runs = Path(options.runs).absolute()
    name = plan.suites[0].id if len(plan.suites) == 1 else f"{len(plan.suites)}-suites" if plan.suites else ""
    try:
        return journal.make_run_folder(runs, options.robot, name[:60])
    except OSError as error:
        raise SuiteError(f"--runs {runs}: {error.strerror or error}; name another folder with --runs") from None


def run_options(options: argparse.Namespace, folder: Path, words: Sequence[str]) -> RunOptions:
    """Return the options of the runner."""
    from rtf.testing.isolation.attempt import GRACE
    from rtf.testing.run_control import Control
    from rtf.testing.run_state import RunOptions

    control = Control(answer=options.answer)
    if options.answer is None and sys.stdin is not None and sys.stdin.isatty():
        control.attend_terminal()
    return RunOptions(
        run_folder=folder,
        jobs=1 if options.debug else max(1, options.jobs),
        terminal=_terminal() if options.debug else "",
        core_dumps=options.core_dumps,
        limits=Timeouts(setup=options.setup_timeout, run=options.timeout, teardown=options.teardown_timeout),
        run_timeout=options.run_timeout,
        grace=options.grace or GRACE,
        memory=_memory(options.memory),
        overrides=tuple(options.overrides),
        features=frozenset(options.feature),
        isolation=Isolation.TEST if options.debug else Isolation(options.isolation) if options.isolation else None,
        repetition=options.repetition,
        retries=options.retries,
        maxfail=options.maxfail or int(options.stepwise),
        device=device_record(options),
        allow_empty=options.allow_empty,
        robot=options.robot,
        station=options.station,
        seed=options.shuffle,
        command=tuple(words),
        control=control,
    )


def _terminal() -> str:
    """Return the device of the terminal at which tests are debugged."""
    if not sys.stdin.isatty():
        raise SuiteError("--debug needs a terminal as its input; start it in one, without a pipe")
    return os.ttyname(sys.stdin.fileno())


def _memory(mebibytes: int | None) -> int:
    from rtf.testing.runner import most_memory

    if mebibytes is not None:
        return mebibytes << 20
    return most_memory()


def make_room_for_files(jobs: int) -> None:
    """Allow as many open files as a run needs. Raises SuiteError if that is forbidden, because nothing would run."""
    needed = _FILES + _FILES_OF_WORKER * jobs
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        if hard != resource.RLIM_INFINITY and hard < needed:
            raise SuiteError(f"{hard} open files are too few for this run, which needs {needed}: ulimit -n {needed}")
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def execute(plan: Plan, run: RunOptions, options: argparse.Namespace, launched: Launched | None = None) -> ExitCode:
    """Open reporters and journal, run, and close everything. ``launched`` is a fork server that is starting."""
    from rtf.testing.broadcast import Broadcast
    from rtf.testing.runner import Run

    make_room_for_files(run.jobs)
    path = run.run_folder / journal.FILE_NAME
    if path.exists() and not run.resumed:
        raise SuiteError(f"{run.run_folder} holds a run already; go on with it by --resume, or name another folder")
    # Before any report is touched: the run may still be going on.
    writer = journal.Journal(path, resume=run.resumed, latest=not (options.run_folder or run.resumed))
    reporters = open_reporters(options, run.run_folder, run.control)
    broadcast = Broadcast(writer, [*reporters])
    if run.resumed:
        changes = run.changes
        broadcast.resume(path, void=(*changes.removed, *changes.changed) if changes else ())
    facts, said = profiles_of(plan.suites)
    run = replace(run, facts={**run.facts, **facts})
    code = Run(plan.suites, run, broadcast, launched).execute([*said, *plan.diagnostics])
    problems = linger_until_asked(reporters)
    for reporter, error in problems:
        print(f"testrunner: reporter {type(reporter).plugin_name} is left behind: {error}", file=sys.stderr)
    return ExitCode.INTERNAL if problems else code


def linger_until_asked(reporters: list[Reporter]) -> list[tuple[Reporter, Exception]]:
    """Let reporters show the finished run until a signal asks this process to end. Returns those that broke or hang."""
    from rtf.testing.reporter_thread import let_linger

    stop = threading.Event()
    before = [(signum, signal.signal(signum, lambda *_: stop.set())) for signum in _SIGNALS]
    try:
        return let_linger(reporters, stop)
    finally:
        for signum, handler in before:
            signal.signal(signum, handler)


def open_reporters(options: argparse.Namespace, folder: Path, control: Control | None = None) -> list[Reporter]:
    """Make every reporter that was asked for; raises before anything runs when one could never write.

    ``control`` is given to the reporters of a run that can be stopped.
    """
    from rtf.testing.reporter_thread import bounded
    from rtf.testing.reporting import ReportError, ReportOptions, load_reporter

    colour = {"auto": None, "always": True, "never": False}[options.color]
    verbosity = -1 if options.quiet else min(2, options.verbose)
    extra = {"junit-family": options.junit_family, "summary": "no" if options.no_summary else "yes"}
    if getattr(options, "debug", False):
        extra["moving"] = "no"  # the debugger has the terminal
    for name in ("compare", "history"):
        if getattr(options, name) is not None:
            extra[name] = getattr(options, name)
    if getattr(options, "web_reporter", False):
        extra |= {"port": str(options.web_port), "host": options.web_host, "keep": "yes" if options.web_keep else "no"}
    reporters = []
    unwritten: dict[Path, str] = {}
    wanted = [*_wanted(options, folder)]
    extra["reports"] = ":".join(str(target) for _, target in wanted if target is not None)
    for name, target in wanted:
        made = load_reporter(name)(
            ReportOptions(
                target=target,
                run_folder=folder,
                verbosity=verbosity,
                detail=options.detail,
                colour=colour,
                extra=extra,
                control=control,
                unwritten=unwritten,
            ),
        )
        try:
            bounded(made, "open")
        except (OSError, ValueError) as error:
            raise ReportError(f"report {name} cannot be written: {error}") from None
        reporters.append(made)
    return reporters


def _wanted(options: argparse.Namespace, folder: Path) -> Iterator[tuple[str, Path | None]]:
    yield options.style, None
    served = getattr(options, "web_reporter", False)
    if served:
        yield "web", None
    if not options.no_output:
        name = options.output_type
        default = folder / "result.txt" if name == "text" else Path("result.xml")
        yield name, Path(options.output) if options.output else default
    for name in ("junit", "json", "ctrf"):
        if getattr(options, name):
            yield name, Path(getattr(options, name))
    if options.html or served:
        yield "html", Path(options.html) if options.html else folder / "report.html"
    for word in options.report:
        name, _, target = word.partition("=")
        yield name, Path(target) if target else None
    if options.history is not None:  # closed first, so that the trends in the page have this run in them
        yield "history", Path(options.history) if options.history else None
