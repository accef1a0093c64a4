"""From suite files and plug-in names to a plan: which tests will run, in which order, with which plug-in files.

A test or fixture whose plug-in cannot be found stays in the plan with the reason, so that no report can lose it.
Plug-ins are described by their text; only a plug-in whose text leaves open whether it has a matrix or several classes
is loaded, in an isolated child.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.errors import Location, nearest
from rtf.testing.dispatch import numbered_copy
from rtf.testing.events import Diagnosed
from rtf.testing.plugin_spec import PluginSpec, combinations
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
    from collections.abc import Iterable, Iterator, Mapping

    from rtf.testing.inspection import Trial

#: A key of a parameter string.
_KEY = re.compile(r"(?<!\S)--(\S+)")


@dataclass(frozen=True, slots=True)
class Plan:
    """Suites, the diagnostics of their files, and the ``variables`` that these use."""

    suites: tuple[TestSuite, ...] = ()
    diagnostics: tuple[Diagnosed, ...] = ()
    variables: frozenset[str] = frozenset()

    @property
    def has_errors(self) -> bool:
        """Whether something that was asked for is not in the plan, so that nothing may be run."""
        return any(diagnosed.severity is Severity.ERROR for diagnosed in self.diagnostics)


def load_files(files: Iterable[tuple[Path, bool]], variables: Mapping[str, str], *, lenient: bool = False) -> Plan:
    """Load suite files. The flag of each says that it must be a suite; any other XML file is ignored.

    With ``lenient`` an unknown element or attribute is a warning.
    """
    from rtf.testing.suite.xml import load_suite

    suites = []
    diagnostics: list[Diagnosed] = []
    asked: set[str] = set()
    for path, required in files:
        loaded = load_suite(path, variables=variables, lenient=lenient)
        if loaded.foreign and not required:
            continue
        asked |= loaded.variables
        diagnostics += loaded.diagnostics
        if loaded.suite is not None:
            suites.append(loaded.suite)
    return Plan(number_suites(suites), tuple(diagnostics), frozenset(asked))


def unused_variables(variables: Mapping[str, str], plan: Plan) -> Iterator[Diagnosed]:
    """Yield a warning for each given variable that no suite uses; a misspelt one would be silent otherwise."""
    for name in variables:
        if name not in plan.variables:
            near = nearest(name, plan.variables)
            hint = f"did you mean {near!r}?" if near else f"write ${{{name}}} where its value is to stand"
            text = f"--define {name}: no suite has ${{{name}}} in it"
            yield Diagnosed(severity=Severity.WARNING, text=text, hint=hint)


def suite_files(folder: Path, *, recursive: bool) -> list[Path]:
    """Return the XML files of a folder in sorted order. Raises SuiteError when it cannot be read."""
    return _files(folder, "*.xml", recursive=recursive)


def plugin_files(folder: Path, *, recursive: bool) -> list[Path]:
    """Return the test plug-in files of a folder in sorted order. Raises SuiteError when it cannot be read."""
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
    """Return a suite without a file, of the plug-ins (name, type) on the command line."""
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


def fingerprint(suite: TestSuite, test: TestEntry) -> str:
    """Return a digest of a test's description in its suite; its place in the file does not matter."""
    fixtures = [replace(fixture, location=Location()) for fixture in suite.fixtures_of(test)]
    how = (test.environment, test.repetition, test.retries, test.requires, test.isolation, test.on_lost)
    what = (test.plugin, test.type, test.param, test.parameters, test.expected)
    return digest(repr((what, how, suite.timeouts_of(test), fixtures)), 12)


