"""What the workers of a cluster on this machine do first: they leave Ctrl-C to the client, which waits for them."""

from __future__ import annotations

import signal


def dask_setup(worker: object) -> None:  # noqa: ARG001 - Dask calls it so
    """Ignore the interrupt that a terminal sends to all processes of a campaign."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
