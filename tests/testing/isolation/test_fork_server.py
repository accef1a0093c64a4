"""The fork server and its plug-in servers: what tests see of their file, and which files are not shared."""

from __future__ import annotations

import os
import signal
import socket
import threading
from typing import TYPE_CHECKING

import pytest

from harness import Outcome, run_suite
from rtf import clock
from rtf.testing import plugins
from rtf.testing.events import Diagnosed, OutputCaptured, TestEnded, TestStarted
from rtf.testing.isolation import child as child_module
from rtf.testing.isolation import messages
from rtf.testing.isolation.child import Child, End
from rtf.testing.isolation.fork_server import ForkServer, unfit_because
from rtf.testing.isolation.messages import Frames, Job, Preload, Use
from rtf.testing.isolation.reactor import Reactor
from rtf.testing.isolation.worker_pool import ForkServerClient, LoadTimeoutError
from rtf.testing.suite.model import Timeouts
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

THRICE = '<test name="one">it.py</test><test name="two">it.py</test><test name="three">it.py</test>'
NAMES = ("one", "two", "three")

# Each test says which process loaded its file.
WHO_LOADED = """
import os
from rtf.testing import TestCase
LOADED_BY = os.getpid()
class It(TestCase):
    def run(self):
        self.report("in a plug-in server" if LOADED_BY != os.getpid() else "in the test")
"""


def said(outcome: Outcome, name: str) -> str:
    """Return the text of the test's one report."""
    (message,) = [
        event
        for event in outcome.events
        if event.kind == "message" and event.test.endswith(f"/{name}")  # type: ignore[attr-defined]
    ]
    return message.detail  # type: ignore[attr-defined, no-any-return]


