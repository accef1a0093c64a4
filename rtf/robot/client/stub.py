"""What the clients of control boards of both protocols have in common.

They are opened and closed in the same way, what is measured comes with the state, and references that come at a high
rate are streamed. Axes are checked here, and so are values, because a board does not answer what is streamed, and may
take anything. How everything else is asked for, each client says itself.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Generic

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, Value
from rtf.robot.client.link import ControlBoardLink, Rpc
from rtf.robot.client.questions import HEADS
from rtf.robot.client.settings import ClientSettings
from rtf.robot.client.state import chosen
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import values_for
from rtf.robot.vocabulary import Shape

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType
    from typing import Self

    from rtf.bottle import Property
    from rtf.robot.client.state import Observer
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

#: The methods that are answered when they are done, which takes its time.
SLOW = frozenset({"calibrate_joint", "calibrate_part", "home_joint", "home_part", "park_joint", "park_part"})
#: The types of the number of one axis.
INTEGER = (int, np.integer)
_CONTROL_MODES: Mapping[int, ControlMode] = {int(mode): mode for mode in ControlMode}
_INTERACTION_MODES: Mapping[int, InteractionMode] = {int(mode): mode for mode in InteractionMode}


class BoardStub(Device, Generic[Rpc]):
    """A board that is at the other end of a link. Its methods raise DeviceError while it is not open."""

    #: By what the state and the streamed commands travel if nothing is said.
    carrier: ClassVar[str] = "udp"
    _opened: ControlBoardLink[Rpc] | None = None

    @abstractmethod
    def _connect(self, settings: ClientSettings) -> ControlBoardLink[Rpc]:
        """The connections with the board. Raises DeviceError."""

    @property
    def _link(self) -> ControlBoardLink[Rpc]:
        if self._opened is None:
            raise DeviceError(f"{self.name} is not open")
        return self._opened

    def open(self, configuration: Property) -> None:
        """See Device. By the machine's clock it returns with the first state, if that comes within the time-out."""
        settings = ClientSettings.read(configuration, self.carrier)
        self.close()
        self._opened = self._connect(settings)
        if type(clock.current()) is clock.SystemClock:  # by others time may stand still meanwhile
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
        """Have every state given to a function as it comes. Until ``unobserve``, until it is closed, or it raises."""
        self._link.state.observe(observer)

    def unobserve(self, observer: Observer) -> None:
        """Give it no more."""
        self._link.state.unobserve(observer)

    # Axes and values ---------------------------------------------------------------------------------------------

    def axes(self) -> int:
        """As the board said when it was opened."""
        return self._link.axes

    def refusal(self, why: str) -> RefusedError:
        """What to raise for arguments that make no sense."""
        return RefusedError(f"{self._link.settings.remote}: {why}")

    def chosen(self, axes: AxisSelection) -> list[int]:
        """The numbers of axes. Raises RefusedError for one that the board does not have."""
        link = self._opened or self._link
        if type(axes) is int and 0 <= axes < link.axes:  # as nearly always
            return [axes]
        return chosen(link.settings.remote, link.axes, axes)

    def checked(self, values: Values, count: int) -> FloatArray:
        """So many finite numbers. Raises RefusedError for others."""
        try:
            return values_for(count, values)
        except RefusedError as error:
            raise self.refusal(str(error)) from None

    def _finite(self, *numbers: float) -> list[Value]:
        """Numbers as they are sent. Raises RefusedError for what is none."""
        for number in numbers:
            if not math.isfinite(number):
                raise self.refusal(f"{number} is no finite number")
        return [float(number) for number in numbers]

    # What is measured: flat, as it is asked for all the time --------------------------------------------------------

    def encoders_together(self) -> tuple[FloatArray, FloatArray]:
        """Where all joints and all motors are (deg), of the same moment: two readings may be of two states."""
        joints, motors = self._link.state.together(Field.JOINT_POSITIONS, Field.MOTOR_POSITIONS)
        return joints, motors

    def encoders(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.JOINT_POSITIONS, joints)

    def encoder_speeds(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.JOINT_VELOCITIES, joints)

    def encoder_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        return self._link.state.read(Field.JOINT_ACCELERATIONS, joints)

    def encoder_times(self, joints: AxisSelection = None) -> FloatArray:
        """See IEncoders; the message has one time for all."""
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
        """See ICurrentControl and IAmplifierControl, for which they are the same."""
        return self._link.state.read(Field.CURRENTS, motors)

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl. They travel in single precision."""
        return self._link.state.read(Field.DUTY_CYCLES, motors)

    def control_modes(self, joints: AxisSelection = None) -> tuple[ControlMode, ...]:
        """See IControlMode. A number that is no mode is UNKNOWN.

        What was set shows when the next state has come, which takes the board's period and its way.
        """
        numbers = self._link.state.read(Field.CONTROL_MODES, joints).tolist()
        return tuple([_CONTROL_MODES.get(number, ControlMode.UNKNOWN) for number in numbers])

    def interaction_modes(self, joints: AxisSelection = None) -> tuple[InteractionMode, ...]:
        """See IInteractionMode; likewise."""
        numbers = self._link.state.read(Field.INTERACTION_MODES, joints).tolist()
        return tuple([_INTERACTION_MODES.get(number, InteractionMode.UNKNOWN) for number in numbers])

    # What is streamed: it comes so often that nobody could wait for answers ------------------------------------------

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """See IVelocityControl. The board does not answer, here and below."""
        self._stream("velocity_move", velocities, joints)

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        self._stream("set_positions", positions, joints)

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        self._stream("set_reference_torques", torques, joints)

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        self._stream("set_reference_currents", currents, motors)

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """See IPWMControl. There is no command for several: they get one each."""
        self._stream("set_reference_duty_cycles", duties, motors)

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        """Stream a command. One for a single axis waits for the one before."""
        heads, stream = HEADS[method], self._link.stream
        if axes is None:
            stream.send([*heads[Shape.ALL]], self.checked(values, self._link.axes), strict=False)
            return
        numbers = self.chosen(axes)
        given = self.checked(values, len(numbers))
        if isinstance(axes, INTEGER):
            stream.send([*heads[Shape.ONE], *numbers], given, strict=True)
        elif Shape.GROUP not in heads:
            for place, number in enumerate(numbers):
                stream.send([*heads[Shape.ONE], number], given[place : place + 1], strict=True)
        elif numbers:
            stream.send([*heads[Shape.GROUP], len(numbers), Bottle.adopt([*numbers])], given, strict=False)
