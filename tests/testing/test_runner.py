"""The runner: suite workers, shared fixtures, early ends, isolation, exit codes, and internal errors."""

from __future__ import annotations

import resource
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import pytest

from harness import Command, Outcome, read_back, run_command, run_suite, write_files
from rtf.testing import journal
from rtf.testing.broadcast import Broadcast
from rtf.testing.dispatch import groups_sharing_fixtures
from rtf.testing.events import (
    Event,
    FixtureChanged,
    FixtureIncident,
    InternalError,
    RunEnded,
    StackDumped,
    SuiteEnded,
    SuiteStarted,
    TestEnded,
    TestStarted,
)
from rtf.testing.isolation.worker_pool import ForkServerClient, ForkServerLostError
from rtf.testing.plan import Planner, load_files
from rtf.testing.reporting import Reporter, ReportOptions
from rtf.testing.run_state import RunOptions
from rtf.testing.runner import Run
from rtf.testing.verdict import ExitCode, FixtureState, Verdict

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.testing.isolation.child import Child
    from rtf.testing.plugins import PluginRef
    from rtf.testing.results import RunResult

HEAD = """
import os, time
from pathlib import Path
from rtf.testing import FixtureManager, Parameter, TestCase

LOG = Path(__file__).with_name("log")

def note(word):
    with LOG.open("a") as stream:
        stream.write(word + "\\n")

def wait_for(word):
    while word not in (LOG.read_text().split() if LOG.exists() else []):
        time.sleep(0.002)
"""


def test_file(body: str) -> str:
    """Return a test plug-in with this body."""
    return f"{HEAD}\nclass T(TestCase):\n    def run(self):\n        {body}\n"


test_file.__test__ = False  # type: ignore[attr-defined]


def rig_file(name: str = "") -> str:
    """Return a fixture plug-in that notes its calls."""
    return (
        f"{HEAD}\nclass Rig(FixtureManager):\n    speed = Parameter(float, 'how fast', default=1.0)\n"
        f"    def setup(self):\n        note('up{name}')\n"
        f"    def teardown(self):\n        note('down{name}')\n"
    )


@dataclass
class Recorder(Reporter):
    """A reporter that raises an error where it is told to."""

    plugin_name: ClassVar[str] = "recorder"
    breaks_at: type[Event] | None = None
    breaks_on_close: bool = False
    heard: list[str] = field(default_factory=list)
    order: list[int] = field(default_factory=list)
    closed: int = 0

    def __post_init__(self) -> None:
        super().__init__(ReportOptions(target=None, run_folder=Path()))

    def handle(self, event: Event, results: RunResult) -> None:
        """Note the event, or raise an error."""
        self.heard.append(event.kind)
        self.order.append(event.seq)
        if self.breaks_at is not None and isinstance(event, self.breaks_at):
            raise RuntimeError("ink is out")

    def close(self, results: RunResult) -> None:
        """Note the call, or raise an error."""
        self.closed += 1
        if self.breaks_on_close:
            raise RuntimeError("paper is out")


def run_suites(tmp_path: Path, suites: dict[str, str], *reporters: Reporter, **more: object) -> Outcome:
    """Run several suites, given by name and content; ``more`` has options, and files as ``name__py``."""
    folder = tmp_path / "suite"
    files = {name: text for name, text in more.items() if isinstance(text, str)}
    options = {name: value for name, value in more.items() if name not in files}
    write_files(
        folder, files | {f"{name}.xml": f'<suite name="{name}">{inside}</suite>' for name, inside in suites.items()}
    )
    loaded = load_files([(folder / f"{name}.xml", True) for name in suites], {})
    assert not loaded.has_errors, loaded.diagnostics
    planned = Planner().plan(loaded.suites)
    run_folder = tmp_path / "run"
    run_folder.mkdir()
    broadcast = Broadcast(journal.Journal(run_folder / journal.FILE_NAME), [*reporters])
    code = Run(planned, RunOptions(run_folder=run_folder, handle_signals=False, **options), broadcast).execute()
    events, results = read_back(run_folder)
    return Outcome(int(code), run_folder, events, results)


