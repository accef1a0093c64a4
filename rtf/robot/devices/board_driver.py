"""The base class of drivers of motor boards: three methods of the hardware, and what it can do.

The rules of a board are not the driver's: see :mod:`rtf.robot.devices.motor_board`.
"""

from __future__ import annotations

from abc import abstractmethod
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar

from rtf import clock
from rtf.robot.control_modes import REQUESTS, ControlMode
from rtf.robot.device import DeviceProvider
from rtf.robot.devices.board_axes import BoardAxes
from rtf.robot.extended_state import Field

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import AbstractContextManager

    import numpy as np
    from numpy.typing import NDArray

    from rtf.bottle import Bottle, Property
    from rtf.robot.device import Device
    from rtf.robot.devices.board_axes import BoardAxis
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray


class Setpoints:
    """The present setpoints, an array for each quantity. The mode of an axis says which of them counts."""

    def __init__(self, board: BoardAxes) -> None:
        self._board = board

    @property
    def positions(self) -> FloatArray:
        """Of the trajectories or direct positions, as the encoders count (deg)."""
        board = self._board
        return board.trajectories.at(board.tick, slice(None))[0] - board.encoder_offsets

    @property
    def velocities(self) -> FloatArray:
        """The speeds of these positions (deg/s)."""
        return self._board.trajectories.at(self._board.tick, slice(None))[1]

    @property
    def torques(self) -> FloatArray:
        """Torques of joints (Nm); 0 once the command has expired."""
        return self._board.unexpired(self._board.torques)

    @property
    def currents(self) -> FloatArray:
        """Currents of motors (A), likewise."""
        return self._board.unexpired(self._board.currents)

    @property
    def duty_cycles(self) -> FloatArray:
        """Duty cycles of motors (per cent), likewise."""
        return self._board.unexpired(self._board.duties)


class DrivenBoard(BoardAxes):
    """A board as its driver sees it: modes, settings and limits of all axes, and the report of a fault."""

    @abstractmethod
    def fault(self, axis: int, code: int, message: str) -> None:
        """Put an axis into hardware fault; only a forced idle ends it."""

    @abstractmethod
    def end_calibration(self, axis: int) -> None:
        """End the calibration of an axis before its time is over, as its hardware has finished it."""

    @abstractmethod
    def restart(self) -> None:
        """Start again with the configuration, as the hardware was reset on purpose: nothing of before is left."""


class BoardDriver(DeviceProvider):
    """A driver of a board. As a device type, it is a control board over the driver.

    The methods are called by one thread at a time, with the lock of the board held. ``board`` has the modes, settings
    and limits of all axes, as arrays; it is there from ``configure`` on. ``connect`` may change the constants, for
    boards that differ.
    """

    #: Seconds between two cycles of reading and writing, in a thread; None: one whenever the board is used.
    period: float | None = 0.01
    #: For how long a state counts when no cycle follows, s, and for ten periods; ``connect`` may set it.
    max_age: float = 0.1
    #: The fields that ``read`` fills in. Values of motors that it does not measure follow from the joints.
    measures: frozenset[Field] = frozenset({Field.JOINT_POSITIONS, Field.JOINT_VELOCITIES, Field.JOINT_ACCELERATIONS})
    #: The modes that a user may request; others are refused.
    supported: frozenset[ControlMode] = frozenset(REQUESTS)
    #: Seconds until a command expires, and of a calibration with the pause after it.
    watchdog: ClassVar[float] = 0.5
    calibration_time: tuple[float, float] = (0.5, 0.01)
    #: Deceleration of a stop, deg/s²; 0: at once.
    stopping: ClassVar[float] = 1000.0
    #: Motors = couplings @ joints, before the gearbox; ``connect`` may set it. None: each joint has a motor of its own.
    couplings: FloatArray | None = None
    #: What the loop that calls the cycles holds, and ``write`` and ``configure`` take; it is that of the board then.
    lock: AbstractContextManager[object] | None = None
    board: DrivenBoard
    #: Called with a sentence about a problem that is no fault of an axis; there from ``connect`` on.
    report: Callable[[str], None]

    @classmethod
    def device_type(cls) -> type[Device]:
        """Return the control board over this driver."""
        # By its name, as devices are loaded: a board knows its driver, not the driver a board.
        made: type[Device] = import_module("rtf.robot.devices.control_board").ControlBoard.over(cls)
        return made

    @abstractmethod
    def connect(self, configuration: Property) -> Sequence[BoardAxis]:
        """Connect to the hardware and return its axes.

        Raises ConfigurationError for invalid parameters, DeviceError if there is no hardware. After an error nothing is
        connected.
        """

    @abstractmethod
    def disconnect(self) -> None:
        """Switch the motors off and disconnect; allowed in any state, and repeatedly."""

    @abstractmethod
    def read(self, state: ExtendedState) -> None:
        """Fill in the measurements named by ``measures``, and call ``board.fault`` for axes that report one.

        Raises DeviceError if the hardware does not answer: the state is stale then, and the next period tries again.
        """

    @abstractmethod
    def write(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> None:
        """Send the setpoint of each axis that its control mode asks for; none in the modes without power.

        Called once a period; without a period after every change of an effort or a mode. Raises the errors of ``read``.
        """

    @abstractmethod
    def configure(self, axis: int) -> None:
        """Apply the mode and the settings of an axis: one of them has changed. Raises the errors of ``read``."""

    def time(self) -> float:
        """Return the present time, in seconds of the robot's clock."""
        return clock.current().now()

    def stamp(self, now: float) -> float:
        """Return when the latest measurements were made (s); ``now`` is when they were read."""
        return now

    def variables(self) -> dict[str, Bottle]:
        """Return remote variables of the hardware, beside those of all boards. May be called from any thread."""
        return {}

    def reset_controller(self, axis: int) -> None:
        """Reset the integral of the position controller of an axis; for hardware that can."""
