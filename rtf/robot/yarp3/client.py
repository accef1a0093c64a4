"""The client of a YARP 3 control board: a remote board with the interfaces of a local one.

Measurements come with the state that the board publishes; setpoints at a high rate are streamed without a reply;
everything else is a request with a reply. For YARP 4 see :mod:`rtf.robot.yarp4.client`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rtf.bottle import Bottle, Value, Vocab
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IMotor, IMotorEncoders, IRemoteVariables
from rtf.robot.network.board_stub import INTEGER, SLOW, BoardStub
from rtf.robot.yarp3 import values as kinds
from rtf.robot.yarp3.requests import CALIBRATE, CALIBRATION_DONE, GETTING, KEEP_CALIBRATION, SETTING
from rtf.robot.yarp3.rpc import WordRpc
from rtf.robot.yarp3.table import Shape

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.forwarded_board import Plural
    from rtf.robot.interfaces import AxisSelection, CalibrationParameters, Pid, PidType
    from rtf.robot.yarp3.requests import Request, RequestsByShape

R = TypeVar("R")
#: The types of nearly all numbers in answers; there are others, too.
_NUMBERS = {int, float}
#: How many parameters of a calibration are sent.
_CALIBRATE, _KEEP = 3, 4


class RemoteControlBoard(BoardStub[WordRpc]):
    """``remote_controlboard``: a board of another process. The parameters are those of :class:`ClientSettings`.

    A lost board raises NoAnswerError, or StaleStateError for measurements, and the next call tries to reconnect; see
    :class:`~rtf.robot.network.board_link.ControlBoardLink` for how long that may take.

    A client that dies stops nothing; the board decides what a joint does then. A trajectory continues to its end, a
    joint in velocity mode is stopped by the board's watchdog, and setpoints of position, torque, current and duty cycle
    stay at their last value unless the board has a watchdog for them. The same holds for ``close``: call ``stop`` or
    change the control mode to make joints stand still.
    """

    rpc = WordRpc

    # Requests: one joint, a group and all joints each have a form of their own ----------------------------------------

    def forward_reading(self, method: Plural, axes: AxisSelection, *of: object) -> Sequence[Any]:
        requests, lead = GETTING[method.__name__], _words(of) if of else ()
        request, elements = requests[Shape.ALL], self._elements(requests, axes, lead)
        if request.kind is kinds.FLOAT:
            return self._numbers(request, lead, elements)
        try:
            return [request.kind.read([element])[0] for element in elements]
        except RefusedError as error:
            raise self._link.rpc.nonsense(request, lead, [*elements], str(error)) from None

    def forward_setting(self, method: Plural, values: Sequence[Any], axes: AxisSelection, *of: object) -> None:
        requests = SETTING[method.__name__]
        write = requests[Shape.ONE].kind.write
        self._command(requests, axes, _words(of), [element for value in values for element in write(value)])

    def forward_action(self, method: Plural, axes: AxisSelection) -> list[Any]:
        requests = GETTING.get(method.__name__)
        if requests is None:
            self._command(SETTING[method.__name__], axes)
            return []
        rpc, numbers = (self._opened or self._link).rpc, self.chosen(axes)
        if isinstance(axes, INTEGER):
            return [rpc.read(requests[Shape.ONE], *numbers)]
        if axes is None:
            return [rpc.read(requests[Shape.ALL])]
        return [not numbers or rpc.read(requests[Shape.GROUP], len(numbers), _listed(numbers))]

    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        name, rpc = method.__name__, self._link.rpc
        if name in GETTING:
            return rpc.read(GETTING[name][Shape.SINGLE], *_words(of), axis)  # type: ignore[no-any-return]
        request = SETTING[name][Shape.SINGLE]
        command = rpc.act if name in SLOW else rpc.command
        return command(request, *_words(of), axis, *self._written(request, arguments))  # type: ignore[return-value]

    def forward_whole(self, method: Callable[..., R]) -> R:
        name, rpc = method.__name__, self._link.rpc
        if name in GETTING:
            return rpc.read(GETTING[name][Shape.NONE])  # type: ignore[no-any-return]
        command = rpc.act if name in SLOW else rpc.command
        return command(SETTING[name][Shape.NONE])  # type: ignore[return-value]

    def _elements(self, requests: RequestsByShape, axes: AxisSelection, lead: tuple[Value, ...]) -> Sequence[Value]:
        """Return the elements of the answer, one for each axis."""
        rpc = self._link.rpc
        if axes is None:
            return self._list(requests[Shape.ALL], self.axes(), *lead)
        numbers = self.chosen(axes)
        if isinstance(axes, INTEGER):
            request = requests[Shape.ONE]
            data = rpc.get(request, *lead, *numbers)
            if len(data) != 1:
                raise rpc.nonsense(request, (*lead, *numbers), data, "one value is needed")
            return data
        if not numbers:
            return []
        if Shape.GROUP in requests:
            return self._list(requests[Shape.GROUP], len(numbers), *lead, len(numbers), _listed(numbers))
        every = self._list(requests[Shape.ALL], self.axes(), *lead)
        return [every[number] for number in numbers]

    def _list(self, request: Request, count: int, *arguments: Value) -> Sequence[Value]:
        rpc = self._link.rpc
        data = rpc.get(request, *arguments)
        inner = data[0] if len(data) == 1 else None
        if not isinstance(inner, Bottle) or len(inner) != count:
            raise rpc.nonsense(request, arguments, data, f"a list of {count} values is needed")
        return inner.elements()

    def _numbers(self, request: Request, lead: tuple[Value, ...], elements: Sequence[Value]) -> Sequence[Any]:
        """Check that elements are numbers. Those that the board has not measured are not finite."""
        if not {*map(type, elements)} <= _NUMBERS and not all(isinstance(element, int | float) for element in elements):
            raise self._link.rpc.nonsense(request, lead, [*elements], "numbers are needed")
        return elements

    def _command(
        self,
        requests: RequestsByShape,
        axes: AxisSelection,
        lead: tuple[Value, ...] = (),
        elements: Sequence[Value] = (),
    ) -> None:
        """Send a command for axes, with an element for each where values are needed."""
        rpc = self._link.rpc
        if axes is None:
            rpc.command(requests[Shape.ALL], *lead, *_together(elements))
            return
        numbers = self.chosen(axes)
        if isinstance(axes, INTEGER) or Shape.GROUP not in requests:
            for place, number in enumerate(numbers):
                rpc.command(requests[Shape.ONE], *lead, number, *elements[place : place + 1])
        elif numbers:
            rpc.command(requests[Shape.GROUP], *lead, len(numbers), _listed(numbers), *_together(elements))

    def _written(self, request: Request, arguments: tuple[Any, ...]) -> list[Value]:
        """Encode the values of a single axis: finite numbers."""
        for argument in arguments:
            self._finite(*(argument if isinstance(argument, tuple) else (argument,)))
        return request.kind.write(arguments[0] if len(arguments) == 1 else arguments)

    # Methods with requests of another form --------------------------------------------------------------------------

    def motor_encoder_count(self) -> int:
        return self.forward_whole(IMotorEncoders.motor_encoder_count)

    def motor_count(self) -> int:
        return self.forward_whole(IMotor.motor_count)

    def pwm(self, motor: int) -> float:
        """Return the duty cycle in the latest state."""
        return float(self.duty_cycles(motor)[0])

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        """Return the gains of all joints, with one request."""
        request, rpc = GETTING["pids"][Shape.NONE], self._link.rpc
        pids: tuple[Pid, ...] = rpc.read(request, Vocab(kind))
        if len(pids) != self.axes():
            raise rpc.nonsense(request, (Vocab(kind),), [str(pids)], f"{self.axes()} are needed")
        return pids

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        """Set the gains of all joints, with one request."""
        if len(pids) != self.axes():
            raise self.refusal(f"{self.axes()} are needed, {len(pids)} were given")
        request = SETTING["set_pids"][Shape.NONE]
        for pid in pids:
            self._finite(*pid)
        self._link.rpc.command(request, Vocab(kind), *request.kind.write(pids))

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """Calibrate an axis. The protocol transmits the type and three parameters."""
        self._calibrate(CALIBRATE, joint, parameters, _CALIBRATE)

    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        """Store calibration parameters. The protocol transmits the type and four of them."""
        self._calibrate(KEEP_CALIBRATION, joint, parameters, _KEEP)

    def _calibrate(self, request: Request, joint: int, parameters: CalibrationParameters, count: int) -> None:
        kind, *numbers = parameters
        self._link.rpc.command(request, *self.chosen(joint), int(kind), *self._finite(*numbers[:count]))

    def calibration_done(self, joint: int) -> bool:
        """Return whether an axis is calibrated; False also for a board that cannot calibrate."""
        axes = self.chosen(joint)
        try:
            self._link.rpc.command(CALIBRATION_DONE, *axes)
        except RefusedError:
            return False
        return True

    def has_calibrator(self) -> bool:
        """Return whether the board has a calibrator; False for a board without this request."""
        try:
            return super().has_calibrator()
        except RefusedError:
            return False

    def variable(self, key: str) -> Bottle:
        request, rpc = GETTING["variable"][Shape.NAMED], self._link.rpc
        data = rpc.get(request, key)
        if len(data) == 1 and isinstance(data[0], Bottle):
            return data[0]
        raise rpc.nonsense(request, (key,), data, "a list is needed")

    def set_variable(self, key: str, value: Bottle) -> None:
        self._link.rpc.command(SETTING["set_variable"][Shape.NAMED], key, *value)

    def variables(self) -> tuple[str, ...]:
        return self.forward_whole(IRemoteVariables.variables)


def _words(of: tuple[object, ...]) -> tuple[Value, ...]:
    """Return the words of the PID types in a request."""
    return tuple(Vocab(kind) for kind in of if isinstance(kind, int))


def _listed(numbers: list[int]) -> Bottle:
    return Bottle.adopt([*numbers])


def _together(elements: Sequence[Value]) -> tuple[Bottle, ...]:
    """Return the values of the axes as one list; nothing if there are no values."""
    return (Bottle.adopt([*elements]),) if elements else ()