def open_files() -> int:
    """Return the number of descriptors of this process."""
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def log_of(tmp_path: Path) -> list[str]:
    """Return the notes."""
    return (tmp_path / "suite" / "log").read_text().split()


def spans(outcome: Outcome) -> dict[str, tuple[int, int]]:
    """Return the begin and end of each suite in the order of events."""
    starts = {event.suite: event.seq for event in outcome.of(SuiteStarted)}
    return {event.suite: (starts[event.suite], event.seq) for event in outcome.of(SuiteEnded)}


# Suite workers --------------------------------------------------------------------------------------------------------


def test_suites_that_share_no_fixture_run_at_the_same_time(tmp_path: Path):
    """Two suites that wait for each other end with two suite workers."""
    outcome = run_suites(
        tmp_path,
        {"a": "<test>a.py</test>", "b": "<test>b.py</test>"},
        jobs=2,
        a__py=test_file("note('a'); wait_for('b')"),
        b__py=test_file("note('b'); wait_for('a')"),
    )
    assert outcome.exit_code == ExitCode.PASSED
    (first, last), (begin, end) = spans(outcome).values()
    assert first < end
    assert begin < last


def test_suites_that_share_a_fixture_never_overlap(tmp_path: Path):
    """A fixture is used by one suite at a time, with any number of suite workers."""
    shared = '<fixture name="one">one.py</fixture>'
    outcome = run_suites(
        tmp_path,
        {
            "a": f"{shared}<test>t.py</test><test>t.py</test>",
            "b": f'{shared}<fixture name="two">two.py</fixture><test>t.py</test>',
            "c": '<fixture name="zwei">two.py</fixture><test>t.py</test><test>t.py</test>',
            "d": "<test>t.py</test>",
        },
        jobs=4,
        one__py=rig_file("1"),
        two__py=rig_file("2"),
        t__py=test_file("time.sleep(0.02)"),
    )
    assert outcome.exit_code == ExitCode.PASSED
    at = spans(outcome)
    assert at["a"][1] < at["b"][0]
    assert at["b"][1] < at["c"][0]
    for one in "12":
        words = [word for word in log_of(tmp_path) if word.endswith(one)]
        assert words == [f"up{one}", f"down{one}"] * (len(words) // 2)


@pytest.mark.parametrize(
    ("first", "second", "apart"),
    [
        ('<fixture name="a" param="--word 1">rig</fixture>', '<fixture name="a" param="--word 2">rig</fixture>', True),
        ('<fixture name="a" param="--word 1">rig</fixture>', '<fixture name="b" param="--word 1">rig</fixture>', False),
        ('<fixture name="a">rig</fixture>', '<fixture name="b">rig</fixture>', False),
        ('<fixture name="a">rig</fixture>', '<fixture name="a" param="--word 1">rig</fixture>', False),
        (
            '<fixture name="a"><parameter name="word">1</parameter>rig</fixture>',
            '<fixture name="a"><parameter name="word">2</parameter>rig</fixture>',
            False,
        ),
        ('<fixture name="a">rig</fixture>', '<fixture name="a">Rig</fixture>', False),
        ('<fixture name="a">rig.py</fixture>', '<fixture name="a">../suite/rig</fixture>', False),
        ('<fixture name="a">rig</fixture>', '<fixture name="a">Bench</fixture>', True),
        ('<fixture name="a" param="--x 1">robot</fixture>', '<fixture name="b" param="--x 2">robot</fixture>', False),
        ('<fixture name="a" param="--x 1">robot</fixture>', '<fixture name="b">robotinterface</fixture>', False),
        ('<fixture name="a">robot</fixture>', "<test>JointLimits</test>", False),
        ('<fixture name="a">robot</fixture>', '<fixture name="b" param="--x 1">elsewhere</fixture>', False),
        ("<test>JointLimits</test>", "<test>ControlModes</test>", False),
        ("<test>JointLimits</test>", "<test>PortsFrequency</test>", True),
        ("<test>JointLimits</test>", "<test>derived.py</test>", False),
        ("<test>JointLimits</test>", "<test>odd.py</test>", False),
        ("<test>PortsFrequency</test>", "<test>odd.py</test>", True),
        ('<fixture name="a">rig</fixture><test>JointLimits</test>', "<test>ControlModes</test>", False),
        ('<fixture name="a">rig</fixture><test>JointLimits</test>', '<fixture name="b">robot</fixture>', False),
        ('<fixture name="a">simulator</fixture><test>JointLimits</test>', "<test>JointLimits</test>", True),
        (
            '<fixture name="a" param="--x 1">simulator</fixture><test>JointLimits</test>',
            '<fixture name="a" param="--x 2">simulator</fixture><test>JointLimits</test>',
            True,
        ),
        (
            '<fixture name="a">simulator</fixture><fixture name="b">rig</fixture><test fixtures="b">JointLimits</test>',
            "<test>JointLimits</test>",
            False,
        ),
        ('<fixture name="a">nowhere</fixture>', '<fixture name="a">nowhere</fixture>', False),
        (
            '<fixture name="s" param="--word 1">rig</fixture><fixture name="r" depends="s">Bench</fixture>',
            '<fixture name="s" param="--word 2">rig</fixture><fixture name="r" depends="s">Bench</fixture>',
            False,
        ),
    ],
)
def test_what_may_be_one_rig_is_taken_for_one(tmp_path: Path, first: str, second: str, apart: bool):
    """Fixtures of one plug-in count as one unless each has its own ``param``.

    A test that may move something uses the robot, unless it runs on a simulator.
    """
    rig = "from rtf.testing import FixtureManager\n\nclass Rig(FixtureManager):\n    plugin_name = 'rig'\n"
    suites = {"a.xml": first, "b.xml": second}
    write_files(
        tmp_path / "suite",
        {
            "rig.py": f"{rig}\nclass Bench(FixtureManager):\n    pass\n",
            "t.py": test_file("pass"),
            "elsewhere.py": "from lab import Robot\n\nclass Elsewhere(Robot):\n    pass\n",
            "derived.py": "from joint_limits import JointLimits\n\nclass Derived(JointLimits):\n    pass\n",
            "odd.py": test_file("pass").replace("T(TestCase):", "T(TestCase):\n    safety = 'sti' + 'll'"),
        }
        | {name: f'<suite name="{name}">{inside}<test>t.py</test></suite>' for name, inside in suites.items()},
    )
    loaded = load_files([(tmp_path / "suite" / name, True) for name in suites], {})
    assert len(groups_sharing_fixtures(Planner().plan(loaded.suites))) == (2 if apart else 1)


def test_results_of_many_workers_are_complete_and_in_one_order(tmp_path: Path):
    """Each test of many suite workers ends once, and events are numbered without gaps."""
    suites = {f"s{index}": "<test>t.py</test>" * 5 for index in range(12)}
    before = open_files()
    outcome = run_suites(tmp_path, suites, jobs=3, t__py=test_file("print('x')"))
    assert outcome.exit_code == ExitCode.PASSED
    assert outcome.results.counts() == {Verdict.PASSED: 60}
    assert len({event.test for event in outcome.of(TestEnded)}) == 60
    assert [event.seq for event in outcome.events] == [*range(1, len(outcome.events) + 1)]
    assert all(event.counts == {"passed": 5} for event in outcome.of(SuiteEnded))
    assert open_files() == before, "each suite worker gives its descriptors back"


def test_what_is_not_begun_any_more_costs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """After a stop suite workers start no processes for the remaining suites."""
    started: list[ForkServerClient] = []
    start = ForkServerClient.start
    monkeypatch.setattr(
        ForkServerClient, "start", lambda fork_server: [started.append(fork_server), start(fork_server)]
    )
    suites = {f"s{index}": "<test>t.py</test>" for index in range(12)}
    outcome = run_suites(tmp_path, suites, jobs=2, maxfail=1, t__py=test_file("self.check(False, 'no')"))
    assert outcome.exit_code == ExitCode.FAILURES
    assert len(outcome.of(SuiteEnded)) == len(outcome.results.tests) == 12
    assert {test.verdict for test in outcome.results.tests.values()} == {Verdict.FAILED, Verdict.NOT_RUN}
    assert len(started) <= 4


def test_worker_that_breaks_leaves_the_others_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """An internal error in a suite worker is reported; other suites run, and the exit code is 3."""
    begin = ForkServerClient.take

    def take(
        fork_server: ForkServerClient,
        plugin: PluginRef | None = None,
        fixtures: Mapping[str, int] | None = None,
        limit: float | None = None,
    ) -> Child:
        if plugin is not None and plugin.path.endswith("bad.py"):
            raise ZeroDivisionError("suite worker")
        return begin(fork_server, plugin, fixtures, limit)

    monkeypatch.setattr(ForkServerClient, "take", take)
    outcome = run_suites(
        tmp_path,
        {"a": "<test>bad.py</test><test>bad.py</test>", "b": "<test>t.py</test>"},
        jobs=2,
        bad__py=test_file("pass"),
        t__py=test_file("pass"),
    )
    assert outcome.exit_code == ExitCode.INTERNAL
    (problem,) = outcome.of(InternalError)
    assert problem.text == "ZeroDivisionError: suite worker"
    assert "in take" in problem.traceback
    assert {test.id: test.verdict for test in outcome.results.tests.values()} == {
        "a/bad": Verdict.NOT_RUN,
        "a/bad+2": Verdict.NOT_RUN,
        "b/t": Verdict.PASSED,
    }
    assert isinstance(outcome.events[-1], RunEnded)


# Fixtures of the run -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("second", "ups"),
    [
        ('<fixture name="rig" scope="run">rig.py</fixture>', 1),
        ('<fixture name="rig">rig.py</fixture>', 2),
        ('<fixture name="rig" scope="run" param="--speed 2">rig.py</fixture>', 2),
        ('<fixture name="rig" scope="run">other.py</fixture>', 2),
        ('<fixture name="other" scope="run">rig.py</fixture>', 2),
    ],
)
def test_fixture_of_the_run_stays_up_for_the_very_same_one(second: str, ups: int, tmp_path: Path):
    """A fixture of scope run is kept for a later suite with the same name, plug-in and parameters."""
    outcome = run_suites(
        tmp_path,
        {
            "a": '<fixture name="rig" scope="run">rig.py</fixture><test>t.py</test>',
            "b": f"{second}<test>t.py</test>",
        },
        rig__py=rig_file(),
        other__py=rig_file(),
        t__py=test_file("note('run')"),
    )
    assert outcome.results.counts() == {Verdict.PASSED: 2}
    expected = ["up", "run", "run", "down"] if ups == 1 else ["up", "run", "down", "up", "run", "down"]
    assert log_of(tmp_path) == expected


