"""How a port that closes has others send no more: it asks each source by administration, all at once, and not for long.

Without it a source would go on until it notices, which is when it writes next, and for datagrams never. Sources that
do not answer are left to find out so.
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.middleware import remote
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.names import Contact

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.middleware.inputs import Input
    from rtf.middleware.network import Network

#: Seconds for all sources together: nobody wants to wait for a port to close.
_PATIENCE = 1.0
#: Sources that are asked at a time.
_AT_ONCE = 8


def ask_to_stop(network: Network, whose: str, callers: Iterable[Input]) -> None:
    """Have those that send to the port ``whose`` disconnect. Returns when they have, or after a second."""
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
    """Not who has no port, nor the port itself; nor who waits for this very thread, and so could not answer."""
    return caller.sender.startswith("/") and caller.sender != whose and caller.carrier != "local" and not caller.is_here


def _ask(network: Network, whose: str, sources: deque[str], deadline: clock.Deadline) -> None:
    while not deadline.expired:
        try:
            source = sources.popleft()
        except IndexError:
            return
        with contextlib.suppress(MiddlewareError):  # the source is gone itself, then
            found = network.resolve(Contact(source))
            if found is not None and not deadline.expired:
                remote.administer(network, found, Bottle([Vocab("del"), whose]), patience=deadline.remaining())
