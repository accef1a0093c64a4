"""Waiting for a name server that is away for a moment, while it is restarted."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.errors import ConnectError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network

#: How long a name server may be away, s. The fixture ``yarpserver`` sets it for an existing server.
GRACE_VARIABLE = "RTF_NAMESERVER_GRACE"
_LOOK_AGAIN = 0.1


def await_name_server(network: Network, warn: Callable[[str], object]) -> None:
    """Wait until the name server answers, for the grace of the fixture; without the fixture do not wait.

    ``warn`` is called once if it is away. Raises ConnectError if it does not come back.
    """
    grace = float(os.environ.get(GRACE_VARIABLE) or 0.0)
    if not grace:
        return
    deadline, warned = clock.Deadline.after(grace), False
    while True:
        try:
            network.names.query("/root")
        except ConnectError as error:
            if deadline.expired:
                raise
            if not warned:
                warn(f"{error}; the test waits for it, {grace:g} s at most")
                warned = True
            clock.sleep(_LOOK_AGAIN)
        else:
            return
