"""Tests of the JUnit XML that its consumers need. See docs/decisions/0003-junit-writer.md."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from junitparser import xunit2
from lxml import etree

from rtf.testing.events import (
    Attached,
    Diagnosed,
    InternalError,
    Interrupted,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    StackDumped,
    TestEnded,
    TestPlanned,
    TestStarted,
)
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict
from tests.waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.reports.conftest import Reports, Story

SCHEMA = etree.XMLSchema(etree.parse(Path(__file__).parents[1] / "data" / "junit" / "junit-10.xsd"))


def read(path: Path):
    """Return the root of a document, after checking it against the schema."""
    document = etree.parse(path)
    SCHEMA.assertValid(document)
    return document.getroot()


def case(root: Any, name: str):
    """Return the one test case of this name."""
    (found,) = [element for element in root.iter("testcase") if element.get("name") == name]
    return found


def kinds(root: Any):
    """Return each case's elements that consumers read as its verdict."""
    words = {"failure", "error", "skipped", "flakyFailure", "rerunFailure"}
    return {e.get("name"): [child.tag for child in e if child.tag in words] for e in root.iter("testcase")}


def out_of(element: Any):
    """Return the lines of an element's system-out."""
    return element.findtext("system-out").splitlines()


def test_every_verdict_becomes_what_it_means(story: Story, reports: Reports):
    """Failed is a failure, could not be tested is an error, did not run is skipped; nothing bad is a pass."""
    expected = {
        Verdict.PASSED: [],
        Verdict.MEASURED: [],
        Verdict.FLAKY: [],
        Verdict.SKIPPED: ["skipped"],
        Verdict.EXPECTED_FAILURE: ["skipped"],
        Verdict.BLOCKED: ["skipped"],
        Verdict.NOT_RUN: ["skipped"],
        Verdict.FAILED: ["failure"],
        Verdict.UNEXPECTED_PASS: ["failure"],
        Verdict.ERROR: ["error"],
        Verdict.INCONCLUSIVE: ["error"],
        Verdict.FIXTURE_LOST: ["error"],
        Verdict.INTERRUPTED: ["error"],
    }
    assert set(expected) == set(Verdict)
    story.begin(("arm", len(expected))).start("arm")
    for number, verdict in enumerate(expected, 1):
        story.test(f"arm/t{number}", verdict, detail=f"because {number}")
    root = read(reports("junit", story.end("arm", Verdict.FAILED).finish()))
    assert list(expected.values()) == list(kinds(root).values())
    assert "because 12" in case(root, "t12").find("error").get("message")


def test_counts_times_and_names_are_those_of_the_schema(story: Story, reports: Reports):
    """Attributes count what is in the file, times have three decimals, and the class is robot.suite."""
    story.begin(("arm.left", 2)).start("arm.left").test("arm.left/t1", duration=1 / 3).failing("arm.left/t2")
    root = read(reports("junit", story.end("arm.left", Verdict.FAILED).finish()))
    suite = root.find("testsuite")
    assert dict(root.attrib) == {"name": "rtf", "tests": "2", "failures": "1", "errors": "0", "time": "3.500"}
    assert tuple(suite.get(name) for name in ("tests", "failures", "errors", "skipped")) == ("2", "1", "0", "0")
    assert tuple(suite.get(name) for name in ("hostname", "id", "timestamp")) == (
        "bench",
        "arm.left",
        "2025-06-15T15:06:42.500Z",
    )
    assert case(root, "t1").get("time") == "0.333"
    assert case(root, "t1").get("classname") == "icubSim.arm_left"
    assert suite.find("properties/property[@name='robot']").get("value") == "icubSim"


def test_two_tests_of_one_name_are_told_apart(story: Story, reports: Reports):
    """Tests of one name are written by their ids, for GitLab ignores a second case of the same class and name."""
    story.begin(("arm", 0))
    for suite_test in ("a", "b", "c"):
        story.add(TestPlanned(test=f"arm/{suite_test}", suite="arm", name="same"))
    story.start("arm")
    for suite_test in ("a", "b", "c"):
        story.test(f"arm/{suite_test}")
    root = read(reports("junit", story.end("arm").finish()))
    assert [element.get("name") for element in root.iter("testcase")] == ["a", "b", "c"]


