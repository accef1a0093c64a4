"""Recording of topics of ROS 2: every message with its stamp, arrival time, size and a digest, as of a port."""

from __future__ import annotations

import math
import zlib
from typing import TYPE_CHECKING

from rtf.clock import Deadline, SystemClock
from rtf.robot_testing.streams.message import Message
from rtf.ros2 import messages
from rtf.ros2.cdr import Message as RosMessage
from rtf.ros2.errors import Ros2Error
from rtf.ros2.graph import Graph
from rtf.ros2.messages import ros_type
from rtf.ros2.node import Node, domain_of_environment

if TYPE_CHECKING:
    from collections.abc import Callable

#: The types that can be recorded, by their names in ROS.
_TYPES = {
    ros_type(kind): kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and issubclass(kind, RosMessage) and kind is not RosMessage
}
#: Seconds for a topic to be seen, and between two looks.
_PATIENCE, _LOOK = 5.0, 0.05


class TopicRecorder:
    """Recorder of one topic until it is closed; ``now`` returns the arrival time.

    Raises Ros2Error if nobody publishes the topic, or its type is not one of :mod:`rtf.ros2.messages`.
    """

    def __init__(self, topic: str, *, now: Callable[[], float], report: Callable[[str], None]) -> None:
        self.messages: list[Message] = []
        self.problems: list[str] = []
        self._now = now
        domain = domain_of_environment()
        kind = _type_of(topic, domain, report)
        self._node = Node("rtf_recorder", domain=domain, report=self.problems.append)
        self._node.subscribe(topic, kind, self._take)

    def _take(self, message: RosMessage) -> None:
        data = message.serialize()
        header = getattr(message, "header", None)
        stamp = math.nan if header is None else header.stamp.seconds
        self.messages.append(Message(-1, stamp, self._now(), len(data), zlib.crc32(data), None))

    def close(self) -> None:
        """Leave the topic."""
        self._node.close()


def _type_of(topic: str, domain: int, report: Callable[[str], None]) -> type[RosMessage]:
    """Return the class of the messages of a topic, as its publishers declare them."""
    graph, deadline = Graph(domain, report=report), Deadline.after(_PATIENCE)
    try:
        while True:
            info = graph.topics().get(topic)
            if info is not None and info.publishers:
                break
            if deadline.expired:
                raise Ros2Error(f"nobody publishes {topic} in the domain {domain}; ros2 topic list shows what there is")
            SystemClock().sleep(_LOOK)
    finally:
        graph.close()
    known = [_TYPES[name] for name in sorted(info.types) if name in _TYPES]
    if not known:
        raise Ros2Error(f"{topic} has the type {', '.join(info.types)}; those that are known are {', '.join(_TYPES)}")
    return known[0]
