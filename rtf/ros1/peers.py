"""The connections that others make to a node: each is given to the topic or the service that it names."""

from __future__ import annotations

import contextlib
import socket
import threading
from typing import TYPE_CHECKING

from rtf.middleware.carriers.socket_watcher import SHARED_LISTENER
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.network import listen
from rtf.ros1.errors import PeerError
from rtf.ros1.tcpros import encode_header, read_header

if TYPE_CHECKING:
    from rtf.ros1.contents import Contents

#: How long a peer may take for its header (s).
_PATIENCE = 5.0


class Peers:
    """Accepts connections at a host, on any free port, until it is closed. Raises OSError if it is not this machine."""

    def __init__(self, contents: Contents, host: str) -> None:
        self._contents = contents
        self._listening = listen(host, 0)
        self.port = int(self._listening.getsockname()[1])
        self._lock = threading.Lock()
        self._streams: set[Stream] = set()
        SHARED_LISTENER.add(self._listening, self._take)

    @property
    def connected(self) -> int:
        """The number of connections that are served here: of clients, and of those whose header is awaited."""
        return len(self._streams)

    def close(self) -> None:
        """Accept no more, and end the connections."""
        SHARED_LISTENER.remove(self._listening)
        with self._lock:
            streams = [*self._streams]
        for stream in streams:
            stream.wake()

    def _take(self, connected: socket.socket) -> None:
        """Serve a connection in a thread of its own."""
        stream = Stream(connected)
        with self._lock:
            self._streams.add(stream)
        threading.Thread(target=self._serve, args=(stream,), name="rtf-ros1-peer", daemon=True).start()

    def _serve(self, stream: Stream) -> None:
        kept = False
        try:
            stream.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            stream.limit_waiting(_PATIENCE)
            kept = self._accept(stream.run(read_header(stream)), stream)
        except PeerError as error:
            self._contents.report(f"{self._contents.path}: a connection from {_name(stream)}: {error}")
            with contextlib.suppress(MiddlewareError):  # it has gone
                stream.send_bytes(encode_header({"error": str(error)}))
        except (MiddlewareError, OSError):
            pass  # it has gone
        finally:
            with self._lock:
                self._streams.discard(stream)
            if not kept:
                stream.close()

    def _accept(self, header: dict[str, str], stream: Stream) -> bool:
        """Give a connection to its topic or service; return whether that keeps it."""
        with self._contents.lock:
            publisher = self._contents.publishers.get(header.get("topic", ""))
            server = self._contents.servers.get(header.get("service", ""))
        if publisher is not None:
            publisher.accept(header, stream)
            return True
        if server is None:
            wanted = header.get("topic") or header.get("service") or "nothing"
            raise PeerError(
                f"{header.get('callerid', 'a peer')} wants {wanted[:80]}, which {self._contents.path} has not"
            )
        server.accept(header, stream)
        return False


def _name(stream: Stream) -> str:
    """Return the address of a peer, for messages."""
    try:
        host, port = stream.socket.getpeername()[:2]
    except OSError:
        return "somebody who has gone"
    return f"{host}:{port}"
