"""Choosing among the tests of suites: by name, by tag, by id; and putting them into another order.

An expression is words joined by ``and``, ``or``, ``not`` and brackets, such as ``left and not (leg or "left eye")``.
``not`` binds tightest and ``or`` loosest; a word in quotes may contain anything. For names a word matches where it is
part of a test's name or id, for tags where it is the whole tag; case makes no difference. As in pytest, Python's own
parser reads the expression.
"""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from hashlib import blake2b
from typing import TYPE_CHECKING, NamedTuple

from rtf.testing.suite.ids import former, program_of
from rtf.testing.suite.model import SuiteError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from rtf.testing.suite.model import TestEntry, TestSuite

    Filter = Callable[[TestEntry], bool]

MAX_DEPTH = 50
MAX_LENGTH = 10_000

_TOKEN = re.compile(r"""[()]|"[^"]*"|'[^']*'|[^\s()"']+|["']""")
#: The characters that each token has in what Python parses: its columns then give the token.
_WIDTH = 4
_RULE = f"an expression is words joined by 'and', 'or', 'not' and brackets, at most {MAX_DEPTH} deep"


class ExpressionError(SuiteError):
    """An expression that cannot be read. ``column`` counts from 1."""

    def __init__(self, message: str, text: str, column: int) -> None:
        shown = "".join(char if char.isprintable() else " " for char in text)
        super().__init__(f"column {column}: {message}\n  {shown}\n  {' ' * (column - 1)}^")
        self.column = column


class Expression(NamedTuple):
    """A parsed expression; ``holds`` says whether it is true where its argument says which words are."""

    holds: Callable[[Callable[[str], bool]], bool]


def parse_expression(text: str) -> Expression:
    """Read an expression; ExpressionError points at what does not fit."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression is longer than {MAX_LENGTH} characters", text[:20] + "…", 21)
    tokens = [*_TOKEN.finditer(text)]
    for token in tokens:
        if token[0] in ("'", '"'):
            raise ExpressionError("this quote is never closed", text, token.start() + 1)
    columns = [*(token.start() + 1 for token in tokens), len(text.rstrip()) + 1]
    words = [token[0][1:-1] if token[0][0] in "'\"" else token[0] for token in tokens]
    try:
        tree = ast.parse("".join(_in_python(token[0]).ljust(_WIDTH) for token in tokens), mode="eval").body
        return Expression(_compiled(tree, words, MAX_DEPTH))
    except _MisplacedError as error:
        raise ExpressionError(_RULE, text, columns[error.token]) from None
    except SyntaxError as error:
        index = min((error.offset - 1) // _WIDTH, len(tokens)) if error.offset else len(tokens)
        said = "this is nested too deep" if "nested" in error.msg else _RULE
        raise ExpressionError(error.msg if "'" in error.msg else said, text, columns[index]) from None
    except (MemoryError, RecursionError):
        raise ExpressionError("this is nested too deep", text, 1) from None


class _MisplacedError(Exception):
    """An expression that Python accepts and ``-k`` must not, such as ``a (b)``, which is a call, or too much depth."""

    def __init__(self, node: ast.expr) -> None:
        super().__init__()
        self.token = node.col_offset // _WIDTH


def _in_python(token: str) -> str:
    folded = token.lower()
    return folded if folded in ("and", "or", "not", "(", ")") else "x"


def _compiled(node: ast.expr, words: Sequence[str], depth: int) -> Callable[[Callable[[str], bool]], bool]:
    if depth and isinstance(node, ast.BoolOp):
        parts = [_compiled(value, words, depth - 1) for value in node.values]
        joined = all if isinstance(node.op, ast.And) else any
        return lambda matches: joined(part(matches) for part in parts)
    if depth and isinstance(node, ast.UnaryOp):
        part = _compiled(node.operand, words, depth - 1)
        return lambda matches: not part(matches)
    if depth and isinstance(node, ast.Name):
        word = words[node.col_offset // _WIDTH]
        return lambda matches: matches(word)
    raise _MisplacedError(node)


def name_filter(expression: str) -> Filter:
    """Build the filter of ``-k``: words are searched in names and ids."""
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
    """Build the filter of ``--last-failed`` and ``--resume``: these ids, also as older versions had them.

    For a program with one of the ids, all its cases pass.
    """
    wanted = frozenset(ids)
    return lambda test: not wanted.isdisjoint((test.id, former(test.id), program_of(test.id)))


def select(
    suites: Iterable[TestSuite],
    filters: Iterable[Filter],
    *,
    with_required: bool = False,
    cases: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[TestSuite, ...]:
    """Keep the tests that pass all filters, in their order, and the suites in which any is left.

    ``with_required`` keeps also the earlier tests of the same suite that those require by ``test:``. Without filters
    everything is kept, empty suites included.

    ``cases`` has, by id, the names of the cases of programs as far as they are known. They are selected as tests are: a
    program is run whole when it passes the filters with all its cases, else with the cases that pass.
    """
    conditions = tuple(filters)
    if not conditions:
        return tuple(suites)
    selected = []
    for suite in suites:
        chosen = [_chosen(test, conditions, (cases or {}).get(test.id, {})) for test in suite.tests]
        kept = {test.id: test for test in chosen if test is not None}
        keep = {*kept}
        if with_required:
            _add_required(suite, keep)
        if keep:
            selected.append(suite.with_tests(kept.get(test.id, test) for test in suite.tests if test.id in keep))
    return tuple(selected)


def _chosen(test: TestEntry, conditions: Sequence[Filter], cases: Mapping[str, str]) -> TestEntry | None:
    """Return the test if it passes, with the only cases that are wanted of it."""
    itself = all(condition(test) for condition in conditions)
    wanted = tuple(
        (case, name)
        for case, name in cases.items()
        if all(condition(replace(test, id=case, name=f"{test.name}::{name}")) for condition in conditions)
    )
    if itself and len(wanted) == len(cases):
        return test
    return replace(test, cases=wanted) if wanted else None


def shuffle(suites: Iterable[TestSuite], seed: int) -> tuple[TestSuite, ...]:
    """Put the tests of each suite into an order that depends only on the seed and their ids.

    Suites stay where they are and keep their tests. A test that requires another, or is required, keeps its place, so
    that what it needs still comes before it. Because the order comes from a hash of each id, leaving tests out does not
    change the order of the others, and the same seed gives the same order on every machine.
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
