"""From parsed options to a run: the plan, the run's folder, the reporters, and the run itself."""

from __future__ import annotations

import difflib
import os
import resource
import signal
import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.device import device_record
from rtf.cli.parser import UsageError
from rtf.testing import run_folder
from rtf.testing.events import Diagnosed
from rtf.testing.plan import (
    Loaded,
    PlannedSuite,
    Planner,
    fingerprint,
    load_files,
    plugin_files,
    suite_files,
    suite_of_plugins,
)
from rtf.testing.suite.ids import program_of
from rtf.testing.suite.model import Isolation, SuiteError, TestSuite, Timeouts, number_suites
from rtf.testing.verdict import ExitCode, Severity

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping, Sequence

    from rtf.testing.events import PlanChanged
    from rtf.testing.isolation.launch import Launched
    from rtf.testing.reporting import Reporter
    from rtf.testing.run_control import Control
    from rtf.testing.runner import RunOptions
    from rtf.testing.suite.model import TestEntry

#: Open files that a run needs: the runner with its reports, and each suite worker with its fork server.
_FILES, _FILES_OF_WORKER = 48, 16
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True, slots=True)
class Plan:
    """What will run, and what is to be said about the files it came from."""

    suites: tuple[PlannedSuite, ...]
    diagnostics: tuple[Diagnosed, ...]
    refused: bool


def make_plan(options: argparse.Namespace) -> Plan:
    """Load, complete, select and order. Raises SuiteError for what the command line gets wrong."""
    loaded = _load(options)
    planner = Planner(options.overrides)
    suites = planner.plan(_select(planner.complete(loaded.suites), planner, options))
    if options.list or options.dry_run:
        return Plan(suites, loaded.diagnostics, loaded.has_errors)
    suites, diagnostics = _with_fixtures(suites, planner, options)
    return Plan(suites, (*loaded.diagnostics, *diagnostics), loaded.has_errors)


def _with_fixtures(
    suites: tuple[PlannedSuite, ...], planner: Planner, options: argparse.Namespace
) -> tuple[tuple[PlannedSuite, ...], tuple[Diagnosed, ...]]:
    """The plan with the fixtures that its tests ask for, in each suite that names none."""
    if all(planned.suite.fixtures for planned in suites):
        return suites, ()
    from rtf.testing.implied_fixtures import with_fixtures

    made: list[PlannedSuite] = []
    diagnostics: list[Diagnosed] = []
    for planned in suites:
        if planned.suite.fixtures:
            made.append(planned)
            continue
        suite, said = with_fixtures(planned, options.overrides)
        made += [planned] if suite is planned.suite else planner.plan([suite])
        diagnostics += said
    return tuple(made), tuple(diagnostics)


def _load(options: argparse.Namespace) -> Loaded:
    """All suites that the command line names: single tests as one suite, then what its words name, then options."""
    tests = [(options.test, options.type)] if options.test else []
    tests += [(word, options.type) for word in options.targets if _is_test(word)]
    parts = [Loaded((_suite_for(options, "test", tests),), ())] if tests else []
    if options.tests:
        parts.append(_tests_of(Path(options.tests), options))
    parts += [_load_target(Path(word), options) for word in options.targets if not _is_test(word)]
    wanted = [(Path(name), True) for name in options.suite]
    if options.suites:
        wanted += [(path, False) for path in suite_files(Path(options.suites), recursive=options.recursive)]
    parts.append(_load_suites(wanted, options))
    suites = number_suites([suite for part in parts for suite in part.suites])
    return Loaded(suites, tuple(said for part in parts for said in part.diagnostics))


def _is_test(word: str) -> bool:
    """Whether a word names a test plug-in: a file that is no suite file, or a class of a file."""
    file = Path(word.partition("::")[0])
    return file.is_file() and file.suffix != ".xml"


def _load_target(path: Path, options: argparse.Namespace) -> Loaded:
    """The suite of a file; all suites of a folder, or else all its tests. Raises UsageError when nothing is there."""
    if path.is_file():
        return _load_suites([(path, True)], options)
    if not path.is_dir():
        raise UsageError(_nothing_like(path))
    files = suite_files(path, recursive=options.recursive)
    loaded = _load_suites([(file, False) for file in files], options)
    if not (loaded.suites or loaded.diagnostics):
        loaded = _tests_of(path, options)
        if not any(suite.tests for suite in loaded.suites):
            deeper = "" if options.recursive else "; -r looks into its folders, too"
            raise UsageError(f"the folder {path} has neither suites nor tests in it{deeper}")
    return loaded


def _nothing_like(path: Path) -> str:
    """Say that there is no such file or folder, and which name is near."""
    from rtf.cli.command_tree import TESTRUNNER

    siblings = [one.name for one in path.parent.iterdir()] if path.parent.is_dir() else []
    near = difflib.get_close_matches(path.name, [*siblings, *(command.name for command in TESTRUNNER.commands)], n=1)
    hint = f"did you mean {near[0]}?" if near else "a test is named by --test, or by its file"
    return f"there is no file or folder {str(path)!r}; {hint}"