def test_fixture_of_the_run_is_not_kept_without_the_one_below(tmp_path: Path):
    """A fixture of scope run is torn down with one that it depends on."""

    def fixtures(speed: int) -> str:
        base = f'<fixture name="base" scope="run" param="--speed {speed}">base.py</fixture>'
        return f'{base}<fixture name="top" depends="base" scope="run">top.py</fixture>'

    outcome = run_suites(
        tmp_path,
        {"a": f"{fixtures(1)}<test>t.py</test>", "b": f"{fixtures(2)}<test>t.py</test>"},
        base__py=rig_file("B"),
        top__py=rig_file("T"),
        t__py=test_file("note('run')"),
    )
    assert outcome.exit_code == ExitCode.PASSED
    assert log_of(tmp_path) == ["upB", "upT", "run", "downT", "downB"] * 2
    assert {event.state for event in outcome.of(FixtureChanged)} >= {FixtureState.STOPPED}


# Stopping early, empty runs ------------------------------------------------------------------------------------------


def test_fail_fast_starts_nothing_after_the_first_bad_verdict(tmp_path: Path):
    """After ``maxfail`` failures nothing is started, all others are listed as not run, and the fixture is torn down."""
    outcome = run_suites(
        tmp_path,
        {
            "a": "<fixture>rig.py</fixture><test>good.py</test><test>bad.py</test><test>good.py</test>",
            "b": "<test>good.py</test>",
        },
        maxfail=1,
        good__py=test_file("pass"),
        bad__py=test_file("self.assert_fail('x')"),
        rig__py=rig_file(),
    )
    tests = [*outcome.results.tests.values()]
    assert [test.verdict for test in tests] == [Verdict.PASSED, Verdict.FAILED, Verdict.NOT_RUN, Verdict.NOT_RUN]
    assert tests[2].last is not None
    assert tests[2].last.detail == "1 test failed before (--maxfail)"
    assert log_of(tmp_path) == ["up", "down"]
    assert outcome.exit_code == ExitCode.FAILURES


