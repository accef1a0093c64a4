"""Services: what answers requests, and what makes them."""

from __future__ import annotations

import threading
from socket import MSG_DONTWAIT, MSG_PEEK
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from rtf import clock
from rtf.middleware.carriers.stream import open_stream
from rtf.middleware.errors import MiddlewareError, WaitTimeoutError
from rtf.ros1.errors import MasterError, NoServiceError, PeerError, Ros1Error, ServiceFailedError
from rtf.ros1.tcpros import encode_header, encode_response, frame, read_header, read_message, read_response

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.carriers.stream import Stream
    from rtf.ros1.master import Master
    from rtf.ros1.types import ServiceType


class ServiceServer:
    """Answers requests, in a thread for each client, one request of a client after the other."""

    def __init__(
        self,
        name: str,
        service: ServiceType,
        answer: Callable[[Any], Any],
        node: str,
        report: Callable[[str], None],
        limit: int,
    ) -> None:
        self.name, self.service = name, service
        self._answer, self._node, self._report, self._limit = answer, node, report, limit

    def accept(self, header: dict[str, str], stream: Stream) -> None:
        """Serve a client whose header has been read, in this thread. Raises MiddlewareError when it goes, PeerError."""
        theirs = header.get("md5sum", "")
        if theirs not in (self.service.md5sum, "*"):
            who = header.get("callerid", "a client")
            raise PeerError(
                f"{who} calls {self.name} with md5sum {theirs[:80]!r}; {self._node} has {self.service.md5sum}"
            )
        fields = {
            "callerid": self._node,
            "md5sum": self.service.md5sum,
            "request_type": self.service.request.name,
            "response_type": self.service.response.name,
            "service": self.name,
            "type": self.service.name,
        }
        stream.send_bytes(encode_header(fields))
        if header.get("probe") == "1":
            return
        stream.limit_waiting(None)
        persistent = header.get("persistent") in ("1", "true")
        while True:
            data = bytes(stream.run(read_message(stream, self._limit)))
            stream.send_bytes(self._respond(data))
            if not persistent:
                return

    def _respond(self, data: bytes) -> bytes:
        try:
            response = self._answer(self.service.request.decode(data))
            return encode_response(True, self.service.response.encode(response))
        except Exception as error:  # noqa: BLE001 - whatever it is, the client gets it, and the server goes on
            self._report(f"the service {self.name} could not answer: {type(error).__name__}: {error}")
            return encode_response(False, f"{type(error).__name__}: {error}".encode())


class ServiceClient:
    """Calls a service. It may be used by any thread; calls are made one after the other, on one connection."""

    def __init__(self, name: str, service: ServiceType, master: Master, node: str, limit: int) -> None:
        self.name, self.service = name, service
        self._master, self._node, self._limit = master, node, limit
        self._calling = threading.Lock()
        self._stream: Stream | None = None
        self._closed = False

    def call(self, request: Any = None, timeout: float = 5.0) -> Any:
        """Return the response to a request; None is an empty one.

        Raises NoServiceError if there is no such service or no response within ``timeout`` s, ServiceFailedError if
        it answers that it failed, PeerError and MessageError.
        """
        body = frame(self.service.request.encode(self.service.request() if request is None else request))
        with self._calling:
            stream = self._connected(timeout)
            try:
                succeeded, data = self._exchange(stream, body, clock.Deadline.after(timeout))
            except WaitTimeoutError:
                self._drop()
                raise NoServiceError(f"the service {self.name} did not answer in {timeout:g} s") from None
            except MiddlewareError as error:
                self._drop()
                raise PeerError(f"the service {self.name} was lost while it was called: {error}") from None
            except PeerError:
                self._drop()
                raise
        if not succeeded:
            raise ServiceFailedError(f"the service {self.name} failed: {data.decode(errors='replace')[:1000]}")
        return self.service.response.decode(data)

    def close(self) -> None:
        """End the connection; a call that waits fails."""
        self._closed = True
        stream = self._stream
        if stream is not None:
            stream.wake()
        with self._calling:
            self._drop()

    def _exchange(self, stream: Stream, body: bytes, deadline: clock.Deadline) -> tuple[bool, bytes]:
        stream.limit_waiting(max(deadline.remaining(), 0.001))
        stream.send_bytes(body)
        return stream.run(read_response(stream, self._limit))

    def _connected(self, timeout: float) -> Stream:
        """Return the connection, a new one if there is none that is still open."""
        if self._closed:
            raise Ros1Error(f"the node of the client of {self.name} was closed")
        if self._stream is not None and not _is_over(self._stream):
            return self._stream
        self._drop()
        try:
            uri = str(self._master.call("lookupService", self.name))
        except MasterError as error:
            raise NoServiceError(f"there is no service {self.name}; is its node running? {error}") from None
        try:
            parts = urlsplit(uri)
            self._stream = open_stream(parts.hostname or "", parts.port or 0, timeout, b"")
        except (OSError, ValueError) as error:
            raise NoServiceError(f"the service {self.name} at {uri[:200]} cannot be reached: {error}") from None
        try:
            self._agree(self._stream)
        except WaitTimeoutError:
            self._drop()
            raise NoServiceError(f"the service {self.name} did not answer in {timeout:g} s") from None
        except MiddlewareError as error:
            self._drop()
            raise PeerError(f"the service {self.name} at {uri[:200]}: {error}") from None
        except PeerError:
            self._drop()
            raise
        return self._stream

    def _agree(self, stream: Stream) -> None:
        fields = {
            "callerid": self._node,
            "md5sum": self.service.md5sum,
            "persistent": "1",
            "service": self.name,
            "type": self.service.name,
        }
        stream.send_bytes(encode_header(fields))
        header = stream.run(read_header(stream))
        if "error" in header:
            raise PeerError(f"the service {self.name} refuses: {header['error'][:300]}")
        theirs = header.get("md5sum", "*")
        if theirs not in (self.service.md5sum, "*"):
            raise PeerError(f"the service {self.name} has md5sum {theirs[:80]!r}, not {self.service.md5sum}")

    def _drop(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None


def _is_over(stream: Stream) -> bool:
    """Return whether the other end has closed a connection on which nothing is outstanding."""
    try:
        return len(stream.socket.recv(1, MSG_DONTWAIT | MSG_PEEK)) == 0
    except BlockingIOError:
        return False
    except OSError:
        return True
