"""Two runs of the same tests on simulated robots with the same seed."""

import numpy as np
import pytest

from rtf.testing.events import Measured, SeriesRecorded

_TORSO = '<parameter name="part">torso</parameter>'
SUITE = f"""
<test name="moves"> {_TORSO} MotorTest </test>
<test name="open-loop"> {_TORSO} OpenLoopConsistency </test>
<test name="signs"> {_TORSO} <parameter name="joints">(2)</parameter> MotorEncodersSignCheck </test>
"""


@pytest.fixture(scope="module")
def outcomes(run_on_robot):
    """The suite above, run twice with one seed."""
    return [run_on_robot(SUITE, parts="torso", seed=7) for _ in range(2)]


def values_of(outcome):
    """All measured values with their subjects."""
    return [(event.test, event.subject, event.name, event.value) for event in outcome.of(Measured)]


def test_measurements_are_the_same_to_the_last_bit(outcomes):
    """In lockstep nothing depends on the speed of the machine, and all random numbers come from the seed."""
    first, second = map(values_of, outcomes)
    assert len(first) > 60  # or there would be nothing to differ
    assert first == second


def test_recordings_are_the_same_to_the_last_bit(outcomes):
    """All rows of all series, with their times."""
    first, second = ([*outcome.of(SeriesRecorded)] for outcome in outcomes)
    assert [(one.subject, one.path) for one in first] == [(one.subject, one.path) for one in second]
    assert len(first) > 10
    for one in first:
        with np.load(outcomes[0].folder / one.path) as a, np.load(outcomes[1].folder / one.path) as b:
            assert a.files == b.files
            assert all(np.array_equal(a[column], b[column], equal_nan=True) for column in a.files), one.path
