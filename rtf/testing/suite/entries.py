"""From one ``<test>`` or ``<fixture>`` element to one entry of the suite, and what a file says for all its entries."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from rtf.testing.suite.fields import LONGEST, SHORTEST, Budget, Fields
from rtf.testing.suite.ids import TestIds, label_of_name, label_of_plugin, name_of_plugin
from rtf.testing.suite.model import Expected, FixtureEntry, Isolation, LostPolicy, Scope, TestEntry, Timeouts
from rtf.testing.suite.values import NameBook, parse_duration, plugin_stem, quote

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.testing.suite.scan import Element

MAX_REPETITION = 1_000_000
MAX_RETRIES = 1000
MAX_RESTARTS = 1000
SHORTEST_CHECK = 0.01
"""Seconds between two looks at a fixture: a hundred a second is as often as a look can mean anything."""

_TAG = re.compile(r"""[^\s,()"']+""")
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_REQUIREMENT_KINDS = frozenset({"test", "program", "module", "env", "file"})

Parameters = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Defaults:
    """What a suite says for all of its tests."""

    timeouts: Timeouts = field(default_factory=Timeouts)
    retries: int = 0
    isolation: Isolation = Isolation.TEST
    on_lost: LostPolicy = LostPolicy.RERUN
    tags: tuple[str, ...] = ()
    parameters: Parameters = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What holds at one place of a file: variables, loop values (outermost first), environment, defaults."""

    bindings: Mapping[str, str]
    loop_values: tuple[str, ...] = ()
    environment: str = ""
    fixture_environment: str = ""
    defaults: Defaults = field(default_factory=Defaults)


class EntryReader:
    """Turns elements into entries. A faulty one is reported, all its faults at once, and None comes back."""

    def __init__(self, suite_id: str, problems: DiagnosticLog, budget: Budget) -> None:
        self._ids = TestIds(suite_id)
        self._problems = problems
        self._budget = budget

    def fields(self, element: Element, bindings: Mapping[str, str]) -> Fields:
        """The attributes and the text of an element under the given variables."""
        self._budget.spend(element.location, steps=1)
        return Fields(element, bindings, self._problems, self._budget)

    def test(self, element: Element, around: Surroundings) -> TestEntry | None:
        """Read a ``<test>``. Its id is taken even when it is faulty, so that fixing it renames no other."""
        fields = self.fields(element, around.bindings)
        self._budget.spend(element.location, tests=1, steps=len(around.defaults.parameters))
        defaults = around.defaults
        plugin = self._plugin(fields)
        class_name = fields.text("class").strip()
        if class_name and "::" in plugin:
            fields.fail(f"this <test> names a class twice: {quote(plugin)} and {quote(class_name)}", "class")
        elif class_name:
            plugin = f"{plugin}::{class_name}"
        param = fields.text("param")
        name = fields.text("name").strip()
        type_ = _lower(fields.optional("type"))
        own, inherited = self._own_parameters(fields, around.bindings), defaults.parameters
        label = label_of_name(name) if name else label_of_plugin(plugin, param, own, around.loop_values)
        expected, reason = self._expectation(fields)
        retries = fields.integer("retries", defaults.retries, MAX_RETRIES)
        fixtures = fields.words("fixtures")
        own_environment = self.last_text(element, "environment", around.bindings)
        entry = TestEntry(
            id=self._ids.unique(label, name, plugin, type_, param, own),
            name=name or name_of_plugin(plugin, param, around.loop_values),
            plugin=plugin,
            type=type_,
            param=param,
            parameters=inherited + own if own else inherited,
            environment=around.environment if own_environment is None else own_environment,
            repetition=fields.integer("repetition", 0, MAX_REPETITION),
            retries=retries,
            timeouts=Timeouts(
                setup=fields.seconds("setup-timeout"),
                run=fields.seconds("timeout"),
                teardown=fields.seconds("teardown-timeout"),
                total=fields.seconds("total-timeout"),
            ).inherit(defaults.timeouts),
            tags=self.tags(fields, defaults.tags),
            expected=expected,
            expected_reason=reason,
            requires=self._requirements(fields),
            occupies=fields.words("occupies") or (),
            isolation=fields.choice("isolation", Isolation) or defaults.isolation,
            fixtures=None if fixtures is None else tuple(dict.fromkeys(fixtures)),
            on_lost=fields.choice("on-lost", LostPolicy) or defaults.on_lost,
            description=fields.text("description").strip(),
            location=element.location,
        )
        return entry if fields.ok else None

    def fixture(self, element: Element, around: Surroundings, names: NameBook) -> FixtureEntry | None:
        """Read a ``<fixture>``; one without a name is named after its plug-in, made unique by ``names``."""
        fields = self.fields(element, around.bindings)
        plugin = self._plugin(fields)
        name = self.fixture_name(fields) or names.unique(re.sub(r"[\s,]+", "-", plugin_stem(plugin)))
        environment = self.last_text(element, "environment", around.bindings)
        check_period = fields.seconds("check-period", low=SHORTEST_CHECK)
        backoff = fields.seconds("backoff", low=0)
        entry = FixtureEntry(
            name=name,
            plugin=plugin,
            type=_lower(fields.optional("type")),
            param=fields.text("param"),
            parameters=self._own_parameters(fields, around.bindings),
            environment=around.fixture_environment if environment is None else environment,
            depends=tuple(dict.fromkeys(fields.words("depends") or ())),
            scope=fields.choice("scope", Scope) or Scope.SUITE,
            restarts=fields.integer("restarts", 3, MAX_RESTARTS),
            backoff=0.5 if backoff is None else backoff,
            check_period=0.5 if check_period is None else check_period,
            timeouts=Timeouts(setup=fields.seconds("timeout"), teardown=fields.seconds("teardown-timeout")),
            on_lost=fields.choice("on-lost", LostPolicy),
            location=element.location,
        )
        return entry if fields.ok else None

    def fixture_name(self, fields: Fields) -> str:
        """The name a fixture was given; empty when it has none. Other entries write it in lists, so it is one word."""
        name = fields.text("name").strip()
        if re.search(r"""[\s,"']""", name):
            fields.fail(f"the fixture name {quote(name)} is not one word", "name", "write it without blanks or commas")
        return name

    def tags(self, fields: Fields, inherited: tuple[str, ...]) -> tuple[str, ...]:
        """The tags of an element together with those of the suite around it, sorted."""
        words = fields.words("tags")
        if not words:
            return inherited
        for word in words:
            if not _TAG.fullmatch(word):
                fields.fail(f"{quote(word)} cannot be a tag", "tags", "leave out blanks, commas, brackets and quotes")
        return tuple(sorted({*inherited, *words}))

    def parameters(self, element: Element, bindings: Mapping[str, str]) -> tuple[Parameters, bool]:
        """The ``<parameter>`` children in file order, and whether all of them could be read."""
        values: list[tuple[str, str]] = []
        ok = True
        for child in element.children:
            if child.name != "parameter":
                continue
            fields = self.fields(child, bindings)
            name, value = fields.text("name").strip(), fields.body()
            if not name and fields.ok:
                fields.fail("a <parameter> needs a name", hint='write <parameter name="speed">20</parameter>')
            ok = ok and fields.ok
            values.append((name, value))
        return tuple(pair for pair in values if pair[0]), ok

    def last_text(self, element: Element, name: str, bindings: Mapping[str, str]) -> str | None:
        """The text of the last child of that name, or None when there is no such child."""
        for child in reversed(element.children):
            if child.name == name:
                return self.fields(child, bindings).body()
        return None

    def _own_parameters(self, fields: Fields, bindings: Mapping[str, str]) -> Parameters:
        own, ok = self.parameters(fields.element, bindings)
        fields.ok = fields.ok and ok
        return own

    def _plugin(self, fields: Fields) -> str:
        plugin = fields.body()
        if not plugin and fields.ok:
            name = fields.element.name
            fields.fail(f"this <{name}> names no plug-in", hint=f"write <{name}> PluginName </{name}>")
        return plugin

    def _expectation(self, fields: Fields) -> tuple[Expected, str]:
        expected = fields.choice("expected", Expected) or Expected.PASS
        reason = fields.text("reason").strip()
        if expected is Expected.FAIL and not reason:
            fields.warn('expected="fail" stands without a reason', 'add reason="…" for the next reader')
        if expected is Expected.PASS and reason and fields.ok:
            fields.warn('a reason stands without expected="fail"; it is only noted')
        return expected, reason

    def _requirements(self, fields: Fields) -> tuple[str, ...]:
        tokens = tuple(dict.fromkeys(fields.words("requires") or ()))
        for token in tokens:
            kind, colon, value = token.partition(":")
            if not token or (colon and kind in _REQUIREMENT_KINDS and not value):
                fields.fail(f"the requirement {quote(token)} names nothing", "requires")
        return tokens


