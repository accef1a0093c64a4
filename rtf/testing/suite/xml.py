"""Loading a suite file: all that is wrong with it in one go, and the suite as far as it can be used.

Files of the C++ framework load as they are, with its meaning: element names are compared without regard to case, white
space is condensed, an ``<environment>`` is given to the tests that follow it. What a file may contain is listed in
:mod:`rtf.testing.suite.elements` and explained in ``suite.xsd``.

Includes name a suite file relative to the including one; ``../`` is allowed, so that a folder of suites can share
parts, while absolute paths and addresses are refused, because they break on the next machine. Nothing is ever fetched.
An included file keeps its own environment and defaults for its own tests and takes from the including file what it
does not say; its name, description and time-out of the whole suite count only where it is loaded by itself.
"""

from __future__ import annotations

import re
import stat
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.errors import Location
from rtf.testing.suite.diagnostics import Budget, DiagnosticLog, OverBudgetError, diagnosed
from rtf.testing.suite.elements import KINDS, Given, check
from rtf.testing.suite.entries import Surroundings, read_fixture, read_test, read_timeouts
from rtf.testing.suite.ids import NameBook, TestIds
from rtf.testing.suite.model import FixtureEntry, SuiteError, TestEntry, TestSuite, suite_id_of
from rtf.testing.suite.references import check_test_fixtures, order_fixtures, resolve_requirements
from rtf.testing.suite.scan import MAX_BYTES, Element, scan
from rtf.testing.suite.values import plugin_stem, quote
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.events import Diagnosed

SCHEMA = Path(__file__).with_name("suite.xsd")
"""The schema for editors and for ``xmllint``; the loader does not need it."""

_UNNAMED = "unknown"  # what the C++ framework calls a suite without a name
_MAX_INCLUDE_DEPTH = 16
_MAX_LOOP_DEPTH = 16  # both keep the recursion far from the interpreter's limit
_NOT_RELATIVE = re.compile(r"[/\\~]|[A-Za-z][A-Za-z0-9+.-]*:")
_VARIABLE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True, slots=True)
class LoadedSuite:
    """The outcome of loading a file.

    ``suite`` is None when the file could not be understood at all. Otherwise it holds every entry that is sound; each
    that is not was left out and has an error among ``diagnostics``, so a suite with errors is not the suite that was
    meant. ``foreign`` is True for XML that is no suite at all, which a caller that loads a whole folder passes over.
    """

    suite: TestSuite | None
    diagnostics: tuple[Diagnosed, ...] = ()
    foreign: bool = False

    @property
    def errors(self) -> tuple[Diagnosed, ...]:
        """The problems for which the suite must not be run."""
        return tuple(diagnostic for diagnostic in self.diagnostics if diagnostic.severity is Severity.ERROR)

    @property
    def warnings(self) -> tuple[Diagnosed, ...]:
        """The problems that leave the suite as it was meant."""
        return tuple(diagnostic for diagnostic in self.diagnostics if diagnostic.severity is Severity.WARNING)


def load_suite(path: str | Path, *, variables: Mapping[str, str] | None = None, lenient: bool = False) -> LoadedSuite:
    """Load a suite file. ``variables`` are put in for ``${name}`` everywhere. Nothing is raised for a bad file.

    With ``lenient`` an unknown element or attribute is a warning.
    """
    try:
        data = _read(Path(path))
    except SuiteError as error:
        return LoadedSuite(None, (diagnosed(Severity.ERROR, str(error), Location(str(path))),))
    return load_suite_bytes(data, str(path), variables=variables, lenient=lenient)


def load_suite_bytes(
    data: bytes, file: str, *, variables: Mapping[str, str] | None = None, lenient: bool = False
) -> LoadedSuite:
    """Load a suite from memory; ``file`` names it in messages, and includes are relative to the folder of that name."""
    problems = DiagnosticLog(lenient=lenient)
    loader = _Loader(file, dict(variables or {}), problems)
    suite = loader.load(data)
    return LoadedSuite(suite, tuple(problems), loader.foreign)


