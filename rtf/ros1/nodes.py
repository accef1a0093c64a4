"""The nodes of a process: topics and services by the names of YARP's ports, such as ``/chatter+@/talker``.

A node is made when it is named first, and lasts as long as something uses it: two of one name would end each other.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from rtf.ros1.errors import Ros1Error
from rtf.ros1.names import NestedName
from rtf.ros1.node import Node
from rtf.ros1.types import message_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType
    from typing import Self

    from rtf.ros1.publishing import Publisher
    from rtf.ros1.services import ServiceClient
    from rtf.ros1.subscribing import Subscription
    from rtf.ros1.types import MessageType, ServiceType

_lock = threading.Lock()
_nodes: dict[str, Node] = {}
_users: dict[str, int] = {}


@contextmanager
def shared_node(path: str, report: Callable[[str], None] | None = None) -> Iterator[Node]:
    """Use the node of this process with a full name, such as ``/icub/left_arm``. Raises the errors of :class:`Node`.

    ``report`` gets the errors of a node that is made by this call.
    """
    full = f"/{path.strip('/')}"
    with _lock:
        if full not in _nodes:
            namespace, _, name = full.rpartition("/")
            settings: dict[str, Any] = {} if report is None else {"report": report}
            _nodes[full] = Node(name, namespace or "/", **settings)
        _users[full] = _users.get(full, 0) + 1
    try:
        yield _nodes[full]
    finally:
        with _lock:
            _users[full] -= 1
            unused = _nodes.pop(full) if not _users[full] else None
        if unused is not None:
            unused.close()


class Nodes:
    """Topics and services under YARP's names, until it is closed. A name without a node belongs to the node before.

    Categories may be left out; a wrong one raises Ros1Error, as does what the methods of :class:`Node` refuse.
    """

    def __init__(self, report: Callable[[str], None] | None = None) -> None:
        self._report = report
        self._opened = ExitStack()
        self._used: dict[str, Node] = {}

    def publisher(self, name: str, kind: MessageType | None = None, *, latched: bool = False) -> Publisher:
        """Return a publisher, such as of ``/chatter+@/talker``. The type may be in the name: ``~std_msgs/String``."""
        nested = self._nested(name, "+")
        return self._node(nested).publisher(nested.topic, _kind(nested, kind), latched=latched)

    def subscribe(self, name: str, kind: MessageType | None, callback: Callable[[Any], object]) -> Subscription:
        """Have messages passed to a callback, such as those of ``/chatter-@/listener``."""
        nested = self._nested(name, "-")
        typed = _kind(nested, kind) if kind or nested.kind else None
        return self._node(nested).subscribe(nested.topic, typed, callback)

    def serve(self, name: str, service: ServiceType, answer: Callable[[Any], Any]) -> None:
        """Answer the requests of a service, such as ``/beep-1@/server``."""
        nested = self._nested(name, "-1")
        self._node(nested).serve(nested.topic, service, answer)

    def client(self, name: str, service: ServiceType) -> ServiceClient:
        """Return a client, such as ``/beep+1@/caller``."""
        nested = self._nested(name, "+1")
        return self._node(nested).client(nested.topic, service)

    def close(self) -> None:
        """End. Nodes that others use stay."""
        self._used.clear()
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _nested(self, name: str, category: str) -> NestedName:
        nested = NestedName.of(name)
        if nested.category not in ("", category):
            raise Ros1Error(f"{name!r} has the category {nested.category}; here it is {category}, or none")
        return nested

    def _node(self, nested: NestedName) -> Node:
        if not nested.node:
            if not self._used:
                raise Ros1Error(f"{nested.topic} names no node, and there is none before; write {nested.topic}@/node")
            return [*self._used.values()][-1]
        if nested.node not in self._used:
            self._used[nested.node] = self._opened.enter_context(shared_node(nested.node, self._report))
        return self._used[nested.node]


def _kind(nested: NestedName, kind: MessageType | None) -> MessageType:
    if kind is not None:
        return kind
    if not nested.kind:
        raise Ros1Error(f"{nested.topic} has no type; give one, or write it behind the name, as in ~std_msgs/String")
    return message_type(nested.kind)
