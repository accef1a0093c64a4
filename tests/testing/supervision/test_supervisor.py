"""Fixtures in real runs, with processes that fail in every known way and phase."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest

from harness import MARK, Command, Outcome, marked, run_command, run_suite, write_files
from rtf import clock
from rtf.testing.events import (
    FixtureChanged,
    FixtureIncident,
    Message,
    OutputCaptured,
    StackDumped,
    TestEnded,
    TestStarted,
)
from rtf.testing.supervision import fixture_process
from rtf.testing.verdict import ExitCode, FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.runner import Run

FIXTURE = '''
import ctypes, os, signal, sys, threading
from rtf import clock
from rtf.testing import FixtureCollapsed, FixtureManager, Parameter
from rtf.testing.fixture import FixtureUnusable

class Fx(FixtureManager):
    """Notes each call in a file and then does what its parameter of that name says, in its first ``times`` lives."""
    label = Parameter(str, "who", default="fx")
    times = Parameter(int, "lives in which it misbehaves", default=1)
    on_setup = Parameter(str, "", default="")
    on_check = Parameter(str, "", default="")
    on_park = Parameter(str, "", default="")
    on_teardown = Parameter(str, "", default="")
    after = Parameter(str, "the file until which checks hold; test-began is of the first test", default="")

    def note(self, hook):
        with open(FOLDER + "/calls", "a") as stream:
            stream.write(f"{self.label} {hook} #{self.generation}\\n")

    def act(self, hook, what):
        self.note(hook)
        return getattr(self, "do_" + what, lambda: None)() if self.generation <= self.times and what else None

    def setup(self): return self.act("setup", self.on_setup)
    def check(self):
        if self.after and not os.path.exists(FOLDER + "/" + self.after): return True
        return self.act("check", self.on_check)
    def enter_safe_state(self): return self.act("park", self.on_park)
    def teardown(self): self.act("teardown", self.on_teardown)
    def on_collapse(self, reason): self.note("on_collapse")
    def before_restart(self, generation): self.note("before_restart")

    def do_raise(self): raise RuntimeError("broken on purpose")
    def do_false(self): return False
    def do_false_at_first(self): return self.generation > 1
    def do_exit(self): print("last words", flush=True); os._exit(3)
    def do_sysexit(self): sys.exit(4)
    def do_segv(self): ctypes.string_at(0)
    def do_kill(self): os.kill(os.getpid(), signal.SIGKILL)
    def do_stop(self): os.kill(os.getpid(), signal.SIGSTOP)
    def do_hang(self): self.linger_in_vain()
    def do_hang_in_c(self):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
        self.linger_in_vain()
    def linger_in_vain(self): clock.sleep(1000)
    def do_linger(self): clock.sleep(2.5); self.note("parked")
    def do_unusable(self): raise FixtureUnusable("never ever")
    def do_say_why(self): raise FixtureCollapsed("in my own words")
    def do_announce_and_false(self):
        self.collapsed("announced in check()", exit_status=7)
        return False
    def do_announce_in_thread(self):
        thread = threading.Thread(target=self.collapsed, args=("announced in a thread",)); thread.start(); thread.join()
    def do_announce_and_hang(self): self.do_announce_in_thread(); self.linger_in_vain()
    def do_garbage(self):
        for data in (b"", b"[1, 2]", b"\\xc0", b"\\x81\\xa5event\\x05", b"\\x91" * 100000):
            os.write(3, len(data).to_bytes(4, "little") + data)
    def do_foreign(self):
        from rtf.testing import events
        from rtf.testing.isolation.messages import pack
        os.write(3, pack(events.TestEnded(test="s/t", verdict="passed", outcome="passed")))
    def do_surrogate(self): self.output("\\ud800")
    def do_nonsense(self): os.write(3, b"\\x08\\0\\0\\0nonsense" * 3000)
    def do_close_channel(self): os.close(3); self.linger_in_vain()
    def do_flood(self):
        for _ in range(400): self.output("x" * 8191)
        self.output("the very last line")
    def do_chatter(self):
        for _ in range(40): self.report("y" * 1_000_000)
    def do_daemonize(self):
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0: self.linger_in_vain()
            os._exit(0)
        os.wait()
'''

TESTS = '''
import os
from rtf import clock
from rtf.testing import Parameter, TestCase

class T(TestCase):
    """Waits until a fixture's call is in the file."""
    wait_for = Parameter(str, "", default="")
    hang = Parameter(bool, "", default=False)
    quiet = Parameter(bool, "whether it keeps its beginning to itself", default=False)
    began = Parameter(str, "the file that it makes at its beginning", default="test-began")
    undo = Parameter(str, "which part of its undoing goes wrong", default="")
    def setup(self): self.add_cleanup(self.go_wrong, "clean-up")
    def teardown(self): self.go_wrong("teardown")
    def go_wrong(self, where):
        self.check(self.undo != f"{where} fails", "left")
        if self.undo == f"{where} raises": raise RuntimeError("left")
    def run(self):
        if not self.quiet: open(FOLDER + "/" + self.began, "w").close()
        if self.hang: clock.sleep(1000)
        while self.wait_for and self.wait_for not in open(FOLDER + "/calls").read(): clock.sleep(0.005)
