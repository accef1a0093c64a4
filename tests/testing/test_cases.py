"""Cases of programs are tests of their own: in results, counts and reruns, and after errors."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import run_command, run_suite, write_files
from rtf.testing import cases as cases_module
from rtf.testing import journal
from rtf.testing.events import Message, TestEnded, TestPlanned, TestStarted
from rtf.testing.results import RunResult
from rtf.testing.selection import name_filter
from rtf.testing.suite.ids import CaseIds, program_of
from rtf.testing.suite.model import TestEntry
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from harness import Outcome

#: A program that runs what GoogleTest's filter selects. The file ``fails`` beside it names the cases that fail, and
#: ``ran`` is where it notes what it ran.
GTEST = r"""#!/usr/bin/env python3
import fnmatch, os, pathlib, sys
here = pathlib.Path(__file__).parent
names = ["Arm.Moves", "Arm.Stops", "Hand/Grip.Closes/0"]
patterns = os.environ.get("GTEST_FILTER", "*").split(":")
wanted = [name for name in names if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)]
fails = (here / "fails").read_text().split()
with (here / "ran").open("a") as stream:
    stream.write(" ".join(wanted) + "\n")
with open(os.environ["GTEST_OUTPUT"].partition(":")[2], "w") as stream:
    stream.write("<testsuites><testsuite name='x'>")
    for name in wanted:
        suite, _, case = name.partition(".")
        failure = "<failure message='/src/arm.cc:7&#10;it fell'/>" if name in fails else ""
        stream.write(f"<testcase classname='{suite}' name='{case}' time='0.5' file='/src/arm.cc' line='5'>")
        stream.write(f"{failure}</testcase>")
    stream.write("</testsuite></testsuites>")
sys.exit(any(name in fails for name in wanted))
"""
SUITE = '<suite name="s"><test name="ctrl" type="gtest">ctrl.py</test></suite>'
RIG = "from rtf.testing import FixtureManager\nclass Rig(FixtureManager):\n    pass\n"


def tap(*lines: str, status: int = 0) -> str:
    """Return a program that prints these lines."""
    said = "\n".join(f"echo '{line}'" for line in lines)
    return f"#!/bin/sh\n{said}\nexit {status}\n"


def verdicts(outcome: Outcome) -> dict[str, str]:
    """Return the verdict of each test by its label."""
    return {test.label: str(test.verdict) for test in outcome.results.tests.values()}


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A folder with a program of which two cases fail."""
    write_files(tmp_path, {"s.xml": SUITE, "ctrl.py": GTEST, "fails": "Arm.Stops Hand/Grip.Closes/0"})
    return tmp_path


# Results -------------------------------------------------------------------------------------------------------------


def test_each_case_is_a_test_and_the_program_is_not_blamed_for_it(bench: Path):
    """Each failed case counts as a test, and the program itself passes."""
    outcome = run_command(bench, "s.xml")
    assert verdicts(outcome) == {
        "ctrl": "passed",
        "ctrl::Arm.Moves": "passed",
        "ctrl::Arm.Stops": "failed",
        "ctrl::Hand-Grip.Closes-0": "failed",
    }
    assert outcome.exit_code == 1
    stops = outcome.results.tests["s/ctrl::Arm.Stops"]
    assert stops in outcome.results.tests["s/ctrl"].cases
    assert (stops.name, stops.planned.file, stops.planned.line) == ("ctrl::Arm.Stops", "/src/arm.cc", 5)
    assert (stops.duration, stops.last.reason) == (0.5, "failure")
    (problem,) = stops.problems
    assert (problem.detail, problem.subject) == ("it fell", "")
    assert "ctrl::Arm.Stops" in outcome.stdout


def test_every_report_has_the_cases(bench: Path):
    """Every report has the cases."""
    run_command(
        bench,
        "s.xml",
        "--junit",
        "j.xml",
        "--json",
        "r.json",
        "--ctrf",
        "c.json",
        "--output",
        "r.txt",
        "--history",
        "h.sqlite",
    )
    assert b"ctrl::Arm.Stops" in (bench / "h.sqlite").read_bytes()
    for name in ("j.xml", "r.json", "c.json", "r.txt"):
        text = (bench / name).read_text()
        assert "ctrl::Arm.Stops" in text, name
        assert "it fell" in text, name


