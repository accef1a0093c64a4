"""Interrupts of the real command: once, twice, three times, and at the worst moments.

The first SIGINT lets the running test finish, the second stops it, the third kills it; SIGTERM and SIGHUP stop it at
once. Always: fixtures are torn down, reports written, the journal closed, and the exit code says that the run was
interrupted.
"""

from __future__ import annotations

import signal
import subprocess
from typing import TYPE_CHECKING

import pytest
from junitparser import JUnitXml

from harness import Command, Outcome, write_files
from rtf import clock
from rtf.testing.events import (
    FixtureChanged,
    FixtureIncident,
    Interrupted,
    PhaseStarted,
    RunEnded,
    TestEnded,
    TestStarted,
)
from rtf.testing.verdict import FixtureState, Phase, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from rtf.testing.events import Event

COMMON = """
import ctypes, time
from pathlib import Path
from rtf.testing import FixtureManager, TestCase

def note(word):
    with open("log", "a") as stream:
        stream.write(word + "\\n")

def wait_for_go(name="go"):
    while not Path(name).exists():
        time.sleep(0.002)
"""
RIG = (
    COMMON
    + """
class Rig(FixtureManager):
    stop_limit = STOP_LIMIT

    def setup(self):
        note("rig up")
        HOOK_UP

    def enter_safe_state(self):
        HOOK_SAFE

    def teardown(self):
        note("rig going down")
        HOOK_DOWN
        note("rig down")
"""
)
TEST = (
    COMMON
    + """
class Test(TestCase):
    def run(self):
        note("run")
        HOOK

    def teardown(self):
        note("teardown")
        HOOK_TEARDOWN
        note("torn down")
"""
)