def test_a_failure_without_a_word_is_still_a_failure(story: Story, reports: Reports):
    """A failure's message and text are never empty, for some readers drop an empty element and show a pass."""
    story.begin(("arm", 2)).start("arm").test("arm/t1", Verdict.FAILED).test("arm/t2", Verdict.ERROR, detail=" ")
    root = read(reports("junit", story.end("arm", Verdict.FAILED).finish()))
    for name, kind in (("t1", "failure"), ("t2", "error")):
        element = case(root, name).find(kind)
        assert element.get("message").strip()
        assert element.text.strip()


def test_a_failure_of_a_part_is_written_once(story: Story, reports: Reports):
    """A test's reason and its first message, even with a title, are written once; other failures follow."""
    first = Message(
        severity=Severity.FAILURE,
        title="measures",
        detail="gap = 3 mm",
        test="arm/t1",
        subject="lid",
        file="a.py",
        line=3,
    )
    other = Message(severity=Severity.FAILURE, title="checks", detail="it squeaks", test="arm/t1", subject="lid")
    story.begin(("arm", 1)).start("arm").test("arm/t1", Verdict.FAILED, first, other, detail="lid: gap = 3 mm")
    failure = case(read(reports("junit", story.end("arm", Verdict.FAILED).finish())), "t1").find("failure")
    assert failure.get("message") == "lid: gap = 3 mm"
    assert failure.text == "lid: measures: gap = 3 mm\n  at a.py:3\nlid: checks: it squeaks"


def test_control_characters_are_shown(story: Story, reports: Reports):
    """Control characters, which XML cannot carry, are written as ``#x1B``."""
    story.begin(("arm", 1)).start("arm").failing("arm/t1", "\x1b[31mred\x00 ]]> \ud800 & <b>")
    root = read(reports("junit", story.end("arm", Verdict.FAILED).finish()))
    assert case(root, "t1").find("failure").get("message") == "#x1B[31mred#x00 ]]> #xD800 & <b>"


