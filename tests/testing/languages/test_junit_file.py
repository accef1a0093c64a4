"""JUnit files of programs under test, of GoogleTest and others, and hostile ones."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf import clock
from rtf.testing.languages import case_report
from rtf.testing.languages.case_report import JunitCase, JunitFileError, JunitProblem, read_junit

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

GTEST = """<?xml version="1.0" encoding="UTF-8"?>
<testsuites tests="3" failures="1" disabled="1" errors="0" time="0.01" name="AllTests">
  <testsuite name="Joint" tests="3" failures="1" disabled="1" errors="0" time="0.01">
    <testcase name="Moves" file="/src/j.cc" line="5" status="run" result="completed" time="0.25" classname="Joint" />
    <testcase name="Stops" status="run" result="completed" time="0." classname="Joint">
      <failure message="/src/j.cc:12&#x0A;Failed" type=""><![CDATA[/src/j.cc:12
Failed]]></failure>
    </testcase>
    <testcase name="DISABLED_Burns" status="notrun" result="suppressed" time="0." classname="Joint" />
  </testsuite>
</testsuites>
"""


@pytest.fixture
def read(tmp_path: Path):
    """Return a function that reads a JUnit file with this content."""

    def of(content: str | bytes) -> list[JunitCase]:
        path = tmp_path / "junit.xml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_junit(path)

    return of


def test_the_file_of_googletest(read: Callable[[str | bytes], list[JunitCase]]):
    """Failures have their place, and disabled tests are skipped."""
    text = "/src/j.cc:12\nFailed"
    assert [
        JunitCase("Moves", "Joint", "Joint", time=0.25, file="/src/j.cc", line=5),
        JunitCase("Stops", "Joint", "Joint", (JunitProblem("failure", text, text, "/src/j.cc", 12),), time=0.0),
        JunitCase("DISABLED_Burns", "Joint", "Joint", skipped="disabled", time=0.0),
    ] == read(GTEST)


def test_failures_errors_and_skips_are_told_apart(read: Callable[[str | bytes], list[JunitCase]]):
    """A case may have several problems; without a message the type is the text."""
    cases = read(
        """<testsuite name="s"><testcase name="a"><failure type="T">x</failure><error message="m"/></testcase>
        <testcase name="b" classname="c"><skipped message="no robot"/></testcase>
        <testcase name="d"><skipped/></testcase></testsuite>"""
    )
    assert [problem.kind for problem in cases[0].problems] == ["failure", "error"]
    assert [str(problem) for problem in cases[0].problems] == ["T\nx", "m"]
    assert [case.skipped for case in cases[1:]] == ["no robot", "skipped"]
    assert [case.subject for case in cases] == ["s.a", "c.b", "s.d"]


def test_nested_suites_and_foreign_elements(read: Callable[[str | bytes], list[JunitCase]]):
    """Cases are found at any depth and in any namespace; other elements are ignored."""
    cases = read(
        """<testsuites xmlns="urn:x"><!-- c --><testsuite name="o"><properties><property name="p"/></properties>
        <testsuite name="i"><testcase name="a"><system-out>x</system-out><?pi?></testcase></testsuite></testsuite>
        </testsuites>"""
    )
    assert [JunitCase("a", "", "i")] == cases


@pytest.mark.parametrize(("text", "time"), [("1,234.5", 1234.5), ("", None), ("x", None), ("nan", None), ("-1", None)])
def test_times_that_are_none_are_left_out(
    read: Callable[[str | bytes], list[JunitCase]], text: str, time: float | None
):
    """An invalid time is None."""
    assert time == read(f'<testsuite><testcase name="a" time="{text}"/></testsuite>')[0].time


BOMB = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 10))


@pytest.mark.parametrize(
    ("content", "part"),
    [
        ("", "is empty"),
        ("  \n", "is empty"),
        ("not XML", "no XML"),
        ("<testsuite>", "no XML"),
        ("<html/>", "<html> is no root"),
        ("<!DOCTYPE t><testsuite/>", "document type"),
        (f'<!DOCTYPE t [<!ENTITY e0 "x">{BOMB}]><testsuite><testcase name="a">&e9;</testcase></testsuite>', ""),
        ('<!DOCTYPE t SYSTEM "http://127.0.0.1:1/x.dtd"><testsuite/>', "document type"),
        ('<!DOCTYPE t [<!ENTITY e SYSTEM "file:///etc/passwd">]><testsuite name="&e;"/>', ""),
        ("<testsuite>" * 300 + "</testsuite>" * 300, "no XML"),
        (b"\x00\x01\x02", "no XML"),
        ('<?xml version="1.0" encoding="no-such"?><testsuite/>', "no XML"),
        (GTEST[: len(GTEST) // 2], "no XML"),
    ],
)
def test_what_is_no_junit_file_is_an_own_error(
    read: Callable[[str | bytes], list[JunitCase]], content: str | bytes, part: str
):
    """Any other file raises JunitFileError; entities are not expanded, and nothing is fetched."""
    began = clock.monotonic()
    with pytest.raises(JunitFileError, match=r"junit\.xml") as caught:
        read(content)
    assert part in str(caught.value)
    assert clock.monotonic() - began < 5


def test_size_and_number_of_cases_are_bounded(
    read: Callable[[str | bytes], list[JunitCase]], monkeypatch: pytest.MonkeyPatch
):
    """Size and number of cases have a limit."""
    monkeypatch.setattr(case_report, "MAX_CASES", 2)
    with pytest.raises(JunitFileError, match="more than 2 test cases"):
        read(f"<testsuite>{'<testcase/>' * 3}</testsuite>")
    monkeypatch.setattr(case_report, "MAX_SIZE", 1 << 20)
    with pytest.raises(JunitFileError, match="larger than 1 MiB"):
        read(b"<testsuite>" + b" " * (1 << 20))


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=40))
def test_every_text_comes_back(tmp_path_factory: pytest.TempPathFactory, text: str):
    """The text of a failure is read unchanged."""
    from xml.sax.saxutils import escape

    path = tmp_path_factory.getbasetemp() / "property.xml"
    content = f'<testsuite><testcase name="a"><failure>{escape(text)}</failure></testcase></testsuite>'
    path.write_text(content, encoding="utf-8")
    assert text.strip() == read_junit(path)[0].problems[0].text


@pytest.mark.fuzz
def test_mutated_files_do_no_harm(read: Callable[[str | bytes], list[JunitCase]]):
    """A damaged file is read, or raises JunitFileError."""
    chance = random.Random(7)
    data = GTEST.encode()
    for _ in range(500):
        mutated = bytearray(data)
        for _ in range(chance.randint(1, 6)):
            mutated[chance.randrange(len(mutated))] = chance.choice(b"<>/&\"' \x00\xffax1")
        try:
            cases = read(bytes(mutated))
        except JunitFileError:
            continue
        assert all(isinstance(case, JunitCase) for case in cases)
