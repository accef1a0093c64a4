"""From suite files and plug-in names to a plan: which tests will run, in which order, with which plug-in files.

Nothing of a plug-in is executed here. A test or fixture whose plug-in cannot be found stays in the plan with the
reason, so that no report can lose it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing.events import Diagnosed
from rtf.testing.plugins import ClassFacts, PluginError, PluginRef, facts_of, find
from rtf.testing.suite.model import FixtureEntry, SuiteError, TestEntry, TestSuite, number_suites, suite_id_of
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rtf.testing.suite.diagnostics import Diagnostic


@dataclass(frozen=True, slots=True)
class PlannedTest:
    """A test of the plan: its entry, its plug-in or why there is none, and its author's time-out in seconds."""

    entry: TestEntry
    plugin: PluginRef | None
    problem: str = ""
    timeout: float | None = None


@dataclass(frozen=True, slots=True)
class PlannedSuite:
    """A suite of the plan; each fixture comes with its plug-in or the reason why there is none."""

    suite: TestSuite
    tests: tuple[PlannedTest, ...]
    fixtures: tuple[tuple[FixtureEntry, PluginRef | str], ...]


@dataclass(frozen=True, slots=True)
class Loaded:
    """What the files gave: suites, and everything that is to be said about the files."""

    suites: tuple[TestSuite, ...]
    diagnostics: tuple[Diagnosed, ...]

    @property
    def has_errors(self) -> bool:
        """Whether something that was asked for is not in the plan."""
        return any(diagnosed.severity is Severity.ERROR for diagnosed in self.diagnostics)


def load_files(files: Iterable[tuple[Path, bool]], variables: Mapping[str, str], *, lenient: bool = False) -> Loaded:
    """Load suite files; the flag of each says that it must be a suite (else a file that is none is passed over).

    With ``lenient`` an unknown element or attribute is a warning.
    """
    from rtf.testing.suite.xml import load_suite

    suites = []
    diagnostics: list[Diagnosed] = []
    for path, required in files:
        loaded = load_suite(path, variables=variables, lenient=lenient)
        problems = [diagnosed_from(diagnostic) for diagnostic in loaded.diagnostics]
        if loaded.foreign and not required:
            continue
        diagnostics.extend(problems)
        if loaded.suite is not None:
            suites.append(loaded.suite)
    return Loaded(number_suites(suites), tuple(diagnostics))


def diagnosed_from(diagnostic: Diagnostic) -> Diagnosed:
    """The event that tells of a problem in a suite file."""
    location = diagnostic.location
    return Diagnosed(
        severity=Severity(str(diagnostic.severity)),
        text=diagnostic.message,
        file=location.file,
        line=location.line,
        column=location.column,
        hint=diagnostic.hint,
    )


def suite_files(folder: Path, *, recursive: bool) -> list[Path]:
    """The XML files of a folder in sorted order. Raises SuiteError when it cannot be read."""
    return _files(folder, "*.xml", recursive=recursive)


def plugin_files(folder: Path, *, recursive: bool) -> list[Path]:
    """The test plug-in files of a folder in sorted order. Raises SuiteError when it cannot be read."""
    found = [path for pattern in ("*.py", "*.lua") for path in _files(folder, pattern, recursive=recursive)]
    return sorted(path for path in found if not path.name.startswith(("_", ".")))


def _files(folder: Path, pattern: str, *, recursive: bool) -> list[Path]:
    if not folder.is_dir():
        raise SuiteError(f"{folder} is no folder")
    found = folder.rglob(pattern) if recursive else folder.glob(pattern)
    return sorted(path for path in found if path.is_file())


def suite_of_plugins(
    name: str, plugins: Iterable[tuple[str, str | None]], *, param: str, environment: str
) -> TestSuite:
    """A suite without a file, for plug-ins that were named on the command line (name, type)."""
    suite_id = suite_id_of(name)
    tests: list[TestEntry] = []
    taken: set[str] = set()
    for plugin, type_ in plugins:
        stem = Path(plugin).stem if "/" in plugin or plugin.endswith((".py", ".lua", ".so")) else plugin
        count = 1
        test_id = f"{suite_id}/{stem}"
        while test_id in taken:
            count += 1
            test_id = f"{suite_id}/{stem}~{count}"
        taken.add(test_id)
        tests.append(TestEntry(id=test_id, name=stem, plugin=plugin, type=type_, param=param, environment=environment))
    return TestSuite(id=suite_id, name=name, environment=environment, tests=tuple(tests))


class Planner:
    """Finds the plug-in of every test and fixture once, and lays what authors declared beside what the suites say."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str | None, str], PluginRef | str] = {}
        self._facts: dict[PluginRef, ClassFacts | None] = {}

    def complete(self, suites: Iterable[TestSuite]) -> tuple[TestSuite, ...]:
        """The suites with the tags, requirements and descriptions that the plug-ins' authors gave, to select by."""
        return tuple(suite.with_tests(self._completed(entry) for entry in suite.tests) for suite in suites)

    def plan(self, suites: Iterable[TestSuite]) -> tuple[PlannedSuite, ...]:
        """Every test and fixture with its plug-in. What is not found is in it with all places that were tried."""
        return tuple(
            PlannedSuite(
                suite,
                tuple(self._planned(entry) for entry in suite.tests),
                tuple((entry, self._find("fixture", entry)) for entry in suite.fixtures),
            )
            for suite in suites
        )

    def _completed(self, entry: TestEntry) -> TestEntry:
        found = self._find("test", entry)
        facts = None if isinstance(found, str) else self._facts_of(found)
        if facts is None:
            return entry
        return replace(
            entry,
            tags=tuple(dict.fromkeys((*entry.tags, *facts.tags))),
            requires=tuple(dict.fromkeys((*entry.requires, *facts.requires))),
            description=entry.description or facts.description,
        )

    def _planned(self, entry: TestEntry) -> PlannedTest:
        found = self._find("test", entry)
        if isinstance(found, str) or entry.problem:
            return PlannedTest(entry, None, entry.problem or str(found))
        facts = self._facts_of(found)
        return PlannedTest(entry, found, "", None if facts is None else facts.timeout)

    def _facts_of(self, found: PluginRef) -> ClassFacts | None:
        if found not in self._facts:
            self._facts[found] = facts_of(found)
        return self._facts[found]

    def _find(self, kind: str, entry: TestEntry | FixtureEntry) -> PluginRef | str:
        key = (kind, entry.plugin, entry.type, entry.location.file)
        found = self._found.get(key)
        if found is None:
            beside = Path(entry.location.file).parent if entry.location.file else Path.cwd()
            try:
                found = find(kind, entry.plugin, entry.type, beside=beside)
            except PluginError as error:
                found = str(error)
            self._found[key] = found
        return found
