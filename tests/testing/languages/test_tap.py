"""The Test Anything Protocol, versions 12 to 14: valid streams, and any others."""

from __future__ import annotations

import random
import resource
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.languages.tap import (
    MAX_BLOCK,
    MAX_POINTS,
    BailOut,
    Comment,
    Fault,
    Item,
    Point,
    SkippedAll,
    TapParser,
    looks_like_tap,
)

NESTED = (Path(__file__).parents[2] / "data" / "plugins" / "nested.tap").read_text()


def parse(text: str, *, cut_off: bool = False) -> list[Item]:
    """Return all items of a stream."""
    parser = TapParser()
    items = [item for line in text.splitlines() for item in parser.feed(line)]
    return items + parser.finish(cut_off=cut_off)


def points(text: str) -> list[Point]:
    """Return the points of a stream without faults."""
    items = parse(text)
    assert [item for item in items if isinstance(item, Fault)] == []
    return [item for item in items if isinstance(item, Point)]


def faults(text: str) -> list[str]:
    """Return the faults of a stream."""
    return [item.text for item in parse(text) if isinstance(item, Fault)]


# Test points ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("ok", Point(True, 1)),
        ("not ok", Point(False, 1)),
        ("ok 1", Point(True, 1)),
        ("ok 1 - moves", Point(True, 1, "moves")),
        ("ok 1 moves", Point(True, 1, "moves")),
        ("ok - moves", Point(True, 1, "moves")),
        ("ok moves", Point(True, 1, "moves")),
        ("ok 1.5 volts", Point(True, 1, "1.5 volts")),
        ("ok 1 - a # SKIP no robot", Point(True, 1, "a", "skip", "no robot")),
        ("ok 1 - a # skipped: no robot", Point(True, 1, "a", "skip", "no robot")),
        ("not ok 1 # TODO later", Point(False, 1, "", "todo", "later")),
        ("not ok 1 - a #todo", Point(False, 1, "a", "todo")),
        ("ok 1 - a # todone", Point(True, 1, "a # todone")),
        (r"ok 1 - a \# SKIP not", Point(True, 1, "a # SKIP not")),
        (r"ok 1 - a\\b", Point(True, 1, r"a\b")),
        ("ok 1 - number # 3", Point(True, 1, "number # 3")),
    ],
)
def test_a_test_point_has_number_description_and_directive(line: str, expected: Point):
    """Number, description and directive of a point are optional."""
    assert [expected] == points(f"{line}\n1..1")


@pytest.mark.parametrize("line", ["okay 1", "Ok 1", "nok 1", "not  ok 1", " ok 1", "# ok 1", "x ok 1", "not", "o"])
def test_what_is_no_test_point_is_passed_over(line: str):
    """Other lines are ignored."""
    assert [item for item in parse(f"1..0\n{line}") if isinstance(item, Point | Fault)] == []


def test_points_that_are_todo_or_skipped_do_not_fail():
    """A failing point with TODO or SKIP is no failure."""
    assert [p.failed for p in points("1..3\nnot ok # TODO\nnot ok # SKIP\nnot ok")] == [False, False, True]


def test_a_line_end_of_windows_is_no_part_of_the_line():
    """Lines may end with CR LF."""
    parser = TapParser()
    items = [*parser.feed("1..1\r\n"), *parser.feed("ok 1 - a\r\n"), *parser.finish()]
    assert [Point(True, 1, "a")] == items


def test_a_yaml_block_belongs_to_the_point_before_it():
    """A YAML block belongs to the point before it, and its indentation is removed."""
    text = "TAP version 13\nnot ok 1 - a\n  ---\n  message: bad\n  data:\n    got: 1\n  ...\n# next\n1..1"
    items = parse(text)
    assert Point(False, 1, "a", block="message: bad\ndata:\n  got: 1") == items[0]
    assert Comment("next") == items[1]


def test_a_yaml_block_that_never_ends_does_not_swallow_the_stream():
    """A line without indentation ends a YAML block."""
    assert [Point(False, 1, block="a: b"), Point(True, 2)] == points("1..2\nnot ok 1\n  ---\n  a: b\nok 2")


def test_a_point_inside_a_yaml_block_is_text():
    """Lines of the protocol within a YAML block are text."""
    assert [Point(True, 1, block="ok 2\n  ok 3")] == points("1..1\nok 1\n  ---\n  ok 2\n    ok 3\n  ...")


