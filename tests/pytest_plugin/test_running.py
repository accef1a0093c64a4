"""Running items: selection, order, early ends, options, and the journal."""

from __future__ import annotations

import json
import signal
import subprocess
import sys

import pytest

from harness import write_files
from rtf.testing.verdict import Verdict

ARMS = '<test name="left"> Measures </test><test name="right"> Fine </test><test name="head"> Fine </test>'
FIXTURE = '<fixture name="robot" backoff="0"> Robot </fixture>'


def verdicts(finished) -> dict[str, Verdict]:
    """Return the verdicts of the journal by the last part of the ids."""
    return {test.id.rpartition("/")[2]: test.verdict for test in finished.results.tests.values()}


def test_selection_is_pytests(lab):
    """Only selected tests are planned."""
    finished = lab.run(lab.suite(ARMS), "-k", "right or s/head")
    assert finished.last_line.startswith("2 passed, 1 deselected")
    assert verdicts(finished) == {"right": Verdict.PASSED, "head": Verdict.PASSED}


def test_stopping_at_the_first_failure_takes_fixtures_down(lab):
    """``-x`` starts nothing more, tears fixtures down, and records tests as not run."""
    finished = lab.run(lab.suite(FIXTURE + ARMS), "-x")
    assert finished.last_line.startswith("1 failed")
    assert verdicts(finished) == {"left": Verdict.FAILED, "right": Verdict.NOT_RUN, "head": Verdict.NOT_RUN}
    assert lab.log == ["up", "down"]
    assert finished.events[-1].kind == "run_ended"


def test_last_failed_are_run_again(lab):
    """``--lf`` selects failed tests of suites."""
    lab.suite(ARMS)
    lab.run("s.xml", "-p", "cacheprovider")
    again = lab.run("s.xml", "-p", "cacheprovider", "--lf")
    assert again.last_line.startswith("1 failed, 2 deselected")
    assert verdicts(again) == {"left": Verdict.FAILED}


def test_any_order_keeps_fixtures_apart(lab):
    """In any order the fixtures of one suite are down before those of the next are up."""
    lab.write(conftest__py="def pytest_collection_modifyitems(items): items[:] = items[::2] + items[1::2]")
    for name in ("one", "two"):
        lab.suite(
            f'{FIXTURE}<test name="a"> Fine </test><test name="b"> Fine </test><test name="c"> Fine </test>', name
        )
    finished = lab.run("one.xml", "two.xml", "-v")
    assert finished.last_line.startswith("6 passed")
    assert lab.log == ["up", "down"] * 4  # a c | b of the other | b | a c of the other


def test_fixture_is_set_up_once_a_suite(lab):
    """A fixture is up for all tests of its suite, and down before the next file."""
    lab.write(test_after__py="def test_log(): assert open('robot.log').read().split() == ['up', 'down']")
    finished = lab.run(lab.suite(FIXTURE + ARMS.replace("Measures", "Fine")), "test_after.py")
    assert finished.last_line.startswith("4 passed")


def test_options_reach_the_tests(lab):
    """The options of the command line reach the tests."""
    lab.write(
        asked__py=(
            "from pathlib import Path\n"
            "from rtf.testing import Parameter, TestCase\n"
            "class Asked(TestCase):\n"
            "    speed = Parameter(int, 'speed', default=1)\n"
            "    def run(self):\n"
            "        self.check(self.speed == 7, f'{self.speed} is 7')\n"
            "        self.check(self.confirm('sure?'), 'sure')\n"
            "        if not Path('was-here').exists():\n"
            "            Path('was-here').touch()\n"
            "            self.assert_fail('once more')\n"
        )
    )
    lab.suite('<test name="${who}" requires="bench"> asked.py </test>')
    options = ["--rtf-set=speed=7", "--rtf-define=who=me", "--rtf-feature=bench", "--rtf-retries=1", "--rtf-answer=yes"]
    finished = lab.run("s.xml", *options, "--rtf-robot=icub", "--rtf-station=bench 2", "--rtf-timeout=20s", "-v")
    assert "s.xml::me PASSED" in finished.out
    assert verdicts(finished) == {"me": Verdict.FLAKY}
    started = finished.events[0]
    assert (started.robot, started.station) == ("icub", "bench 2")
    assert finished.results.tests["s/me"].planned.run_timeout == 20.0


