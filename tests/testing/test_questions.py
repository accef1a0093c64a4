"""Questions to the operator: valid answers, and runs without an operator."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import read_back, run_suite, write_files
from live_page import Page
from rtf import clock
from rtf.testing.events import Answered, Asked, Attached
from rtf.testing.run_control import AnswerError, Control, interpret
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
    """Return a question."""
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
    """Answers are accepted in the operator's languages, and choices by number."""
    assert interpret(question, typed) == answer


@pytest.mark.parametrize(
    ("question", "typed"),
    [
        (asked("confirm"), "perhaps"),
        (asked("confirm"), ""),
        (asked("choice", choices=("left", "right")), "3"),
        (asked("choice", choices=("left", "right")), "\u00b2"),
        (asked("choice", choices=("left", "right")), "1" * 10_000),
        (asked("number"), "nan"),
        (asked("number"), "1e999"),
        (asked("number"), "far"),
    ],
)
def test_what_is_no_answer(question: Asked, typed: str):
    """An invalid answer raises AnswerError, and the question stays open."""
    with pytest.raises(AnswerError):
        interpret(question, typed)


@given(st.sampled_from(["confirm", "choice", "number", "text"]), st.text(max_size=50))
def test_nothing_typed_breaks_it(form: str, typed: str):
    """Any line is an answer, or raises AnswerError."""
    try:
        answer = interpret(asked(form, choices=("a", "b")), typed)
    except AnswerError:
        return
    assert isinstance(answer, str)


def test_an_automatic_answer_is_given_where_it_fits():
    """An automatic answer is given where it is valid, else the default."""
    given: list[tuple[str | None, str]] = []
    for answer in ("yes", "default"):
        control = Control(answer=answer)
        assert control.attended
        control.ask(asked("confirm"), lambda answer, source: given.append((answer, source)))
        control.ask(asked("number", default="3"), lambda answer, source: given.append((answer, source)))
    assert given == [("yes", "automatic"), ("3", "automatic"), (None, "automatic"), ("3", "automatic")]


def test_answers_reach_the_test(tmp_path: Path):
    """Question and answer are events, and the test gets the answer."""
    answers = {"confirm": "yes", "choice": "right", "number": "12.5"}
    control = Control()
    control.attend(lambda asked: control.answer(asked.test, asked.question, answers[asked.form], "a program"))
    outcome = run_suite(tmp_path, "<test>asking.py</test>", options={"control": control}, asking__py=ASKING)
    assert outcome.verdict("asking") is Verdict.PASSED
    assert [event.form for event in outcome.of(Asked)] == ["confirm", "choice", "number"]
    assert [event.answer for event in outcome.of(Answered)] == ["yes", "right", "12.5"]


def test_without_an_answer_the_default_or_inconclusive(tmp_path: Path):
    """Without an operator a question has its default, or the test is inconclusive."""
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
    """A question without an answer in time has its default."""
    away = """
from rtf.testing import TestCase
class Away(TestCase):
    def run(self):
        self.check_equal(self.ask("who?", timeout=0.2, default="nobody"), "nobody", "the answer")
"""
    control = Control()
    control.attend()
    outcome = run_suite(tmp_path, "<test>away.py</test>", options={"control": control}, away__py=away)
    assert outcome.verdict("away") is Verdict.PASSED
    (answered,) = outcome.of(Answered)
    assert answered.source == "timeout"


