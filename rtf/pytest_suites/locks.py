"""One worker at a time for each fixture, where pytest-xdist spreads tests that need the same one over several workers.

A suite's fixtures are locked while they are up. Each worker has at most one suite up, and locks in one order, so no
two can wait for each other; and the kernel unlocks what a worker that died had locked. One file serves all workers
of a session: each fixture is a byte of it, by a hash of what it is, and so is each plug-in.

Two fixtures are two as with ``testrunner -j`` (:mod:`rtf.testing.dispatch`): one without a ``param`` has its plug-in
for itself, and those with one share it.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.testing.dispatch import Use

#: Bytes of the hash: an offset in a file fits into 63 bits.
_HASHED = 7


def lock_file(session: str) -> Path:
    """Return the lock file by which the workers of a session share fixtures; its name cannot be guessed."""
    return Path(tempfile.gettempdir()) / f"rtf-fixtures-{session}.lock"


class FixtureLocks:
    """The locks that one worker holds."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1
        self._held: list[int] = []

    def acquire(self, uses: Iterable[Use]) -> None:
        """Wait until no other worker has one of a suite's fixtures up. A signal's exception ends the wait."""
        locks = sorted(locks_of(uses).items())
        if locks and self._descriptor < 0:
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            self._descriptor = os.open(self._path, flags, 0o600)
        try:
            for offset, kind in locks:
                self._held.append(offset)  # first: what is not locked may be unlocked
                fcntl.lockf(self._descriptor, kind, 1, offset)
        except BaseException:  # what waits for a part of them has none
            self.release()
            raise

    def release(self) -> None:
        """Release the locks."""
        while self._held:
            fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, self._held.pop())

    def close(self) -> None:
        """Close the lock file, which releases every lock."""
        self._held.clear()
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def locks_of(uses: Iterable[Use]) -> dict[int, int]:
    """Return the locks of fixtures by their offsets in the file: exclusive ones, and those shared by other params."""
    locks: dict[int, int] = {}
    for thing, param in uses:
        place = _offset(thing)
        alone = not param or locks.get(place) == fcntl.LOCK_EX
        locks[place] = fcntl.LOCK_EX if alone else fcntl.LOCK_SH
        if param:
            locks[_offset(f"{thing}\0{param}")] = fcntl.LOCK_EX
    return locks


def _offset(what: str) -> int:
    return int.from_bytes(blake2b(what.encode(), digest_size=_HASHED).digest())