class TestPluginServers:
    """A file with several tests is loaded once, without a visible difference."""

    def test_a_file_with_one_test_is_loaded_in_the_test(self, tmp_path: Path):
        """A file with one test is loaded by the test's own process."""
        outcome = run_suite(tmp_path, '<test name="one">it.py</test>', it__py=WHO_LOADED)
        assert said(outcome, "one") == "in the test"

    def test_a_file_with_several_tests_is_loaded_once(self, tmp_path: Path):
        """The tests of a file with several are forked from a process that has loaded it."""
        outcome = run_suite(tmp_path, THRICE, it__py=WHO_LOADED)
        assert {said(outcome, name) for name in NAMES} == {"in a plug-in server"}
        assert len({event.pid for event in outcome.of(TestStarted)}) == 3  # type: ignore[attr-defined]

    def test_each_test_sees_the_file_as_it_was_right_after_loading(self, tmp_path: Path):
        """Changes that a test makes to module, class or environment do not reach other tests."""
        code = """
import os
from rtf.testing import TestCase
seen = []
class It(TestCase):
    count = 0
    def run(self):
        seen.append(1)
        It.count += 1
        os.environ["SEEN"] = os.environ.get("SEEN", "") + "x"
        self.assert_equal((seen, It.count, os.environ["SEEN"]), ([1], 1, "x"), "what is seen")
"""
        outcome = run_suite(tmp_path, THRICE, it__py=code)
        assert [outcome.verdict(name) for name in NAMES] == [Verdict.PASSED] * 3

    def test_the_classes_of_one_file_share_a_plugin_server(self, tmp_path: Path):
        """Tests of different classes of a file share a plug-in server, and get their class."""
        code = WHO_LOADED + "\nclass Other(It):\n    def run(self):\n        self.report(f'Other, {LOADED_BY}')\n"
        xml = '<test name="one">It</test><test name="two">Other</test><test name="three">Other</test>'
        outcome = run_suite(tmp_path, xml, it__py=code)
        assert said(outcome, "one") == "in a plug-in server"
        assert said(outcome, "two") == said(outcome, "three")
        assert said(outcome, "two").startswith("Other, ")

    @pytest.mark.parametrize(
        "line",
        [
            "import threading; threading.Thread(target=threading.Event().wait, daemon=True).start()",
            "import subprocess; sleeper = subprocess.Popen(['sleep', '1000'])",
            "stream = open(__file__)",
            "import mmap; shared = mmap.mmap(-1, 4096)",
            "import signal; signal.setitimer(signal.ITIMER_REAL, 1000)",
            "print('hello')",
        ],
        ids=["thread", "process", "file", "memory", "timer", "output"],
    )
    def test_a_file_that_leaves_something_behind_is_loaded_in_each_test(self, tmp_path: Path, line: str):
        """A file whose loading leaves threads, processes or such is loaded by each test."""
        outcome = run_suite(tmp_path, THRICE, it__py=f"{WHO_LOADED}\n{line}\n")
        assert {said(outcome, name) for name in NAMES} == {"in the test"}

    def test_the_output_of_loading_is_in_each_test(self, tmp_path: Path):
        """Output of loading is captured for each test."""
        outcome = run_suite(tmp_path, THRICE, it__py=f"print('hello')\n{WHO_LOADED}")
        texts = [(event.test, event.text) for event in outcome.of(OutputCaptured)]  # type: ignore[attr-defined]
        assert texts == [(f"s/{name}", "hello\n") for name in NAMES]

    @pytest.mark.parametrize(
        ("line", "detail"),
        [
            ("raise KeyError('x')", "KeyError: 'x'"),
            ("import sys; sys.exit(0)", "SystemExit(0)"),
            ("import os; os._exit(3)", "exit status 3 while loading"),
            ("import os; os.kill(os.getpid(), 9)", "killed by SIGKILL while loading"),
            ("class Broken:", "expected an indented block"),
        ],
        ids=["raises", "exits", "exits at once", "dies", "is no Python"],
    )
    def test_a_file_that_cannot_be_loaded_is_an_error_of_each_test(self, tmp_path: Path, line: str, detail: str):
        """A file that cannot be loaded is an error of each of its tests."""
        outcome = run_suite(tmp_path, THRICE, it__py=f"{WHO_LOADED}\n{line}\n")
        assert [outcome.verdict(name) for name in NAMES] == [Verdict.ERROR] * 3
        assert all(detail in outcome.detail(name) for name in NAMES)

    def test_a_plugin_server_that_is_killed_takes_one_test_with_it(self, tmp_path: Path):
        """A killed plug-in server costs one test; later ones load the file themselves."""
        code = WHO_LOADED + "        if LOADED_BY != os.getpid():\n            os.kill(os.getppid(), 9)\n"
        outcome = run_suite(tmp_path, THRICE, it__py=code)
        assert outcome.verdict("one") is Verdict.ERROR
        assert "the process from which tests are forked was lost" in outcome.detail("one")
        assert [said(outcome, name) for name in NAMES[1:]] == ["in the test"] * 2

    def test_a_plugin_server_that_is_stopped_goes_on(self, tmp_path: Path):
        """Tests after one that stopped its plug-in server run."""
        code = f"{WHO_LOADED}        if self.folder.name == 'one':\n            os.kill(os.getppid(), 19)\n"
        outcome = run_suite(tmp_path, THRICE, options={"limits": Timeouts(total=1.0)}, it__py=code)
        assert [outcome.verdict(name) for name in NAMES[1:]] == [Verdict.PASSED] * 2

    def test_all_output_of_a_test_is_reported(self, tmp_path: Path):
        """Output that is still in a pipe when the test ends is captured."""
        code = """
import fcntl, os
from rtf.testing import TestCase
class It(TestCase):
    def run(self):
        fcntl.fcntl(1, fcntl.F_SETPIPE_SZ, 1 << 20)
        os.write(1, b"x" * 600_000 + b"the end\\n")
"""
        outcome = run_suite(tmp_path, '<test name="one">it.py</test>', it__py=code)
        assert "".join(event.text for event in outcome.of(OutputCaptured)).endswith("the end\n")  # type: ignore[attr-defined]

    def test_what_a_test_leaves_behind_is_gone_before_the_next_begins(self, tmp_path: Path):
        """Processes that a test leaves are ended before the next test begins."""
        code = """
import os, pathlib, subprocess
from rtf.testing import TestCase
class It(TestCase):
    def run(self):
        left = pathlib.Path(__file__).with_name("left")
        if left.exists():
            self.check(not pathlib.Path("/proc", left.read_text()).exists(), "it is gone")
        left.write_text(str(subprocess.Popen(["sleep", "1000"], start_new_session=True).pid))
"""
        outcome = run_suite(tmp_path, THRICE, it__py=code)
        assert [outcome.verdict(name) for name in NAMES] == [Verdict.PASSED] * 3
        last = (tmp_path / "suite" / "left").read_text()
        assert not os.path.exists(f"/proc/{last}")  # noqa: PTH110 - a process, not a file

    def test_used_resources_are_reported(self, tmp_path: Path):
        """Processor time and memory in the result are those of the test."""
        code = WHO_LOADED + "        data = bytearray(64 << 20)\n        sum(range(1 << 20))\n"
        outcome = run_suite(tmp_path, THRICE, it__py=code)
        for event in outcome.of(TestEnded):
            assert event.max_rss > 64 << 20  # type: ignore[attr-defined]
            assert 0 < event.cpu_time < 10  # type: ignore[attr-defined]


