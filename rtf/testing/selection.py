"""Choosing among the tests of suites: by name, by tag, by id; and putting them into another order.

An expression is words joined by ``and``, ``or``, ``not`` and brackets, such as ``left and not (leg or "left eye")``.
``not`` binds tightest and ``or`` loosest; a word in quotes may contain anything. For names a word matches where it is
part of a test's name or id, for tags where it is the whole tag; case makes no difference.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from hashlib import blake2b
from typing import TYPE_CHECKING

from rtf.testing.suite.model import SuiteError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from rtf.testing.suite.model import TestEntry, TestSuite

    Filter = Callable[[TestEntry], bool]

MAX_DEPTH = 50
MAX_LENGTH = 10_000

_TOKEN = re.compile(r"""\s*(?:(?P<bracket>[()])|(?P<quoted>"[^"]*"|'[^']*')|(?P<word>[^\s()"']+)|(?P<open>["']))""")
_OPERATORS = frozenset({"and", "or", "not"})


class ExpressionError(SuiteError):
    """An expression that cannot be read. ``column`` counts from 1."""

    def __init__(self, message: str, text: str, column: int) -> None:
        shown = "".join(char if char.isprintable() else " " for char in text)
        super().__init__(f"column {column}: {message}\n  {shown}\n  {' ' * (column - 1)}^")
        self.column = column


@dataclass(frozen=True, slots=True)
class Word:
    """True where the predicate holds for this text."""

    text: str

    def holds(self, matches: Callable[[str], bool]) -> bool:
        """Ask the predicate."""
        return matches(self.text)


@dataclass(frozen=True, slots=True)
class Not:
    """True where the operand is not."""

    operand: Expression

    def holds(self, matches: Callable[[str], bool]) -> bool:
        """Ask the operand and turn the answer round."""
        return not self.operand.holds(matches)


@dataclass(frozen=True, slots=True)
class AllOf:
    """True where all operands are."""

    operands: tuple[Expression, ...]

    def holds(self, matches: Callable[[str], bool]) -> bool:
        """Ask the operands from the left until one says no."""
        return all(operand.holds(matches) for operand in self.operands)


@dataclass(frozen=True, slots=True)
class AnyOf:
    """True where one of the operands is."""

    operands: tuple[Expression, ...]

    def holds(self, matches: Callable[[str], bool]) -> bool:
        """Ask the operands from the left until one says yes."""
        return any(operand.holds(matches) for operand in self.operands)


Expression = Word | Not | AllOf | AnyOf


def parse_expression(text: str) -> Expression:
    """Read an expression; ExpressionError points at the first thing that does not fit."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression is longer than {MAX_LENGTH} characters", text[:20] + "…", 21)
    return _Parser(text).parse()


def name_filter(expression: str) -> Filter:
    """Build the filter of ``-k``: words are looked for in names and ids."""
    parsed = parse_expression(expression)

    def keeps(test: TestEntry) -> bool:
        haystack = (test.name.casefold(), test.id.casefold())
        return parsed.holds(lambda word: any(word.casefold() in text for text in haystack))

    return keeps


def tag_filter(expression: str) -> Filter:
    """Build the filter of ``--tags``: words are whole tags."""
    parsed = parse_expression(expression)

    def keeps(test: TestEntry) -> bool:
        tags = {tag.casefold() for tag in test.tags}
        return parsed.holds(lambda word: word.casefold() in tags)

    return keeps


def id_filter(ids: Collection[str]) -> Filter:
    """Build the filter of ``--last-failed`` and ``--resume``: exactly these ids."""
    wanted = frozenset(ids)
    return lambda test: test.id in wanted


def select(
    suites: Iterable[TestSuite], filters: Iterable[Filter], *, with_required: bool = False
) -> tuple[TestSuite, ...]:
    """Keep the tests that pass all filters, in their order, and the suites in which any is left.

    ``with_required`` keeps also the earlier tests of the same suite that those require by ``test:``. Without filters
    everything is kept, empty suites included.
    """
    conditions = tuple(filters)
    if not conditions:
        return tuple(suites)
    selected = []
    for suite in suites:
        keep = {test.id for test in suite.tests if all(condition(test) for condition in conditions)}
        if with_required:
            _add_required(suite, keep)
        if keep:
            selected.append(suite.with_tests(test for test in suite.tests if test.id in keep))
    return tuple(selected)


