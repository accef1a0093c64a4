"""What a node has registered with its master, and registers again when the master was lost."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.ros1.errors import MasterError

if TYPE_CHECKING:
    from rtf.ros1.contents import Contents

#: How often the master is asked whether it is still the same one (s).
_PERIOD = 1.0


class Registration:
    """Registers publishers, subscribers and services of a node, in order, and again at each new master."""

    def __init__(self, contents: Contents, pid: int) -> None:
        """``pid`` is the number of the master's process."""
        self._contents = contents
        self._pid = pid
        self._entries: dict[tuple[str, str], str] = {}
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._lost = False
        self._thread = threading.Thread(target=self._watch, name="rtf-ros1-master", daemon=True)
        self._thread.start()

    def add(self, what: str, name: str, kind: str) -> list[str]:
        """Register a ``Publisher``, ``Subscriber`` or ``Service``; return the publishers for a subscriber.

        Raises MasterError, also when the node was closed.
        """
        with self._lock:
            if self._over.is_set():
                raise MasterError(f"the node {self._contents.path} is closed")
            found = self._register(what, name, kind)
            self._entries[what, name] = kind
        return found

    def close(self) -> None:
        """Take everything from the master. One that is lost has nothing."""
        self._over.set()
        if self._thread is not threading.current_thread():
            self._thread.join()
        with self._lock:
            entries, self._entries = self._entries, {}
            try:
                for what, name in entries:
                    at = self._service() if what == "Service" else self._contents.uri
                    self._contents.master.call(f"unregister{what}", name, at)
            except MasterError as error:
                if not self._lost:
                    self._contents.report(f"{self._contents.path} could not leave its master: {error}")

    def _service(self) -> str:
        host, port = self._contents.tcpros
        return f"rosrpc://{host}:{port}"

    def _register(self, what: str, name: str, kind: str) -> list[str]:
        master = self._contents.master
        if what == "Service":
            master.call("registerService", name, self._service(), self._contents.uri)
            return []
        found = master.call(f"register{what}", name, kind, self._contents.uri)
        return [str(uri) for uri in found] if what == "Subscriber" and isinstance(found, list) else []

    def _watch(self) -> None:
        while not self._over.wait(_PERIOD):
            try:
                pid = self._contents.master.pid()
                if pid != self._pid or self._lost:
                    self._register_all()
                    self._pid = pid
                if self._lost:
                    self._lost = False
                    self._contents.report(f"the master of {self._contents.path} is back")
            except MasterError as error:
                if not self._lost:
                    self._lost = True
                    self._contents.report(f"the master of {self._contents.path} is lost: {error}")

    def _register_all(self) -> None:
        with self._lock:
            found = [(name, self._register(what, name, kind)) for (what, name), kind in self._entries.items()]
        for name, publishers in found:
            subscription = self._contents.subscription(name)
            if subscription is not None:
                subscription.connect(publishers)
