"""The description of a plug-in, which listing, describing, validating, planning and sharing use.

It has two sources: the text of the file, which is read without running it (:mod:`rtf.testing.plugin_source`), and the
loaded class, in an isolated child (:mod:`rtf.testing.inspection`), which alone has the parameters. The matrix is here,
too: it determines how many tests a class is.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, Any

import msgspec

from rtf.testing.measurement import number

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

#: The classes of safety of tests that move nothing; most tests declare none.
_HARMLESS = ("", "still")


class Axis(msgspec.Struct, frozen=True):
    """A parameter that a matrix varies: the label of each value, which names and ids show, and its text."""

    name: str
    labels: tuple[str, ...]
    texts: tuple[str, ...]


class Matrix:
    """The values of parameters with which a test class is run, each combination as a test of its own.

    It is a class attribute by the name of ``matrix``, and its keywords are the keys of declared parameters::

        class Nod(TestCase):
            speed = Parameter(float, "reference speed", unit="deg/s")
            part = Parameter(str, "part of the robot")
            matrix = Matrix(speed=(10, 20), part=("head", "torso"))

    The tests are ``Nod[10-head]``, ``Nod[10-torso]``, ``Nod[20-head]`` and ``Nod[20-torso]``, with the labels that
    pytest gives to such values. Where a suite or the command line sets a parameter, that is not varied; a parameter
    file counts less than the matrix.
    """

    def __init__(self, **values: Iterable[object]) -> None:
        self.axes = tuple(_axis(name, tuple(given)) for name, given in values.items())


def _axis(name: str, values: Sequence[object]) -> Axis:
    axis = Axis(name, tuple(_label(name, *item) for item in enumerate(values)), tuple(map(_text, values)))
    if not values or len(set(axis.labels)) < len(values):
        raise ValueError(f"the matrix needs different values of {name!r}, not {values!r}")
    return axis


def _label(name: str, index: int, value: object) -> str:
    """The label as pytest makes it: plain values as they are, others by name and number."""
    return str(value) if isinstance(value, str | int | float) else f"{name}{index}"


def _text(value: object) -> str:
    """The value as a suite's ``<parameter>`` has it."""
    if isinstance(value, str):
        return value or '""'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return value_text(value)
    raise TypeError(f"a matrix holds truth values, numbers, texts and lists of these, not {value!r}")


def value_text(value: object) -> str:
    """Write a value in text form."""
    from rtf.bottle import Bottle

    if isinstance(value, Bottle):
        return value.to_text()
    if isinstance(value, float):
        return number(value)
    if isinstance(value, list | tuple):
        return f"({' '.join(value_text(item) for item in value)})"
    return Bottle([value]).to_text()


class ParameterSpec(msgspec.Struct, frozen=True, kw_only=True):
    """A declared parameter: its key, all its names, and, once the class is loaded, the rest in words for people."""

    name: str
    names: frozenset[str]
    secret: bool = False
    type: str = ""
    unit: str = ""
    default: str = ""
    range: str = ""
    description: str = ""

    @classmethod
    def declared(cls, attribute: str, key: str, aliases: Iterable[str], **words: Any) -> ParameterSpec:  # the rest
        """Return the description of a parameter that an attribute of a class declares."""
        return cls(name=key or attribute, names=frozenset({attribute, key or attribute, *aliases}), **words)


class PluginSpec(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of a plug-in.

    ``safety`` is a word in small letters, empty if the plug-in declares none, and None if the text leaves it open;
    ``occupies`` is None likewise. It is ``complete`` unless the text leaves open what the planner has to know. A file
    with several test classes, of which none is named, has them in ``classes`` and nothing else.
    """

    class_name: str = ""
    names: tuple[str, ...] = ()
    description: str = ""
    tags: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    timeout: float | None = None
    occupies: str | None = ""
    safety: str | None = ""
    matrix: tuple[Axis, ...] = ()
    classes: tuple[str, ...] = ()
    complete: bool = True
    parameters: tuple[ParameterSpec, ...] = ()

    @property
    def secrets(self) -> tuple[str, ...]:
        """The names of parameters that are declared secret, sorted."""
        return tuple(sorted({name for one in self.parameters if one.secret for name in one.names}))

    @property
    def summary(self) -> str:
        """The first line of the description."""
        return self.description.partition("\n")[0]

    @property
    def may_move(self) -> bool:
        """Whether a test may move something; an unknown safety class counts as moving."""
        return may_move(self.safety)


#: A plug-in of which nothing is known.
UNKNOWN = PluginSpec(safety=None)


def combinations(spec: PluginSpec, given: Collection[str]) -> Iterator[tuple[str, tuple[tuple[str, str], ...]]]:
    """Yield each combination of a matrix in the parameters that are not ``given``: its label and its parameters."""
    names = {name: one.names for one in spec.parameters for name in one.names}
    varied = [axis for axis in spec.matrix if names.get(axis.name, frozenset({axis.name})).isdisjoint(given)]
    for chosen in product(*(zip(axis.labels, axis.texts, strict=True) for axis in varied)):
        parameters = tuple((axis.name, text) for axis, (_, text) in zip(varied, chosen, strict=True))
        yield "-".join(label for label, _ in chosen), parameters


def may_move(safety: object) -> bool:
    """Whether a test with this ``safety``, a word, a member of an enumeration or None, may move something."""
    return _word_of(safety) not in _HARMLESS


#: The value of an attribute that is not set, and of one that has to be computed.
ABSENT, UNCERTAIN = object(), object()


def make_spec(
    class_name: str, description: str, get: Callable[[str], object], parameters: Iterable[ParameterSpec]
) -> PluginSpec:
    """Return the description of a class; ``get`` returns the value of an attribute, or ABSENT, or UNCERTAIN."""
    safety, matrix, occupies, timeout = get("safety"), get("matrix"), get("occupies"), get("timeout")
    tags, requires = get("tags"), get("requires")
    return PluginSpec(
        class_name=class_name,
        names=(*as_strings(get("plugin_name")), *as_strings(get("aliases"))),
        description=description,
        tags=as_strings(tags),
        requires=as_strings(requires),
        # A limit that is no number is the author's error, which loading the test reports.
        timeout=float(timeout) if isinstance(timeout, int | float) and not math.isnan(timeout) else None,
        occupies=None if occupies is UNCERTAIN else occupies if isinstance(occupies, str) else "",
        safety=None if safety is UNCERTAIN else "" if safety is ABSENT else _word_of(safety),
        matrix=matrix.axes if isinstance(matrix, Matrix) else (),
        complete=all(value is not UNCERTAIN for value in (tags, requires, timeout, occupies, matrix)),
        parameters=tuple(parameters),
    )


def as_strings(value: object) -> tuple[str, ...]:
    """Return one string or several as a tuple."""
    if isinstance(value, str):
        return (value,) if value else ()
    return tuple(str(item) for item in value) if isinstance(value, tuple | list) else ()


def _word_of(safety: object) -> str:
    """Return the word for a safety class: a text, or a member of an enumeration."""
    return str(getattr(safety, "name", safety)).lower()
