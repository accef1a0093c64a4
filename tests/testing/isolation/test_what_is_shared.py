"""What tests of one file share with each other and with the runner's process: nothing visible."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from harness import run_suite
from rtf import clock
from rtf.testing.events import Measured, Message, StackDumped, TestEnded, TestStarted
from rtf.testing.isolation import processes
from rtf.testing.isolation.worker_pool import ForkServerClient
from rtf.testing.suite.model import Timeouts
from rtf.testing.verdict import Severity, Verdict

TWICE = '<test name="one">it.py</test><test name="two">it.py</test>'


class TestLoading:
    """Loading of a file with several tests."""

    def test_slow_loading_is_done_once(self, tmp_path: Path):
        """A file that takes long to load is loaded once for all its tests."""
        code = """
import pathlib, time
with pathlib.Path(__file__).with_name("loads").open("a") as loads:
    loads.write("x")
time.sleep(0.5)
from rtf.testing import TestCase
class It(TestCase):
    def run(self): self.check(True, "")
"""
        outcome = run_suite(tmp_path, TWICE, it__py=code, options={"limits": Timeouts(setup=20.0)})
        assert [outcome.verdict(name) for name in ("one", "two")] == [Verdict.PASSED] * 2
        assert next(tmp_path.rglob("loads")).read_text() == "x"

    def test_loading_that_takes_too_long_is_a_time_out_of_the_test(self, tmp_path: Path):
        """Loading beyond the setup limit is a time-out of each test, with stacks."""
        code = 'import pathlib, time\nwith pathlib.Path(__file__).with_name("loads").open("a") as loads:\n'
        code += '    loads.write("x")\ntime.sleep(60)\nfrom rtf.testing import TestCase\nclass It(TestCase): pass\n'
        began = clock.monotonic()
        outcome = run_suite(tmp_path, TWICE, it__py=code, options={"limits": Timeouts(setup=1.0), "grace": 0.3})
        assert [outcome.verdict(name) for name in ("one", "two")] == [Verdict.ERROR] * 2
        assert all("loading did not end within 1 s" in outcome.detail(name) for name in ("one", "two"))
        assert next(tmp_path.rglob("loads")).read_text() == "xx"
        assert all("it.py" in event.text for event in outcome.of(StackDumped))  # type: ignore[attr-defined]
        assert clock.monotonic() - began < 30


DRAWS = """
import numpy, random, os
SEED
from rtf.testing import TestCase
class It(TestCase):
    def run(self):
        self.measure("numpy", float(numpy.random.random()))
        self.measure("python", random.random())
        self.check("OPENBLAS_NUM_THREADS" not in os.environ, "the environment is the user's")
"""


def drawn(tmp_path: Path, seed: str, name: str) -> list[float]:
    """Return the first random numbers of the tests of one file."""
    tmp_path.mkdir()
    outcome = run_suite(tmp_path, TWICE, it__py=DRAWS.replace("SEED", seed))
    assert [outcome.verdict(test) for test in ("one", "two")] == [Verdict.PASSED] * 2
    return [event.value for event in outcome.of(Measured) if event.name == name]  # type: ignore[attr-defined]


class TestRandomNumbers:
    """The random numbers of each test."""

    @pytest.fixture(autouse=True)
    def _as_the_user_has_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)

    def test_are_drawn_anew_in_each_test(self, tmp_path: Path):
        """Python's and numpy's generators are seeded anew in each test."""
        for name in ("numpy", "python"):
            one, two = drawn(tmp_path / name, "", name)
            assert one != two

    def test_are_those_of_a_seed_that_the_file_has_chosen(self, tmp_path: Path):
        """A seed that the file sets holds for each of its tests."""
        assert len(set(drawn(tmp_path / "numpy", "numpy.random.seed(7)", "numpy"))) == 1
        assert len(set(drawn(tmp_path / "python", "random.seed(7)", "python"))) == 1


@pytest.mark.parametrize("context", ["fork", "spawn"])
@pytest.mark.parametrize("xml", [TWICE, '<test name="one">it.py</test>'], ids=["shared", "alone"])
def test_objects_and_functions_of_a_test_file_can_be_pickled(tmp_path: Path, context: str, xml: str):
    """Objects of a test file can be pickled, also for processes that the test starts."""
    code = f"""
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from rtf.testing import TestCase
class Point:
    def __init__(self, x): self.x = x
