"""What a suite file says for all its tests: defaults, time-outs, modules to load beforehand."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from rtf.testing.suite.entries import MAX_RETRIES, EntryReader, Surroundings
from rtf.testing.suite.fields import LONGEST, SHORTEST, Fields
from rtf.testing.suite.model import Isolation, LostPolicy, Timeouts
from rtf.testing.suite.values import parse_duration, quote

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.suite.scan import Element

_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")


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