# The plan ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["1..2\nok\nok", "ok\nok\n1..2", "# hello\n1..2\nok 2\nok 1"])
def test_the_plan_stands_first_or_last(text: str):
    """The plan is before or after the points, comments apart; points may be in any order."""
    assert faults(text) == []


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("ok 1", "no plan"),
        ("", "no plan"),
        ("1..3\nok 1\nok 3", "3 test points planned, 2 came; missing: 2"),
        ("1..1\nok 1\nok 2", "outside the plan 1..1"),
        ("1..2\nok 1\nok 1", "test point 1 comes twice"),
        ("1..1\nok 0", "test point 0 is outside"),
        ("ok 1\n1..2\nok 2", "neither before nor after"),
        ("1..1\nok 1\n1..1", "a second plan"),
        ("1..1\nTAP version 13\nok 1", "in the middle"),
        ("TAP version 15\n1..1\nok 1", "not known"),
        ("1..20", "missing: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 …"),
        ("1..0\nok 1", "outside the plan 1..0"),
    ],
)
def test_a_plan_that_is_not_kept_is_a_fault(text: str, part: str):
    """A missing plan or point is a fault, so that a program that dies does not pass."""
    assert any(part in fault for fault in faults(text)), faults(text)


def test_a_plan_of_nothing_skips_everything():
    """``1..0`` skips the test, with or without a reason."""
    assert [SkippedAll("no robot")] == parse("1..0 # SKIP no robot")
    assert [SkippedAll("no robot")] == parse("1..0 # no robot")
    assert [SkippedAll("")] == parse("1..0")


def test_a_program_that_was_cut_off_broke_no_plan():
    """Missing points of a stream that was cut off are no fault, because the crash is reported."""
    assert [Point(True, 1)] == parse("1..3\nok 1", cut_off=True)


def test_nothing_counts_after_bailing_out():
    """Lines after a bail-out are ignored."""
    assert [Point(True, 1), BailOut("on fire")] == parse("1..3\nok 1\nBail out! on fire\nnot ok 2")


# Subtests ------------------------------------------------------------------------------------------------------------


def test_a_subtest_is_a_document_of_its_own():
    """Points of a subtest have its name in their path, and come before its point."""
    items = parse(NESTED)
    block = "message: stuck\nfile: 'arm.c'\nline: 42"
    assert [
        Point(True, 1, "power is on"),
        Comment("the arm is cold"),
        Point(True, 1, "shoulder", path=("left arm",)),
        Point(False, 2, "elbow", path=("left arm",), block=block),
        Point(False, 2, "left arm"),
        Point(True, 3, "right arm", "skip", "not mounted"),
        Point(False, 4, "hand", "todo", "tendons"),
    ] == items


def test_bare_subtests_may_nest_at_once():
    """In version 14 indentation alone begins subtests, also several at once."""
    text = "TAP version 14\n        ok 1 - a\n        1..1\n    ok 1 - b\n    1..1\nok 1 - c\n1..1"
    assert [point.path for point in points(text)] == [("subtest 1", "subtest 1"), ("subtest 1",), ()]


def test_older_streams_need_the_comment_for_a_subtest():
    """Before version 14 indented lines are a subtest only after its comment."""
    assert [Point(True, 1)] == points("1..1\n    not ok 1\nok 1")
    announced = points("1..1\n    # Subtest: x\n    ok 1\n    1..1\nok 1 - x")
    assert [point.path for point in announced] == [("x",), ()]


def test_the_parent_has_the_last_word_on_a_subtest():
    """Failures and faults in a subtest with TODO do not fail."""
    text = "TAP version 14\n1..1\n    not ok 1 - a\n        not ok 1 - b\n    1..7\nnot ok 1 # TODO later"
    assert not any(getattr(item, "failed", False) for item in parse(text))


@pytest.mark.parametrize("end", ["ok 1", "1..1", "Bail out!", "", "# Subtest: y\n    1..0\nok 1"])
def test_a_failure_in_a_subtest_is_never_lost(end: str):
    """A failed point in a subtest is reported, whatever follows."""
    items = parse(f"TAP version 14\n# Subtest: x\n    not ok 1 - a\n{end}")
    assert Point(False, 1, "a", path=("x",)) in items
    assert Point(False, 1, "a", path=("x",)) in parse(
        f"TAP version 14\n# Subtest: x\n    not ok 1 - a\n{end}", cut_off=True
    )


