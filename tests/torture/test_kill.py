"""``kill -9`` at random instants: of the runner, the fork server, a test, a fixture's host, a fixture's program.

After each kill, every finished result is in the journal and intact, no process is left, ``--resume`` runs the tests
that are left and no others, reports can be made, and no report changes the verdict of a finished test.

``RTF_TORTURE_ROUNDS`` sets the number of rounds a victim; a round is reproduced by its seed, as far as time can be.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
from typing import TYPE_CHECKING

import psutil
import pytest
from junitparser import JUnitXml

from harness import Command, marked, read_back, run_command, write_files
from rtf import clock
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.testing import journal
from rtf.testing.events import (
    FixtureChanged,
    RunEnded,
    RunStarted,
    TestEnded,
    TestPlanned,
    TestStarted,
    from_line,
)
from rtf.testing.verdict import FixtureState, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event

pytestmark = pytest.mark.torture

ROUNDS = int(os.environ.get("RTF_TORTURE_ROUNDS", "4"))
TESTS = 8
PROGRAM = "86399"

FIXTURE = f"""
import subprocess
from rtf.testing import FixtureManager

class Rig(FixtureManager):
    '''A program, and a log of what was done to it.'''

    def note(self, word):
        with open("rig.log", "a") as stream:
            stream.write(word + "\\n")

    def setup(self):
        self.process = subprocess.Popen(["sleep", "{PROGRAM}"], start_new_session=True)
        self.note("up")

    def check(self):
        return self.process.poll() is None

    def teardown(self):
        self.process.kill()
        self.process.wait()
        self.note("down")
"""
TEST = """
import time
from rtf.testing import TestCase

class Steady(TestCase):
    '''Does a little of everything.'''

    def setup(self):
        self.report("begins")

    def run(self):
        with self.subresult("part"):
            self.check(True, "holds")
        time.sleep(0.03)
        self.measure("length", 1.5, "mm", low=1, high=2)
        print("words")

    def teardown(self):
        self.report("ends")
"""
SUITE = (
    '<suite name="s"><fixture check-period="0.05" backoff="0.01" restarts="5">rig.py</fixture>'
    + "".join(f'<test name="t{index}">steady.py</test>' for index in range(TESTS))
    + "</suite>"
)
NAMES = {f"s/t{index}" for index in range(TESTS)}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a suite of steady tests on a rig."""
    write_files(tmp_path, {"suite.xml": SUITE, "rig.py": FIXTURE, "steady.py": TEST})
    return tmp_path


def start(folder: Path) -> Command:
    """Start a run of the suite."""
    return Command(folder, "--suite", "suite.xml", "--no-output", "--junit", "live.xml")


def events_so_far(folder: Path) -> list[Event]:
    """Return the events in the journal."""
    path = folder / "rtf-runs" / "latest" / journal.FILE_NAME
    return [*journal.read(path)] if path.exists() else []


def victims(command: Command) -> dict[str, int]:
    """Return the run's processes that are there now, by their kind."""
    found = {"runner": command.process.pid}
    for event in events_so_far(command.folder):
        if isinstance(event, TestStarted):
            found["test"] = event.pid
        elif isinstance(event, TestEnded):
            found.pop("test", None)
        elif isinstance(event, FixtureChanged) and event.pid:
            found["host"] = event.pid
            if event.state is FixtureState.STOPPED:
                found.pop("host")
    for process in marked(command.mark):
        try:
            if PROGRAM in process.cmdline():
                found["program"] = process.pid
            elif process.ppid() == command.process.pid:
                found["fork_server"] = process.pid
        except psutil.NoSuchProcess:
            continue
    return found


