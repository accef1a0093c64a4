"""A wire between a browser and a server that can be cut and fixed, as those of a lab are."""

from __future__ import annotations

import contextlib
import socket
import threading


class Wire:
    """Carries connections to a port of this machine, until it is cut: then they break, and new ones do, too.

    What the browser calls the server by is changed on the way, for the server answers to its own name only.
    """

    def __init__(self, port: int) -> None:
        self._port = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self._whole = True
        self.port = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def cut(self) -> None:
        """Break every connection; from now on each new one breaks at once."""
        with self._lock:
            self._whole = False
            broken, self._open = self._open, set()
        for end in broken:
            _break(end)

    def restore(self) -> None:
        """Carry connections again."""
        with self._lock:
            self._whole = True

    def close(self) -> None:
        """Cut it for good."""
        self.cut()
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            with self._lock:
                if not self._whole:
                    near.close()
                    continue
                far = socket.create_connection(("127.0.0.1", self._port))
                self._open |= {near, far}
            names = (f"127.0.0.1:{self.port}".encode(), f"127.0.0.1:{self._port}".encode())
            for source, sink, change in ((near, far, names), (far, near, None)):
                threading.Thread(target=self._carry, args=(source, sink, change), daemon=True).start()

    def _carry(self, source: socket.socket, sink: socket.socket, change: tuple[bytes, bytes] | None) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(1 << 16):
                sink.sendall(data.replace(*change) if change else data)
        with self._lock:
            self._open -= {source, sink}
        for end in (source, sink):
            _break(end)


def _break(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()