def test_fail_fast_does_not_mind_good_verdicts(tmp_path: Path):
    """Skipped, flaky and expected failures do not count for ``maxfail``."""
    outcome = run_suites(
        tmp_path,
        {
            "a": '<test>skip.py</test><test retries="1">flaky.py</test>'
            '<test expected="fail" reason="x">bad.py</test><test>t.py</test>'
        },
        maxfail=1,
        skip__py=test_file("self.skip('x')"),
        flaky__py=test_file("note('try'); self.assert_true(LOG.read_text().count('try') > 1, 'x')"),
        bad__py=test_file("self.assert_fail('x')"),
        t__py=test_file("pass"),
    )
    assert [test.verdict for test in outcome.results.tests.values()] == [
        Verdict.SKIPPED,
        Verdict.FLAKY,
        Verdict.EXPECTED_FAILURE,
        Verdict.PASSED,
    ]


@pytest.mark.parametrize(("allow", "code"), [(False, ExitCode.NOTHING_RAN), (True, ExitCode.PASSED)])
def test_empty_run(allow: bool, code: int, tmp_path: Path):
    """A suite without tests is reported, and no success unless that is allowed."""
    outcome = run_suites(tmp_path, {"a": ""}, allow_empty=allow)
    assert outcome.exit_code == code
    assert [event.suite for event in outcome.of(SuiteEnded)] == ["a"]


