"""HTTP connections with bounds: on how many there are, how long a request takes to arrive, and how long one may stall.

uvicorn's protocol bounds the size of a request; what it leaves open is time, which a client that says one word a minute
would take for ever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

if TYPE_CHECKING:
    import asyncio

#: Requests beyond this number of connections are refused, and connections beyond twice the number not taken.
MAX_CONNECTIONS = 512
#: What a request line and its headers may amount to, in bytes.
MAX_REQUEST_HEAD = 16 << 10
#: Seconds after which a connection is looked at again, and looks after which one ends that brings no request, or takes
#: nothing of its answer.
LOOK = 2.0
IDLE_LOOKS = 2
STALLED_LOOKS = 30
#: Seconds in which a new connection is expected to ask for something; browsers also open some for later.
FRESH = 0.5


class BoundedProtocol(H11Protocol):
    """One connection."""

    def __init__(self, *arguments: Any, **options: Any) -> None:  # what uvicorn hands over is its own business
        super().__init__(*arguments, **options)
        self._timer: asyncio.TimerHandle | None = None
        self._looks = 0
        self._made = self.loop.time()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, unless there are too many."""
        super().connection_made(transport)
        if len(self.connections) > 2 * MAX_CONNECTIONS:
            transport.abort()
            return
        self._timer = self.loop.call_later(LOOK, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone."""
        if self._timer is not None:
            self._timer.cancel()
        super().connection_lost(exc)

    def resume_writing(self) -> None:
        """The client takes what it is sent."""
        self._looks = 0
        super().resume_writing()

    @property
    def _last(self) -> RequestResponseCycle | None:
        """The last request and its answer; none before the first."""
        return self.cycle

    @property
    def answering(self) -> bool:
        """Whether a request has come that is not answered yet."""
        return self._last is not None and not self._last.response_complete

    @property
    def at_rest(self) -> bool:
        """Whether nothing is owed to it: all it asked for was answered, or it came a while ago and asks for nothing."""
        return not self.answering and (self._last is not None or self.loop.time() > self._made + FRESH)

    def _look(self) -> None:
        self._timer = self.loop.call_later(LOOK, self._look)
        if self.answering and not self.flow.write_paused:
            self._looks = 0
            return
        self._looks += 1
        if self._looks >= (STALLED_LOOKS if self.answering else IDLE_LOOKS):
            self.transport.abort()
