"""From parsed options to a plan: which suites and tests were named, which of them are selected, in which order."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import UsageError
from rtf.errors import did_you_mean
from rtf.testing import journal
from rtf.testing.events import Diagnosed
from rtf.testing.plan import (
    Plan,
    Planner,
    fingerprint,
    load_files,
    plugin_files,
    suite_files,
    suite_of_plugins,
    unused_variables,
)
from rtf.testing.suite.ids import program_of
from rtf.testing.suite.model import SuiteError, TestSuite, number_suites
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping, Sequence

    from rtf.testing.events import PlanChanged
    from rtf.testing.suite.model import TestEntry


def make_plan(options: argparse.Namespace) -> Plan:
    """Load, complete, select and order the tests. Raises SuiteError for mistakes of the command line."""
    loaded = _load(options)
    planner = Planner(options.overrides)
    suites = _select(planner.plan(loaded.suites), options)
    if options.list or options.dry_run:
        return Plan(suites, loaded.diagnostics)
    completed = planner.with_implied_fixtures(suites)
    return Plan(completed.suites, (*loaded.diagnostics, *completed.diagnostics))


def _load(options: argparse.Namespace) -> Plan:
    """Return all suites of the command line: its tests as one suite, then those of its words, then of its options."""
    if "" in (options.test, options.tests, options.suites, *options.targets):
        raise UsageError("an empty word names no test, suite or folder; is a variable of the shell not set?")
    tests = [(options.test, options.type)] if options.test else []
    tests += [(word, options.type) for word in options.targets if _is_test(word)]
    parts = [Plan((_suite_for(options, "test", tests),))] if tests else []
    if options.tests:
        parts.append(_tests_of(Path(options.tests), options))
    parts += [_load_target(Path(word), options) for word in options.targets if not _is_test(word)]
    wanted = [(Path(name), True) for name in options.suite]
    if options.suites:
        wanted += [(path, False) for path in suite_files(Path(options.suites), recursive=options.recursive)]
    parts.append(_load_suites(wanted, options))
    suites = number_suites([suite for part in parts for suite in part.suites])
    of_command_line = bool(tests) or any(not suite.file for suite in suites)
    for name, given in (("param", options.param), ("environment", options.environment), ("type", options.type)):
        if given and not (tests if name == "type" else of_command_line):
            raise UsageError(f"--{name} is for tests that the command line names, and there is none; edit the suite")
    said = [one for part in parts for one in part.diagnostics]
    loaded = Plan(suites, variables=frozenset[str]().union(*(part.variables for part in parts)))
    return replace(loaded, diagnostics=(*said, *unused_variables(dict(options.define), loaded)))


def _is_test(word: str) -> bool:
    """Return whether a word names a test plug-in: a file that is no suite file, or a class of a file."""
    file = Path(word.partition("::")[0])
    return file.is_file() and file.suffix != ".xml"


def _load_target(path: Path, options: argparse.Namespace) -> Plan:
    """Return the suite of a file, all suites of a folder, or else all its tests. Raises UsageError if there is none."""
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
    """Return that there is no such file or folder, and which name is near."""
    from rtf.cli.command_tree import TESTRUNNER

    siblings = [one.name for one in path.parent.iterdir()] if path.parent.is_dir() else []
    hint = did_you_mean(path.name, [*siblings, *(command.name for command in TESTRUNNER.commands)])
    return f"there is no file or folder {str(path)!r}{hint or '; a test is named by --test, or by its file'}"


def _load_suites(wanted: Sequence[tuple[Path, bool]], options: argparse.Namespace) -> Plan:
    return load_files(wanted, dict(options.define), lenient=options.lenient) if wanted else Plan()


def _tests_of(folder: Path, options: argparse.Namespace) -> Plan:
    files = plugin_files(folder, recursive=options.recursive)
    plugins: list[tuple[str, str | None]] = [(str(path.resolve()), None) for path in files]
    return Plan((_suite_for(options, folder.resolve().name or "tests", plugins),))


def _suite_for(options: argparse.Namespace, name: str, plugins: list[tuple[str, str | None]]) -> TestSuite:
    return suite_of_plugins(name, plugins, param=options.param, environment=options.environment)


def _select(suites: tuple[TestSuite, ...], options: argparse.Namespace) -> tuple[TestSuite, ...]:
    from rtf.testing import selection

    filters = {}
    if options.names:
        filters[f"-k {options.names!r}"] = selection.name_filter(options.names)
    if options.tags:
        filters[f"--tags {options.tags!r}"] = selection.tag_filter(options.tags)
    planned = getattr(options, "planned", None)
    if planned is not None and (options.last_failed or options.stepwise):
        filters["--resume"] = selection.id_filter(planned)  # the test that failed has been changed since
    else:
        last = Path(options.runs) / journal.LATEST
        if options.last_failed:
            failed = selection.id_filter(_failed_in(last, "--last-failed"))
            filters[f"--last-failed (what did not pass in {last.resolve()})"] = failed
        if options.stepwise and last.exists():
            filters["--stepwise"] = selection.id_filter(_from_first(suites, _failed_in(last, "--stepwise")))
    limited = getattr(options, "limited", {})  # of a run that is resumed: the only cases that it wants
    if filters:
        cases = journal.reported_cases(Path(options.runs), _programs(suites)) if planned is None else {}
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


def _programs(suites: Sequence[TestSuite]) -> set[str]:
    """Return the ids of the tests that are programs."""
    tests = [test for suite in suites for test in suite.tests]
    return {test.id for test in tests if test.found is not None and test.found.language.startswith("executable")}


def _limited(test: TestEntry, limited: Mapping[str, Mapping[str, str]]) -> TestEntry:
    return replace(test, cases=tuple(limited.get(test.id, {}).items()))


def _from_first(suites: tuple[TestSuite, ...], failed: frozenset[str]) -> list[str]:
    """Return the tests from the first one on that did not pass; all of them, if none of those is in the plan."""
    ids = [test.id for suite in suites for test in suite.tests]
    programs = {program_of(test) for test in failed}
    first = next((index for index, test in enumerate(ids) if test in programs), 0)
    return ids[first:]


def _failed_in(folder: Path, option: str) -> frozenset[str]:
    if not folder.exists():
        raise SuiteError(f"{option}: there is no earlier run in {folder.parent}")
    return frozenset(
        test.id for test in journal.results_of(folder).tests.values() if test.verdict is None or not test.verdict.good
    )


def fingerprints(plan: Plan) -> dict[str, str]:
    """Return the fingerprint of each test of a plan, by its id."""
    return {test.id: fingerprint(suite, test) for suite in plan.suites for test in suite.tests}


def said_of_changes(changes: PlanChanged) -> Diagnosed:
    """Return the message that the suites of a run that is resumed were edited."""
    kinds = (("added", changes.added), ("removed", changes.removed), ("changed", changes.changed))
    listed = "; ".join(f"{word}: {', '.join(tests)}" for word, tests in kinds if tests)
    text = f"the suites were edited since the run was begun: {listed}"
    return Diagnosed(
        severity=Severity.WARNING, text=text, hint="what is new or changed is run, what is gone is left out"
    )
