"""Values that a fixture hands to the tests, and the fixtures, that stand on it: declared, typed, and JSON.

The fixture declares them in ``provides`` and gives them in ``setup``; who needs one declares it as well::

    class Server(FixtureManager):
        provides = {"port": Value(int, "the port it listens at")}

        def setup(self):
            self.provide_value("port", self.start())

    class Answers(TestCase):
        port = FixtureValue(int, fixture="server", key="port")

A value that is missing or of another type is an error of the author's, which names fixture and key.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:
    from collections.abc import Mapping

T = TypeVar("T")

#: The types that JSON keeps as they are.
_TYPES = (bool, int, float, str, list, dict)


class FixtureValueError(TypeError):
    """A value of a fixture that is not there, not declared, or of another type than declared."""


@dataclass(frozen=True, slots=True)
class Value:
    """The declaration of a value that a fixture provides: its type, one of those of JSON, and what it is."""

    kind: type
    description: str = ""

    def __post_init__(self) -> None:
        _require_type(self.kind)


class FixtureValue(Generic[T]):
    """A value of a fixture that a test, or another fixture, needs; it is read like an attribute.

    It is checked before anything of the test is called. A new generation of the fixture has new values.
    """

    def __init__(self, kind: type[T], *, fixture: str, key: str) -> None:
        _require_type(kind)
        self.kind = kind
        self.fixture = fixture
        self.key = key

    def __set_name__(self, owner: type[UsesFixtures], name: str) -> None:
        owner.needed_values = {**owner.needed_values, name: self}

    @overload
    def __get__(self, instance: None, owner: type) -> FixtureValue[T]: ...
    @overload
    def __get__(self, instance: UsesFixtures, owner: type) -> T: ...
    def __get__(self, instance: UsesFixtures | None, owner: type) -> FixtureValue[T] | T:
        if instance is None:
            return self
        values = instance.fixture(self.fixture)
        if self.key not in values:
            raise FixtureValueError(
                f"fixture {self.fixture!r} provides no {self.key!r}; it provides {', '.join(values) or 'nothing'}"
            )
        value: T = checked(values[self.key], self.kind, f"{self.key!r} of fixture {self.fixture!r}")
        return value


class UsesFixtures:
    """What tests and fixtures have in common: they read the values of the fixtures that they stand on."""

    #: The needed values by the name of the attribute; filled by :class:`FixtureValue`.
    needed_values: Mapping[str, FixtureValue[Any]] = {}
    _fixture_values: Mapping[str, Mapping[str, Any]] = {}

    def fixture(self, name: str) -> Mapping[str, Any]:
        """The values that a fixture provides, by key. Raises FixtureValueError when this does not stand on it."""
        if name not in self._fixture_values:
            known = ", ".join(self._fixture_values) or "none"
            raise FixtureValueError(f"it does not stand on a fixture {name!r}; its fixtures are: {known}")
        return self._fixture_values[name]

    def take_fixture_values(self, text: str) -> None:
        """Take over the values of all fixtures, and see that those are there which are needed. For the worker."""
        if text:
            self._fixture_values = json.loads(text)
        for name in self.needed_values:
            getattr(self, name)


def checked(value: Any, kind: type, what: str) -> Any:
    """The value, which is of a type. A whole number is a ``float`` as well; a ``bool`` is no number."""
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise FixtureValueError(f"{what} is {value!r}, which is no {kind.__name__}")
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise FixtureValueError(f"{what} cannot be handed on: {error}") from None
    return value


def _require_type(kind: type) -> None:
    if kind not in _TYPES:
        raise FixtureValueError(f"a value is one of {', '.join(one.__name__ for one in _TYPES)}, not {kind}")
