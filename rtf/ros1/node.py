"""A node of ROS 1: topics, services and parameters at a master, shown to ``rosnode list`` and ``rostopic list``.

Without a setting of the user, all of it stays on this machine: ROS_HOSTNAME or ROS_IP say where other machines find it,
as with ROS 1.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from rtf.ros1 import xml_rpc
from rtf.ros1.contents import Contents
from rtf.ros1.errors import Ros1Error
from rtf.ros1.master import Master, host_of_environment, master_of_environment
from rtf.ros1.names import full_name, node_name
from rtf.ros1.peers import Peers
from rtf.ros1.publishing import Publisher
from rtf.ros1.registration import Registration
from rtf.ros1.services import ServiceClient, ServiceServer
from rtf.ros1.slave import Slave
from rtf.ros1.subscribing import Subscription
from rtf.ros1.tcpros import MAX_MESSAGE

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType
    from typing import Self

    from rtf.ros1.types import MessageType, ServiceType

_LOG = logging.getLogger(__name__)


class Node:
    """A node. ``name`` is its own and ``namespace`` begins with ``/``. It lasts until it is closed.

    ``master`` is the address of the master (default: ROS_MASTER_URI), and ``host`` that at which others find this node
    (default: ROS_HOSTNAME, ROS_IP, else loopback). ``report`` gets later errors, such as a master that is
    lost, from any thread. Messages of more than ``limit`` bytes are refused. Raises Ros1Error for names that ROS 1 does
    not take, and MasterError if there is no master.
    """

    def __init__(
        self,
        name: str,
        namespace: str = "/",
        *,
        master: str | None = None,
        host: str | None = None,
        report: Callable[[str], None] = _LOG.warning,
        limit: int = MAX_MESSAGE,
    ) -> None:
        self.name, self.namespace, self._report, self._limit = name, namespace, report, limit
        self.path = node_name(name, namespace)
        self.master = Master(master or master_of_environment(), self.path)
        self._clients: list[ServiceClient] = []
        self._contents = Contents(self.path, self.master, report)
        pid = self.master.pid()
        where = host or host_of_environment()
        try:
            self._peers = Peers(self._contents, where)
        except OSError as error:
            raise Ros1Error(f"{where} is no address of this machine: {error}; see ROS_HOSTNAME") from None
        self._contents.tcpros = where, self._peers.port
        self._server = xml_rpc.Server(where, Slave(self._contents, self.close).answer)
        self._contents.uri = f"http://{where}:{self._server.port}/"
        self._registration = Registration(self._contents, pid)

    def publisher(self, topic: str, kind: MessageType, *, latched: bool = False, depth: int = 10) -> Publisher:
        """Return the publisher of a topic. A subscriber that connects later gets the last message if it is ``latched``.

        Raises Ros1Error for a name that is none, and for a second type of the same topic.
        """
        name = self.full_name(topic)
        with self._contents.lock:
            self._check_open()
            known = self._contents.publishers.get(name)
            if known is None:
                known = Publisher(name, kind, self.path, latched=latched, depth=depth)
                self._contents.publishers[name] = known
        if known.kind.md5sum != kind.md5sum:
            raise Ros1Error(f"{self.path} publishes {name} with {known.kind.name} already, not with {kind.name}")
        self._registration.add("Publisher", name, kind.name)
        return known

    def subscribe(self, topic: str, kind: MessageType | None, callback: Callable[[Any], object]) -> Subscription:
        """Have each message of a topic passed to ``callback``, in a thread of its publisher's connection.

        Without a type it takes any, by the definition that the publisher sends. Raises Ros1Error as above.
        """
        name = self.full_name(topic)
        with self._contents.lock:
            self._check_open()
            known = self._contents.subscriptions.get(name)
            if known is None:
                known = Subscription(name, kind, self.path, self._report, self._limit)
                self._contents.subscriptions[name] = known
        if (known.kind and known.kind.md5sum) != (kind and kind.md5sum):
            raise Ros1Error(f"{self.path} subscribes to {name} with another type already")
        known.add(callback)
        known.connect(self._registration.add("Subscriber", name, kind.name if kind else "*"))
        return known

    def serve(self, name: str, service: ServiceType, answer: Callable[[Any], Any]) -> None:
        """Answer the requests of a service by ``answer``, in a thread for each client. Raises Ros1Error."""
        full = self.full_name(name)
        with self._contents.lock:
            self._check_open()
            if full in self._contents.servers:
                raise Ros1Error(f"{self.path} has the service {full} already")
            self._contents.servers[full] = ServiceServer(full, service, answer, self.path, self._report, self._limit)
        self._registration.add("Service", full, service.name)

    def client(self, name: str, service: ServiceType) -> ServiceClient:
        """Return a client of a service. Raises Ros1Error."""
        client = ServiceClient(self.full_name(name), service, self.master, self.path, self._limit)
        with self._contents.lock:
            self._check_open()
            self._clients.append(client)
        return client

    def parameter(self, name: str, default: Any = None) -> Any:
        """Return a parameter, such as ``/robot_description``, or ``default`` if it is not set. Raises MasterError."""
        full = self.full_name(name)
        return self.master.parameter(full) if self.master.has_parameter(full) else default

    def full_name(self, name: str) -> str:
        """Return a name that begins with ``/``: others are in the namespace, and ``~`` is the node's own.

        Raises Ros1Error for what is no name.
        """
        return full_name(name, self.namespace, self.path)

    def close(self) -> None:
        """Take the node from the master, and end its topics and services. A second call has no effect."""
        with self._contents.lock:
            if self._contents.closed:
                return
            self._contents.closed = True
        self._registration.close()
        self._server.close()
        self._peers.close()
        for publisher in self._contents.publishers.values():
            publisher.close()
        for subscription in self._contents.subscriptions.values():
            subscription.close()
        for client in self._clients:
            client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._contents.closed:
            raise Ros1Error(f"the node {self.path} is closed")
