"""The parameters of devices and actions: conversion of elements to a configuration.

A ``param`` is a key with the values in its text, a ``group`` a key with lists of a key and its values. A ``paramlist``
is a key with a list of names, each of which is a key, too. Groups of the same name are merged.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Property, Value, is_complete

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rtf.errors import Location
    from rtf.robot.interface.problems import ProblemLog
    from rtf.xml_tree import Element

#: The tags of parameter elements.
TAGS = frozenset({"params", "param", "group", "paramlist"})
#: Keys that every device gets.
AUTOMATIC = ("id", "device", "robotName")
_VARIABLE = re.compile(r"\$\{([^{}]{1,64})\}")


@dataclass(frozen=True, slots=True)
class Setting:
    """A key and its values."""

    name: str
    values: tuple[Value, ...]
    location: Location


@dataclass(frozen=True, slots=True)
class Group:
    """A key and its settings."""

    name: str
    settings: tuple[Setting | Group, ...]
    location: Location


Settings = tuple[Setting | Group, ...]


@dataclass(slots=True)
class ParameterReader:
    """Reads parameter elements. ``variables`` replace ``${name}``; ``given`` are the command line's parameters.

    ``asked`` are the keys in ``extern-name`` attributes, whether they were given or not.
    """

    problems: ProblemLog
    variables: Mapping[str, str]
    given: Property
    asked: set[str] = field(default_factory=set)

    def read(self, element: Element) -> Settings:
        """Return the parameters of an element with a tag in ``TAGS``."""
        match element.tag:
            case "param":
                return self._setting(element, element.attributes.get("extern-name"))
            case "group":
                return self._group(element)
            case "paramlist":
                return self._list(element)
            case _:
                self.check_attributes(element)
                return self._all(element)

    def _all(self, element: Element) -> Settings:
        found: list[Setting | Group] = []
        self.check_text(element)
        for child in element.children:
            if child.tag in TAGS:
                found += self.read(child)
            else:
                self.unexpected(child, element, TAGS)
        return tuple(found)

    def _group(self, element: Element) -> Settings:
        self.check_attributes(element, "name")
        name = self.name_of(element)
        inner = self._all(element)
        return (Group(name, inner, element.location),) if name else ()

    def _list(self, element: Element) -> Settings:
        self.check_attributes(element, "name")
        self.check_text(element)
        name = self.name_of(element)
        found: list[Setting] = []
        for child in element.children:
            if child.tag == "elem":
                found += self._setting(child)
            else:
                self.unexpected(child, element, ("elem",))
        names = Bottle([one.name for one in found])
        return (Setting(name, (names,), element.location), *found) if name else ()

    def _setting(self, element: Element, extern: str | None = None) -> tuple[Setting, ...]:
        self.check_attributes(element, "name", *(["extern-name"] if element.tag == "param" else []))
        name = self.name_of(element)
        for child in element.children:
            self.unexpected(child, element, ())
        if extern is not None:
            self.asked.add(extern)
        group = None if extern is None else self.given.find_group(extern)
        values = self._parse(element, self._filled(element)) if group is None else self._external(element, group[1:])
        return (Setting(name, values, element.location),) if name else ()

    def _external(self, element: Element, values: Bottle) -> tuple[Value, ...]:
        """Return a value from the command line: several values are a list, a text is parsed like that of the file."""
        if len(values) > 1:
            return (values,)
        return self._parse(element, values[0]) if len(values) and isinstance(values[0], str) else tuple(values)

    def _filled(self, element: Element) -> str:
        def replace(match: re.Match[str]) -> str:
            if match[1] not in self.variables:
                known = ", ".join(f"${{{name}}}" for name in self.variables)
                self.problems.warn(element.location, f"{match[0]} is not replaced; the known variables are {known}")
            return self.variables.get(match[1], match[0])

        return _VARIABLE.sub(replace, element.text)

    def _parse(self, element: Element, text: str) -> tuple[Value, ...]:
        text = re.sub(r"[\t\r\n]", " ", text)
        try:
            if is_complete(text):
                return tuple(Bottle.parse(text))
            reason = "its quotes or brackets are not closed"
        except BottleError as error:
            reason = str(error)
        name = element.attributes.get("name", "")
        self.problems.error(element.location, f"the value of {name!r} cannot be read: {reason}", "fix the value")
        return ()

    # Checks of elements ------------------------------------------------------------------------------------------

    def name_of(self, element: Element) -> str:
        """Return the attribute ``name``; empty, with an error recorded, if it is missing."""
        name = element.attributes.get("name", "").strip()
        if not name:
            self.problems.error(element.location, f"<{element.tag}> has no name", 'write name="…"')
        elif not name.isprintable():
            self.problems.error(
                element.location, f"{name!r} is not a valid name", "write one of letters, digits and signs"
            )
            return ""
        return name

    def check_attributes(self, element: Element, *known: str) -> None:
        """Warn of unknown attributes, and refuse includes by the attribute ``file``."""
        for name in element.attributes:
            if name == "file":
                self.problems.error(
                    element.location,
                    f"<{element.tag}> includes {element.attributes[name]!r} by its attribute 'file', which is not"
                    " allowed any more",
                    'write <xi:include href="…"/>',
                )
            elif name not in known and not name.startswith("xml"):
                self.problems.warn(element.location, f"the attribute {name!r} of <{element.tag}> has no meaning")

    def check_text(self, element: Element) -> None:
        """Warn of text without meaning."""
        if element.text:
            self.problems.warn(element.location, f"the text {element.text[:40]!r} in <{element.tag}> has no meaning")

    def unexpected(self, child: Element, element: Element, known: Iterable[str]) -> None:
        """Record an error for an element that is not allowed here."""
        may = ", ".join(f"<{tag}>" for tag in sorted(known))
        hint = f"allowed here: {may}" if may else "only text is allowed here"
        self.problems.error(child.location, f"<{child.tag[:40]}> is not allowed in <{element.tag}>", hint)


def to_property(settings: Sequence[Setting | Group], problems: ProblemLog, whose: str) -> Property:
    """Convert parameters to a configuration. A duplicate key is an error; groups of the same name are merged."""
    made = Property()
    for one in _merged(settings):
        first = made.location(one.name)
        if first is not None:
            problems.error(one.location, f"{whose} has the parameter {one.name!r} twice, first in {first}", "keep one")
        elif isinstance(one, Setting):
            made.put(one.name, *one.values, location=one.location)
        else:
            made.put_group(_bottle(one, problems, whose), key=one.name, location=one.location)
    return made


def _merged(settings: Iterable[Setting | Group]) -> list[Setting | Group]:
    """Merge groups of the same name, at the position of the first one."""
    inner: dict[str, list[Setting | Group]] = {}
    found: list[Setting | Group] = []
    for one in settings:
        if isinstance(one, Setting) or one.name not in inner:
            found.append(one)
        if isinstance(one, Group):
            inner.setdefault(one.name, []).extend(one.settings)
    return [one if isinstance(one, Setting) else replace(one, settings=tuple(inner[one.name])) for one in found]


def _bottle(group: Group, problems: ProblemLog, whose: str) -> Bottle:
    """Convert a group to a list. The first of duplicate keys counts, as in look-ups."""
    made = Bottle([group.name])
    names: set[str] = set()
    for one in _merged(group.settings):
        if one.name in names:
            problems.warn(one.location, f"{whose} has {one.name!r} twice in the group {group.name!r}; the first counts")
            continue
        names.add(one.name)
        made.append(Bottle([one.name, *one.values]) if isinstance(one, Setting) else _bottle(one, problems, whose))
    return made
