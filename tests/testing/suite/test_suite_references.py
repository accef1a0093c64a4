"""References in suites: of fixtures to fixtures, tests to fixtures and tests, and files to files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.suite.xml import LoadedSuite, load_suite, load_suite_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.suite.model import TestSuite


def load(text: str, file: str = "s.xml", **variables: str) -> LoadedSuite:
    """Load a suite from a text."""
    return load_suite_bytes(text.encode(), file, variables=variables)


def sound(body: str, attributes: str = 'name="S"', **variables: str) -> TestSuite:
    """Load a suite that must have no problem."""
    loaded = load(f"<suite {attributes}>{body}</suite>", **variables)
    assert loaded.diagnostics == ()
    return loaded.suite


def problems(body: str, attributes: str = 'name="S"') -> list[str]:
    """Return the problems of a suite with this content."""
    return [str(diagnostic) for diagnostic in load(f"<suite {attributes}>{body}</suite>").diagnostics]


def plugins(suite: TestSuite) -> list[str]:
    """Return the plug-ins of the tests, in order."""
    return [test.plugin for test in suite.tests]


# --- fixtures ---------------------------------------------------------------------------------------------------------


def test_fixtures_without_names_are_named_after_their_plugins():
    """A fixture without a name is named after its plug-in, with a number if that is taken."""
    suite = sound(
        '<fixture>p.py</fixture><fixture>p</fixture><fixture name="q">p</fixture><fixture name="p~2">p</fixture>'
    )
    assert [fixture.name for fixture in suite.fixtures] == ["p", "p~3", "q", "p~2"]


def test_fixtures_start_in_file_order_as_far_as_they_depend():
    """Fixtures start in the order of the file, after those that they depend on."""
    suite = sound(
        '<fixture name="d" depends="b,a">F</fixture><fixture name="c">F</fixture><fixture name="b">F</fixture>'
        '<fixture name="a" depends="b">F</fixture>',
    )
    assert [fixture.name for fixture in suite.fixtures] == ["c", "b", "a", "d"]


def test_fixtures_in_a_circle_are_named():
    """Fixtures that depend on each other are an error with the circle; dependent ones are named apart."""
    loaded = load(
        '<suite name="S"><fixture name="a" depends="c">F</fixture><fixture name="b" depends="a">F</fixture>'
        '<fixture name="c" depends="b">F</fixture><fixture name="d" depends="c">F</fixture>'
        '<fixture name="e">F</fixture>'
        '<test fixtures="d">A</test></suite>',
    )
    assert [fixture.name for fixture in loaded.suite.fixtures] == ["e"]
    messages = [error.text for error in loaded.errors]
    assert "fixtures depend on each other in a circle: a -> c -> b -> a" in messages
    assert "fixture 'd' is left out, because something it depends on could not be used" in messages
    assert "test 'A' needs the fixture 'd', which could not be used" in messages


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<fixture name="a" depends="a">F</fixture>', "in a circle: a -> a"),
        ('<fixture name="robot">F</fixture><fixture depends="robto">F</fixture>', "did you mean 'robot'?"),
        ('<fixture name="robot">F</fixture><test fixtures="robto">T</test>', "did you mean 'robot'?"),
        ('<fixture name="a">F</fixture><fixture name="a">F</fixture>', "'a' is already defined at s.xml:1:17"),
        (
            '<fixture name="a">F</fixture><fixture depends="a" scope="run">G</fixture>',
            "lasts the whole run but depends",
        ),
    ],
)
def test_fixtures_that_cannot_be_used_are_errors(body: str, message: str):
    """Each invalid fixture is an error with its reason."""
    assert any(message in problem for problem in problems(body))


# --- requirements -----------------------------------------------------------------------------------------------------


def test_a_required_test_may_be_named_by_id_or_by_name():
    """A requirement names a test by id or name; a shared name means all its tests."""
    suite = sound(
        '<test name="Left arm">A</test><test name="Left arm">A</test>'
        """<test requires="test:s/left-arm">B</test><test requires="test:Left-arm+2,test:other/x">C</test>"""
        """<test requires="'test:Left arm' feature">D</test>""",
    )
    assert [test.requires for test in suite.tests[2:]] == [
        ("test:s/Left-arm",),
        ("test:s/Left-arm+2", "test:other/x"),
        ("test:s/Left-arm", "test:s/Left-arm+2", "feature"),
    ]


@pytest.mark.parametrize(
    "body",
    [
        '<test requires="test:b">A</test><test>B</test>',
        '<test requires="test:a">A</test>',
        '<test requires="test:s/none">A</test>',
    ],
)
def test_a_test_cannot_require_what_does_not_stand_before_it(body: str):
    """A requirement of a later or unknown test is an error."""
    (problem,) = problems(body)
    assert "which does not stand before it" in problem


# --- includes ---------------------------------------------------------------------------------------------------------


def write(folder: Path, **files: str) -> Path:
    """Write suite files into a folder."""
    for name, text in files.items():
        (folder / f"{name}.xml").write_text(text, encoding="utf-8")
    return folder


def test_an_include_stands_where_its_tests_run(tmp_path: Path):
    """The tests of an include run at its place; a loop around it varies them."""
    write(
        tmp_path,
        main='<suite name="M"><test>A</test><for name="p" in="x y"><include>arm.xml</include></for>'
        "<test>B</test></suite>",
        arm='<suite name="Arm" preload="json"><fixture>F</fixture><test param="${p}">J</test></suite>',
    )
    suite = load_suite(tmp_path / "main.xml").suite
    assert [test.id for test in suite.tests] == ["m/A", "m/J[x]", "m/J[y]", "m/B"]
    assert ([fixture.name for fixture in suite.fixtures], suite.preload) == (["F"], ("json",))


def test_an_include_may_go_up_the_folders(tmp_path: Path):
    """An include may name a file in a parent folder."""
    (tmp_path / "sub").mkdir()
    write(tmp_path, part='<suite name="P"><test>A</test></suite>')
    write(tmp_path / "sub", main='<suite name="M"><include>../part.xml</include></suite>')
    assert plugins(load_suite(tmp_path / "sub" / "main.xml").suite) == ["A"]


@pytest.mark.parametrize(
    "target", ["", "/etc/passwd", "http://x/y.xml", "file:x.xml", "~/x.xml", "\\\\host\\x.xml", "C:x"]
)
def test_an_include_is_a_relative_path(target: str):
    """An absolute path or URL in an include is an error."""
    (problem,) = problems(f"<include>{target}</include>")
    assert "error: an <include> cannot be" in problem


def test_files_that_include_each_other_are_named(tmp_path: Path):
    """Files that include each other are an error with the circle."""
    write(
        tmp_path,
        a='<suite name="A"><include>b.xml</include></suite>',
        b='<suite name="B"><include>./a.xml</include></suite>',
    )
    (error,) = load_suite(tmp_path / "a.xml").errors
    assert "circle: a.xml -> b.xml -> a.xml" in error.text
    assert str(tmp_path / "b.xml") == error.file


def test_problems_of_an_included_file_have_its_own_place(tmp_path: Path):
    """An error in an included file has its own place; a malformed file spoils the suite."""
    write(tmp_path, main='<suite name="M"><include>bad.xml</include></suite>', bad='<suite name="B">\n<test>A</suite>')
    loaded = load_suite(tmp_path / "main.xml")
    assert loaded.suite is None
    assert (str(tmp_path / "bad.xml"), 2) == (loaded.errors[0].file, loaded.errors[0].line)


def test_one_fixture_in_two_files_is_one_fixture_unless_they_differ(tmp_path: Path):
    """Equal fixtures of two files are one; differences are an error that names them."""
    write(
        tmp_path,
        main='<suite name="M"><fixture>f</fixture><include>same.xml</include><include>other.xml</include></suite>',
        same='<suite name="S"><fixture>f</fixture></suite>',
        other='<suite name="O"><fixture param="x" restarts="1">f</fixture></suite>',
    )
    loaded = load_suite(tmp_path / "main.xml")
    assert [fixture.name for fixture in loaded.suite.fixtures] == ["f"]
    (error,) = loaded.errors
    assert "differs from the one at" in error.text
    assert "in param, restarts" in error.text


@pytest.mark.parametrize("target", ["none.xml", ".", "a\N{REPLACEMENT CHARACTER}"])
def test_what_cannot_be_included_is_an_error(tmp_path: Path, target: str):
    """An include that cannot be read is an error, and the other tests stay."""
    write(tmp_path, main=f'<suite name="M"><include>{target}</include><test>A</test></suite>')
    loaded = load_suite(tmp_path / "main.xml")
    assert plugins(loaded.suite) == ["A"]
    assert "cannot include" in loaded.errors[0].text


@given(st.lists(st.lists(st.integers(0, 9), max_size=3), max_size=10))
def test_whatever_depends_on_whatever_the_order_is_sound_or_there_is_an_error(graph: list[list[int]]):
    """For any dependencies the suite has all fixtures in order, or an error."""
    body = "".join(
        f'<fixture name="f{index}" depends="{" ".join(f"f{other}" for other in others)}">F</fixture>'
        for index, others in enumerate(graph)
    )
    loaded = load(f'<suite name="S">{body}</suite>')
    assert (len(loaded.suite.fixtures) == len(graph)) == (not loaded.errors)
