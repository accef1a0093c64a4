"""Loading a suite file: all its problems in one go, and the suite as far as it can be used.

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
from dataclasses import dataclass, field, replace
from dataclasses import fields as fields_of
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.errors import Location
from rtf.testing.suite.diagnostics import DiagnosticLog, diagnosed
from rtf.testing.suite.elements import KINDS, Given, check, condensed
from rtf.testing.suite.ids import NameBook, TestIds, label_of_name, label_of_plugin, name_of_plugin
from rtf.testing.suite.model import Expected, FixtureEntry, SuiteError, TestEntry, TestSuite, Timeouts, suite_id_of
from rtf.testing.suite.references import check_test_fixtures, order_fixtures, resolve_requirements
from rtf.testing.suite.values import parse_duration, plugin_stem
from rtf.testing.verdict import Severity
from rtf.xml_tree import MAX_BYTES, Element, XmlError, parse, quote

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rtf.testing.events import Diagnosed

SCHEMA = Path(__file__).with_name("suite.xsd")
"""The schema for editors and for ``xmllint``; the loader does not need it."""

_UNNAMED = "unknown"  # what the C++ framework calls a suite without a name
_MAX_INCLUDE_DEPTH = 16
_MAX_LOOP_DEPTH = 16  # both keep the recursion far from the interpreter's limit
_NOT_RELATIVE = re.compile(r"[/\\~]|[A-Za-z][A-Za-z0-9+.-]*:")
_VARIABLE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]{0,63}")
_SEPARATORS = re.compile(r"""[\s,"']+""")
_CONTAINERS = frozenset({"suite", "for"})
#: The attributes that are fields of an entry by the same name.
_OF_TEST = (
    *("type", "param", "description", "repetition", "retries", "expected"),
    *("requires", "occupies", "isolation", "fixtures", "on-lost"),
)
_OF_FIXTURE = ("type", "param", "depends", "scope", "restarts", "backoff", "check-period", "on-lost")
#: Those of a suite that hold for each of its tests.
_DEFAULTS = ("retries", "isolation", "on-lost")


@dataclass(frozen=True, slots=True)
class LoadedSuite:
    """The outcome of loading a file.

    ``suite`` is None when the file could not be understood at all. Otherwise it holds every entry that is sound; each
    that is not was left out and has an error among ``diagnostics``, so a suite with errors is not the suite that was
    meant. ``foreign`` is True for XML that is no suite at all, which a caller that loads a whole folder passes over.
    ``variables`` are those that the file and what it includes ask for.
    """

    suite: TestSuite | None
    diagnostics: tuple[Diagnosed, ...] = ()
    foreign: bool = False
    variables: frozenset[str] = frozenset()

    @property
    def errors(self) -> tuple[Diagnosed, ...]:
        """The problems for which the suite must not be run."""
        return tuple(one for one in self.diagnostics if one.severity is Severity.ERROR)


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
    return LoadedSuite(suite, tuple(problems), loader.foreign, frozenset(problems.variables))


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Surroundings:
    """The context at one place of a file: variables, loop values (outermost first), environment, defaults of tests."""

    bindings: Mapping[str, str]
    loop_values: tuple[str, ...] = ()
    environment: str = ""
    fixture_environment: str = ""
    timeouts: Timeouts = field(default_factory=Timeouts)
    tags: tuple[str, ...] = ()
    parameters: tuple[tuple[str, str], ...] = ()
    defaults: Mapping[str, Any] = field(default_factory=dict)  # of attributes of tests

    def within(self, suite: Given) -> _Surroundings:
        """Return the context with a file's settings for all its tests, wherever in the file they are."""
        return replace(
            self,
            fixture_environment=suite.text_of("environment", self.fixture_environment),
            defaults={**self.defaults, **{name: suite.said[name] for name in _DEFAULTS if name in suite.said}},
            tags=_tags(suite, self.tags),
            parameters=self.parameters + _parameters(suite),
        )


