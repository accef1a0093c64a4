"""Interrupts at any moment: fixtures are torn down, the journal is closed, and no process is left."""

from __future__ import annotations

import signal

import pytest

from rtf.testing.verdict import Verdict

SUITE = '<fixture name="robot"> Robot </fixture><test name="slow"> Hangs </test><test name="next"> Fine </test>'


def running(lab):
    """Return a function that tells whether the endless test has begun."""
    return (lab.folder / "running").exists


def test_interrupt_stops_the_test_and_takes_everything_down(lab):
    """An interrupt stops the test with its teardown, tears the fixture down, and closes the journal."""
    session = lab.start(lab.suite(SUITE))
    session.wait_until(running(lab))
    session.interrupt()
    finished = session.wait()
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert "KeyboardInterrupt" in finished.out
    assert {test.name: test.verdict for test in finished.results.tests.values()} == {
        "slow": Verdict.INTERRUPTED,
        "next": Verdict.NOT_RUN,
    }
    assert (lab.folder / "torn-down").exists()
    assert lab.log == ["up", "down"]
    assert finished.events[-1].kind == "run_ended"
    assert not session.left_over()


STUBBORN = """
import threading
from pathlib import Path
from rtf.testing import TestCase

class Stubborn(TestCase):
    def run(self):
        Path("running").touch()
        while True:
            try:
                threading.Event().wait()
            except BaseException:
                Path("asked").touch()
"""


def test_second_interrupt_kills_what_does_not_react(lab):
    """A second interrupt kills a test that does not react, and the fixture is torn down."""
    lab.write(stubborn__py=STUBBORN)
    session = lab.start(lab.suite('<fixture name="robot"> Robot </fixture><test name="s"> stubborn.py </test>'))
    session.wait_until(running(lab))
    session.interrupt()
    session.wait_until((lab.folder / "asked").exists)
    session.interrupt()
    finished = session.wait()
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert finished.results.tests["s/s"].verdict is Verdict.INTERRUPTED
    assert finished.results.interrupted.stage == 3
    assert lab.log == ["up", "down"]
    assert not session.left_over()


def test_interrupt_while_a_fixture_comes_up(lab):
    """An interrupted setup is torn down, and no test begins."""
    begin = "import threading\nfrom pathlib import Path\nfrom rtf.testing import FixtureManager\n"
    lab.write(
        slow__py=f"{begin}class Slow(FixtureManager):\n"
        "    def setup(self):\n        Path('running').touch()\n        threading.Event().wait()\n"
        "    def teardown(self):\n        Path('torn-down').touch()\n"
    )
    session = lab.start(lab.suite('<fixture name="slow"> slow.py </fixture><test name="a"> Fine </test>'))
    session.wait_until(running(lab))
    session.interrupt()
    finished = session.wait()
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert finished.results.tests["s/a"].verdict is Verdict.NOT_RUN
    assert (lab.folder / "torn-down").exists()
    assert not session.left_over()


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGKILL], ids=lambda signum: signum.name)
def test_nothing_is_left_of_a_session_that_was_killed(lab, signum):
    """After a kill of the session the fixture is torn down, and every process ends."""
    session = lab.start(lab.suite(SUITE))
    session.wait_until(running(lab))
    session.interrupt(signum)
    finished = session.wait()
    assert finished.exit_code == -signum
    assert not session.left_over()
    assert lab.log == ["up", "down"]


def test_interrupt_between_tests_takes_everything_down(lab):
    """An interrupt between tests tears the fixtures down."""
    lab.write(
        conftest__py=(
            "import pytest\n"
            "def pytest_runtest_logstart(nodeid):\n"
            "    if nodeid.endswith('::b'): raise KeyboardInterrupt\n"
        )
    )
    suite = lab.suite('<fixture name="robot"> Robot </fixture><test name="a"> Fine </test><test name="b"> Fine </test>')
    session = lab.start(suite)
    finished = session.wait()
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert lab.log == ["up", "down"]
    assert finished.results.tests["s/a"].verdict is Verdict.PASSED
    assert finished.results.tests["s/b"].verdict is Verdict.NOT_RUN
    assert not session.left_over()


def test_interrupt_reaches_the_workers(lab):
    """With pytest-xdist an interrupt tears down the workers' fixtures."""
    lab.write(conftest__py="from xdist.workermanage import NodeManager\nNodeManager.EXIT_TIMEOUT = 2\n")  # 10 otherwise
    session = lab.start(lab.suite(SUITE), "-p", "xdist", "-n", "2")
    session.wait_until(running(lab))
    session.interrupt()
    finished = session.wait()
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert not session.left_over()
    assert lab.log == ["up", "down"] * (len(lab.log) // 2)
