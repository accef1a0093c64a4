"""What a port shows of itself in a browser: its connections, and the last message in each direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.wire.page import MAX_SHOWN, LastMessage, Link, Page, Section, text_of, too_long

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.outgoing_message import OutgoingMessage


class LastMessages:
    """The last message in each direction; of a received one only the beginning is kept."""

    def __init__(self) -> None:
        self.written: OutgoingMessage | None = None
        self._received: tuple[Input, bytes, int] | None = None

    def receive(self, caller: Input, data: Buffer) -> None:
        """Keep what has come. Its bytes may be in memory that is reused."""
        size = len(data)
        self._received = caller, bytes(data if size <= MAX_SHOWN else data[:MAX_SHOWN]), size

    def shown(self) -> list[LastMessage]:
        """Return both as text."""
        last = []
        if (written := self.written) is not None:
            text = written.text if written.size <= MAX_SHOWN else too_long(written.size)
            last.append(LastMessage("Last message written", text))
        if (received := self._received) is not None:
            caller, data, size = received
            in_lines = caller.link is not None and caller.link.carrier.text
            text = text_of(data, caller.dialect, in_lines=in_lines) if size <= MAX_SHOWN else too_long(size)
            last.append(LastMessage(f"Last message received, from {caller.sender}", text))
        return last


def page_of(
    last: LastMessages,
    outputs: Iterable[Output],
    inputs: Iterable[Input],
    *,
    promise: str,
    requests: bool,
    pictures: bool,
) -> Page:
    """Return the page of a port: ``promise`` is what it sends, ``requests`` whether it may be asked. Any thread."""
    return Page(
        kind="a port" + (f" of {promise}" if promise else ""),
        sections=[
            Section("Sends to", [Link.to(one.target, f"by {one.carrier}") for one in outputs]),
            Section("Receives from", [Link(one.sender, about=f"by {one.carrier}") for one in inputs if one.announced]),
        ],
        messages=last.shown(),
        accepts_requests=requests,
        pictures=pictures,
    )
