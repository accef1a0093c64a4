"""Sensors on a bus: their values from messages, their status, and boards that are not what is expected."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.robot.device import make_device
from rtf.robot.devices.can import sensor_messages as sensor
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.codes import BoardType, StrainMode
from rtf.robot.devices.can.sensor_base import CanSensors
from rtf.robot.devices.can.sensors import CanMais, CanStrain
from rtf.robot.errors import ConfigurationError, DeviceError, RefusedError, StaleStateError
from rtf.robot.interfaces import SensorCategory, SensorStatus
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.devices.can.messages import Frame

STRAIN = "(canAddress 13) (timeout 5000)"


class StrainBoard:
    """A strain board at the address 13, which answers questions; a test sends its readings."""

    def __init__(self, channel: str) -> None:
        self.kind = BoardType.STRAIN
        self.commands: list[tuple[str, tuple[float | bytes, ...]]] = []
        self.bus = CanBus(BusSettings("virtual", channel))
        self.bus.subscribe(self._take, [0x20D])

    def _take(self, frame: Frame, stamp: float) -> None:
        del stamp
        got = decode(*frame)
        self.commands.append((got.message.name, got.values))
        if got.message is sensor.SENSOR_VERSION.get:
            self.bus.send(sensor.SENSOR_VERSION.value.frame(13, self.kind, 1, 0, 0, 1, 6, 1))
        elif got.message is sensor.FULL_SCALE.get:
            channel = int(got.values[0])
            self.bus.send(sensor.FULL_SCALE.value.frame(13, channel, 100 * (channel + 1)))


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A virtual channel of this test alone."""
    return f"{request.node.name}"


@pytest.fixture
def board(channel: str) -> Iterator[StrainBoard]:
    """A strain board."""
    made = StrainBoard(channel)
    with closing(made.bus):
        yield made


def opened(kind: str, text: str, channel: str) -> CanSensors:
    """Return an open device on the channel."""
    bus = f" (CAN (interface virtual) (channel {channel}))"
    return cast("CanSensors", make_device(kind, Property.parse(text + bus)))


def is_well(device: CanSensors, category: SensorCategory, index: int = 0) -> bool:
    """Whether a sensor has values."""
    return device.sensor_status(category, index) is SensorStatus.OK


def test_forces_and_torques_are_shares_of_full_scale(board: StrainBoard, channel: str):
    """The board is asked for its scales and set to send; both messages together are a reading."""
    with closing(opened("canBusStrain", STRAIN + " (period 5)", channel)) as device:
        place = SensorCategory.FORCE_TORQUE, 0
        assert device.sensor_status(*place) is SensorStatus.WAITING_FOR_FIRST_READ
        board.bus.send(sensor.FORCE.frame(13, 0x8000, 0xC000, 0), sensor.TORQUE.frame(13, 0x8000, 0x4000, 0x8001))
        eventually(lambda: is_well(device, *place), "no reading")
        expected = [0, 100, -300, 0, -250, 600 / 0x8000]
        assert device.read_sensor(*place).values == pytest.approx(expected)
        device.calibrate(1)
        device.calibrate(0, 7.0)
        assert device.read().values == pytest.approx([7, 0, *expected[2:]])
        with pytest.raises(RefusedError, match="no 6"):
            device.calibrate(6)
    eventually(lambda: ("set_strain_mode", (StrainMode.CALIBRATED,)) in board.commands, "no mode")
    assert ("set_sensor_rate", (5,)) in board.commands


def test_the_device_of_analog_boards(board: StrainBoard, channel: str):
    """The files of real robots have one type for all, and other capital letters; the channels say what it is."""
    text = "(CanAddress 0x0D) (Period 5) (Channels 6) (Format 16)"
    with closing(opened("canBusAnalogSensor", text, channel)) as made:
        device = made.implementation
        assert isinstance(device, CanStrain)
        board.bus.send(sensor.FORCE.frame(13, 0x8000, 0xC000, 0), sensor.TORQUE.frame(13, 0x8000, 0x8000, 0x8000))
        eventually(lambda: is_well(device, SensorCategory.FORCE_TORQUE), "no reading")
        assert device.read().values[:2] == pytest.approx([0, 100])
    assert ("set_sensor_rate", (5,)) in board.commands
    with closing(opened("canBusAnalogSensor", "(canAddress 14) (channels 16) (format 8)", channel)) as made:
        assert isinstance(made.implementation, CanMais)
    with pytest.raises(ConfigurationError, match="4 are neither 6, of forces, nor 15 or 16, of a hand"):
        opened("canBusAnalogSensor", "(canAddress 14) (channels 4)", channel)


def test_saturated_channels_are_reported(board: StrainBoard, channel: str):
    """The status is OVERFLOW, in which only the older interface has values."""
    with closing(opened("canBusStrain", STRAIN + " (fullScale 1 1 1 1 1 1)", channel)) as device:
        board.bus.send(sensor.FORCE_SATURATED.frame(13, 0xFFFF, 0, 0, 0b0101), sensor.TORQUE.frame(13, 0, 0, 0))
        eventually(
            lambda: device.sensor_status(SensorCategory.FORCE_TORQUE, 0) is SensorStatus.OVERFLOW, "no saturation"
        )
        with pytest.raises(RefusedError, match="OVERFLOW"):
            device.read_sensor(SensorCategory.FORCE_TORQUE, 0)
        assert device.read().values[0] == pytest.approx(1, abs=1e-4)


