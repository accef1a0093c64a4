"""The pools from which a name server assigns port numbers, names of anonymous ports, and multicast groups.

A port number is remembered for the name that had it last, so that a program finds its ports where they were. Numbers
that were never used are assigned first; after the last one the search starts again at the first that is free. Released
names and groups are reused at once.
"""

from __future__ import annotations

from collections import Counter, deque

from rtf.middleware.errors import ConnectError

_HIGHEST = 65535
_FIRST = 2
_LAST = 9999
_STANDARD = 10000
_GROUPS = 255 * 255
_SPREAD = 61


class Numbers:
    """The pool of TCP port numbers of a network, for all of its machines together."""

    def __init__(self, first: int, last: int) -> None:
        self.first = first
        self.last = last
        self.cursor = first
        self.owner: dict[int, str] = {}  # the name that had a number last
        self._preferred: dict[str, int] = {}
        self._held: Counter[int] = Counter()

    @classmethod
    def above(cls, server: int) -> Numbers:
        """Return the pool of a server at this port number; near the end of the range, that of a server at 10000."""
        base = server if server + _LAST <= _HIGHEST else _STANDARD
        return cls(base + _FIRST, base + _LAST)

    @classmethod
    def beside(cls, server: int) -> Numbers:
        """Return the pool of a server whose port number the system chose: those above it belong to the system.

        It is that of a server at 10000, starting at an offset that differs from server to server.
        """
        numbers = cls.above(_STANDARD)
        numbers.cursor += server % (_LAST // 2)
        return numbers

    def hold(self, number: int) -> None:
        """Mark a number as used by a registered port, even if the pool did not assign it."""
        self._held[number] += 1

    def release(self, number: int) -> None:
        """Mark a number as no longer used by a port."""
        self._held[number] -= 1
        if self._held[number] <= 0:
            del self._held[number]

    def take(self, name: str) -> int:
        """Return a number for a name, without marking it as used. Raises ConnectError if all are used."""
        number = self._preferred.get(name, 0)
        if not number or number in self._held:
            number = self._next()
            self.remember(number, name)
        return number

    def remember(self, number: int, name: str) -> None:
        """Record that this name had the number last."""
        before = self.owner.get(number)
        if before is not None and self._preferred.get(before) == number:
            del self._preferred[before]
        self.owner[number] = name
        self._preferred[name] = number

    def _next(self) -> int:
        for _ in range(self.first, self.last + 1):
            number = self.cursor
            self.cursor = number + 1 if number < self.last else self.first
            if number not in self._held:
                return number
        raise ConnectError(
            f"all port numbers from {self.first} to {self.last} are in use:"
            " unregister ports that are gone with 'rtf clean'"
        )


class Slots:
    """A pool of small numbers from 1 upwards, each in use at most once."""

    def __init__(self, highest: int, last: int = 0) -> None:
        self.highest = highest
        self.last = last
        self._free: deque[int] = deque()

    def take(self) -> int:
        """Return a free number. Raises ConnectError if there is none."""
        if self._free:
            return self._free.popleft()
        if self.last >= self.highest:
            raise ConnectError(f"all {self.highest} are in use: unregister ports that are gone with 'rtf clean'")
        self.last += 1
        return self.last

    def give_back(self, slot: int) -> None:
        """Release a number."""
        self._free.append(slot)

    def resume(self, last: int, used: set[int]) -> None:
        """Restore the state of an earlier server."""
        first = self.last + 1
        self.last = min(max(last, self.last, *used), self.highest)
        self._free = deque(slot for slot in range(first, self.last + 1) if slot not in used)


def nameless(slot: int) -> str:
    """Return the name of an anonymous port."""
    return f"/tmp/port/{slot}"  # noqa: S108 - a name in a network, not in a file system


def group_slots(seed: int = 0) -> Slots:
    """Return the pool of all multicast groups.

    A service without a fixed port number on this machine gives a ``seed``, so that two services do not assign the same
    groups.
    """
    return Slots(_GROUPS - 2, seed * _SPREAD % (_GROUPS // 2))


def group(slot: int) -> str:
    """Return the address of a multicast group; the first is 224.1.1.3."""
    high, low = divmod(slot + 1, 255)
    return f"224.1.{high + 1}.{low + 1}"
