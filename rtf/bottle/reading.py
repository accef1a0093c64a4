"""The parser of the text form of bottles, with all peculiarities of YARP's parser.

There are two parsers. The quick one takes well-formed text in one pass and gives up at anything unusual; the exact one
then parses the whole text again by YARP's own procedure: an element is the text between separators outside quotes,
lists and blobs, its first character determines its type, and the first and last characters of lists, blobs and quoted
strings are cut off. The tests compare the two.

Consequences of that procedure, kept because existing programs depend on them: an element that is never closed is lost,
with all that follows it; so is the last element when the text ends in a backslash; a superfluous ``)`` swallows what
follows.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.bottle.access import as_int
from rtf.bottle.balance import Balance
from rtf.bottle.containers import CONTAINERS, MAX_DEPTH
from rtf.bottle.errors import BottleLimitError, BottleSyntaxError
from rtf.bottle.numbers import read_number
from rtf.bottle.values import FALSE, TRUE, Dialect, Kind, Vocab, Vocab64

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.bottle.containers import Value

MAX_TEXT = 4 << 20
"""The largest text, in characters. YARP has no limit; the longest text of a robot has some kilobytes."""
MAX_WORK = 4 * MAX_TEXT
"""The largest number of characters that the exact parser reads in total, as it reads nested text once per level."""

_TOKEN = re.compile(
    r"""(?:
      (-?(?:0|[1-9][0-9]{0,17}))                         # 1 an ordinary integer
    | (-?[0-9]+\.[0-9]*(?:e[+-]?[0-9]+)?)                # 2 an ordinary float
    | ([^\ \t\n\r,"(){}\\\[][^\ \t\n\r,"(){}\\]*+)       # 3 a word, or a number out of the ordinary
    | "([^"\\]*+(?:\\.[^"\\]*+)*+)"                      # 4 a quoted string
    | (\))                                               # 5 the end of a list
    | \[([^\ \t\n\r,"(){}\\\[\]]*+)\]                    # 6 a vocab
    | \{((?:(?:0|[1-9][0-9]{0,2})?(?:\ ++|(?=\})))*+)\}   # 7 a blob of ordinary numbers
    )(?=[\ \t\n\r,)]|\Z)
    | (\()                                               # 8 the beginning of a list
    | ([^\ \t\n\r,])                                     # 9 anything else: not for the quick reader
    """,
    re.VERBOSE | re.DOTALL,
)
_STRING, _CLOSE, _VOCAB, _BLOB, _OPEN = range(4, 9)
_MARK = re.compile(r'[\\"(){}, \t\n\r]')
_BRACKETS = {"(": ("(", 1), ")": ("(", -1), "{": ("{", 1), "}": ("{", -1)}
_ESCAPE = re.compile(r"\\(.?)", re.DOTALL)
_ESCAPED = {"n": "\n", "r": "\r", "0": "\0"}
_NUMERIC = frozenset("0123456789+-.in")
_WORDS: dict[str, Value] = {"true": TRUE, "false": FALSE, "null": Vocab("null")}


def read_items(text: str, *, strict: bool = False, dialect: Dialect = Dialect.YARP3) -> list[Value]:
    """Parse the elements of a bottle; errors as for ``Bottle.parse``."""
    if len(text) > MAX_TEXT:
        raise BottleLimitError(f"the text has {len(text)} characters, more than {MAX_TEXT}")
    items = read_quickly(text, dialect)
    if items is None:
        if strict:
            _require_balance(text)
        items = read_exactly(text, dialect)
    return items


def _require_balance(text: str) -> None:
    balance = Balance()
    if not balance.feed(text):
        opened = text[balance.since]
        raise BottleSyntaxError(f"{opened!r} has no counterpart in {text[:60]!r}", balance.since)


def read_quickly(text: str, dialect: Dialect) -> list[Value] | None:
    """Parse well-formed text in one pass; return ``None`` for any other text."""
    new_list = CONTAINERS[Kind.LIST].of_elements
    items: list[Value] = []
    stack: list[list[Value]] = []
    for token in _TOKEN.finditer(text):
        kind = token.lastindex or 0
        if kind <= _STRING:
            items.append(_SCALARS[kind](token[kind]))
        elif kind == _OPEN:
            if len(stack) == MAX_DEPTH:
                raise BottleLimitError(f"lists are nested more than {MAX_DEPTH} levels deep", token.start())
            stack.append(items)
            items = []
        elif kind == _CLOSE:
            if not stack:
                return None
            closed = new_list(items)
            items = stack.pop()
            items.append(closed)
        elif kind == _VOCAB:
            items.append(_vocab(token[_VOCAB], dialect))
        elif kind == _BLOB:
            items.append(bytes([int(part) & 0xFF for part in token[_BLOB].split()]))
        else:
            return None
    return None if stack else items


def read_exactly(text: str, dialect: Dialect) -> list[Value]:
    """Parse any text by YARP's own procedure."""
    return _ExactReader(dialect).items(text, 0, 0)


class _ExactReader:
    __slots__ = ("_dialect", "_work")

    def __init__(self, dialect: Dialect) -> None:
        self._dialect = dialect
        self._work = 0

    def items(self, text: str, offset: int, depth: int) -> list[Value]:
        if depth > MAX_DEPTH:
            raise BottleLimitError(f"lists are nested more than {MAX_DEPTH} levels deep", offset)
        self._work += len(text)
        if self._work > MAX_WORK:
            raise BottleLimitError("the text is too long for being so deeply nested", offset)
        return [self._item(token, offset + start, depth) for token, start in _tokens(text)]

    def _item(self, token: str, offset: int, depth: int) -> Value:
        first = token[0]
        if first == "(":
            return CONTAINERS[Kind.LIST].of_elements(self.items(token[1:-1], offset + 1, depth + 1))
        if first == "[":
            return _vocab(token[1:-1], self._dialect)
        if first == "{":
            return bytes([as_int(value) & 0xFF for value in self.items(token[1:-1], offset + 1, depth + 1)])
        if first == '"':
            return _unescape(token[1:-1])
        return _word(token)


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """Yield every element with its offset, except one that is still open at the end of the text."""
    quoted = False
    depth = {"(": 0, "{": 0}
    begin = 0  # where the present element began, or the end of the latest separator
    resume = 0
    for mark in _MARK.finditer(text):
        position = mark.start()
        character = text[position]
        if position < resume:
            continue
        if character == "\\":
            resume = position + 2
        elif character == '"':
            quoted = not quoted
        elif not quoted and character in _BRACKETS:
            opening, step = _BRACKETS[character]
            depth[opening] += step
        elif not quoted and not depth["("] and not depth["{"]:
            if position > begin:
                yield text[begin:position], begin
            begin = position + 1
    complete = not quoted and not depth["("] and not depth["{"] and resume <= len(text)
    if complete and begin < len(text):
        yield text[begin:], begin


def _word(token: str) -> Value:
    value = _WORDS.get(token)
    if value is None and token[0] in _NUMERIC:
        value = read_number(token)
    if value is None:
        word = _unescape(token)
        value = _WORDS.get(word, word) if word != "null" else word
    return value


def _vocab(text: str, dialect: Dialect) -> Vocab:
    vocab = Vocab.truncated(text)
    if dialect is Dialect.YARP4 and len(text.encode("utf-8", "surrogateescape")) > Vocab.WIDTH:
        vocab = Vocab64.truncated(text)
    return vocab


def _unescape(text: str) -> str:
    return _ESCAPE.sub(lambda found: _ESCAPED.get(found[1], found[1]), text) if "\\" in text else text


_SCALARS: tuple[Callable[[str], Value], ...] = (str, int, float, _word, _unescape)  # by the number of the group
