"""Fixtures add to what is known of a test that did not pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness import run_suite
from rtf.testing.events import Attached, FixtureIncident, Message, TestEnded
from rtf.testing.fixture import FixtureManager
from rtf.testing.supervision.fixture_host import Host
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from pathlib import Path

PLUGINS = '''
from rtf.testing import FixtureManager, TestCase

class Knows(FixtureManager):
    """Knows something of every test."""
    def on_test_failure(self, failed):
        text = f"{failed.test} {0 < failed.ended - failed.began < 60}"
        self.attach(text.encode(), "known.txt")
        self.attach(__file__)

class Stumbles(FixtureManager):
    """Fails to say what it knows."""
    def on_test_failure(self, failed):
        raise LookupError("it is lost")

class Silent(FixtureManager):
    """Has nothing to say."""

class Passes(TestCase):
    def run(self): pass

class Fails(TestCase):
    def run(self): self.check(False, "no")
'''
XML = (
    "<fixture>Silent</fixture><fixture>Stumbles</fixture>"
    "<fixture depends='Silent Stumbles'>Knows</fixture>"
    "<test>Passes</test><test retries='1'>Fails</test>"
)


def test_each_attempt_that_fails_is_explained(tmp_path: Path):
    """A fixture attaches files to each attempt that failed, in its folder; an error of its own is a message."""
    outcome = run_suite(tmp_path, XML, plugins__py=PLUGINS)
    assert [event.verdict for event in outcome.of(TestEnded)] == [Verdict.PASSED, Verdict.FAILED, Verdict.FAILED]
    found = outcome.of(Attached)
    test = outcome.of(TestEnded)[-1].test
    assert [(event.fixture, event.test, event.name) for event in found] == [
        ("Knows", test, "known.txt"),
        ("Knows", test, "plugins.py"),
    ] * 2
    assert [(outcome.folder / event.path).read_text() for event in found[::2]] == [f"{test} True"] * 2
    assert ".attempt2/" in found[2].path
    said = [event.detail for event in outcome.of(Message) if event.fixture == "Stumbles"]
    assert said == ["on_test_failure() raised LookupError: it is lost"] * 2
    assert {event.severity for event in outcome.of(Message) if event.fixture == "Stumbles"} == {Severity.ERROR}
    assert outcome.of(FixtureIncident) == []


def test_only_a_test_that_failed_gets_files():
    """A fixture cannot attach a file to nothing."""
    manager = FixtureManager()
    host = Host.__new__(Host)
    host._failed = None
    manager.attach_to(host, "")
    with pytest.raises(RuntimeError, match=r"in on_test_failure\(\)"):
        manager.attach(b"", "a.txt")
