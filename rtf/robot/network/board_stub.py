"""Base class of the control board clients of both protocols.

They are opened and closed in the same way, measurements come with the state, and setpoints at a high rate are streamed.
Axes and values are checked here, because a board does not answer streamed commands and may accept anything. Each client
implements all other requests.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar, Generic

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, Value
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.extended_state import Field
from rtf.robot.forwarded_board import ForwardedBoard
from rtf.robot.interfaces import IRemoteVariables, values_for
from rtf.robot.network.board_link import ControlBoardLink, Rpc
from rtf.robot.network.client_settings import ClientSettings
from rtf.robot.network.state_reader import chosen
from rtf.robot.network.streamed_commands import HEADS, Axes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType
    from typing import Self

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values
    from rtf.robot.network.state_reader import Observer

#: Methods whose reply comes when the action is done, which takes long.
SLOW = frozenset({"calibrate_joint", "calibrate_part", "home_joint", "home_part", "park_joint", "park_part"})
#: The types of the number of an axis.
INTEGER = (int, np.integer)
_CONTROL_MODES: Mapping[int, ControlMode] = {int(mode): mode for mode in ControlMode}
_INTERACTION_MODES: Mapping[int, InteractionMode] = {int(mode): mode for mode in InteractionMode}


class BoardStub(Device, ForwardedBoard, IRemoteVariables, Generic[Rpc]):
    """A board at the other end of a link. Its methods raise DeviceError while it is not open."""

    #: The default carrier of the state and the streamed commands.
    carrier: ClassVar[str] = "udp"
    _opened: ControlBoardLink[Rpc] | None = None

    #: The connection by which requests are sent; a subclass may refuse some of them.
    rpc: ClassVar[type[Any]]

    @property
    def _board_network(self) -> Network:
        """The network of the client's ports."""
        return self.network

    def _connect(self, settings: ClientSettings) -> ControlBoardLink[Rpc]:
        return ControlBoardLink(settings, self._board_network, self.rpc)

    @property
    def _link(self) -> ControlBoardLink[Rpc]:
        if self._opened is None:
            raise DeviceError(f"{self.name} is not open")
        return self._opened

    def open(self, configuration: Property) -> None:
        """Open the client. By the machine's clock, wait for the first state, at most for the timeout."""
        settings = ClientSettings.read(configuration, self.carrier)
        self.close()
        self._opened = self._connect(settings)
        if type(clock.current()) is clock.SystemClock:  # a simulated time may stand still meanwhile
            self._opened.state.wait_for_first()

    def close(self) -> None:
        opened, self._opened = self._opened, None
        if opened is not None:
            opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def observe(self, observer: Observer) -> None:
        """Call a function with every state, until ``unobserve``, ``close``, or an error in it."""
        self._link.state.observe(observer)

    def unobserve(self, observer: Observer) -> None:
        """Stop calling a function."""
        self._link.state.unobserve(observer)

    # Axes and values ---------------------------------------------------------------------------------------------

    def axes(self) -> int:
        """Return the number of axes that the board had when it was opened."""
        return self._link.axes

    def refusal(self, why: str) -> RefusedError:
        """Return the error for invalid arguments."""
        return RefusedError(f"{self._link.settings.remote}: {why}")

    def chosen(self, axes: AxisSelection) -> list[int]:
        """Return the numbers of the selected axes. Raises RefusedError for one that the board does not have."""
        link = self._opened or self._link
        if type(axes) is int and 0 <= axes < link.axes:  # the usual case
            return [axes]
        return chosen(link.settings.remote, link.axes, axes)

    def checked(self, values: Values, count: int) -> FloatArray:
        """Return the values as an array of ``count`` finite numbers. Raises RefusedError for others."""
        try:
            return values_for(count, values)
        except RefusedError as error:
            raise self.refusal(str(error)) from None

    def _finite(self, *numbers: float) -> list[Value]:
        """Return numbers as they are sent. Raises RefusedError unless all are finite."""
        for number in numbers:
            if not math.isfinite(number):
                raise self.refusal(f"{number} is not a finite number")
        return [float(number) for number in numbers]

    # Measurements: no helper functions, as they are read often ------------------------------------------------------

    def encoders_together(self) -> tuple[FloatArray, FloatArray]:
        """Return the positions of all joints and of all motors (deg), from the same state."""
        joints, motors = self._link.state.together(Field.JOINT_POSITIONS, Field.MOTOR_POSITIONS)
        return joints, motors

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.JOINT_POSITIONS, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.JOINT_VELOCITIES, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.JOINT_ACCELERATIONS, joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """Return the times of the positions; a message has one time for all joints."""
        return self._link.state.times(joints)

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.MOTOR_POSITIONS, motors)

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.MOTOR_VELOCITIES, motors)

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.MOTOR_ACCELERATIONS, motors)

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.TORQUES, joints)

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """Return the measured currents, for both ICurrentControl and IAmplifierControl."""
        return self._link.state.read(Field.CURRENTS, motors)

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """Return the duty cycles. YARP 4 transmits them in single precision."""
        return self._link.state.read(Field.DUTY_CYCLES, motors)

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        """Return the control modes. An unknown number is UNKNOWN.

        A mode that was set is visible in the next state, after the board's period and the transmission.
        """
        numbers = self._link.state.read(Field.CONTROL_MODES, joints).tolist()
        return tuple([_CONTROL_MODES.get(number, ControlMode.UNKNOWN) for number in numbers])

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """Return the interaction modes; an unknown number is UNKNOWN."""
        numbers = self._link.state.read(Field.INTERACTION_MODES, joints).tolist()
        return tuple([_INTERACTION_MODES.get(number, InteractionMode.UNKNOWN) for number in numbers])

    # Streamed commands, which are not answered because of their rate -------------------------------------------------

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """Stream velocities. The board does not answer, here and below."""
        self._stream("velocity_move", velocities, joints)

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        self._stream("set_positions", positions, joints)

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        self._stream("set_reference_torques", torques, joints)

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        self._stream("set_reference_currents", currents, motors)

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """Stream duty cycles. There is no command for several motors: each gets one."""
        self._stream("set_reference_duty_cycles", duties, motors)

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        """Stream a command. One for a single axis waits for the previous one."""
        heads, stream = HEADS[method], self._link.stream
        if axes is None:
            stream.send([*heads[Axes.ALL]], self.checked(values, self._link.axes), strict=False)
            return
        numbers = self.chosen(axes)
        given = self.checked(values, len(numbers))
        if isinstance(axes, INTEGER):
            stream.send([*heads[Axes.ONE], *numbers], given, strict=True)
        elif Axes.GROUP not in heads:
            for place, number in enumerate(numbers):
                stream.send([*heads[Axes.ONE], number], given[place : place + 1], strict=True)
        elif numbers:
            stream.send([*heads[Axes.GROUP], len(numbers), Bottle.adopt([*numbers])], given, strict=False)
