"""Environment variables and values that fixtures provide to tests and dependent fixtures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

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
    """Return what tests and fixtures reported."""
    return [event.detail for event in outcome.of(Message) if "sees" in event.detail]  # type: ignore[attr-defined]


def test_only_tests_and_dependents_have_them(tmp_path: Path):
    """Tests with the fixture and dependent fixtures have its variables, other tests do not."""
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
    """An invalid variable blocks the test, with the reason."""
    xml = '<fixture name="odd" restarts="0">odd</fixture><test name="one">look.py</test>'
    outcome = run_suite(tmp_path, xml, fixtures__py=FIXTURES, look__py=TEST)
    assert outcome.verdict("one") is Verdict.BLOCKED
    assert "cannot hold a b='x'" in outcome.of(FixtureIncident)[0].cause  # type: ignore[attr-defined]


VALUES = """
from rtf.testing import FixtureCollapsed, FixtureManager, FixtureValue, Value
class Server(FixtureManager):
    plugin_name = "server"
    provides = {"port": Value(int, "where it listens"), "names": Value(list, "who is there")}
    def setup(self):
        self.provide_value("port", 1000 + self.generation)
        self.provide_value("names", ["a", "b"])
    def check(self):
        import os
        from pathlib import Path
        if self.generation == 1 and Path(os.environ["RTF_RUN_FOLDER"], "collapse").exists():
            raise FixtureCollapsed("it was asked to")
class Client(FixtureManager):
    plugin_name = "client"
    port = FixtureValue(int, fixture="server", key="port")
    def setup(self):
        self.report(f"a fixture sees {self.port}")
class Forgets(FixtureManager):
    plugin_name = "forgets"
    provides = {"port": Value(int)}
class Undeclared(FixtureManager):
    plugin_name = "undeclared"
    def setup(self):
        self.provide_value("port", 1)
class Mistyped(FixtureManager):
    plugin_name = "mistyped"
    provides = {"port": Value(int)}
    def setup(self):
        self.provide_value("port", "80")
"""
NEEDS = """
from rtf.testing import FixtureValue, TestCase
class Needs(TestCase):
    port = FixtureValue(KIND, fixture="FIXTURE", key="KEY")
    def run(self):
        self.report(f"a test sees {self.port} {self.fixture('FIXTURE')}")
"""
ONCE = """
import os
from pathlib import Path
from rtf import clock
from rtf.testing import FixtureValue, TestCase
class Once(TestCase):
    port = FixtureValue(int, fixture="server", key="port")
    def run(self):
        self.report(f"a test sees {self.port}")
        Path(os.environ["RTF_RUN_FOLDER"], "collapse").touch()
        if self.port == 1001:
            clock.sleep(1000)
"""


def test_values_are_handed_to_tests_and_dependents_with_their_types(tmp_path: Path):
    """Values reach tests and dependents with their types, and are in the journal."""
    xml = """
    <fixture name="server">server</fixture><fixture name="client" depends="server">client</fixture>
    <test name="one">needs.py</test>
    """
    needs = NEEDS.replace("KIND", "int").replace("FIXTURE", "server").replace("KEY", "port")
    outcome = run_suite(tmp_path, xml, fixtures__py=VALUES, needs__py=needs)
    assert said(outcome) == ["a fixture sees 1001", "a test sees 1001 {'port': 1001, 'names': ['a', 'b']}"]
    values = [(event.fixture, event.detail) for event in outcome.of(Message, title="provides")]  # type: ignore[attr-defined]
    assert values == [("server", "port = 1001"), ("server", 'names = ["a", "b"]')]


def test_values_follow_a_restart(tmp_path: Path):
    """A test that is run again gets the values of the next generation."""
    xml = '<fixture check-period="0.05" backoff="0">server</fixture><test name="one">once.py</test>'
    outcome = run_suite(tmp_path, xml, fixtures__py=VALUES, once__py=ONCE)
    assert said(outcome) == ["a test sees 1001", "a test sees 1002"]
    assert outcome.verdict("one") is Verdict.PASSED


@pytest.mark.parametrize(
    ("kind", "fixture", "key", "problem"),
    [
        ("str", "server", "port", "'port' of fixture 'server' is 1001, which is no str"),
        ("int", "server", "prt", "fixture 'server' provides no 'prt'; it provides port, names"),
        ("int", "sever", "port", "it has no fixture 'sever'; its fixtures are: server"),
    ],
)
def test_a_value_that_a_test_cannot_have_is_an_error_before_it_begins(
    tmp_path: Path, kind: str, fixture: str, key: str, problem: str
):
    """A missing or wrong value is an error of the test before it begins."""
    needs = NEEDS.replace("KIND", kind).replace("FIXTURE", fixture).replace("KEY", key)
    xml = '<fixture name="server">server</fixture><test name="one">needs.py</test>'
    outcome = run_suite(tmp_path, xml, fixtures__py=VALUES, needs__py=needs)
    assert outcome.verdict("one") is Verdict.ERROR
    assert problem in outcome.detail("one")
    assert not said(outcome)


@pytest.mark.parametrize(
    ("plugin", "problem"),
    [
        ("forgets", "setup() of fixture 'odd' did not provide port"),
        ("undeclared", "Undeclared does not declare 'port' in provides, which has: nothing"),
        ("mistyped", "'port' of fixture 'odd' is '80', which is no int"),
    ],
)
def test_a_fixture_that_does_not_keep_what_it_declares_is_not_usable(tmp_path: Path, plugin: str, problem: str):
    """A fixture that omits a declared value, or adds one, is not usable."""
    xml = f'<fixture name="odd" restarts="0">{plugin}</fixture><test name="one">look.py</test>'
    outcome = run_suite(tmp_path, xml, fixtures__py=VALUES, look__py=TEST)
    assert outcome.verdict("one") is Verdict.BLOCKED
    assert problem in outcome.of(FixtureIncident)[0].cause  # type: ignore[attr-defined]
