"""Waiting at the end of a receiver for what has been sent to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from rtf.middleware.ports.port import Port

#: Seconds between two looks, and the looks at which nothing may be left.
_LOOK, _LOOKS = 0.005, 3


def await_quiet(port: Port, deadline: clock.Deadline) -> None:
    """Wait until nothing that was sent to a port is unread: senders by fast_tcp do not wait for that, and may be gone.

    Returns at the deadline, too, as while messages keep coming.
    """
    quiet = 0
    while quiet < _LOOKS and not deadline.expired:
        quiet = quiet + 1 if all(caller.idle for caller in port.inputs) else 0
        clock.sleep(_LOOK)
