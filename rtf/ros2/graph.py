"""What there is in a domain: nodes by name, and topics with their types, publishers and subscriptions."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import DDSException, InstanceState
from cyclonedds.sub import DataReader

from rtf.ros2.domains import open_participant, open_topic
from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import ParticipantEntities
from rtf.ros2.node import default_qos
from rtf.ros2.readers import taken

if TYPE_CHECKING:
    from collections.abc import Callable

    from cyclonedds.builtin import DcpsEndpoint
_MOST = 1000
_PREFIX = "rt/"


@dataclass(slots=True)
class TopicInfo:
    """The ends of a topic: how many publish and read it, and the types, of which there should be one."""

    publishers: int = 0
    subscriptions: int = 0
    types: set[str] = field(default_factory=set)


class Graph:
    """Looks at a domain, without a node of its own, until it is closed. Used by one thread.

    What a participant had is gone when its lease is over, at most 10 s after it was killed. Raises Ros2Error.
    """

    def __init__(self, domain: int, *, report: Callable[[str], None]) -> None:
        self._report = report
        try:
            participant = self._participant = open_participant(domain)
            self._nodes = DataReader(
                participant,
                open_topic(participant, domain, "ros_discovery_info", ParticipantEntities),
                qos=default_qos(depth=10, latched=True),
            )
            self._alive = BuiltinDataReader(participant, BuiltinTopicDcpsParticipant)
            self._writers = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
            self._readers = BuiltinDataReader(participant, BuiltinTopicDcpsSubscription)
        except DDSException as error:
            raise Ros2Error(f"the DDS of domain {domain} cannot be opened: {error}") from None
        self._known: dict[bytes, ParticipantEntities] = {}

    def nodes(self) -> Counter[str]:
        """Return the full names of all nodes; a name may be there several times."""
        for message in taken(self._nodes, self._report):
            self._known[bytes(message.gid.data)] = message
        alive = {one.key.bytes for one in _living(self._alive)}
        self._known = {gid: message for gid, message in self._known.items() if gid in alive}
        return Counter(
            f"{node.node_namespace.rstrip('/')}/{node.node_name}"
            for message in self._known.values()
            for node in message.node_entities_info_seq
        )

    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics by their names in ROS; those of services are not among them."""
        found: dict[str, TopicInfo] = {}
        for writes, source in ((True, self._writers), (False, self._readers)):
            for end in _living(source):
                if end.topic_name.startswith(_PREFIX):
                    info = found.setdefault(end.topic_name.removeprefix("rt"), TopicInfo())
                    info.types.add(end.type_name.replace("::dds_::", "::").replace("::", "/").removesuffix("_"))
                    info.publishers += writes
                    info.subscriptions += not writes
        return found

    def close(self) -> None:
        """Leave the domain."""
        for entity in (self._nodes, self._alive, self._writers, self._readers, self._participant):
            entity.__del__()


def _living(reader: BuiltinDataReader) -> list[DcpsEndpoint]:
    return [one for one in reader.read(N=_MOST) if one.sample_info.instance_state == InstanceState.Alive]
