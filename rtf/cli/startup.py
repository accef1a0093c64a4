"""What the commands set before they import anything else of RTF."""

from __future__ import annotations

import atexit
import gc


def collect_rarely() -> None:
    """Look for garbage less often, and not at the end.

    Imports make many objects and hardly any garbage: looking for it took a sixth of ``--help``.
    """
    gc.set_threshold(20_000)
    atexit.register(gc.freeze)
