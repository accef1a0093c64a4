"""The suite model: consistent when it is made, with stable ids."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.errors import Location, RtfError
from rtf.testing.suite.ids import NameBook, slug
from rtf.testing.suite.model import (
    Expected,
    FixtureEntry,
    Isolation,
    LostPolicy,
    Scope,
    SuiteError,
    TestEntry,
    TestSuite,
    Timeouts,
    number_suites,
    suite_id_of,
)
from rtf.testing.suite.values import parse_duration, parse_integer, plugin_stem, split_words, substitute


def entry(name: str, **more: object) -> TestEntry:
    """Return a test of the suite."""
    return TestEntry(id=f"s/{name}", name=name, plugin="P", **more)


def suite(**more: object) -> TestSuite:
    """Return a suite called S."""
    return TestSuite(id="s", name="S", **more)


def test_a_test_has_the_documented_defaults():
    """A test needs id, name and plug-in only."""
    test = TestEntry(id="s/a", name="a", plugin="A")
    assert (0, 0, Isolation.TEST, Expected.PASS, LostPolicy.RERUN, None, Timeouts()) == (
        test.repetition,
        test.retries,
        test.isolation,
        test.expected,
        test.on_lost,
        test.fixtures,
        test.timeouts,
    )
    assert Location() == test.location


def test_a_fixture_has_the_documented_defaults():
    """A fixture has three restarts, and half a second of back-off and check period."""
    fixture = FixtureEntry(name="f", plugin="F")
    assert (
        fixture.restarts,
        fixture.backoff,
        fixture.check_period,
        fixture.scope,
        fixture.on_lost,
    ) == (3, 0.5, 0.5, Scope.SUITE, None)


def test_two_tests_with_one_id_are_refused():
    """Two tests with one id are refused."""
    with pytest.raises(SuiteError, match="two tests with the id 's/a'"):
        suite(tests=(entry("a"), entry("a")))


def test_two_fixtures_with_one_name_are_refused():
    """Two fixtures with one name are refused."""
    with pytest.raises(SuiteError, match="two fixtures named 'f'"):
        suite(fixtures=(FixtureEntry(name="f", plugin="F"), FixtureEntry(name="f", plugin="G")))


def test_a_fixture_stands_behind_what_it_depends_on():
    """A fixture before one that it depends on is refused."""
    one, two = FixtureEntry(name="one", plugin="F"), FixtureEntry(name="two", plugin="F", depends=("one",))
    assert (one, two) == suite(fixtures=(one, two)).fixtures
    with pytest.raises(SuiteError, match="'one', which does not stand before it"):
        suite(fixtures=(two, one))


def test_a_test_names_fixtures_of_its_suite():
    """A test with an unknown fixture is refused."""
    with pytest.raises(SuiteError, match=r"test 's/a'.*'robot'"):
        suite(tests=(entry("a", fixtures=("robot",)),))


def test_suite_errors_are_errors_of_the_framework_and_value_errors():
    """SuiteError is an RtfError and a ValueError."""
    assert issubclass(SuiteError, RtfError)
    assert issubclass(SuiteError, ValueError)


def test_the_fixtures_of_a_test_include_what_those_depend_on():
    """The fixtures of a test include those that its fixtures depend on, and no others."""
    fixtures = (
        FixtureEntry(name="simulator", plugin="F"),
        FixtureEntry(name="camera", plugin="F", depends=("simulator",)),
        FixtureEntry(name="robot", plugin="F", depends=("simulator",)),
        FixtureEntry(name="gaze", plugin="F", depends=("robot",)),
    )
    whole = suite(fixtures=fixtures, tests=(entry("a", fixtures=("gaze",)), entry("b"), entry("c", fixtures=())))
    names = [[fixture.name for fixture in whole.fixtures_of(test)] for test in whole.tests]
    assert names == [["simulator", "robot", "gaze"], ["simulator", "camera", "robot", "gaze"], []]


def test_timeouts_fall_back_one_by_one():
    """A limit that a test does not set is that of the suite."""
    test = entry("a", timeouts=Timeouts(run=5))
    whole = suite(timeouts=Timeouts(setup=1, run=2), tests=(test,))
    assert Timeouts(setup=1, run=5) == whole.timeouts_of(test)


def test_suites_of_one_name_are_numbered_and_their_tests_follow():
    """Suites of one name are numbered in a run, with the ids and requirements of their tests."""
    tests = (entry("a"), entry("b", requires=("test:s/a", "env:HOME", "test:other/x")))
    first, second, third = number_suites([suite(tests=tests)] * 3)
    assert (first.id, second.id, third.id) == ("s", "s+2", "s+3")
    assert [test.id for test in second.tests] == ["s+2/a", "s+2/b"]
    assert third.tests[1].requires == ("test:s+3/a", "env:HOME", "test:other/x")
    assert third.tests[1].required_tests == ("s+3/a", "other/x")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Arm suite", "arm-suite"),
        ("JointLimits [left_arm]", "jointlimits-left_arm"),
        ("robot's stream", "robot-s-stream"),
        ("Größe 5µm", "groe-5m"),
        ("../../etc/passwd", "etc-passwd"),
        ("视觉", "suite"),
        ("", "suite"),
    ],
)
def test_ids_are_link_friendly(name: str, expected: str):
    """An id has only characters that are harmless in links and file names."""
    assert expected == suite_id_of(name)


@given(st.text())
def test_any_name_gives_a_usable_slug(name: str):
    """A slug of any text is a non-empty word of harmless characters, and its own slug."""
    made = slug(name, "x")
    assert made.isascii()
    assert 0 < len(made) <= 100
    assert set(made) <= set("abcdefghijklmnopqrstuvwxyz0123456789._-")
    assert made == slug(made, "x")
    assert not made.startswith(".")


@given(st.lists(st.sampled_from(["a", "b", "a~2"])), st.sets(st.sampled_from(["a", "a~2", "a~3"])))
def test_a_name_book_never_repeats_itself(names: list[str], reserved: set[str]):
    """A name book returns each name once, and no reserved one."""
    book = NameBook()
    for name in reserved:
        book.reserve(name)
    given_out = [book.unique(name) for name in names]
    assert len(set(given_out)) == len(names)
    assert not reserved & set(given_out)


@pytest.mark.parametrize(
    ("plugin", "stem"),
    [
        ("CameraTest", "CameraTest"),
        ("PositionDirect.so", "PositionDirect"),
        ("libx.so.2", "libx"),
        ("checks/encoders.py", "encoders"),
        ("./encoders.v2.py", "encoders.v2"),
        ("C:\\tests\\arm.dll", "arm"),
        (".py", ".py"),
        ("/", "/"),
    ],
)
def test_the_stem_of_a_plugin_is_its_name_without_folder_and_ending(plugin: str, stem: str):
    """The stem of a plug-in has no folder and no suffix."""
    assert stem == plugin_stem(plugin)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("20", 20), ("1.5", 1.5), (".5", 0.5), ("200ms", 0.2), ("3 min", 180), ("1h", 3600), (" 7 s ", 7)],
)
def test_durations_are_seconds_unless_a_unit_says_otherwise(text: str, seconds: float):
    """Durations with and without units are read as seconds."""
    assert seconds == pytest.approx(parse_duration(text, 0.001, 1e6))


@pytest.mark.parametrize("text", ["", "x", "1e3", "-1", "nan", "inf", "1 day", "1,5", "٣", "1_000", "0", "999h"])
def test_what_is_no_duration_or_out_of_range_is_refused(text: str):
    """The error about an invalid duration has the range."""
    with pytest.raises(ValueError, match=r"from 0.001 s to 3600 s"):
        parse_duration(text, 0.001, 3600)


@pytest.mark.parametrize("text", ["", "1.0", "1e3", "-1", "11", "٣", "1_0", "0x1"])
def test_what_is_no_whole_number_or_out_of_range_is_refused(text: str):
    """The error about an invalid number has the range."""
    with pytest.raises(ValueError, match="from 0 to 10"):
        parse_integer(text, 0, 10)


@given(st.lists(st.text(st.characters(exclude_characters="\"'", exclude_categories=["Cs"]))))
def test_words_in_quotes_come_back_as_they_were(words: list[str]):
    """Quoted words are read unchanged."""
    assert tuple(words) == split_words(" ".join(f'"{word}"' for word in words))


@given(st.text(alphabet="${}ab "), st.dictionaries(st.sampled_from(["a", "b"]), st.text(alphabet="${}ab ")))
def test_substitution_leaves_unknown_names_and_does_not_look_into_values(text: str, bindings: dict[str, str]):
    """Each known variable is replaced once; unknown ones stay, and values are not substituted."""
    expected = text
    for name in bindings:
        expected = expected.replace(f"${{{name}}}", f"\0{name}\0")
    for name, value in bindings.items():
        expected = expected.replace(f"\0{name}\0", value)
    assert expected == substitute(text, bindings)
