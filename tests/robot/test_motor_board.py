"""The rules of ControlBoard, with a driver whose hardware is a few registers."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.robot.control_modes import HOLDING_MODES, ControlMode
from rtf.robot.device import find_device
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.board_driver import BoardDriver, Setpoints
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.devices.motor_board import ERROR_LIMIT, OVERHEATED
from rtf.robot.errors import DeviceError, NotSupportedError, RefusedError
from rtf.robot.extended_state import ExtendedState, Field
from rtf.robot.interfaces import JointType, PidType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .sensor_bench import ManualClock

_KIND = "registers"
_LAB = '''
from tests.robot.test_motor_board import Registers


class LabBoard(Registers):
    """Of an installed package."""
'''


class Registers(BoardDriver):
    """Two coupled motors, a rotation and a slide, that are at their setpoints at the next reading."""

    measures = frozenset({Field.JOINT_POSITIONS, Field.TEMPERATURES})
    supported = frozenset({ControlMode.POSITION, ControlMode.IDLE, ControlMode.FORCE_IDLE})
    couplings = np.array([[1.0, 0.0], [-1.0, 2.0]])

    def __init__(self) -> None:
        self.positions, self.temperature, self.stuck = np.zeros(2), 30.0, False
        self.failure: Exception | None = None
        self.calls: list[object] = []

    def connect(self, configuration: Property) -> list[BoardAxis]:
        """See BoardDriver."""
        self.calls.append("connect")
        return [BoardAxis(name="turn", gearbox=10.0), BoardAxis(name="slide", kind=JointType.PRISMATIC, gearbox=-5.0)]

    def disconnect(self) -> None:
        """See BoardDriver."""
        self.calls.append("disconnect")

    def read(self, state: ExtendedState) -> None:
        """See BoardDriver."""
        if self.failure is not None:
            raise self.failure
        state.joint_positions[:] = self.positions
        state.temperatures[:] = self.temperature

    def write(self, setpoints: Setpoints, modes: np.ndarray) -> None:
        """See BoardDriver."""
        if not self.stuck:
            self.positions = np.where(np.isin(modes, [*HOLDING_MODES]), setpoints.positions, self.positions)

    def configure(self, axis: int) -> None:
        """See BoardDriver."""
        self.calls.append((axis, self.board.max_current[axis]))


class Board(ControlBoard):
    """A board whose cycles are run by the test."""

    driver_class = Registers

    def __init__(self, time: ManualClock) -> None:
        self.hardware = Registers()
        self.time = time
        super().__init__(_KIND, driver=self.hardware)

    def _begin_cycles(self) -> None:
        """Start no thread; ``advance`` runs the cycles."""

    def advance(self, seconds: float) -> None:
        """Let time pass, and run the cycles of that time."""
        for _ in range(round(seconds / 0.01)):
            self.time.sleep(0.01)
            with self.board.lock:
                self.board.cycle(self.time.now())


@pytest.fixture
def board(stepped: ManualClock) -> Iterator[Board]:
    """An open board."""
    with closing(Board(stepped)) as board:
        board.open(Property())
        yield board


def test_modes_that_the_hardware_lacks_are_refused(board: Board):
    """A mode that the driver does not support is refused by name, and the joint's mode stays."""
    with pytest.raises(RefusedError, match="slide: this board does not have the mode torq"):
        board.set_control_modes(ControlMode.TORQUE, 1)
    assert board.control_modes() == (ControlMode.POSITION,) * 2
    board.set_control_modes(ControlMode.IDLE, 1)
    assert board.control_mode(1) is ControlMode.IDLE


def test_motors_follow_from_joints_and_couplings(board: Board):
    """Motor positions that the driver does not measure are computed from joints, couplings and gearboxes."""
    board.set_reference_speeds([50.0, 50.0])
    board.position_move([4.0, 3.0])
    board.advance(1.0)
    assert board.encoders() == pytest.approx([4.0, 3.0])
    assert board.motor_encoders() == pytest.approx([40.0, -5.0 * (-4.0 + 6.0)])
    assert str(board.variable("kinematic_mj")) == "(1.0 0.0 -1.0 2.0)"
    assert board.joint_type(1) is JointType.PRISMATIC
    for read in (board.encoder_speeds, board.motor_encoder_speeds, board.torques, board.currents, board.duty_cycles):
        with pytest.raises(NotSupportedError, match="does not measure"):
            read()


def test_a_joint_that_does_not_follow_is_in_fault(board: Board):
    """A joint that is off its setpoint by more than its error limit is in fault."""
    board.set_pid_error_limits(PidType.POSITION, 2.0, 0)
    board.hardware.stuck = True
    board.set_reference_speeds([50.0, 50.0])
    board.position_move([10.0, 10.0])
    board.advance(0.5)
    assert board.control_modes() == (ControlMode.HARDWARE_FAULT, ControlMode.POSITION)
    assert board.last_joint_fault(0) == (ERROR_LIMIT, "turn: the position is more than 2 degrees off")


def test_a_hot_motor_is_in_fault(board: Board):
    """A motor above its temperature limit is in fault."""
    board.hardware.temperature = 60.0
    board.set_temperature_limit(1, 50.0)
    board.advance(0.01)
    assert board.control_modes() == (ControlMode.POSITION, ControlMode.HARDWARE_FAULT)
    assert board.last_joint_fault(1) == (OVERHEATED, "slide: too hot: more than 50 degrees")


def test_a_change_configures_its_axis(board: Board):
    """The driver configures all axes at opening, and later the axis of a changed setting or mode."""
    assert board.hardware.calls[-2:] == [(0, 20.0), (1, 20.0)]
    before = len(board.hardware.calls)
    board.set_max_current(1, 7.0)
    board.set_pwm_limit(1, 50.0)
    board.set_control_modes(ControlMode.IDLE, 0)
    assert board.hardware.calls[before:] == [(1, 7.0), (1, 7.0), (0, 20.0)]


def test_hardware_that_fails_at_the_beginning_is_disconnected(stepped: ManualClock):
    """If the first reading fails, the driver is disconnected, and the board is not open."""
    board = Board(stepped)
    board.hardware.failure = DeviceError("the bus is off")
    with pytest.raises(DeviceError, match="the bus is off"):
        board.open(Property())
    assert board.hardware.calls[-1] == "disconnect"
    with pytest.raises(DeviceError, match="registers is not open"):
        board.encoders()


def test_a_driver_of_an_installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A driver of an installed package is a device type, by its entry point."""
    (tmp_path / "lab_driver.py").write_text(_LAB, encoding="utf-8")
    info = tmp_path / "lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text("[rtf.devices]\nlabBoard = lab_driver:LabBoard\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2]))
    kind = find_device("labBoard")
    assert issubclass(kind, ControlBoard)
    assert kind.driver_class.__name__ == "LabBoard"