class Scene:
    """A suite of three tests with a fixture, in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def start(
        self,
        run: str = "pass",
        *arguments: str,
        teardown: str = "pass",
        up: str = "pass",
        safe: str = "pass",
        down: str = "pass",
        stop_limit: float = 4.0,
    ) -> Command:
        """Start the run; the first test executes ``run``, the others nothing."""
        suite = (
            '<fixture>rig.py</fixture><test name="a">a.py</test><test name="b">b.py</test><test name="c">b.py</test>'
        )
        test = TEST.replace("HOOK_TEARDOWN", teardown).replace("HOOK", run)
        write_files(
            self.folder,
            {
                "suite.xml": f'<suite name="s">{suite}</suite>',
                "rig.py": RIG.replace("HOOK_UP", up)
                .replace("HOOK_SAFE", safe)
                .replace("HOOK_DOWN", down)
                .replace("STOP_LIMIT", str(stop_limit)),
                "a.py": test,
                "b.py": TEST.replace("HOOK_TEARDOWN", "pass").replace("HOOK", "pass"),
            },
        )
        return Command(self.folder, "--suite", "suite.xml", "--junit", "out.xml", "--grace", "30", *arguments)

    def go(self, name: str = "go") -> None:
        """Let a waiting test go on."""
        (self.folder / name).touch()

    @property
    def log(self) -> list[str]:
        """The notes up to now."""
        path = self.folder / "log"
        return path.read_text().splitlines() if path.exists() else []

    def wait_until_noted(self, word: str) -> None:
        """Wait until a word is in the log."""
        deadline = clock.Deadline.after(30.0)
        while word not in self.log:
            assert not deadline.expired
            clock.sleep(0.002)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """A folder for a run that is interrupted."""
    return Scene(tmp_path)


def stage(number: int) -> Callable[[list[Event]], bool]:
    """Return a function that finds an interrupt of this stage among events."""
    return lambda events: any(isinstance(event, Interrupted) and event.stage == number for event in events)


def interrupt(command: Command, times: int = 1, signum: int = signal.SIGINT) -> None:
    """Interrupt a run several times, each after the one before has been noticed."""
    for count in range(1, times + 1):
        command.signal(signum)
        if count < times:
            command.wait_for(stage(count))


def check_end(command: Command, scene: Scene, **verdicts: Verdict) -> Outcome:
    """Wait for the end of an interrupted run, and check verdicts, reports and remaining processes."""
    outcome = command.wait()
    assert outcome.exit_code == 2, outcome
    assert {test.id[2:]: test.verdict for test in outcome.results.tests.values()} == verdicts
    last = outcome.events[-1]
    assert isinstance(last, RunEnded)
    assert (last.verdict, last.exit_code) == (Verdict.INTERRUPTED, 2)
    cases = {case.name for suite in JUnitXml.fromfile(str(scene.folder / "out.xml")) for case in suite}
    assert {"a", "b", "c"} <= cases
    assert "Traceback" not in outcome.stderr
    assert scene.log.count("rig up") == scene.log.count("rig going down")
    states = [event.state for event in outcome.of(FixtureChanged)]
    assert not states or states[-1] in (FixtureState.STOPPED, FixtureState.FAILED)
    assert command.left_over() == []
    return outcome


def test_first_interrupt_lets_the_running_test_finish(scene: Scene):
    """The running test ends with its teardown, and no other one is started."""
    command = scene.start("wait_for_go()")
    scene.wait_until_noted("run")
    interrupt(command)
    command.wait_for(stage(1))
    scene.go()
    outcome = check_end(command, scene, a=Verdict.PASSED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert scene.log == ["rig up", "run", "teardown", "torn down", "rig going down", "rig down"]
    (interrupted,) = outcome.of(Interrupted)
    assert (interrupted.source, interrupted.stage) == ("SIGINT", 1)


LOCKED = (
    "lock = ctypes.create_string_buffer(128); wait = ctypes.PyDLL(None).pthread_mutex_lock; "
    "wait(lock); note('locked'); wait(lock)"
)


def stop_as_docker_does(command: Command, signum: int, limit: float = 10.0) -> float:
    """Send a signal, kill the run after ``limit`` seconds, and return its duration."""
    began = clock.monotonic()
    command.signal(signum)
    try:
        command.process.wait(limit)
    except subprocess.TimeoutExpired:
        command.process.kill()
    return clock.monotonic() - began


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGHUP], ids=lambda signum: signum.name)
def test_sigterm_ends_a_run_before_it_is_killed(scene: Scene, signum: signal.Signals):
    """A test is stopped and torn down, the fixture enters its safe state, and reports are written in time."""
    command = scene.start("time.sleep(40)", safe="note('safe')")
    scene.wait_until_noted("run")
    assert stop_as_docker_does(command, signum) < 8
    outcome = check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert scene.log == ["rig up", "run", "teardown", "torn down", "safe", "rig going down", "rig down"]
    (interrupted,) = outcome.of(Interrupted)
    assert (interrupted.source, interrupted.stage) == (signum.name, 2)


def test_sigterm_ends_a_run_in_which_everything_hangs(scene: Scene):
    """A hung test, safe state and teardown are cut short, and reports are written in time."""
    command = scene.start(LOCKED, safe="time.sleep(40)", down=LOCKED.replace("locked", "stuck"))
    scene.wait_until_noted("locked")
    assert stop_as_docker_does(command, signal.SIGTERM) < 9  # nothing ends sooner than its limit here
    outcome = check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    causes = [event.cause for event in outcome.of(FixtureIncident)]
    assert causes[0] == "enter_safe_state() did not come back and was interrupted"
    assert causes[1].startswith(("killed before the end of teardown()", "teardown() did not come back within"))


def test_sigterm_cuts_a_teardown_short_that_takes_too_long(scene: Scene):
    """SIGTERM cuts a long teardown of a test short."""
    command = scene.start("pass", teardown="time.sleep(20)")
    scene.wait_until_noted("teardown")
    assert stop_as_docker_does(command, signal.SIGTERM) < 8
    check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)


def test_a_fixture_that_needs_longer_than_a_run_has_says_so(scene: Scene):
    """The stop limit that a fixture declares is waited for, and reported."""
    command = scene.start("time.sleep(40)", safe="time.sleep(4)", stop_limit=6)
    scene.wait_until_noted("run")
    assert 4 <= stop_as_docker_does(command, signal.SIGTERM) < 10
    outcome = check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert scene.log[-1] == "rig down"
    assert "fixture rig needs up to 6 s to be brought down safely" in outcome.stderr
    assert not outcome.of(FixtureIncident)


def test_first_interrupt_is_the_last_attempt(scene: Scene):
    """A test that fails after the interrupt is not retried."""
    command = scene.start("wait_for_go(); self.assert_fail('wrong')", "--retries", "3")
    scene.wait_until_noted("run")
    interrupt(command)
    command.wait_for(stage(1))
    scene.go()
    outcome = check_end(command, scene, a=Verdict.FAILED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert len(outcome.of(TestEnded, test="s/a")) == 1


def test_second_interrupt_stops_the_running_test(scene: Scene):
    """The running test is stopped, and its teardown runs."""
    command = scene.start("wait_for_go()")
    scene.wait_until_noted("run")
    interrupt(command, 2)
    check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert scene.log == ["rig up", "run", "teardown", "torn down", "rig going down", "rig down"]


def test_second_interrupt_does_not_cut_a_teardown_short(scene: Scene):
    """A teardown that has begun is completed."""
    command = scene.start("pass", teardown="wait_for_go()")
    scene.wait_until_noted("teardown")
    interrupt(command, 2)
    command.wait_for(stage(2))
    scene.go()
    check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert "torn down" in scene.log


def test_failure_found_before_the_second_interrupt_stands(scene: Scene):
    """A failure before the interrupt is the verdict."""
    command = scene.start("self.check(False, 'wrong'); note('checked'); wait_for_go()")
    scene.wait_until_noted("checked")
    interrupt(command, 2)
    outcome = check_end(command, scene, a=Verdict.FAILED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert outcome.detail("a") == "wrong; then: the run was interrupted"


def test_second_interrupt_kills_a_test_that_hangs_in_native_code(scene: Scene):
    """A test that does not react is killed after the grace, and the fixture is torn down."""
    command = scene.start(LOCKED, "--grace", "0.3")
    scene.wait_until_noted("locked")
    interrupt(command, 2)
    outcome = check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert "did not react to being stopped and was killed" in outcome.detail("a")


def test_third_interrupt_kills_at_once(scene: Scene):
    """The running test is killed without its teardown, and the fixture is torn down."""
    command = scene.start("wait_for_go()", teardown="wait_for_go()")
    scene.wait_until_noted("run")
    interrupt(command, 2)
    scene.wait_until_noted("teardown")
    command.signal()
    outcome = check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert "torn down" not in scene.log
    assert scene.log[-1] == "rig down"
    (ended,) = outcome.of(TestEnded, test="s/a")
    assert ended.signal == "SIGKILL"
    assert [event.stage for event in outcome.of(Interrupted)] == [1, 2, 3]


def test_interrupt_in_the_last_test_is_not_forgotten(scene: Scene):
    """A run that is interrupted in its last test counts as interrupted."""
    command = scene.start("wait_for_go()", "-k", "a")
    scene.wait_until_noted("run")
    interrupt(command)
    command.wait_for(stage(1))
    scene.go()
    outcome = command.wait()
    assert outcome.exit_code == 2
    assert outcome.verdict("a") is Verdict.PASSED
    assert scene.log[-1] == "rig down"
    assert command.left_over() == []


def test_interrupt_while_a_fixture_sets_up(scene: Scene):
    """A setup is interrupted and torn down, and no test is started."""
    command = scene.start(up="wait_for_go()")
    scene.wait_until_noted("rig up")
    interrupt(command)
    outcome = check_end(command, scene, a=Verdict.NOT_RUN, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    assert scene.log == ["rig up", "rig going down", "rig down"]
    assert not outcome.of(TestStarted)


def test_interrupt_while_a_fixture_tears_down(scene: Scene):
    """A fixture's teardown is completed, and verdicts stay."""
    command = scene.start(down="wait_for_go()")
    scene.wait_until_noted("rig going down")
    interrupt(command)
    command.wait_for(stage(1))
    scene.go()
    check_end(command, scene, a=Verdict.PASSED, b=Verdict.PASSED, c=Verdict.PASSED)
    assert scene.log[-1] == "rig down"


