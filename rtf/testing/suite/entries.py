"""From one ``<test>`` or ``<fixture>`` element to one entry of the suite, and what a file says for all its entries."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from rtf.testing.suite.ids import NameBook, TestIds, label_of_name, label_of_plugin, name_of_plugin
from rtf.testing.suite.model import Expected, FixtureEntry, Isolation, LostPolicy, Scope, TestEntry, Timeouts
from rtf.testing.suite.values import parse_duration, plugin_stem, quote

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.suite.elements import Given

_SEPARATORS = re.compile(r"""[\s,"']+""")

Parameters = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What holds at one place of a file: variables, loop values (outermost first), environment, defaults of tests."""

    bindings: Mapping[str, str]
    loop_values: tuple[str, ...] = ()
    environment: str = ""
    fixture_environment: str = ""
    timeouts: Timeouts = field(default_factory=Timeouts)
    retries: int = 0
    isolation: Isolation = Isolation.TEST
    on_lost: LostPolicy = LostPolicy.RERUN
    tags: tuple[str, ...] = ()
    parameters: Parameters = ()

    def within(self, suite: Given) -> Surroundings:
        """Add what a file says for all its tests, wherever in the file it says it."""
        environment = suite.text_of("environment")
        return replace(
            self,
            fixture_environment=self.fixture_environment if environment is None else environment,
            retries=suite.get("retries", self.retries),
            isolation=suite.get("isolation", self.isolation),
            on_lost=suite.get("on-lost", self.on_lost),
            tags=_tags(suite, self.tags),
            parameters=self.parameters + _parameters(suite),
        )


def read_test(given: Given, around: Surroundings, ids: TestIds) -> TestEntry | None:
    """Read a ``<test>``; None if it is faulty. Its id is taken all the same, so that fixing it renames no other."""
    plugin, class_name = _plugin(given), given.get("class")
    if class_name and "::" in plugin:
        given.fail(f"this <test> names a class twice: {quote(plugin)} and {quote(class_name)}", "class")
    elif class_name:
        plugin = f"{plugin}::{class_name}"
    name, type_, param = given.get("name", ""), given.get("type"), given.get("param", "")
    own = _parameters(given)
    label = label_of_name(name) if name else label_of_plugin(plugin, param, own, around.loop_values)
    environment = given.text_of("environment")
    expected, reason = _expectation(given)
    entry = TestEntry(
        id=ids.unique(label, name, plugin, type_, param, own),
        name=name or name_of_plugin(plugin, param, around.loop_values),
        plugin=plugin,
        type=type_,
        param=param,
        parameters=around.parameters + own if own else around.parameters,
        environment=around.environment if environment is None else environment,
        repetition=given.get("repetition", 0),
        retries=given.get("retries", around.retries),
        timeouts=Timeouts(
            setup=given.get("setup-timeout"),
            run=given.get("timeout"),
            teardown=given.get("teardown-timeout"),
            total=given.get("total-timeout"),
        ).inherit(around.timeouts),
        tags=_tags(given, around.tags),
        expected=expected,
        expected_reason=reason,
        requires=given.get("requires", ()),
        occupies=given.get("occupies", ()),
        isolation=given.get("isolation", around.isolation),
        fixtures=given.get("fixtures"),
        on_lost=given.get("on-lost", around.on_lost),
        description=given.get("description", ""),
        location=given.element.location,
    )
    return entry if given.ok else None


def read_fixture(given: Given, around: Surroundings, names: NameBook) -> FixtureEntry | None:
    """Read a ``<fixture>``; None if it is faulty. One without a name is named after its plug-in."""
    plugin, name = _plugin(given), given.get("name", "")
    if _SEPARATORS.search(name):  # other entries write it in lists
        given.fail(f"the fixture name {quote(name)} is not one word", "name", "write it without blanks or commas")
    environment = given.text_of("environment")
    entry = FixtureEntry(
        name=name or names.unique(_SEPARATORS.sub("-", plugin_stem(plugin))),
        plugin=plugin,
        type=given.get("type"),
        param=given.get("param", ""),
        parameters=_parameters(given),
        environment=around.fixture_environment if environment is None else environment,
        depends=given.get("depends", ()),
        scope=given.get("scope", Scope.SUITE),
        restarts=given.get("restarts", 3),
        backoff=given.get("backoff", 0.5),
        check_period=given.get("check-period", 0.5),
        timeouts=Timeouts(setup=given.get("timeout"), teardown=given.get("teardown-timeout")),
        on_lost=given.get("on-lost"),
        location=given.element.location,
    )
    return entry if given.ok else None


def read_timeouts(suite: Given) -> Timeouts:
    """The ``<timeout>`` of a file, for its tests; when there are several, the last one."""
    timeouts = Timeouts()
    for index, given in enumerate(suite.children("timeout")):
        if index:
            given.warn("a second <timeout> replaces the first")
        timeouts = Timeouts(
            setup=given.get("setup"), run=_run_timeout(given), teardown=given.get("teardown"), total=given.get("total")
        )
    return timeouts


def _run_timeout(given: Given) -> float | None:
    body = given.body()
    try:
        if body:
            return parse_duration(body)
        if given.ok and not given.element.attributes:
            given.fail("this <timeout> is empty", hint="write <timeout> 20 </timeout>")
    except ValueError as error:
        given.fail(f"<timeout> {error}")
    return None


def _plugin(given: Given) -> str:
    plugin = given.body()
    if not plugin and given.ok:
        name = given.element.name
        given.fail(f"this <{name}> names no plug-in", hint=f"write <{name}> PluginName </{name}>")
    return plugin


def _tags(given: Given, inherited: tuple[str, ...]) -> tuple[str, ...]:
    """The tags of an element together with those of the suite around it, sorted."""
    own = given.get("tags", ())
    return tuple(sorted({*inherited, *own})) if own else inherited


def _parameters(given: Given) -> Parameters:
    """The ``<parameter>`` children in file order."""
    values = []
    for parameter in given.children("parameter"):
        name, value = parameter.get("name"), parameter.body()
        if name:
            values.append((name, value))
        elif parameter.ok:
            parameter.fail("a <parameter> needs a name", hint='write <parameter name="speed">20</parameter>')
    return tuple(values)


def _expectation(given: Given) -> tuple[Expected, str]:
    expected, reason = given.get("expected", Expected.PASS), given.get("reason", "")
    if expected is Expected.FAIL and not reason:
        given.warn('expected="fail" stands without a reason', 'add reason="…" for the next reader')
    if expected is Expected.PASS and reason and given.ok:
        given.warn('a reason stands without expected="fail"; it is only noted')
    return expected, reason
