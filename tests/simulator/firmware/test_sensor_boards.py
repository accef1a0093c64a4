"""Boards that measure, emulated: what they send, when, and what they obey; and the way through driver and port."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.devices.can import sensor_messages as s
from rtf.robot.devices.can.codec import Decoded, decode
from rtf.robot.devices.can.codes import BoardType, InertialKind, StrainMode
from rtf.robot.errors import StaleStateError
from rtf.robot.interfaces import SensorCategory, SensorStatus
from rtf.robot.model import load_robot
from rtf.simulator.firmware.sensor_boards import (
    InertialBoard,
    MaisBoard,
    SensorBoard,
    SkinBoard,
    StrainBoard,
    calibration_of,
)
from rtf.simulator.firmware.wire import Wire
from rtf.simulator.plant import Options, build
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Frame, Message
    from rtf.robot.interfaces import FloatArray

ADDRESS = 13
SCALES = (1500, 1500, 1500, 35, 35, 35)


class SensorBench:
    """A bus with a host, a board, and what the sensor of the board is to measure."""

    address = None

    def __init__(self) -> None:
        self.simulation = Simulation(build(load_robot("bench"), Options()))
        self.wire = Wire("bench")
        self.simulation.boards.each_step.append(self.wire.step)
        self.connection = self.wire.attach(self)
        self.values: FloatArray = np.zeros(6)
        self.got: list[tuple[float, Decoded]] = []

    def receive(self, frame: Frame, time: float) -> None:
        """Keep a message."""
        self.got.append((time, decode(*frame)))

    def measure(self) -> FloatArray:
        """Return what the sensor measures."""
        return self.values

    def strain(self, calibration: FloatArray | None = None) -> StrainBoard:
        """Return a force-torque board on the bus."""
        matrix = calibration_of(ADDRESS) if calibration is None else calibration
        return StrainBoard(self.wire, ADDRESS, self.simulation, self.measure, SCALES, matrix)

    def send(self, message: Message, *values: float | bytes) -> None:
        """Send a command, and forget what came before it."""
        self.connection.send(message.frame(ADDRESS, *values))
        self.run(0.02)
        self.got.clear()

    def run(self, seconds: float) -> None:
        """Simulate."""
        self.simulation.advance(self.simulation.now + seconds)

    def sent(self, message: Message) -> list[tuple[float | bytes, ...]]:
        """Return the values of all messages of a kind."""
        return [one.values for _, one in self.got if one.message is message]


@pytest.fixture
def bench() -> SensorBench:
    """An empty bus."""
    return SensorBench()


def shares(pairs: list[tuple[float | bytes, ...]]) -> FloatArray:
    """Return the numbers of messages of counts about 0x8000, as shares of the range."""
    return (np.array([row[:3] for row in pairs], dtype=np.float64) - 0x8000) / 0x8000


def test_a_strain_board_sends_what_it_is_asked_for(bench: SensorBench):
    """Nothing after power-up; then calibrated forces within a count; raw ones that the matrix makes forces of."""
    board = bench.strain()
    bench.values = np.array([100.0, -20.0, 300.0, 1.0, -2.0, 0.5])
    bench.run(0.05)
    assert not bench.got
    bench.send(s.SET_STRAIN_MODE, StrainMode.BOTH)
    bench.run(0.1)
    assert len(bench.sent(s.FORCE)) == len(bench.sent(s.RAW_TORQUE)) == 10
    scales = np.array(SCALES, dtype=np.float64)
    calibrated = np.concatenate([shares(bench.sent(s.FORCE))[0], shares(bench.sent(s.TORQUE))[0]]) * scales
    assert calibrated == pytest.approx(bench.values, abs=1.6 * scales.max() / 0x8000)
    raw = np.concatenate([shares(bench.sent(s.RAW_FORCE))[0], shares(bench.sent(s.RAW_TORQUE))[0]])
    assert board.calibration @ raw * scales == pytest.approx(bench.values, abs=1.6 * scales.max() / 0x8000)
    bench.run(1.0)
    assert bench.sent(s.STRAIN_TEMPERATURE) == [(1, 250, 0)]
    bench.send(s.SET_STRAIN_MODE, StrainMode.STOPPED)
    bench.run(0.05)
    assert not bench.got


@pytest.mark.parametrize(("period", "count"), [(1, 100), (5, 20), (50, 2)])
def test_the_rate_is_that_of_the_host(bench: SensorBench, period: int, count: int):
    """In milliseconds, in simulated time."""
    bench.strain()
    bench.send(s.SET_STRAIN_MODE, StrainMode.CALIBRATED)
    bench.send(s.SET_SENSOR_RATE, period)
    bench.run(0.1)
    assert len(bench.sent(s.FORCE)) == pytest.approx(count, abs=1)


def test_saturated_gauges_are_reported(bench: SensorBench):
    """A byte more: the gauges at their upper (2) and lower end (1); the numbers end at the range, and do not wrap."""
    bench.strain(np.eye(6))
    bench.values = np.array([2000.0, 0.0, -2000.0, 0.0, 100.0, 0.0])
    bench.send(s.SET_STRAIN_MODE, StrainMode.CALIBRATED)
    bench.run(0.021)
    force, torque = bench.sent(s.FORCE_SATURATED)[0], bench.sent(s.TORQUE_SATURATED)[0]
    assert force == (0xFFFF, 0x8000, 0, 0b01_00_10_11)
    assert torque == (0x8000, 0xFFFF, 0x8000, 0b00_10_00_11)


def test_questions_to_a_strain_board(bench: SensorBench):
    """Versions and full scales are sent once; a channel that is none, and commands that are none, are dropped."""
    board = bench.strain()
    for channel in (0, 5, 6):
        bench.connection.send(s.FULL_SCALE.get.frame(ADDRESS, channel))
    bench.connection.send(s.SENSOR_VERSION.get.frame(ADDRESS, 1, 6))
    bench.connection.send(s.SENSOR_VERSION.get.frame(ADDRESS, 2, 0))
    bench.connection.send(s.SET_STRAIN_MODE.frame(ADDRESS, 9))
    bench.run(0.01)
    assert bench.sent(s.FULL_SCALE.value) == [(0, 1500), (5, 35)]
    versions = bench.sent(s.SENSOR_VERSION.value)
    assert [(row[0], row[-1]) for row in versions] == [(BoardType.STRAIN, 1), (BoardType.STRAIN, 0)]
    assert board.rejected == 2


def test_boards_answer_a_search_and_stop(bench: SensorBench):
    """With their types; a board in its boot loader is silent until a reset, which brings back what is in flash."""
    board: SensorBoard = SkinBoard(bench.wire, ADDRESS, bench.simulation, lambda: np.full(24, 7.0), BoardType.SKIN)
    bench.run(0.021)
    assert len(bench.sent(s.SKIN[0])) == len(bench.sent(s.SKIN[1])) == 2
    assert not bench.sent(s.SKIN[2])
    bench.send(s.DISCOVER.get)
    bench.run(0.05)
    assert not bench.got
    bench.send(s.JUMP_TO_LOADER)
    bench.connection.send(s.DISCOVER.get.frame(ADDRESS))
    bench.run(0.05)
    assert not bench.got
    board.reset()
    bench.run(0.05)
    assert bench.sent(s.SKIN[1])[0] == (0, *[7] * 7)


def test_inertial_boards_of_both_generations(bench: SensorBench):
    """The older ones have a message for each vector, the newer ones one that says what it is, with a number."""
    scales = {InertialKind.ANGULAR_VELOCITY: 0.5, InertialKind.ACCELERATION: 0.01}
    bench.values = np.array([1.0, 2.0, -3.0, 0.0, 9.81, 1e9])
    board = InertialBoard(bench.wire, ADDRESS, bench.simulation, bench.measure, scales)
    bench.run(0.021)
    assert bench.sent(s.INERTIAL_VECTOR)[:3] == [
        (0, InertialKind.ANGULAR_VELOCITY, 2, 4, -6),
        (0, InertialKind.ACCELERATION, 0, 981, 0x7FFF),
        (1, InertialKind.ANGULAR_VELOCITY, 2, 4, -6),
    ]
    board.stop()
    older = InertialBoard(bench.wire, 12, bench.simulation, bench.measure, scales, board_type=BoardType.SKIN)
    bench.run(0.01)
    assert bench.sent(s.GYROSCOPE) == [(2, 4, -6)]
    older.stop()


def test_a_board_of_hall_sensors(bench: SensorBench):
    """Fifteen bytes in two messages, once it is told to send."""
    MaisBoard(bench.wire, ADDRESS, bench.simulation, lambda: np.arange(15.0), BoardType.MAIS)
    bench.send(s.SET_STRAIN_MODE, StrainMode.CALIBRATED)
    bench.run(0.01)
    assert bench.sent(s.MAIS_LOW) == [tuple(range(7))]
    assert bench.sent(s.MAIS_HIGH) == [tuple(range(7, 15))]


def test_the_sensors_of_a_robot_through_their_buses():
    """Every sensor of an arm, through board, bus and driver, reads what the sensor measures, within its counts."""
    network = Network(LocalNames())
    with SimulatedRobot(load_robot("icub"), network=network, lockstep=True, can=True, parts=["left_arm"]) as made:
        assert made.parts["left_arm"].encoders() == pytest.approx(made.simulation.boards.targets[6:22], abs=0.5)  # home
        clock.current().sleep(0.1)
        firmware, drivers = made.firmware, made._drivers
        assert firmware is not None
        assert {one.wire for one in firmware.sensors} == {"left_arm0", "left_arm1", "skin0"}
        force = made.force_torques["left_arm"]
        through = drivers[force]
        assert through.read().values == pytest.approx(force.read().values, abs=0.4)
        assert through.sensor_status(SensorCategory.FORCE_TORQUE, 0) is SensorStatus.OK
        angles = made.angles["left_hand"]
        assert drivers[angles].read().values == pytest.approx(angles.read().values, abs=8.0)
        skin = made.skin["left_forearm"]
        assert drivers[skin].channels() == skin.channels() == 384
        assert drivers[skin].read().values == pytest.approx(skin.read().values, abs=10.0)
        firmware.wires["left_arm0"].filters.append(lambda _frame, _time: [])
        clock.current().sleep(0.2)
        with pytest.raises(StaleStateError, match=r"has sent nothing for 0.1 s"):
            through.read()