def test_a_subtest_keeps_its_own_plan():
    """A broken plan of a subtest is a fault with its name."""
    items = parse("TAP version 14\n1..1\n# Subtest: x\n    1..2\n    ok 1\nok 1 - x")
    assert Fault("2 test points planned, 1 came; missing: 2", ("x",)) in items


# Any stream ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("TAP version 13", True),
        ("1..5", True),
        ("ok 1", True),
        ("not ok 3 - x", True),
        ("ok - x", True),
        ("not ok # TODO", True),
        ("ok", False),
        ("ok then", False),
        ("okay 1", False),
        ("# ok", False),
        ("[==========] Running 4 tests", False),
        ("", False),
    ],
)
def test_the_first_line_tells_whether_a_program_speaks_tap(line: str, expected: bool):
    """A stream is TAP by its first line; the word ``ok`` alone is not."""
    assert expected is looks_like_tap(line)


@given(st.lists(st.tuples(st.booleans(), st.text("abc #\\", max_size=8)), max_size=20), st.booleans())
def test_what_is_written_is_read(rows: list[tuple[bool, str]], plan_first: bool):
    """Each point of a valid stream is read with its description, unescaped and trimmed."""
    escaped = [text.replace("\\", "\\\\").replace("#", "\\#") for _, text in rows]
    lines = [
        f"{'' if ok else 'not '}ok {n} - {text}" for n, ((ok, _), text) in enumerate(zip(rows, escaped, strict=True), 1)
    ]
    plan = f"1..{len(rows)}"
    read = points("\n".join([plan, *lines] if plan_first else [*lines, plan]))
    assert [(ok, text.strip()) for ok, text in rows] == [(point.ok, point.description) for point in read]


@given(st.text())
def test_no_text_is_too_strange(text: str):
    """Any text is parsed without an exception, and does not pass without a plan."""
    items = parse(text)
    assert any(isinstance(item, Fault | SkippedAll | BailOut) or getattr(item, "failed", False) for item in items) or (
        "1.." in text
    )


@given(st.lists(st.sampled_from(NESTED.splitlines()), max_size=30))
def test_a_failed_point_at_top_level_is_always_reported(lines: list[str]):
    """A failed point at the top level is reported in any mix of lines."""
    items = parse("\n".join(lines))
    surface = [line for line in lines if line.startswith("not ok 2")]
    failed = [item for item in items if isinstance(item, Point) and item.description == "left arm" and item.failed]
    assert len(surface) == len(failed)


def test_a_long_stream_is_bounded():
    """Points beyond the limit are counted, a failure among them is reported, and blocks are cut."""
    parser = TapParser()
    count = sum(len(parser.feed("ok")) for _ in range(MAX_POINTS + 1000))
    count += len(parser.feed("not ok"))
    parser.feed(f"1..{MAX_POINTS + 1001}")
    assert count == MAX_POINTS + 1  # and one remark
    assert [Fault("1 more test points failed")] == parser.finish()
    block = "\n".join(f"  {'x' * 1000}" for _ in range(1000))
    (point,) = points(f"1..1\nnot ok 1\n  ---\n{block}\n  ...")
    assert MAX_BLOCK <= len(point.block) + 1000 <= MAX_BLOCK + 2000


def test_faults_are_bounded_too():
    """At most a thousand faults are reported."""
    parser = TapParser()
    parser.feed("1..1")
    assert sum(len(parser.feed("1..1")) for _ in range(5000)) == 1000


@pytest.mark.fuzz
def test_mutated_streams_do_no_harm():
    """25 000 damaged streams are parsed without an exception, in bounded time."""
    chance = random.Random(14)
    seeds = [
        "1..2\nok 1 - a # SKIP\nnot ok 2",
        "TAP version 14\n# Subtest: x\n    ok 1\n    1..1\nok 1 - x\n1..1",
        "ok 1\n  ---\n  a: b\n  ...\n1..1",
        "1..0 # SKIP x\nBail out! y",
    ]
    pieces = ["\n", " ", "    ", "#", "1..", "ok ", "not ", "---", "...", "\\", "\t", "\x00", "٣", "9" * 12, "é"]
    began = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    for _ in range(25_000):
        text = chance.choice(seeds)
        for _ in range(chance.randint(1, 3)):
            at = chance.randrange(len(text) + 1)
            text = text[:at] + chance.choice(pieces) + text[at + chance.randint(0, 2) :]
        for item in parse(text):
            assert isinstance(item, Point | Comment | Fault | SkippedAll | BailOut)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_utime - began < 5
