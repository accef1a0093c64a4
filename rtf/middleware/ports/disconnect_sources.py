"""Disconnection of the sources of a port that closes, by admin requests, in parallel and for at most a second.

Without it a source would continue until its next write fails, which for datagrams never happens. A source that does not
answer is left to find out by itself.
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.network import Network

#: Seconds for all sources together: closing a port must not take long.
_PATIENCE = 1.0
#: Sources that are contacted in parallel.
_AT_ONCE = 8


def disconnect_sources(network: Network, whose: str, callers: Iterable[Input]) -> None:
    """Ask all ports that send to ``whose`` to disconnect. Return when they have, or after a second."""
    sources = deque(dict.fromkeys(caller.sender for caller in callers if _can_be_asked(caller, whose)))
    deadline = clock.Deadline.after(_PATIENCE)
    threads = [
        threading.Thread(target=_ask, args=(network, whose, sources, deadline), name=f"rtf-leave {whose}", daemon=True)
        for _ in range(min(len(sources), _AT_ONCE))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(deadline.remaining())


def _can_be_asked(caller: Input, whose: str) -> bool:
    """Return whether a source can be asked.

    Excluded are callers without a port, the port itself, ``local`` sources, and a source that waits for the current
    thread and so could not answer; and one that waits for a reply, which it would lose: its connection ends after it.
    """
    if caller.is_here or (caller.answering and not caller.connectionless):
        return False
    return caller.sender.startswith("/") and caller.sender != whose and caller.carrier != "local"


def _ask(network: Network, whose: str, sources: deque[str], deadline: clock.Deadline) -> None:
    while not deadline.expired:
        try:
            source = sources.popleft()
        except IndexError:
            return
        with contextlib.suppress(MiddlewareError):  # the source is gone
            found = network.resolve(Contact(source))
            if found is not None and not deadline.expired:
                remote.administer(network, found, Bottle([Vocab("del"), whose]), patience=deadline.remaining())