def _lower(text: str | None) -> str | None:
    return None if text is None else text.lower()


def surroundings(root: Element, fields: Fields, entries: EntryReader, outer: Surroundings) -> Surroundings:
    """Add to ``outer`` what a file says for all its tests, wherever in the file it says it."""
    defaults = outer.defaults
    own, _ok = entries.parameters(root, outer.bindings)
    environment = entries.last_text(root, "environment", outer.bindings)
    return replace(
        outer,
        fixture_environment=outer.fixture_environment if environment is None else environment,
        defaults=replace(
            defaults,
            retries=fields.integer("retries", defaults.retries, MAX_RETRIES),
            isolation=fields.choice("isolation", Isolation) or defaults.isolation,
            on_lost=fields.choice("on-lost", LostPolicy) or defaults.on_lost,
            tags=entries.tags(fields, defaults.tags),
            parameters=defaults.parameters + own,
        ),
    )


def read_timeouts(root: Element, bindings: Mapping[str, str], entries: EntryReader) -> Timeouts:
    """The ``<timeout>`` of a file, for its tests; when there are several, the last one."""
    timeouts = Timeouts()
    for index, element in enumerate(child for child in root.children if child.name == "timeout"):
        fields = entries.fields(element, bindings)
        if index:
            fields.warn("a second <timeout> replaces the first")
        timeouts = Timeouts(
            setup=fields.seconds("setup"),
            run=_run_timeout(fields),
            teardown=fields.seconds("teardown"),
            total=fields.seconds("total"),
        )
    return timeouts


def _run_timeout(fields: Fields) -> float | None:
    body = fields.body()
    if not body:
        if fields.ok and not fields.element.attributes:
            fields.fail("this <timeout> is empty", hint="write <timeout> 20 </timeout>")
        return None
    try:
        return parse_duration(body, SHORTEST, LONGEST)
    except ValueError as error:
        fields.fail(f"<timeout> {error}")
        return None


def read_preload(fields: Fields) -> tuple[str, ...]:
    """The Python modules the suite asks to have loaded before its tests start."""
    modules = tuple(dict.fromkeys(fields.words("preload") or ()))
    for module in modules:
        if not _MODULE.fullmatch(module):
            fields.fail(f"{quote(module)} is no name of a Python module", "preload")
    return modules
