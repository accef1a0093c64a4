"""A node of ROS 2: publishers and subscriptions on DDS, shown to ``ros2 node list`` and ``ros2 topic list``.

Without a setting of the user, all of it stays on this machine: the variable CYCLONEDDS_URI is theirs, as with ROS 2.
"""

from __future__ import annotations

import os
import re
import threading
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from cyclonedds.core import DDSException, Listener
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import Gid, NodeEntities, ParticipantEntities

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType
    from typing import Self

    from cyclonedds.core import Entity

M = TypeVar("M", bound=IdlStruct)
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
#: The setting without one of the user: the interface of loopback, and no multicast.
_LOOPBACK = """\
<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
_MOST_DOMAINS = 232
#: Domains of this process that have the setting; it is made once, and lives as long as the process.
_domains: dict[int, Domain] = {}
_domains_lock = threading.Lock()


def domain_of_environment() -> int:
    """Return the domain that ROS_DOMAIN_ID names, or 0. Raises Ros2Error."""
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    if not text.isdecimal() or int(text) > _MOST_DOMAINS:
        raise Ros2Error(f"ROS_DOMAIN_ID is a number from 0 to {_MOST_DOMAINS}, not {text!r}")
    return int(text)


def default_qos(*, depth: int = 10, latched: bool = False) -> Qos:
    """Return the quality of service of ROS 2: reliable, the last ``depth`` messages; ``latched`` is transient local."""
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class Publisher(Generic[M]):
    """A topic that is written. ``publish`` may be called from any thread."""

    def __init__(self, writer: DataWriter[M]) -> None:
        self._writer = writer

    def publish(self, message: M) -> None:
        """Send a message to all subscriptions. Raises Ros2Error if a reader does not take it within 0.1 s."""
        try:
            self._writer.write(message)
        except DDSException as error:
            raise Ros2Error(f"{self._writer.topic.name} cannot be written: {error}") from None

    @property
    def entity(self) -> Entity:
        """The entity of DDS."""
        return self._writer


class _Arrival(Listener):
    """Calls back with each message that has arrived, in a thread of the DDS."""

    def __init__(self, callback: Callable[[Any], object]) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._callback = callback

    def on_data_available(self, reader: DataReader[Any]) -> None:
        for message in reader.take(N=100):
            if isinstance(message, IdlStruct):  # not the end of a writer
                self._callback(message)


class Node:
    """A node. ``name`` is its own and ``namespace`` begins with ``/``. It lasts until it is closed.

    Raises Ros2Error for names that ROS 2 does not take, and if the DDS cannot be opened.
    """

    def __init__(self, name: str, namespace: str = "/", *, domain: int | None = None) -> None:
        if not _NAME.fullmatch(f"/{name}") or "/" in name:
            raise Ros2Error(f"{name!r} is no name of a node: letters, digits and '_'")
        if namespace != "/" and not _NAME.fullmatch(namespace):
            raise Ros2Error(f"{namespace!r} is no namespace; write it as in /robot")
        self.name, self.namespace = name, namespace
        self.domain = domain_of_environment() if domain is None else domain
        self._lock = threading.Lock()
        self._closed = False
        self._writers: list[Entity] = []
        self._readers: list[Entity] = []
        try:
            _restrict(self.domain)
            self._participant = DomainParticipant(self.domain)
            graph: Topic[ParticipantEntities] = Topic(self._participant, "ros_discovery_info", ParticipantEntities)
            self._graph = DataWriter(self._participant, graph, qos=default_qos(depth=1, latched=True))
        except DDSException as error:
            raise Ros2Error(f"the DDS of domain {self.domain} cannot be opened: {error}") from None
        self._tell()

    def publisher(self, topic: str, kind: type[M], qos: Qos | None = None) -> Publisher[M]:
        """Return a publisher. Raises Ros2Error for a name that is none."""
        writer = DataWriter(self._participant, self._topic(topic, kind), qos=qos or default_qos())
        with self._lock:
            self._writers.append(writer)
        self._tell()
        return Publisher(writer)

    def subscribe(self, topic: str, kind: type[M], callback: Callable[[M], object], qos: Qos | None = None) -> None:
        """Have each message of a topic passed to ``callback``, in a thread of the DDS. Raises Ros2Error."""
        reader = DataReader(
            self._participant, self._topic(topic, kind), qos=qos or default_qos(), listener=_Arrival(callback)
        )
        with self._lock:
            self._readers.append(reader)
        self._tell()

    def full_name(self, topic: str) -> str:
        """Return the name of a topic; one that does not begin with ``/`` is in the namespace. Raises Ros2Error."""
        found = topic if topic.startswith("/") else f"{self.namespace.rstrip('/')}/{topic}"
        if not _NAME.fullmatch(found):
            raise Ros2Error(f"{topic!r} is no name of a topic: letters, digits, '_', and '/' between them")
        return found

    def close(self) -> None:
        """Take the node out of the graph, and end its topics. A second call has no effect."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            entities, self._writers, self._readers = [*self._writers, *self._readers], [], []
        self._tell(gone=True)
        for entity in entities:
            entity.set_listener(None)
        del entities, self._participant, self._graph  # which ends them

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _topic(self, name: str, kind: type[M]) -> Topic[M]:
        return Topic(self._participant, f"rt{self.full_name(name)}", kind)

    def _tell(self, *, gone: bool = False) -> None:
        """Publish what the node has."""
        with self._lock:
            node = NodeEntities(self.namespace, self.name, [*map(_gid, self._readers)], [*map(_gid, self._writers)])
            self._graph.write(ParticipantEntities(_gid(self._participant), [] if gone else [node]))


def _gid(entity: Entity) -> Gid:
    return Gid([*entity.guid.bytes])


def _restrict(domain: int) -> None:
    """Keep a domain of this process on the machine, unless the user has a setting of their own."""
    with _domains_lock:
        if "CYCLONEDDS_URI" not in os.environ and domain not in _domains:
            _domains[domain] = Domain(domain, _LOOPBACK)
