"""From suite files and plug-in names to a plan: which tests will run, in which order, with which plug-in files.

A test or fixture whose plug-in cannot be found stays in the plan with the reason, so that no report can lose it.
Plug-ins are described by their text; only one that hides there whether it has a matrix or several classes is loaded, in
an isolated child.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.errors import Location
from rtf.testing.dispatch import numbered_copy
from rtf.testing.events import Diagnosed
from rtf.testing.plugin_spec import UNKNOWN, PluginSpec, combinations
from rtf.testing.plugins import PluginError, PluginRef, find, shipped_folder, spec_of
from rtf.testing.suite.ids import TestIds, digest, label_of_plugin, name_of_plugin, varied
from rtf.testing.suite.model import (
    TEST_REQUIREMENT,
    FixtureEntry,
    SuiteError,
    TestEntry,
    TestSuite,
    number_suites,
    suite_id_of,
)
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rtf.testing.inspection import Trial


@dataclass(frozen=True, slots=True)
class PlannedTest:
    """A test of the plan: its entry, its plug-in or why there is none, and what that says of itself."""

    entry: TestEntry
    plugin: PluginRef | None
    problem: str = ""
    spec: PluginSpec = UNKNOWN

    @property
    def timeout(self) -> float | None:
        """Its author's limit for one run of the body, in seconds."""
        return self.spec.timeout


@dataclass(frozen=True, slots=True)
class PlannedSuite:
    """A suite of the plan; each fixture comes with its plug-in or the reason why there is none.

    ``copy`` says which of the suite workers that run it at the same time this one is for.
    """

    suite: TestSuite
    tests: tuple[PlannedTest, ...]
    fixtures: tuple[tuple[FixtureEntry, PluginRef | str], ...]
    copy: int = 1


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
        if loaded.foreign and not required:
            continue
        diagnostics += loaded.diagnostics
        if loaded.suite is not None:
            suites.append(loaded.suite)
    return Loaded(number_suites(suites), tuple(diagnostics))


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
    ids = TestIds(suite_id)
    tests = tuple(
        TestEntry(
            id=ids.unique(label_of_plugin(plugin, param), plugin, type_),
            name=name_of_plugin(plugin, param),
            plugin=plugin,
            type=type_,
            param=param,
            environment=environment,
        )
        for plugin, type_ in plugins
    )
    return TestSuite(id=suite_id, name=name, environment=environment, tests=tests)


def fingerprint(suite: TestSuite, entry: TestEntry) -> str:
    """Return a digest of what the suite says of a test and how it runs; its place in the file does not matter."""
    fixtures = [replace(fixture, location=Location()) for fixture in suite.fixtures_of(entry)]
    how = (entry.environment, entry.repetition, entry.retries, entry.requires, entry.isolation, entry.on_lost)
    what = (entry.plugin, entry.type, entry.param, entry.parameters, entry.expected)
    return digest(repr((what, how, suite.timeouts_of(entry), fixtures)), 12)


class Completed(NamedTuple):
    """A suite with the fixtures that its tests ask for, and the problems that were found."""

    suite: PlannedSuite
    diagnostics: tuple[Diagnosed, ...]


