"""A suite's fixtures in pytest's reports."""

from __future__ import annotations

from rtf.testing.verdict import Verdict

FINE = '<test name="a"> Fine </test><test name="b"> Fine </test>'


def test_fixture_that_does_not_come_up_is_an_error_of_the_setup(lab):
    """A failed fixture is an error in the setup of its tests; others run."""
    lab.write(
        broken__py="from rtf.testing import FixtureManager\nclass Broken(FixtureManager):\n    def setup(self): 1 / 0\n"
    )
    lab.suite(f'<fixture name="bench" restarts="0"> broken.py </fixture>{FINE}<test name="c" fixtures=""> Fine </test>')
    finished = lab.run("s.xml")
    assert finished.last_line.startswith("1 passed, 2 errors")
    assert finished.line("ERROR s.xml::a").startswith("ERROR s.xml::a - blocked: fixture bench is not usable: ")
    assert "ZeroDivisionError: division by zero" in finished.out
    assert finished.results.tests["s/b"].verdict is Verdict.BLOCKED


DIES_ONCE = """
import threading
from pathlib import Path
from rtf.testing import TestCase

class Killer(TestCase):
    def run(self):
        if not Path("killed").exists():
            Path("killed").touch()
            Path("robot-dies").touch()
            threading.Event().wait()
"""


def test_collapse_is_repaired_and_reported(lab):
    """After a collapse the test is run again, with a warning, a section and a property."""
    lab.write(killer__py=DIES_ONCE)
    lab.suite('<fixture name="robot" backoff="0" check-period="0.1"> Robot </fixture><test name="k"> killer.py </test>')
    finished = lab.run("s.xml", "-rA", "--junit-xml=junit.xml")
    assert finished.last_line.startswith("1 passed, 1 warning")
    assert "FixtureWarning: robot #1 in check: " in finished.out
    assert "Captured fixture incidents call" in finished.out
    assert lab.log == ["up", "down", "up", "down"]
    properties = {item.get("name"): item.get("value") for item in finished.cases()["k"].iter("property")}
    assert properties["rtf:incident"].startswith("robot #1 in check: ")


def test_teardown_that_goes_wrong_is_an_error_of_the_last_test(lab):
    """A failed teardown of a fixture is an error of the last test, without internal frames."""
    begin = "from rtf.testing import FixtureManager\nclass Stuck(FixtureManager):\n"
    lab.write(stuck__py=f"{begin}    def teardown(self): raise OSError('brake')\n")
    finished = lab.run(lab.suite(f'<fixture name="stuck"> stuck.py </fixture>{FINE}'))
    assert finished.last_line.startswith("2 passed, 1 error")
    assert finished.line("ERROR").startswith("ERROR s.xml::b - ")
    assert "stuck #1 in teardown: teardown() raised OSError: brake" in finished.out
    assert "pytest_suites" not in finished.out


def test_fixture_is_watched_while_pytest_is_busy(lab):
    """A collapse between two tests is noticed at once."""
    lab.write(
        conftest__py=(
            "import time, pathlib\n"
            "def pytest_runtest_logstart(nodeid):\n"
            "    if nodeid.endswith('::b'):\n"
            "        pathlib.Path('robot-dies').touch()\n"
            "        end = time.monotonic() + 20\n"
            "        record = pathlib.Path('rtf-runs/latest/journal.jsonl')\n"
            "        while 'fixture_incident' not in record.read_text():\n"
            "            assert time.monotonic() < end\n"
            "            time.sleep(0.01)\n"
        )
    )
    lab.suite(f'<fixture name="robot" backoff="0" check-period="0.1"> Robot </fixture>{FINE}')
    finished = lab.run("s.xml")
    assert finished.last_line.startswith("2 passed, 1 warning"), finished.out
    assert lab.log == ["up", "down", "up", "down"]
