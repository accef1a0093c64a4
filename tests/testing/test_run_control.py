"""The control of a run: stops, and answers to questions."""

from __future__ import annotations

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import pytest

from harness import run_suite
from rtf.testing.events import Answered, Asked, Interrupted, RunEnded, TestEnded
from rtf.testing.run_control import AnswerError, Control, TooLateError
from rtf.testing.verdict import ExitCode, Verdict
from waiting import eventually

if TYPE_CHECKING:
    from pathlib import Path


ASKING = """
from rtf.testing import TestCase
class Asking(TestCase):
    def run(self):
        self.check(self.confirm("is it well?", timeout=20), "it is")
"""
FINE = "from rtf.testing import TestCase\nclass Fine(TestCase):\n    def run(self):\n        self.check(True, 'fine')\n"


def question(test: str = "s/t", number: int = 1, **members: Any) -> Asked:
    """Return a question."""
    return Asked(test=test, question=f"{test}#{number}", text="?", **members)


def ended(test: str) -> TestEnded:
    """Return the end of a test."""
    return TestEnded(test=test, verdict=Verdict.PASSED, outcome=Verdict.PASSED)


@pytest.fixture
def control() -> Control:
    """A control with an open question."""
    made = Control()
    made.ask(question(), lambda *_: None)
    return made


def test_a_stop_before_the_run_is_remembered():
    """A stop before the run is announced to it."""
    control = Control()
    control.stop("a button", 1)
    heard: list[Any] = []
    control.announce(heard.append)
    assert [(event.source, event.stage) for event in heard] == [("a button", 1)]


def test_a_stage_is_what_was_asked_for_and_never_less():
    """A stop has its stage, and never lowers it."""
    control = Control()
    stages = []
    for stage in (1, 1, 2, 1):
        control.stop("a button", stage)
        stages.append(control.stage)
    assert stages == [1, 1, 2, 2]


def test_requests_count_up_to_three():
    """Each request raises the stage up to three, and is announced once."""
    control = Control()
    heard: list[Any] = []
    for _ in range(4):
        control.request("x")
    control.announce(heard.append)
    control.announce(heard.append)
    assert [event.stage for event in heard] == [1, 2, 3, 3]
    assert (control.stage, control.count) == (3, 4)
    other = Control()
    other.request("time", stage=2)
    other.request("signal")
    assert other.stage == 3


def test_a_run_that_is_over_is_not_stopped(control: Control):
    """Stopping a finished run raises TooLateError."""
    control.note(RunEnded(verdict=Verdict.PASSED, exit_code=0, duration=1.0))
    with pytest.raises(TooLateError, match="the run is over"):
        control.stop("a button", 1)


def test_an_answer_is_understood_and_given_once(control: Control):
    """The first valid answer counts; a later one gets an error with the first source."""
    given: list[tuple[str | None, str]] = []
    control.ask(question(number=2), lambda answer, source: given.append((answer, source)))
    with pytest.raises(AnswerError, match="yes or no"):
        control.answer("s/t", "s/t#2", "perhaps", "a button")
    assert control.answer("s/t", "s/t#2", "Ja", "a button") == "yes"
    with pytest.raises(TooLateError, match=r"answered already \(a button\)"):
        control.answer("s/t", "s/t#2", "no", "console")
    assert given == [("yes", "a button")]


def test_many_answer_at_once_and_one_is_taken(control: Control):
    """Of answers from several threads one is taken."""
    given: list[str | None] = []
    control.ask(question(number=2), lambda answer, _source: given.append(answer))
    together = threading.Barrier(8)

    def answer(number: int) -> bool:
        together.wait()
        try:
            control.answer("s/t", "s/t#2", "yes" if number % 2 else "no", f"person {number}")
        except TooLateError:
            return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(answer, range(8))) == 1
    assert len(given) == 1


def test_open_questions_are_listed_oldest_first(control: Control):
    """Open questions are listed, oldest first."""
    control.ask(question("s/u"), lambda *_: None)
    assert [asked.test for asked in control.questions()] == ["s/t", "s/u"]


@pytest.mark.parametrize(
    "event",
    [Answered(test="s/t", question="s/t#1", answer="yes", source="timeout"), ended("s/t")],
    ids=["its time is up", "its test is over"],
)
def test_a_question_without_a_waiting_test_is_closed(control: Control, event: Any):
    """A question is closed by its time-out, or the end of its test."""
    control.note(event)
    assert control.questions() == ()
    with pytest.raises(TooLateError):
        control.answer("s/t", "s/t#1", "yes", "console")


def test_other_tests_do_not_close_it(control: Control):
    """Events of other tests and questions do not close it."""
    control.note(ended("s/u"))
    control.note(Answered(test="s/t", question="s/t#2"))
    assert len(control.questions()) == 1


