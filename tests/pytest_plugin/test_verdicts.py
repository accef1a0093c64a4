"""Each verdict in pytest: outcome, words, sections and properties, all in one session."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from rtf.testing.verdict import Verdict

SUITE = """
<test name="fine"> Fine </test>
<test name="arm"> Measures </test>
<test name="crash"> Crashes </test>
<test name="hang" timeout="1.5"> Hangs </test>
<test name="skip"> Skips </test>
<test name="unsure"> Unsure </test>
<test name="flaky" retries="1"> Flaky </test>
<test name="bug"> Raises </test>
<test name="known bug" expected="fail" reason="ticket 7"> Measures </test>
<test name="fixed" expected="fail" reason="ticket 8"> Fine </test>
<test name="missing"> NoSuchTest </test>
<test name="needs more" requires="program:no-such-program"> Fine </test>
<test name="stands on arm" requires="test:arm"> Fine </test>
"""

#: name: verdict of the record, phase, word in the short summary (none for a pass) with what follows the name.
EXPECTED = {
    "fine": (Verdict.PASSED, "", ""),
    "arm": (Verdict.FAILED, "FAILED", " - left: position = 12.5 deg, expected within [0, 10] deg, margin -2.5 deg"),
    "crash": (Verdict.ERROR, "FAILED", " - error: killed by SIGKILL in run() (the machine may have run out of memory)"),
    "hang": (Verdict.ERROR, "FAILED", " - error: run() did not end within 1.5 s"),
    "unsure": (Verdict.INCONCLUSIVE, "FAILED", " - inconclusive: the light was off"),
    "flaky": (Verdict.FLAKY, "", ""),
    "bug": (Verdict.ERROR, "FAILED", " - error: KeyError: 'arm'"),
    "known-bug": (Verdict.EXPECTED_FAILURE, "XFAIL", " - ticket 7: left: position = 12.5 deg"),
    "fixed": (Verdict.UNEXPECTED_PASS, "FAILED", " - unexpected pass: expected to fail: ticket 8"),
    "missing": (Verdict.ERROR, "ERROR", " - error: no test plug-in 'NoSuchTest' …"),
    "stands-on-arm": (Verdict.BLOCKED, "ERROR", " - blocked: needs test s/arm, which came to: failed"),
}


@pytest.fixture(scope="module")
def session(module_lab):
    """The session of a suite with all verdicts."""
    module_lab.suite(SUITE)
    return module_lab.run("s.xml", "-ra", "--junit-xml=junit.xml", "--durations=0", "-vv", "-o", "junit_logging=all")


@pytest.mark.parametrize("name", EXPECTED)
def test_verdict_is_where_people_look(session, name):
    """The journal has the verdict, and the short summary has pytest's word and the reason."""
    verdict, word, said = EXPECTED[name]
    assert session.results.tests[f"s/{name.replace(' ', '-')}"].verdict is verdict
    lines = [line for line in session.summary if f" s.xml::{name}" in line and not line.startswith("SKIPPED")]
    if word:
        assert any(line.startswith(f"{word} s.xml::{name}{said}") for line in lines), lines
    else:
        assert not lines


def test_counts_are_those_of_the_table(session):
    """Each test is counted once, and the exit code is that of failed tests."""
    assert session.last_line.startswith("6 failed, 2 passed, 2 skipped, 1 xfailed, 1 warning, 2 errors in ")
    assert session.exit_code == pytest.ExitCode.TESTS_FAILED


def test_reason_of_a_skip_is_at_the_test(session):
    """A skip has its reason, and the place of the test in the suite."""
    skips = [line for line in session.summary if line.startswith("SKIPPED")]
    assert "SKIPPED [1] s.xml:7: no left arm here" in skips
    assert "SKIPPED [1] s.xml:14: requires program 'no-such-program', which is not there" in skips


def test_nothing_of_our_own_frames_is_shown(session):
    """No traceback shows frames of the plug-in or of pytest."""
    assert "pytest_suites" not in session.out
    assert "_pytest/" not in session.out


def test_failure_has_place_limits_and_parts(session):
    """A failure has its place, limits, and sub-results."""
    text = session.cases()["arm"].find("failure").text
    assert (
        "left: measures: position = 12.5 deg, expected within [0, 10] deg, margin -2.5 deg\n  at tests.py:18\n" in text
    )
    assert "1 of 2 sub-results did not pass: left" in text


