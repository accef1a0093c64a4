"""Nodes: topics between processes over real DDS, and the graph that ROS 2's tools read."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import psutil
import pytest
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from hypothesis import given
from hypothesis import strategies as st

from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import Header, Image, JointState, ParticipantEntities, String, Time, ros_type
from rtf.ros2.node import Node, default_qos, domain_of_environment
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

#: A program that answers each joint state with its name.
ECHO = """
import sys, threading
from rtf.ros2.messages import JointState, String
from rtf.ros2.node import Node
end = threading.Event()
with Node("echo", domain=int(sys.argv[1])) as node:
    answers = node.publisher("answers", String)
    node.subscribe("joint_states", JointState, lambda state: answers.publish(String(",".join(state.name))))
    node.subscribe("end", String, lambda _: end.set())
    print("ready", flush=True)
    end.wait(60)
"""


def test_messages_go_to_another_process_and_back(node: Callable[..., Node], domain: int):
    """By reliable topics of ROS's types."""
    here = node("here")
    got: list[str] = []
    here.subscribe("answers", String, lambda answer: got.append(answer.data))
    states, end = here.publisher("joint_states", JointState), here.publisher("end", String)
    with subprocess.Popen([sys.executable, "-c", ECHO, str(domain)], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"ready\n"

        def answered() -> bool:
            states.publish(JointState(Header(Time(1, 5), "base"), ["elbow", "knee"], [0.5, -0.5], [], []))
            return "elbow,knee" in got

        eventually(answered, "no answer came")
        end.publish(String("over"))
        assert other.wait(20) == 0


def test_the_graph_names_nodes_and_what_they_have(node: Callable[..., Node], domain: int):
    """As ``ros2 node list`` and ``ros2 topic list`` read it; a closed node is gone."""
    one = node("talker", "/lab")
    participant = DomainParticipant(domain)
    topic = Topic(participant, "ros_discovery_info", ParticipantEntities)
    reader = DataReader(participant, topic, qos=default_qos(depth=10, latched=True))
    writer = one.publisher("chatter", String)
    known: dict[bytes, ParticipantEntities] = {}

    def found() -> list[tuple[str, str, list[bytes]]]:
        for message in reader.take(N=50):
            if isinstance(message, ParticipantEntities):
                known[bytes(message.gid.data)] = message
        return [
            (info.node_namespace, info.node_name, [bytes(gid.data) for gid in info.writer_gid_seq])
            for message in known.values()
            for info in message.node_entities_info_seq
        ]

    eventually(lambda: ("/lab", "talker", [writer.entity.guid.bytes]) in found(), "the node is not in the graph")
    one.close()
    eventually(lambda: not any(name == "talker" for _, name, _ in found()), "the node is still in the graph")


def test_nothing_is_open_off_the_machine(node: Callable[..., Node]):
    """All sockets of the DDS are those of loopback."""
    node("local").publisher("chatter", String)
    opened = [one.laddr.ip for one in psutil.Process().net_connections("udp") if one.laddr]
    assert opened
    assert {ip for ip in opened if ip not in ("127.0.0.1", "0.0.0.0", "::")} == set()


@pytest.mark.parametrize(("name", "namespace"), [("a/b", "/"), ("1", "/"), ("", "/"), ("a", "lab"), ("a", "/lab/")])
def test_names_of_nodes_are_checked(domain: int, name: str, namespace: str):
    """As ROS 2 does."""
    with pytest.raises(Ros2Error, match="is no name"):
        Node(name, namespace, domain=domain)


def test_names_of_topics(node: Callable[..., Node]):
    """A relative one is in the namespace."""
    one = node("one", "/lab")
    assert [one.full_name("states"), one.full_name("/states"), one.full_name("a/b")] == [
        "/lab/states",
        "/states",
        "/lab/a/b",
    ]
    for wrong in ("", "a b", "/a//b", "a/", "1a"):
        with pytest.raises(Ros2Error, match="no name of a topic"):
            one.full_name(wrong)


def test_the_domain_is_that_of_the_environment(monkeypatch: pytest.MonkeyPatch):
    """A wrong one is reported."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert domain_of_environment() == 7
    for wrong in ("x", "233", "-1"):
        monkeypatch.setenv("ROS_DOMAIN_ID", wrong)
        with pytest.raises(Ros2Error, match="ROS_DOMAIN_ID is a number from 0 to 232"):
            domain_of_environment()


@given(seconds=st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_any_time_fits(seconds: float):
    """Seconds are whole, and a billion nanoseconds are a second."""
    time = Time.of(seconds)
    assert -(2**31) <= time.sec < 2**31
    assert 0 <= time.nanosec < 10**9
    if abs(seconds) < 1e9:
        assert time.seconds == pytest.approx(seconds, abs=1e-6)


@given(
    names=st.lists(st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=8), max_size=4),
    numbers=st.lists(st.floats(allow_nan=False), max_size=6),
    data=st.binary(max_size=20),
)
def test_what_is_written_is_read(names: list[str], numbers: list[float], data: bytes):
    """In the encoding of ROS 2, little-endian CDR."""
    state = JointState(Header(Time(1, 2), "x"), names, numbers, numbers, [])
    written = state.serialize(use_version_2=False)
    assert written[:4] == b"\0\1\0\0"
    assert JointState.deserialize(written) == state
    image = Image(height=1, width=len(data), data=data)
    written = image.serialize(use_version_2=False)
    assert bytes(Image.deserialize(written).data) == data
    assert written == Image(height=1, width=len(data), data=[*data]).serialize(use_version_2=False)


def test_types_have_the_names_of_ros():
    """For people, and on the wire."""
    assert ros_type(JointState) == "sensor_msgs/msg/JointState"
    assert JointState.__idl_typename__ == "sensor_msgs.msg.dds_.JointState_"
