"""The driver of the documentation's example: a board at a serial line, whose firmware is another process."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import pytest

pytest.importorskip("serial", reason="needs pip install 'rtf[serial]'")

from rtf import clock
from rtf.bottle import Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import find_device, make_device
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError, StaleStateError
from rtf.robot.extended_state import ExtendedState, Field
from waiting import eventually

from .contract import ControlBoardContract

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .sensor_bench import ManualClock

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
KIND = "twoMotorBoard"


class Firmware:
    """The firmware of the board: a process at the other end of a pseudo terminal, which is scripted line by line."""

    def __init__(self) -> None:
        words = [sys.executable, str(EXAMPLES / "two_motor_firmware.py")]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.port = self._line()

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def script(self, line: str) -> None:
        """Send the firmware a line of the script, and wait until it has obeyed."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        assert self._line() == "done"

    def close(self) -> None:
        """End the process."""
        self._process.communicate(timeout=10)


@pytest.fixture(scope="module")
def firmware() -> Iterator[Firmware]:
    """One process for all tests; its state is reset with each connection."""
    with closing(Firmware()) as firmware:
        yield firmware


@pytest.fixture
def configuration(firmware: Firmware) -> Property:
    """The configuration that a user would write."""
    return Property({"port": firmware.port, "patience": 2.0})


def in_steps(opened: Callable[[ControlBoard], None]) -> ControlBoard:
    """Open a board whose cycles are run by the test instead of a thread."""

    class Stepped(find_device(KIND, EXAMPLES)):  # type: ignore[misc]  # a class that is found by name
        def _begin_cycles(self) -> None:
            """Start no thread; ``advance`` runs the cycles."""

    board = Stepped(KIND)
    opened(board)
    return board


class _InSteps:
    """Runs a board cycle by cycle."""

    def begin(self, configuration: Property, time: ManualClock) -> ControlBoard:
        """Return an open board."""
        self.time = time
        self.opened = in_steps(lambda board: board.open(configuration))
        return self.opened

    def advance(self, seconds: float) -> None:
        """See the contract."""
        board = self.opened.board
        period = board.driver.period
        assert period is not None
        for _ in range(max(1, round(seconds / period))):
            self.time.sleep(period)
            with board.lock:
                board.cycle(self.time.now())


class TestSerialBoard(_InSteps, ControlBoardContract):
    """The serial board keeps the contract of control boards."""

    UNMEASURED: ClassVar[frozenset[str]] = frozenset({"encoder_accelerations"})

    @pytest.fixture
    def board(self, configuration: Property, stepped: ManualClock) -> Iterator[ControlBoard]:
        """See the contract."""
        with closing(self.begin(configuration, stepped)) as board:
            yield board

    def can_be_compliant(self, board: ControlBoard) -> list[bool]:
        """See the contract: the board senses no torque."""
        return [False] * board.axes()


class TestFaults(_InSteps):
    """Faults, expired speeds and calibrations of the serial board."""

    def test_a_fault_of_the_hardware_is_one_of_the_joint(
        self, firmware: Firmware, configuration: Property, stepped: ManualClock
    ):
        """A fault of the hardware is one of its joint, with the driver's code and text, until a forced idle."""
        with closing(self.begin(configuration, stepped)) as board:
            firmware.script("fault 1 3")
            self.advance(0.02)
            assert board.control_modes() == (ControlMode.POSITION, ControlMode.HARDWARE_FAULT)
            assert board.last_joint_fault(1) == (13, "motor1: the board reports the fault 3")
            assert board.amplifier_status() == (0, 13)
            self.advance(0.1)
            board.set_control_modes(ControlMode.FORCE_IDLE, 1)
            self.advance(0.1)
            assert board.control_mode(1) is ControlMode.IDLE

    def test_too_much_current_is_a_fault(self, configuration: Property, stepped: ManualClock):
        """A current above the limit for several cycles is a fault of the joint."""
        with closing(self.begin(configuration, stepped)) as board:
            board.set_max_current(0, 2.0)
            board.set_control_modes(ControlMode.CURRENT, 0)
            board.set_reference_currents(2.5, 0)
            self.advance(0.06)
            assert board.control_mode(0) is ControlMode.CURRENT
            self.advance(0.1)
            assert board.last_joint_fault(0) == (1, "motor0: over-current: more than 2 A")

    def test_speeds_expire(self, configuration: Property, stepped: ManualClock):
        """A joint stops if its speed is not commanded again."""
        with closing(self.begin(configuration, stepped)) as board:
            board.set_control_modes(ControlMode.VELOCITY, 0)
            board.velocity_move(10.0, 0)
            self.advance(0.4)
            assert board.encoder_speeds(0)[0] == pytest.approx(10.0, abs=0.1)
            self.advance(0.3)
            assert board.encoder_speeds(0)[0] == 0.0
            assert board.encoder(0) == pytest.approx(5.0, abs=0.3)

    def test_calibration_is_a_chain_of_modes(self, configuration: Property, stepped: ManualClock):
        """A joint that is being calibrated takes no mode, and is in position mode afterwards."""
        with closing(self.begin(configuration, stepped)) as board:
            board.calibrate_axis(0, board.board.calibration[0])
            assert not board.calibration_done(0)
            board.set_control_modes(ControlMode.VELOCITY, 0)
            assert board.control_mode(0) is ControlMode.CALIBRATING
            self.advance(0.6)
            assert board.calibration_done(0)
            assert board.control_mode(0) is ControlMode.POSITION

    def test_declared_positions_are_kept(self, configuration: Property, stepped: ManualClock):
        """Set encoders keep their values without motion, and the next move is relative to them."""
        with closing(self.begin(configuration, stepped)) as board:
            board.set_encoders(10.0, 0)
            board.set_motor_encoders(50.0, 1)
            self.advance(0.1)
            assert board.encoder(0) == pytest.approx(10.0)
            assert board.motor_encoders() == pytest.approx([1000.0, 50.0])
            board.set_reference_speeds(50.0, 0)
            board.position_move(15.0, 0)
            self.advance(0.5)
            assert board.encoder(0) == pytest.approx(15.0, abs=0.01)
            assert board.motor_encoders(0) == pytest.approx([1500.0], abs=1.0)

    def test_the_state_says_what_is_measured(self, configuration: Property, stepped: ManualClock):
        """Fields that the driver does not measure are not valid, and reading them raises an error."""
        with closing(self.begin(configuration, stepped)) as board:
            state = ExtendedState(2)
            board.fill_state(state)
            lacking = {field for field in Field if not state.valid[field]}
            assert lacking == {Field.JOINT_ACCELERATIONS, Field.MOTOR_ACCELERATIONS}
            with pytest.raises(NotSupportedError, match="joint accelerations"):
                board.encoder_accelerations()


