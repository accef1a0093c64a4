"""What the programs of the simulator print."""

from __future__ import annotations

import sys
from contextlib import suppress


def say(sentence: str) -> None:
    """Print a line to stderr. A closed stderr is ignored."""
    with suppress(OSError, ValueError):
        sys.stderr.write(f"{sentence}\n")
        sys.stderr.flush()