class Terminal:
    """``testrunner`` at a terminal."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._end, there = pty.openpty()
        self.shown = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtf.cli.testrunner", *arguments, "--color", "never"],
            cwd=folder,
            stdin=there,
            stdout=there,
            stderr=there,
            close_fds=True,
        )
        os.close(there)

    def wait_for(self, text: str) -> str:
        """Wait until a text is shown; return the output up to it."""
        deadline = clock.Deadline.after(60)
        while text not in self.shown:
            assert not deadline.expired, self.shown
            if select.select([self._end], [], [], 0.2)[0]:
                self.shown += os.read(self._end, 65536).decode()
        before, found, self.shown = self.shown.partition(text)
        return before + found

    def type(self, line: str) -> None:
        """Type a line."""
        os.write(self._end, line.encode() + b"\n")

    def close(self) -> int:
        """Read to the end, and return the exit code."""
        with contextlib.suppress(OSError):  # no process holds the other end any more
            while data := os.read(self._end, 65536):
                self.shown += data.decode()
        os.close(self._end)
        return self.process.wait(timeout=20)


def test_a_person_at_the_terminal_answers(tmp_path: Path):
    """Questions are shown at the terminal; a typed line answers, an invalid one is asked again."""
    write_files(tmp_path, {"asking__py": ASKING})
    terminal = Terminal(tmp_path, "-t", "asking.py")
    for shown, typed in [("stand?", "maybe"), ("yes or no", "yes"), ("arm?", "2"), ("far?", "12.5")]:
        terminal.wait_for(shown)
        terminal.type(typed)
    assert terminal.close() == 0, terminal.shown


def test_people_at_the_terminal_and_at_the_page_are_asked_together(tmp_path: Path):
    """A question is at terminal and page; the first answer counts, with its source."""
    write_files(tmp_path, {"asking__py": ASKING})
    terminal = Terminal(tmp_path, "-t", "asking.py", "--run-folder", "run", "-w", "--web-port", "0")
    page = Page.said(terminal.wait_for("#token=") + terminal.wait_for("\n"))
    with page.follow() as stream:
        stream.until(event="asked", question="test/asking#1")
        assert page.control("answer", test="test/asking", question="test/asking#1", answer="yes").status == 202
        terminal.wait_for("arm?")
        terminal.type("right")
        assert stream.until(event="answered", question="test/asking#2")["source"] == "console"
        late = page.control("answer", test="test/asking", question="test/asking#2", answer="left")
        assert (late.status, late.json["error"]) == (409, "it is answered already (console)")
        stream.until(event="asked", question="test/asking#3")
        assert page.control("answer", test="test/asking", question="test/asking#3", answer="12,5").status == 202
        stream.until_end()
    assert terminal.close() == 0, terminal.shown
    events, _ = read_back(tmp_path / "run")
    assert [event.source for event in events if isinstance(event, Answered)] == ["web", "console", "web"]


PICTURED = """
from pathlib import Path
from rtf.testing import TestCase
class Pictured(TestCase):
    def run(self):
        here = Path(__file__).with_name("elbow.png")
        here.write_bytes(b"PNG")
        kept = self.attach(here, "kept.png")
        inside = kept.relative_to(self._session.run_folder)
        for picture in (str(here), str(kept), str(inside), ""):
            self.check(self.confirm("like this?", timeout=20, default=True, picture=picture), "yes")
"""


def test_a_picture_is_kept_with_the_run(tmp_path: Path):
    """A picture is copied into the run's folder, unless it is there already."""
    outcome = run_suite(tmp_path, "<test>pictured.py</test>", pictured__py=PICTURED)
    assert outcome.verdict("pictured") is Verdict.PASSED
    pictures = [event.picture for event in outcome.of(Asked)]
    assert pictures[1:] == ["files/s/pictured/kept.png"] * 2 + [""]
    assert (outcome.folder / pictures[0]).read_bytes() == b"PNG"
    assert len(outcome.of(Attached)) == 2


def test_a_picture_that_is_not_there_is_an_error_of_the_test(tmp_path: Path):
    """A question with a missing picture is an error of the test, and is not asked."""
    test = """
from rtf.testing import TestCase
class Missing(TestCase):
    def run(self):
        self.confirm("like this?", picture="nowhere.png")
"""
    outcome = run_suite(tmp_path, "<test>missing.py</test>", missing__py=test)
    assert outcome.verdict("missing") is Verdict.ERROR
    assert "nowhere.png" in outcome.detail("missing")
    assert not outcome.of(Asked)
