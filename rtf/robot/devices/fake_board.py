"""A control board without hardware: its joints follow commands by kinematics alone, in the robot's time.

It obeys the rules of a board (control modes, limits, ignored commands), so that clients of boards can be tested on it.
Not modelled: masses, forces, friction, controllers, delays, expiry of commands. The positions are the setpoints;
torques, currents and duty cycles are the commanded ones, and move nothing.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, as_string
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.board_configuration import configured_axes
from rtf.robot.devices.board_driver import BoardDriver
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.errors import NotSupportedError
from rtf.robot.extended_state import Field

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.devices.board_driver import Setpoints
    from rtf.robot.extended_state import ExtendedState

_AXIS = BoardAxis(name="joint", minimum=0.0, maximum=100.0, gearbox=100.0, max_current=10.0)
_TEMPERATURE = 25.0


class FakeDriver(BoardDriver):
    """Joints that are where their setpoints are, at the time of each look. ``now``: their time, if not the robot's."""

    period = None
    measures = frozenset(Field) - {Field.MOTOR_POSITIONS, Field.MOTOR_VELOCITIES, Field.MOTOR_ACCELERATIONS}
    watchdog = math.inf
    stopping = 0.0
    calibration_time = (0.0, 0.0)

    def __init__(self, now: Callable[[], float] | None = None) -> None:
        self._now = now

    def connect(self, configuration: Property) -> list[BoardAxis]:
        return configured_axes(configuration, _AXIS)

    def disconnect(self) -> None:
        """Do nothing: there is no hardware."""

    def time(self) -> float:
        return super().time() if self._now is None else self._now()

    def read(self, state: ExtendedState) -> None:
        board = self.board
        state.floats[:3] = board.trajectories.at(board.tick, slice(None))
        state.joint_positions -= board.encoder_offsets
        for mode, values, commands in (
            (ControlMode.TORQUE, state.torques, board.torques),
            (ControlMode.CURRENT, state.currents, board.currents),
            (ControlMode.PWM, state.duty_cycles, board.duties),
        ):
            values[:] = np.where(board.mode == mode, commands, 0.0)
        state.temperatures[:] = _TEMPERATURE

    def write(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> None:
        """Do nothing: ``read`` shows the setpoints."""

    def configure(self, axis: int) -> None:
        """Do nothing: there are no controllers."""


class FakeBoard(ControlBoard):
    """``fakeMotionControl``: it starts at 0 deg, in position mode, stiff.

    Configuration groups: those of :mod:`rtf.robot.devices.board_configuration`, and ``VARIABLES`` with remote variables
    by name.
    """

    driver_class = FakeDriver

    def __init__(self, name: str = "", *, driver: BoardDriver | None = None, network: Network | None = None) -> None:
        super().__init__(name, driver=driver, network=network)
        self._configured: dict[str, Bottle] = {}

    def open(self, configuration: Property) -> None:
        super().open(configuration)
        variables = configuration.find_group("VARIABLES") or ()
        self._configured = {as_string(one[0]): one.tail() for one in variables if isinstance(one, Bottle) and len(one)}

    def _variables(self) -> dict[str, Bottle]:
        return self._configured

    def variables(self) -> tuple[str, ...]:
        if not self._configured:
            raise NotSupportedError(f"{self.name} has no variables; its group VARIABLES may give it some")
        return super().variables()

    def set_variable(self, key: str, value: Bottle) -> None:
        self.variable(key)
        self._configured[key] = value
