"""Values that no journal, report or page shows: passwords, tokens, keys, and parameters declared ``secret=True``.

A value is secret by the name of what it is given to. In its place stands :data:`MASK`.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

MASK = "***"

_WORDS = frozenset(
    {*("password", "passwd", "passphrase", "passcode", "pwd", "secret", "token", "key", "apikey", "credential")}
)
#: The words of a name: ``apiToken``, ``api_token`` and ``API-TOKEN`` have the same.
_PART = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_GIVEN = re.compile(r"(?P<head>(?:-{1,2}[A-Za-z][\w-]*=)?(?P<name>[A-Za-z][\w.-]*)=)(?P<value>.*)", re.DOTALL)
_OPTION = re.compile(
    r"""(?P<head>(?<![^\s=])--?(?P<name>[A-Za-z][\w.-]*)(?:\s+|=))(?P<value>"[^"]*"|'[^']*'|[^\s-]\S*)"""
)


def is_secret(name: str, declared: Collection[str] = ()) -> bool:
    """Return whether a value with this name is secret: by a word of the name, or because it is ``declared``."""
    words = {part.lower().removesuffix("s") for part in _PART.findall(name)}
    return name in declared or not words.isdisjoint(_WORDS) or "passwd" in name.lower()


def masked_command(words: Iterable[str], declared: Collection[str] = ()) -> tuple[str, ...]:
    """Return the words of a command line without the secret values in ``NAME=VALUE`` and in parameter strings."""
    return tuple(_masked_word(word, declared) for word in words)


def masked_text(text: str, declared: Collection[str] = ()) -> str:
    """Return a parameter string, ``--name value …``, without its secret values."""
    return _OPTION.sub(lambda match: match["head"] + MASK if is_secret(match["name"], declared) else match[0], text)


def _masked_word(word: str, declared: Collection[str]) -> str:
    match = _GIVEN.fullmatch(word)
    if match is not None and is_secret(match["name"], declared):
        return match["head"] + MASK
    return masked_text(word, declared)
