"""The test case as authors use it: assertions, checks, measurements, series and attachments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.testing import TestCase
from rtf.testing.events import (
    Attached,
    Event,
    Measured,
    Message,
    Progressed,
    SeriesRecorded,
    SeriesSampled,
    TestRenamed,
)
from rtf.testing.session import Session
from rtf.testing.verdict import Inconclusive, Severity, SkipTest, TestFailure, TestProblem, Verdict

if TYPE_CHECKING:
    from pathlib import Path


class Case(TestCase):
    """A test with an empty body."""

    def run(self) -> None:
        """Do nothing."""


@pytest.fixture
def sent() -> list[Event]:
    """The events of the test."""
    return []


@pytest.fixture
def case(tmp_path: Path, sent: list[Event]) -> Case:
    """A test that is attached to a session."""
    made = Case()
    made.attach_to(Session("s/t", sent.append, folder=tmp_path / "files" / "s" / "t", run_folder=tmp_path), "--robot x")
    return made


STOPPING = {
    "assert_fail": (("x",), TestFailure),
    "assert_error": (("x",), TestProblem),
    "assert_true": ((0, "x"), TestFailure),
    "assert_fail_if_true": ((1, "x"), TestFailure),
    "assert_fail_if_false": ((0, "x"), TestFailure),
    "assert_error_if_true": ((1, "x"), TestProblem),
    "assert_error_if_false": ((0, "x"), TestProblem),
    "assert_equal": ((1, 2, "x"), TestFailure),
    "assert_near": ((1.0, 2.0, 0.5, "deg"), TestFailure),
    "assert_within": ((1.0, 2.0, None, "deg"), TestFailure),
    "assert_vector_near": (([1.0, 5.0], [1.0, 2.0], 0.5, "deg"), TestFailure),
    "skip": (("x",), SkipTest),
    "inconclusive": (("x",), Inconclusive),
}


@pytest.mark.parametrize("name", STOPPING)
def test_assertion_that_does_not_hold_stops(case: Case, name: str):
    """A failed assertion raises its exception."""
    arguments, error = STOPPING[name]
    with pytest.raises(error):
        getattr(case, name)(*arguments)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("assert_true", (1, "x")),
        ("assert_fail_if_true", (0, "x")),
        ("assert_error_if_true", (0, "x")),
        ("assert_equal", (1, 1.0, "x")),
        ("assert_near", (1.0, 1.5, 0.5, "deg")),
        ("assert_within", (2.0, 2.0, None, "deg")),
        ("assert_vector_near", ([1, 2], [1, 2.1], [0, 0.2], "deg")),
    ],
)
def test_assertion_that_holds_is_silent(case: Case, sent: list[Event], name: str, arguments: tuple[object, ...]):
    """An assertion that holds, also at its limit, sends no event."""
    getattr(case, name)(*arguments)
    assert sent == []


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("check", (True, "x"), (False, "x")),
        ("check_equal", (1, 1, "x"), (1, 2, "x")),
        ("check_near", (1.0, 1.0, 0.1, "deg"), (1.0, 2.0, 0.1, "deg")),
        ("check_within", (1.0, 0.0, 2.0, "deg"), (3.0, 0.0, 2.0, "deg")),
        ("check_vector_near", ([1], [1], 0.1), ([1], [2], 0.1)),
    ],
)
def test_check_says_what_it_found_and_goes_on(
    case: Case, sent: list[Event], name: str, good: tuple[object, ...], bad: tuple[object, ...]
):
    """A check returns its result, and sends a message with the author's line."""
    assert getattr(case, name)(*good) is True
    assert getattr(case, name)(*bad) is False
    assert [event.severity for event in sent] == [Severity.PASS, Severity.FAILURE]
    assert all(event.file == __file__ and event.line for event in sent)


def test_failed_comparison_states_value_limit_margin_and_unit(case: Case, sent: list[Event]):
    """A failed comparison has value, limits, margin and unit, in text and as numbers."""
    case.check_near(12.5, 10.0, 2.0, "deg", "elbow")
    (message,) = sent
    assert message.detail == "elbow: 12.5 deg, expected within [8, 12] deg, margin -0.5 deg"
    assert (message.value, message.low, message.high, message.margin, message.unit) == (12.5, 8.0, 12.0, -0.5, "deg")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_what_is_no_number_is_near_nothing(case: Case, value: float):
    """NaN and infinities never satisfy a comparison."""
    assert not case.check_near(value, 0.0, 1.0)
    assert not case.check_within(value, -1.0, 1.0)
    assert not case.check_vector_near([value], [0.0], 1.0)


def test_vectors_of_different_lengths_are_the_authors_mistake(case: Case):
    """Vectors of different lengths raise ValueError."""
    with pytest.raises(ValueError, match="vectors of different lengths: 1 values, 2 expected"):
        case.check_vector_near([1], [1, 2], 0.1)


def test_measurement_outside_its_limits_is_a_failure_and_the_test_goes_on(case: Case, sent: list[Event]):
    """A measurement outside its limits is recorded, and a failure."""
    case.measure("gap", 3, "mm", high=2)
    assert [type(event) for event in sent] == [Measured, Message]
    assert case._session.tally.verdict() is Verdict.FAILED


