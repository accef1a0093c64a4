"""The group ``ROS`` of a server's configuration, as servers of YARP had it until 3.9: its data also goes to a topic.

``useROS`` is true, false or only (then the server has no ports); ``ROS_topicName`` and ``ROS_nodeName`` name the topic
and its node, ``jointNames`` and ``frame_id`` what is in its messages. A device of another type publishes, which the
server makes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Property, as_string
from rtf.robot import parameters

if TYPE_CHECKING:
    from rtf.bottle import Bottle

_USES = {"true": True, "1": True, "yes": True, "only": True, "false": False, "0": False, "no": False}


@dataclass(frozen=True, slots=True)
class RosGroup:
    """What a group asks for: ``alone`` without the server's own ports, and the configuration of the other device."""

    alone: bool
    configuration: Property


def read_ros_group(configuration: Property, period: float, message_type: str) -> RosGroup | None:
    """Return what the group ``ROS`` asks for; None without one. ``message_type`` is what the server's data is.

    Raises ConfigurationError for what is missing or wrong, also if ``message_type`` is empty: there is no topic for it.
    """
    group: Bottle | None = configuration.find_group("ROS")
    if group is None:
        return None
    found = parameters.group_of(configuration, "ROS")
    use = as_string(found.get("useROS", "false")).lower()
    if use not in _USES:
        raise parameters.wrong(found, "useROS", f"{use!r} is none of true, false and only")
    if not _USES[use]:
        return None
    asked = as_string(found.get("ROS_msgType", message_type))
    if not message_type or asked != message_type:
        known = message_type or "nothing"
        raise parameters.wrong(found, "ROS_msgType", f"this server publishes {known}, not {asked or 'its data'}")
    settings = Property({"period": period})
    for key, ours in (("ROS_nodeName", "node_name"), ("ROS_topicName", "topic_name")):
        if not found.check(key):
            raise parameters.wrong(found, key, "it is missing")
        settings.put(ours, found.find(key))
    for key in ("jointNames", "frame_id"):
        if found.check(key):
            settings.put(key, found.find(key))
    return RosGroup(use == "only", settings)