def test_three_interrupts_end_a_fixture_that_does_not_come_down(scene: Scene):
    """After three interrupts a teardown that hangs is killed."""
    command = scene.start(down="time.sleep(3600)")
    scene.wait_until_noted("rig going down")
    interrupt(command, 3)  # each after the one before: signals that are pending together count as one
    outcome = check_end(command, scene, a=Verdict.PASSED, b=Verdict.PASSED, c=Verdict.PASSED)
    assert outcome.events[-1].duration < 15


def test_interrupts_reach_every_worker(tmp_path: Path):
    """With ``-j`` each running test finishes, and no other is started."""
    scene = Scene(tmp_path)
    files = {
        f"s{n}.xml": f'<suite name="s{n}"><test name="a{n}">w{n}.py</test><test name="b{n}">w.py</test></suite>'
        for n in (1, 2)
    }
    body = COMMON + "class W(TestCase):\n    def run(self):\n        note('NAME')\n        wait_for_go()\n"
    write_files(
        tmp_path,
        files
        | {"w1.py": body.replace("NAME", "1"), "w2.py": body.replace("NAME", "2"), "w.py": body.replace("NAME", "3")},
    )
    command = Command(tmp_path, "--suite", "s1.xml", "--suite", "s2.xml", "-j", "2")
    scene.wait_until_noted("1")
    scene.wait_until_noted("2")
    interrupt(command)
    command.wait_for(stage(1))
    scene.go()
    outcome = command.wait()
    assert outcome.exit_code == 2
    assert {test.id: test.verdict for test in outcome.results.tests.values()} == {
        "s1/a1": Verdict.PASSED,
        "s2/a2": Verdict.PASSED,
        "s1/b1": Verdict.NOT_RUN,
        "s2/b2": Verdict.NOT_RUN,
    }
    assert sorted(scene.log) == ["1", "2"]


