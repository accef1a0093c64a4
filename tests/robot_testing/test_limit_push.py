"""The judgement of JointLimits on a joint that pushes against its limit."""

from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot.interfaces import Pid

from .kept_test import kept_test


@pytest.mark.parametrize("kp", [8.0, -8.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_push_is_found_with_both_signs_of_the_gains(kp, sign):
    """Gains are negative for motors that are mounted in reverse, as on most joints of an arm."""
    part = SimpleNamespace(names=["elbow"])
    test = kept_test("JointLimits", robot_part=part, gains={0: Pid(kp=kp, max_output=60.0)}, beyond=[2.0], near=[0.5])
    test.outputs_known = True
    test.wanted = {"upper": [np.nan], "lower": [np.nan]}
    side = SimpleNamespace(name="upper" if sign > 0 else "lower", limit=80.0 * sign, sign=sign)
    reached, asked = (SimpleNamespace(position=80.0 * sign, output=sign * error * kp) for error in (0.2, 2.2))
    test._judge(0, side, reached, asked)
    assert test.kept.values[f"push beyond the {side.name} limit"] == pytest.approx(100 * 16 / 60)
    (failure,) = test.kept.failures
    assert "pushes beyond its" in failure
