"""The controller as a device on two boards, moved by its client through the network."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import Device, make_device
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import ConfigurationError, DeviceError, RefusedError
from rtf.robot.interfaces import ControllerEvent, ICartesianControl
from rtf.robot.kinematics import robot_chains
from rtf.robot.model import load_robot
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

CHAIN = robot_chains(load_robot("icub")).chain("left_arm", "2.5")
START = [-30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0]
GENERAL = (
    "(GENERAL (KinematicPart arm) (KinematicType left_v2.5) (ControllerName bot/cartesianController/left_arm)"
    " (NumberOfDrivers 2)"
    " (Inactive (torso_pitch torso_roll torso_yaw)) (Together (l_shoulder_pitch l_shoulder_roll l_shoulder_yaw))"
    " (Drawn (5 (0 0 -1) (0 0 1))))"
)


def board(name: str, joints: tuple[str, ...]) -> FakeBoard:
    """A board with these joints."""
    opened = FakeBoard(name)
    opened.open(Property.parse(f"(GENERAL (Joints {len(joints)}) (AxisName {' '.join(joints)}))"
                               f" (LIMITS (Min {'-95 ' * len(joints)}) (Max {'160 ' * len(joints)}))"))  # fmt: skip
    return opened


@pytest.fixture
def boards() -> dict[str, Device]:
    """The torso in the order of its board, which is not that of the chain, and the arm."""
    arm = board("arm", CHAIN.joints[3:])
    arm.set_control_modes(ControlMode.POSITION_DIRECT)
    arm.set_positions(START)
    return {"torso": board("torso", CHAIN.joints[2::-1]), "left_arm": arm}


@pytest.fixture
def client(network: Network, boards: dict[str, Device]) -> Iterator[ICartesianControl]:
    """The client of the device."""
    with ExitStack() as opened:
        device = make_device("cartesiancontrollerserver", Property.parse(GENERAL), network=network)
        opened.callback(device.close)
        device.attach(boards)
        where = Property.parse("(remote /bot/cartesianController/left_arm) (carrier tcp)")
        found = opened.enter_context(closing(make_device("cartesiancontrollerclient", where, network=network)))
        yield found.view(ICartesianControl)


def test_the_arm_is_moved_through_the_network(client: ICartesianControl, boards: dict[str, Device]):
    """A reach ends at its pose, with its events; the torso stands; a stop ends a motion in its middle."""
    assert client.active_joints() == (False,) * 3 + (True,) * 7
    events: list[ControllerEvent] = []
    client.observe_events(events.append)
    target = CHAIN.pose([0, 0, 0, -40, 40, 10, 60, 10, -5, 5])[:3, 3]
    client.go_to(target, 0.2)
    eventually(client.motion_done, "the motion does not end")
    eventually(lambda: len(events) >= 2, "events are missing")
    assert [event.name for event in events] == ["motion-onset", "motion-done"]
    assert client.pose(9).vector[:3] == pytest.approx(target, abs=0.012)
    assert client.desired().pose[:3] == pytest.approx(target, abs=2e-4)
    assert not boards["torso"].encoders().any()
    client.go_to(CHAIN.pose([0, 0, 0, *START])[:3, 3], 30.0)
    client.stop()
    assert client.motion_done()
    boards["left_arm"].set_control_modes(ControlMode.IDLE, 0)
    with pytest.raises(RefusedError):
        client.go_to(target)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(KinematicPart arm)", "", "KinematicPart: a part and its type are needed"),
        ("left_v2.5", "left-2", "KinematicType: a part and its type are needed"),
        ("left_v2.5", "middle_v2.5", "KinematicType: .* has no chain 'middle_arm'"),
        ("(Inactive (torso_pitch", "(Inactive (torso_pich", "has no joint 'torso_pich'"),
        ("(Together (l_shoulder_pitch", "(Together (l_sholder_pitch", "has no joint 'l_sholder_pitch'"),
        ("(Drawn (5", "(Drawn (15", "Drawn: a link, a place and weights are needed: .* links 0 to 9, not 15"),
        ("(0 0 1))))", "(0 0))))", "Drawn: a link, a place and weights are needed"),
    ],
)
def test_wrong_configurations_are_reported(network: Network, old: str, new: str, message: str):
    """By the parameter, and what is there instead."""
    assert old in GENERAL
    with pytest.raises(ConfigurationError, match=message):
        make_device("cartesiancontrollerserver", Property.parse(GENERAL.replace(old, new)), network=network)


def test_boards_without_its_joints_are_refused(network: Network, boards: dict[str, Device]):
    """By the joint that is missing."""
    device = make_device("cartesiancontrollerserver", Property.parse(GENERAL), network=network)
    with closing(device), pytest.raises(DeviceError, match="no board has an axis 'torso_pitch'"):
        device.attach({"left_arm": boards["left_arm"]})