def test_the_next_attempt_asks_anew(control: Control):
    """The question of the next attempt is open again."""
    control.answer("s/t", "s/t#1", "yes", "web")
    given: list[str | None] = []
    control.ask(question(), lambda answer, _source: given.append(answer))
    control.answer("s/t", "s/t#1", "no", "web")
    assert given == ["no"]


def test_listeners_hear_of_each_question():
    """Listeners get each question."""
    control, heard = Control(), []
    control.attend(heard.append)
    control.ask(question(), lambda *_: None)
    assert [asked.question for asked in heard] == ["s/t#1"]


def test_a_typed_letter_of_another_encoding_is_no_answer(control: Control, monkeypatch: pytest.MonkeyPatch):
    """What is typed after it is."""
    given: list[tuple[str | None, str]] = []
    read, write = os.pipe()
    with os.fdopen(read, encoding="utf-8") as typed, os.fdopen(write, "wb", buffering=0) as terminal:
        monkeypatch.setattr(sys, "stdin", typed)
        control.note(ended("s/t"))
        control.attend_terminal()
        control.ask(question("s/u"), lambda answer, source: given.append((answer, source)))
        terminal.write(b"s\xec\n")
        terminal.write(b"yes\n")
        eventually(lambda: given, "it is not answered", 2.0)
        terminal.close()
        eventually(lambda: "rtf-operator" not in {one.name for one in threading.enumerate()}, "it reads on")
    assert given == [("yes", "console")]


# In a run ----------------------------------------------------------------------------------------------------------


def test_a_button_answers_a_real_test(tmp_path: Path):
    """A program with the control can answer a test."""
    control = Control()
    control.attend(lambda asked: control.answer(asked.test, asked.question, "yes", "a button"))
    outcome = run_suite(tmp_path, "<test>asking.py</test>", options={"control": control}, asking__py=ASKING)
    assert outcome.verdict("asking") is Verdict.PASSED
    assert [event.source for event in outcome.of(Answered)] == ["a button"]


def test_a_button_stops_a_real_run(tmp_path: Path):
    """A program with the control can stop a run after the running test."""
    control = Control()

    def stop_and_answer(asked: Asked) -> None:
        control.stop("a button", 1)
        control.answer(asked.test, asked.question, "yes", "a button")

    control.attend(stop_and_answer)
    xml = "<test>asking.py</test><test>fine.py</test>"
    outcome = run_suite(tmp_path, xml, options={"control": control}, asking__py=ASKING, fine__py=FINE)
    assert outcome.exit_code == ExitCode.INTERRUPTED
    assert [(event.source, event.stage) for event in outcome.of(Interrupted)] == [("a button", 1)]
    assert (outcome.verdict("asking"), outcome.verdict("fine")) == (Verdict.PASSED, Verdict.NOT_RUN)


def test_a_stop_before_the_first_test_runs_nothing(tmp_path: Path):
    """A stop before the run leaves all tests not run."""
    control = Control()
    control.stop("a button", 1)
    outcome = run_suite(tmp_path, "<test>fine.py</test>", options={"control": control}, fine__py=FINE)
    assert outcome.exit_code == ExitCode.INTERRUPTED
    assert outcome.verdict("fine") is Verdict.NOT_RUN


def test_reporters_are_given_the_control(tmp_path: Path):
    """Any reporter has the control, and can stop the run."""
    from harness import run_command, write_files

    reporter = """
from pathlib import Path
from rtf.testing import Reporter
from rtf.testing.events import TestEnded

class Button(Reporter):
    plugin_name = "button"
    def handle(self, event, results):
        if isinstance(event, TestEnded):
            self.options.control.stop("a button", 1)
            Path("stopped").touch()
"""
    waits = """
from pathlib import Path
from rtf import clock
from rtf.testing import TestCase

class Waits(TestCase):
    def run(self):
        deadline = clock.Deadline.after(20.0)
        while not Path("stopped").exists() and not deadline.expired:
            clock.sleep(0.005)
"""
    tests = '<test name="a">fine.py</test><test name="b">waits.py</test><test name="c">fine.py</test>'
    xml = f'<suite name="s">{tests}</suite>'
    write_files(tmp_path, {"button__py": reporter, "fine__py": FINE, "waits__py": waits, "s__xml": xml})
    outcome = run_command(tmp_path, "-s", "s.xml", "--report", "button", RTF_PLUGIN_PATH=str(tmp_path))
    assert outcome.exit_code == ExitCode.INTERRUPTED
    assert (outcome.verdict("a"), outcome.verdict("c")) == (Verdict.PASSED, Verdict.NOT_RUN)
    assert outcome.of(Interrupted, source="a button")
