"""Selecting tests by name, tag and id, and shuffling them."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.selection import (
    ExpressionError,
    id_filter,
    name_filter,
    parse_expression,
    select,
    shuffle,
    tag_filter,
)
from rtf.testing.suite.model import SuiteError, TestEntry, TestSuite


def suite(*names: str, suite_id: str = "s", **more: object) -> TestSuite:
    """Return a suite whose tests have these names."""
    tests = (TestEntry(id=f"{suite_id}/{name.lower()}", name=name, plugin="P", **more) for name in names)
    return TestSuite(id=suite_id, name=suite_id, tests=tuple(tests))


def names(suites: tuple[TestSuite, ...]) -> list[str]:
    """Return the names of all tests, in order."""
    return [test.name for suite in suites for test in suite.tests]


ARMS = suite("LeftArm", "LeftLeg", "RightArm", "RightLeg", "Head")


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("left", ["LeftArm", "LeftLeg"]),
        ("LEFT and not leg", ["LeftArm"]),
        ("left and arm or right and leg", ["LeftArm", "RightLeg"]),
        ("(left or right) and arm", ["LeftArm", "RightArm"]),
        ("not (left or right)", ["Head"]),
        ("not left and not right", ["Head"]),
        ("not not head", ["Head"]),
        ("NOT left AND Arm", ["RightArm"]),
        ("s/left", ["LeftArm", "LeftLeg"]),
        ('"left arm"', []),
        ("'head'", ["Head"]),
        ("nothing", []),
    ],
)
def test_names_are_chosen_by_an_expression(expression: str, expected: list[str]):
    """Words match parts of names and ids in any case; ``not`` binds tightest, ``or`` loosest."""
    assert names(select([ARMS], [name_filter(expression)])) == expected


def test_words_in_quotes_may_be_anything():
    """Quoted words may have blanks, brackets and operators."""
    odd = suite("a (b) c", "this and that", "don't")
    assert names(select([odd], [name_filter('"(b) c"')])) == ["a (b) c"]
    assert names(select([odd], [name_filter("'and'")])) == ["this and that"]
    assert names(select([odd], [name_filter('''"n't"''')])) == ["don't"]


def test_tags_are_whole_words():
    """A tag is matched as a whole, in any case."""
    suites = [suite("a", tags=("slow", "arm")), suite("b", suite_id="t", tags=("Slowly",))]
    assert names(select(suites, [tag_filter("SLOW")])) == ["a"]
    assert names(select(suites, [tag_filter("slowly or arm")])) == ["a", "b"]
    assert names(select(suites, [tag_filter("not slow")])) == ["b"]


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("", 1, "an expression is words joined by 'and', 'or', 'not' and brackets"),
        ("left and", 9, "an expression is words"),
        ("left arm", 6, "an expression is words"),
        ("and left", 1, "an expression is words"),
        ("left or or b", 9, "an expression is words"),
        ("(left", 1, "'(' was never closed"),
        ("(left arm)", 2, "an expression is words"),
        ("left (arm)", 1, "an expression is words"),
        ("left)", 5, "unmatched ')'"),
        ("()", 1, "an expression is words"),
        ('a and "b', 7, "this quote is never closed"),
        ("not", 4, "an expression is words"),
        ("(" * 300 + "a" + ")" * 300, 201, "nested too deep"),
        ("not " * 60 + "a", 201, "at most 50 deep"),
        ("not " * 2400 + "a", 201, "at most 50 deep"),
        ("a" * 10_001, 21, "longer than 10000 characters"),
    ],
)
def test_an_expression_that_cannot_be_read_is_pointed_at(text: str, column: int, message: str):
    """The error about an invalid expression marks the column."""
    with pytest.raises(ExpressionError, match=f"^column {column}: ") as caught:
        parse_expression(text)
    assert message in str(caught.value)
    assert caught.value.column == column
    assert str(caught.value).endswith("\n  " + " " * (column - 1) + "^")
    assert isinstance(caught.value, SuiteError)


def test_all_filters_have_to_agree_and_empty_suites_go():
    """A test must pass all filters; order stays, and empty suites are removed."""
    suites = [suite("a", "b", "c"), suite("d", suite_id="t")]
    chosen = select(suites, [name_filter("a or c or d"), id_filter({"s/c", "s/a", "s/b"})])
    assert [(part.id, names((part,))) for part in chosen] == [("s", ["a", "c"])]


def test_without_filters_nothing_is_left_out():
    """Without filters also empty suites stay."""
    suites = (suite(), suite("a", suite_id="t"))
    assert select(suites, []) == suites


def test_required_tests_come_along_when_asked_for():
    """On request required tests of the same suite are selected, too."""
    chain = TestSuite(
        id="s",
        name="S",
        tests=(
            TestEntry(id="s/a", name="a", plugin="P"),
            TestEntry(id="s/x", name="x", plugin="P"),
            TestEntry(id="s/b", name="b", plugin="P", requires=("test:s/a", "env:HOME")),
            TestEntry(id="s/c", name="c", plugin="P", requires=("test:s/b", "test:t/y")),
        ),
    )
    assert names(select([chain], [name_filter("s/c")])) == ["c"]
    assert names(select([chain], [name_filter("s/c")], with_required=True)) == ["a", "b", "c"]


def test_shuffling_keeps_the_place_of_linked_tests():
    """Tests with requirements keep their places."""
    plain = [TestEntry(id=f"s/t{number}", name=f"t{number}", plugin="P") for number in range(20)]
    plain[12] = TestEntry(id="s/t12", name="t12", plugin="P", requires=("test:s/t3",))
    (shuffled,) = shuffle([TestSuite(id="s", name="S", tests=tuple(plain))], 1)
    assert (shuffled.tests[3].id, shuffled.tests[12].id) == ("s/t3", "s/t12")
    assert list(shuffled.tests) != plain


def test_the_order_of_a_seed_never_changes():
    """The order of a seed is the same in every version."""
    assert names(shuffle([suite(*"abcdefgh")], 7)) == list("edhacfgb")


ids = st.lists(st.sampled_from("abcdefghijkl"), unique=True)


@given(ids, st.integers())
def test_shuffling_loses_nothing_and_repeats(letters: list[str], seed: int):
    """Shuffling keeps all tests, and gives the same order for the same seed."""
    suites = (suite(*letters), suite(*letters, suite_id="t"))
    shuffled = shuffle(suites, seed)
    assert [part.id for part in shuffled] == ["s", "t"]
    assert all(set(one.tests) == set(other.tests) for one, other in zip(suites, shuffled, strict=True))
    assert shuffled == shuffle(suites, seed) == shuffle(shuffled, seed)


@given(ids, st.sets(st.sampled_from("abcdefghijkl")), st.integers())
def test_shuffling_and_selecting_may_change_places(letters: list[str], kept: set[str], seed: int):
    """Selecting before or after shuffling gives the same order."""
    wanted = [id_filter({f"s/{letter}" for letter in kept})]
    suites = (suite(*letters),)
    assert select(shuffle(suites, seed), wanted) == shuffle(select(suites, wanted), seed)


#: Expressions as nested tuples: the word, or the operator and its operands.
words = st.text(st.characters(exclude_characters='"', exclude_categories=["Cs"]), max_size=5)
expressions = st.recursive(
    words,
    lambda inner: st.one_of(
        st.tuples(st.just("not"), inner),
        st.tuples(st.sampled_from(["and", "or"]), inner, inner),
        st.tuples(st.sampled_from(["and", "or"]), inner, inner, inner),
    ),
    max_leaves=12,
)


def write(expression: str | tuple[Any, ...]) -> str:
    """Write an expression with all brackets."""
    match expression:
        case "not", operand:
            return f"not ({write(operand)})"
        case operator, *operands:
            return operator.join(f"({write(operand)})" for operand in operands)
    return f'"{expression}"'


def truth(expression: str | tuple[Any, ...], known: set[str]) -> bool:
    """Evaluate an expression independently."""
    match expression:
        case "not", operand:
            return not truth(operand, known)
        case "and", *operands:
            return sum(truth(operand, known) for operand in operands) == len(operands)
        case "or", *operands:
            return sum(truth(operand, known) for operand in operands) > 0
    return expression in known


@given(expressions, st.sets(st.text(max_size=2)))
def test_an_expression_that_is_written_is_read_and_means_the_same(expression: str | tuple[Any, ...], known: set[str]):
    """A written expression is read with the same meaning."""
    assert parse_expression(write(expression)).holds(known.__contains__) == truth(expression, known)


@given(st.text(alphabet="()\"' \tandortx", max_size=60) | st.text(max_size=60))
def test_any_text_is_an_expression_or_an_error_of_ours(text: str):
    """Any text is an expression, or raises ExpressionError."""
    column = 1
    try:
        parse_expression(text)
    except ExpressionError as error:
        column = error.column
    assert 1 <= column <= len(text) + 1