def test_the_programs_own_account_is_its_verdict(tmp_path: Path):
    """The program has a verdict for its plan, crash and exit status; cases keep theirs."""
    outcome = run_suite(
        tmp_path,
        "<test>plan.sh</test><test>crash.sh</test><test>status.sh</test><test>skipped.sh</test>",
        plan__sh=tap("1..3", "ok 1 - a", "not ok 2 - b"),
        crash__sh=tap("1..2", "ok 1 - a").replace("exit 0", "kill -SEGV $$"),
        status__sh=tap("1..1", "ok 1 - a", status=3),
        skipped__sh=tap("1..1", "ok 1 - a # SKIP no robot"),
    )
    assert verdicts(outcome) == {
        "plan": "failed",
        "plan::a": "passed",
        "plan::b": "failed",
        "crash": "error",
        "crash::a": "passed",
        "status": "error",
        "status::a": "passed",
        "skipped": "skipped",
        "skipped::a": "skipped",
    }


def test_cases_are_reported_while_the_program_runs(tmp_path: Path):
    """Without retries, fixtures and repetitions, cases are reported while the program runs."""
    outcome = run_suite(tmp_path, "<test>p.sh</test>", p__sh=tap("1..2", "ok 1 - a", "ok 2 - b"))
    kinds = [
        (type(event).__name__, event.test)
        for event in outcome.events
        if isinstance(event, TestPlanned | TestStarted | TestEnded)
    ]
    assert kinds[1:] == [
        ("TestStarted", "s/p"),
        ("TestPlanned", "s/p::a"),
        ("TestStarted", "s/p::a"),
        ("TestEnded", "s/p::a"),
        ("TestPlanned", "s/p::b"),
        ("TestStarted", "s/p::b"),
        ("TestEnded", "s/p::b"),
        ("TestEnded", "s/p"),
    ]


def test_what_one_test_requires_is_the_program_with_its_cases(tmp_path: Path):
    """A test that requires a program is blocked by a failed case of it."""
    outcome = run_suite(
        tmp_path,
        '<test name="p">p.sh</test><test name="q" requires="test:p">q.sh</test>',
        p__sh=tap("1..1", "not ok 1 - a"),
        q__sh=tap("1..1", "ok 1"),
    )
    assert outcome.verdict("q") is Verdict.BLOCKED
    assert "test s/p, which has a case that came to: failed (p::a)" in outcome.detail("q")


def test_a_case_of_each_repetition(tmp_path: Path):
    """A case of repetitions is one test, with the worst verdict."""
    program = "#!/bin/sh\necho 1..1\n[ -e $RTF_FOLDER/x ] && echo not ok 1 - a || echo ok 1 - a\ntouch $RTF_FOLDER/x\n"
    outcome = run_suite(tmp_path, '<test repetition="2">p.sh</test>', p__sh=program)
    assert verdicts(outcome) == {"p": "passed", "p::a": "failed"}
    assert [event.subject for event in outcome.of(Message, test="s/p::a")] == ["repetition 2/3", "repetition 3/3"]
    (report,) = outcome.of(Message, title="repetitions")
    assert report.detail.startswith("1 of 3 passed")


# Attempts, fixtures, ends from outside -------------------------------------------------------------------------------


def test_a_second_attempt_runs_the_bad_cases_alone(bench: Path):
    """A retry runs the failed cases only; one that passes then is flaky."""
    (bench / "ctrl.py").write_text(
        GTEST.replace('"ran").open("a")', '"ran").open("a")').replace(
            "fails = ", "again = (here / 'ran').exists()\nfails = ['Arm.Stops'] if again else "
        )
    )
    outcome = run_command(bench, "s.xml", "--retries", "1")
    assert (bench / "ran").read_text().splitlines() == [
        "Arm.Moves Arm.Stops Hand/Grip.Closes/0",
        "Arm.Stops Hand/Grip.Closes/0",
    ]
    assert verdicts(outcome) == {
        "ctrl": "passed",
        "ctrl::Arm.Moves": "passed",
        "ctrl::Arm.Stops": "failed",
        "ctrl::Hand-Grip.Closes-0": "flaky",
    }
    assert [event.attempt for event in outcome.of(TestEnded, test="s/ctrl::Arm.Stops")] == [1, 2]
    assert [event.attempt for event in outcome.of(TestEnded, test="s/ctrl::Arm.Moves")] == [1]


def test_a_program_that_crashes_is_tried_again_whole(tmp_path: Path):
    """After a crash the whole program is retried; a case that is missing then is an error."""
    program = (
        "#!/bin/sh\necho 1..2\n[ -e $RTF_RUN_FOLDER/x ] || echo ok 1 - a\necho ok 2 - b\n"
        "[ -e $RTF_RUN_FOLDER/x ] || { touch $RTF_RUN_FOLDER/x; kill -KILL $$; }\n"
    )
    outcome = run_suite(tmp_path, '<test retries="1">p.sh</test>', p__sh=program)
    assert verdicts(outcome) == {"p": "failed", "p::a": "error", "p::b": "passed"}
    assert outcome.detail("p::a").startswith("the program did not report this case this time")
    assert [event.attempt for event in outcome.of(TestEnded, test="s/p::b")] == [1, 2]


