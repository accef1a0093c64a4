"""The vocabulary of suite files: each element with its attributes, the type of their values, and what may stand in it.

Files are checked and read by this one table. The published schema ``suite.xsd`` states the same for editors; a test
keeps the two in agreement.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from rtf.testing.suite.model import Expected, Isolation, LostPolicy, Scope
from rtf.testing.suite.values import MAX_TEXT, parse_duration, parse_integer, quote, split_words, substitute

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from enum import StrEnum

    from rtf.testing.suite.diagnostics import Budget, DiagnosticLog
    from rtf.testing.suite.scan import Element

    #: Reads the text of an attribute. Raises ValueError with what is wrong; None means that nothing is said.
    Reader = Callable[[str], Any]

_FOREIGN = ("xmlns", "xsi:", "xml:")  # what editors put there to find the schema
_LOSABLE = frozenset({"test", "include", "fixture"})
_TAG = re.compile(r"""[^\s,()"']+""")
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_REQUIREMENT_KINDS = frozenset({"test", "program", "module", "env", "file"})


# Readers of attributes -----------------------------------------------------------------------------------------------


class NoChoiceError(ValueError):
    """A word that is none of those allowed."""

    def __init__(self, word: str, allowed: list[str]) -> None:
        super().__init__(f"is {quote(word)}; it must be one of {', '.join(allowed)}")
        self.word, self.allowed = word, allowed


def _text(text: str) -> str:
    return text


def _line(text: str) -> str | None:
    return text.strip() or None


def _type(text: str) -> str | None:
    return text.strip().lower() or None


def _words(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(split_words(text)))


def _values(text: str) -> tuple[str, ...]:
    return split_words(text, commas=False)


def _tags(text: str) -> tuple[str, ...]:
    words = _words(text)
    for word in words:
        if not _TAG.fullmatch(word):
            raise ValueError(f"is {quote(text)}, but {quote(word)} cannot be a tag; leave out brackets and quotes")
    return words


def _modules(text: str) -> tuple[str, ...]:
    words = _words(text)
    for word in words:
        if not _MODULE.fullmatch(word):
            raise ValueError(f"is {quote(text)}, but {quote(word)} is no name of a Python module")
    return words


def _requirements(text: str) -> tuple[str, ...]:
    words = _words(text)
    for word in words:
        kind, colon, value = word.partition(":")
        if not word or (colon and kind in _REQUIREMENT_KINDS and not value):
            raise ValueError(f"is {quote(text)}, but {quote(word)} names nothing")
    return words


def _whole(high: int) -> Reader:
    return partial(parse_integer, low=0, high=high)


def _choice(kind: type[StrEnum]) -> Reader:
    def read(text: str) -> StrEnum | None:
        word = text.strip()
        try:
            return kind(word) if word else None
        except ValueError:
            raise NoChoiceError(word, [member.value for member in kind]) from None

    return read


# The vocabulary ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Kind:
    """What one kind of element may have: attributes, each with its reader, elements in it, and text."""

    attributes: Mapping[str, Reader]
    children: frozenset[str] = frozenset()
    text: bool = True


def _names(names: str) -> frozenset[str]:
    return frozenset(names.split())


KINDS: Mapping[str, Kind] = {
    "suite": Kind(
        {
            "name": _line,
            "timeout": parse_duration,
            "retries": _whole(1000),
            "isolation": _choice(Isolation),
            "tags": _tags,
            "on-lost": _choice(LostPolicy),
            "preload": _modules,
            "copies": _whole(64),
        },
        _names("description environment timeout parameter fixture test for include"),
        text=False,
    ),
    "description": Kind({}),
    "environment": Kind({}),
    "timeout": Kind(dict.fromkeys(("setup", "teardown", "total"), parse_duration)),
    "parameter": Kind({"name": _line}),
    "fixture": Kind(
        {
            "name": _line,
            "type": _type,
            "param": _text,
            "depends": _words,
            "scope": _choice(Scope),
            "restarts": _whole(1000),
            "backoff": partial(parse_duration, low=0),
            "check-period": partial(parse_duration, low=0.01),  # a look more often than that can mean nothing
            "timeout": parse_duration,
            "teardown-timeout": parse_duration,
            "on-lost": _choice(LostPolicy),
        },
        _names("parameter environment"),
    ),
    "test": Kind(
        {
            "name": _line,
            "description": _line,
            "type": _type,
            "class": _line,
            "param": _text,
            "repetition": _whole(1_000_000),
            "retries": _whole(1000),
            "timeout": parse_duration,
            "setup-timeout": parse_duration,
            "teardown-timeout": parse_duration,
            "total-timeout": parse_duration,
            "tags": _tags,
            "expected": _choice(Expected),
            "reason": _line,
            "requires": _requirements,
            "occupies": _words,
            "isolation": _choice(Isolation),
            "fixtures": _words,
            "on-lost": _choice(LostPolicy),
        },
        _names("parameter environment"),
    ),
    "for": Kind({"name": _line, "in": _values}, _names("test for include"), text=False),
    "include": Kind({}),
}
"""Every element by its name in lower case; attribute names are as written."""


