"""Locks of fixtures among several workers."""

import fcntl

import pytest

from rtf.pytest_suites.locks import locks_of
from rtf.testing.dispatch import Use

ROBOT, FIRST, SECOND = Use("robot", ""), Use("robot", "--x 1"), Use("robot", "--x 2")


def exclude(one, other):
    """Return whether two suites exclude each other."""
    first, second = locks_of(one), locks_of(other)
    return any(fcntl.LOCK_EX in (first[place], second[place]) for place in first.keys() & second.keys())


@pytest.mark.parametrize(
    ("one", "other", "wait"),
    [
        ([ROBOT], [ROBOT], True),
        ([FIRST], [FIRST], True),
        ([FIRST], [SECOND], False),
        ([ROBOT], [SECOND], True),
        ([ROBOT], [Use("simulator", "")], False),
        ([FIRST, ROBOT], [SECOND], True),
        ([ROBOT, FIRST], [SECOND], True),
    ],
)
def test_two_fixtures_of_a_plug_in_are_two_only_with_params_that_differ(one, other, wait):
    """Fixtures of one plug-in exclude each other unless their params differ, as with suite workers."""
    assert exclude(one, other) is wait
    assert exclude(other, one) is wait
