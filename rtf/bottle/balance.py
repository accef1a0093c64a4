"""A check whether text is complete: a reader of lines appends lines until quotes, lists and blobs are closed."""

from __future__ import annotations

import re

_MARK = re.compile(r'\\.?|["(){}]', re.DOTALL)
_STEP = {"(": (1, 0), ")": (-1, 0), "{": (0, 1), "}": (0, -1)}


class Balance:
    """Counts open quotes, lists and blobs in text that arrives in pieces.

    A backslash escapes the next character of the same piece.

    As in YARP they are counted, not matched: ``)`` before ``(`` makes the text incomplete until a ``(`` balances it.
    """

    __slots__ = ("_braces", "_lists", "_quoted", "_since", "_size")

    def __init__(self) -> None:
        self._quoted = False
        self._lists = 0
        self._braces = 0
        self._size = 0
        self._since = -1

    @property
    def complete(self) -> bool:
        """Whether nothing is open."""
        return not (self._quoted or self._lists or self._braces)

    @property
    def since(self) -> int:
        """The offset, over all pieces, of the character that made the text incomplete; -1 while it is complete."""
        return self._since

    def feed(self, text: str) -> bool:
        """Process a further piece; return :attr:`complete`."""
        for mark in _MARK.finditer(text):
            character = mark[0]
            if character == '"':
                self._quoted = not self._quoted
            elif not self._quoted and character in _STEP:
                lists, braces = _STEP[character]
                self._lists += lists
                self._braces += braces
            if self._quoted or self._lists or self._braces:
                if self._since < 0:
                    self._since = self._size + mark.start()
            else:
                self._since = -1
        self._size += len(text)
        return self.complete


def is_complete(text: str) -> bool:
    """Return whether every quote, list and blob in ``text`` is closed."""
    return Balance().feed(text)