def test_a_lost_fixture_takes_the_cases_along(tmp_path: Path):
    """Cases of a lost attempt are lost, and those of the next attempt count."""
    fixture = (
        "import pathlib, os\nfrom rtf.testing import FixtureManager\nclass Rig(FixtureManager):\n"
        "    def check(self):\n"
        "        flag = pathlib.Path(os.environ['RTF_RUN_FOLDER'], 'lose')\n"
        "        if flag.exists():\n            flag.unlink()\n            return False\n        return True\n"
    )
    program = (
        "#!/bin/sh\necho 1..1\n"
        "if [ -e $RTF_RUN_FOLDER/x ]; then echo ok 1 - a; exit; fi\n"
        "echo not ok 1 - a; touch $RTF_RUN_FOLDER/x $RTF_RUN_FOLDER/lose\nexec sleep 100\n"
    )
    xml = '<fixture check-period="0.02">rig.py</fixture><test>p.sh</test>'
    outcome = run_suite(tmp_path, xml, rig__py=fixture, p__sh=program)
    first, second = outcome.of(TestEnded, test="s/p::a")
    assert (first.outcome, first.final) == (Verdict.FIXTURE_LOST, False)
    assert "the case itself had come to: failed" in first.detail
    assert (second.verdict, second.attempt) == (Verdict.PASSED, 2)
    assert outcome.verdict("p") is Verdict.PASSED


def test_a_timeout_leaves_the_reported_cases(tmp_path: Path):
    """After a time-out the program is an error, and reported cases count."""
    program = "#!/bin/sh\necho 1..2\necho ok 1 - a\nexec sleep 100\n"
    outcome = run_suite(tmp_path, '<test timeout="1.5">p.sh</test>', p__sh=program)
    assert verdicts(outcome) == {"p": "error", "p::a": "passed"}


@pytest.mark.parametrize(
    ("line", "program", "case"),
    [("not ok 1 - a", "expected failure", "expected failure"), ("ok 1 - a", "unexpected pass", "passed")],
)
def test_a_program_that_is_expected_to_fail(tmp_path: Path, line: str, program: str, case: str):
    """A program that is expected to fail does so if one of its cases fails."""
    outcome = run_suite(tmp_path, '<test expected="fail">p.sh</test>', p__sh=tap("1..1", line))
    assert verdicts(outcome) == {"p": program, "p::a": case}


def test_each_bad_case_counts_for_maxfail(tmp_path: Path):
    """Each failed case counts for ``maxfail``, and the program runs to its end."""
    xml = "<test>p.sh</test><test>q.sh</test>"
    outcome = run_suite(
        tmp_path,
        xml,
        options={"maxfail": 2},
        p__sh=tap("1..2", "not ok 1 - a", "not ok 2 - b"),
        q__sh=tap("1..1", "ok 1"),
    )
    assert outcome.verdict("q") is Verdict.NOT_RUN


# Choosing cases ------------------------------------------------------------------------------------------------------


def test_last_failed_runs_a_program_with_the_cases_that_failed(bench: Path):
    """``--last-failed`` runs a program with its failed cases."""
    run_command(bench, "s.xml")
    (bench / "fails").write_text("Arm.Stops")
    outcome = run_command(bench, "s.xml", "--last-failed")
    assert (bench / "ran").read_text().splitlines()[1:] == ["Arm.Stops Hand/Grip.Closes/0"]
    assert verdicts(outcome) == {"ctrl": "passed", "ctrl::Arm.Stops": "failed", "ctrl::Hand-Grip.Closes-0": "passed"}
    (bench / "fails").write_text("")
    outcome = run_command(bench, "s.xml", "--last-failed")
    assert (bench / "ran").read_text().splitlines()[2:] == ["Arm.Stops"]
    assert verdicts(outcome) == {"ctrl": "passed", "ctrl::Arm.Stops": "passed"}