def unknown_ids(suites: Iterable[TestSuite], ids: Iterable[str]) -> tuple[str, ...]:
    """The ids that no test has (any more), in the order given."""
    known = {test.id for suite in suites for test in suite.tests}
    return tuple(test_id for test_id in ids if test_id not in known)


def shuffle(suites: Iterable[TestSuite], seed: int) -> tuple[TestSuite, ...]:
    """Put the tests of each suite into an order that depends on nothing but the seed and their ids.

    Suites stay where they are and keep their tests. A test that requires another, or is required, keeps its place, so
    that what it needs still stands before it. Because the order comes from a hash of each id, leaving tests out does
    not change the order of the others, and the same seed gives the same order on every machine.
    """
    return tuple(suite.with_tests(_shuffled(suite.tests, seed)) for suite in suites)


def _shuffled(tests: Sequence[TestEntry], seed: int) -> list[TestEntry]:
    linked = {required for test in tests for required in test.required_tests}
    linked.update(test.id for test in tests if test.required_tests)
    free = [test for test in tests if test.id not in linked]
    order = iter(sorted(free, key=lambda test: blake2b(f"{seed}\0{test.id}".encode(), digest_size=16).digest()))
    return [test if test.id in linked else next(order) for test in tests]


def _add_required(suite: TestSuite, keep: set[str]) -> None:
    for test in reversed(suite.tests):  # what is required stands earlier, so one pass from behind reaches all
        if test.id in keep:
            keep.update(test.required_tests)
    keep.intersection_update(test.id for test in suite.tests)


@dataclass(frozen=True, slots=True)
class _Token:
    text: str
    column: int
    kind: str

    @property
    def operator(self) -> str:
        """The operator or bracket this token is, or an empty string for a word to look for."""
        if self.kind == "bracket":
            return self.text
        folded = self.text.lower()
        return folded if self.kind == "word" and folded in _OPERATORS else ""


class _Parser:
    """Recursive descent over the tokens; the depth is bounded, so a long line of brackets is an error, not a crash."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = self._split()
        self._next = 0
        self._depth = 0

    def parse(self) -> Expression:
        expression = self._any()
        if (token := self._peek()) is not None:
            problem = "this bracket closes nothing" if token.text == ")" else "expected 'and' or 'or' before this"
            raise self._error(problem, token)
        return expression

    def _split(self) -> list[_Token]:
        tokens = []
        position = 0
        end = len(self._text.rstrip())
        while position < end:
            match = _TOKEN.match(self._text, position)
            if match is None or match.lastgroup is None:  # pragma: no cover - the pattern takes every character
                raise ExpressionError("this cannot be read", self._text, position + 1)
            kind = match.lastgroup
            token = _Token(match[kind], match.start(kind) + 1, kind)
            if kind == "open":
                raise self._error("this quote is never closed", token)
            tokens.append(_Token(token.text[1:-1], token.column, kind) if kind == "quoted" else token)
            position = match.end()
        return tokens

    def _any(self) -> Expression:
        operands = [self._all()]
        while self._take("or"):
            operands.append(self._all())
        return operands[0] if len(operands) == 1 else AnyOf(tuple(operands))

    def _all(self) -> Expression:
        operands = [self._operand()]
        while self._take("and"):
            operands.append(self._operand())
        return operands[0] if len(operands) == 1 else AllOf(tuple(operands))

    def _operand(self) -> Expression:
        token = self._peek()
        if token is None:
            raise self._error("expected a word, 'not' or a bracket here, but the expression ends")
        if token.operator in {"and", "or", ")"}:
            raise self._error(f"expected a word, 'not' or a bracket before {token.text!r}", token)
        self._next += 1
        if not token.operator:
            return Word(token.text)
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._error(f"this is nested more than {MAX_DEPTH} deep", token)
        expression = Not(self._operand()) if token.operator == "not" else self._bracket(token)
        self._depth -= 1
        return expression

    def _bracket(self, opening: _Token) -> Expression:
        expression = self._any()
        if not self._take(")"):
            token = self._peek()
            if token is None:
                raise self._error("this bracket is never closed", opening)
            raise self._error("expected 'and', 'or' or a closing bracket before this", token)
        return expression

    def _peek(self) -> _Token | None:
        return self._tokens[self._next] if self._next < len(self._tokens) else None

    def _take(self, operator: str) -> bool:
        token = self._peek()
        if token is None or token.operator != operator:
            return False
        self._next += 1
        return True

    def _error(self, message: str, token: _Token | None = None) -> ExpressionError:
        column = token.column if token else len(self._text.rstrip()) + 1
        return ExpressionError(message, self._text, column)
