"""One worker at a time for each fixture, where pytest-xdist spreads tests that need the same one over several workers.

A suite's fixtures are locked while they are up. Each worker has at most one suite up, and locks in one order, so no
two can wait for each other; and the kernel unlocks what a worker that died had locked. One file serves all workers
of a session: each fixture is a byte of it, by a hash of what it is.
"""

from __future__ import annotations

import fcntl
import os
from hashlib import blake2b
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from rtf.testing.suite.model import TestSuite

#: Bytes of the hash: an offset in a file fits into 63 bits.
_HASHED = 7


class FixtureLocks:
    """The locks that one worker holds."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1
        self._held: list[int] = []

    def acquire(self, suite: TestSuite) -> None:
        """Wait until no other worker has one of this suite's fixtures up. A signal's exception ends the wait."""
        offsets = sorted(_offsets(suite))
        if offsets and self._descriptor < 0:
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            self._descriptor = os.open(self._path, flags, 0o600)
        for offset in offsets:
            fcntl.lockf(self._descriptor, fcntl.LOCK_EX, 1, offset)
            self._held.append(offset)

    def release(self) -> None:
        """Let the others go on."""
        while self._held:
            fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, self._held.pop())

    def close(self) -> None:
        """Let go of the file, and so of every lock."""
        self._held.clear()
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _offsets(suite: TestSuite) -> Iterable[int]:
    for entry in suite.fixtures:
        what = f"{entry.plugin}\0{entry.param}".encode()
        yield int.from_bytes(blake2b(what, digest_size=_HASHED).digest())
