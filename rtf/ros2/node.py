"""A node of ROS 2: publishers and subscriptions on DDS, shown to ``ros2 node list`` and ``ros2 topic list``.

Without a setting of the user, all of it stays on this machine: the variable CYCLONEDDS_URI is theirs, as with ROS 2.
"""

from __future__ import annotations

import itertools
import logging
import os
import re
import threading
import uuid
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from cyclonedds.core import DDSException
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.util import duration

from rtf import clock
from rtf.robot import parameters
from rtf.ros2.domains import open_participant, open_topic
from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import Gid, NodeEntities, ParticipantEntities
from rtf.ros2.readers import Arrival, Changes
from rtf.ros2.services import Ends, ServiceClient, ServiceServer

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType
    from typing import Self

    from cyclonedds.core import Entity, Listener
    from cyclonedds.topic import Topic

    from rtf.bottle import Property
    from rtf.ros2.readers import Source
    from rtf.ros2.service_types import A, Call, Q, Service

M = TypeVar("M", bound=IdlStruct)
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_MOST_DOMAINS = 232
#: Devices of a process have nodes of their own.
_numbers = itertools.count()
_LOG = logging.getLogger(__name__)


def domain_of_environment(given: str | None = None) -> int:
    """Return the domain that ROS_DOMAIN_ID names, or has been ``given``, or 0. Raises Ros2Error."""
    text = given or os.environ.get("ROS_DOMAIN_ID", "0")
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

    def __init__(self, writer: DataWriter[M], changed: threading.Event) -> None:
        self._writer, self._changed = writer, changed

    def publish(self, message: M) -> None:
        """Send a message to all subscriptions. Raises Ros2Error if a reader does not take it within 0.1 s."""
        try:
            self._writer.write(message)
        except DDSException as error:
            raise Ros2Error(f"{self._writer.topic.name} cannot be written: {error}") from None

    def await_reader(self, timeout: float) -> bool:
        """Wait until anybody has subscribed to the topic; False if nobody does within ``timeout`` s."""
        deadline = clock.Deadline.after(timeout)
        while not self._writer.get_matched_subscriptions():
            if not self._changed.wait(deadline.remaining()):
                return False
            self._changed.clear()
        return True

    @property
    def entity(self) -> Entity:
        """The entity of DDS."""
        return self._writer