# Isolation -----------------------------------------------------------------------------------------------------------

STATEFUL = f"""{HEAD}
import builtins
class T(TestCase):
    def run(self):
        builtins.seen = getattr(builtins, "seen", 0) + 1
        print("seen", builtins.seen)
        self.measure("seen", builtins.seen, "count")
        self.measure("pid", os.getpid(), "count")
"""


@pytest.mark.parametrize(("isolation", "processes"), [("test", 3), ("suite", 1)])
def test_isolation(isolation: str, processes: int, tmp_path: Path):
    """Each test, or each suite, has one process; output belongs to the test that wrote it."""
    xml = f'<suite name="s" isolation="{isolation}">{"<test>t.py</test>" * 3}</suite>'
    outcome = run_suite(tmp_path, xml, t__py=STATEFUL)
    assert outcome.results.counts() == {Verdict.MEASURED: 3}
    assert len({event.pid for event in outcome.of(TestStarted)}) == processes
    text = [event.text for event in outcome.events if event.kind == "output_captured"]
    assert text == (["seen 1\n"] * 3 if processes == 3 else ["seen 1\n", "seen 2\n", "seen 3\n"])


def test_shared_process_that_crashes_is_replaced(tmp_path: Path):
    """A crash or hang in a shared process is an error of its test, and the next test has a new process."""
    outcome = run_suite(
        tmp_path,
        '<suite name="s" isolation="suite"><test name="a">t.py</test><test name="crash">crash.py</test>'
        '<test name="b">t.py</test><test name="hang" timeout="0.3">hang.py</test><test name="c">t.py</test></suite>',
        options={"grace": 0.2},
        t__py=STATEFUL,
        crash__py=test_file("os.abort()"),
        hang__py=test_file(
            "\n        while True:\n            try: time.sleep(9)\n            except BaseException: pass"
        ),
    )
    assert [test.verdict for test in outcome.results.tests.values()] == [
        Verdict.MEASURED,
        Verdict.ERROR,
        Verdict.MEASURED,
        Verdict.ERROR,
        Verdict.MEASURED,
    ]
    pids = [event.pid for event in outcome.of(TestStarted)]
    assert pids[0] == pids[1]
    assert pids[2] == pids[3]
    assert len({*pids}) == 3


