"""Devices of a robot configuration that are attached to a simulated robot, and their servers."""

from __future__ import annotations

from contextlib import ExitStack, closing
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.bottle.binary import encode
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.remote import connect
from rtf.middleware.wire.contact import Contact
from rtf.robot.device import make_device
from rtf.robot.errors import ConfigurationError, DeviceError
from rtf.robot.interfaces import (
    IAnalogSensor,
    IMultipleAnalogSensors,
    IPositionControl,
    IRgbdSensor,
    SensorCategory,
)
from rtf.robot.model import load_robot
from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end
from rtf.simulator.robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.device import Device

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


def devices_of(network: Network, opened: ExitStack) -> Callable[..., Device]:
    """Makes devices that are closed at the end."""

    def made(kind: str, **parameters: object) -> Device:
        return opened.enter_context(closing(make_device(kind, Property(parameters), network=network)))

    return made


@pytest.fixture
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Device]]:
    """Makes devices on a network of this process."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    with ExitStack() as opened:
        yield devices_of(Network(LocalNames(), patience=30), opened)


def test_they_are_the_devices_of_the_robot(device: Callable[..., Device]):
    """Boards, force-torque and inertial sensors, sensors of fingers, and skin; with the faults of the robot."""
    simulation = device("simulatedRobot", model="icub", lockstep=True)
    robot = simulation.robot
    for kind, parameters, expected, interface in (
        ("simulatedBoard", {"part": "head"}, robot.parts["head"], IPositionControl),
        ("simulatedForceTorque", {"sensor": "l_arm_ft_sensor"}, robot.force_torques["left_arm"], IAnalogSensor),
        ("simulatedImu", {}, robot.imus["inertial"], IMultipleAnalogSensors),
        ("simulatedAngles", {"sensor": "left_hand"}, robot.angles["left_hand"], IAnalogSensor),
        ("simulatedSkin", {"sensor": "right_hand"}, robot.skin["right_hand"], IAnalogSensor),
    ):
        attached = device(kind, **parameters)
        with pytest.raises(DeviceError, match="attached to no simulated robot; its action 'attach' comes first"):
            attached.view(interface)
        attached.attach({"simulation": simulation})
        assert attached.view(interface) is expected
        assert attached.implementation is expected
        attached.detach()
        with pytest.raises(DeviceError, match="attached to no simulated robot"):
            attached.view(interface)
    single = robot.force_torques["left_leg"]
    assert [info.name for info in single.sensors(SensorCategory.FORCE_TORQUE)] == ["l_leg_ft_sensor"]
    assert single.read_all()[SensorCategory.FORCE_TORQUE] == [single.read()]


def test_what_cannot_be_attached(device: Callable[..., Device]):
    """An unknown name, a missing name where there are several, and a device that is no simulated robot are errors."""
    simulation = device("simulatedRobot", model="icub", lockstep=True)
    for kind, parameters, message in (
        ("simulatedBoard", {"part": "tail"}, "no part 'tail'; it has head, left_arm"),
        ("simulatedBoard", {}, "not one part: name it with 'part'; it has head"),
        ("simulatedSkin", {"sensor": "tail"}, "no skin 'tail'; it has left_hand, left_forearm"),
        (
            "simulatedDepthCamera",
            {},
            "not one depth camera: name it .*; it has none; see the parameter cameras",
        ),
        ("simulatedBattery", {}, "not one battery"),
    ):
        with pytest.raises(DeviceError, match=message):
            device(kind, **parameters).attach({"simulation": simulation})
    with pytest.raises(DeviceError, match="attached to one simulatedRobot, not to nothing"):
        device("simulatedImu").attach({})
    with pytest.raises(ConfigurationError, match="no robot 'unheard'"):
        device("simulatedRobot", model="unheard")


def test_cameras(device: Callable[..., Device]):
    """Cameras are attached if the robot is simulated with cameras."""
    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    simulation = device("simulatedRobot", model="bench", lockstep=True, cameras=True)
    depths = device("simulatedDepthCamera")
    depths.attach({"simulation": simulation})
    assert depths.view(IRgbdSensor).images().depth.pixels.std() > 0.05
    with pytest.raises(DeviceError, match="has no IFrameGrabber"):
        device("frameGrabber_nws_yarp").attach({"depths": depths})


def test_in_lockstep_they_are_published_as_by_rtf_simulator(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Same seed, same commands: every message and every stamp of the streams is the same, to the last bit."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    published = []
    for assemble in (assembled, served):
        with ExitStack() as robot:
            published.append(streams(*assemble(robot)))
    assert published[0] == published[1]
    stamps = [float(stamp.split()[1]) for stamp, _ in published[0]["/bench/inertial"]]
    assert stamps == pytest.approx(np.arange(51) / 100.0, abs=1e-9)


def assembled(opened: ExitStack) -> tuple[Network, IPositionControl]:
    """The bench as a robot configuration makes it: its network, and its board."""
    network = Network(LocalNames(), patience=30)
    device = devices_of(network, opened)
    simulation = device("simulatedRobot", model="bench", robot="bench", lockstep=True)
    for kind, server, settings in (
        ("simulatedBoard", "controlBoard_nws_yarp", {"name": "/bench/arm", "period": 0.01}),
        ("simulatedImu", "inertial", {"name": "/bench/inertial", "period": 0.01}),
        ("simulatedBattery", "battery_nws_yarp", {"name": "/bench/battery", "period": 0.05}),
    ):
        attached = device(kind)
        attached.attach({"simulation": simulation})
        device(server, **settings).attach({"attached": attached})
    return network, simulation.robot.parts["arm"]


def served(opened: ExitStack) -> tuple[Network, IPositionControl]:
    """The bench as ``rtf simulator`` makes it."""
    network = Network(LocalNames(), patience=30)
    robot = opened.enter_context(SimulatedRobot(load_robot("bench"), "bench", network=network, lockstep=True))
    return network, robot.parts["arm"]


def streams(network: Network, arm: IPositionControl) -> dict[str, list[tuple[str, bytes]]]:
    """What is published in half a second of lockstep, during a movement, by ports: envelopes and messages."""
    heard: dict[str, list[tuple[str, bytes]]] = {}
    with ExitStack() as opened:
        time = opened.enter_context(closing(LockstepClock("/clock", "reader", network=network)))
        for name in ("/bench/arm/state:o", "/bench/arm/stateExt:o", "/bench/inertial"):
            messages = heard[name] = []

            def hear(delivery: IncomingMessage, messages: list[tuple[str, bytes]] = messages) -> None:
                messages.append((delivery.envelope, encode(delivery.read())))

            port = opened.enter_context(Port(f"/reader{name}", hear, network=network))
            connect(network, Contact(name), Contact(port.name), "tcp")
        arm.position_move([40.0, 60.0])
        time.sleep(0.5)
    return heard
