"""Servers with a group ROS: boards, cameras and forces on topics of a real master, beside their ports or alone."""

from __future__ import annotations

import math
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import pytest

from rtf.bottle import Property
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.robot.device import Device, make_device
from rtf.robot.errors import ConfigurationError, DeviceError
from rtf.ros1.messages import Image, Imu, JointState, WrenchStamped, seconds_of
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from ros1.conftest import Ros

    from rtf.middleware.ports.network import Network
    from rtf.ros1.node import Node

GROUP = "(ROS (useROS {}) (ROS_topicName {}) (ROS_nodeName {}) {})"


@pytest.fixture(autouse=True)
def at_the_master(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment of a program."""
    monkeypatch.setenv("ROS_MASTER_URI", ros.uri)
    monkeypatch.setenv("ROS_IP", "127.0.0.1")


@contextmanager
def attached(network: Network, kind: str, fake: str, configuration: str, settings: str = "") -> Iterator[Device]:
    """A server that is attached to a fake device."""
    with ExitStack() as opened:
        device = make_device(fake, Property.parse(settings), network=network)
        opened.callback(device.close)
        server = make_device(kind, Property.parse(configuration), network=network)
        opened.callback(server.close)
        server.attach({"fake": device})
        yield device


def test_a_board_is_on_a_topic_and_on_its_ports(node: Callable[..., Node], network: Network):
    """In rad, with the names that are given."""
    got: list[Any] = []
    node("listener").subscribe("/joint_states", JointState, got.append)
    arm = "(name /robot/arm) (period 10) " + GROUP.format("true", "/joint_states", "/lab/arm", "(jointNames (a b c))")
    with attached(network, "controlboardwrapper2", "fakeMotionControl", arm, "(GENERAL (Joints 3))") as board:
        board.set_encoders([90.0, 0.0, -45.0])
        eventually(lambda: any(one.position[0] > 1.5 for one in got), "no state came")
        assert remote.exists(network, Contact("/robot/arm/state:o"))
        assert ["/joint_states", ["/lab/arm"]] in node("asks").master.call("getSystemState")[0]
    assert got[-1].name == ["a", "b", "c"]
    assert got[-1].position == pytest.approx([math.pi / 2, 0.0, -math.pi / 4])
    assert not [one for one in node("asks").master.call("getSystemState")[0] if one[0] == "/joint_states"]


def test_a_board_may_be_on_the_topic_only(node: Callable[..., Node], network: Network):
    """Two boards may have the same node and the same topic; ``false`` is no topic."""
    got: list[Any] = []
    node("listener").subscribe("/joint_states", JointState, got.append)
    arm = "(name /robot/arm) " + GROUP.format("only", "/joint_states", "/lab/robot", "")
    hand = "(node_name /lab/robot) (topic_name /joint_states)"
    leg = "(name /robot/leg) " + GROUP.format("false", "/x", "/y", "")
    with (
        attached(network, "controlboardwrapper2", "fakeMotionControl", arm, "(GENERAL (Joints 2))"),
        attached(network, "controlBoard_nws_ros", "fakeMotionControl", hand, "(GENERAL (Joints 3))"),
        attached(network, "controlBoard_nws_yarp", "fakeMotionControl", leg, "(GENERAL (Joints 1))"),
    ):
        eventually(lambda: {len(one.name) for one in got} == {2, 3}, "no state came")
        assert not remote.exists(network, Contact("/robot/arm/state:o"))
        assert remote.exists(network, Contact("/robot/leg/state:o"))
        published, _, _ = node("asks").master.call("getSystemState")
        assert published == [["/joint_states", ["/lab/robot"]]]


def test_sensors_are_on_topics(node: Callable[..., Node], network: Network):
    """Pictures, forces and inertial units, with their frames and times."""
    imus: list[Any] = []
    images: list[Any] = []
    wrenches: list[Any] = []
    listener = node("listener")
    listener.subscribe("/eye", Image, images.append)
    listener.subscribe("/foot", WrenchStamped, wrenches.append)
    listener.subscribe("/imu", Imu, imus.append)
    imu = "(name /imu) " + GROUP.format("only", "/imu", "/lab/imu", "(frame_id head)")
    eye = "(name /cam) " + GROUP.format("true", "/eye", "/lab/eye", "(frame_id eye)")
    foot = "(name /foot) " + GROUP.format("true", "/foot", "/lab/foot", "(frame_id foot)")
    with (
        attached(network, "frameGrabber_nws_yarp", "fakeFrameGrabber", eye),
        attached(network, "analogServer", "fakeAnalogSensor", foot),
        attached(network, "inertial", "fakeIMU", imu),
    ):
        eventually(lambda: len(images) > 1 and wrenches and imus, "they did not arrive")
    assert (images[0].header.frame_id, images[0].encoding) == ("eye", "rgb8")
    assert len(images[0].data) == images[0].height * images[0].step > 0
    stamps = [seconds_of(one.header.stamp) for one in images]
    assert stamps == sorted(set(stamps))
    assert (wrenches[0].header.frame_id, imus[0].header.frame_id) == ("foot", "head")
    turn = imus[0].orientation
    assert turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2 == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("group", "complaint"),
    [
        ("(ROS (useROS maybe))", "useROS: 'maybe' is none of true, false and only"),
        ("(ROS (useROS true) (ROS_nodeName /a))", "ROS_topicName: it is missing"),
        (
            GROUP.format("true", "/t", "/n", "(ROS_msgType lab/Other)"),
            "publishes sensor_msgs/JointState, not lab/Other",
        ),
    ],
)
def test_a_wrong_group_is_reported(network: Network, group: str, complaint: str):
    """When the server is opened."""
    with pytest.raises(ConfigurationError, match=complaint):
        make_device("controlboardwrapper2", Property.parse(f"(name /robot/arm) {group}"), network=network)


def test_a_server_without_a_topic_says_so(network: Network):
    """Batteries have none here."""
    group = GROUP.format("true", "/t", "/n", "")
    with pytest.raises(ConfigurationError, match="this server publishes nothing"):
        make_device("battery_nws_yarp", Property.parse(f"(name /battery) {group}"), network=network)


@pytest.mark.parametrize(
    ("group", "complaint"),
    [
        (GROUP.format("true", "/t", "/n", "(jointNames (a))"), "1 jointNames for 3 axes"),
        (GROUP.format("true", '"/t t"', "/n", ""), "'/t t' is no name"),
        (GROUP.format("true", "/t", '"/n n"', ""), "'n n' is no name of a node"),
    ],
)
def test_what_cannot_be_published_is_reported(network: Network, group: str, complaint: str):
    """When it is attached; the ports are not opened."""
    configuration = f"(name /robot/arm) {group}"
    with (
        pytest.raises(DeviceError, match=complaint),
        attached(network, "controlboardwrapper2", "fakeMotionControl", configuration, "(GENERAL (Joints 3))"),
    ):
        pass
    assert not remote.exists(network, Contact("/robot/arm/state:o"))


def test_without_a_master_it_cannot_be_attached(network: Network, monkeypatch: pytest.MonkeyPatch):
    """And says which."""
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    group = GROUP.format("true", "/t", "/n", "")
    with (
        pytest.raises(DeviceError, match=r"cannot publish on /t: http://127\.0\.0\.1:9 does not answer"),
        attached(
            network, "controlboardwrapper2", "fakeMotionControl", f"(name /robot/arm) {group}", "(GENERAL (Joints 3))"
        ),
    ):
        pass