def test_shared_process_that_was_stopped_is_replaced(tmp_path: Path):
    """A shared process that was stopped is replaced, also if it reacted."""
    outcome = run_suite(
        tmp_path,
        '<suite name="s" isolation="suite"><test name="a">t.py</test><test name="hang" timeout="0.1">hang.py</test>'
        '<test name="b">t.py</test><test name="c">t.py</test></suite>',
        options={"grace": 30},
        t__py=STATEFUL,
        hang__py=test_file("time.sleep(99)"),
    )
    pids = [event.pid for event in outcome.of(TestStarted)]
    assert pids[0] == pids[1]
    assert pids[2] == pids[3]
    assert pids[1] != pids[2]
    assert outcome.verdict("b") is Verdict.MEASURED


def test_test_that_another_process_interrupts_has_not_passed(tmp_path: Path):
    """A test that is interrupted from outside of the runner is an error."""
    body = "self.check(True, '')\n        os.kill(os.getpid(), 2)\n        time.sleep(9)\n        self.check(False, '')"
    outcome = run_suite(tmp_path, '<suite name="s"><test name="t">t.py</test></suite>', t__py=test_file(body))
    assert outcome.verdict("t") is Verdict.ERROR
    assert outcome.detail("t") == "it was told to stop, and not by the runner"
    assert [event.reason for event in outcome.of(TestEnded)] == ["stopped"]


#: Waits in its main thread, while another thread takes the signals: the interpreter learns of them, and is not woken.
UNWAKEABLE = """
        import signal, threading
        threading.Thread(target=signal.pause, daemon=True).start()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        threading.Event().wait()
    def teardown(self):
        note('torn-down')
"""


def test_request_to_stop_that_is_not_noticed_is_followed_up(tmp_path: Path):
    """A test that misses the signal of a stop is woken, and torn down."""
    outcome = run_suite(
        tmp_path,
        '<suite name="s"><test timeout="0.1">deaf.py</test></suite>',
        options={"grace": 30},
        deaf__py=test_file(UNWAKEABLE),
    )
    (test,) = outcome.results.tests.values()
    assert test.attempts[-1].detail == "run() did not end within 0.1 s"
    assert (tmp_path / "suite" / "log").read_text() == "torn-down\n"
    assert test.duration < 15


def test_fixture_that_does_not_notice_that_it_is_to_end_is_woken(tmp_path: Path):
    """A fixture that misses the signal in its setup is woken, and torn down."""
    outcome = run_suite(
        tmp_path,
        '<suite name="s"><fixture timeout="0.3" restarts="0">deaf.py</fixture><test>t.py</test></suite>',
        deaf__py=f"{HEAD}\nclass Rig(FixtureManager):\n    def setup(self):{UNWAKEABLE}",
        t__py=test_file("pass"),
    )
    assert [incident.cause for incident in outcome.of(FixtureIncident)] == ["setup() did not come back within 0.3 s"]
    assert (tmp_path / "suite" / "log").read_text() == "torn-down\n"