LOADED_BEFORE = """
import sys
before = "rtf.robot_testing" in sys.modules
from rtf.testing import TestCase
LINE
class It(TestCase):
    def run(self):
        self.report(str(before))
"""


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("from rtf.robot_testing import RobotTest", "True"),
        ("import rtf.robot_testing", "True"),
        ("import json", "False"),
        ("if not before: from rtf.robot_testing import RobotTest", "False"),
    ],
)
def test_modules_of_the_library_are_loaded_once_for_all_files(tmp_path: Path, line: str, found: str):
    """What any file of the suite imports from the library at its top is in memory before each of them is loaded."""
    importing = LOADED_BEFORE.replace("LINE", line)
    xml = '<test name="one">it.py</test><test name="other">other.py</test>'
    outcome = run_suite(tmp_path, xml, it__py=importing, other__py=LOADED_BEFORE.replace("LINE", ""))
    assert [said(outcome, name) for name in ("one", "other")] == [found, found]


def test_a_module_that_the_library_has_not_is_an_error_of_its_test_only(tmp_path: Path):
    """The run does not look for it on its own."""
    code = LOADED_BEFORE.replace("LINE", "from rtf.nowhere import Something")
    outcome = run_suite(tmp_path, '<test name="one">it.py</test>', it__py=code)
    assert "No module named 'rtf.nowhere'" in outcome.detail("one")
    assert not outcome.of(Diagnosed)


def test_every_change_is_named():
    """The reason against a plug-in server names everything that loading left."""
    before: dict[str, list[str]] = {"threads": ["1"], "open files": ["0"], "timers": []}
    assert unfit_because(before, before) == ""
    after = {**before, "threads": ["1", "2"], "timers": ["3"]}
    assert unfit_because(before, after) == "loading it left threads, timers"


FILES = ("a", "b", "c", "d", "e")


@pytest.fixture
def fork_server(tmp_path: Path) -> Iterator[ForkServerClient]:
    """A fork server with five files, of which several tests are planned each."""
    for name in FILES:
        (tmp_path / f"{name}.py").write_text(WHO_LOADED)
    made = ForkServerClient(uses={found(tmp_path, name).path: 3 for name in FILES})
    made.start()
    yield made
    made.close()


def found(folder: Path, name: str) -> plugins.PluginRef:
    """Return the plug-in of one of the files."""
    return plugins.find("test", f"{name}.py", beside=folder)


def parent_of(child: Child) -> int:
    """Return the process that forked a child."""
    with open(f"/proc/{child.pid}/stat", encoding="utf-8") as stream:  # noqa: PTH123
        return int(stream.read().rpartition(")")[2].split()[1])


def test_a_plugin_server_holds_as_long_as_the_fixtures_it_was_loaded_on(fork_server: ForkServerClient, tmp_path: Path):
    """A restart of a fixture replaces the plug-in server, because the file may know the old generation."""
    ref = found(tmp_path, "a")
    first = fork_server.take(ref, {"simulator": 1})
    plugin_server = parent_of(first)
    assert parent_of(fork_server.take(ref, {"simulator": 1})) == plugin_server
    assert parent_of(fork_server.take(ref, {"simulator": 2})) != plugin_server
    assert first.end is not None  # it went with its plug-in server


def test_only_so_many_plugin_servers_are_kept(fork_server: ForkServerClient, tmp_path: Path):
    """At most four plug-in servers exist; tests of further files load them."""
    children = [fork_server.take(found(tmp_path, name)) for name in FILES]
    root = parent_of(fork_server.take())
    assert [parent_of(child) == root for child in children] == [False] * 4 + [True]


def test_a_plugin_server_whose_tests_are_over_makes_room(fork_server: ForkServerClient, tmp_path: Path):
    """A plug-in server without remaining tests is replaced by that of another file."""
    for _ in range(3):
        fork_server.take(found(tmp_path, "a")).dismiss()
    children = [fork_server.take(found(tmp_path, name)) for name in FILES[1:]]
    root = parent_of(fork_server.take())
    assert all(parent_of(child) != root for child in children)


def test_loading_that_does_not_end_is_given_up_once(fork_server: ForkServerClient, tmp_path: Path):
    """Loading ends at the limit of the first test, and later tests load the file themselves."""
    (tmp_path / "a.py").write_text("import time\nwhile True:\n    time.sleep(1)\n")
    fork_server.take()  # now it is up
    with pytest.raises(LoadTimeoutError, match=r"^loading did not end within 1 s$") as caught:
        fork_server.take(found(tmp_path, "a"), {}, 1.0)
    assert "a.py" in caught.value.stacks
    child = fork_server.take(found(tmp_path, "a"))
    assert parent_of(child) == parent_of(fork_server.take())