def test_cases_are_chosen_by_name(bench: Path):
    """``-k`` selects cases that earlier runs know; a run of few cases does not hide the others."""
    assert "none of 1 test is selected" in run_command(bench, "s.xml", "-k", "Grip").stderr
    run_command(bench, "s.xml")
    run_command(bench, "s.xml", "-k", "ctrl::Arm.Stops")
    run_command(bench, "s.xml", "-k", "grip")
    run_command(bench, "s.xml", "-k", "ctrl and not Grip")
    run_command(bench, "s.xml", "-k", "ctrl")
    assert (bench / "ran").read_text().splitlines()[1:] == [
        "Arm.Stops",
        "Hand/Grip.Closes/0",
        "Arm.Moves Arm.Stops",
        "Arm.Moves Arm.Stops Hand/Grip.Closes/0",
    ]
    listed = run_command(bench, "s.xml", "-k", "grip", "--list")
    assert "    s/ctrl::Hand-Grip.Closes-0\n" in listed.stdout


def test_a_program_that_ignores_the_choice_runs_whole_and_only_the_chosen_cases_count(tmp_path: Path):
    """If a program ignores the selection, only selected cases count."""
    write_files(
        tmp_path,
        {"s.xml": '<suite name="s"><test>p.sh</test></suite>', "p.sh": tap("1..2", "not ok 1 - a", "not ok 2 - b b")},
    )
    run_command(tmp_path, "s.xml")
    outcome = run_command(tmp_path, "s.xml", "-k", "b-b")
    assert verdicts(outcome) == {"p": "passed", "p::b-b": "failed"}


def test_a_chosen_case_that_does_not_come_is_an_error(bench: Path):
    """A selected case that is not reported is an error."""
    run_command(bench, "s.xml")
    (bench / "ctrl.py").write_text(GTEST.replace('"Arm.Stops", ', ""))
    outcome = run_command(bench, "s.xml", "-k", "Stops")
    assert verdicts(outcome) == {"ctrl": "passed", "ctrl::Arm.Stops": "error"}
    assert outcome.detail("ctrl::Arm.Stops") == "the program did not report this case"
    assert outcome.exit_code == 1


def test_the_chosen_cases_of_a_program_that_is_not_run_are_not_lost(tmp_path: Path):
    """Selected cases of a program that is not run have its verdict."""
    suite = '<suite name="s"><test name="p" {}>p.sh</test></suite>'
    write_files(tmp_path, {"s.xml": suite.format(""), "p.sh": tap("1..1", "not ok 1 - a")})
    run_command(tmp_path, "s.xml")
    (tmp_path / "s.xml").write_text(suite.format('requires="env:NO_SUCH_VARIABLE"'))
    outcome = run_command(tmp_path, "s.xml", "--last-failed")
    assert verdicts(outcome) == {"p": "skipped", "p::a": "skipped"}


def test_stepwise_goes_on_with_the_program_whose_case_failed(tmp_path: Path):
    """``--stepwise`` continues with the whole program whose case failed."""
    suite = '<suite name="s"><test>p.sh</test><test>q.sh</test></suite>'
    write_files(
        tmp_path, {"s.xml": suite, "p.sh": tap("1..1", "ok 1 - a"), "q.sh": tap("1..2", "ok 1 - a", "not ok 2 - b")}
    )
    run_command(tmp_path, "s.xml", "--stepwise")
    assert verdicts(run_command(tmp_path, "s.xml", "--stepwise")) == {"q": "passed", "q::a": "passed", "q::b": "failed"}


def test_a_run_that_is_resumed_runs_the_program_anew_with_the_chosen_cases(bench: Path):
    """A resumed run runs an unfinished program again, with its selected cases."""
    run_command(bench, "s.xml")
    first = run_command(bench, "s.xml", "-k", "Arm")
    path = first.folder / "journal.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    cut = next(n for n, line in enumerate(lines) if '"test_ended"' in line and "Moves" in line)
    path.write_text("".join(lines[: cut + 1]))
    outcome = run_command(bench, "--resume", str(first.folder))
    assert (bench / "ran").read_text().splitlines()[1:] == ["Arm.Moves Arm.Stops"] * 2
    results = RunResult()
    for event in journal.as_one_run(first.folder):
        results.apply(event)
    assert {test.label: str(test.verdict) for test in results.tests.values()} == {
        "ctrl": "passed",
        "ctrl::Arm.Moves": "passed",
        "ctrl::Arm.Stops": "failed",
    }
    assert len(results.tests["s/ctrl::Arm.Moves"].attempts) == 1
    assert outcome.exit_code == 1


# Bounds and names ----------------------------------------------------------------------------------------------------