CROWDED = """
        import sys, threading
        def deep(depth, over):
            over.wait() if depth == 0 else deep(depth - 1, over)
        over = threading.Event()
        for _ in range(30):
            threading.Thread(target=deep, args=(40, over)).start()
        try:
            threading.Event().wait()
        finally:
            over.set()  # all of them leave their frames at once
    def teardown(self):
        note('torn-down')
"""


@pytest.mark.parametrize("kind", ["test", "fixture"])
def test_stacks_are_written_before_it_is_asked_to_stop(tmp_path: Path, kind: str):
    """Stacks are written before the stop, so that the process is not disturbed meanwhile."""
    suites = {
        "test": '<suite name="s"><test timeout="2">crowd.py</test></suite>',
        "fixture": '<suite name="s"><fixture timeout="2" restarts="0">crowd.py</fixture><test>t.py</test></suite>',
    }
    plugins = {
        "test": test_file(CROWDED),
        "fixture": f"{HEAD}\nclass Rig(FixtureManager):\n    def setup(self):{CROWDED}",
    }
    outcome = run_suite(tmp_path, suites[kind], crowd__py=plugins[kind], t__py=test_file("pass"))
    assert (tmp_path / "suite" / "log").read_text() == "torn-down\n"
    (dumped,) = outcome.of(StackDumped)
    assert dumped.text.count("in deep") == 30 * 41
    assert "Fatal Python error" not in dumped.text


def test_isolation_none_is_the_runners_own_process(tmp_path: Path):
    """With isolation none tests run in the runner's process, with a warning."""
    write_files(
        tmp_path,
        {
            "t.py": test_file("self.measure('parent', os.getppid(), 'count'); note(str(os.getpid()))"),
            "bad.py": test_file("raise SystemExit(0)"),
            "s.xml": '<suite name="s"><test>bad.py</test><test>t.py</test></suite>',
        },
    )
    command = Command(tmp_path, "--suite", "s.xml", "--isolation", "none")
    outcome = command.wait()
    assert [test.verdict for test in outcome.results.tests.values()] == [Verdict.ERROR, Verdict.MEASURED]
    assert (tmp_path / "log").read_text().split() == [str(command.process.pid)]
    assert "takes the run with it" in outcome.stderr


# When a part of RTF breaks --------------------------------------------------------------------------------------------


def test_fork_server_that_cannot_be_had_is_an_error_of_the_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A lost fork server is replaced once; a test without a process is an error, and the others run."""
    begin = ForkServerClient.take
    lost = []

    def take(
        fork_server: ForkServerClient,
        plugin: PluginRef | None = None,
        fixtures: Mapping[str, int] | None = None,
        limit: float | None = None,
    ) -> Child:
        lost.append(1)
        if len(lost) in (1, 2, 3):
            raise ForkServerLostError("no process is to be had")
        return begin(fork_server, plugin, fixtures, limit)

    monkeypatch.setattr(ForkServerClient, "take", take)
    for isolation in ("test", "suite"):
        lost.clear()
        (tmp_path / isolation).mkdir()
        outcome = run_suite(
            tmp_path / isolation,
            f'<suite name="s" isolation="{isolation}"><test name="a">t.py</test><test name="b">t.py</test></suite>',
            t__py=test_file("pass"),
        )
        assert [test.verdict for test in outcome.results.tests.values()] == [Verdict.ERROR, Verdict.PASSED]
        assert len(lost) == 4
        assert outcome.detail("a") == "no process is to be had"
        assert outcome.exit_code == ExitCode.FAILURES


def test_reporter_that_breaks_is_left_out_and_reported(tmp_path: Path):
    """A reporter that raises an error is left out and reported; the exit code is 3."""
    broken, sound = Recorder(breaks_at=TestStarted), Recorder()
    outcome = run_suites(tmp_path, {"a": "<test>t.py</test><test>t.py</test>"}, broken, sound, t__py=test_file("pass"))
    assert outcome.exit_code == ExitCode.INTERNAL
    assert outcome.results.counts() == {Verdict.PASSED: 2}
    (problem,) = outcome.of(InternalError)
    assert problem.text == "reporter recorder broke and is left out: RuntimeError: ink is out"
    assert broken.heard[-1] == "test_started"
    assert (broken.closed, sound.closed) == (0, 1)
    assert sound.heard == [event.kind for event in outcome.events]
    assert sound.order == [event.seq for event in outcome.events] == [*range(1, len(outcome.events) + 1)]
    assert outcome.events[-1].exit_code == ExitCode.INTERNAL


def test_reporter_that_breaks_while_it_finishes(tmp_path: Path):
    """An error in a reporter's close is reported, others finish, and the journal ends with exit code 3."""
    sound, broken, last = Recorder(), Recorder(breaks_on_close=True), Recorder()
    outcome = run_suites(tmp_path, {"a": "<test>t.py</test>"}, sound, broken, last, t__py=test_file("pass"))
    assert outcome.exit_code == ExitCode.INTERNAL
    assert (sound.closed, broken.closed, last.closed) == (1, 1, 1)
    assert sound.heard[-1] == "internal_error"
    ends = [event for event in outcome.events if isinstance(event, RunEnded)]
    assert [event.exit_code for event in ends] == [0, 3]
    assert outcome.events[-1] is ends[-1]


