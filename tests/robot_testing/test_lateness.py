"""Whether the loop of a test has kept up."""

import numpy as np
import pytest

from rtf.robot_testing.lateness import lateness


def test_a_loop_that_keeps_its_period_is_not_late():
    """Nor one that is a little off now and then, nor one that has hardly begun."""
    assert lateness(np.arange(100) * 0.01, 0.01) == ""
    assert lateness([0.0, 0.014, 0.02, 0.036, 0.04, 0.05], 0.01) == ""
    assert lateness([], 0.01) == lateness([1.0], 0.01) == ""


@pytest.mark.parametrize(
    ("beats", "words"),
    [([0.0, 0.01, 0.049, 0.06, 0.07], "stood still for 39 ms"), (np.arange(20) * 0.016, "takes 16 ms a round")],
)
def test_a_loop_that_stands_still_or_is_slow_is_late(beats, words):
    """And it is said how much, beside what it should have been."""
    said = lateness(beats, 0.01)
    assert words in said
    assert "its period is 10 ms" in said