def _load_suites(wanted: Sequence[tuple[Path, bool]], options: argparse.Namespace) -> Loaded:
    return load_files(wanted, dict(options.define), lenient=options.lenient) if wanted else Loaded((), ())


def _tests_of(folder: Path, options: argparse.Namespace) -> Loaded:
    files = plugin_files(folder, recursive=options.recursive)
    plugins: list[tuple[str, str | None]] = [(str(path.resolve()), None) for path in files]
    return Loaded((_suite_for(options, folder.resolve().name or "tests", plugins),), ())


def _suite_for(options: argparse.Namespace, name: str, plugins: list[tuple[str, str | None]]) -> TestSuite:
    return suite_of_plugins(name, plugins, param=options.param, environment=options.environment)


def _select(suites: tuple[TestSuite, ...], planner: Planner, options: argparse.Namespace) -> tuple[TestSuite, ...]:
    from rtf.testing import replay, selection

    filters = {}
    if options.names:
        filters[f"-k {options.names!r}"] = selection.name_filter(options.names)
    if options.tags:
        filters[f"--tags {options.tags!r}"] = selection.tag_filter(options.tags)
    planned = getattr(options, "planned", None)
    if planned is not None and (options.last_failed or options.stepwise):
        filters["--resume"] = selection.id_filter(planned)  # what has failed last is something else by now
    else:
        last = Path(options.runs) / run_folder.LATEST
        if options.last_failed:
            failed = selection.id_filter(_failed_in(last, "--last-failed"))
            filters[f"--last-failed (what did not pass in {last.resolve()})"] = failed
        if options.stepwise and last.exists():
            filters["--stepwise"] = selection.id_filter(_from_first(suites, _failed_in(last, "--stepwise")))
    limited = getattr(options, "limited", {})  # of a run that is resumed: the only cases that it wants
    if filters:
        cases = replay.cases_told(Path(options.runs), planner.programs(suites)) if planned is None else {}
        conditions = [lambda test, passes=passes: test.id in limited or passes(test) for passes in filters.values()]
        selected = selection.select(suites, conditions, with_required=True, cases=cases)
        if not selected:
            total = sum(len(suite.tests) for suite in suites)
            tests = f"none of {total} test{'s' if total != 1 else ''}"
            print(f"testrunner: {tests} is selected by {' and '.join(filters)}", file=sys.stderr)
        suites = selected
    if limited:
        suites = tuple(suite.with_tests(_limited(test, limited) for test in suite.tests) for suite in suites)
    if options.shuffle is not None:
        suites = selection.shuffle(suites, options.shuffle)
    return suites


def _limited(test: TestEntry, limited: Mapping[str, Mapping[str, str]]) -> TestEntry:
    return replace(test, cases=tuple(limited.get(test.id, {}).items()))


def _from_first(suites: tuple[TestSuite, ...], failed: frozenset[str]) -> list[str]:
    """The tests from the first one on that did not pass; all of them, if none of those is in the plan."""
    ids = [test.id for suite in suites for test in suite.tests]
    programs = {program_of(test) for test in failed}
    first = next((index for index, test in enumerate(ids) if test in programs), 0)
    return ids[first:]


def _failed_in(folder: Path, option: str) -> frozenset[str]:
    from rtf.testing import replay
    from rtf.testing.results import RunResult

    if not folder.exists():
        raise SuiteError(f"{option}: there is no earlier run in {folder.parent}")
    results = RunResult()
    for event in replay.as_one_run(folder):
        results.apply(event)
    return frozenset(test.id for test in results.tests.values() if test.verdict is None or not test.verdict.good)


def fingerprints(plan: Plan) -> dict[str, str]:
    """Return what each test of a plan is, by its id."""
    return {test.entry.id: fingerprint(planned.suite, test.entry) for planned in plan.suites for test in planned.tests}


def said_of_changes(changes: PlanChanged) -> Diagnosed:
    """Return the message that the suites of a run that is resumed were edited."""
    kinds = (("added", changes.added), ("removed", changes.removed), ("changed", changes.changed))
    told = "; ".join(f"{word}: {', '.join(tests)}" for word, tests in kinds if tests)
    text = f"the suites were edited since the run was begun: {told}"
    return Diagnosed(
        severity=Severity.WARNING, text=text, hint="what is new or changed is run, what is gone is left out"
    )


def list_plan(plan: Plan) -> ExitCode:
    """Print a plan, and below it why something of it is not found: where that was looked for ``--dry-run`` tells."""
    from rtf.cli.check_plan import missing_of

    show_plan(plan)
    missing = tuple(missing_of(plan))
    show_diagnostics(missing)
    return ExitCode.USAGE if plan.refused or missing else ExitCode.PASSED