def test_disk_that_is_full_ends_the_journal_and_not_the_run(tmp_path: Path):
    """A full disk ends the journal with whole lines, the tests run, and the exit code is 3."""
    write_files(
        tmp_path,
        {
            "wait.py": test_file("wait_for('go')"),
            "talk.py": test_file("[self.report('x' * 1000) for _ in range(100)]; note('talked')"),
            "s.xml": '<suite name="s"><test>wait.py</test><test>talk.py</test><test>talk.py</test></suite>',
        },
    )
    command = Command(tmp_path, "--suite", "s.xml", "--no-output")
    events = command.wait_for(lambda events: any(isinstance(event, TestStarted) for event in events))
    path = tmp_path / "rtf-runs" / "latest" / journal.FILE_NAME
    resource.prlimit(command.process.pid, resource.RLIMIT_FSIZE, (path.stat().st_size + 20_000, resource.RLIM_INFINITY))
    (tmp_path / "log").write_text("go\n")
    outcome = command.wait()
    assert outcome.exit_code == ExitCode.INTERNAL
    assert "cannot write the journal" in outcome.stdout + outcome.stderr
    assert (tmp_path / "log").read_text().split() == ["go", "talked", "talked"]
    assert "3 passed" in outcome.stdout
    assert len(outcome.events) > len(events)
    assert command.left_over() == []


@pytest.mark.parametrize(
    "arguments", [["--junit", "/proc/none/x.xml"], ["-o", "/proc/none/x.txt"], ["--runs", "/proc/none"]]
)
def test_report_that_can_never_be_written_is_an_error_before_anything_runs(arguments: list[str], tmp_path: Path):
    """A report that cannot be written is an error before the run."""
    write_files(tmp_path, {"t.py": test_file("note('ran')"), "s.xml": "<suite><test>t.py</test></suite>"})
    outcome = run_command(tmp_path, "--suite", "s.xml", *arguments)
    assert outcome.exit_code == ExitCode.USAGE
    assert not (tmp_path / "log").exists()
    assert "Traceback" not in outcome.stderr


def test_grace_of_the_run_is_that_of_its_tests(tmp_path: Path):
    """The grace of the run applies to its tests."""
    seen: list[float] = []

    def interfere(run: Run) -> None:
        seen.append(run.limits_of(run.suites[0], run.suites[0].tests[0]).grace)

    run_suite(tmp_path, "<test>t.py</test>", interfere=interfere, options={"grace": 0.7}, t__py=test_file("pass"))
    assert seen == [0.7]
