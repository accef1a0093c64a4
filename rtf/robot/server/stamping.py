"""The stamps of a stream."""

from __future__ import annotations

from functools import lru_cache

from rtf.bottle.values import INT32_MAX


class Stamping:
    """Gives the messages of a stream their stamps, which count from ``first``; after the greatest count comes 0."""

    def __init__(self, first: int = 0) -> None:
        self._count = first

    def next(self, time: float) -> str:
        """The envelope of the next message; the same text as that of a :class:`~rtf.middleware.types.Stamp`."""
        count = self._count
        self._count = count + 1 if count < INT32_MAX else 0
        return f"{count} {_text(time)}"


@lru_cache(maxsize=16)
def _text(time: float) -> str:
    """The time; many streams tell of the same moment."""
    return f"{time:.15g}"
