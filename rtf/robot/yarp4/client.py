"""The client of a YARP 4.0 control board: a remote board with the interfaces of a local one.

Measurements come with the state that the board publishes; setpoints at a high rate are streamed without a reply;
everything else is a function of the board's service. For YARP 3 see :mod:`rtf.robot.yarp3.client`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rtf.bottle import Bottle, Dialect, as_string
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.interfaces import IPidControl
from rtf.robot.network.board_stub import SLOW, BoardStub
from rtf.robot.yarp4.functions import Style
from rtf.robot.yarp4.rpc import ServiceRpc
from rtf.robot.yarp4.table import BY_METHOD, BY_NAME

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.forwarded_board import Plural
    from rtf.robot.interfaces import AxisSelection, CalibrationParameters, Pid, PidType, Values
    from rtf.robot.yarp4.functions import Message

R = TypeVar("R")
_PARK_JOINT = BY_NAME["parkSingleJointRPC"]


class ControlBoardServiceClient(BoardStub[ServiceRpc]):
    """``controlBoard_nwc_yarp``: a board of another process.

    The parameters are those of :class:`ClientSettings`, with the default carrier fast_tcp. The behaviour after a lost
    board or a lost client is that of :class:`~rtf.robot.yarp3.client.RemoteControlBoard`.
    """

    carrier = "fast_tcp"

    rpc = ServiceRpc

    @property
    def _board_network(self) -> Network:
        return self.network.in_dialect(Dialect.YARP4)

    # Requests -------------------------------------------------------------------------------------------------------

    def forward_reading(self, method: Plural, axes: AxisSelection, *of: object) -> Sequence[Any]:
        name, rpc, numbers = method.__name__, self._link.rpc, self.chosen(axes)
        if len(numbers) == 1:
            return [rpc.call(_message(method, Style.ONE), *of, numbers[0])]
        some = None if self._are_all(numbers) else BY_METHOD.get((name, Style.SOME))
        if some is not None:
            return self._so_many(rpc.call(some, *of, numbers), len(numbers), method)
        every = self._so_many(rpc.call(_message(method, Style.ALL), *of), self.axes(), method)
        return [every[number] for number in numbers]

    def forward_setting(self, method: Plural, values: Sequence[Any], axes: AxisSelection, *of: object) -> None:
        name, rpc, numbers = method.__name__, self._link.rpc, self.chosen(axes)
        if self._are_all(numbers) and len(numbers) > 1:
            rpc.call(_message(method, Style.ALL), *of, values)
        elif len(numbers) > 1 and (name, Style.SOME) in BY_METHOD:
            rpc.call(_message(method, Style.SOME), *of, numbers, values)
        else:
            for number, value in zip(numbers, values, strict=True):
                rpc.call(_message(method, Style.ONE), *of, number, value)

    def forward_action(self, method: Plural, axes: AxisSelection) -> list[Any]:
        rpc, numbers = self._link.rpc, self.chosen(axes)
        if self._are_all(numbers):
            return [rpc.call(_message(method, Style.ALL))]
        if len(numbers) > 1 and (method.__name__, Style.SOME) in BY_METHOD:
            return [rpc.call(_message(method, Style.SOME), numbers)]
        return [rpc.call(_message(method, Style.ONE), number) for number in numbers]

    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        rpc = self._link.rpc
        if method.__name__ == "park_joint":
            return rpc.call_slowly(_PARK_JOINT, axis, True)  # type: ignore[no-any-return]  # wait until it is done
        ask = rpc.call_slowly if method.__name__ in SLOW else rpc.call
        return ask(_message(method, Style.CALL), *of, axis, *arguments)  # type: ignore[no-any-return]

    def forward_whole(self, method: Callable[..., R]) -> R:
        rpc = self._link.rpc
        ask = rpc.call_slowly if method.__name__ in SLOW else rpc.call
        return ask(_message(method, Style.CALL))  # type: ignore[no-any-return]

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        """Stream a command. Its form depends on the number of axes, not on how they were selected."""
        numbers = self.chosen(axes)
        alone = numbers[0] if len(numbers) == 1 else numbers
        super()._stream(method, values, None if self._are_all(numbers) else alone)

    def _are_all(self, axes: list[int]) -> bool:
        return axes == [*range(self._link.axes)]

    def _so_many(self, values: Sequence[Any], count: int, method: Plural) -> Sequence[Any]:
        """Return the values. Raises NoAnswerError for a wrong number of them."""
        if len(values) != count:
            raise NoAnswerError(
                f"{self._link.settings.remote} gave {len(values)} values of {method.__name__} for {count} axes"
            )
        return values

    # Methods that differ in the service -----------------------------------------------------------------------------

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """Calibrate an axis. Only three parameters are transmitted; others are refused before anything moves."""
        kind, *numbers = parameters
        if any(numbers[3:]):
            raise self.refusal(
                f"boards of YARP 4.0 take three parameters when they calibrate joint "
                f"{joint}; the others are set with set_calibration_parameters"
            )
        self._link.rpc.call(BY_NAME["calibrateAxisWithParamsRPC"], *self.chosen(joint), kind, *numbers[:3])

    def calibration_done(self, joint: int) -> bool:
        try:
            self._link.rpc.call(BY_NAME["calibrationDoneRPC"], *self.chosen(joint))
        except RefusedError:
            return False
        return True

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        """See IPidControl: in one request."""
        return tuple(self._so_many(self._link.rpc.call(BY_NAME["getPidsRPC"], kind), self.axes(), IPidControl.pids))

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        """See IPidControl: likewise."""
        self._link.rpc.call(BY_NAME["setPidsRPC"], kind, [*pids])

    def variable(self, key: str) -> Bottle:
        value: Bottle = self._link.rpc.call(BY_NAME["getRemoteVariableRPC"], key)
        return value

    def set_variable(self, key: str, value: Bottle) -> None:
        self._link.rpc.call(BY_NAME["setRemoteVariableRPC"], key, value)

    def variables(self) -> tuple[str, ...]:
        keys: list[Bottle] = self._link.rpc.call(BY_NAME["getRemoteVariablesListRPC"])
        return tuple(as_string(item) for key in keys for item in key)


def _message(method: Callable[..., Any], style: Style) -> Message:
    """Return the service function of a method. Raises NotSupportedError if the service has none."""
    found = BY_METHOD.get((method.__name__, style))
    if found is None:
        raise NotSupportedError(f"boards of YARP 4.0 have no {method.__qualname__} for {style.value}")
    return found