def test_ini_values_count_where_the_command_line_says_nothing(lab):
    """Values of the ini file are defaults of the options."""
    lab.write(pytest__ini="[pytest]\nrtf_robot = red\nrtf_runs = records\nrtf_define =\n    who=she\n    how=well\n")
    lab.suite('<test name="${who} ${how}"> Fine </test>')
    finished = lab.run("s.xml", "--rtf-define", "how=badly", "-v")
    assert "s.xml::she-badly PASSED" in finished.out
    assert (lab.folder / "records" / "latest").exists()


def test_reports_of_the_runner_are_written(lab):
    """Reporters of the runner write their files, by default into the run's folder."""
    finished = lab.run(lab.suite(ARMS), "--rtf-report", "json=out.json", "--rtf-report", "junit")
    record = json.loads((lab.folder / "out.json").read_text())
    assert len(record["suites"][0]["tests"]) == 3
    assert (lab.folder / "rtf-runs" / "latest" / "junit.xml").exists()
    assert "robot tests: out.json" in finished.out


def test_record_can_be_reported_later(lab):
    """``testrunner report`` reads the journal of a session; resuming it is refused with a hint."""
    lab.run(lab.suite(ARMS))

    def testrunner(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "rtf.cli.testrunner", *words]
        return subprocess.run(command, cwd=lab.folder, capture_output=True, text=True, timeout=60, check=False)

    assert (
        testrunner("report", "rtf-runs/latest").stdout.rstrip().splitlines()[-1].startswith("FAILED  1 failed, 2 pas")
    )
    resumed = testrunner("--resume", "rtf-runs/latest")
    assert resumed.returncode == 4
    assert "was made by pytest, which goes on with it by --last-failed" in resumed.stderr


def test_report_that_cannot_be_written_ends_the_session(lab):
    """A report that cannot be written is a usage error before any test."""
    finished = lab.run(lab.suite(ARMS), "--rtf-report", "json=/proc/no/such.json")
    assert finished.exit_code == pytest.ExitCode.USAGE_ERROR
    assert "robot tests: report json cannot be written" in finished.out


def test_reporter_that_breaks_is_an_internal_error(lab):
    """A reporter that fails is an internal error of the session, and tests go on."""
    broken = "from rtf.testing import Reporter\nclass Broken(Reporter):\n    def handle(self, event, results): 1 / 0\n"
    lab.write(reports__broken__py="", **{"reports/broken.py": broken})
    finished = lab.run(lab.suite(ARMS), "--rtf-report", "broken", RTF_PLUGIN_PATH=str(lab.folder / "reports"))
    assert finished.exit_code == pytest.ExitCode.INTERNAL_ERROR
    assert "robot tests: internal error: reporter" in finished.out
    assert verdicts(finished)["head"] is Verdict.PASSED


def test_time_out_of_the_suite_is_red_once(lab):
    """After a suite's time-out one test fails, and the remaining ones are skipped."""
    lab.suite('<test name="slow"> Hangs </test><test name="late"> Fine </test>', attributes='timeout="3"')
    finished = lab.run("s.xml", "-ra")
    assert finished.last_line.startswith("1 failed, 1 skipped")
    assert finished.line("FAILED") == "FAILED s.xml::slow - error: the suite did not end within 3 s"
    assert finished.line("SKIPPED").endswith("not run: the suite did not end within 3 s")