def test_signal_that_was_ignored_from_the_beginning_stays_ignored(scene: Scene):
    """A signal that was ignored at the start, as by ``nohup``, stays ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        command = scene.start("wait_for_go()")
    finally:
        signal.signal(signal.SIGHUP, before)
    scene.wait_until_noted("run")
    command.signal(signal.SIGHUP)
    scene.go()
    assert command.wait().exit_code == 0


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12])
def test_interrupt_before_the_run_has_begun(scene: Scene, delay: float):
    """An interrupt at any moment of the start leaves no process, and no traceback of the runner."""
    command = scene.start()
    clock.sleep(delay)
    command.signal()
    outcome = command.wait()
    # Python is interrupted before RTF's first line; in a callback of an import it prints that and goes on.
    dropped = outcome.stderr.startswith("Exception ignored in: ") and "KeyboardInterrupt" in outcome.stderr
    assert outcome.exit_code in ((0,) if dropped else (2, 1, -signal.SIGINT, 130))
    assert "rtf/testing/runner.py" not in outcome.stderr
    assert command.left_over() == []


def test_interrupted_run_is_resumed_with_what_it_owes(scene: Scene):
    """A resumed run runs what was interrupted or not run, and has the verdict of the whole."""
    command = scene.start("wait_for_go()")
    scene.wait_until_noted("run")
    interrupt(command, 2)
    check_end(command, scene, a=Verdict.INTERRUPTED, b=Verdict.NOT_RUN, c=Verdict.NOT_RUN)
    scene.go()
    outcome = Command(scene.folder, "--resume", "rtf-runs/latest").wait()
    assert outcome.exit_code == 0
    assert {test.verdict for test in outcome.results.tests.values()} == {Verdict.PASSED}
    phases = [event.phase for event in outcome.of(PhaseStarted, test="s/a")]
    assert phases == [Phase.RUN, Phase.TEARDOWN, Phase.RUN, Phase.TEARDOWN]