class Planner:
    """Finds the plug-in of every test and fixture once, and joins the author's declarations with the suite's values.

    ``overrides`` are the parameters that the command line sets; a matrix does not vary them.
    """

    def __init__(self, overrides: Iterable[tuple[str, str]] = ()) -> None:
        self._overrides = tuple(overrides)
        self._found: dict[tuple[str, str, str | None, str], PluginRef | str] = {}
        self._specs: dict[PluginRef, PluginSpec] = {}

    def plan(self, suites: Iterable[TestSuite]) -> tuple[TestSuite, ...]:
        """Return the suites with all plug-ins, and a test for each class and each combination of a matrix.

        Each test has the tags, requirements and description that its author gave. For a plug-in that is not found the
        plan has all places that were tried.
        """
        suites = tuple(suites)
        self._describe({self._find("test", test) for suite in suites for test in suite.tests})
        return tuple(self._planned(suite) for suite in suites)

    def _describe(self, found: Iterable[PluginRef | str]) -> None:
        """Describe each test's plug-in, and each class of a file with several."""
        refs = {ref for ref in found if not isinstance(ref, str)}
        while refs := {ref for ref in refs if ref not in self._specs}:
            specs = {ref: spec_of(ref) for ref in sorted(refs)}
            unknown = {ref: () for ref, spec in specs.items() if not spec.complete}
            if unknown:
                from rtf.testing.inspection import inspect_plugins

                specs |= {ref: inspection.spec for ref, inspection in inspect_plugins(unknown).items()}
            self._specs |= specs
            refs = {ref._replace(class_name=name) for ref, spec in specs.items() for name in spec.classes}

    def _planned(self, suite: TestSuite) -> TestSuite:
        tests: list[TestEntry] = []
        made: dict[str, list[str]] = {}
        ids = TestIds(suite.id)
        for entry in suite.tests:
            planned = [
                replace(one, id=ids.unique(one.id.removeprefix(f"{suite.id}/"), one.plugin, one.param, one.parameters))
                for member in self._of_classes(entry)
                for one in self._of_matrix(member)
            ]
            made[entry.id] = [one.id for one in planned]
            tests += planned
        return replace(
            numbered_copy(self._with_fixtures(suite, suite.fixtures), 1),
            tests=tuple(_with_requirements(test, made) for test in tests),
        )

    def _with_fixtures(self, suite: TestSuite, entries: Iterable[FixtureEntry]) -> TestSuite:
        """Return the suite with these fixtures, and the plug-in of each."""
        fixtures = []
        for entry in entries:
            found = self._find("fixture", entry)
            said = replace(entry, problem=found) if isinstance(found, str) else replace(entry, found=found)
            fixtures.append(said)
        return replace(suite, fixtures=tuple(fixtures), written=tuple(fixtures))

    def _of_classes(self, entry: TestEntry) -> list[TestEntry]:
        """Return the test, or one for each class if it names a file with several."""
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
        """Return the test with its author's description, once for each combination of its matrix."""
        found = self._find("test", entry)
        if isinstance(found, str):
            return [replace(entry, problem=found)]
        spec = self._specs[found]
        entry = replace(
            entry,
            found=found,
            spec=spec,
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
            for label, parameters in combinations(spec, given)
        ]

    def _find(self, kind: str, entry: TestEntry | FixtureEntry) -> PluginRef | str:
        """Return the plug-in of an entry, or why there is none."""
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

    # Implied fixtures --------------------------------------------------------------------------------------------

    def with_implied_fixtures(self, suites: Iterable[TestSuite]) -> Plan:
        """Return the suites with the fixtures that their tests ask for, where the suites name none.

        A test that may move a robot may leave it in a state that only a fixture, which outlives the test, can correct.
        So each test whose description does not exclude that it moves is loaded in an isolated child and asked for its
        :meth:`~rtf.testing.case.TestCase.implied_fixtures`. A test that gives no answer is not run.
        """
        suites = tuple(suites)
        asking = [
            test
            for suite in suites
            for test in suite.tests
            if not suite.fixtures and test.found is not None and test.spec.may_move
        ]
        if not asking:
            return Plan(suites)
        from rtf.testing.inspection import try_uses  # with all about parameters, which few runs need here
        from rtf.testing.isolation.messages import Use

        uses = {test.id: (test.found, Use.of(test, self._overrides)) for test in asking if test.found is not None}
        found = try_uses(uses.values(), ask=True)
        trials = {test: found[use] for test, use in uses.items()}
        said: list[Diagnosed] = []
        return Plan(tuple(self._with_asked(suite, trials, said) for suite in suites), tuple(said))

    def _with_asked(self, suite: TestSuite, trials: Mapping[str, Trial], said: list[Diagnosed]) -> TestSuite:
        if suite.fixtures or not any(test.id in trials for test in suite.tests):
            return suite
        entries: dict[tuple[str, tuple[tuple[str, str], ...]], FixtureEntry] = {}
        tests: list[TestEntry] = []
        for test in suite.tests:
            trial = trials.get(test.id)
            if trial is not None and trial.no_answer:
                text = f"{test.name} was not asked what puts right what it may leave behind: {trial.no_answer}"
                said.append(Diagnosed(severity=Severity.WARNING, text=text))
                tests.append(replace(test, problem=text, found=None))
                continue
            asked = () if trial is None else trial.fixtures
            for name, parameters in asked:
                if (name, parameters) not in entries:  # equal requests share one
                    others = sum(other == name for other, _ in entries)
                    entries[name, parameters] = _implied(name, parameters, others)
            tests.append(replace(test, fixtures=tuple(entries[wanted].name for wanted in asked)))
        return self._with_fixtures(suite, entries.values()).with_tests(tests)


def _implied(name: str, parameters: tuple[tuple[str, str], ...], others: int) -> FixtureEntry:
    """Return the fixture of the suite for one request, where ``others`` are of the same plug-in."""
    shipped = shipped_folder("fixture") / f"{name}.py"  # and no file of that name beside the tests
    return FixtureEntry(
        name=f"{name}~{others + 1}" if others else name,
        plugin=str(shipped) if shipped.is_file() else name,
        parameters=parameters,
    )


def _with_requirements(entry: TestEntry, made: Mapping[str, list[str]]) -> TestEntry:
    """Return the test with the ids of those tests that were made of a required one."""
    if not entry.required_tests:
        return entry
    requires: list[str] = []
    for token in entry.requires:
        other = token.removeprefix(TEST_REQUIREMENT)
        requires += [token] if other == token else [TEST_REQUIREMENT + one for one in made.get(other, [other])]
    return replace(entry, requires=tuple(requires))