class _Loader:
    """Reads one suite and its includes into one list of fixtures and one list of tests."""

    def __init__(self, file: str, variables: Mapping[str, str], problems: DiagnosticLog) -> None:
        self._file = file
        self._variables = variables
        self._problems = problems
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
        except XmlError as error:  # it unfolds into too much
            self._problems.error(error.message, error.location, error.hint)
            return None
        return suite if self._complete else None  # what refers to what cannot be judged when half of it is missing

    def _scan(self, data: bytes, file: str) -> Element | None:
        """Return the root of a file; of a broken file it has the part that was read, and the suite is not complete."""
        try:
            root = parse(data, file, self._problems.warning).root
        except XmlError as error:
            self._complete = False
            self._problems.error(error.message, error.location, error.hint)
            root = _sound_part(error.before)
        if root is None:
            return None
        if root.name != "suite":
            self.foreign = self._complete and not self._including
            message = f"this is not a test suite file: its root is <{quote(root.tag)[1:-1]}>, not <suite>"
            self._problems.error(message, root.location, self._problems.did_you_mean(root.tag, ["suite"]))
            return None
        check(root, self._problems)
        return root

    def _suite(self, root: Element) -> TestSuite | None:
        given = Given(root, self._variables, self._problems)
        name = given.get("name")
        if name is None:
            given.warn(f"the suite has no name; it is called {_UNNAMED!r}", 'add name="…"')
            name = _UNNAMED
        suite_id = suite_id_of(name)
        self._ids = TestIds(suite_id)
        around = _Surroundings(bindings=self._variables).within(given)
        self._read_entries(given, around)
        timeouts, description = _timeouts(given), given.text_of("description")
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
            tests=tuple(resolve_requirements(tests, suite_id, self._problems)),
            location=root.location,
        )

    def _read_entries(self, suite: Given, around: _Surroundings) -> None:
        """Read the fixtures and tests of one file, and the modules that it asks to have loaded before tests start."""
        self._preload.update(dict.fromkeys(suite.get("preload", ())))
        self._read_fixtures(suite, around)
        self._walk(suite.element, around)

    def _walk(self, parent: Element, around: _Surroundings) -> None:
        allowed = KINDS[parent.name].children
        without = 0
        for child in parent.children:
            before = len(self._tests)
            if child.name in allowed and child.name in ("test", "for", "include", "environment"):
                if child.name == "test":
                    self._problems.spend(child.location, tests=1, steps=len(around.parameters))
                given = Given(child, around.bindings, self._problems)
                match child.name:
                    case "test":
                        self._tests += _read_test(given, around, self._ids)
                    case "for":
                        self._for(given, around)
                    case "include":
                        self._include(given, around)
                    case _:
                        _warn_if_late(given, without)
                        around = replace(around, environment=given.body())
            if not any(grandchild.name == "environment" for grandchild in child.children):
                without += len(self._tests) - before

    def _for(self, given: Given, around: _Surroundings) -> None:
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
            self._problems.spend(given.element.location, steps=1 + len(bindings))
            self._walk(given.element, replace(around, bindings=bindings, loop_values=(*around.loop_values, value)))

    def _include(self, given: Given, around: _Surroundings) -> None:
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
        self._problems.spend(location, files=1, characters=len(data))
        self._including.append(here)
        root = self._scan(data, str(name))
        if root is None:
            self._complete = False
        else:
            suite = Given(root, around.bindings, self._problems)
            timeouts = _timeouts(suite).inherit(around.timeouts)
            self._read_entries(suite, replace(around.within(suite), timeouts=timeouts))
        self._including.pop()

    def _read_fixtures(self, suite: Given, around: _Surroundings) -> None:
        """Read one file's fixtures and add them to those of the files before; the same fixture twice is one."""
        names = NameBook()
        all_given = [*suite.children("fixture")]
        for given in all_given:
            names.reserve(given.get("name", ""))
        here: set[str] = set()
        for given in all_given:
            element = given.element
            entry = _read_fixture(given, around, names)
            if entry is None:
                self._faulty_fixtures.add(element.attributes.get("name") or plugin_stem(condensed(element)))
                continue
            other = self._fixtures.setdefault(entry.name, entry)
            if entry.name in here:
                message = f"the fixture {quote(entry.name)} is already defined at {other.location}"
                self._problems.error(message, element.location, 'give one of them another name="…"')
            elif differences := _differences(entry, other):
                message = f"the fixture {quote(entry.name)} differs from the one at {other.location} in {differences}"
                self._problems.error(message, element.location, 'make them equal, or give one another name="…"')
            here.add(entry.name)


def _sound_part(open_elements: tuple[Element, ...]) -> Element | None:
    """Return what was read before the parser gave up, without the elements of which only a part is known."""
    for parent, element in zip(open_elements[-2::-1], open_elements[:0:-1], strict=True):
        if element.name not in _CONTAINERS:
            del parent.children[-1]
    return open_elements[0] if open_elements else None


def _differences(one: FixtureEntry, other: FixtureEntry) -> str:
    names = (item.name for item in fields_of(one) if item.name != "location")
    return ", ".join(name for name in names if getattr(one, name) != getattr(other, name))


def _warn_if_late(environment: Given, tests: int) -> None:
    if tests:
        environment.warn(
            f"this <environment> comes too late for {tests} {'test' if tests == 1 else 'tests'} above it",
            "move it to the top of the file, or give those tests an <environment> of their own",
        )