class Node:
    """A node. ``name`` is its own and ``namespace`` begins with ``/``. It lasts until it is closed.

    ``report`` is called with a sentence about a message or a request that could not be handled; by default they are
    logged. Raises Ros2Error for names that ROS 2 does not take, and if the DDS cannot be opened.
    """

    def __init__(
        self,
        name: str,
        namespace: str = "/",
        *,
        domain: int | None = None,
        report: Callable[[str], None] = _LOG.warning,
    ) -> None:
        if not _NAME.fullmatch(f"/{name}") or "/" in name:
            raise Ros2Error(f"{name!r} is no name of a node: letters, digits and '_'")
        if namespace != "/" and not _NAME.fullmatch(namespace):
            raise Ros2Error(f"{namespace!r} is no namespace; write it as in /robot")
        self.name, self.namespace, self._report = name, namespace, report
        self.domain = domain_of_environment() if domain is None else domain
        self._lock = threading.Lock()
        self._closed = False
        self._writers: list[Entity] = []
        self._readers: list[Entity] = []
        self._listeners: list[Listener] = []  # the library frees them while they may still be called
        self._services: list[ServiceServer[Any, Any] | ServiceClient[Any, Any]] = []
        try:
            self._participant = open_participant(self.domain)
            graph = open_topic(self._participant, self.domain, "ros_discovery_info", ParticipantEntities)
            self._graph = DataWriter(self._participant, graph, qos=default_qos(depth=1, latched=True))
        except DDSException as error:
            raise Ros2Error(f"the DDS of domain {self.domain} cannot be opened: {error}") from None
        self._publish_entities()

    def publisher(self, topic: str, kind: type[M], qos: Qos | None = None) -> Publisher[M]:
        """Return a publisher. Raises Ros2Error for a name that is none."""
        listener = Changes(changed := threading.Event())
        writer = DataWriter(
            self._participant, self._topic("rt", topic, kind), qos=qos or default_qos(), listener=listener
        )
        self._add([writer], [], listener)
        return Publisher(writer, changed)

    def subscribe(self, topic: str, kind: type[M], callback: Callable[[M], object], qos: Qos | None = None) -> None:
        """Have each message of a topic passed to ``callback``, in a thread of the DDS. Raises Ros2Error."""
        self.listen(topic, kind, lambda message, _: callback(message), qos)

    def listen(
        self, topic: str, kind: type[M], callback: Callable[[M, Source], object], qos: Qos | None = None
    ) -> None:
        """Do the same, with the source of each message."""
        arrival = Arrival(callback, self._report)
        reader = DataReader(
            self._participant, self._topic("rt", topic, kind), qos=qos or default_qos(), listener=arrival
        )
        self._add([], [reader], arrival)
        arrival.begin(reader)

    def serve(self, name: str, service: Service[Q, A], answer: Callable[[Q], A]) -> None:
        """Answer the requests of a service by ``answer``, in a thread of the service. Raises Ros2Error."""
        ends = self._ends(name, "serviceid", reads=service.request, writes=service.response)
        self._services.append(ServiceServer(self.full_name(name), ends, answer, self._report))

    def client(self, name: str, service: Service[Q, A]) -> ServiceClient[Q, A]:
        """Return a client of a service. Raises Ros2Error."""
        ends = self._ends(name, "clientid", reads=service.response, writes=service.request)
        client: ServiceClient[Q, A] = ServiceClient(self.full_name(name), ends, self._report)
        self._services.append(client)
        return client

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
            services, self._services = self._services, []
        for service in services:
            service.close()
        self._publish_entities(gone=True)
        for entity in (*entities, self._graph, self._participant):
            entity.set_listener(None)
            entity.__del__()  # the only way to end it while it is referred to; children come before parents
        self._listeners.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _topic(self, prefix: str, name: str, kind: type[M], suffix: str = "") -> Topic[M]:
        return open_topic(self._participant, self.domain, f"{prefix}{self.full_name(name)}{suffix}", kind)

    def _ends(self, name: str, role: str, *, reads: type[Call], writes: type[Call]) -> Ends:
        """Open the two topics of a service; ``role`` is the word of its identifier in the user data."""
        topics = {"serviceid": ("rq", "Request", "rr", "Reply"), "clientid": ("rr", "Reply", "rq", "Request")}[role]
        incoming = self._topic(topics[0], name, reads, topics[1])
        outgoing = self._topic(topics[2], name, writes, topics[3])
        identifier = ".".join(f"{byte:x}" for byte in uuid.uuid4().bytes)
        qos = Qos(Policy.Userdata(f"{role}={identifier};".encode()), base=default_qos())
        listener = Changes(changed := threading.Event())
        writer = DataWriter(self._participant, outgoing, qos=qos, listener=listener)
        ends = Ends(writer, DataReader(self._participant, incoming, qos=qos, listener=listener), changed)
        self._add([ends.writer], [ends.reader], listener)
        return ends

    def _add(self, writers: list[Entity], readers: list[Entity], listener: Listener) -> None:
        with self._lock:
            self._listeners.append(listener)
            self._writers += writers
            self._readers += readers
        self._publish_entities()

    def _publish_entities(self, *, gone: bool = False) -> None:
        """Publish what the node has."""
        with self._lock:
            node = NodeEntities(self.namespace, self.name, [*map(_gid, self._readers)], [*map(_gid, self._writers)])
            self._graph.write(ParticipantEntities(_gid(self._participant), [] if gone else [node]))


def make_node(configuration: Property, name: str, report: Callable[[str], None]) -> Node:
    """Return the node of a device, by its parameters ``namespace`` and ``domain``. Raises Ros2Error."""
    domain = configuration.get("domain")
    if domain is not None and not isinstance(domain, int):
        raise Ros2Error(f"domain: {domain!r} is no number")
    unique = f"{name}_{os.getpid()}_{next(_numbers)}"
    return Node(unique, parameters.text(configuration, "namespace", "/"), domain=domain, report=report)


def _gid(entity: Entity) -> Gid:
    return Gid([*entity.guid.bytes])