def test_in_the_machines_time(firmware: Firmware, configuration: Property):
    """A thread runs the cycles in real time; the state of silent hardware is stale until it answers again."""
    board = make_device(KIND, configuration, beside=EXAMPLES)
    assert isinstance(board, ControlBoard)
    with closing(board):
        board.set_reference_speeds(90.0, 0)
        board.position_move(5.0, 0)
        eventually(lambda: fresh(board) and arrived(board), "the motor does not arrive")
        firmware.script("mute")
        try:
            with pytest.raises(StaleStateError, match=f"{KIND}: the hardware has not answered for"):
                eventually(lambda: board.encoder(0) < 0, "the state does not become stale")
        finally:
            firmware.script("speak")
        eventually(lambda: fresh(board), "the board is not read again")


def arrived(board: ControlBoard) -> bool:
    """Whether its first motor is where it was sent; a busy machine may be too slow for a state that is new enough."""
    try:
        late = clock.current().now() - board.encoder_times()[0]
        return abs(board.encoder(0) - 5.0) < 0.01 and abs(late) < 0.2
    except StaleStateError:
        return False


def fresh(board: ControlBoard) -> bool:
    """Return whether the state can be read."""
    try:
        board.encoders()
    except StaleStateError:
        return False
    return True


def test_what_is_not_this_board(tmp_path: Path, configuration: Property):
    """A missing line, a wrong number of joints and a silent line are errors of the opening."""
    with pytest.raises(DeviceError, match="no board at the serial line '/dev/no-such'"):
        make_device(KIND, Property({"port": "/dev/no-such"}), beside=EXAMPLES)
    with pytest.raises(ConfigurationError, match="Joints: this board has 2, not 3"):
        make_device(KIND, Property.parse("(GENERAL (Joints 3))"), beside=EXAMPLES)
    master, terminal = os.openpty()
    try:
        with pytest.raises(DeviceError, match=r"does not answer 'I' within 0\.05 s"):
            make_device(KIND, Property({"port": os.ttyname(terminal), "patience": 0.05}), beside=EXAMPLES)
    finally:
        os.close(master)
        os.close(terminal)
    board = find_device(KIND, EXAMPLES)("unopened")
    assert isinstance(board, ControlBoard)
    with pytest.raises(DeviceError, match="unopened is not open"):
        board.encoders()


def test_a_driver_is_found_in_a_plugin_folder(monkeypatch: pytest.MonkeyPatch):
    """Drivers in RTF_PLUGIN_PATH are found by type and by file; paths and other files are no types."""
    with pytest.raises(ConfigurationError, match="there is no device type 'twoMotorBoard'"):
        find_device(KIND)
    monkeypatch.setenv("RTF_PLUGIN_PATH", str(EXAMPLES))
    assert issubclass(find_device(KIND), ControlBoard)
    assert issubclass(find_device("serial_board"), ControlBoard)
    with pytest.raises(ConfigurationError):
        find_device("../examples/serial_board")
    with pytest.raises(DeviceError, match="two_motor_firmware"):
        find_device("two_motor_firmware")
