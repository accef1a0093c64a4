"""Questions to the operator: what counts as an answer, and what happens when nobody gives one."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import run_suite, write_files
from rtf import clock
from rtf.testing.events import Answered, Asked
from rtf.testing.operator import AnswerError, automatic, interpret
from rtf.testing.verdict import Verdict

ASKING = """
from rtf.testing import TestCase
class Asking(TestCase):
    def run(self):
        self.check(self.confirm("is the robot on its stand?", timeout=20), "it is")
        self.check_equal(self.ask("which arm?", ["left", "right"], timeout=20), "right", "the arm")
        self.check_near(self.ask_number("how far?", "deg", timeout=20), 12.5, 0.01, "deg")
"""


def asked(form: str, **members: object) -> Asked:
    """A question."""
    return Asked(test="s/t", question="s/t#1", text="?", form=form, **members)


@pytest.mark.parametrize(
    ("question", "typed", "answer"),
    [
        (asked("confirm"), "Y", "yes"),
        (asked("confirm"), " no ", "no"),
        (asked("confirm"), "ja", "yes"),
        (asked("confirm"), "sì", "yes"),
        (asked("confirm", default="no"), "", "no"),
        (asked("choice", choices=("left", "right")), "RIGHT", "right"),
        (asked("choice", choices=("left", "right")), "1", "left"),
        (asked("number", unit="deg"), "12,5", "12.5"),
        (asked("text"), " anything ", "anything"),
    ],
)
def test_what_counts_as_an_answer(question: Asked, typed: str, answer: str):
    """Answers are understood in the operator's languages, choices also by number."""
    assert interpret(question, typed) == answer


@pytest.mark.parametrize(
    ("question", "typed"),
    [
        (asked("confirm"), "perhaps"),
        (asked("confirm"), ""),
        (asked("choice", choices=("left", "right")), "3"),
        (asked("number"), "far"),
    ],
)
def test_what_is_no_answer(question: Asked, typed: str):
    """What does not answer is told, and the question stays open."""
    with pytest.raises(AnswerError):
        interpret(question, typed)


@given(st.sampled_from(["confirm", "choice", "number", "text"]), st.text(max_size=50))
def test_nothing_typed_breaks_it(form: str, typed: str):
    """Any line is an answer or an AnswerError."""
    try:
        answer = interpret(asked(form, choices=("a", "b")), typed)
    except AnswerError:
        return
    assert isinstance(answer, str)


def test_an_automatic_answer_is_given_where_it_fits():
    """One answer for a run without people; questions it does not fit get their default."""
    given: list[tuple[str | None, str]] = []
    operator = automatic("yes")
    operator(asked("confirm"), lambda answer, source: given.append((answer, source)))
    operator(asked("number", default="3"), lambda answer, source: given.append((answer, source)))
    assert given == [("yes", "automatic"), ("3", "automatic")]


def test_answers_reach_the_test(tmp_path: Path):
    """A question is an event, its answer another, and the test goes on with it."""
    answers = {"confirm": "yes", "choice": "right", "number": "12.5"}
    options = {"ask": lambda question, reply: reply(answers[question.form], "automatic")}
    outcome = run_suite(tmp_path, "<test>asking.py</test>", options=options, asking__py=ASKING)
    assert outcome.verdict("asking") is Verdict.PASSED
    assert [event.form for event in outcome.of(Asked)] == ["confirm", "choice", "number"]
    assert [event.answer for event in outcome.of(Answered)] == ["yes", "right", "12.5"]


def test_nobody_there_means_the_default_or_inconclusive(tmp_path: Path):
    """A question never holds up a run in which nobody can answer."""
    default = """
from rtf.testing import TestCase
class Default(TestCase):
    def run(self):
        self.check(self.confirm("go on?", timeout=100, default=True), "went on")
"""
    xml = "<test>asking.py</test><test>default.py</test>"
    outcome = run_suite(tmp_path, xml, asking__py=ASKING, default__py=default)
    assert outcome.verdict("asking") is Verdict.INCONCLUSIVE
    assert outcome.verdict("default") is Verdict.PASSED


def test_a_question_that_nobody_answers_times_out(tmp_path: Path):
    """An operator who is away leads to the default after the time-out, not to a hang."""
    away = """
from rtf.testing import TestCase
class Away(TestCase):
    def run(self):
        self.check_equal(self.ask("who?", timeout=0.2, default="nobody"), "nobody", "the answer")
"""
    outcome = run_suite(tmp_path, "<test>away.py</test>", options={"ask": lambda *_: None}, away__py=away)
    assert outcome.verdict("away") is Verdict.PASSED
    (answered,) = outcome.of(Answered)
    assert answered.source == "timeout"


def test_a_person_at_the_terminal_answers(tmp_path: Path):
    """On a real terminal the questions are shown and typed lines answer them, a wrong one is asked for again."""
    write_files(tmp_path, {"asking__py": ASKING})
    here, there = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "rtf.cli.testrunner", "-t", "asking.py", "--color", "never"],
        cwd=tmp_path,
        stdin=there,
        stdout=there,
        stderr=there,
        close_fds=True,
    )
    os.close(there)
    shown = ""
    replies = [("stand?", "maybe\n"), ("yes or no", "yes\n"), ("arm?", "2\n"), ("far?", "12.5\n")]
    deadline = clock.Deadline.after(60)
    while not deadline.expired:
        if select.select([here], [], [], 0.2)[0]:
            try:
                shown += os.read(here, 65536).decode()
            except OSError:
                break
        if replies and replies[0][0] in shown:
            shown = shown.partition(replies[0][0])[2]
            os.write(here, replies.pop(0)[1].encode())
    assert process.wait(timeout=20) == 0, shown
    assert not replies
    os.close(here)