def test_modules_may_be_loaded_for_a_runner_that_is_gone():
    """One that had nothing to run, as when a run is resumed, does not wait for them."""
    ours, theirs = socket.socketpair()
    with ours:
        server = ForkServer(ours)
        theirs.close()
        server._carry_out(Preload(("string",)))
        os.close(server._children)


def test_a_job_arrives_as_it_was_sent():
    """A job is the same after encoding and decoding."""
    ref = plugins.PluginRef("test", "näme", "/x/y.py", "python", "It")
    job = Job(
        kind="test",
        id="s/t",
        name="t\n\0",
        plugin=ref,
        folder="/f",
        run_folder="/r",
        use=Use(parameters=(("a", "1"), ("b", "")), overrides=(("c", "(1 2)"),)),
        memory=1 << 40,
        can_ask=True,
        check_period=0.25,
        last=False,
    )
    data = messages.pack(job)
    frames = Frames()
    halves = [*frames.feed(data[:9]), *frames.feed(data[9:])]
    assert [messages.to_child(frame) for frame in halves] == [job]
    assert isinstance(messages.to_child(halves[0]).plugin, plugins.PluginRef)  # type: ignore[union-attr]


def test_a_fork_server_that_was_killed_is_replaced(fork_server: ForkServerClient):
    """After a kill of the fork server its children count as ended, and the next child has a new one."""
    child = fork_server.take()
    os.kill(parent_of(child), signal.SIGKILL)
    deadline = clock.Deadline.after(10)
    while child.end is None and not deadline.expired:
        fork_server.reactor.run_once(deadline)
    assert child.end is not None
    assert child.end.status is None
    assert fork_server.take().pid != child.pid


def test_a_child_that_is_ended_twice_takes_nothing_with_it(
    fork_server: ForkServerClient, monkeypatch: pytest.MonkeyPatch
):
    """Ending a child that is gone has no effect on the fork server."""
    child, other = fork_server.take(), fork_server.take()
    child.dismiss()
    monkeypatch.setattr(child_module, "_VANISH", 0.01)
    child.dismiss()
    child.interrupt(signal.SIGTERM)
    for _ in range(3):
        fork_server.reactor.run_once(clock.Deadline.after(0.05))
    assert other.end is None
    assert parent_of(fork_server.take()) == parent_of(other)


def test_a_fork_server_that_does_not_end_a_killed_child_is_replaced(
    fork_server: ForkServerClient, monkeypatch: pytest.MonkeyPatch
):
    """A fork server that does not reap a killed child in time is replaced."""
    monkeypatch.setattr(child_module, "_VANISH", 0.05)
    child = fork_server.take()
    monkeypatch.setattr(fork_server, "rouse", lambda: None)
    first = parent_of(child)
    os.kill(first, signal.SIGSTOP)
    child.dismiss()
    assert child.end is not None
    assert parent_of(fork_server.take()) != first


class Alone:
    """A pool in which nothing is forked."""

    def __init__(self) -> None:
        self.reactor = Reactor()

    def request(self, message: object, *descriptors: int) -> None: ...

    def rouse(self) -> None: ...

    def abandon(self) -> None: ...


def test_an_answer_goes_to_its_test_or_nowhere(monkeypatch: pytest.MonkeyPatch):
    """The channel is not closed while another thread writes, as the next file to be opened would get its number."""
    child = Child(Alone())
    ending, write = threading.Thread(target=child.ended, args=(End(0),)), os.write
    was_closed: list[bool] = []

    def ended_meanwhile(descriptor: int, data: memoryview) -> int:
        ending.start()
        ending.join(0.3)  # unless it waits for the write
        was_closed.append(child.channel_closed)
        return write(descriptor, data)

    monkeypatch.setattr(os, "write", ended_meanwhile)
    child.send(messages.Answer("q", "yes", "web"))
    monkeypatch.undo()
    ending.join()
    assert was_closed == [False]
    child.send(messages.Answer("q", "yes", "web"))
    child._reactor.close()


def test_a_wait_without_an_end_is_made_of_short_ones():
    """A signal that comes just before one is looked at after it."""
    reactor = Reactor()
    waiting = threading.Thread(target=reactor.run_once, args=(clock.Deadline(),), daemon=True)
    waiting.start()
    waiting.join(2.0)
    assert not waiting.is_alive()
    reactor.close()
