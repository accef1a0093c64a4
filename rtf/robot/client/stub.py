"""What all interfaces of a client of a control board are made with: how axes and values become questions and commands.

Axes are checked here, and so are values, because a board does not answer what is streamed, and may take anything.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rtf.bottle import Bottle, Value
from rtf.robot.client.questions import GETTING, HEADS, SETTING, Question, Questions
from rtf.robot.client.state import chosen
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.interfaces import values_for
from rtf.robot.vocabulary import Shape

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.client.link import ControlBoardLink
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

T = TypeVar("T")
#: What nearly all answers are made of; there are other numbers, too.
_NUMBERS = {int, float}


class BoardStub(Device):
    """A device whose methods are questions to a board. Raises DeviceError while it is not open."""

    _opened: ControlBoardLink | None = None

    @property
    def _link(self) -> ControlBoardLink:
        if self._opened is None:
            raise DeviceError(f"{self.name} is not open")
        return self._opened

    # Axes and values ---------------------------------------------------------------------------------------------

    def _axis(self, axis: int) -> int:
        link = self._link
        if 0 <= axis < link.axes:
            return int(axis)
        raise RefusedError(f"{link.settings.remote}: there is no joint {axis}; they go from 0 to {link.axes - 1}")

    def _chosen(self, axes: AxisSelection) -> list[int]:
        link = self._link
        return chosen(link.settings.remote, link.axes, axes)

    def _values(self, values: Values, count: int) -> FloatArray:
        try:
            return values_for(count, values)
        except RefusedError as error:
            raise RefusedError(f"{self._link.settings.remote}: {error}") from None

    def _finite(self, *numbers: float) -> list[Value]:
        """Numbers as they are sent. Raises RefusedError for what is none."""
        for number in numbers:
            if not math.isfinite(number):
                raise RefusedError(f"{self._link.settings.remote}: {number} is no finite number")
        return [float(number) for number in numbers]

    # One axis, or none -------------------------------------------------------------------------------------------

    def _get(self, method: str) -> Any:
        """What is asked of the board as a whole."""
        return self._link.rpc.read(GETTING[method][Shape.NONE])

    def _get_of(self, method: str, axis: int, *lead: Value) -> Any:
        return self._link.rpc.read(GETTING[method][Shape.SINGLE], *lead, self._axis(axis))

    def _set_of(self, method: str, axis: int, *elements: Value) -> None:
        self._link.rpc.tell(SETTING[method][Shape.SINGLE], self._axis(axis), *elements)

    # Any choice of axes ------------------------------------------------------------------------------------------

    def _elements(self, method: str, axes: AxisSelection, *lead: Value) -> Sequence[Value]:
        """What the board answers, one element for each axis."""
        questions, rpc = GETTING[method], self._link.rpc
        if axes is None:
            return self._list(questions[Shape.ALL], self._link.axes, *lead)
        if isinstance(axes, int | np.integer):
            question, axis = questions[Shape.ONE], self._axis(int(axes))
            data = rpc.get(question, *lead, axis)
            if len(data) != 1:
                raise rpc.nonsense(question, (*lead, axis), data, "one value is needed")
            return data
        numbers = self._chosen(axes)
        if not numbers:
            return []
        if Shape.GROUP in questions:
            return self._list(questions[Shape.GROUP], len(numbers), *lead, len(numbers), _axes(numbers))
        every = self._list(questions[Shape.ALL], self._link.axes, *lead)
        return [every[number] for number in numbers]

    def _list(self, question: Question, count: int, *arguments: Value) -> Sequence[Value]:
        rpc = self._link.rpc
        data = rpc.get(question, *arguments)
        inner = data[0] if len(data) == 1 else None
        if not isinstance(inner, Bottle) or len(inner) != count:
            raise rpc.nonsense(question, arguments, data, f"a list of {count} values is needed")
        return inner.elements()

    def _floats(self, method: str, axes: AxisSelection, *lead: Value) -> FloatArray:
        """Numbers, which a board may also not have measured: then they are not finite."""
        elements = self._elements(method, axes, *lead)
        if not {*map(type, elements)} <= _NUMBERS and not all(isinstance(element, int | float) for element in elements):
            raise self._link.rpc.nonsense(GETTING[method][Shape.ALL], lead, [*elements], "numbers are needed")
        return np.array(elements, dtype=np.float64)

    def _words(self, method: str, axes: AxisSelection, read: Callable[[Value], T]) -> tuple[T, ...]:
        """Elements of another kind, which ``read`` makes something of; it raises RefusedError where it cannot."""
        elements = self._elements(method, axes)
        try:
            return tuple(map(read, elements))
        except RefusedError as error:
            raise self._link.rpc.nonsense(GETTING[method][Shape.ALL], (), [*elements], str(error)) from None

    def _flag(self, method: str, axes: AxisSelection) -> bool:
        """Whether something is true for all of these axes."""
        questions, rpc = GETTING[method], self._link.rpc
        if axes is None:
            return bool(rpc.read(questions[Shape.ALL]))
        if isinstance(axes, int | np.integer):
            return bool(rpc.read(questions[Shape.ONE], self._axis(int(axes))))
        numbers = self._chosen(axes)
        return not numbers or bool(rpc.read(questions[Shape.GROUP], len(numbers), _axes(numbers)))

    def _set(self, method: str, values: Values, axes: AxisSelection, *lead: Value) -> None:
        """Give the axes a number each."""
        if isinstance(axes, int | np.integer) and isinstance(values, int | float):
            self._put(SETTING[method], self._finite(values), axes, *lead)
        else:
            count = len(self._chosen(axes))
            self._put(SETTING[method], self._values(values, count).tolist(), axes, *lead)

    def _put(self, questions: Questions, elements: list[Value], axes: AxisSelection, *lead: Value) -> None:
        """Give the axes an element each."""
        rpc = self._link.rpc
        if axes is None:
            rpc.tell(questions[Shape.ALL], *lead, Bottle.adopt(elements))
        elif isinstance(axes, int | np.integer):
            rpc.tell(questions[Shape.ONE], *lead, self._axis(int(axes)), elements[0])
        elif Shape.GROUP in questions:
            numbers = self._chosen(axes)
            if numbers:
                rpc.tell(questions[Shape.GROUP], *lead, len(numbers), _axes(numbers), Bottle.adopt(elements))
        else:
            for number, element in zip(self._chosen(axes), elements, strict=True):
                rpc.tell(questions[Shape.ONE], *lead, number, element)

    def _do(self, method: str, axes: AxisSelection) -> None:
        """Something that needs no value."""
        questions, rpc = SETTING[method], self._link.rpc
        if axes is None:
            rpc.tell(questions[Shape.ALL])
        elif isinstance(axes, int | np.integer):
            rpc.tell(questions[Shape.ONE], self._axis(int(axes)))
        elif Shape.GROUP in questions:
            numbers = self._chosen(axes)
            if numbers:
                rpc.tell(questions[Shape.GROUP], len(numbers), _axes(numbers))
        else:
            for number in self._chosen(axes):
                rpc.tell(questions[Shape.ONE], number)

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        """Stream a command. One for a single axis waits for the one before."""
        heads, stream = HEADS[method], self._link.stream
        if axes is None:
            stream.send([*heads[Shape.ALL]], self._values(values, self._link.axes), strict=False)
            return
        numbers = self._chosen(axes)
        given = self._values(values, len(numbers))
        if isinstance(axes, int | np.integer):
            stream.send([*heads[Shape.ONE], *numbers], given, strict=True)
        elif Shape.GROUP not in heads:
            for place, number in enumerate(numbers):
                stream.send([*heads[Shape.ONE], number], given[place : place + 1], strict=True)
        elif numbers:
            stream.send([*heads[Shape.GROUP], len(numbers), _axes(numbers)], given, strict=False)


def _axes(numbers: list[int]) -> Bottle:
    return Bottle.adopt([*numbers])
