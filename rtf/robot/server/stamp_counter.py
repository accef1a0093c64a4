"""The numbering of the messages of a stream."""

from __future__ import annotations

from functools import lru_cache

from rtf.bottle.values import INT32_MAX


class StampCounter:
    """Generates the stamps of a stream, counting from ``first``; the count after the maximum is 0."""

    def __init__(self, first: int = 0) -> None:
        self._count = first

    def next(self, time: float) -> str:
        """Return the envelope of the next message, the text of a :class:`~rtf.middleware.types.Stamp`."""
        count = self._count
        self._count = count + 1 if count < INT32_MAX else 0
        return f"{count} {_text(time)}"


@lru_cache(maxsize=16)
def _text(time: float) -> str:
    """Return the text of a time; cached, as many streams have the same."""
    return f"{time:.15g}"
