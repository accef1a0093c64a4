"""The session of a test: verdicts of events, sub-results and errors, and the effect of a stop."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest

from rtf.testing.events import Answered, Asked, Event, Message, SubResultEnded
from rtf.testing.session import TEXT_LIMIT, Session, bounded, text_of
from rtf.testing.verdict import Inconclusive, Phase, Severity, SkipTest, TestFailure, TestProblem, TestStopped, Verdict

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def sent() -> list[Event]:
    """The events of the session."""
    return []


@pytest.fixture
def session(tmp_path: Path, sent: list[Event]) -> Session:
    """The session of a test in its body."""
    made = Session("s/t", sent.append, folder=tmp_path, run_folder=tmp_path)
    made.phase = Phase.RUN
    return made


@pytest.mark.parametrize(
    ("errors", "verdict"),
    [
        ([], Verdict.PASSED),
        ([TestFailure("f")], Verdict.FAILED),
        ([TestProblem("e")], Verdict.ERROR),
        ([OSError("e")], Verdict.ERROR),
        ([AssertionError("f")], Verdict.FAILED),
        ([SkipTest("s")], Verdict.SKIPPED),
        ([Inconclusive("i")], Verdict.INCONCLUSIVE),
        ([TestFailure("f"), SkipTest("s")], Verdict.FAILED),
        ([SkipTest("s"), TestFailure("f")], Verdict.FAILED),
        ([TestProblem("e"), TestFailure("f")], Verdict.FAILED),
        ([TestFailure("f"), TestProblem("e")], Verdict.FAILED),
        ([TestProblem("e"), Inconclusive("i")], Verdict.ERROR),
        ([Inconclusive("i"), SkipTest("s")], Verdict.SKIPPED),
    ],
)
def test_what_errors_add_up_to(session: Session, errors: list[Exception], verdict: Verdict):
    """A failure outweighs an error, and both outweigh all else, in any order."""
    for error in errors:
        session.raised(error)
    assert session.tally.verdict() is verdict


def test_error_without_text_is_still_reported(session: Session, sent: list[Event]):
    """An exception whose text raises an error is reported with its class."""

    class OddError(Exception):
        def __str__(self) -> str:
            raise KeyError("no")

    session.raised(OddError())
    (message,) = sent
    assert isinstance(message, Message)
    assert message.detail == "OddError: (its text cannot be had: KeyError)"
    assert text_of(ValueError("x")) == "x"


def test_part_has_a_verdict_of_its_own_and_ends_nothing(session: Session, sent: list[Event]):
    """An exception ends its sub-result only; its failure is one of the test."""
    with session.part("arm"):
        with session.part("joint 1"):
            raise TestFailure("x")
        with session.part("joint 2"):
            pass
    parts = {event.subject: event.verdict for event in sent if isinstance(event, SubResultEnded)}
    assert parts == {"arm/joint 1": Verdict.FAILED, "arm/joint 2": Verdict.PASSED, "arm": Verdict.FAILED}
    assert session.tally.verdict() is Verdict.FAILED
    assert session.subject == ""


def test_part_that_is_skipped_skips_the_part_only(session: Session, sent: list[Event]):
    """A skipped sub-result does not skip the test; an inconclusive one makes it inconclusive."""
    with session.part("a"):
        raise SkipTest("x")
    assert session.tally.verdict() is Verdict.PASSED
    with session.part("b"):
        raise Inconclusive("y")
    assert session.tally.verdict() is Verdict.INCONCLUSIVE


def test_what_a_test_came_to_names_the_part(session: Session):
    """The detail of the test begins with the sub-result's name, that of the sub-result does not."""
    with session.part("l_elbow"):
        session.message(Severity.FAILURE, "measure", "12 deg", ("", 0))
        _, part = session._tallies
        assert part.first == "12 deg"
    assert session.tally.first == "l_elbow: 12 deg"


