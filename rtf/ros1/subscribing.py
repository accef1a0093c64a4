"""Topics that a node reads: a subscription, and a connection to each publisher."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from rtf.errors import RtfError
from rtf.middleware.carriers.stream import StreamClosedError, open_stream
from rtf.middleware.carriers.uncaught import report_uncaught
from rtf.middleware.wire.inbox import CHUNK
from rtf.ros1.errors import MessageError, PeerError
from rtf.ros1.master import call_node
from rtf.ros1.tcpros import encode_header, read_header, read_message
from rtf.ros1.types import Types
from rtf.ros1.xml_rpc import PATIENCE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.middleware.carriers.stream import Stream
    from rtf.ros1.types import MessageType

#: How long after a failure a publisher is tried again, the first time and at most (s).
_SOON, _LATER = 0.1, 5.0


class Subscription:
    """A topic that is read. Each message is passed to all callbacks, in a thread for each publisher.

    ``kind`` is its type; None takes any, by the definition that the publisher sends.
    """

    def __init__(
        self, topic: str, kind: MessageType | None, node: str, report: Callable[[str], None], limit: int
    ) -> None:
        self.topic, self.kind, self.node, self.report, self.limit = topic, kind, node, report, limit
        self._callbacks: list[Callable[[Any], object]] = []
        self._lock = threading.Lock()
        self._closed = False
        self._sources: dict[str, _Source] = {}

    def add(self, callback: Callable[[Any], object]) -> None:
        """Have messages passed to a callback, too."""
        self._callbacks = [*self._callbacks, callback]

    def connect(self, publishers: Iterable[str]) -> None:
        """Connect to the publishers at these addresses, and keep the others."""
        with self._lock:
            self._connect(publishers)

    def _connect(self, publishers: Iterable[str]) -> None:
        for uri in publishers:
            if uri not in self._sources and not self._closed:
                self._sources[uri] = _Source(uri, self)

    def update(self, publishers: Iterable[str]) -> None:
        """Connect to the publishers at these addresses, and to no others."""
        wanted = dict.fromkeys(publishers)
        with self._lock:
            gone = [self._sources.pop(uri) for uri in [*self._sources] if uri not in wanted]
            self._connect(wanted)
        for source in gone:
            source.close()

    @property
    def publishers(self) -> int:
        """The number of connected publishers."""
        return sum(source.connected for source in [*self._sources.values()])

    def close(self) -> None:
        """End all connections, and wait for callbacks to end."""
        self._closed = True
        self.update(())

    def deliver(self, message: Any) -> None:
        """Pass a message to all callbacks. What one of them raises is reported like that of any thread."""
        for callback in self._callbacks:
            try:
                callback(message)
            except Exception as error:  # noqa: BLE001 - the connection goes on
                report_uncaught(error)


class _Source:
    """The connection to a publisher, in a thread of its own. It is made again when it has ended."""

    def __init__(self, uri: str, owner: Subscription) -> None:
        self._uri, self._owner = uri, owner
        self.connected = False
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._stream: Stream | None = None
        self._reported = ""
        self._thread = threading.Thread(target=self._run, name=f"rtf-ros1 {owner.topic}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End. From its own callback, the thread ends after it."""
        self._over.set()
        with self._lock:
            if self._stream is not None:
                self._stream.wake()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        pause = _SOON
        while not self._over.is_set():
            try:
                self._follow()
            except (RtfError, OSError, UnicodeError) as error:
                self._report_once(f"{self._owner.topic} of {self._uri}: {error}")
            pause = _SOON if self.connected else min(2 * pause, _LATER)
            self.connected = False
            self._over.wait(pause)

    def _follow(self) -> None:
        """Connect, and deliver messages until the connection ends."""
        stream = self._connect()
        try:
            kind = self._agree(stream)
            self.connected = True
            self._reported = ""
            self._deliver_all(stream, kind)
        finally:
            with self._lock:
                self._stream = None
            stream.close()

    def _deliver_all(self, stream: Stream, kind: MessageType) -> None:
        """Deliver messages until the publisher closes the connection. Raises PeerError if it is lost within one."""
        while True:
            if not stream.unread:
                try:
                    stream.more(1)
                except StreamClosedError:
                    return
            try:
                data = stream.run(read_message(stream, self._owner.limit))
            except StreamClosedError:
                raise PeerError("the connection was lost within a message") from None
            try:
                message = kind.decode(bytes(data) if len(data) <= CHUNK else data)
            except MessageError as error:
                self._report_once(f"{self._owner.topic} of {self._uri}: {error}")
                continue
            del data  # so that its memory may be used again
            self._owner.deliver(message)

    def _connect(self) -> Stream:
        """Ask the publisher where it is, and connect. Raises MasterError, PeerError, OSError."""
        owner = self._owner
        answer = call_node(self._uri, "requestTopic", owner.node, owner.topic, [["TCPROS"]])
        match answer:
            case ["TCPROS", str(host), int(port)] if 0 < port < 1 << 16:
                stream = open_stream(host, port, PATIENCE, b"")
            case _:
                raise PeerError(f"it offers {answer!r:.100} instead of TCPROS, a host and a port")
        with self._lock:
            self._stream = stream
            if self._over.is_set():
                stream.wake()
        return stream

    def _agree(self, stream: Stream) -> MessageType:
        """Exchange headers, and return the type of the messages. Raises PeerError, DefinitionError."""
        owner = self._owner
        kind = owner.kind
        fields = {
            "callerid": owner.node,
            "md5sum": kind.md5sum if kind else "*",
            "message_definition": kind.definition if kind else "",
            "tcp_nodelay": "1",
            "topic": owner.topic,
            "type": kind.name if kind else "*",
        }
        stream.send_bytes(encode_header(fields))
        header = stream.run(read_header(stream))
        stream.limit_waiting(None)
        if "error" in header:
            raise PeerError(f"it refuses: {header['error'][:300]}")
        if kind is None:
            types = Types(standard=False)
            types.add_full_text(header.get("type", ""), header.get("message_definition", ""))
            return types.message(header.get("type", ""))
        theirs = header.get("md5sum", "*")
        if theirs not in (kind.md5sum, "*"):
            raise PeerError(f"it sends {header.get('type', '')[:80]} ({theirs[:40]}), not {kind.name} ({kind.md5sum})")
        return kind

    def _report_once(self, sentence: str) -> None:
        """Say what is wrong, once until something else is."""
        if sentence != self._reported and not self._over.is_set():
            self._reported = sentence
            self._owner.report(sentence)
