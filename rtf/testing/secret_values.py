"""Values that no journal, report or page shows: passwords, tokens, keys, and parameters declared ``secret=True``.

A value is secret by the name of what it is given to. In its place stands :data:`MASK`.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

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
    """Return whether what is given to this name is secret: by one of its words, or because it is ``declared``."""
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


def declared_in(files: Iterable[str]) -> frozenset[str]:
    """Return the names of the parameters that these Python files declare with ``secret=True``. Nothing is run."""
    return frozenset(name for file in files if file.endswith(".py") for name in _declared_in(Path(file)))


def _declared_in(file: Path) -> Iterator[str]:
    try:
        text = file.read_text(encoding="utf-8")
        tree = ast.parse(text) if "secret" in text else ast.Module([], [])
    except (OSError, ValueError, SyntaxError):
        return  # loading it says what is wrong
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Call)):
            continue
        keywords = {keyword.arg: keyword.value for keyword in node.value.keywords}
        if _literal(keywords.get("secret")) is not True:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        yield from (target.id for target in targets if isinstance(target, ast.Name))
        aliases = _literal(keywords.get("aliases"))
        names = [_literal(keywords.get("key")), *(aliases if isinstance(aliases, list | tuple) else ())]
        yield from (name for name in names if isinstance(name, str))


def _literal(node: ast.expr | None) -> object:
    try:
        return None if node is None else ast.literal_eval(node)
    except ValueError:
        return None