def test_part_is_not_named_twice(session: Session):
    """A text that begins with the sub-result's name is left unchanged."""
    with session.part("l_elbow"):
        session.message(Severity.FAILURE, "assert", "l_elbow does not move", ("", 0))
    assert session.tally.first == "l_elbow does not move"


def test_stop_takes_effect_at_once_in_the_authors_code(session: Session):
    """A stop raises TestStopped in the author's code only."""
    session.stop("x")  # outside: noted
    assert session.stopped == "x"
    called = []
    with pytest.raises(TestStopped):
        session.run_stoppable(lambda: called.append(1))
    assert called == []
    with pytest.raises(TestStopped):
        session.run_stoppable(lambda: session.stop("y"))


def test_stop_before_teardown_does_not_keep_it_from_running(session: Session):
    """A stop before teardown or clean-up does not prevent them."""
    for phase in (Phase.TEARDOWN, Phase.CLEANUP):
        session.stop("x")
        session.phase = phase
        called: list[int] = []
        session.run_stoppable(lambda called=called: called.append(1))
        assert called == [1]


def test_stop_while_an_event_is_sent_takes_effect_when_it_is_whole(tmp_path: Path):
    """A stop while an event is sent takes effect after the event."""
    done: list[Event] = []

    def send(event: Event) -> None:
        made.stop("x")
        done.append(event)

    made = Session("s/t", send, folder=tmp_path, run_folder=tmp_path)
    made.phase = Phase.RUN
    with pytest.raises(TestStopped):
        made.run_stoppable(lambda: made.message(Severity.INFO, "x", "y", ("", 0)))
    assert len(done) == 1


def test_stop_is_for_the_main_thread_only(session: Session, sent: list[Event]):
    """A stop does not interrupt another thread of the test."""
    errors: list[BaseException] = []

    def speak() -> None:
        try:
            session.message(Severity.INFO, "x", "y", ("", 0))
        except BaseException as error:  # noqa: BLE001 - what must not happen
            errors.append(error)

    def body() -> None:
        session._stop = "x"
        thread = threading.Thread(target=speak)
        thread.start()
        thread.join()
        session._stop = None

    session.run_stoppable(body)
    assert errors == []
    assert len(sent) == 1


def test_long_texts_are_cut_in_the_middle():
    """A long text keeps both ends, and the number of omitted characters."""
    assert bounded("x" * TEXT_LIMIT) == "x" * TEXT_LIMIT
    text = bounded("a" * TEXT_LIMIT + "b" * TEXT_LIMIT)
    assert text.startswith("a" * 1000)
    assert text.endswith("b" * 1000)
    assert f"{TEXT_LIMIT} characters left out" in text


@pytest.mark.parametrize(
    ("received", "answer", "source"),
    [
        ([("q", "yes", "console")], "yes", "console"),
        ([("another", "no", "web"), None, ("q", "yes", "web")], "yes", "web"),
        ([], "no", "timeout"),
    ],
)
def test_question_and_answer(
    received: list[tuple[str, str, str] | None], answer: str, source: str, tmp_path: Path, sent: list[Event]
):
    """Answers to other questions are ignored; without one in time the default counts, with its source."""
    waiting = [*received]

    def receive(seconds: float) -> tuple[str, str | None, str] | None:
        return waiting.pop(0) if waiting else None

    made = Session("s/t", sent.append, folder=tmp_path, run_folder=tmp_path, receive=receive)
    asked = Asked(test="s/t", question="q", text="?", timeout=0.05, default="no")
    assert made.ask(asked) == answer
    assert [type(event) for event in sent] == [Asked, Answered]
    assert sent[1].source == source


def test_question_without_an_operator(session: Session, sent: list[Event]):
    """Without an operator the default is the answer at once."""
    assert session.ask(Asked(test="s/t", question="q", text="?", timeout=3600, default="no")) == "no"
    assert sent[1].source == "automatic"