def double(point): return Point(2 * point.x)
class It(TestCase):
    def run(self):
        with ProcessPoolExecutor(1, multiprocessing.get_context({context!r})) as pool:
            self.assert_equal(pool.submit(double, Point(21)).result(20).x, 42, "what comes back")
        self.assert_equal(__name__, "rtf_plugins.test.it", "the name")
"""
    outcome = run_suite(tmp_path, xml, it__py=code)
    assert (outcome.verdict("one"), outcome.detail("one")) == (Verdict.PASSED, "")


def test_thread_of_an_earlier_test_is_not_the_fault_of_the_next(tmp_path: Path):
    """In a shared process, a message of a thread belongs to the test that started it."""
    code = """
import threading
from rtf.testing import TestCase
go, done = threading.Event(), threading.Event()
class Leaver(TestCase):
    def run(self):
        self.check(True, "")
        def late():
            go.wait(20)
            self.check(False, "too late")
            done.set()
        import builtins
        builtins.late = (go, done)
        threading.Thread(target=late, daemon=True).start()
class Next(TestCase):
    def run(self):
        import builtins
        go, done = builtins.late
        go.set()
        self.check(done.wait(20), "it has spoken")
"""
    xml = '<test name="one" isolation="suite">Leaver</test><test name="two" isolation="suite">Next</test>'
    outcome = run_suite(tmp_path, xml, it__py=code)
    assert [outcome.verdict(name) for name in ("one", "two")] == [Verdict.PASSED] * 2
    (warning,) = outcome.of(Message, title="late")
    assert (warning.test, warning.severity) == ("s/one", Severity.WARNING)  # type: ignore[attr-defined]
    assert "too late" in warning.detail  # type: ignore[attr-defined]


def is_subreaper() -> bool:
    """Return whether orphans become children of this process."""
    import ctypes

    answer = ctypes.c_int()
    ctypes.CDLL(None).prctl(37, ctypes.byref(answer), 0, 0, 0)  # PR_GET_CHILD_SUBREAPER
    return bool(answer.value)


def test_process_that_runs_tests_is_not_changed(tmp_path: Path):
    """The runner's process adopts no orphans and keeps no children, which matters to hosts such as pytest."""
    before = processes.children_of(os.getpid())
    code = """
import os, subprocess
from rtf.testing import TestCase
class It(TestCase):
    def run(self):
        subprocess.Popen(["sleep", "1000"], start_new_session=True)
        parent = os.getppid()
        os.kill(parent, 9)
"""
    outcome = run_suite(tmp_path, '<test name="one">it.py</test>', it__py=code)
    assert outcome.verdict("one") is Verdict.ERROR
    assert len(outcome.of(TestStarted)) == len(outcome.of(TestEnded)) == 1
    assert not is_subreaper()
    assert processes.children_of(os.getpid()) == before


def test_lost_fork_servers_leave_no_zombies():
    """Lost fork servers and their children leave no zombies."""
    client = ForkServerClient()
    before = processes.children_of(os.getpid())
    for _ in range(5):
        children = [client.take() for _ in range(3)]
        parent = int(Path(f"/proc/{children[0].pid}/stat").read_text().rpartition(")")[2].split()[1])
        os.kill(parent, signal.SIGKILL)
        deadline = clock.Deadline.after(10.0)
        while children[0].end is None and not deadline.expired:
            client.reactor.run_once(deadline)
        assert all(child.end is not None and child.end.status is None for child in children)
        assert processes.children_of(os.getpid()) == before
    client.close()
