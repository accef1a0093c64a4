"""Tests of a suite at the same time, each on its own copy of the fixtures, never two with one resource."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness import Outcome, run_suite
from rtf.testing.events import Diagnosed, FixtureChanged, SuiteEnded, SuiteStarted, TestEnded, TestStarted
from rtf.testing.verdict import FixtureState, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.runner import Run

RIG = """
from rtf.testing import FixtureManager, Parameter
class Rig(FixtureManager):
    where = Parameter(str, "a place")
    OCCUPIES
    def setup(self):
        self.provide(RIG=self.where)
"""
TEST = """
import os
from pathlib import Path
from rtf import clock
from rtf.testing import Parameter, TestCase
class Meet(TestCase):
    \"\"\"Waits until as many tests run at this moment as it wants.\"\"\"
    me = Parameter(str, "its mark", default="")
    others = Parameter(list[str], "the marks of those that it waits for", default=[])
    safety = "still"
    def run(self):
        folder = Path(os.environ["RTF_RUN_FOLDER"])
        (folder / f"mark-{self.me}").write_text(os.environ.get("RIG", ""))
        for other in self.others:
            deadline = clock.Deadline.after(20.0)
            while not (folder / f"mark-{other}").exists():
                self.assert_true(not deadline.expired, "alone")
                clock.sleep(0.005)
        self.check(True, "met")
"""


def run(tmp_path: Path, xml: str, occupies: str = "", **options: object) -> Outcome:
    """Run a suite with two suite workers."""
    text = f'<suite name="s" copies="2">{xml}</suite>'
    files = {"rig__py": RIG.replace("OCCUPIES", occupies), "meet__py": TEST}
    return run_suite(tmp_path, text, options={"jobs": 2, **options}, **files)


def meet(name: str, *others: str, attributes: str = "") -> str:
    """Return a test that waits for others to run at the same time."""
    words = f"--others ({' '.join(others)})" if others else ""
    return f'<test name="{name}" {attributes} param="--me {name} {words}">meet.py</test>'


def overlap(outcome: Outcome, one: str, other: str) -> bool:
    """Return whether two tests ran at the same time."""
    times = {}
    for name in (one, other):
        (began,) = outcome.of(TestStarted, test=f"s/{name}")
        (ended,) = outcome.of(TestEnded, test=f"s/{name}")
        times[name] = (began.time, ended.time)
    (a, b), (c, d) = times.values()
    return a < d and c < b


def test_tests_of_a_suite_run_at_once_each_on_a_copy_of_its_fixtures(tmp_path: Path):
    """Two tests that wait for each other pass on two copies, in one suite."""
    fixture = '<fixture name="rig" param="--where bench${copy}">rig.py</fixture>'
    outcome = run(tmp_path, fixture + meet("a", "b") + meet("b", "a") + meet("c"))
    assert [(test.id, test.verdict) for test in outcome.results.tests.values()] == [
        ("s/a", Verdict.PASSED),
        ("s/b", Verdict.PASSED),
        ("s/c", Verdict.PASSED),
    ]
    assert len(outcome.of(SuiteStarted)) == len(outcome.of(SuiteEnded)) == 1
    assert {event.fixture for event in outcome.of(FixtureChanged, state=FixtureState.STOPPED)} == {"rig", "rig@2"}
    assert {(outcome.folder / f"mark-{name}").read_text() for name in "ab"} == {"bench1", "bench2"}
    assert outcome.exit_code == 0


def test_one_suite_worker_has_the_first_copy(tmp_path: Path):
    """Without ``-j`` the variable ``copy`` is 1."""
    outcome = run(tmp_path, '<fixture param="--where bench${copy}">rig.py</fixture>' + meet("a") + meet("b"), jobs=1)
    assert [(outcome.folder / f"mark-{name}").read_text() for name in "ab"] == ["bench1", "bench1"]


def test_what_a_test_requires_or_occupies_is_waited_for(tmp_path: Path):
    """A test runs after those that it requires, and not together with one that occupies the same."""
    xml = (
        meet("a", "b", attributes='occupies="camera"')
        + meet("late", attributes='requires="test:a"')
        + meet("shy", attributes='occupies="camera microphone"')
        + meet("b", "a")
    )
    outcome = run(tmp_path, xml)
    assert outcome.exit_code == 0, outcome.results
    assert overlap(outcome, "a", "b")
    assert not overlap(outcome, "a", "late")
    assert not overlap(outcome, "a", "shy")


@pytest.mark.parametrize(
    ("where", "occupies"), [("bench", ""), ("bench${copy}", 'occupies = "robot"')], ids=["the same", "a robot"]
)
def test_what_is_there_once_is_never_used_twice(tmp_path: Path, where: str, occupies: str):
    """A fixture with the same parameters in each copy, or of a robot, is shared, with a warning."""
    fixture = f'<fixture name="rig" param="--where {where}">rig.py</fixture>'
    outcome = run(tmp_path, fixture + meet("a") + meet("b"), occupies)
    assert not overlap(outcome, "a", "b")
    assert {event.fixture for event in outcome.of(FixtureChanged)} == {"rig"}
    (warning,) = outcome.of(Diagnosed)
    assert "copies has no effect" in warning.text


def test_a_class_says_what_its_tests_occupy(tmp_path: Path):
    """A test class can declare what it occupies."""
    declared = TEST.replace('safety = "still"', 'safety = "still"\n    occupies = "camera"')
    text = f'<suite name="s" copies="2">{meet("a")}{meet("b")}</suite>'
    outcome = run_suite(tmp_path, text, options={"jobs": 2}, meet__py=declared)
    assert not overlap(outcome, "a", "b")


def test_an_interrupt_reaches_those_that_wait(tmp_path: Path):
    """An interrupt leaves out a test that waits for an occupied resource."""
    xml = meet("a", "never", attributes='occupies="x"') + meet("b", attributes='occupies="x"')

    def interfere(run: Run) -> None:
        def attend(event: Event) -> None:
            if isinstance(event, TestStarted):
                run.control.request("the test", stage=2)

        emit = run.emit
        run.emit = lambda event: (emit(event), attend(event))[0]  # type: ignore[method-assign]

    text = f'<suite name="s" copies="2">{xml}</suite>'
    outcome = run_suite(tmp_path, text, options={"jobs": 2}, interfere=interfere, meet__py=TEST)
    assert outcome.verdict("a") is Verdict.INTERRUPTED
    assert outcome.verdict("b") is Verdict.NOT_RUN
