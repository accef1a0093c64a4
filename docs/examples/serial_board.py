"""A driver for a board with two motors at a serial line. A device type of its own: ``twoMotorBoard``.

The board answers each line with a line, except setpoints, which it does not answer::

    I                             TWO-MOTOR-BOARD 1.0
    C <motor> <ampere> <percent>  OK             the greatest current and duty cycle of a motor
    R                             <deg> <deg/s> <ampere> <percent> <celsius> <fault> of both motors
    S <mode> <value> <mode> <value>              O 0: off, P: position, C: current, D: duty cycle

It switches a motor off when it has a fault, until the setpoint O.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import serial  # pip install 'rtf[serial]'

from rtf.bottle import as_string
from rtf.robot.control_modes import HOLDING_MODES, ControlMode
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.board_configuration import configured_axes
from rtf.robot.devices.board_driver import BoardDriver, Setpoints
from rtf.robot.errors import DeviceError
from rtf.robot.extended_state import ExtendedState, Field
from rtf.robot.parameters import positive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.bottle import Property

MOTORS, NUMBERS = 2, 6
#: The torque of a joint, Nm an ampere.
TORQUE = 0.5
FIRST_FAULT = 10
AXIS = BoardAxis(
    name="motor",
    minimum=-30.0,
    maximum=30.0,
    max_velocity=90.0,
    max_torque=5.0,
    gearbox=100.0,
    peak_current=10.0,
    max_current=12.0,
    torque_controlled=False,
)


class TwoMotorBoard(BoardDriver):
    """The board at the serial line ``port``, such as ``/dev/ttyUSB0``, which answers within ``patience`` s (0.1)."""

    plugin_name = "twoMotorBoard"
    period = 0.02
    measures = frozenset(
        {
            Field.JOINT_POSITIONS,
            Field.JOINT_VELOCITIES,
            Field.CURRENTS,
            Field.DUTY_CYCLES,
            Field.TORQUES,
            Field.TEMPERATURES,
        }
    )
    _line: serial.Serial | None = None

    def connect(self, configuration: Property) -> list[BoardAxis]:
        """Open the line and check that this board is at its other end."""
        axes = configured_axes(configuration, AXIS, MOTORS)
        port = as_string(configuration.find("port"))
        self._patience = positive(configuration, "patience", 0.1)
        try:
            self._line = serial.Serial(
                port, 115200, timeout=self._patience, write_timeout=self._patience, exclusive=True
            )
            version = self._ask("I")
        except (serial.SerialException, DeviceError) as error:
            self.disconnect()
            raise DeviceError(f"there is no board at the serial line {port!r}: {error}") from error
        if not version.startswith("TWO-MOTOR-BOARD "):
            self.disconnect()
            raise DeviceError(f"at {port} is not a board with two motors: it calls itself {version!r}")
        self._configured: dict[int, str] = {}
        return axes

    def disconnect(self) -> None:
        """Switch the motors off."""
        if self._line is not None:
            with suppress(serial.SerialException):  # a board that is gone cannot be switched off
                self._line.write(b"S O 0 O 0\n")
            self._line.close()
            self._line = None

    def read(self, state: ExtendedState) -> None:
        """Ask for the measurements."""
        answer = self._ask("R")
        try:
            numbers = np.array(answer.split(), dtype=np.float64).reshape(MOTORS, NUMBERS).T
        except ValueError as error:
            raise DeviceError(f"the board answered 'R' by {answer!r}") from error
        state.joint_positions[:], state.joint_velocities[:], state.currents[:], state.duty_cycles[:] = numbers[:4]
        state.torques[:] = TORQUE * state.currents
        state.temperatures[:], faults = numbers[4:]
        for axis in np.flatnonzero(faults).tolist():
            if self.board.mode[axis] != ControlMode.HARDWARE_FAULT:
                self.board.fault(axis, FIRST_FAULT + int(faults[axis]), f"the board reports the fault {faults[axis]:g}")

    def write(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> None:
        """Send the setpoint of each motor."""
        words = [self._setpoint(setpoints, ControlMode(mode), axis) for axis, mode in enumerate(modes.tolist())]
        self._send(f"S {' '.join(words)}")

    def _setpoint(self, setpoints: Setpoints, mode: ControlMode, axis: int) -> str:
        if mode in HOLDING_MODES:
            return f"P {setpoints.positions[axis]:.4f}"
        if mode is ControlMode.TORQUE:
            return f"C {setpoints.torques[axis] / TORQUE:.4f}"
        if mode is ControlMode.CURRENT:
            return f"C {setpoints.currents[axis]:.4f}"
        if mode is ControlMode.PWM:
            return f"D {setpoints.duty_cycles[axis]:.4f}"
        return "O 0"

    def configure(self, axis: int) -> None:
        """Send the limits of a motor, if they have changed."""
        line = f"C {axis} {self.board.max_current[axis]:g} {self.board.duty_limit[axis]:g}"
        if self._configured.get(axis) != line:
            self._ask(line)
            self._configured[axis] = line

    def _ask(self, line: str) -> str:
        """Send a line and return the answer."""
        if self._line is not None:
            self._line.reset_input_buffer()  # what arrived too late
        self._send(line)
        answer = b"" if self._line is None else self._line.readline()
        if not answer.endswith(b"\n"):
            raise DeviceError(f"the board does not answer {line!r} within {self._patience:g} s")
        return answer.decode("ascii", "replace").strip()

    def _send(self, line: str) -> None:
        if self._line is None:
            raise DeviceError("the serial line is closed")
        try:
            self._line.write(f"{line}\n".encode())
        except serial.SerialException as error:
            raise DeviceError(f"the serial line is broken: {error}") from error
