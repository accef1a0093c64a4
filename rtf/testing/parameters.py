"""Parameters that tests and fixtures declare once, with type, unit, default and range, and where values come from.

A declaration is a class attribute, and reading it from an object gives the value::

    class JointLimits(TestCase):
        part = Parameter(str, "part of the robot", default="left_arm")
        joints = Parameter(list[int], "joints to test", default=[0, 1, 2, 3])
        speed = Parameter(list[float], "reference speeds", unit="deg/s", default=20.0, low=1.0, length="joints")

Later layers win: defaults, the profile of the thing under test (:meth:`Declared.profile`), the file of ``--from``, the
suite's ``param``, its ``<parameter>`` elements, ``--set``.
Each value has its source. A key that is not declared, a value of the wrong type, out of range or of the wrong length
is an error that names the place; all of them are reported in one go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar, get_args, get_origin, overload

from rtf.bottle import Bottle, Value, as_bool, as_string, is_bool, to_string, to_text
from rtf.errors import nearest
from rtf.resources import DiagnosticKind, find_parameters
from rtf.resources.arguments import loose_words, parse_arguments
from rtf.testing.measurement import limits_text, number, require_limits, unit
from rtf.testing.plugin_spec import value_text
from rtf.testing.plugins import shipped_folder
from rtf.testing.secret_values import MASK, is_secret, masked_text
from rtf.testing.verdict import TestingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rtf.bottle import Property
    from rtf.resources import Parameters

T = TypeVar("T")

#: Keys that say where values come from and are no parameters themselves.
_CONTROL_KEYS = frozenset({"from", "context"})


class ParameterError(TestingError, ValueError):
    """Values that do not fit their declarations; the message lists every problem, one per line."""

    def __init__(self, owner: str, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        head = f"{len(problems)} problem{'s' if len(problems) > 1 else ''} with the parameters of {owner}"
        super().__init__("\n".join([f"{head}:", *(f"  {problem}" for problem in problems)]))


#: In place of a default: the parameter must be given.
REQUIRED = object()


class Parameter(Generic[T]):
    """The declaration of one parameter of type ``bool``, ``int``, ``float``, ``str``, a ``list`` of one, or ``Bottle``.

    ``default`` is the value when no layer has one; without it the parameter must be given. For a list with a ``length``
    a single default element stands for all. ``low`` and ``high`` are inclusive and hold for each element of a list.
    ``length`` is a number, or the name of another parameter: the length of a list, or the value of an ``int``.
    ``Bottle`` takes everything that follows the key, or a whole section, as it is. A ``secret`` value is shown nowhere;
    one whose key has a word such as ``password``, ``token`` or ``key`` is secret unless ``secret`` is False.
    """

    def __init__(
        self,
        kind: type[T],
        description: str,
        *,
        default: Any = REQUIRED,  # T, or one element of it
        unit: str = "",
        low: float | None = None,
        high: float | None = None,
        length: int | str | None = None,
        choices: Sequence[object] = (),
        aliases: Sequence[str] = (),
        key: str = "",
        secret: bool | None = None,
    ) -> None:
        self._secret = secret
        self.kind = kind
        self.description = description
        self.default = default
        self.unit = _symbol(unit)
        require_limits(low=low, high=high)
        self.low = low
        self.high = high
        self.length = length
        self.choices = tuple(choices)
        self.aliases = tuple(aliases)
        self.key = key
        self.element: type[object] = get_args(kind)[0] if get_origin(kind) is list else kind
        self.is_list = get_origin(kind) is list
        if self.element not in _ELEMENTS:
            raise TypeError(f"a parameter is a bool, int, float, str, a list of one of these, or a Bottle; not {kind}")

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self.key = self.key or name

    @overload
    def __get__(self, instance: None, owner: type) -> Parameter[T]: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> Parameter[T] | T:
        if instance is None:
            return self
        values: dict[str, Any] = instance.__dict__.setdefault("_parameter_values", {})
        if self.name in values:
            value: T = values[self.name]
            return value
        if self.default is REQUIRED:
            raise AttributeError(f"parameter {self.key!r} of {owner.__name__} has no value yet")
        fallback: T = self.default
        return fallback

    def __set__(self, instance: object, value: T) -> None:
        instance.__dict__.setdefault("_parameter_values", {})[self.name] = value

    @property
    def secret(self) -> bool:
        """Whether no journal, report or page shows the value."""
        return is_secret(self.key) if self._secret is None else self._secret

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is REQUIRED

    @property
    def type_name(self) -> str:
        """The type as authors declare it, such as ``list of float``."""
        return f"list of {self.element.__name__}" if self.is_list else self.element.__name__.lower()

    @property
    def noun(self) -> str:
        """The type for people who need not know Python, such as ``list of numbers``."""
        noun = _ELEMENTS[self.element].noun
        return f"list of {noun}s" if self.is_list else noun

    def range_text(self) -> str:
        """The allowed range, for people; empty without one."""
        parts = []
        if self.choices:
            parts.append(" | ".join(map(str, self.choices)))
        if self.low is not None or self.high is not None:
            parts.append(limits_text(self.low, self.high, self.unit))
        if self.length is not None:
            parts.append(f"as many as {self.length}" if isinstance(self.length, str) else f"{self.length} values")
        return ", ".join(parts)

    def default_text(self) -> str:
        """The default in text form, for people."""
        return "required" if self.required else MASK if self.secret else value_text(self.default)

    # From values to what the test sees -----------------------------------------------------------------------------

    def convert(self, group: Bottle, text: str | None = None) -> T:
        """Make the value of everything that followed the key. Raises ValueError with what is wrong.

        ``text`` is the value as it was written, where it stood alone: that is what a single text is.
        """
        if self.element is Bottle and not self.is_list:
            return group  # type: ignore[return-value]
        values: list[Value] = list(group)
        if self.kind is str and text and text.strip() and not _is_quoted(text, values):
            values = [text.strip()]
        if self.is_list:
            if len(values) == 1 and isinstance(values[0], Bottle):
                values = list(values[0])
            return [self._element(value, index) for index, value in enumerate(values)]  # type: ignore[return-value]
        if len(values) != 1:
            if not values:
                raise ValueError("has no value")
            hint = "; put a text with blanks in quotes" if self.kind is str else ""
            raise ValueError(f"is one {self.noun}, not {len(values)} values{hint}")
        return self._element(values[0], None)  # type: ignore[return-value]

    def _element(self, value: Value, index: int | None) -> object:
        where = "" if index is None else f"element {index}: "
        kind = _ELEMENTS[self.element]
        made = kind.convert(value)
        if made is None:
            hint = ": write true or false" if self.element is bool else ""
            raise ValueError(f"{where}{to_text(value)} is no {kind.noun}{hint}")
        if isinstance(made, int | float) and not isinstance(made, bool):
            low, high = self.low, self.high
            if math.isnan(made) or (low is not None and made < low) or (high is not None and made > high):
                raise ValueError(f"{where}{number(made)} is not {limits_text(low, high, self.unit)}")
        if self.choices and made not in self.choices:
            near = nearest(str(made), map(str, self.choices))
            hint = f"; did you mean {near!r}?" if near else ""
            raise ValueError(f"{where}{made!r} is none of {', '.join(map(repr, self.choices))}{hint}")
        return made


def _is_quoted(text: str, values: list[Value]) -> bool:
    return len(values) == 1 and text.lstrip().startswith('"')


def _symbol(symbol: str) -> str:
    return str(unit(symbol))


class _Element(NamedTuple):
    """A type of values: its name for people, and a function that converts a written value; None if it does not fit."""

    noun: str
    convert: Callable[[Value], object | None]


def _to_bool(value: Value) -> bool | None:
    return as_bool(value) if is_bool(value) or (isinstance(value, int) and value in (0, 1)) else None


_ELEMENTS: dict[type[object], _Element] = {
    bool: _Element("truth value", _to_bool),
    int: _Element("whole number", lambda value: int(value) if isinstance(value, int) else None),
    float: _Element("number", lambda value: float(value) if isinstance(value, int | float) else None),
    str: _Element("text", lambda value: None if isinstance(value, Bottle) else to_string(value)),
    Bottle: _Element("list", lambda value: value),
}


@dataclass(frozen=True, slots=True)
class Given:
    """One value of one layer: the key as written, what followed it, and its place; ``text`` if it stood alone."""

    key: str
    group: Bottle
    source: str
    text: str | None = None


def _require_own_names(cls: type) -> None:
    """Refuse a class of a plug-in that defines a private name which its base classes here use themselves."""
    package = __name__.partition(".")[0]
    if cls.__module__.partition(".")[0] == package:
        return
    for base in cls.__mro__[1:]:
        hidden = [name for name in vars(cls).keys() & vars(base).keys() if name[0] == "_" and not name.endswith("__")]
        if hidden and base.__module__.partition(".")[0] == package:
            names = ", ".join(sorted(hidden))
            raise TypeError(f"{cls.__name__} defines {names}, which {base.__name__} uses itself; give it another name")


class Declared:
    """Base of tests and fixtures: collects the declarations of a class and fills an object's values."""

    #: Keys that files may carry and that mean nothing (any more).
    ignored_keys: ClassVar[tuple[str, ...]] = ()
    #: The key that the words of ``param`` before its first ``--key`` belong to; without one they are refused.
    words_key: ClassVar[str] = ""
    #: What reading the parameter file found doubtful, such as a variable that is not defined.
    parameter_warnings: tuple[str, ...] = ()
    _suite_values: Property | None = None
    _declarations: ClassVar[dict[str, Parameter[Any]]]

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        _require_own_names(cls)

    @classmethod
    def declarations(cls) -> dict[str, Parameter[Any]]:
        """The declared parameters by attribute name, those of base classes first. They are looked up once."""
        found: dict[str, Parameter[Any]] | None = cls.__dict__.get("_declarations")
        if found is None:
            attributes = (item for base in reversed(cls.__mro__) for item in vars(base).items())
            found = {name: value for name, value in attributes if isinstance(value, Parameter)}
            cls._declarations = found
        return found

    def resolve_parameters(
        self,
        *,
        param: str,
        parameters: Sequence[tuple[str, str]] = (),
        overrides: Sequence[tuple[str, str]] = (),
        environment: str = "",
        place: str = "",
        folder: str = "",
    ) -> list[dict[str, str]]:
        """Fill the values from all layers, and say each with its source: rows of name, value, unit, source.

        ``place`` names the suite's line, ``folder`` is the suite's. Raises ParameterError with every problem, and
        whatever reading the file of ``--from`` raises.
        """
        declared = self.declarations()
        if not (param or parameters or overrides or len(declared) > _BUILT_IN):
            return []  # the common case of a test without parameters costs nothing
        found = find_parameters(param, environment, roots=_roots(folder))
        self._suite_values = found.environment
        lost = [str(item) for item in found.diagnostics if item.kind is DiagnosticKind.UNBALANCED]
        self.parameter_warnings = tuple(text for text in map(str, found.diagnostics) if text not in lost)
        source = f"param of {place}" if place else "param"
        words = self._loose_words(param, source, lost)
        layers = [*self.profile(folder), *words, *_layers(found, parameters, overrides, place)]
        rows = _Filling(self, declared, lost).fill(layers)
        self.check_parameters(folder)
        return rows

    def _loose_words(self, param: str, source: str, problems: list[str]) -> Iterator[Given]:
        """Yield what stands in ``param`` before its first key. If it were lost, a default would move something else."""
        words = loose_words(param)
        if words and self.words_key:
            group = parse_arguments([f"--{self.words_key}", *words]).find_group(self.words_key)
            assert group is not None
            yield Given(self.words_key, group.tail(), source)
        elif words:
            text = masked_text(" ".join(words))
            problems.append(f"{text!r} belongs to no key ({source}); write --KEY VALUE, as in --{text.lstrip('-')}")

    def suite_value(self, key: str) -> str:
        """Return the value of a key, such as ``robotname``, in the suite's environment string; empty without it."""
        return as_string(self._suite_values.find(key)) if self._suite_values is not None else ""

    def profile(self, folder: str) -> Iterable[Given]:  # noqa: ARG002 - for overrides
        """Return values of the thing under test that replace the defaults; all other layers win over them.

        Called when the environment of the suite is known. ``folder`` is the suite's. An override may raise an error
        that says why they cannot be read.
        """
        return ()

    def check_parameters(self, folder: str) -> None:
        """Check that the values work together, before anything starts; called when all are filled.

        For authors: raise an error that names the parameter, with a hint. ``folder`` is the suite's.
        """

    def parameter_source(self, key: str) -> str:
        """Return the source of a value by the parameter's key: a place in a file, ``param`` of a place, ``--set``."""
        sources: dict[str, str] = self.__dict__.get("_parameter_sources", {})
        return sources.get(key, "default")

    def parameter_values(self) -> dict[str, Any]:
        """The current value of every parameter by name."""
        return {
            name: getattr(self, name) for name, p in self.declarations().items() if not p.required or _has(self, name)
        }


