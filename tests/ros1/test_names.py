"""Names: those of ROS, and those of YARP's ports for topics."""

from __future__ import annotations

import pytest

from rtf.ros1.errors import Ros1Error
from rtf.ros1.names import NestedName, full_name, node_name


def test_names_are_resolved_as_ros_does():
    """In the namespace, below the node, or as they are."""
    assert [full_name(name, "/lab", "/lab/talker") for name in ("a", "/a", "~a", "b/c")] == [
        "/lab/a",
        "/a",
        "/lab/talker/a",
        "/lab/b/c",
    ]
    assert full_name("a", "/", "/talker") == "/a"
    assert node_name("talker", "/") == "/talker"


@pytest.mark.parametrize("name", ["", "a b", "/a//b", "a/", "1a", "~", "/a\n"])
def test_what_is_no_name_is_refused(name: str):
    """With the name."""
    with pytest.raises(Ros1Error, match="is no name"):
        full_name(name, "/lab", "/lab/talker")


@pytest.mark.parametrize(("name", "namespace"), [("a/b", "/"), ("1", "/"), ("", "/"), ("a", "lab"), ("a", "/lab/")])
def test_names_of_nodes_are_checked(name: str, namespace: str):
    """As for ROS 2."""
    with pytest.raises(Ros1Error, match="is no name"):
        node_name(name, namespace)


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("/chatter@/talker", ("/chatter", "", "/talker", "")),
        ("/chatter+@/talker", ("/chatter", "+", "/talker", "")),
        ("/chatter-@/listener~std_msgs/String", ("/chatter", "-", "/listener", "std_msgs/String")),
        ("/add-1@/server", ("/add", "-1", "/server", "")),
        ("/add+1@", ("/add", "+1", "", "")),
        ("/talker=+/chatter", ("/chatter", "+", "/talker", "")),
        ("/talker=/chatter", ("/chatter", "", "/talker", "")),
        ("/talker-#/chatter", ("/chatter", "-", "/talker", "")),
    ],
)
def test_names_of_yarp_are_read(name: str, parts: tuple[str, str, str, str]):
    """In all of its forms."""
    found = NestedName.of(name)
    assert (found.topic, found.category, found.node, found.kind) == parts


@pytest.mark.parametrize("name", ["/chatter", "@/talker", "/a b@/n", "/a@/b@/c", ""])
def test_what_has_no_topic_is_refused(name: str):
    """With an example."""
    with pytest.raises(Ros1Error, match="is no name of a topic; write it as in"):
        NestedName.of(name)
