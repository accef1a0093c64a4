"""Tests of the skin wrapper: its ports are called after the robot, and it brings its sensor with it."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle, Property
from rtf.middleware.ports.port import Port
from rtf.robot.device import make_device
from rtf.robot.devices.fake_sensors import FakeAnalogSensor
from rtf.robot.errors import ConfigurationError, DeviceError
from rtf.robot.sensors.skin_wrapper import SkinWrapper

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network

BARE = {"robotName": "bot", "total_taxels": 3, "period": 20}
WHOLE = {**BARE, "subdevice": "fakeAnalogSensor"}


def ports_of(network: Network) -> set[str]:
    """The ports below the robot's name."""
    return {contact.name for contact in network.names.list("/bot")}


def test_one_port(network: Network):
    """Without ``ports`` all taxels are at ``/ROBOT/skin``; nothing is left when it is closed."""
    with closing(make_device("skinWrapper", Property(WHOLE), network=network)):
        assert ports_of(network) == {"/bot/skin", "/bot/skin/rpc:i"}
    assert ports_of(network) == set()


def test_a_port_for_each_part(network: Network):
    """Each of ``ports`` is below ``/ROBOT/skin``, and several may show one taxel."""
    shares = {"ports": Bottle(["hand", "arm"]), "hand": Bottle([0, 0, 0, 0]), "arm": Bottle([0, 0, 0, 0])}
    with closing(make_device("skinWrapper", Property({**WHOLE, **shares}), network=network)):
        assert ports_of(network) == {f"/bot/skin/{part}{end}" for part in ("hand", "arm") for end in ("", "/rpc:i")}


def test_it_can_be_attached_to_a_sensor(network: Network):
    """Without ``subdevice`` it serves the sensor that is attached, and names it if its channels do not fit."""
    sensor = FakeAnalogSensor("hand", network=network)
    sensor.open(Property({"channels": 6}))
    wrapper = SkinWrapper("skin", network=network)
    wrapper.open(Property(BARE))
    with closing(wrapper), pytest.raises(DeviceError, match="total_taxels is 3, and hand has 6 channels"):
        wrapper.attach({"hand": sensor})
    wrapper.open(Property({**BARE, "total_taxels": 6}))
    with closing(wrapper):
        wrapper.attach({"hand": sensor})
        assert "/bot/skin" in ports_of(network)


def test_a_name_in_use_is_refused(network: Network):
    """A port that exists is not taken over, and the wrapper leaves nothing open."""
    with Port("/bot/skin/rpc:i", network=network):
        with pytest.raises(DeviceError, match="the port /bot/skin/rpc:i exists already"):
            make_device("skinWrapper", Property(WHOLE), network=network)
        assert ports_of(network) == {"/bot/skin/rpc:i"}


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"robotName": ""}, "robotName: it is the name of a robot"),
        ({"robotName": None}, "robotName: it is missing, and so is name"),
        ({"total_taxels": None}, "total_taxels: it is missing"),
        ({"total_taxels": 0}, "total_taxels: 0 is not a whole number from 1"),
        ({"subdevice": "nothing"}, "there is no device type 'nothing'"),
    ],
)
def test_wrong_parameters(network: Network, change: dict[str, object], problem: str):
    """A parameter that is missing or wrong is named."""
    values = {key: value for key, value in {**WHOLE, **change}.items() if value is not None}
    with pytest.raises(ConfigurationError, match=problem):
        make_device("skinWrapper", Property(values), network=network)