#: ``name`` and ``description``, which every test has.
_BUILT_IN = 2


def _has(target: Declared, name: str) -> bool:
    return name in target.__dict__.get("_parameter_values", {})


def _roots(folder: str) -> list[str]:
    """Return the folders of parameter files after YARP's own: beside the suite, and with the shipped suites."""
    return [*([folder] if folder else []), str(shipped_folder("suites"))]


def _layers(
    found: Parameters, parameters: Sequence[tuple[str, str]], overrides: Sequence[tuple[str, str]], place: str
) -> Iterator[Given]:
    if found.file is not None:
        yield from _file_layer(found)
    for key, group in found.arguments.items():
        if key not in _CONTROL_KEYS:
            yield Given(key, group.tail(), f"param of {place}" if place else "param")
    for key, text in parameters:
        yield Given(key, _parse(text), f"<parameter> of {place}" if place else "<parameter>", text)
    for key, text in overrides:
        yield Given(key, _parse(text), "--set", text)


def _parse(text: str) -> Bottle:
    """Read a value that stands alone: words that are all texts are one, with its blanks, as on a command line."""
    bottle = Bottle.parse(text)
    if len(bottle) > 1 and all(isinstance(value, str) for value in bottle):
        return Bottle([text])
    return bottle


def _file_layer(found: Parameters) -> Iterator[Given]:
    for key, group in found.properties.items():
        place = found.properties.location(key)
        yield Given(key, group.tail(), str(place) if place else str(found.file))