'''

READY, COLLAPSED, FAILED = FixtureState.READY, FixtureState.COLLAPSED, FixtureState.FAILED
STARTING, STOPPING, STOPPED = FixtureState.STARTING, FixtureState.STOPPING, FixtureState.STOPPED


class Lab:
    """Runs suites of ``Fx`` and ``T`` in one folder, and keeps the calls."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(
        self, xml: str, *, interfere: Callable[[Run], None] | None = None, options: dict[str, object] | None = None
    ) -> Outcome:
        """Run a suite, and check that no process of it is left."""
        outcome = run_suite(self.folder, xml, interfere=interfere, options=options, **self.plugins())
        assert marked_others(os.environ[MARK], os.getpid()) == []
        return outcome

    def plugins(self) -> dict[str, str]:
        """Return the files of the fixtures and the test."""
        folder = repr(str(self.folder))
        text = FIXTURE.replace("FOLDER", folder)
        # A lab's own kind of fixture, with its own safe state.
        rig = f'{text.replace("class Fx(", "class Fx_(")}\nclass Rig(Fx_):\n    occupies = "rig"\n'
        return {"fx__py": text, "rig__py": rig, "t__py": TESTS.replace("FOLDER", folder)}

    @property
    def calls(self) -> list[str]:
        """The calls of the fixtures, without checks."""
        path = self.folder / "calls"
        lines = path.read_text().splitlines() if path.exists() else []
        return [line for line in lines if " check " not in line]


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A lab with short limits."""
    monkeypatch.setenv(MARK, f"{os.getpid()}-{tmp_path.name}")
    monkeypatch.setattr(fixture_process, "CHECK_LIMIT", 1.0)
    monkeypatch.setattr(fixture_process, "SAFE_STATE_LIMIT", 1.0)
    monkeypatch.setattr(fixture_process, "GRACE", 0.5)
    return Lab(tmp_path)


def marked_others(mark: str, but: int):
    """Return the living processes of a run, without this one."""
    return [process for process in marked(mark) if process.pid != but]


def fixture(
    name: str = "fx",
    depends: str = "",
    *,
    restarts: int = 1,
    timeout: str = "10 s",
    teardown: str = "10 s",
    on_lost: str = "",
    **parameters: object,
):
    """Return a fixture element with short check period and back-off."""
    inner = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    lost = f' on-lost="{on_lost}"' if on_lost else ""
    return (
        f'<fixture name="{name}" depends="{depends}" restarts="{restarts}" backoff="0.01" check-period="0.02" '
        f'timeout="{timeout}" teardown-timeout="{teardown}"{lost}>fx'
        f'<parameter name="label">{name}</parameter>{inner}</fixture>'
    )


def rig(name: str = "rig", depends: str = "", **more: object):
    """Return a fixture that occupies ``rig``, and collapses in the first test."""
    lost = {"on_check": "false", "after": "test-began", "on_lost": "error"}
    return fixture(name, depends, **{**lost, **more}).replace(">fx<", ">rig<")  # type: ignore[arg-type]


def at(what: Callable[[Event], bool], act: Callable[[Run], object]) -> Callable[[Run], None]:
    """Return a function that acts at each matching event of a run."""

    def interfere(run: Run) -> None:
        emit = run.emit

        def listening(event: Event) -> None:
            emit(event)
            if what(event):
                act(run)

        run.emit = listening

    return interfere


def on(what: Callable[[Event], bool], stage: int = 0) -> Callable[[Run], None]:
    """Return a function that interrupts a run at the first matching event."""
    return at(what, lambda run: run.control.request("a test", stage=stage))


def case(name: str = "t", attributes: str = "", **parameters: object):
    """Return a test element."""
    inner = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}" {attributes}>t{inner}</test>'


def states(outcome: Outcome, name: str = "fx"):
    """Return the states of a fixture, with its generations."""
    return [(event.state, event.generation) for event in outcome.of(FixtureChanged, fixture=name)]


def incidents(outcome: Outcome, name: str = "fx"):
    """Return the incidents of a fixture."""
    return outcome.of(FixtureIncident, fixture=name)


def verdicts(outcome: Outcome, test: str = "s/t"):
    """Return the verdict of each attempt at a test."""
    return [event.verdict for event in outcome.of(TestEnded, test=test)]


class TestSetup:
    """A setup that fails."""

    @pytest.mark.parametrize(
        ("how", "cause", "status", "signal_name"),
        [
            ("raise", "RuntimeError: broken on purpose", None, ""),
            ("false", "setup() returned False", None, ""),
            ("say_why", "in my own words", None, ""),
            ("sysexit", "SystemExit: 4", None, ""),
            ("exit", "exit status 3", 3, ""),
            ("segv", "killed by SIGSEGV", None, "SIGSEGV"),
            ("kill", "killed by SIGKILL", None, "SIGKILL"),
            ("hang", "setup() did not come back within 0.6 s", None, ""),
            ("stop", "stopped by a signal", None, ""),
            ("announce_and_hang", "announced in a thread", None, ""),
            ("close_channel", "closed the channel", None, ""),
        ],
    )
    def test_is_tried_again(self, lab: Lab, how: str, cause: str, status: int | None, signal_name: str):
        """After any failure of setup the fixture is restarted, and the test runs on the second generation."""
        timeout = "0.6 s" if how in ("hang", "stop") else "10 s"
        outcome = lab.run(fixture(on_setup=how, timeout=timeout) + case())
        (incident,) = incidents(outcome)
        assert cause in incident.cause
        assert (incident.phase, incident.generation) == (Phase.SETUP, 1)
        assert (incident.exit_status, incident.signal) == (status, signal_name)
        assert verdicts(outcome) == [Verdict.PASSED]
        assert outcome.of(TestStarted)[0].fixtures == {"fx": 2}
        assert outcome.exit_code == ExitCode.PASSED

    @pytest.mark.parametrize("how", ["raise", "false", "hang", "announce_and_hang"])
    def test_is_torn_down(self, lab: Lab, how: str):
        """A failed setup is followed by one teardown, without safe state and on_collapse."""
        lab.run(fixture(on_setup=how, timeout="0.6 s") + case())
        assert lab.calls == [
            "fx setup #1",
            "fx teardown #1",
            "fx before_restart #2",
            "fx setup #2",
            "fx park #2",
            "fx teardown #2",
        ]

    def test_leaves_teardown_its_time(self, lab: Lab):
        """A teardown after a failed setup is neither interrupted nor killed."""
        lab.run(fixture(on_setup="raise", on_teardown="linger") + case())
        assert lab.calls[:3] == ["fx setup #1", "fx teardown #1", "fx parked #1"]

    def test_that_never_works_blocks_the_tests(self, lab: Lab):
        """After all restarts the fixture has failed, its tests are blocked, and the exit code is 6."""
        outcome = lab.run(fixture(on_setup="raise", times=9, restarts=2) + case() + case("u"))
        assert states(outcome)[-1] == (FAILED, 3)
        assert len(incidents(outcome)) == 3
        assert verdicts(outcome) == verdicts(outcome, "s/u") == [Verdict.BLOCKED]
        assert "(2 restarts used up)" in outcome.detail("t")
        assert outcome.exit_code == ExitCode.FIXTURE

    def test_that_cannot_work_is_not_tried_again(self, lab: Lab):
        """FixtureUnusable fails the fixture without restarts."""
        outcome = lab.run(fixture(on_setup="unusable", times=9, restarts=3) + case())
        assert states(outcome)[-1] == (FAILED, 1)
        assert outcome.detail("t") == "fixture fx is not usable: never ever"
        assert lab.calls == ["fx setup #1", "fx teardown #1"]

    def test_does_not_begin_on_wrong_parameters(self, lab: Lab):
        """Wrong parameters are one incident, and nothing is set up or torn down."""
        outcome = lab.run(fixture(no_such="1") + case())
        (incident,) = incidents(outcome)
        assert incident.phase == Phase.LOAD
        assert "unknown parameter 'no_such'" in incident.cause
        assert lab.calls == []

    def test_hung_shows_its_stacks(self, lab: Lab):
        """The stacks of a setup that hangs are reported for the fixture."""
        outcome = lab.run(fixture(on_setup="hang", timeout="0.6 s") + case())
        (dumped,) = outcome.of(StackDumped)
        assert (dumped.fixture, dumped.test) == ("fx", "")
        assert "linger_in_vain" in dumped.text
        assert "setup() did not come back" in dumped.cause


class TestCheck:
    """A collapse while a test runs."""

    @pytest.mark.parametrize(
        ("how", "cause", "status", "signal_name"),
        [
            ("raise", "check() raised RuntimeError: broken on purpose", None, ""),
            ("false", "check() returned False", None, ""),
            ("say_why", "in my own words", None, ""),
            ("sysexit", "check() raised SystemExit: 4", None, ""),
            ("exit", "exit status 3", 3, ""),
            ("segv", "killed by SIGSEGV", None, "SIGSEGV"),
            ("kill", "killed by SIGKILL", None, "SIGKILL"),
            ("hang", "check() did not come back within", None, ""),
            ("hang_in_c", "check() did not come back within", None, ""),
            ("stop", "stopped by a signal", None, ""),
            ("announce_and_false", "announced in check()", 7, ""),
            ("announce_in_thread", "announced in a thread", None, ""),
            ("announce_and_hang", "announced in a thread", None, ""),
            ("close_channel", "closed the channel", None, ""),
            ("nonsense", "says only nonsense", None, ""),
        ],
    )
    def test_loses_the_running_test_and_repeats_it(
        self, lab: Lab, how: str, cause: str, status: int | None, signal_name: str
    ):
        """The running test is stopped as lost, and run again on the next generation."""
        outcome = lab.run(fixture(on_check=how, after="test-began") + case(wait_for="setup #2"))
        incident = incidents(outcome)[0]
        assert cause in incident.cause
        assert (incident.phase, incident.generation, incident.test) == (Phase.CHECK, 1, "s/t")
        assert (incident.exit_status, incident.signal) == (status, signal_name)
        assert verdicts(outcome) == [Verdict.FIXTURE_LOST, Verdict.PASSED]
        assert [event.fixtures for event in outcome.of(TestStarted)] == [{"fx": 1}, {"fx": 2}]
        assert states(outcome) == [
            (STARTING, 1),
            (READY, 1),
            (COLLAPSED, 1),
            (STOPPING, 1),
            (STOPPED, 1),
            (STARTING, 2),
            (READY, 2),
            (STOPPING, 2),
            (STOPPED, 2),
        ]

    @pytest.mark.parametrize("how", ["false", "hang", "announce_and_hang"])
    def test_hooks_are_called_in_order(self, lab: Lab, how: str):
        """After a collapse on_collapse, teardown, before_restart and setup are called, in this order.

        The new generation enters the safe state for the test that was cut short, and at the end.
        """
        lab.run(fixture(on_check=how, after="test-began") + case(wait_for="park #2"))
        assert lab.calls == [
            "fx setup #1",
            "fx on_collapse #1",
            "fx teardown #1",
            "fx before_restart #2",
            "fx setup #2",
            "fx park #2",
            "fx park #2",
            "fx teardown #2",
        ]

    def test_end_of_the_process_is_noticed_at_once(self, lab: Lab, monkeypatch: pytest.MonkeyPatch):
        """The death of the fixture's process is noticed without a check."""
        monkeypatch.setattr(fixture_process, "CHECK_LIMIT", 60.0)
        outcome = lab.run(fixture(on_check="kill", after="test-began") + case(wait_for="setup #2"))
        began = outcome.of(TestStarted)[0].time
        assert outcome.of(TestEnded)[0].time - began < 5.0

    def test_last_words_are_in_the_incident(self, lab: Lab):
        """The last output lines of a fixture that died are in the incident."""
        outcome = lab.run(fixture(on_check="exit", after="test-began") + case(wait_for="setup #2"))
        assert incidents(outcome)[0].output == "last words"

    def test_that_hangs_shows_its_stacks_and_not_the_tests(self, lab: Lab):
        """The stacks of a hung check are those of the fixture, not of the test."""
        outcome = lab.run(fixture(on_check="hang", after="test-began") + case(wait_for="setup #2"))
        (dumped,) = outcome.of(StackDumped)
        assert (dumped.fixture, dumped.test) == ("fx", "")
        assert "linger_in_vain" in dumped.text

    def test_of_a_hung_test_shows_its_stacks_and_not_the_fixtures(self, lab: Lab):
        """The stacks of a hung test are those of the test, not of the fixture."""
        outcome = lab.run(fixture() + case(attributes='timeout="0.5 s"', hang="true"))
        (dumped,) = outcome.of(StackDumped)
        assert (dumped.fixture, dumped.test) == ("", "s/t")
        assert "linger_in_vain" not in dumped.text

    def test_under_the_last_test_is_noticed(self, lab: Lab):
        """A test counts only if its fixture is still usable afterwards."""
        outcome = lab.run(fixture(on_check="false", after="test-began", times=9, restarts=0) + case())
        assert verdicts(outcome)[-1] in (Verdict.FIXTURE_LOST, Verdict.BLOCKED)
        assert Verdict.PASSED not in verdicts(outcome)

    def test_again_and_again_uses_up_the_restarts(self, lab: Lab):
        """A fixture that collapses each time fails after its restarts, and blocks later tests."""
        xml = fixture(on_check="false", after="test-began", times=99, restarts=2)
        outcome = lab.run(xml + case(wait_for="never") + case("u", wait_for="never") + case("v"))
        assert states(outcome)[-1] == (FAILED, 3)
        assert verdicts(outcome) == [Verdict.FIXTURE_LOST, Verdict.FIXTURE_LOST]
        assert verdicts(outcome, "s/v") == [Verdict.BLOCKED]
        assert outcome.exit_code == ExitCode.FIXTURE

    @pytest.mark.parametrize(
        ("policy", "expected"),
        [
            ("rerun", [Verdict.FIXTURE_LOST, Verdict.PASSED]),
            ("error", [Verdict.FIXTURE_LOST]),
            ("skip", [Verdict.SKIPPED]),
        ],
    )
    def test_policy_decides_what_becomes_of_the_test(self, lab: Lab, policy: str, expected: list[Verdict]):
        """A lost test is run again, an error, or skipped, by the policy; the next test runs."""
        xml = fixture(on_check="false", after="test-began", on_lost=policy) + case(wait_for="setup #2") + case("u")
        outcome = lab.run(xml)
        assert verdicts(outcome) == expected
        assert verdicts(outcome, "s/u") == [Verdict.PASSED]

    def test_of_another_fixture_disturbs_no_test(self, lab: Lab):
        """A collapse does not affect a test without that fixture; it is restarted for the next one with it."""
        xml = fixture("a", on_check="false", after="test-began") + fixture("b")
        xml += case("first", 'fixtures="a"', quiet="true")
        xml += case(attributes='fixtures="b"', wait_for="a check #1") + case("u", 'fixtures="a b"')
        outcome = lab.run(xml)
        assert verdicts(outcome) == verdicts(outcome, "s/u") == [Verdict.PASSED]
        assert outcome.of(TestStarted, test="s/u")[0].fixtures == {"a": 2, "b": 1}


class TestDependencies:
    """Fixtures that depend on others."""

    def test_worked_example(self, lab: Lab):
        """The example in the supervisor's docstring, step by step."""
        xml = (
            fixture("server", on_check="kill", after="test-began")
            + fixture("simulator", "server", restarts=0)
            + fixture("logger", restarts=0)
            + case(wait_for="simulator setup #2")
        )
        outcome = lab.run(xml)
        changes = [(event.fixture, str(event.state), event.generation) for event in outcome.of(FixtureChanged)]
        assert changes == [
            *((name, state, 1) for name in ("server", "simulator", "logger") for state in ("starting", "ready")),
            ("server", "collapsed", 1),
            ("simulator", "stopping", 1),
            ("simulator", "stopped", 1),
            ("server", "stopping", 1),
            ("server", "stopped", 1),
            *((name, state, 2) for name in ("server", "simulator") for state in ("starting", "ready")),
            *(
                (name, state, number)
                for name, number in (("logger", 1), ("simulator", 2), ("server", 2))
                for state in ("stopping", "stopped")
            ),
        ]
        assert [event.fixtures for event in outcome.of(TestStarted)] == [
            {"server": 1, "simulator": 1, "logger": 1},
            {"server": 2, "simulator": 2, "logger": 1},
        ]
        assert verdicts(outcome) == [Verdict.FIXTURE_LOST, Verdict.PASSED]

    def test_failed_one_blocks_those_above_it(self, lab: Lab):
        """A fixture that depends on a failed one is not started; tests without both run."""
        xml = fixture("a", on_setup="raise", times=9, restarts=0) + fixture("b", "a") + fixture("c")
        outcome = lab.run(xml + case(attributes='fixtures="b"') + case("u", 'fixtures="c"'))
        assert verdicts(outcome) == [Verdict.BLOCKED]
        assert verdicts(outcome, "s/u") == [Verdict.PASSED]
        assert [call for call in lab.calls if call.startswith("b")] == []

    def test_collapse_while_a_dependent_sets_up(self, lab: Lab):
        """A collapse interrupts the setup of a dependent, and both are restarted."""
        (lab.folder / "test-began").touch()
        xml = fixture("a", on_check="false", after="test-began") + fixture("b", "a", on_setup="hang", restarts=0)
        outcome = lab.run(xml + case())
        assert verdicts(outcome) == [Verdict.PASSED]
        assert outcome.of(TestStarted)[0].fixtures == {"a": 2, "b": 2}

    def test_collapse_of_an_earlier_one_while_a_later_one_sets_up(self, lab: Lab):
        """A fixture that collapses while a later one starts is restarted before the test."""
        (lab.folder / "test-began").touch()
        xml = fixture("a", on_check="false", after="test-began") + fixture("b", on_setup="raise") + case()
        outcome = lab.run(xml)
        assert verdicts(outcome)[-1] == Verdict.PASSED
        assert outcome.of(TestStarted)[-1].fixtures == {"a": 2, "b": 2}


class TestTeardown:
    """A teardown that fails."""

    @pytest.mark.parametrize(
        ("how", "cause", "status", "signal_name"),
        [
            ("raise", "teardown() raised RuntimeError: broken on purpose", None, ""),
            ("sysexit", "teardown() raised SystemExit: 4", None, ""),
            ("exit", "ended in teardown(): exit status 3", 3, ""),
            ("segv", "ended in teardown(): killed by SIGSEGV", None, "SIGSEGV"),
            ("kill", "ended in teardown(): killed by SIGKILL", None, "SIGKILL"),
            ("hang", "teardown() did not come back within 0.6 s; killed", None, ""),
            ("hang_in_c", "teardown() did not come back within 0.6 s; killed", None, ""),
            ("stop", "stopped by a signal", None, ""),
        ],
    )
    def test_is_reported_and_the_others_are_torn_down(
        self, lab: Lab, how: str, cause: str, status: int | None, signal_name: str
    ):
        """Teardown goes on in reverse order; each problem is an incident, and the run fails."""
        xml = (
            fixture("a") + fixture("b", "a", on_teardown=how, teardown="0.6 s") + fixture("c", "b", on_teardown="raise")
        )
        outcome = lab.run(xml + case())
        (incident,) = incidents(outcome, "b")
        assert cause in incident.cause
        assert (incident.phase, incident.exit_status, incident.signal) == (Phase.TEARDOWN, status, signal_name)
        assert len(incidents(outcome, "c")) == 1
        assert [call for call in lab.calls if "teardown" in call] == ["c teardown #1", "b teardown #1", "a teardown #1"]
        assert verdicts(outcome) == [Verdict.PASSED]
        assert outcome.exit_code == ExitCode.FAILURES

    def test_hung_shows_its_stacks(self, lab: Lab):
        """The stacks of a teardown that hangs are reported before it is killed."""
        outcome = lab.run(fixture(on_teardown="hang", teardown="0.6 s") + case())
        (dumped,) = outcome.of(StackDumped)
        assert dumped.fixture == "fx"
        assert "linger_in_vain" in dumped.text

    def test_only_what_was_set_up(self, lab: Lab):
        """A fixture that was never started is not torn down."""
        lab.run(fixture("a") + fixture("b") + case(attributes='fixtures="a"'))
        assert lab.calls == ["a setup #1", "a park #1", "a teardown #1"]

    def test_is_done_although_park_hangs_before_it(self, lab: Lab):
        """A safe state that hangs is interrupted, and teardown runs."""
        outcome = lab.run(fixture(on_park="hang") + case())
        assert "enter_safe_state() did not come back and was interrupted" in incidents(outcome)[0].cause
        assert lab.calls[-1] == "fx teardown #1"

    def test_leaves_nothing_behind(self, lab: Lab):
        """A process that a fixture leaves is ended with it."""
        outcome = lab.run(fixture(on_setup="daemonize") + case())
        assert verdicts(outcome) == [Verdict.PASSED]


class TestPark:
    """The safe state after tests."""

    def test_after_a_test_that_was_stopped(self, lab: Lab):
        """After a test that timed out the fixture enters the safe state before the next one."""
        lab.run(fixture() + case(attributes='timeout="0.3 s"', hang="true") + case("u"))
        assert lab.calls == ["fx setup #1", "fx park #1", "fx park #1", "fx teardown #1"]

    @pytest.mark.parametrize("isolation", ["test", "suite", "none"])
    @pytest.mark.parametrize("undo", ["teardown raises", "teardown fails", "clean-up raises", "clean-up fails"])
    def test_after_a_test_that_did_not_undo_what_it_did(self, lab: Lab, undo: str, isolation: str):
        """After a test with a failed teardown or clean-up it does so, too."""
        lab.run(fixture() + case(attributes=f'isolation="{isolation}"', undo=undo) + case("u"))
        assert lab.calls == ["fx setup #1", "fx park #1", "fx park #1", "fx teardown #1"]

    def test_on_the_next_generation_where_the_first_was_lost(self, lab: Lab):
        """The next generation enters the safe state once, before dependents are set up."""
        lost = fixture("a", on_check="false", after="test-began", on_lost="error") + fixture("b", "a")
        lab.run(lost + case(hang="true") + case("u") + case("v"))
        assert lab.calls[-8:] == [
            "a setup #2",
            "a park #2",
            "b before_restart #2",
            "b setup #2",
            "b park #2",
            "b teardown #2",
            "a park #2",
            "a teardown #2",
        ]

    @pytest.mark.parametrize(
        ("how", "cause"),
        [
            ("raise", "enter_safe_state() raised RuntimeError"),
            ("hang", "enter_safe_state() did not come back within 1 s"),
        ],
    )
    def test_that_does_not_work_is_a_collapse(self, lab: Lab, how: str, cause: str):
        """A safe state that fails is a collapse, and the next test runs on a new generation."""
        outcome = lab.run(fixture(on_park=how) + case(attributes='timeout="0.3 s"', hang="true") + case("u"))
        assert cause in incidents(outcome)[0].cause
        assert outcome.of(TestStarted, test="s/u")[0].fixtures == {"fx": 2}
        assert verdicts(outcome, "s/u") == [Verdict.PASSED]


class TestDueSafeState:
    """A fixture of a robot collapsed in a test, so that the safe state is still to be entered."""

    AGAIN = ("rig before_restart #2", "rig setup #2", "rig park #2", "rig park #2", "rig teardown #2")

    @pytest.mark.parametrize("how", ["at the end", "interrupted"])
    def test_is_made_up_for_before_the_end(self, lab: Lab, how: str):
        """The fixture starts once more to enter the safe state, also after an interrupt."""
        collapsed = on(lambda event: isinstance(event, FixtureChanged) and event.state is COLLAPSED)
        outcome = lab.run(rig() + case(hang="true"), interfere=collapsed if how == "interrupted" else None)
        assert lab.calls[-5:] == [*self.AGAIN]
        assert [incident.cause for incident in incidents(outcome, "rig")] == ["check() returned False"]

    def test_is_made_up_for_when_the_first_try_was_interrupted(self, lab: Lab):
        """The fixture enters the due safe state also if the restart for another test was interrupted."""
        second = on(
            lambda event: isinstance(event, FixtureChanged) and event.state is STARTING and event.generation == 2
        )
        outcome = lab.run(rig(restarts=1) + case(hang="true") + case("u"), interfere=second)
        assert lab.calls[-4:] == ["rig setup #3", "rig park #3", "rig park #3", "rig teardown #3"]
        assert len(incidents(outcome, "rig")) == 1

    def test_that_force_forbids_is_reported(self, lab: Lab):
        """An interrupt does not end the back-off, and force does; the omission is an incident."""

        def interfere(run: Run) -> None:
            on(lambda event: isinstance(event, FixtureChanged) and event.state is COLLAPSED)(run)
            on(lambda event: isinstance(event, FixtureChanged) and event.state is STOPPED, stage=3)(run)

        xml = rig().replace('backoff="0.01"', 'backoff="60 s"') + case(hang="true")
        began = clock.monotonic()
        outcome = lab.run(xml, interfere=interfere)
        assert clock.monotonic() - began < 30.0
        incident = incidents(outcome, "rig")[-1]
        assert incident.cause == "rig did not put back what a test left: the run was ended by force"
        assert incident.phase is Phase.TEARDOWN
        assert "rig setup #2" not in lab.calls

    def test_that_force_breaks_off_is_reported(self, lab: Lab):
        """Force ends a safe state that is under way, and the omission is an incident."""
        second = on(
            lambda event: isinstance(event, FixtureChanged) and (event.state, event.generation) == (READY, 2), 3
        )
        fixtures = rig(on_park="hang", on_check="false_at_first", times=2)
        outcome = lab.run(fixtures + case(hang="true"), interfere=second)
        causes = [incident.cause for incident in incidents(outcome, "rig")]
        assert causes == [
            "check() returned False",
            "rig did not put back what a test left: the run was ended by force",
            "killed before the end of teardown(), because the run was ended by force",
        ]

    def test_without_restarts_is_reported(self, lab: Lab):
        """Without restarts the omission is an incident, and the run fails."""
        outcome = lab.run(rig(restarts=0, on_lost="skip") + case(hang="true"))
        causes = [incident.cause for incident in incidents(outcome, "rig")]
        assert causes == [
            "check() returned False",
            "rig did not put back what a test left: check() returned False",
        ]
        assert outcome.exit_code == ExitCode.FAILURES

    def test_that_does_not_work_is_reported(self, lab: Lab):
        """The incident has the last cause, with the used restarts."""
        outcome = lab.run(rig(restarts=2, times=9, on_park="raise") + case(hang="true"))
        last = incidents(outcome, "rig")[-1].cause
        assert last.startswith("rig did not put back what a test left: ")
        assert last.endswith("enter_safe_state() raised RuntimeError: broken on purpose (2 restarts used up)")

    def test_on_what_does_not_come_up_is_reported(self, lab: Lab):
        """If a fixture below is not usable, its cause is in the incident."""
        below = fixture("a", on_check="kill", after="b-is-down", restarts=0, on_lost="error")
        above = rig("b", "a", on_check="kill").replace('backoff="0.01"', 'backoff="60"')
        down = at(
            lambda event: isinstance(event, FixtureChanged) and (event.fixture, event.state) == ("b", COLLAPSED),
            lambda _: (lab.folder / "b-is-down").touch(),
        )
        outcome = lab.run(below + above + case(hang="true"), interfere=down)
        last = incidents(outcome, "b")[-1].cause
        assert last.startswith("b did not put back what a test left: fixture a is not usable: ")

    def test_by_what_is_not_there_is_not_reported(self, lab: Lab):
        """A fixture that occupies nothing has no such incident."""
        outcome = lab.run(fixture(restarts=0, on_check="false", after="test-began") + case(hang="true"))
        assert [incident.cause for incident in incidents(outcome)] == ["check() returned False"]

    def test_is_handed_on_to_later_suites(self, lab: Lab):
        """The first later generation of that name and plug-in enters the safe state."""
        later = fixture("rig").replace(">fx<", ">rig<")
        suites = {
            "one": rig(restarts=0) + case(hang="true"),
            "two": later + case(attributes='fixtures=""'),
            "three": later + case() + case("u"),
        }
        files = {name + "__xml": f'<suite name="{name}">{xml}</suite>' for name, xml in suites.items()}
        write_files(lab.folder, {**lab.plugins(), **files})
        outcome = run_command(lab.folder, *(f"--suite={name}.xml" for name in suites))
        assert lab.calls == [
            "rig setup #1",
            "rig on_collapse #1",
            "rig teardown #1",
            "rig setup #1",
            "rig park #1",
            "rig park #1",
            "rig teardown #1",
        ]
        assert len(incidents(outcome, "rig")) == 2


class TestChannel:
    """Invalid messages of a fixture's process."""

    @pytest.mark.parametrize("how", ["garbage", "foreign"])
    def test_nonsense_is_reported_and_survived(self, lab: Lab, how: str):
        """Invalid messages are reported as errors, and have no other effect."""
        outcome = lab.run(fixture(on_setup=how) + case())
        said = outcome.of(Message, fixture="fx", severity=Severity.ERROR)
        assert said
        assert all(message.title == "protocol" for message in said)
        assert verdicts(outcome) == [Verdict.PASSED]

    def test_text_that_is_no_unicode_is_survived(self, lab: Lab):
        """A lone surrogate in a fixture's output is escaped."""
        outcome = lab.run(fixture(on_setup="surrogate") + case())
        assert outcome.of(OutputCaptured, fixture="fx")[0].text == "\\ud800\n"

    def test_flood_of_output_is_bounded(self, lab: Lab):
        """Of a flood of output beginning and end are kept, and the rest is counted."""
        outcome = lab.run(fixture(on_setup="flood") + case())
        captured = outcome.of(OutputCaptured, fixture="fx")
        kept = sum(len(event.text) for event in captured)
        assert kept < 512 * 1024
        assert kept + sum(event.omitted for event in captured) == 400 * 8192 + len("the very last line\n")
        assert captured[-1].text.endswith("the very last line\n")

    def test_flood_of_messages_is_bounded(self, lab: Lab):
        """Messages beyond 16 MB are counted and omitted."""
        outcome = lab.run(fixture(on_setup="chatter") + case())
        said = outcome.of(Message, fixture="fx")
        assert sum(len(message.detail) for message in said) < 17 << 20
        assert said[-1].detail.endswith("messages left out: the fixture said too much")


class TestInterrupt:
    """An interrupted run."""

    def test_ends_a_back_off(self, lab: Lab):
        """An interrupt ends the back-off, and the fixture does not count as failed."""

        def interfere(run: Run) -> None:
            emit = run.emit

            def listening(event: Event) -> None:
                emit(event)
                if isinstance(event, FixtureChanged) and event.state is STOPPED:
                    run.control.request("a test")

            run.emit = listening

        xml = fixture(on_setup="raise", times=9).replace('backoff="0.01"', 'backoff="60 s"') + case()
        began = clock.monotonic()
        outcome = lab.run(xml, interfere=interfere)
        assert clock.monotonic() - began < 20.0
        assert verdicts(outcome) == [Verdict.NOT_RUN]
        assert states(outcome)[-1] == (STOPPED, 1)

    def test_ends_a_setup(self, lab: Lab):
        """An interrupt stops a setup, followed by teardown, without an incident."""

        def interfere(run: Run) -> None:
            emit = run.emit

            def listening(event: Event) -> None:
                emit(event)
                if isinstance(event, FixtureChanged) and event.state is STARTING:
                    run.control.request("a test")

            run.emit = listening

        outcome = lab.run(fixture(on_setup="hang", timeout="60 s") + case(), interfere=interfere)
        assert verdicts(outcome) == [Verdict.NOT_RUN]
        assert incidents(outcome) == []


class TestCommandLine:
    """Fixtures of the command ``testrunner``."""

    def write(self, lab: Lab, **suites: str) -> None:
        """Write suites and plug-ins into the lab's folder."""
        files = {name + "__xml": f'<suite name="{name}">{xml}</suite>' for name, xml in suites.items()}
        write_files(lab.folder, {**lab.plugins(), **files})

    def test_workers_have_fixtures_of_their_own(self, lab: Lab) -> None:
        """With two jobs each suite worker restarts its own fixture, and repeats its test."""
        self.write(
            lab,
            one=fixture("a", on_check="false", after="one-began") + case(wait_for="a setup #2", began="one-began"),
            two=fixture("b", on_check="kill", after="two-began") + case(wait_for="b setup #2", began="two-began"),
        )
        outcome = run_command(lab.folder, "-j", "2", "-s", "one.xml", "-s", "two.xml")
        for suite in ("one", "two"):
            assert verdicts(outcome, f"{suite}/t") == [Verdict.FIXTURE_LOST, Verdict.PASSED]

    @pytest.mark.parametrize("signum", [signal.SIGKILL, signal.SIGSEGV])
    def test_runner_that_dies_leaves_nothing(self, lab: Lab, signum: int) -> None:
        """If the runner dies, fixtures enter the safe state and tear down in reverse order, and no process is left."""
        self.write(lab, one=fixture("a") + fixture("b", "a") + case(hang="true"))
        command = Command(lab.folder, "-s", "one.xml")
        command.wait_for(lambda events: any(isinstance(event, TestStarted) for event in events))
        command.signal(signum)
        command.process.communicate(timeout=20)
        assert command.left_over() == []
        assert lab.calls == [
            "a setup #1",
            "b setup #1",
            "b park #1",
            "b teardown #1",
            "a park #1",
            "a teardown #1",
        ]

    @pytest.mark.parametrize(
        ("what", "patience", "called"),
        [
            ("on_park linger", "ORPHAN_GRACE = 1.5", ["b park", "b parked", "b teardown", "a park", "a teardown"]),
            ("on_park hang", "SAFE_STATE_LIMIT = 0.3", ["b park", "b teardown", "a park", "a teardown"]),
            (
                "on_park hang_in_c",
                "ORPHAN_GRACE = fork_server.SAFE_STATE_LIMIT = 1.5",
                ["b park", "a park", "a teardown"],
            ),
            ("on_teardown hang", "ORPHAN_GRACE = 1.5", ["b park", "b teardown", "a park", "a teardown"]),
        ],
    )
    def test_runner_that_dies_leaves_time_for_the_safe_state(
        self, lab: Lab, what: str, patience: str, called: list[str]
    ) -> None:
        """Each fixture then has its time; one that hangs is killed, and the next has its turn."""
        hook, how = what.split()
        fixtures = fixture("a") + fixture("b", "a", **{hook: how})
        (lab.folder / "patience.py").write_text(
            f"from rtf.testing.isolation import fork_server\nfork_server.{patience}\n"
        )
        files = {"one.xml": f'<suite name="one" preload="patience">{fixtures}{case(hang="true")}</suite>'}
        write_files(lab.folder, {**lab.plugins(), **files})
        command = Command(lab.folder, "-s", "one.xml", PYTHONPATH=str(lab.folder))
        command.wait_for(lambda events: any(isinstance(event, TestStarted) for event in events))
        command.signal(signal.SIGKILL)
        command.process.communicate(timeout=20)
        assert command.left_over() == []
        assert lab.calls == ["a setup #1", "b setup #1", *(f"{call} #1" for call in called)]
