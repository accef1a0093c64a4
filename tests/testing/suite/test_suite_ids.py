"""Ids of tests: made of plug-in and parameters, independent of other tests, and words for ``-k``."""

from __future__ import annotations

import re
from html import escape

import pytest
from _pytest.mark.expression import Expression
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.testing.selection import parse_expression
from rtf.testing.suite.ids import NameBook, TestIds, former, label_of_name, label_of_plugin, renewed, suite_id
from rtf.testing.suite.xml import load_suite_bytes

PARAMS = st.sampled_from(["", "--speed 20", "--speed -20", "--from left_arm.ini", "--from right_arm.ini --speed 20"])
#: Tests that a suite may have: plug-in, param, a parameter of its own.
ENTRIES = st.tuples(
    st.sampled_from(["Nod", "a/Nod.py", "JointLimits"]),
    PARAMS | st.text('abc -/"\u00e9', max_size=60),
    st.sampled_from(["", "left", "right arm"]),
)
Entry = tuple[str, str, str]


def ids_of(entries: list[Entry]) -> list[str]:
    """Return the ids in a suite of these tests."""
    tests = ""
    for plugin, param, part in entries:
        parameter = f'<parameter name="part">{part}</parameter>' if part else ""
        tests += f'<test param="{escape(param)}">{parameter}{plugin}</test>'
    suite = load_suite_bytes(f'<suite name="S">{tests}</suite>'.encode(), "s.xml", variables={}).suite
    return [test.id for test in suite.tests]


def label_of(entry: Entry) -> str:
    """Return the label of a test."""
    plugin, param, part = entry
    return label_of_plugin(plugin, param, [("part", part)] if part else [])


@settings(deadline=None)
@given(st.lists(ENTRIES, unique_by=label_of, max_size=6), st.data())
def test_id_stays_when_other_tests_come_and_go(entries: list[Entry], data: st.DataObject):
    """A test has the same id in any order and any part of a suite."""
    before = dict(zip(entries, ids_of(entries), strict=True))
    others = data.draw(st.permutations(entries))[: data.draw(st.integers(0, len(entries)))]
    assert ids_of(others) == [before[entry] for entry in others]


@settings(deadline=None)
@given(st.lists(ENTRIES, max_size=8))
def test_id_is_unique_and_a_word_for_k(entries: list[Entry]):
    """Ids are unique, and one word for ``-k`` of this runner and of pytest."""
    ids = ids_of(entries)
    assert len({*ids}) == len(ids)
    for test in ids:
        assert re.fullmatch(r"s/[A-Za-z0-9._-]+(\[[A-Za-z0-9._-]+\])?(\+[0-9]+)?", test)
        assert len(test) < 200
        assert Expression.compile(f"{test} and not x").evaluate(lambda word, /, test=test, **_: word == test)
        assert parse_expression(f"{test} and not x").holds(lambda word, test=test: word == test)


@pytest.mark.parametrize(
    ("plugin", "param", "parameters", "variant", "label"),
    [
        ("Nod", "", [], (), "Nod"),
        ("checks/Nod.py", "", [], (), "Nod"),
        ("libNod.so.2", "", [], (), "libNod"),
        ("JointLimits", "--from left_arm.ini", [], (), "JointLimits[left_arm]"),
        ("JointLimits", "--speed 20 --joint 3", [], (), "JointLimits[speed-20-joint-3]"),
        ("JointLimits", "--speed -20", [], (), "JointLimits[speed--20]"),
        ("JointLimits", "", [("part", "left_arm")], (), "JointLimits[part-left_arm]"),
        ("JointLimits", "--from x.ini", [("part", "x")], ("left_arm", "20"), "JointLimits[left_arm-20]"),
        ("JointLimits", "--port /icub/head", [], (), "JointLimits[port--icub-head-af03b3]"),
        ("\u89c6\u89c9", "", [], (), "test"),
    ],
)
def test_label_is_made_of_plugin_and_parameters(plugin, param, parameters, variant, label):
    """A label is short and readable; a digest replaces what does not fit."""
    assert label_of_plugin(plugin, param, parameters, variant) == label


def test_only_the_same_test_is_numbered():
    """Equal tests are numbered; a different test with the same label gets a digest."""
    one, other = TestIds("s"), TestIds("s")
    assert [one.unique("Nod", "a"), one.unique("Nod", "a"), one.unique("Nod", "b")][:2] == ["s/Nod", "s/Nod+2"]
    third = one.unique("Nod", "b")
    other.unique("Nod", "a")
    assert other.unique("Nod", "b") + "+2" == third


def test_suites_of_one_name_are_told_apart_by_their_files():
    """Suites of one name have their file's name in the id, or a number if that is the same."""
    names = NameBook("+")
    ids = [suite_id("Arm", file, names) for file in ("lab/arm.xml", "lab/second.xml", "lab/second.xml", "")]
    assert ids == ["arm", "arm[second]", "arm+2", "arm+3"]


@pytest.mark.parametrize(
    ("old", "name", "new"),
    [
        ("s/jointlimits-left_arm", "JointLimits [left_arm]", "s/JointLimits[left_arm]"),
        ("s/jointlimits-left_arm~2", "JointLimits [left_arm]", "s/JointLimits[left_arm]+2"),
        ("s/left-arm", "Left arm", "s/Left-arm"),
        ("s/nod", "renamed by the test", "s/nod"),
    ],
)
def test_id_of_an_older_version_has_its_successor(old: str, name: str, new: str):
    """An id of an older version is translated into the present one, and back."""
    assert renewed(old, "s", name) == new
    assert former(new) == old
    assert label_of_name(name) == new.removeprefix("s/").removesuffix("+2") or name == "renamed by the test"
