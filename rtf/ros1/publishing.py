"""Topics that a node writes: a publisher, and the connections of its subscribers."""

from __future__ import annotations

import threading
from collections import deque
from socket import MSG_DONTWAIT
from typing import TYPE_CHECKING, Any

from rtf.middleware.carriers.socket_watcher import SocketWatcher
from rtf.middleware.errors import MiddlewareError, WaitTimeoutError
from rtf.ros1.errors import PeerError
from rtf.ros1.tcpros import encode_header, frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.carriers.stream import Stream
    from rtf.ros1.types import MessageType

#: Notices that subscribers have gone.
_WATCHER = SocketWatcher("rtf-ros1-subscribers")


class Publisher:
    """A topic that is written. All methods may be called from any thread."""

    def __init__(self, topic: str, kind: MessageType, node: str, *, latched: bool, depth: int) -> None:
        self.topic, self.kind, self.latched = topic, kind, latched
        self._node, self._depth = node, depth
        self._lock = threading.Lock()
        self._outlets: list[_Outlet] = []
        self._last: bytes | None = None
        self._closed = False

    def publish(self, message: Any) -> None:
        """Send a message to all subscribers. Raises MessageError for one that is none.

        It never waits: for a subscriber that does not read, the last messages are kept, as many as the depth is.
        """
        data = frame(self.kind.encode(message))
        with self._lock:
            if self.latched:
                self._last = data
            outlets = self._outlets
        for outlet in outlets:
            outlet.offer(data)

    @property
    def subscribers(self) -> int:
        """The number of connected subscribers."""
        return len(self._outlets)

    def accept(self, header: dict[str, str], stream: Stream) -> None:
        """Take the connection of a subscriber whose header has been read. Raises PeerError and MiddlewareError."""
        self._check(header)
        fields = {
            "callerid": self._node,
            "latching": str(int(self.latched)),
            "md5sum": self.kind.md5sum,
            "message_definition": self.kind.definition,
            "topic": self.topic,
            "type": self.kind.name,
        }
        stream.send_bytes(encode_header(fields))
        stream.limit_waiting(None)
        outlet = _Outlet(stream, self._depth, self._forget)
        with self._lock:
            if self._closed:
                raise PeerError(f"{self._node} has closed {self.topic}")
            self._outlets = [*self._outlets, outlet]
            last = self._last
            outlet.start()
            if last is not None:
                outlet.offer(last)

    def close(self) -> None:
        """End all connections."""
        with self._lock:
            self._closed = True
            outlets, self._outlets = self._outlets, []
        for outlet in outlets:
            outlet.close()

    def _check(self, header: dict[str, str]) -> None:
        for key, ours in (("md5sum", self.kind.md5sum), ("type", self.kind.name)):
            theirs = header.get(key, "")
            if theirs not in (ours, "*"):
                who = header.get("callerid", "a subscriber")
                raise PeerError(f"{who} wants {self.topic} with {key} {theirs[:80]!r}; {self._node} has {ours}")

    def _forget(self, outlet: _Outlet) -> None:
        with self._lock:
            self._outlets = [one for one in self._outlets if one is not outlet]


class _Outlet:
    """The connection of a subscriber. What it does not take at once is sent by a thread."""

    def __init__(self, stream: Stream, depth: int, gone: Callable[[_Outlet], None]) -> None:
        self._stream, self._depth, self._gone = stream, depth, gone
        self._changed = threading.Condition()
        self._rest: memoryview | None = None  # of the message that is being sent
        self._waiting: deque[bytes] = deque(maxlen=depth)
        self._thread: threading.Thread | None = None
        self._closed = False

    def start(self) -> None:
        """Begin to watch whether the subscriber is still there."""
        _WATCHER.add(self._stream.socket, self._readable)

    def offer(self, data: bytes) -> None:
        """Send a message; if another one is being sent, keep it until then."""
        with self._changed:
            if self._closed:
                return
            if self._rest is not None:
                self._waiting.append(data)
                return
            try:
                sent = self._stream.socket.send(data, MSG_DONTWAIT)
            except BlockingIOError:
                sent = 0
            except OSError:
                return  # it has gone; the watcher notices
            if sent < len(data):
                self._rest = memoryview(data)[sent:]
                self._send_later()

    def close(self) -> None:
        """End the connection. A second call has no effect."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._changed.notify_all()
            thread = self._thread
        _WATCHER.remove(self._stream.socket)
        self._stream.wake()
        if thread is not None:
            thread.join()
        self._stream.close()

    def _send_later(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="rtf-ros1-sender", daemon=True)
            self._thread.start()
        self._changed.notify_all()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._rest is not None or self._closed)
                rest = self._rest
            if rest is None or self._closed:
                return
            try:
                self._stream.send_bytes(rest)
            except MiddlewareError:
                return  # it has gone; the watcher notices
            with self._changed:
                self._rest = memoryview(self._waiting.popleft()) if self._waiting else None

    def _readable(self) -> None:
        """A subscriber sends nothing: the connection has ended. What it sends all the same is discarded."""
        try:
            self._stream.start = self._stream.end
            self._stream.more(1, MSG_DONTWAIT)
        except WaitTimeoutError:
            return
        except MiddlewareError:
            self._gone(self)
            self.close()
