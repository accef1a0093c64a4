"""Suites on several workers: reports are complete, and no fixture is up twice at a time."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from harness import read_back
from rtf.testing.verdict import Verdict

FIXTURE = '<fixture name="robot"> Robot </fixture>'
TESTS = "".join(f'<test name="t{number}"> Fine </test>' for number in range(4))


def records(folder: Path) -> dict[str, Verdict]:
    """Return the verdicts of all workers' journals; each test is in one of them."""
    found = {}
    for run in sorted((folder / "rtf-runs").iterdir()):
        if run.is_symlink():
            continue
        events, results = read_back(run)
        assert events[-1].kind == "run_ended"
        assert not found.keys() & results.tests.keys()
        found |= {test: result.verdict for test, result in results.tests.items()}
    return found


@pytest.mark.parametrize("mode", ["load", "loadfile"])
def test_fixture_is_up_once_at_a_time(lab, mode):
    """Suites with the same fixture wait for each other, whether tests or files are distributed."""
    files = [lab.suite(FIXTURE + TESTS, name) for name in ("one", "two")]
    finished = lab.run(*files, "-p", "xdist", "-n", "2", "--dist", mode)
    assert finished.last_line.startswith("8 passed"), finished.out
    assert lab.log == ["up", "down"] * (len(lab.log) // 2)
    assert len(records(lab.folder)) == 8
    assert not [*Path(tempfile.gettempdir()).glob(f"rtf-fixtures-{finished_session(finished)}*.lock")]


def finished_session(finished) -> str:
    """Return the id of a session from its workers' journals."""
    return finished.events[0].environment["session"]


def test_reports_survive_the_way_from_the_worker(lab):
    """Words, places, sections, properties and warnings are those of a session without workers."""
    lab.suite(
        '<test name="arm"> Measures </test><test name="f" retries="1"> Flaky </test><test name="n"> NoTest </test>'
    )
    finished = lab.run("s.xml", "-p", "xdist", "-n", "1", "--junit-xml=junit.xml", "-o", "junit_logging=all")
    assert finished.last_line.startswith("1 failed, 1 passed, 1 warning, 1 error")
    expected = "FAILED s.xml::arm - left: position = 12.5 deg, expected within [0, 10] deg, margin -2.5 deg"
    assert finished.line("FAILED") == expected
    assert "FlakyTestWarning: passed at attempt 2" in finished.out
    case = finished.cases()["arm"]
    properties = {item.get("name"): item.get("value") for item in case.iter("property")}
    assert properties["measurement.left.position"] == "12.5"
    assert "at tests.py:18" in case.find("failure").text
    assert "FAILURE  left: measures" in case.find("system-out").text


def test_tests_that_belong_together_are_marked(lab):
    """Suites that share a fixture, or have requirements, are one group."""
    lab.write(
        conftest__py=(
            "def pytest_collection_finish(session):\n"
            "    for item in session.items:\n"
            "        print(item.nodeid, [mark.args[0] for mark in item.iter_markers('xdist_group')])\n"
        )
    )
    lab.suite(f'{FIXTURE}<test name="a"> Fine </test>', "one")
    lab.suite(f'{FIXTURE}<test name="a"> Fine </test>', "two")
    lab.suite('<test name="a"> Fine </test><test name="b" requires="test:a"> Fine </test>', "three")
    lab.suite('<test name="a"> Fine </test>', "four")
    finished = lab.run("--rtf", "-p", "xdist", "--collect-only", "-q", "-s", "--strict-markers")
    for line in ("one.xml::a ['one']", "two.xml::a ['one']", "three.xml::b ['three']", "four.xml::a []"):
        assert line in finished.out, finished.out


def test_each_worker_writes_a_report_of_its_own(lab):
    """A report's file is named after its worker."""
    lab.suite(TESTS)
    finished = lab.run("s.xml", "-p", "xdist", "-n", "2", "--rtf-report", "json=out.json")
    assert finished.exit_code == 0
    assert sorted(path.name for path in lab.folder.glob("out*.json")) == ["out-gw0.json", "out-gw1.json"]
    assert "robot tests: out-gw0.json" in finished.out


def test_worker_that_breaks_is_an_internal_error(lab):
    """An internal error of a worker is reported by the session."""
    broken = "from rtf.testing import Reporter\nclass Broken(Reporter):\n    def handle(self, event, results): 1 / 0\n"
    lab.write(**{"reports/broken.py": broken})
    arguments = (lab.suite(TESTS), "-p", "xdist", "-n", "1", "--rtf-report", "broken")
    finished = lab.run(*arguments, RTF_PLUGIN_PATH=str(lab.folder / "reports"))
    assert finished.exit_code == pytest.ExitCode.INTERNAL_ERROR
    assert "robot tests: internal error: reporter" in finished.out


def test_report_that_a_worker_cannot_write_is_an_error_of_its_tests(lab):
    """A report that a worker cannot write is an error of its tests."""
    finished = lab.run(lab.suite(TESTS), "-p", "xdist", "-n", "1", "--rtf-report", "json=/proc/no/such.json")
    assert finished.last_line.startswith("4 errors")
    assert "robot tests: report json cannot be written" in finished.line("ERROR s.xml::t3")


def test_live_page_is_for_one_process(lab):
    """The live page with several workers is refused with a hint."""
    finished = lab.run(lab.suite(TESTS), "-p", "xdist", "-n", "2", "--rtf-report", "web")
    assert finished.exit_code == pytest.ExitCode.USAGE_ERROR
    assert "leave out -n, or write 'html' instead" in finished.out
