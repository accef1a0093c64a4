"""The values of an element's children: texts with their variables replaced, numbers, truth values."""

from __future__ import annotations

import math
import os
import re
from typing import TYPE_CHECKING, TypeVar

from rtf.applications.xml.model import Text
from rtf.xml_tree import COMMENT, XmlError, quote

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from enum import StrEnum

    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.xml_tree import Element

#: The longest value, and all values of an application together, in characters, after variables were replaced.
MAX_TEXT, MAX_TEXTS = 64 * 1024, 16 * 1024 * 1024
#: The longest wait, in seconds.
MAX_SECONDS = 86400.0
_VARIABLE = re.compile(r"\$\{([^{}$]{1,64})\}|\$ENV\{([^{}$]{1,64})\}")
_LINE_END = re.compile(r"\s*[\t\r\n]\s*")
_YES, _NO = ("true", "yes", "1", "on"), ("false", "no", "0", "off", "")

E = TypeVar("E", bound="StrEnum")


class Fields:
    """Reads values. ``variables`` are those of the file; all files of an application share ``spent``."""

    def __init__(self, problems: DiagnosticLog, variables: Mapping[str, str], spent: list[int]) -> None:
        self.problems = problems
        self.variables = variables
        self._spent = spent

    def text(self, element: Element, name: str, default: str = "") -> Text:
        """Return the text of the first child of this name."""
        found = next(self.all(element, name), None)
        return Text(default, element.location) if found is None else self.of(found) or Text(default, found.location)

    def all(self, element: Element, *names: str) -> Iterator[Element]:
        """Yield the children of these names."""
        return (child for child in element.children if child.name in names and child.tag != COMMENT)

    def of(self, element: Element) -> Text:
        """Return the text of an element, in one line."""
        return Text(self._replaced(_LINE_END.sub(" ", element.text), element), element.location)

    def attribute(self, element: Element, name: str) -> Text:
        """Return an attribute; empty without it."""
        text = element.attributes.get(name, "").strip()
        return Text(self._replaced(text, element), element.attribute_location(name))

    def seconds(self, text: Text, what: str, default: float | None = None) -> float | None:
        """Read seconds; the default if the text is empty, or wrong, which is a problem."""
        if not text:
            return default
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if 0 <= number <= MAX_SECONDS:
            return number
        self.problems.error(f"{what} is seconds from 0 to {MAX_SECONDS:g}, not {quote(text)}", text.location)
        return default

    def truth(self, text: Text, what: str) -> bool:
        """Read a truth value; one that is none is a problem."""
        word = text.lower()
        if word not in (*_YES, *_NO):
            self.problems.error(f"{what} is true or false, not {quote(text)}", text.location)
        return word in _YES

    def choice(self, text: Text, kind: type[E], default: E, what: str) -> E:
        """Read one of several words."""
        if text.lower() in list(kind):
            return kind(text.lower())
        if text:
            self.problems.error(f"{what} is one of {', '.join(kind)}, not {quote(text)}", text.location)
        return default

    def _replaced(self, text: str, element: Element) -> str:
        def value(match: re.Match[str]) -> str:
            name, own = match[1] or match[2], bool(match[1])
            found = self.variables.get(name) if own else os.environ.get(name)
            if found is None:
                if own:
                    message, hint = f"there is no variable {quote(name)}", self._hint(name)
                else:
                    message, hint = f"the environment has no {quote(name)}", f"set it: export {name}=…"
                self.problems.error(message, element.location, hint)
            return found or ""

        if "$" in text:
            text = _VARIABLE.sub(value, text)
        self._spent[0] += len(text)
        if len(text) > MAX_TEXT:
            raise XmlError(f"a value is longer than {MAX_TEXT} characters", element.location, "use fewer variables")
        if self._spent[0] > MAX_TEXTS:
            raise XmlError(f"the values of the application have more than {MAX_TEXTS} characters", element.location)
        return text

    def _hint(self, name: str) -> str:
        near = self.problems.did_you_mean(name, [*self.variables])
        return near or f'write <var name="{quote(name)[1:-1]}">…</var>'
