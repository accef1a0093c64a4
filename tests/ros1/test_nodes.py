"""Topics and services by the names of YARP's ports, and nodes that are shared."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rtf.ros1.errors import Ros1Error
from rtf.ros1.master import Master
from rtf.ros1.messages import TRIGGER, String
from rtf.ros1.nodes import Nodes, shared_node
from waiting import eventually

if TYPE_CHECKING:
    from ros1.conftest import Ros


@pytest.fixture(autouse=True)
def at_the_master(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment of a program."""
    monkeypatch.setenv("ROS_MASTER_URI", ros.uri)
    monkeypatch.setenv("ROS_IP", "127.0.0.1")


def nodes_of(ros: Ros) -> set[str]:
    """The nodes that the master knows."""
    return {node for part in Master(ros.uri, "/tests").call("getSystemState") for _, nodes in part for node in nodes}


def test_topics_and_services_have_the_names_of_ports(ros: Ros):
    """A node is made when it is named first; without one it is that of before."""
    got: list[Any] = []
    with Nodes() as nodes:
        nodes.subscribe("/chatter-@/lab/listener", None, got.append)
        chatter = nodes.publisher("/chatter+@/talker~std_msgs/String", latched=True)
        chatter.publish(String("hello"))
        nodes.serve("/beep-1@", TRIGGER, lambda _: TRIGGER.response(message="beep"))
        assert nodes.client("/lab/listener=+1/beep", TRIGGER).call().message == "beep"
        eventually(lambda: got, "nothing came")
        assert nodes_of(ros) == {"/lab/listener", "/talker"}
        assert ["/beep", ["/talker"]] in Master(ros.uri, "/tests").call("getSystemState")[2]
    assert nodes_of(ros) == set()


def test_wrong_names_are_reported():
    """What is missing, and how it is written."""
    with Nodes() as nodes:
        with pytest.raises(Ros1Error, match=r"has the category -; here it is \+, or none"):
            nodes.publisher("/chatter-@/talker", String)
        with pytest.raises(Ros1Error, match="/chatter names no node, and there is none before; write /chatter@/node"):
            nodes.publisher("/chatter@", String)
        with pytest.raises(Ros1Error, match="/chatter has no type"):
            nodes.publisher("/chatter@/talker")


def test_a_shared_node_lasts_as_long_as_it_is_used(ros: Ros):
    """By devices of one process that have the same node."""
    with shared_node("/lab/robot") as one:
        with shared_node("lab/robot") as other:
            assert one is other
            other.publisher("states", String)
        assert nodes_of(ros) == {"/lab/robot"}
    assert nodes_of(ros) == set()