def kill(pid: int) -> None:
    """Kill a process, which may have ended already."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def final_verdicts(events: list[Event]) -> dict[str, Verdict]:
    """Return the verdict of each test that has a final one."""
    return {event.test: event.verdict for event in events if isinstance(event, TestEnded) and event.final}


def check_whole(folder: Path) -> list[Event]:
    """Check that each line of the journal but a torn last one is an event, in order. Returns the events."""
    data = (folder / "rtf-runs" / "latest" / journal.FILE_NAME).read_bytes()
    events = [from_line(line) for line in data.split(b"\n")[:-1]]
    assert [event.seq for event in events] == [*range(1, len(events) + 1)]
    for index, event in enumerate(events):
        if isinstance(event, TestEnded) and event.attempt:
            assert any(isinstance(other, TestStarted) and other.test == event.test for other in events[:index])
    return events


def check_reports(folder: Path, expected: dict[str, Verdict]) -> None:
    """Check that reports made from the journal have each test with the verdict of the live run."""
    made = run_command(folder, "report", "rtf-runs/latest", "--junit", "again.xml", "-q")
    assert "Traceback" not in made.stderr
    cases = {case.name for suite in JUnitXml.fromfile(str(folder / "again.xml")) for case in suite}
    assert {name.rpartition("/")[2] for name in expected} <= cases
    results = journal.results_of(folder / "rtf-runs" / "latest")
    assert {test: results.tests[test].verdict for test in expected} == expected


@pytest.mark.parametrize("seed", range(ROUNDS * 2))
def test_killed_runner_loses_nothing_and_is_resumed(folder: Path, seed: int):
    """Whenever the runner is killed, finished results stay, the fixture is torn down, and the run can be resumed."""
    rng = random.Random(seed)
    command = start(folder)
    clock.sleep(rng.uniform(0.05, 1.0))
    command.signal(signal.SIGKILL)
    command.process.communicate(timeout=30)
    assert command.left_over() == []
    log = (folder / "rig.log").read_text().split() if (folder / "rig.log").exists() else []
    assert log.count("up") == log.count("down"), "what was set up was torn down by those who were left"
    if not events_so_far(folder):
        return  # it had not begun
    before = check_whole(folder)
    finished = final_verdicts(before)
    assert {*finished.values()} <= {Verdict.PASSED}
    was_over = any(isinstance(event, RunEnded) for event in before)
    check_reports(folder, finished)

    record = MotionRecord(folder / "rtf-runs/latest")
    record.record_permission("icub", may_move=True)
    resumed = run_command(folder, "--resume", "rtf-runs/latest", "--junit", "live.xml")
    assert resumed.exit_code == 0, resumed.stderr
    assert not record.may_move("icub"), "what somebody said of the robot before the run was resumed is of the past"
    events = check_whole(folder)
    second = max(index for index, event in enumerate(events) if isinstance(event, RunStarted))
    again = {event.test for event in events[second:] if isinstance(event, TestStarted)}
    assert again == NAMES - finished.keys(), "the rest, and only the rest"
    assert not (again and was_over)
    assert final_verdicts(events) == dict.fromkeys(NAMES, Verdict.PASSED)
    assert isinstance(events[-1], RunEnded)
    assert {event.test for event in events if isinstance(event, TestPlanned)} == NAMES
    check_reports(folder, dict.fromkeys(NAMES, Verdict.PASSED))


@pytest.mark.parametrize("seed", range(ROUNDS))
@pytest.mark.parametrize("victim", ["fork_server", "test", "host", "program"])
def test_run_survives_the_death_of_any_other_process(folder: Path, victim: str, seed: int):
    """Whichever process below the runner is killed, every test gets its verdict and the run ends in order."""
    rng = random.Random(f"{victim} {seed}")
    command = start(folder)
    clock.sleep(rng.uniform(0.15, 0.7))
    deadline = clock.Deadline.after(10.0)
    while victim not in (found := victims(command)) and command.process.poll() is None and not deadline.expired:
        clock.sleep(0.002)
    if victim in found and command.process.poll() is None:
        kill(found[victim])
    outcome = command.wait(60)
    assert command.left_over() == []
    assert "Traceback" not in outcome.stderr
    assert "internal error" not in outcome.stderr + outcome.stdout
    events = check_whole(folder)
    verdicts = final_verdicts(events)
    assert verdicts.keys() == NAMES
    assert isinstance(events[-1], RunEnded)
    assert outcome.exit_code == events[-1].exit_code
    odd = {verdict for verdict in verdicts.values() if verdict is not Verdict.PASSED}
    if victim in ("host", "program"):
        assert odd == set(), "the fixture was restarted, and its test run again"
    else:
        assert odd <= {Verdict.ERROR, Verdict.FIXTURE_LOST}
        assert sum(verdict is not Verdict.PASSED for verdict in verdicts.values()) <= 1
    check_reports(folder, verdicts)


def test_resuming_a_run_that_is_still_going_on_is_refused(folder: Path):
    """A second runner on a run that still goes on is refused and changes nothing, for a journal has one writer."""
    waiting = TEST.replace("time.sleep(0.03)", "while not os.path.exists('go'): time.sleep(0.002)")
    write_files(folder, {"steady.py": waiting.replace("import time", "import os, time")})
    command = start(folder)
    command.wait_for(lambda events: any(isinstance(event, TestStarted) for event in events))
    second = run_command(folder, "--resume", "rtf-runs/latest")
    assert second.exit_code == 4
    assert "another runner is writing it" in second.stderr
    (folder / "go").touch()
    assert command.wait().exit_code == 0
    check_whole(folder)


def test_resuming_a_run_that_is_complete_runs_nothing(folder: Path):
    """Resuming a complete run starts no test and has the exit code of the run."""
    assert start(folder).wait().exit_code == 0
    outcome = run_command(folder, "--resume", "rtf-runs/latest")
    assert outcome.exit_code == 0
    second = max(index for index, event in enumerate(outcome.events) if isinstance(event, RunStarted))
    assert not [event for event in outcome.events[second:] if isinstance(event, TestStarted | FixtureChanged)]


def test_run_killed_again_and_again_comes_to_its_end(folder: Path):
    """A run that is killed and resumed five times is one run in which each test has passed once."""
    rng = random.Random(5)
    command = start(folder)
    for _ in range(5):
        command.wait_for(lambda events: any(isinstance(event, RunStarted) for event in events))
        clock.sleep(rng.uniform(0.1, 0.3))
        command.signal(signal.SIGKILL)
        command.process.communicate(timeout=30)
        assert command.left_over() == []
        command = Command(folder, "--resume", "rtf-runs/latest")
    outcome = command.wait()
    assert outcome.exit_code == 0, outcome.stderr
    ends = [event.test for event in outcome.of(TestEnded, verdict=Verdict.PASSED)]
    assert sorted(ends) == sorted(NAMES)
    _, results = read_back(folder / "rtf-runs" / "latest")
    assert {test.verdict for test in results.tests.values()} == {Verdict.PASSED}