def check(element: Element, problems: DiagnosticLog) -> None:
    """Report what a file's tree contains that the loader does not read. Depth is bounded by the scanner."""
    kind = KINDS[element.name]
    for attribute in element.attributes:
        if attribute not in kind.attributes and not attribute.startswith(_FOREIGN):
            problems.unknown(
                f"<{element.name}> has no attribute {quote(attribute)}; it is not read",
                element.attribute_location(attribute),
                problems.did_you_mean(attribute, kind.attributes),
            )
    if not kind.text and (text := element.text):
        problems.warning(f"the text {quote(text)} in <{element.name}> is not read", element.location)
    for child in element.children:
        if child.name in kind.children:
            check(child, problems)
        elif child.name in KINDS:
            homes = sorted(f"<{name}>" for name, other in KINDS.items() if child.name in other.children)
            hint = f"it may stand in {' or '.join(homes)}" if homes else "use <include> instead"
            message = f"<{child.name}> may not stand in <{element.name}>; it is left out"
            problems.error(message, child.location, hint)
        else:
            message = f"<{element.name}> has no element <{quote(child.tag)[1:-1]}>; it is not read"
            if lost := _count(child):
                message += f", and with it {lost} tests, fixtures or includes"
            problems.unknown(message, child.location, problems.did_you_mean(child.tag, kind.children))


def _count(element: Element) -> int:
    return sum((child.name in _LOSABLE) + _count(child) for child in element.children)


# Reading -------------------------------------------------------------------------------------------------------------


class Given:
    """What one element says, under the variables that hold there.

    A faulty value is noted in the problems and counts as not given, ``ok`` turns False, and reading goes on.
    """

    def __init__(self, element: Element, bindings: Mapping[str, str], problems: DiagnosticLog, budget: Budget) -> None:
        budget.spend(element.location, steps=1)
        self.element = element
        self.bindings = bindings
        self.ok = True
        self._problems = problems
        self._budget = budget
        readers = KINDS[element.name].attributes
        self._values = {
            name: self._read(name, raw, readers[name]) for name, raw in element.attributes.items() if name in readers
        }

    def get(self, name: str, default: Any = None) -> Any:  # what the attribute's reader makes of it
        """The value of an attribute, or the default where nothing is said, or something faulty."""
        value = self._values.get(name)
        return default if value is None else value

    def body(self) -> str:
        """The element's own text, condensed, variables put in."""
        try:
            return self._expand(self.element.text)
        except ValueError as error:
            self.fail(f"the text of <{self.element.name}> {error}")
            return ""

    def children(self, name: str) -> Iterator[Given]:
        """What each child of this name says, in file order; their faults are the element's own."""
        for child in self.element.children:
            if child.name == name:
                given = Given(child, self.bindings, self._problems, self._budget)
                yield given
                self.ok = self.ok and given.ok

    def text_of(self, name: str) -> str | None:
        """The text of the last child of this name, or None when there is no such child."""
        found = [child for child in self.element.children if child.name == name]
        return Given(found[-1], self.bindings, self._problems, self._budget).body() if found else None

    def fail(self, message: str, attribute: str = "", hint: str = "") -> None:
        """Note an error of this element, at one of its attributes if that is named."""
        self.ok = False
        place = self.element.attribute_location(attribute) if attribute else self.element.location
        self._problems.error(message, place, hint)

    def warn(self, message: str, hint: str = "") -> None:
        """Note something odd about this element that leaves it usable."""
        self._problems.warning(message, self.element.location, hint)

    def _read(self, name: str, raw: str, read: Reader) -> Any:  # what the reader makes of it
        try:
            return read(self._expand(raw))
        except ValueError as error:
            hint = ""
            if isinstance(error, NoChoiceError):
                hint = self._problems.did_you_mean(error.word, error.allowed)
            self.fail(f"attribute {name!r} of <{self.element.name}> {error}", name, hint)
            return None

    def _expand(self, raw: str) -> str:
        if len(raw) > MAX_TEXT:
            raise ValueError(f"is longer than {MAX_TEXT} characters")
        expanded = substitute(raw, self.bindings)
        self._budget.spend(self.element.location, characters=len(expanded))
        return expanded
