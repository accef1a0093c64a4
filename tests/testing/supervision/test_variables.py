"""Environment variables that fixtures provide for those who stand on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness import run_suite
from rtf.testing.events import FixtureIncident, Message, OutputCaptured
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

FIXTURES = """
import os
from rtf.testing import FixtureManager, Parameter
class Server(FixtureManager):
    plugin_name = "server"
    def setup(self):
        self.provide(WHERE=f"here {self.generation}", SECRET="a = b; $HOME")
class Client(FixtureManager):
    plugin_name = "client"
    def setup(self):
        self.report("a fixture sees " + os.environ.get("WHERE", "nothing"))
class Odd(FixtureManager):
    plugin_name = "odd"
    def setup(self):
        self.provide(**{"a b": "x"})
"""
TEST = """
import os
from rtf.testing import TestCase
class Look(TestCase):
    def run(self):
        self.report(f"a test sees {os.environ.get('WHERE')} {os.environ.get('SECRET')}")
"""


def said(outcome: object) -> list[str]:
    """What tests and fixtures reported."""
    return [event.detail for event in outcome.of(Message) if "sees" in event.detail]  # type: ignore[attr-defined]


def test_tests_and_dependents_have_them_and_nobody_else(tmp_path: Path):
    """A test that stands on the fixture, a fixture that depends on it, a program; not a test that does not use it."""
    xml = """
    <fixture name="server">server</fixture>
    <fixture name="client" depends="server">client</fixture>
    <test name="with" fixtures="server">look.py</test>
    <test name="through" fixtures="client">look.py</test>
    <test name="program" fixtures="server" type="exit">show.sh</test>
    <test name="without" fixtures="">look.py</test>
    """
    show = '#!/bin/sh\necho "a program sees $WHERE"\n'
    outcome = run_suite(tmp_path, xml, fixtures__py=FIXTURES, look__py=TEST, show__sh=show)
    assert {str(outcome.verdict(name)) for name in ("with", "through", "program", "without")} <= {"measured", "passed"}
    assert sorted(said(outcome)) == [
        "a fixture sees here 1",
        "a test sees None None",
        "a test sees here 1 a = b; $HOME",
        "a test sees here 1 a = b; $HOME",
    ]
    assert "a program sees here 1" in "".join(event.text for event in outcome.of(OutputCaptured))  # type: ignore[attr-defined]


def test_what_no_environment_can_hold_is_refused(tmp_path: Path):
    """The fixture cannot be set up, and says why."""
    xml = '<fixture name="odd" restarts="0">odd</fixture><test name="one">look.py</test>'
    outcome = run_suite(tmp_path, xml, fixtures__py=FIXTURES, look__py=TEST)
    assert outcome.verdict("one") is Verdict.BLOCKED
    assert "cannot hold a b='x'" in outcome.of(FixtureIncident)[0].cause  # type: ignore[attr-defined]
