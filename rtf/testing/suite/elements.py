"""The vocabulary of suite files: each element with its attributes, the type of their values, and what may stand in it.

Files are checked and read by this one table. The published schema ``suite.xsd`` states the same for editors; a test
keeps the two in agreement.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from rtf.errors import nearest
from rtf.testing.suite.diagnostics import MAX_COMPARED
from rtf.testing.suite.model import Expected, Isolation, LostPolicy, Scope
from rtf.testing.suite.values import MAX_TEXT, parse_duration, parse_integer, split_words, substitute, variables_in
from rtf.xml_tree import quote

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from enum import StrEnum

    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.xml_tree import Element

    #: Reads the text of an attribute. Raises ValueError with what is wrong, and maybe a hint; None says nothing.
    Reader = Callable[[str], Any]

_FOREIGN = ("xmlns", "xsi:", "xml:")  # what editors put there to find the schema
_LOSABLE = frozenset({"test", "include", "fixture"})


# Readers of attributes -----------------------------------------------------------------------------------------------


def _text(text: str) -> str:
    return text


def _line(text: str) -> str | None:
    return text.strip() or None


def _type(text: str) -> str | None:
    return text.strip().lower() or None


def _values(text: str) -> tuple[str, ...]:
    return split_words(text, commas=False)


def _words(form: re.Pattern[str] | None = None, complaint: str = "") -> Reader:
    """Read a list of words, each once; ``complaint`` says what is wrong with one that does not have the ``form``."""

    def read(text: str) -> tuple[str, ...]:
        words = tuple(dict.fromkeys(split_words(text)))
        for word in words:
            if form is not None and not form.fullmatch(word):
                raise ValueError(f"is {quote(text)}, but {quote(word)} {complaint}")
        return words

    return read


_TAGS = _words(re.compile(r"""[^\s,()"']+"""), "cannot be a tag; leave out brackets and quotes")
_MODULES = _words(re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*"), "is no name of a Python module")
_REQUIREMENTS = _words(re.compile(r"(?!(?:test|program|module|env|file):\Z).+", re.DOTALL), "names nothing")


def _whole(high: int) -> Reader:
    return partial(parse_integer, low=0, high=high)


def _choice(kind: type[StrEnum]) -> Reader:
    def read(text: str) -> StrEnum | None:
        word, allowed = text.strip(), [member.value for member in kind]
        if word and word not in allowed:
            near = nearest(word[:MAX_COMPARED], allowed)
            hint = f"did you mean {near!r}?" if near else ""
            raise ValueError(f"is {quote(word)}; it must be one of {', '.join(allowed)}", hint)
        return kind(word) if word else None

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
            "tags": _TAGS,
            "on-lost": _choice(LostPolicy),
            "preload": _MODULES,
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
            "depends": _words(),
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
            "tags": _TAGS,
            "expected": _choice(Expected),
            "reason": _line,
            "requires": _REQUIREMENTS,
            "occupies": _words(),
            "isolation": _choice(Isolation),
            "fixtures": _words(),
            "on-lost": _choice(LostPolicy),
        },
        _names("parameter environment"),
    ),
    "for": Kind({"name": _line, "in": _values}, _names("test for include"), text=False),
    "include": Kind({}),
}
"""Every element by its name in lower case; attribute names are as written."""


def check(element: Element, problems: DiagnosticLog) -> None:
    """Report what the loader does not read in a file's tree. Depth is bounded by the parser."""
    kind = KINDS[element.name]
    for attribute in element.attributes:
        if attribute not in kind.attributes and not attribute.startswith(_FOREIGN):
            problems.unknown(
                f"<{element.name}> has no attribute {quote(attribute)}; it is not read",
                element.attribute_location(attribute),
                problems.did_you_mean(attribute, kind.attributes),
            )
    if not kind.text and (text := condensed(element)):
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


def condensed(element: Element) -> str:
    """Return the text directly in an element, white space condensed."""
    return " ".join(element.text.split())


class Given:
    """The content of one element, under the variables that hold there.

    ``said`` has the values of its attributes. A faulty one is in the problems and not among the values, ``ok`` becomes
    False, and reading goes on.
    """

    def __init__(self, element: Element, bindings: Mapping[str, str], problems: DiagnosticLog) -> None:
        problems.spend(element.location, steps=1)
        self.element = element
        self.ok = True
        self._bindings = bindings
        self._problems = problems
        self.said: dict[str, Any] = {}  # what the readers make of them
        readers = KINDS[element.name].attributes
        for name, raw in element.attributes.items():
            if name in readers and (value := self._read(name, raw, readers[name])) is not None:
                self.said[name] = value

    def get(self, name: str, default: Any = None) -> Any:  # as above
        """Return the value of an attribute, or the default if it is missing or faulty."""
        return self.said.get(name, default)

    def body(self) -> str:
        """Return the element's own text, condensed, with variables replaced."""
        try:
            return self._expand(condensed(self.element))
        except ValueError as error:
            self.fail(f"the text of <{self.element.name}> {error}")
            return ""

    def children(self, name: str) -> Iterator[Given]:
        """Yield each child of this name, in file order; their faults are the element's own."""
        for child in self.element.children:
            if child.name == name:
                given = Given(child, self._bindings, self._problems)
                yield given
                self.ok = self.ok and given.ok

    def text_of(self, name: str, default: str = "") -> str:
        """Return the text of the last child of this name, or the default when there is no such child."""
        found = [child for child in self.element.children if child.name == name]
        return Given(found[-1], self._bindings, self._problems).body() if found else default

    def fail(self, message: str, attribute: str = "", hint: str = "") -> None:
        """Add an error of this element, or of one of its attributes."""
        self.ok = False
        place = self.element.attribute_location(attribute) if attribute else self.element.location
        self._problems.error(message, place, hint)

    def warn(self, message: str, hint: str = "") -> None:
        """Add a warning about this element, which stays usable."""
        self._problems.warning(message, self.element.location, hint)

    def _read(self, name: str, raw: str, read: Reader) -> Any:  # what the reader makes of it
        try:
            return read(self._expand(raw))
        except ValueError as error:
            message, *hint = error.args
            self.fail(f"attribute {name!r} of <{self.element.name}> {message}", name, *hint)
            return None

    def _expand(self, raw: str) -> str:
        if len(raw) > MAX_TEXT:
            raise ValueError(f"is longer than {MAX_TEXT} characters")
        self._problems.variables.update(variables_in(raw))
        expanded = substitute(raw, self._bindings)
        self._problems.spend(self.element.location, characters=len(expanded))
        return expanded
