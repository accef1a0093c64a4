"""Values of parameters with which a test class is run, each combination as a test of its own."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence


class Axis(msgspec.Struct, frozen=True):
    """A parameter that a matrix varies: of each value the label, which names and ids show, and the text."""

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
    pytest gives to such values. Where a suite or the command line sets a parameter, that is not varied.
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
        from rtf.testing.parameters import value_text

        return value_text(value)
    raise TypeError(f"a matrix holds truth values, numbers, texts and lists of these, not {value!r}")


def combinations(axes: Iterable[Axis], given: Collection[str]) -> Iterator[tuple[str, tuple[tuple[str, str], ...]]]:
    """Each combination of the values of the parameters that are not ``given``: its label and its parameters."""
    varied = [axis for axis in axes if axis.name not in given]
    for chosen in product(*(zip(axis.labels, axis.texts, strict=True) for axis in varied)):
        parameters = tuple((axis.name, text) for axis, (_, text) in zip(varied, chosen, strict=True))
        yield "-".join(label for label, _ in chosen), parameters