def test_hang_shows_where(session):
    """The stacks of a hung test are in its failure."""
    assert "in wait" in session.cases()["hang"].find("failure").text
    assert (session.folder / "torn-down").exists()


def test_bug_shows_its_traceback(session):
    """The traceback of an exception is in its failure."""
    assert 'raise KeyError("arm")' in session.cases()["bug"].find("failure").text


def test_durations_are_those_of_the_record(session):
    """Durations are those of the journal."""
    recorded = session.results.tests["s/hang"].duration
    assert f"{recorded:.2f}s call     s.xml::hang" in session.out
    assert 1.5 <= recorded < 15


def test_measurement_is_readable_by_a_script(session):
    """Value, unit, limits, margin and verdict of a measurement are properties."""
    case = session.cases()["arm"]
    properties = {item.get("name"): item.get("value") for item in case.iter("property")}
    name = "measurement.left.position"
    assert {key: value for key, value in properties.items() if key.startswith(name)} == {
        name: "12.5",
        f"{name}:unit": "deg",
        f"{name}:low": "0.0",
        f"{name}:high": "10.0",
        f"{name}:margin": "-2.5",
        f"{name}:verdict": "failed",
    }
    assert properties["measurement.right.position:verdict"] == "passed"
    assert (properties["part.left"], properties["part.right"]) == ("failed", "passed")


def test_verdict_is_a_property(session):
    """The verdict is a property."""
    verdicts = {
        name: {item.get("name"): item.get("value") for item in case.iter("property")}["rtf:verdict"]
        for name, case in session.cases().items()
    }
    expected = {name: str(verdict) for name, (verdict, _, _) in EXPECTED.items()}
    assert verdicts == {**expected, "skip": "skipped", "needs-more": "skipped"}


def test_output_and_messages_are_captured(session):
    """Output and messages of a test are in its captured output."""
    out = session.cases()["fine"].find("system-out").text
    assert "said aloud" in out
    assert "PASS     checks: all is well (tests.py:11)" in out


def test_flaky_pass_is_warned_of(session):
    """A flaky test passes with a warning."""
    assert "FlakyTestWarning: passed at attempt 2; attempt 1: failed: stumbled" in session.out
    properties = {item.get("name"): item.get("value") for item in session.cases()["flaky"].iter("property")}
    assert properties["rtf:attempts"] == "2"


def test_record_is_that_of_a_run(session):
    """The journal is complete, and says that pytest made it."""
    first, last = session.events[0], session.events[-1]
    assert first.command[:2] == ("pytest", "-p")
    assert first.environment["pytest"] == pytest.__version__
    assert (last.kind, last.exit_code, last.counts["failed"]) == ("run_ended", 1, 1)
    assert f"robot tests: rtf-runs/{(session.folder / 'rtf-runs' / 'latest').readlink()}" in session.out


def test_junit_file_is_well_formed(session):
    """The JUnit file has a case for each test, with the suite as class."""
    root = ET.parse(session.folder / "junit.xml").getroot()
    assert {case.get("classname") for case in root.iter("testcase")} == {"s.xml"}
    assert len(session.cases()) == len(EXPECTED) + 2


def test_warnings_as_errors_fail_in_our_words(lab):
    """Warnings as errors fail with the warning's text, without internal frames."""
    finished = lab.run(lab.suite('<test name="flaky" retries="1"> Flaky </test>'), "-W", "error")
    assert "FAILED s.xml::flaky - FlakyTestWarning: passed at attempt 2; attempt 1: failed: stumbled" in finished.out
    assert "pytest_suites" not in finished.out


def test_runxfail_reports_as_if_nothing_was_expected(lab):
    """``--runxfail`` makes an expected failure a failure, and an unexpected pass a pass."""
    lab.suite('<test name="bad" expected="fail"> Measures </test><test name="good" expected="fail"> Fine </test>')
    finished = lab.run("s.xml", "--runxfail")
    assert finished.last_line.startswith("1 failed, 1 passed")
    assert "FAILED s.xml::bad - " in finished.out