class _Filling:
    """One pass over the layers, which collects every problem instead of ending at the first.

    ``problems`` are those with the file itself: values that are lost would become defaults, and move something else.
    """

    def __init__(self, target: Declared, declared: dict[str, Parameter[Any]], problems: list[str]) -> None:
        self._target = target
        self._declared = declared
        self._problems = problems
        self._sources: dict[str, str] = {}
        self._by_key = {
            key: name for name, parameter in declared.items() for key in (parameter.key, *parameter.aliases)
        }

    def fill(self, layers: Iterable[Given]) -> list[dict[str, str]]:
        chosen = {self._name_of(given): given for given in layers}  # a later layer wins
        for name, given in chosen.items():
            if name:
                self._convert(name, given)
        for name, parameter in self._declared.items():  # lengths of defaults follow values that are given
            if name not in chosen:
                self._default(name, parameter)
        for name, parameter in self._declared.items():
            self._check_length(name, parameter)
        if self._problems:
            raise ParameterError(type(self._target).__name__, self._problems)
        self._target.__dict__["_parameter_sources"] = {key: self._sources[name] for key, name in self._by_key.items()}
        return self._rows()

    def _name_of(self, given: Given) -> str:
        name = self._by_key.get(given.key, "")
        if not name and given.key not in self._target.ignored_keys:
            near = nearest(given.key, self._by_key)
            hint = f"did you mean {near!r}?" if near else f"known are {', '.join(sorted(self._by_key))}"
            self._problems.append(f"unknown parameter {given.key!r} ({given.source}); {hint}")
        return name

    def _convert(self, name: str, given: Given) -> None:
        parameter = self._declared[name]
        try:
            value = parameter.convert(given.group, given.text)
        except ValueError as error:
            problem = f"the secret value is no {parameter.noun} that is allowed" if parameter.secret else error
            self._problems.append(f"{given.key}: {problem} ({given.source})")
            return
        parameter.__set__(self._target, value)
        self._sources[name] = given.source

    def _default(self, name: str, parameter: Parameter[Any]) -> None:
        if parameter.required:
            self._problems.append(f"{parameter.key}: must be given ({parameter.noun}; {parameter.description})")
            return
        value = parameter.default
        if parameter.is_list:
            count = self._wanted_length(parameter)
            value = [*value] if isinstance(value, list | tuple) else [value] * (1 if count is None else count)
        parameter.__set__(self._target, value)
        self._sources[name] = "default"

    def _wanted_length(self, parameter: Parameter[Any]) -> int | None:
        if not isinstance(parameter.length, str):
            return parameter.length
        other = self._declared.get(parameter.length)
        if other is None:
            raise TypeError(f"{parameter.name}: its length refers to {parameter.length!r}, which is not declared")
        if other.required and not _has(self._target, other.name):
            return None
        value = getattr(self._target, other.name)  # its default, if it is not filled yet
        return len(value) if isinstance(value, list | tuple) else int(value)

    def _check_length(self, name: str, parameter: Parameter[Any]) -> None:
        if not parameter.is_list or not _has(self._target, name):
            return
        wanted, have = self._wanted_length(parameter), len(getattr(self._target, name))
        if wanted is not None and have != wanted:
            reason = f" (as many as {parameter.length})" if isinstance(parameter.length, str) else ""
            values = "value" if have == 1 else "values"
            problem = f"has {have} {values}, must have {wanted}{reason} ({self._sources[name]})"
            self._problems.append(f"{parameter.key}: {problem}")

    def _rows(self) -> list[dict[str, str]]:
        return [
            {
                "name": parameter.key,
                "value": MASK if parameter.secret else value_text(getattr(self._target, name)),
                "unit": parameter.unit,
                "source": self._sources[name],
            }
            for name, parameter in self._declared.items()
            if not (self._sources[name] == "default" and name in {"name", "description"})
        ]