def test_time_out_of_pytest_ends_the_test_alone(lab):
    """A time-out of pytest-timeout ends the test's process with its teardown, and the next test runs."""
    lab.suite(f'{FIXTURE}<test name="slow"> Hangs </test><test name="next"> Fine </test>')
    session = lab.start("s.xml", "-p", "pytest_timeout", "-o", "timeout=60")
    session.wait_until((lab.folder / "running").exists)
    session.interrupt(signal.SIGALRM)  # as when the time is up
    finished = session.wait()
    assert finished.last_line.startswith("1 failed, 1 passed")
    assert "Timeout (>60.0s)" in finished.line("FAILED")
    assert verdicts(finished) == {"slow": Verdict.ERROR, "next": Verdict.PASSED}
    assert "Timeout" in finished.results.tests["s/slow"].last.detail
    assert (lab.folder / "torn-down").exists()
    assert lab.log == ["up", "down"]


def test_plan_of_the_set_up_touches_nothing(lab):
    """``--setup-plan`` starts no fixture."""
    finished = lab.run(lab.suite(FIXTURE + ARMS), "--setup-plan")
    assert finished.exit_code == 0
    assert lab.log == []
    assert not (lab.folder / "rtf-runs").exists()


def test_set_up_alone_brings_fixtures_up_and_down(lab):
    """``--setup-only`` sets fixtures up and tears them down, without tests."""
    finished = lab.run(lab.suite(FIXTURE + ARMS), "--setup-only")
    assert finished.exit_code == 0
    assert lab.log == ["up", "down"]
    assert {*verdicts(finished).values()} == {Verdict.NOT_RUN}


def test_fork_for_each_test_is_refused(lab):
    """``--forked`` is refused with a hint."""
    finished = lab.run(lab.suite(ARMS), "-p", "pytest_forked", "--forked")
    assert finished.exit_code == pytest.ExitCode.USAGE_ERROR
    assert "leave --forked out" in finished.out


def test_live_page_says_where_it_is_and_goes_with_the_session(lab):
    """The address of the live page is printed, and its server ends with the session."""
    session = lab.start(lab.suite(ARMS), "--rtf-report", "web=0")
    finished = session.wait()
    assert "web page: http://127.0.0.1:" in finished.out
    assert not session.left_over()


STOPPER = """
from pathlib import Path
from rtf.testing import Reporter

class Stopper(Reporter):
    def handle(self, event, results):
        if event.kind == "test_started":
            self.options.control.stop("web", 1)
            Path("stopped").touch()
"""
STOPPED = """
from pathlib import Path
from rtf import clock
from rtf.testing import TestCase

class Stopped(TestCase):
    def run(self):
        while not Path("stopped").exists():
            clock.sleep(0.005)
"""


def test_run_that_is_stopped_from_outside_ends_the_session(lab):
    """A stop on the live page ends the session after the running test."""
    lab.write(**{"reports/stopper.py": STOPPER, "stopped.py": STOPPED, "test_later.py": "def test_later(): pass"})
    environment = {"RTF_PLUGIN_PATH": str(lab.folder / "reports")}
    suite = lab.suite(f'{FIXTURE}<test name="first"> stopped.py </test>{ARMS}')
    finished = lab.run(suite, "test_later.py", "--rtf-report", "stopper", **environment)
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert "the run of the robot tests was stopped" in finished.out
    verdict = verdicts(finished)
    assert verdict.pop("first") is Verdict.PASSED
    assert set(verdict.values()) == {Verdict.NOT_RUN}
    assert lab.log == ["up", "down"]


def test_a_program_fails_with_its_cases(lab):
    """A program fails with its failed cases, which are named with their reasons."""
    lab.suite('<test name="p">p.sh</test><test name="q">q.sh</test>')
    write_files(
        lab.folder,
        {
            "p.sh": "#!/bin/sh\necho 1..2; echo ok 1 - moves; echo not ok 2 - stops\n",
            "q.sh": "#!/bin/sh\necho 1..1; echo ok 1 - moves\n",
        },
    )
    session = lab.run("s.xml", "-ra")
    assert session.last_line.startswith("1 failed, 1 passed")
    assert "FAILED s.xml::p - 1 of 2 cases did not pass: stops" in session.summary
    assert "p::stops: failed: checks: stops" in session.out
    assert session.results.tests["s/p::stops"].verdict is Verdict.FAILED
