"""Sensors: the fakes, the remapper, and every way through the network keep the same contract."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Property
from rtf.robot.device import Device, make_device
from rtf.robot.devices.analog_sensors_remapper import AnalogSensorsRemapper
from rtf.robot.devices.fake_sensors import FakeImu
from rtf.robot.sensors.analog_sensors import AnalogSensorsClient, AnalogSensorsDevice
from rtf.robot.sensors.inertial import InertialClient, InertialDevice
from waiting import eventually

from ..sensor_contract import MultipleAnalogSensorsContract, is_well

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import IMultipleAnalogSensors

    Open = Callable[..., Device]


@pytest.fixture
def opened(network: Network) -> Iterator[Open]:
    """Opens devices, and closes them at the end."""
    with ExitStack() as stack:

        def open_device(kind: type[Device], attached: Device | None = None, **parameters: object) -> Device:
            device = kind(kind.__name__, network=network)
            device.open(Property(parameters))
            stack.callback(device.close)
            if attached is not None:
                device.attach({"it": attached})
            return device

        yield open_device


class TestFakeImu(MultipleAnalogSensorsContract):
    """The fake IMU keeps the contract."""

    @pytest.fixture
    def sensors(self, opened: Open) -> Device:
        """A fake IMU with a short period."""
        return opened(FakeImu, period=1)


class TestRemapper(MultipleAnalogSensorsContract):
    """A remapper of two sensors of another device keeps the contract."""

    @pytest.fixture
    def sensors(self, opened: Open) -> Device:
        """The remapper of another device."""
        names = {f"{tag}Names": ["sensorName"] for tag in ("ThreeAxisGyroscopes", "OrientationSensors")}
        return opened(AnalogSensorsRemapper, opened(FakeImu, period=1), **names)


@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "udp"])
class TestThroughTheNetwork(MultipleAnalogSensorsContract):
    """The server and the client of all categories keep the contract."""

    @pytest.fixture
    def sensors(self, opened: Open, carrier: str) -> IMultipleAnalogSensors:
        """The client of a served device."""
        opened(AnalogSensorsDevice, opened(FakeImu, period=1), name="/icub/imu", period=2)
        client = opened(AnalogSensorsClient, remote="/icub/imu", local="/me", carrier=carrier, timeout=30)
        eventually(lambda: is_well(client), "nothing comes")
        return client


class TestInertial(MultipleAnalogSensorsContract):
    """The oldest server and its client keep the contract."""

    @pytest.fixture
    def sensors(self, opened: Open) -> IMultipleAnalogSensors:
        """The client of a served device."""
        opened(InertialDevice, opened(FakeImu, period=1), name="/icub/inertial", period=0.002)
        client = opened(InertialClient, remote="/icub/inertial", local="/me", timeout=30)
        eventually(lambda: is_well(client), "nothing comes")
        return client


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("fakeIMU", {}),
        ("fakeAnalogSensor", {}),
        ("fakeFrameGrabber", {}),
        ("multipleanalogsensorsserver", {"name": "/s", "period": 10}),
        ("multipleanalogsensorsremapper", {}),
        ("analogServer", {"name": "/s"}),
        ("inertial", {"name": "/s"}),
        ("frameGrabber_nws_yarp", {}),
    ],
)
def test_types_of_devices(network: Network, kind: str, parameters: dict[str, object]):
    """Each device type can be made, and closed repeatedly."""
    device = make_device(kind, Property(parameters), network=network)
    device.close()
    device.close()