def test_more_cases_than_are_kept_fail_the_program_if_one_of_them_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A failed case beyond MAX_CASES fails the program."""
    monkeypatch.setattr(cases_module, "MAX_CASES", 2)
    outcome = run_suite(
        tmp_path,
        "<test>p.sh</test><test>q.sh</test>",
        p__sh=tap("1..3", "ok 1 - a", "ok 2 - b", "ok 3 - c"),
        q__sh=tap("1..3", "ok 1 - a", "ok 2 - b", "not ok 3 - c"),
    )
    assert verdicts(outcome) == {
        "p": "passed",
        "p::a": "passed",
        "p::b": "passed",
        "q": "failed",
        "q::a": "passed",
        "q::b": "passed",
    }
    assert outcome.detail("q").startswith("c: ")


@given(st.lists(st.text(max_size=300), min_size=1, max_size=20, unique=True))
def test_ids_of_cases_hold_for_any_names(names: list[str]):
    """Each name has a unique, stable id that is one word for ``-k``."""
    ids = CaseIds("s/p")
    made = [ids.of(name) for name in names]
    assert len(set(made)) == len(names)
    assert made == [ids.of(name) for name in names]
    for name, case in zip(names, made, strict=True):
        label = case.removeprefix("s/p::")
        assert program_of(case) == "s/p"
        assert len(label) <= 120
        assert set(label) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._[]+-"), name
        assert name_filter(case)(TestEntry(id=case, name="x", plugin="p"))


@given(st.lists(st.text(alphabet="ab -/.é\n", max_size=12), min_size=2, max_size=8, unique=True))
def test_the_id_of_a_case_does_not_depend_on_the_others_unless_they_are_alike(names: list[str]):
    """The id of a case depends on other cases only if their ids would be equal."""
    ids = CaseIds("s/p")
    alone = {name: CaseIds("s/p").of(name) for name in names}
    for name in names:
        alike = [other for other in names if alone[other] == alone[name]]
        assert ids.of(name) == alone[name] or len(alike) > 1


def test_ids_that_were_given_are_kept():
    """A case that is run again keeps its id."""
    ids = CaseIds("s/p", {"a-b": "s/p::a-b-1234"})
    assert ids.of("a b") == "s/p::a-b"
    assert ids.of("a-b") == "s/p::a-b-1234"


def test_hostile_names_reach_no_report_unescaped(tmp_path: Path):
    """Hostile names are kept as text, and ids have no special characters."""
    names = ["../../etc/passwd", "<script>alert(1)</script>", "a::b", "$(reboot)", "]]>", "[[ATTACHMENT|/etc/passwd]]"]
    outcome = run_suite(
        tmp_path, "<test>p.sh</test>", p__sh=tap("1..6", *(f"ok {n} - {name}" for n, name in enumerate(names, 1)))
    )
    cases = outcome.results.tests["s/p"].cases
    assert [case.planned.case for case in cases] == names
    assert all("/" not in case.label and "<" not in case.label for case in cases)


@pytest.mark.parametrize("compiler", ["g++"])
def test_a_real_googletest_program(tmp_path: Path, compiler: str):
    """A GoogleTest program runs with its own filter, if compiler and library are installed."""
    source = tmp_path / "t.cc"
    source.write_text(
        "#include <gtest/gtest.h>\nTEST(Arm, Moves) {}\nTEST(Arm, Stops) { EXPECT_EQ(1, 2); }\n"
        "struct P : testing::TestWithParam<int> {};\nTEST_P(P, Holds) { EXPECT_LT(GetParam(), 2); }\n"
        "INSTANTIATE_TEST_SUITE_P(All, P, testing::Values(1, 2));\n"
    )
    found = shutil.which(compiler)
    if found is None:
        pytest.skip(f"there is no {compiler}")
    built = subprocess.run(
        [found, "-o", tmp_path / "t", source, "-lgtest", "-lgtest_main", "-lpthread"], check=False, capture_output=True
    )
    if built.returncode:
        pytest.skip("GoogleTest is not installed")
    (tmp_path / "s.xml").write_text('<suite name="s"><test name="t" type="gtest">t</test></suite>')
    expected = {
        "t": "passed",
        "t::Arm.Moves": "passed",
        "t::Arm.Stops": "failed",
        "t::All-P.Holds-0": "passed",
        "t::All-P.Holds-1": "failed",
    }
    assert verdicts(run_command(tmp_path, "s.xml")) == expected
    again = run_command(tmp_path, "s.xml", "--last-failed")
    assert verdicts(again) == {"t": "passed", "t::Arm.Stops": "failed", "t::All-P.Holds-1": "failed"}
    assert "2 tests from 2 test suites ran" in "".join(event.text for event in again.events if hasattr(event, "stream"))