def show_plan(plan: Plan) -> None:
    """Print the tests of a plan, a line each: id, plug-in, tags, what it does to the robot, whether it is missing."""
    show_diagnostics(plan.diagnostics)
    total = 0
    for planned in plan.suites:
        print(f"{planned.suite.name}  ({planned.suite.file or 'command line'})")
        for entry, found in planned.fixtures:
            missing = "  NOT FOUND" if isinstance(found, str) else ""
            needs = f"  needs {', '.join(entry.depends)}" if entry.depends else ""
            print(f"  fixture {entry.name}{needs}{missing}")
        for test in planned.tests:
            total += 1
            tags = f"  [{' '.join(test.entry.tags)}]" if test.entry.tags else ""
            missing = "  NOT FOUND" if test.plugin is None else ""
            safety = f"  safety: {test.spec.safety}" if test.spec.safety else ""
            print(f"  {test.entry.id}  {test.entry.name}{tags}{safety}{missing}")
            for case, _ in test.entry.cases:
                print(f"    {case}")
    print(f"{total} test{'s' if total != 1 else ''}")


def refuse(plan: Plan) -> ExitCode:
    """Say why nothing is run: a suite that cannot be read whole is not the suite that was meant."""
    show_diagnostics(plan.diagnostics)
    errors = sum(diagnosed.severity is Severity.ERROR for diagnosed in plan.diagnostics)
    print(
        f"testrunner: nothing was run: {errors} error{'s' if errors != 1 else ''} in the suite files", file=sys.stderr
    )
    return ExitCode.USAGE


def show_diagnostics(diagnostics: tuple[Diagnosed, ...]) -> None:
    """Print what is wrong with files, and with the command line, to stderr, the way compilers do."""
    for diagnosed in diagnostics:
        place = ":".join(str(part) for part in (diagnosed.file, diagnosed.line, diagnosed.column) if part)
        place = place or "command line"
        hint = f" ({diagnosed.hint})" if diagnosed.hint else ""
        print(f"{place}: {diagnosed.severity}: {diagnosed.text}{hint}", file=sys.stderr)


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
    name = plan.suites[0].suite.id if len(plan.suites) == 1 else f"{len(plan.suites)}-suites" if plan.suites else ""
    try:
        return run_folder.make_run_folder(runs, options.robot, name[:60])
    except OSError as error:
        raise SuiteError(f"--runs {runs}: {error.strerror or error}; name another folder with --runs") from None


def run_options(options: argparse.Namespace, folder: Path, words: Sequence[str]) -> RunOptions:
    """The options of the runner."""
    from rtf.testing.isolation.attempt import GRACE
    from rtf.testing.operator import make_operator
    from rtf.testing.run_control import Control
    from rtf.testing.runner import RunOptions

    control = Control()
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
        ask=make_operator(options.answer, control, page=options.web_reporter),
        control=control,
    )


def _terminal() -> str:
    """The device of the terminal at which tests are debugged."""
    if not sys.stdin.isatty():
        raise SuiteError("--debug needs a terminal as its input; start it in one, without a pipe")
    return os.ttyname(sys.stdin.fileno())


def _memory(mebibytes: int | None) -> int:
    from rtf.testing.runner import most_memory

    if mebibytes is not None:
        return mebibytes << 20
    return most_memory()


def make_room_for_files(jobs: int) -> None:
    """Allow as many open files as a run needs. Raises SuiteError where that is forbidden: nothing would run."""
    needed = _FILES + _FILES_OF_WORKER * jobs
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        if hard != resource.RLIM_INFINITY and hard < needed:
            raise SuiteError(f"{hard} open files are too few for this run, which needs {needed}: ulimit -n {needed}")
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def execute(plan: Plan, run: RunOptions, options: argparse.Namespace, launched: Launched | None = None) -> ExitCode:
    """Open reporters and journal, run, and close everything. ``launched`` is a fork server that is getting ready."""
    from rtf.testing.journal import FILE_NAME, Journal
    from rtf.testing.reporting import Broadcast, ReportOptions
    from rtf.testing.run_folder import LatestRun
    from rtf.testing.runner import Run

    make_room_for_files(run.jobs)
    path = run.run_folder / FILE_NAME
    if path.exists() and not run.resumed:
        raise SuiteError(f"{run.run_folder} holds a run already; go on with it by --resume, or name another folder")
    journal = Journal(path, resume=run.resumed)  # before any report is touched: the run may still be going on
    reporters = open_reporters(options, run.run_folder, run.control)
    link = (
        [] if options.run_folder or run.resumed else [LatestRun(ReportOptions(target=None, run_folder=run.run_folder))]
    )
    broadcast = Broadcast(journal, [*reporters, *link])
    if run.resumed:
        changes = run.changes
        broadcast.resume(path, void=(*changes.removed, *changes.changed) if changes else ())
    code = Run(plan.suites, run, broadcast, launched).execute(plan.diagnostics)
    hung = linger_until_asked(reporters)
    for reporter in hung:
        name = type(reporter).plugin_name
        print(f"testrunner: reporter {name} is left behind: linger() did not return within its time", file=sys.stderr)
    return ExitCode.INTERNAL if hung else code


def linger_until_asked(reporters: list[Reporter]) -> list[Reporter]:
    """Let reporters show the finished run until a signal asks this process to end. Returns those that hang."""
    from rtf.testing.reporting import let_linger

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
    from rtf.testing.reporting import ReportError, ReportOptions, bounded, load_reporter

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
