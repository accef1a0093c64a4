"""Real ROS 1 in other processes: rostopic, rosservice and programs of rospy, both ways."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rtf.ros1.errors import ServiceFailedError
from rtf.ros1.types import Types, message_type
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from ros1.conftest import Ros

    from rtf.ros1.node import Node

STATE, STRING = message_type("sensor_msgs/JointState"), message_type("std_msgs/String")
#: A service whose class Debian's packages of ROS have.
SET_CAMERA = "sensor_msgs/CameraInfo camera_info\n---\nbool success\nstring status_message\n"
#: A program that answers each joint state with its names, and serves.
ROSPY = """
import rospy
from sensor_msgs.msg import JointState
from sensor_msgs.srv import SetCameraInfo, SetCameraInfoResponse
from std_msgs.msg import String
rospy.init_node("peer")
answers = rospy.Publisher("answers", String, queue_size=10)
rospy.Subscriber("states", JointState, lambda state: answers.publish(",".join(state.name)))
def answer(request):
    if not request.camera_info.width:
        raise rospy.ServiceException("no width")
    return SetCameraInfoResponse(True, "width %d" % request.camera_info.width)
rospy.Service("set_camera", SetCameraInfo, answer)
print("ready", flush=True)
rospy.spin()
"""
#: A program that calls a service, and prints what it answers.
CALLER = """
import rospy
from sensor_msgs.srv import SetCameraInfo
client = rospy.ServiceProxy("/lab/set_camera", SetCameraInfo, persistent=True)
for width in (3, 4):
    request = SetCameraInfo._request_class()
    request.camera_info.width = width
    print(client.call(request).status_message)
try:
    client.call(SetCameraInfo._request_class())
except rospy.ServiceException as error:
    print(error)
"""


#: A program with other types for two topics.
WRONG = """
import rospy
from std_msgs.msg import Int32
rospy.init_node("wrong")
rospy.Publisher("theirs", Int32, queue_size=1)
rospy.Subscriber("ours", Int32, lambda _: None)
print("ready", flush=True)
rospy.spin()
"""


def set_camera() -> Any:
    """The type of the service."""
    types = Types()
    types.add_service("sensor_msgs/SetCameraInfo", SET_CAMERA)
    return types.service("sensor_msgs/SetCameraInfo")


def test_topics_go_to_rospy_and_back(ros: Ros, node: Callable[..., Node]):
    """And its services, with their errors."""
    here = node("here")
    got: list[str] = []
    here.subscribe("answers", STRING, lambda answer: got.append(answer.data))
    states = here.publisher("states", STATE)
    kind = set_camera()
    with ros.running("/usr/bin/python3", "-c", ROSPY) as peer:
        assert peer.stdout is not None
        assert peer.stdout.readline() == "ready\n"

        def answered() -> bool:
            states.publish(STATE(name=["elbow", "knee"], position=[0.5, -0.5]))
            return "elbow,knee" in got

        eventually(answered, "no answer came")
        client = here.client("set_camera", kind)
        assert client.call(kind.request(message_type("sensor_msgs/CameraInfo")(width=9))).status_message == "width 9"
        with pytest.raises(ServiceFailedError, match="no width"):
            client.call()
        loggers = Types()
        loggers.add_message("roscpp/Logger", "string name\nstring level\n")
        loggers.add_service("roscpp/GetLoggers", "---\nLogger[] loggers\n")
        found = here.client("/peer/get_loggers", loggers.service("roscpp/GetLoggers")).call()
        assert "rosout" in [one.name for one in found.loggers]


def test_a_program_with_other_types_is_reported(ros: Ros, node: Callable[..., Node], said: list[str]):
    """On both sides; who has the right one gets the messages."""
    here, got = node("here"), list[str]()
    ours = here.publisher("ours", STRING)
    here.subscribe("theirs", STRING, lambda _: None)
    here.subscribe("ours", STRING, lambda message: got.append(message.data))
    with ros.running("/usr/bin/python3", "-c", WRONG):
        eventually(lambda: len({one.partition(":")[0] for one in said}) == 2, f"it was not reported: {said}")
        ours.publish(STRING("right"))
        eventually(lambda: got == ["right"], "nothing came")
    reported = "\n".join(said)
    assert "/wrong wants /ours with md5sum 'da5909fbe378aeaf85e547e830cc1bb7'; /here has" in reported
    assert "it refuses: " in reported


def test_rostopic_shows_ours(ros: Ros, node: Callable[..., Node]):
    """``list``, ``echo`` and ``hz``."""
    here = node("here", "/lab")
    states = here.publisher("states", STATE, latched=True)
    states.publish(STATE(name=["elbow"], position=[0.5]))
    listed = ros.run("rostopic", "list", "-v")
    assert " * /lab/states [sensor_msgs/JointState] 1 publisher" in listed
    echoed = ros.run("rostopic", "echo", "-n", "1", "/lab/states")
    assert 'name:\n  - "elbow"\nposition: [0.5]' in echoed.replace("name: \n", "name:\n").replace(
        "- elbow", '- "elbow"'
    )
    with ros.running("rostopic", "hz", "/lab/states") as hz:
        assert hz.stdout is not None
        eventually(lambda: states.publish(STATE()) or states.subscribers, "it does not subscribe")
        for line in hz.stdout:
            states.publish(STATE())
            if "average rate" in line:
                break


def test_rostopic_publishes_to_ours(ros: Ros, node: Callable[..., Node], said: list[str]):
    """``pub``, which ends: that is not reported."""
    got: list[str] = []
    node("here", "/lab").subscribe("chatter", STRING, lambda message: got.append(message.data))
    ros.run("rostopic", "pub", "-1", "/lab/chatter", "std_msgs/String", "data: from rostopic")
    eventually(lambda: got, "nothing came")
    assert (got, said) == (["from rostopic"], [])


def test_services_are_called_by_ros(ros: Ros, node: Callable[..., Node]):
    """By ``rosservice``, which finds their types, and by a program."""
    kind = set_camera()

    def answer(request: Any) -> Any:
        if not request.camera_info.width:
            raise ValueError("no width")
        return kind.response(True, f"width {request.camera_info.width}")

    node("here", "/lab").serve("set_camera", kind, answer)
    assert ros.run("rosservice", "type", "/lab/set_camera") == "sensor_msgs/SetCameraInfo\n"
    called = ros.run("rosservice", "call", "/lab/set_camera", "{camera_info: {width: 7}}")
    assert "width 7" in called
    printed = ros.run("/usr/bin/python3", "-c", CALLER)
    assert printed.splitlines()[:2] == ["width 3", "width 4"]
    assert "no width" in printed.splitlines()[2]


def test_parameters_are_those_of_rosparam(ros: Ros, node: Callable[..., Node]):
    """As launch files set them."""
    ros.run("rosparam", "set", "/robot_description", "<robot/>")
    assert node("here").parameter("/robot_description") == "<robot/>"