def _read(path: Path) -> bytes:
    """Read a regular file; never waits for a pipe and never reads more than the limit allows."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            kind = "a folder" if path.is_dir() else "no regular file"
            raise SuiteError(f"this is {kind}, not a suite file")
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SuiteError(f"the suite file cannot be read: {reason}") from None


class _Loader:
    """Reads one suite and what it includes into one list of fixtures and one list of tests."""

    def __init__(self, file: str, variables: Mapping[str, str], problems: DiagnosticLog) -> None:
        self._file = file
        self._variables = variables
        self._problems = problems
        self._budget = Budget()
        self._ids = TestIds("")
        self._fixtures: dict[str, FixtureEntry] = {}
        self._faulty_fixtures: set[str] = set()
        self._tests: list[TestEntry] = []
        self._preload: dict[str, None] = {}
        self._including: list[Path] = []
        self._complete = True
        self.foreign = False

    def load(self, data: bytes) -> TestSuite | None:
        root = self._scan(data, self._file)
        if root is None:
            return None
        try:
            suite = self._suite(root)
        except OverBudgetError as error:
            self._problems.error(error.message, error.location, "split the suite")
            return None
        return suite if self._complete else None  # what refers to what cannot be judged when half of it is missing

    def _scan(self, data: bytes, file: str) -> Element | None:
        document = scan(data, file, self._problems)
        self._complete = self._complete and document.complete
        root = document.root
        if root is None:
            return None
        if root.name != "suite":
            self.foreign = document.complete and not self._including
            message = f"this is not a test suite file: its root is <{quote(root.tag)[1:-1]}>, not <suite>"
            self._problems.error(message, root.location, self._problems.did_you_mean(root.tag, ["suite"]))
            return None
        check(root, self._problems)
        return root

    def _given(self, element: Element, around: Surroundings) -> Given:
        return Given(element, around.bindings, self._problems, self._budget)

    def _suite(self, root: Element) -> TestSuite | None:
        around = Surroundings(bindings=self._variables)
        given = self._given(root, around)
        name = given.get("name")
        if name is None:
            given.warn(f"the suite has no name; it is called {_UNNAMED!r}", 'add name="…"')
            name = _UNNAMED
        suite_id = suite_id_of(name)
        self._ids = TestIds(suite_id)
        around = around.within(given)
        self._read_entries(given, around)
        timeouts, description = read_timeouts(given), given.text_of("description") or ""
        if not self._complete:
            return None
        fixtures = order_fixtures([*self._fixtures.values()], self._problems)
        named = {*self._fixtures, *self._faulty_fixtures}
        tests = check_test_fixtures(self._tests, fixtures, named, self._problems)
        return TestSuite(
            id=suite_id,
            name=name,
            file=self._file,
            description=description,
            environment=around.fixture_environment,
            timeouts=timeouts,
            timeout=given.get("timeout"),
            tags=around.tags,
            copies=max(1, given.get("copies", 1)),
            preload=tuple(self._preload),
            fixtures=fixtures,
            tests=tuple(resolve_requirements(tests, suite_id, self._problems, self._budget)),
            location=root.location,
        )

    def _read_entries(self, suite: Given, around: Surroundings) -> None:
        """Read the fixtures and tests of one file, and the modules that it asks to have loaded before tests start."""
        self._preload.update(dict.fromkeys(suite.get("preload", ())))
        self._read_fixtures(suite, around)
        self._walk(suite.element, around)

    def _walk(self, parent: Element, around: Surroundings) -> None:
        allowed = KINDS[parent.name].children
        without = 0
        for child in parent.children:
            before = len(self._tests)
            match child.name if child.name in allowed else "":
                case "test":
                    self._test(child, around)
                case "for":
                    self._for(self._given(child, around), around)
                case "include":
                    self._include(self._given(child, around), around)
                case "environment":
                    given = self._given(child, around)
                    _warn_if_late(given, without)
                    around = replace(around, environment=given.body())
            if not any(grandchild.name == "environment" for grandchild in child.children):
                without += len(self._tests) - before

    def _test(self, element: Element, around: Surroundings) -> None:
        self._budget.spend(element.location, tests=1, steps=len(around.parameters))
        entry = read_test(self._given(element, around), around, self._ids)
        if entry is not None:
            self._tests.append(entry)

    def _for(self, given: Given, around: Surroundings) -> None:
        name, values = given.get("name", ""), given.get("in")
        if given.ok and not _VARIABLE_NAME.fullmatch(name):
            given.fail(f"{quote(name)} cannot be the name of a loop variable", "name", "use letters, digits, _ - .")
        if given.ok and not values:
            given.fail("this <for> has no values to go through", "in", 'write in="left_arm right_arm"')
        if given.ok and len(around.loop_values) >= _MAX_LOOP_DEPTH:
            given.fail(f"loops are nested more than {_MAX_LOOP_DEPTH} deep")
        if not given.ok:
            return
        for value in values:
            bindings = {**around.bindings, name: value}
            self._budget.spend(given.element.location, steps=1 + len(bindings))
            self._walk(given.element, replace(around, bindings=bindings, loop_values=(*around.loop_values, value)))

    def _include(self, given: Given, around: Surroundings) -> None:
        target, location = given.body(), given.element.location
        if not target or _NOT_RELATIVE.match(target):
            hint = "name a suite file relative to this one, such as ../common/arms.xml"
            given.fail(f"an <include> cannot be {quote(target)}", hint=hint)
            return
        name = Path(location.file).parent / target
        try:
            path, here = name.resolve(), Path(location.file).resolve()
            data = _read(path)
        except (OSError, RuntimeError, ValueError) as error:  # SuiteError is a ValueError
            given.fail(f"cannot include {quote(target)}: {error}")
            return
        chain = [*self._including, here, path]
        if path in chain[:-1] or len(chain) > _MAX_INCLUDE_DEPTH:
            what = "in a circle" if path in chain[:-1] else f"more than {_MAX_INCLUDE_DEPTH} deep"
            given.fail(f"files include each other {what}: {' -> '.join(part.name for part in chain)}")
            return
        self._budget.spend(location, files=1, characters=len(data))
        self._including.append(here)
        self._included(data, str(name), around)
        self._including.pop()

    def _included(self, data: bytes, file: str, around: Surroundings) -> None:
        root = self._scan(data, file)
        if root is None:
            self._complete = False
            return
        given = self._given(root, around)
        timeouts = read_timeouts(given).inherit(around.timeouts)
        self._read_entries(given, replace(around.within(given), timeouts=timeouts))

    def _read_fixtures(self, suite: Given, around: Surroundings) -> None:
        """Read one file's fixtures and add them to those of the files before; the same fixture twice is one."""
        names = NameBook()
        all_given = [*suite.children("fixture")]
        for given in all_given:
            names.reserve(given.get("name", ""))
        here: set[str] = set()
        for given in all_given:
            element = given.element
            entry = read_fixture(given, around, names)
            if entry is None:
                self._faulty_fixtures.add(element.attributes.get("name") or plugin_stem(element.text))
                continue
            other = self._fixtures.setdefault(entry.name, entry)
            if entry.name in here:
                message = f"the fixture {quote(entry.name)} is already defined at {other.location}"
                self._problems.error(message, element.location, 'give one of them another name="…"')
            elif differences := _differences(entry, other):
                message = f"the fixture {quote(entry.name)} differs from the one at {other.location} in {differences}"
                self._problems.error(message, element.location, 'make them equal, or give one another name="…"')
            here.add(entry.name)


def _differences(one: FixtureEntry, other: FixtureEntry) -> str:
    names = (item.name for item in fields_of(one) if item.name != "location")
    return ", ".join(name for name in names if getattr(one, name) != getattr(other, name))


def _warn_if_late(environment: Given, tests: int) -> None:
    if tests:
        environment.warn(
            f"this <environment> comes too late for {tests} {'test' if tests == 1 else 'tests'} above it",
            "move it to the top of the file, or give those tests an <environment> of their own",
        )