def test_raw_values_are_calibrated_by_a_matrix(board: StrainBoard, channel: str):
    """Without the board's calibration, N and Nm are the matrix times the shares of the range."""
    matrix = np.arange(36.0).reshape(6, 6)
    text = f"{STRAIN} (useCalibration no) (matrix {' '.join(map(str, matrix.flat))})"
    with closing(opened("canBusStrain", text, channel)) as device:
        board.bus.send(sensor.RAW_FORCE.frame(13, 0xC000, 0x8000, 0x8000), sensor.RAW_TORQUE.frame(13, *[0x8000] * 3))
        eventually(lambda: is_well(device, SensorCategory.FORCE_TORQUE), "no reading")
        assert device.read().values == pytest.approx(matrix @ [0.5, 0, 0, 0, 0, 0])


def test_another_board_is_refused(board: StrainBoard, channel: str):
    """A board of another type at the address is named; the bus is given back."""
    board.kind = BoardType.MAIS
    with pytest.raises(DeviceError, match=r"board 13 on virtual .* is a MAIS, not a STRAIN or STRAIN2"):
        opened("canBusStrain", STRAIN, channel)


def test_old_readings_are_reported(board: StrainBoard, channel: str):
    """A board that has stopped sending has the status TIMEOUT."""
    with closing(opened("canBusStrain", "(canAddress 13) (timeout 20)", channel)) as device:
        board.bus.send(sensor.FORCE.frame(13, 1, 2, 3), sensor.TORQUE.frame(13, 1, 2, 3))
        eventually(lambda: device.sensor_status(SensorCategory.FORCE_TORQUE, 0) is SensorStatus.TIMEOUT, "no time-out")
        with pytest.raises(StaleStateError):
            device.read()


def test_hall_sensors_of_a_hand(board: StrainBoard, channel: str):
    """Fifteen values come in two messages."""
    with closing(opened("canBusMais", "(canAddress 14) (timeout 5000)", channel)) as device:
        board.bus.send(sensor.MAIS_LOW.frame(14, *range(7)), sensor.MAIS_HIGH.frame(14, *range(7, 15)))
        eventually(lambda: is_well(device, SensorCategory.ENCODER_ARRAY), "no reading")
        assert device.read().values.tolist() == [*range(15)]


def test_inertial_units(board: StrainBoard, channel: str):
    """Each board has a gyroscope and an accelerometer, in both forms of messages, scaled by the configuration."""
    text = "(canAddresses 8 9) (gyroscopeScale 0.5) (accelerometerScale 0.01) (timeout 5000)"
    with closing(opened("canBusInertialMTB", text, channel)) as device:
        board.bus.send(
            sensor.GYROSCOPE.frame(8, 2, 4, -6),
            sensor.INERTIAL_VECTOR.frame(9, 0, 0, 100, 0, -981),
            sensor.INERTIAL_VECTOR.frame(9, 1, 1, 7, 7, 7),  # a magnetometer, which is not asked for
        )
        eventually(lambda: is_well(device, SensorCategory.ACCELEROMETER, 1), "no reading")
        assert device.read_sensor(SensorCategory.GYROSCOPE, 0).values.tolist() == [1, 2, -3]
        assert device.read_sensor(SensorCategory.ACCELEROMETER, 1).values == pytest.approx([1, 0, -9.81])
        assert not is_well(device, SensorCategory.GYROSCOPE, 1)
        with pytest.raises(RefusedError, match="has 2 sensors"):
            device.sensor_status(SensorCategory.GYROSCOPE, 2)


def test_skin(board: StrainBoard, channel: str):
    """The twelve taxels of a triangle come in two messages, and are at its place in the patch."""
    with closing(opened("canBusSkin", "(canAddresses (8 9)) (timeout 5000)", channel)) as device:
        board.bus.send(
            sensor.SKIN[2].frame(9, 0x40, *range(1, 8)), sensor.SKIN[2].frame(9, 0xC0, 8, 9, 10, 11, 12, 99, 99)
        )
        eventually(lambda: is_well(device, SensorCategory.SKIN_PATCH, 1), "no reading")
        eventually(
            lambda: device.read_sensor(SensorCategory.SKIN_PATCH, 1).values[24:37].tolist() == [*range(1, 13), 0],
            "other taxels",
        )
        assert device.channels() == 2 * 16 * 12


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        ("canBusStrain", "(canAddress 15)", "canAddress"),
        ("canBusStrain", "(canAddress 1 2)", "canAddress"),
        ("canBusStrain", "(canAddress 1) (useCalibration no)", "matrix"),
        ("canBusInertialMTB", "(canAddresses 1)", "gyroscopeScale"),
        ("canBusSkin", "", "canAddresses"),
    ],
)
def test_wrong_configurations_are_reported(kind: str, text: str, said: str):
    """The error names the parameter."""
    with pytest.raises(ConfigurationError, match=said):
        opened(kind, text, "unused")
