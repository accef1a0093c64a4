"""Our JUnit compared with the junit-xml library's: both files say the same of a run, and ``junit_file`` reads both."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from lxml import etree

from rtf.testing.events import OutputCaptured
from rtf.testing.languages.case_report import read_junit
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from tests.reports.conftest import Reports, Story

junit_xml = pytest.importorskip("junit_xml")

TEXT = 'a <b> & "c" ]]> é\n'
#: Attributes that only the library writes: they have no reader, or (``disabled``) RTF counts them as skipped.
LEFT_OUT = {"disabled"}


@pytest.fixture
def ours(story: Story, reports: Reports) -> Path:
    """The file that RTF writes of a run with everything that the library has a word for."""
    said = [
        OutputCaptured(stream="stdout", text=TEXT, test="arm/t1"),
        OutputCaptured(stream="stderr", text=TEXT, test="arm/t1"),
    ]
    story.begin(("arm", 4)).start("arm").test("arm/t1", Verdict.PASSED, *said)
    story.test("arm/t2", Verdict.FAILED, detail=TEXT).test("arm/t3", Verdict.ERROR, detail=TEXT, reason="crash")
    story.test("arm/t4", Verdict.SKIPPED, detail="no robot").end("arm", Verdict.FAILED).finish()
    return reports("junit", story, extra={"junit-family": "rich"})


@pytest.fixture
def theirs(ours: Path, tmp_path: Path) -> Path:
    """The file that the library writes of the same run."""
    made = [
        junit_xml.TestCase(f"t{number}", "icubSim.arm", 0.25, file="/lab/suites/arm.xml", line=number)
        for number in range(1, 5)
    ]
    made[0].stdout = made[0].stderr = TEXT
    made[1].add_failure_info(TEXT, TEXT, "failed")
    made[2].add_error_info(TEXT, TEXT, "crash")
    made[3].add_skipped_info("no robot", "no robot")
    properties = {"robot": "icubSim", "rtf": "0.1", "run": "run-1", "command": "rtf", "host": "bench"}
    (started,) = etree.parse(ours).xpath("//testsuite/@timestamp")
    suite = junit_xml.TestSuite("arm", made, "bench", "arm", None, started, properties, "/lab/suites/arm.xml")
    path = tmp_path / "library.xml"
    path.write_text(junit_xml.to_xml_report_string([suite]), encoding="utf-8")
    return path


def said_by(node: etree._Element) -> dict[str, str]:
    """Return an element's text and its attributes except the time; the library loses line ends in attributes."""
    pairs = {str(name): " ".join(str(value).split()) for name, value in node.attrib.items() if name != "time"}
    return {**pairs, "": (node.text or "").strip()}


def test_we_write_what_the_library_writes(ours: Path, theirs: Path):
    """Each element of the library's file is in ours, in the same place, with the same attributes and the same text."""
    mine, others = etree.parse(ours).getroot(), etree.parse(theirs).getroot()
    for path in (".", "testsuite", "testsuite/testcase", "testsuite/properties/property", *problems()):
        found = [said_by(node) for node in mine.iterfind(path)]
        wanted = [said_by(node) for node in others.iterfind(path)]
        assert wanted, path
        for want in wanted:
            expected = {name: value for name, value in want.items() if name not in LEFT_OUT and (value or name)}
            assert any(expected.items() <= one.items() for one in found), (path, expected, found)
    times = [float(case.get("time")) for case in mine.iter("testcase")]
    assert times == [float(case.get("time")) for case in others.iter("testcase")]


def problems() -> list[str]:
    """Return the paths of the elements inside a case."""
    return [f"testsuite/testcase/{name}" for name in ("failure", "error", "skipped", "system-out", "system-err")]


def test_the_junit_file_kind_reads_what_both_write(ours: Path, theirs: Path):
    """The kind ``junit_file`` reads the same cases from the library's file and from ours."""
    assert read_junit(ours) == read_junit(theirs)
    kinds = [(case.name, [problem.kind for problem in case.problems], case.skipped) for case in read_junit(ours)]
    assert kinds == [("t1", [], None), ("t2", ["failure"], None), ("t3", ["error"], None), ("t4", [], "no robot")]
