"""The client of a control board of YARP 4.0: a board that stands elsewhere, as if it stood here.

What is measured comes with the state that the board publishes; references at a high rate are streamed and not answered;
everything else is a function of the board's service. For YARP 3 see :mod:`rtf.robot.client.control_board`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rtf import clock
from rtf.bottle import Bottle, as_string
from rtf.robot.client.service_rpc import ServiceLink
from rtf.robot.client.settings import ClientSettings
from rtf.robot.client.stub import BoardStub
from rtf.robot.control_board_messages import BY_METHOD, BY_NAME, in_its_dialect
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.extended_state import Field
from rtf.robot.forwarding import ForwardedBoard
from rtf.robot.interfaces import IPidControl, IRemoteVariables
from rtf.robot.service_rows import Style

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Property
    from rtf.robot.forwarding import Plural
    from rtf.robot.interfaces import AxisSelection, CalibrationParameters, FloatArray, Pid, PidType
    from rtf.robot.service_rows import Message

R = TypeVar("R")
#: What is streamed: it comes so often that nobody could wait for the answers.
_STREAMED = frozenset(
    {
        "velocity_move",
        "set_positions",
        "set_reference_torques",
        "set_reference_currents",
        "set_reference_duty_cycles",
    }
)
#: What is answered when it is done, which takes its time.
_SLOW = frozenset({"calibrate_joint", "calibrate_part", "home_joint", "home_part", "park_joint", "park_part"})
_PARK_JOINT = BY_NAME["parkSingleJointRPC"]


class ControlBoardServiceClient(BoardStub, ForwardedBoard, IRemoteVariables):
    """``controlBoard_nwc_yarp``: a board of another process.

    The parameters are those of :class:`ClientSettings`, but the carrier is fast_tcp if none is given. What becomes of
    a board that is lost, and of joints whose client is gone, is told at
    :class:`~rtf.robot.client.control_board.RemoteControlBoard`.
    """

    _opened: ServiceLink | None = None

    @property
    def _link(self) -> ServiceLink:
        link = super()._link
        assert isinstance(link, ServiceLink)
        return link

    def open(self, configuration: Property) -> None:
        """See Device. By the machine's clock it returns with the first state, if that comes within the time-out."""
        given = configuration.copy()
        if not given.check("carrier"):
            given.put("carrier", "fast_tcp")
        settings = ClientSettings.read(given)
        self.close()
        self._opened = ServiceLink(settings, in_its_dialect(self.network))
        if type(clock.current()) is clock.SystemClock:  # by others time may stand still meanwhile
            self._opened.state.wait_for_first()

    def close(self) -> None:
        """See Device."""
        opened, self._opened = self._opened, None
        if opened is not None:
            opened.close()

    def axes(self) -> int:
        """As the board said when it was opened."""
        return self._link.axes

    # What is measured: flat, as it is asked for all the time --------------------------------------------------------

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._link.state.read(Field.JOINT_POSITIONS, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._link.state.read(Field.JOINT_VELOCITIES, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders."""
        return self._link.state.read(Field.JOINT_ACCELERATIONS, joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders; the message has one time for all."""
        return self._link.state.times(joints)

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._link.state.read(Field.MOTOR_POSITIONS, motors)

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._link.state.read(Field.MOTOR_VELOCITIES, motors)

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        """See IMotorEncoders."""
        return self._link.state.read(Field.MOTOR_ACCELERATIONS, motors)

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        """See ITorqueControl."""
        return self._link.state.read(Field.TORQUES, joints)

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """See ICurrentControl."""
        return self._link.state.read(Field.CURRENTS, motors)

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl. They travel in single precision."""
        return self._link.state.read(Field.DUTY_CYCLES, motors)

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        """See IControlMode. What is no mode is UNKNOWN."""
        numbers = self._link.state.read(Field.CONTROL_MODES, joints).tolist()
        return tuple(_MODES.get(number, ControlMode.UNKNOWN) for number in numbers)

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """See IInteractionMode; likewise."""
        numbers = self._link.state.read(Field.INTERACTION_MODES, joints).tolist()
        return tuple(_INTERACTIONS.get(number, InteractionMode.UNKNOWN) for number in numbers)

    # What is asked and told -----------------------------------------------------------------------------------------

    def forward_reading(self, method: Plural, axes: list[int], *of: object) -> Sequence[Any]:
        """See ForwardedBoard."""
        name, rpc = method.__name__, self._link.rpc
        if len(axes) == 1:
            return [rpc.call(_message(method, Style.ONE), *of, axes[0])]
        some = None if self._are_all(axes) else BY_METHOD.get((name, Style.SOME))
        if some is not None:
            return self._so_many(rpc.call(some, *of, axes), len(axes), method)
        every = self._so_many(rpc.call(_message(method, Style.ALL), *of), self.axes(), method)
        return [every[axis] for axis in axes]

    def forward_setting(self, method: Plural, values: Sequence[Any], axes: list[int], *of: object) -> None:
        """See ForwardedBoard."""
        name, rpc = method.__name__, self._link.rpc
        if name in _STREAMED:
            self._stream(name, [*values], None if self._are_all(axes) else axes[0] if len(axes) == 1 else axes)
        elif self._are_all(axes) and len(axes) > 1:
            rpc.call(_message(method, Style.ALL), *of, values)
        elif len(axes) > 1 and (name, Style.SOME) in BY_METHOD:
            rpc.call(_message(method, Style.SOME), *of, axes, values)
        else:
            for axis, value in zip(axes, values, strict=True):
                rpc.call(_message(method, Style.ONE), *of, axis, value)

    def forward_action(self, method: Plural, axes: list[int]) -> list[Any]:
        """See ForwardedBoard."""
        rpc = self._link.rpc
        if self._are_all(axes):
            return [rpc.call(_message(method, Style.ALL))]
        if len(axes) > 1 and (method.__name__, Style.SOME) in BY_METHOD:
            return [rpc.call(_message(method, Style.SOME), axes)]
        return [rpc.call(_message(method, Style.ONE), axis) for axis in axes]

    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        """See ForwardedBoard."""
        rpc = self._link.rpc
        if method.__name__ == "park_joint":
            return rpc.call_slowly(_PARK_JOINT, axis, True)  # type: ignore[no-any-return]  # wait until it is done
        ask = rpc.call_slowly if method.__name__ in _SLOW else rpc.call
        return ask(_message(method, Style.CALL), *of, axis, *arguments)  # type: ignore[no-any-return]

    def forward_whole(self, method: Callable[..., R], *arguments: object) -> R:
        """See ForwardedBoard."""
        rpc = self._link.rpc
        ask = rpc.call_slowly if method.__name__ in _SLOW else rpc.call
        return ask(_message(method, Style.CALL), *arguments)  # type: ignore[no-any-return]

    def _are_all(self, axes: list[int]) -> bool:
        return axes == [*range(self._link.axes)]

    def _so_many(self, values: Sequence[Any], count: int, method: Plural) -> Sequence[Any]:
        """The values, if there are as many as there must be."""
        if len(values) != count:
            raise NoAnswerError(
                f"{self._link.settings.remote} gave {len(values)} values of {method.__name__} for {count} axes"
            )
        return values

    # What is different in the service -------------------------------------------------------------------------------

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """See IControlCalibration. Only three parameters travel: with others it is refused, before anything moves."""
        kind, *numbers = parameters
        if any(numbers[3:]):
            raise RefusedError(
                f"{self._link.settings.remote}: boards of YARP 4.0 take three parameters when they calibrate joint "
                f"{joint}; the others are set with set_calibration_parameters"
            )
        self._link.rpc.call(BY_NAME["calibrateAxisWithParamsRPC"], self._axis(joint), kind, *numbers[:3])

    def calibration_done(self, joint: int) -> bool:
        """See IControlCalibration."""
        try:
            self._link.rpc.call(BY_NAME["calibrationDoneRPC"], self._axis(joint))
        except RefusedError:
            return False
        return True

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        """See IPidControl: in one question."""
        return tuple(self._so_many(self._link.rpc.call(BY_NAME["getPidsRPC"], kind), self.axes(), IPidControl.pids))

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        """See IPidControl: likewise."""
        self._link.rpc.call(BY_NAME["setPidsRPC"], kind, [*pids])

    def variable(self, key: str) -> Bottle:
        """See IRemoteVariables."""
        value: Bottle = self._link.rpc.call(BY_NAME["getRemoteVariableRPC"], key)
        return value

    def set_variable(self, key: str, value: Bottle) -> None:
        """See IRemoteVariables."""
        self._link.rpc.call(BY_NAME["setRemoteVariableRPC"], key, value)

    def variables(self) -> tuple[str, ...]:
        """See IRemoteVariables."""
        keys: list[Bottle] = self._link.rpc.call(BY_NAME["getRemoteVariablesListRPC"])
        return tuple(as_string(item) for key in keys for item in key)


def _message(method: Callable[..., Any], style: Style) -> Message:
    """The function that a method is. Raises NotSupportedError when the service has none."""
    found = BY_METHOD.get((method.__name__, style))
    if found is None:
        raise NotSupportedError(f"boards of YARP 4.0 cannot be asked for {method.__qualname__} of {style.value}")
    return found


_MODES = {mode.value: mode for mode in ControlMode}
_INTERACTIONS = {mode.value: mode for mode in InteractionMode}