def test_a_failure_carries_the_hint_and_a_pass_says_nothing(case: Case, sent: list[Event]):
    """The hint of a measurement is in its failure only."""
    case.measure("gap", 3, "mm", high=2, hint="the lid is open; likely: a broken hinge")
    case.measure("gap", 1, "mm", high=2, hint="the lid is open; likely: a broken hinge")
    case.measure("gap", 3, "mm", hint="the lid is open; likely: a broken hinge")
    (said,) = [event for event in sent if isinstance(event, Message)]
    assert said.severity is Severity.FAILURE
    assert said.detail == "gap = 3 mm, expected at most 2 mm, margin -1 mm; the lid is open; likely: a broken hinge"
    assert case._session.tally.first == said.detail


def test_test_that_only_records_is_measured(case: Case):
    """A test without checks is measured; with one it passes."""
    case.measure("gap", 3, "mm")
    assert case._session.tally.verdict() is Verdict.MEASURED
    case.check(True, "x")
    assert case._session.tally.verdict() is Verdict.PASSED


def test_series_that_grows_is_watched_and_kept(case: Case, sent: list[Event], tmp_path: Path):
    """A growing series is sent in small batches, and stored whole at the end."""
    with case._session.part("joint 1"), case.series("elbow", t="s", q="deg") as series:
        for step in range(10_000):
            series.append(step * 0.01, step)
    batches = [event for event in sent if isinstance(event, SeriesSampled)]
    assert batches[0].samples == ((0.0,), (0.0,))
    assert all(len(column) <= 40 for event in batches for column in event.samples)
    (kept,) = (event for event in sent if isinstance(event, SeriesRecorded))
    assert (kept.rows, kept.subject, kept.columns) == (10_000, "joint 1", batches[0].columns)
    with np.load(tmp_path / kept.path) as columns:
        assert columns["q"].tolist() == [*range(10_000)]


def test_series_is_kept_once_however_it_ends(case: Case, sent: list[Event]):
    """A series is stored once, by its block or by the clean-up; an empty one is not."""
    case.series("empty", t="s", q="deg")
    case.series("left open", t="s", q="deg").append(0, float("nan"))
    for function, arguments, keywords in case.cleanup_stack() * 2:
        function(*arguments, **keywords)
    assert [event.name for event in sent if isinstance(event, SeriesRecorded)] == ["left open"]


def test_series_takes_whole_rows_only(case: Case):
    """A row of another length, or with other values than numbers, is refused whole."""
    series = case.series("elbow", t="s", q="deg")
    for row in ((1.0,), (1.0, "x"), (1.0, 2.0, 3.0)):
        with pytest.raises(ValueError):  # noqa: PT011 - three messages, one class
            series.append(*row)
    assert len(series) == 0
    with pytest.raises(ValueError, match="no columns"):
        case.series("none")


def test_series_are_kept_beside_the_journal(case: Case, sent: list[Event], tmp_path: Path):
    """A recorded series is a file in the run's folder, with units in the event."""
    for _ in range(2):
        case.record("elbow/1", t=([0.0, 0.1], "s"), q=([1, 2], "deg"))
    first, second = sent
    assert isinstance(first, SeriesRecorded)
    assert first.columns == ({"name": "t", "unit": "s"}, {"name": "q", "unit": "deg"})
    assert first.path != second.path
    with np.load(tmp_path / first.path) as arrays:
        assert arrays["q"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("columns", [{}, {"t": ([1, 2], "s"), "q": ([1], "deg")}, {"t": ([[1]], "s")}])
def test_series_that_are_none(case: Case, columns: dict[str, tuple[list[object], str]]):
    """Columns must be one-dimensional and of one length."""
    with pytest.raises(ValueError, match="series 'x'"):
        case.record("x", **columns)


def test_attached_files_never_leave_the_tests_folder(case: Case, sent: list[Event], tmp_path: Path):
    """Attached files are in the test's folder under unique names, whatever they are called."""
    source = tmp_path / "log.txt"
    source.write_text("x")
    kept = [
        case.attach(source),
        case.attach(source),
        case.attach(b"y", "../../etc/passwd"),
        case.attach(b"z", "a b\n.csv"),
    ]
    assert len({*kept}) == 4
    assert all(path.parent == tmp_path / "files" / "s" / "t" for path in kept)
    assert [event.size for event in sent if isinstance(event, Attached)] == [1, 1, 1, 1]
    assert sent[0].media_type == "text/plain"
    with pytest.raises(ValueError, match="need a name"):
        case.attach(b"x")


def test_words_names_and_progress(case: Case, sent: list[Event]):
    """Reports and warnings do not change the verdict; progress stays between 0 and 1."""
    case.report("a")
    case.warn("b")
    case.rename("n", "d")
    case.progress(7, "c")
    assert [type(event) for event in sent] == [Message, Message, TestRenamed, Progressed]
    assert sent[3].fraction == 1.0
    assert case.environment == "--robot x"
    assert case._session.tally.verdict() is Verdict.PASSED


def test_body_that_was_not_written_is_an_error():
    """A test without ``run`` raises NotImplementedError."""
    with pytest.raises(NotImplementedError, match=r"TestCase has no run\(\)"):
        TestCase().run()
