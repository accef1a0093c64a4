"""HTTP connections with limits: on their number, on the duration of a request, and on stalls of a client.

uvicorn's protocol limits the size of a request, but not its duration: a client that sends one byte a minute would hold
its connection for ever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

if TYPE_CHECKING:
    import asyncio

#: Requests beyond this number of connections are refused; connections beyond twice this number are closed.
MAX_CONNECTIONS = 512
#: The greatest size of a request line with its headers, in bytes.
MAX_REQUEST_HEAD = 16 << 10
#: Seconds between two checks of a connection, and the number of checks after which one without a request, or with a
#: stalled response, is closed.
LOOK = 2.0
IDLE_LOOKS = 2
STALLED_LOOKS = 30
#: Seconds within which a new connection is expected to send a request; browsers also open some for later.
FRESH = 0.5


class BoundedProtocol(H11Protocol):
    """A connection."""

    def __init__(self, *arguments: Any, **options: Any) -> None:  # the arguments are uvicorn's
        super().__init__(*arguments, **options)
        self._timer: asyncio.TimerHandle | None = None
        self._looks = 0
        self._made = self.loop.time()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection, unless there are too many."""
        super().connection_made(transport)
        if len(self.connections) > 2 * MAX_CONNECTIONS:
            transport.abort()
            return
        self._timer = self.loop.call_later(LOOK, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the checks."""
        if self._timer is not None:
            self._timer.cancel()
        super().connection_lost(exc)

    def resume_writing(self) -> None:
        """Note that the client reads its response."""
        self._looks = 0
        super().resume_writing()

    @property
    def _last(self) -> RequestResponseCycle | None:
        """The last request and its response; none before the first."""
        return self.cycle

    @property
    def answering(self) -> bool:
        """Whether a request is not answered yet."""
        return self._last is not None and not self._last.response_complete

    @property
    def at_rest(self) -> bool:
        """Whether all requests are answered, or none came for a while."""
        return not self.answering and (self._last is not None or self.loop.time() > self._made + FRESH)

    def _look(self) -> None:
        self._timer = self.loop.call_later(LOOK, self._look)
        if self.answering and not self.flow.write_paused:
            self._looks = 0
            return
        self._looks += 1
        if self._looks >= (STALLED_LOOKS if self.answering else IDLE_LOOKS):
            self.transport.abort()
