"""Statistics of streams, for known messages."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot_testing.judging.statistics import surely_beyond
from rtf.robot_testing.streams.message import Message
from rtf.robot_testing.streams.stream_statistics import stream_of, within


def message(number, *, delay=0.001, period=0.01):
    """Return a message of a regular stream."""
    return Message(number, number * period, number * period + delay, 8, number, None)


def test_a_healthy_stream():
    """No message is missing or repeated; the rate counts intervals, not messages."""
    stream = stream_of([message(number) for number in range(101)])
    assert stream.periods.rate == pytest.approx(100.0)
    assert (stream.lost, stream.duplicates, stream.overtaken, stream.every) == (0, 0, 0, 0)
    assert stream.jitter(0.99) == pytest.approx(0.0)


def test_a_decimated_stream_is_told_from_losses():
    """A stream that sends only each k-th message is reported as such."""
    stream = stream_of([message(number) for number in range(0, 100, 2)])
    assert stream.every == 2
    assert stream.periods.rate == pytest.approx(50.0)
    assert stream_of([message(number) for number in (0, 1, 3, 5)]).every == 0


@given(st.permutations(range(20)), st.sets(st.integers(1, 18), max_size=10), st.sets(st.integers(0, 19), max_size=10))
def test_messages_are_counted_in_any_order(order, missing, twice):
    """Losses and duplicates are found in any order of arrival, and the rate does not depend on it."""
    kept = [number for number in order if number not in missing]
    again = [number for number in kept if number in twice]
    stream = stream_of([message(number) for number in kept + again])
    assert stream.lost == len(missing)
    assert stream.duplicates == len(again)
    assert [one.number for one in stream.messages] == sorted(kept)
    assert stream.loss == pytest.approx(100.0 * len(missing) / 20)


def test_late_messages_are_jitter_and_overtaken():
    """A late message is jitter, and one that arrives after a later one is counted as overtaken."""
    late = message(5, delay=0.035)
    stream = stream_of([*map(message, (0, 1, 2, 3, 4, 6, 7, 8)), late, message(9)])
    assert stream.overtaken == 1
    assert stream.jitter(1.0) == pytest.approx(0.034)
    assert stream.jitter(0.5) == pytest.approx(0.0)


def test_stamps_that_do_not_advance_are_counted():
    """In the order of the numbers: what arrives late is not old."""
    stamps = [(0, 0.0), (1, 0.01), (3, 0.03), (2, 0.01), (4, 0.02), (5, 0.05)]
    stream = stream_of([Message(number, time, 0.1, 8, number, None) for number, time in stamps])
    assert (stream.same_time, stream.back_in_time) == (1, 1)


def test_without_stamps_arrivals_count():
    """Messages without stamps are never duplicates, and their rate is that of their arrivals."""
    bare = [Message(-1, math.nan, number * 0.02, 8, 0, None) for number in range(11)]
    stream = stream_of(bare)
    assert stream.periods.rate == pytest.approx(50.0)
    assert (stream.lost, stream.duplicates, stream.same_time, stream.back_in_time) == (0, 0, 0, 0)
    assert all(math.isnan(delay) for delay in stream.delays)


def test_the_window_is_by_stamps():
    """A message belongs to the window in which it was sent, however late it arrives."""
    messages = [message(number, delay=0.2) for number in range(100)]
    found = within(messages, 0.095, 0.5)
    assert [one.number for one in found] == [*range(10, 60)]
    assert within([], 0.1, 1.0) == []


def test_too_few_messages_are_refused():
    """The error has the number that is needed."""
    with pytest.raises(ValueError, match="3 are needed"):
        stream_of([message(0), message(0), message(1)])


def test_jitter_is_judged_with_its_confidence():
    """With 20 of two hundred late messages allowed, 22 may be chance; 40 are not."""
    stream = stream_of([message(number, delay=0.031 if number % 9 == 0 else 0.001) for number in range(200)])
    assert stream.jitter(0.9) == pytest.approx(0.03)
    assert stream.sure_jitter(0.9) == pytest.approx(0.0)
    stream = stream_of([message(number, delay=0.031 if number % 5 == 0 else 0.001) for number in range(200)])
    assert stream.sure_jitter(0.9) == pytest.approx(0.03)


def test_the_quantile_of_a_small_sample_has_a_wide_interval():
    """For three values the bound is the least value."""
    assert surely_beyond([3.0, 1.0, 2.0], 0.9) == 1.0
    assert surely_beyond([5.0] * 100, 0.9) == 5.0