def test_attachments_come_first_one_a_line_relative_to_the_working_folder(
    story: Story, reports: Reports, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Attachments are the first lines, relative to the working folder.

    Jenkins searches the first 500 characters of a passing case; GitLab wants paths from the project's root.
    """
    monkeypatch.chdir(tmp_path)
    files = [
        Attached(test="arm/t1", name=name, path=f"files/{name}", media_type="image/png")
        for name in ("a.png", "b.png", "odd|name]].png")
    ]
    story.begin(("arm", 1)).start("arm")
    story.test("arm/t1", Verdict.PASSED, OutputCaptured(stream="stdout", text="noise\n", test="arm/t1"), *files)
    root = read(reports("junit", story.end("arm").finish(), run_folder=tmp_path / "runs" / "1"))
    lines = out_of(case(root, "t1"))
    assert lines[:2] == ["[[ATTACHMENT|runs/1/files/a.png]]", "[[ATTACHMENT|runs/1/files/b.png]]"]
    assert lines[2] == "runs/1/files/odd|name]].png"
    assert lines[-1] == "noise"


def measured(story: Story):
    """A story of one test that measures, and has parameters and a place."""
    value = Measured(
        test="arm/t1",
        name="reach",
        value=12.5,
        unit="deg",
        low=10.0,
        high=20.0,
        margin=2.5,
        verdict=MeasurementVerdict.PASSED,
        subject="joint 3",
    )
    row = {"name": "speed", "value": "3", "unit": "deg/s", "source": "suite"}
    story.begin(("arm", 1)).start("arm")
    story.test("arm/t1", Verdict.PASSED, ParametersResolved(test="arm/t1", parameters=(row,)), value)
    return story.end("arm").finish()


def test_strict_says_measurements_and_places_in_system_out(story: Story, reports: Reports):
    """The family ``strict`` writes measurements and places into system-out, for a case has no properties in it."""
    lines = out_of(case(read(reports("junit", measured(story))), "t1"))
    assert "[[PROPERTY|file=/lab/suites/arm.xml]]" in lines
    assert "[[PROPERTY|line=1]]" in lines
    assert "[[PROPERTY|parameter.speed=3 deg/s (suite)]]" in lines
    value = "12.5 deg, expected within [10, 20] deg, margin 2.5 deg, passed"
    assert f"[[PROPERTY|measurement.joint 3.reach={value}]]" in lines


def test_rich_says_them_as_attributes_and_properties(story: Story, reports: Reports):
    """The family ``rich`` writes them as attributes and properties, as pytest does and as some GitHub actions read."""
    path = reports("junit", measured(story), extra={"junit-family": "rich"})
    found = case(etree.parse(path).getroot(), "t1")
    properties = {item.get("name"): item.get("value") for item in found.iter("property")}
    assert (found.get("file"), found.get("line")) == ("/lab/suites/arm.xml", "1")
    assert properties["measurement.joint 3.reach"].startswith("12.5 deg")
    assert found.find("system-out") is None


def test_an_unknown_family_is_refused_before_the_run(story: Story, reports: Reports):
    """An unknown family is an error before the run."""
    with pytest.raises(ValueError, match="strict and rich"):
        reports("junit", story, extra={"junit-family": "xunit3"})


def retried(story: Story, check_failed: Callable[..., Message], verdict: Verdict, outcome: Verdict):
    """A story of one test that fails first and is repeated."""
    story.begin(("arm", 1)).start("arm")
    said = [check_failed("arm/t1", "slipped"), OutputCaptured(stream="stdout", text="first go\n", test="arm/t1")]
    story.test("arm/t1", Verdict.FAILED, *said, final=False, detail="slipped", reason="failure")
    story.test("arm/t1", verdict, check_failed("arm/t1", "again"), outcome=outcome, attempt=2, detail="again")
    return story.end("arm").finish()


def test_a_flaky_test_passes_and_shows_its_earlier_attempt(
    story: Story, reports: Reports, check_failed: Callable[..., Message]
):
    """A flaky test is a pass with its earlier attempt as flakyFailure, which Jenkins reads, unlike flakyError."""
    path = reports("junit", retried(story, check_failed, Verdict.FLAKY, Verdict.PASSED))
    root = read(path)
    earlier = case(root, "t1").find("flakyFailure")
    assert list(kinds(root).values()) == [["flakyFailure"]]
    assert (earlier.get("type"), earlier.get("message")) == ("failed", "slipped")
    assert "checks: slipped" in earlier.findtext("stackTrace")
    assert "first go" in earlier.findtext("system-out")
    (suite,) = xunit2.JUnitXml.fromfile(str(path))
    assert [xunit2.TestCase.fromelem(found).is_flaky for found in suite] == [True]


def test_retries_that_all_failed_are_one_failure(story: Story, reports: Reports, check_failed: Callable[..., Message]):
    """A test that fails in all attempts is one failure; the earlier attempts are rerunFailure elements."""
    root = read(reports("junit", retried(story, check_failed, Verdict.FAILED, Verdict.FAILED)))
    assert list(kinds(root).values()) == [["failure", "rerunFailure"]]


def collapsed(story: Story, *, back: bool):
    """A story of a fixture that collapses between two tests, and comes back or is given up."""
    story.begin(("arm", 2), fixtures=("sim",)).start("arm").fixture("arm", "sim", FixtureState.READY).test("arm/t1")
    story.incident("arm", "sim").fixture("arm", "sim", FixtureState.COLLAPSED)
    if back:
        story.fixture("arm", "sim", FixtureState.READY, 2).test("arm/t2")
    else:
        story.fixture("arm", "sim", FixtureState.FAILED, 2, "restarts used up")
        story.test("arm/t2", Verdict.BLOCKED, attempt=0, detail="fixture sim is not usable")
    return story.end("arm", Verdict.PASSED if back else Verdict.FAILED).finish()


def test_a_fixture_that_came_back_is_seen_and_not_red(story: Story, reports: Reports):
    """A fixture that was restarted is a passing case with its collapse as flakyFailure."""
    root = read(reports("junit", collapsed(story, back=True)))
    found = case(root, "fixture: sim")
    assert (root.get("failures"), root.get("errors")) == ("0", "0")
    assert found.find("flakyFailure").get("type") == "FixtureCollapsed"
    assert "SIGSEGV" in found.findtext("system-out")


def test_a_fixture_that_was_given_up_is_an_error(story: Story, reports: Reports):
    """A fixture that was given up is an error, for the tests that it blocked are only skipped."""
    root = read(reports("junit", collapsed(story, back=False)))
    error = case(root, "fixture: sim").find("error")
    assert (error.get("type"), error.get("message")) == ("FixtureCollapsed", "given up: restarts used up")
    assert "words" in error.text
    assert case(root, "t2").find("skipped").get("message") == "blocked: fixture sim is not usable"


def test_a_failing_teardown_of_a_fixture_is_an_error(story: Story, reports: Reports):
    """A fixture's failing teardown is an error in the file even if all tests passed."""
    story.begin(("arm", 1)).start("arm").test("arm/t1").incident("arm", "sim", phase=Phase.TEARDOWN)
    root = read(reports("junit", story.end("arm").finish()))
    assert root.get("errors") == "1"


def test_problems_of_a_suite_are_never_lost(story: Story, reports: Reports):
    """An error of a suite is an error case; the C++ framework's file was green for a fixture that failed in setup."""
    story.begin(("arm", 1)).start("arm").test("arm/t1")
    story.add(Message(severity=Severity.ERROR, title="teardown", detail="no answer", suite="arm"))
    root = read(reports("junit", story.end("arm", Verdict.FAILED).finish()))
    assert case(root, "suite: arm").find("error").get("message") == "no answer"


def test_a_suite_without_tests_is_seen(story: Story, reports: Reports):
    """A suite without tests has a skipped case, for Jenkins drops a suite that has none."""
    root = read(reports("junit", story.begin(("arm", 0), ("leg", 1)).start("leg").test("leg/t1").end("leg").finish()))
    assert kinds(root)["(no tests)"] == ["skipped"]


@pytest.mark.parametrize(
    ("events", "exit_code", "name"),
    [
        ([InternalError(text="suite worker broke")], 3, "run: internal error"),
        ([Interrupted(source="SIGINT", stage=1)], 2, "run: interrupted"),
        ([Diagnosed(severity=Severity.ERROR, text="no such plug-in", file="a.xml", line=3)], 4, "load: a.xml"),
        ([], 5, "run"),
    ],
)
def test_a_run_that_did_not_pass_is_red(story: Story, reports: Reports, events: list[Any], exit_code: int, name: str):
    """Each reason for an exit code other than 0 has an error case, even where no test is to blame."""
    story.begin(("arm", 1)).start("arm").test("arm/t1", Verdict.SKIPPED).end("arm").add(*events)
    root = read(reports("junit", story.finish(exit_code)))
    assert case(root, name).find("error") is not None


def test_a_run_that_was_cut_off_is_red(story: Story, reports: Reports):
    """A journal without an end, of a runner that died, is an error case."""
    root = read(reports("junit", story.begin(("arm", 2)).start("arm").test("arm/t1")))
    assert "did not end in order" in case(root, "run").find("error").get("message")


def test_the_file_is_there_while_the_run_goes_on(story: Story, reports: Reports):
    """The file exists during the run; it has an error for each test that has not run, in case the runner is killed."""
    story.begin(("arm", 2), ("leg", 1)).start("arm").test("arm/t1").add(TestStarted(test="arm/t2"))
    path = reports("junit", story, close=False)
    expected = {
        "t2": "interrupted: the runner was killed while this test was running",
        "t1": "not run: the runner was killed",
        "run": "the run did not end in order: the runner was killed",
    }

    def errors() -> dict[str, str]:
        return {one.getparent().get("name"): one.get("message") for one in read(path).iter("error")}

    eventually(lambda: path.exists() and errors() == expected, "the file is not there")
    assert [reports.folder / "junit.xml"] == [*reports.folder.iterdir()]
    reports.broadcast.emit(TestEnded(test="arm/t2", verdict=Verdict.PASSED, outcome=Verdict.PASSED))
    eventually(lambda: len(errors()) == 2, "the file is not up to date")
    reports.broadcast.close()


def test_much_output_of_a_passing_test_is_bounded(story: Story, reports: Reports):
    """Long output of a passing test keeps beginning and end, with a note on what is left out."""
    text = "begin" + "x" * 2_000_000 + "end"
    story.begin(("arm", 1)).start("arm")
    story.test("arm/t1", Verdict.PASSED, OutputCaptured(stream="stdout", text=text, test="arm/t1"))
    out = case(read(reports("junit", story.end("arm").finish())), "t1").findtext("system-out")
    assert len(out) < 70_000
    assert "begin" in out
    assert "characters left out" in out
    assert out.endswith("end")


def test_stderr_and_stacks_go_to_system_err(story: Story, reports: Reports):
    """Standard error and dumped stacks go to system-err."""
    story.begin(("arm", 1)).start("arm")
    err = OutputCaptured(stream="stderr", text="careful\n", test="arm/t1", omitted=7)
    story.test("arm/t1", Verdict.ERROR, err, StackDumped(text="Thread 1", cause="hung", test="arm/t1"))
    found = case(read(reports("junit", story.end("arm").finish())), "t1")
    assert found.findtext("system-err") == "… 7 bytes not kept …\ncareful\nhung\nThread 1\n"


def test_an_unwritable_target_is_an_error_before_the_run(story: Story, reports: Reports, tmp_path: Path):
    """A target that cannot be written is an error when the reporter is opened."""
    with pytest.raises(OSError, match="folder"):
        reports("junit", story, target=tmp_path)
