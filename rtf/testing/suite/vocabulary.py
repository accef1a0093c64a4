"""Which elements and attributes a suite file may contain; any other is an error, or with ``lenient`` a warning.

The published schema ``suite.xsd`` states the same for editors; a test keeps the two in agreement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.testing.suite.values import quote

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.testing.suite.scan import Element


@dataclass(frozen=True, slots=True)
class Rule:
    """What one element may carry."""

    attributes: frozenset[str]
    children: frozenset[str] = frozenset()
    text: bool = True


def _names(names: str) -> frozenset[str]:
    return frozenset(names.split())


RULES: Mapping[str, Rule] = {
    "suite": Rule(
        _names("name timeout retries isolation tags on-lost preload copies"),
        _names("description environment timeout parameter fixture test for include"),
        text=False,
    ),
    "description": Rule(frozenset()),
    "environment": Rule(frozenset()),
    "timeout": Rule(_names("setup teardown total")),
    "parameter": Rule(_names("name")),
    "fixture": Rule(
        _names(
            "name type param depends scope restarts backoff check-period timeout teardown-timeout on-lost",
        ),
        _names("parameter environment"),
    ),
    "test": Rule(
        _names(
            "name description type class param repetition retries timeout setup-timeout teardown-timeout total-timeout "
            "tags expected reason requires occupies isolation fixtures on-lost",
        ),
        _names("parameter environment"),
    ),
    "for": Rule(_names("name in"), _names("test for include"), text=False),
    "include": Rule(frozenset()),
}
"""Every element by its name in lower case; attribute names are as written."""

_FOREIGN = ("xmlns", "xsi:", "xml:")  # what editors put there to find the schema
_LOSABLE = _names("test include fixture")


def check(element: Element, problems: DiagnosticLog) -> None:
    """Report what a file's tree contains that the loader does not read. Depth is bounded by the scanner."""
    rule = RULES[element.name]
    for attribute in element.attributes:
        if attribute not in rule.attributes and not attribute.startswith(_FOREIGN):
            problems.unknown(
                f"<{element.name}> has no attribute {quote(attribute)}; it is not read",
                element.attribute_location(attribute),
                problems.did_you_mean(attribute, rule.attributes),
            )
    if not rule.text and (text := element.text):
        problems.warning(f"the text {quote(text)} in <{element.name}> is not read", element.location)
    for child in element.children:
        if child.name in rule.children:
            check(child, problems)
        else:
            _out_of_place(child, element, rule, problems)


def _out_of_place(child: Element, parent: Element, rule: Rule, problems: DiagnosticLog) -> None:
    if child.name in RULES:
        homes = sorted(name for name, other in RULES.items() if child.name in other.children)
        hint = f"it may stand in {' or '.join(f'<{home}>' for home in homes)}" if homes else "use <include> instead"
        problems.error(f"<{child.name}> may not stand in <{parent.name}>; it is left out", child.location, hint)
        return
    lost = _count(child)
    message = f"<{parent.name}> has no element <{quote(child.tag)[1:-1]}>; it is not read"
    if lost:
        message += f", and with it {lost} tests, fixtures or includes"
    problems.unknown(message, child.location, problems.did_you_mean(child.tag, rule.children))


def _count(element: Element) -> int:
    return sum((child.name in _LOSABLE) + _count(child) for child in element.children)