class Planner:
    """Finds the plug-in of every test and fixture once, and joins what authors declared with what the suites say.

    ``overrides`` are the parameters that the command line sets; a matrix does not vary them.
    """

    def __init__(self, overrides: Iterable[tuple[str, str]] = ()) -> None:
        self._overrides = tuple(overrides)
        self._found: dict[tuple[str, str, str | None, str], PluginRef | str] = {}
        self._specs: dict[PluginRef, PluginSpec] = {}

    def complete(self, suites: Iterable[TestSuite]) -> tuple[TestSuite, ...]:
        """The suites with a test for each class and each combination of a matrix, to select from.

        Each has the tags, requirements and description that its author gave.
        """
        suites = tuple(suites)
        self._describe(entry for suite in suites for entry in suite.tests)
        return tuple(self._completed_suite(suite) for suite in suites)

    def plan(self, suites: Iterable[TestSuite]) -> tuple[PlannedSuite, ...]:
        """Every test and fixture with its plug-in. What is not found is in it with all places that were tried."""
        suites = tuple(suites)
        self._describe(entry for suite in suites for entry in suite.tests)
        return tuple(
            numbered_copy(
                PlannedSuite(
                    suite,
                    tuple(self._planned(entry) for entry in suite.tests),
                    tuple((entry, self._find("fixture", entry)) for entry in suite.fixtures),
                ),
                1,
            )
            for suite in suites
        )

    def programs(self, suites: Iterable[TestSuite]) -> set[str]:
        """The ids of the tests that are programs."""
        entries = [entry for suite in suites for entry in suite.tests]
        found = [self._find("test", entry) for entry in entries]
        return {
            entry.id
            for entry, ref in zip(entries, found, strict=True)
            if not isinstance(ref, str) and ref.language.startswith("executable")
        }

    def _describe(self, entries: Iterable[TestEntry]) -> None:
        """Have the description of each test's plug-in, and of each class where it is a file with several."""
        found = {self._find("test", entry) for entry in entries}
        refs = {ref for ref in found if not isinstance(ref, str)}
        while refs := {ref for ref in refs if ref not in self._specs}:
            specs = {ref: spec_of(ref) for ref in sorted(refs)}
            unknown = {ref: () for ref, spec in specs.items() if not spec.complete}
            if unknown:
                from rtf.testing.inspection import inspect_plugins

                specs |= {ref: inspection.spec for ref, inspection in inspect_plugins(unknown).items()}
            self._specs |= specs
            refs = {ref._replace(class_name=name) for ref, spec in specs.items() for name in spec.classes}

    def _completed_suite(self, suite: TestSuite) -> TestSuite:
        tests: list[TestEntry] = []
        made: dict[str, list[str]] = {}
        ids = TestIds(suite.id)
        for entry in suite.tests:
            completed = [one for member in self._of_classes(entry) for one in self._of_matrix(member)]
            completed = [
                replace(one, id=ids.unique(one.id.removeprefix(f"{suite.id}/"), one.plugin, one.param, one.parameters))
                for one in completed
            ]
            made[entry.id] = [one.id for one in completed]
            tests += completed
        return suite.with_tests(_with_requirements(entry, made) for entry in tests)

    def _of_classes(self, entry: TestEntry) -> list[TestEntry]:
        """The test, or one for each class where it names a file with several."""
        found = self._find("test", entry)
        names = () if isinstance(found, str) else self._specs[found].classes
        return [
            replace(
                entry,
                id=varied(entry.id, class_name=name),
                name=f"{entry.name}::{name}",
                plugin=f"{entry.plugin}::{name}",
            )
            for name in names
        ] or [entry]

    def _of_matrix(self, entry: TestEntry) -> list[TestEntry]:
        """The test as its author describes it, once for each combination of its matrix."""
        found = self._find("test", entry)
        if isinstance(found, str):
            return [entry]
        spec = self._specs[found]
        entry = replace(
            entry,
            tags=tuple(dict.fromkeys((*entry.tags, *spec.tags))),
            requires=tuple(dict.fromkeys((*entry.requires, *spec.requires))),
            occupies=tuple(dict.fromkeys((*entry.occupies, *(spec.occupies or "").split()))),
            description=entry.description or spec.summary,
        )
        if not spec.matrix:
            return [entry]
        given = {*(name for name, _ in (*self._overrides, *entry.parameters)), *_KEY.findall(entry.param)}
        return [
            replace(
                entry,
                id=varied(entry.id, variant=label),
                name=f"{entry.name}[{label}]" if label else entry.name,
                parameters=(*entry.parameters, *parameters),
            )
            for label, parameters in combinations(spec.matrix, given)
        ]

    def _planned(self, entry: TestEntry) -> PlannedTest:
        found = self._find("test", entry)
        if isinstance(found, str) or entry.problem:
            return PlannedTest(entry, None, entry.problem or str(found))
        return PlannedTest(entry, found, "", self._specs[found])

    # Implied fixtures --------------------------------------------------------------------------------------------

    def with_implied_fixtures(self, planned: PlannedSuite) -> Completed:
        """The suite with the fixtures that its tests ask for, where it names none itself.

        A test that may move a robot may leave it in a state that only a fixture, which outlives the test, can put
        right. So each test whose description does not exclude that it moves is loaded in an isolated child and asked
        for its :meth:`~rtf.testing.case.TestCase.implied_fixtures`. One that gives no answer is not run.
        """
        trials = {} if planned.suite.fixtures else self._ask(planned.tests)
        if not trials:
            return Completed(planned, ())
        entries: dict[tuple[str, tuple[tuple[str, str], ...]], FixtureEntry] = {}
        said: list[Diagnosed] = []
        tests: list[TestEntry] = []
        for test in planned.suite.tests:
            trial = trials.get(test.id)
            if trial is not None and trial.no_answer:
                text = f"{test.name} was not asked what puts right what it may leave behind: {trial.no_answer}"
                said.append(Diagnosed(severity=Severity.WARNING, text=text))
                tests.append(replace(test, problem=text))
                continue
            asked = () if trial is None else trial.fixtures
            for name, parameters in asked:
                if (name, parameters) not in entries:  # equal requests share one
                    others = sum(other == name for other, _ in entries)
                    entries[name, parameters] = _implied(name, parameters, others)
            tests.append(replace(test, fixtures=tuple(entries[wanted].name for wanted in asked)))
        suite = replace(planned.suite, tests=tuple(tests), fixtures=tuple(entries.values()))
        return Completed(self.plan([suite])[0], tuple(said))

    def _ask(self, tests: Iterable[PlannedTest]) -> dict[str, Trial]:
        """What each test asks for, by its id. One that cannot be loaded asks for nothing; its run says why."""
        asking = [test for test in tests if test.plugin is not None and test.spec.may_move]
        if not asking:
            return {}
        from rtf.testing.inspection import try_uses  # with all about parameters, which few runs need here
        from rtf.testing.isolation.messages import Use

        uses = {
            test.entry.id: (test.plugin, Use.of(test.entry, self._overrides))
            for test in asking
            if test.plugin is not None
        }
        found = try_uses(uses.values(), ask=True)
        return {test: found[use] for test, use in uses.items()}

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


def _implied(name: str, parameters: tuple[tuple[str, str], ...], others: int) -> FixtureEntry:
    """The fixture of the suite for one request, where ``others`` are of the same plug-in."""
    shipped = shipped_folder("fixture") / f"{name}.py"  # and no file of that name beside the tests
    return FixtureEntry(
        name=f"{name}~{others + 1}" if others else name,
        plugin=str(shipped) if shipped.is_file() else name,
        parameters=parameters,
    )


#: A key of a parameter string.
_KEY = re.compile(r"(?<!\S)--(\S+)")


def _with_requirements(entry: TestEntry, made: Mapping[str, list[str]]) -> TestEntry:
    """The test with the ids of those that were made of a test that it requires."""
    if not entry.required_tests:
        return entry
    requires: list[str] = []
    for token in entry.requires:
        other = token.removeprefix(TEST_REQUIREMENT)
        requires += [token] if other == token else [TEST_REQUIREMENT + one for one in made.get(other, [other])]
    return replace(entry, requires=tuple(requires))
