"""What a node is and has: its names, addresses, topics and services. What serves others reads it."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.ros1.master import Master
    from rtf.ros1.publishing import Publisher
    from rtf.ros1.services import ServiceServer
    from rtf.ros1.subscribing import Subscription


class Contents:
    """A node for its own parts. The tables are changed with the ``lock`` held, and only while it is not ``closed``."""

    def __init__(self, path: str, master: Master, report: Callable[[str], None]) -> None:
        self.path, self.master, self.report = path, master, report
        #: Host and port of its topics and services, and the address of what it answers to other nodes.
        self.tcpros = "", 0
        self.uri = ""
        self.lock = threading.RLock()
        self.closed = False
        self.publishers: dict[str, Publisher] = {}
        self.subscriptions: dict[str, Subscription] = {}
        self.servers: dict[str, ServiceServer] = {}

    def subscription(self, topic: str) -> Subscription | None:
        """Return the subscription to a topic; None if there is none, or no more."""
        with self.lock:
            return None if self.closed else self.subscriptions.get(topic)

    def published(self) -> list[list[str]]:
        """Return the topics that are published, with their types."""
        with self.lock:
            return [[name, one.kind.name] for name, one in self.publishers.items()]

    def subscribed(self) -> list[list[str]]:
        """Return the topics that are subscribed to, with their types."""
        with self.lock:
            return [[name, one.kind.name if one.kind else "*"] for name, one in self.subscriptions.items()]