# From an element to an entry -----------------------------------------------------------------------------------------


def _read_test(given: Given, around: _Surroundings, ids: TestIds) -> list[TestEntry]:
    """Read a ``<test>``; nothing if it is faulty. Its id is taken all the same, so that fixing it renames no other."""
    plugin, class_name = _plugin(given), given.get("class")
    if class_name and "::" in plugin:
        given.fail(f"this <test> names a class twice: {quote(plugin)} and {quote(class_name)}", "class")
    elif class_name:
        plugin = f"{plugin}::{class_name}"
    name, param = given.get("name", ""), given.get("param", "")
    own = _parameters(given)
    label = label_of_name(name) if name else label_of_plugin(plugin, param, own, around.loop_values)
    _check_expectation(given)
    entry = TestEntry(
        id=ids.unique(label, name, plugin, given.get("type"), param, own),
        name=name or name_of_plugin(plugin, param, around.loop_values),
        plugin=plugin,
        parameters=around.parameters + own if own else around.parameters,
        environment=given.text_of("environment", around.environment),
        timeouts=Timeouts(
            setup=given.get("setup-timeout"),
            run=given.get("timeout"),
            teardown=given.get("teardown-timeout"),
            total=given.get("total-timeout"),
        ).inherit(around.timeouts),
        tags=_tags(given, around.tags),
        expected_reason=given.get("reason", ""),
        location=given.element.location,
        **_fields({**around.defaults, **given.said}, _OF_TEST),
    )
    return [entry] if given.ok else []


def _read_fixture(given: Given, around: _Surroundings, names: NameBook) -> FixtureEntry | None:
    """Read a ``<fixture>``; None if it is faulty. One without a name is named after its plug-in."""
    plugin, name = _plugin(given), given.get("name", "")
    if _SEPARATORS.search(name):  # other entries write it in lists
        given.fail(f"the fixture name {quote(name)} is not one word", "name", "write it without blanks or commas")
    entry = FixtureEntry(
        name=name or names.unique(_SEPARATORS.sub("-", plugin_stem(plugin))),
        plugin=plugin,
        parameters=_parameters(given),
        environment=given.text_of("environment", around.fixture_environment),
        timeouts=Timeouts(setup=given.get("timeout"), teardown=given.get("teardown-timeout")),
        location=given.element.location,
        **_fields(given.said, _OF_FIXTURE),
    )
    return entry if given.ok else None


def _fields(said: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Return the fields of an entry that attributes of the same names fill; the others have their defaults."""
    return {name.replace("-", "_"): said[name] for name in names if name in said}


def _timeouts(suite: Given) -> Timeouts:
    """Return the ``<timeout>`` of a file, for its tests; when there are several, the last one."""
    timeouts = Timeouts()
    for index, given in enumerate(suite.children("timeout")):
        if index:
            given.warn("a second <timeout> replaces the first")
        run, body = None, given.body()
        try:
            if body:
                run = parse_duration(body)
            elif given.ok and not given.element.attributes:
                given.fail("this <timeout> is empty", hint="write <timeout> 20 </timeout>")
        except ValueError as error:
            given.fail(f"<timeout> {error}")
        timeouts = Timeouts(run=run, **given.said)
    return timeouts


def _plugin(given: Given) -> str:
    plugin = given.body()
    if not plugin and given.ok:
        name = given.element.name
        given.fail(f"this <{name}> names no plug-in", hint=f"write <{name}> PluginName </{name}>")
    return plugin


def _tags(given: Given, inherited: tuple[str, ...]) -> tuple[str, ...]:
    """Return the tags of an element together with those of the suite around it, sorted."""
    own = given.get("tags", ())
    return tuple(sorted({*inherited, *own})) if own else inherited


def _parameters(given: Given) -> tuple[tuple[str, str], ...]:
    """Return the ``<parameter>`` children in file order."""
    values = []
    for parameter in given.children("parameter"):
        name, value = parameter.get("name"), parameter.body()
        if name:
            values.append((name, value))
        elif parameter.ok:
            parameter.fail("a <parameter> needs a name", hint='write <parameter name="speed">20</parameter>')
    return tuple(values)


def _check_expectation(given: Given) -> None:
    expected, reason = given.get("expected", Expected.PASS), given.get("reason")
    if expected is Expected.FAIL and not reason:
        given.warn('expected="fail" stands without a reason', 'add reason="…" for the next reader')
    if expected is Expected.PASS and reason and given.ok:
        given.warn('a reason stands without expected="fail"; it is only noted')
