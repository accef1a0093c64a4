"""FtSensorTest on the simulated robot."""

from itertools import product

import numpy as np
import pytest

from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.plugins import find, load_module
from rtf.testing.verdict import Verdict

PORT = "/icubSim/left_arm/analog:o"
MANY = "/icubSim/FTs/measures:o"
CASES = {
    "healthy": "",
    "biased": "ft_bias left_arm",
    "frozen": "ft_frozen left_leg",
    "noisy": "ft_noise right_foot",
    "elsewhere": "imu_rotated imu",
    "shaken": "backlash l_elbow",
    "jitters": "encoder_noise l_elbow",
    "falls": "motor_dead l_elbow",
}
EXPECTED = f"""
<test name="expected"> <parameter name="portname">{PORT}</parameter>
  <parameter name="expected">(0 0 500 0 0 0)</parameter> FtSensorTest </test>
<test name="many"> <parameter name="portname">{MANY}</parameter>
  <parameter name="inject">ft_bias left_arm</parameter> FtSensorTest </test>
<test name="five"> <parameter name="expected">(0 0 0 0 0)</parameter> FtSensorTest </test>
"""
SUITE = (
    "".join(
        f'<test name="{name}"><parameter name="time">0.5</parameter>'
        f'<parameter name="inject">"{inject}"</parameter> FtSensorTest </test>'
        for name, inject in CASES.items()
    )
    + EXPECTED
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    return run_on_robot(SUITE)


def test_a_healthy_robot_shows_its_weight(outcome, measured):
    """All six sensors agree with the model to a tenth of a newton in the posture that the robot is in."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    forces = [event for axis in "xyz" for event in measured(outcome, "healthy", f"force {axis}")]
    assert len(forces) == 18
    assert all(abs(event.value - (event.low + event.high) / 2) < 0.1 for event in forces)
    assert max(abs(event.value) for event in forces) > 10


@pytest.mark.parametrize(
    ("name", "port", "what"),
    [
        ("biased", "left_arm", "force x"),
        ("frozen", "left_leg", "noise of force x"),
        ("noisy", "right_foot", "noise of force z"),
    ],
)
def test_each_fault_is_found_at_its_sensor_only(outcome, measured, name, port, what):
    """The faulty sensor fails, and no other."""
    assert outcome.verdict(name) is Verdict.FAILED
    failed = {event.subject for event in outcome.events if getattr(event, "verdict", None) is MeasurementVerdict.FAILED
              and event.test.endswith(f"/{name}")}  # fmt: skip
    assert failed == {f"/icubSim/{port}/analog:o"}
    assert measured(outcome, name, what, port)[0].verdict is MeasurementVerdict.FAILED


def test_other_faults_are_not_its_business(outcome):
    """A rotated inertial unit fails none of these sensors."""
    assert outcome.verdict("elsewhere") is Verdict.PASSED


def test_a_sensor_is_not_failed_for_a_limb_that_shakes(outcome):
    """Who shakes it is named."""
    assert outcome.verdict("shaken") is Verdict.INCONCLUSIVE
    assert outcome.detail("shaken").startswith("/icubSim/left_arm/analog:o: force x has a noise of")
    assert "but it was disturbed: l_elbow: joint and motor encoder disagree" in outcome.detail("shaken")


def test_a_sensor_is_not_failed_for_a_limb_that_falls_or_jitters(outcome):
    """Nor is one on the other side of the robot, which has the jitter by the torso."""
    assert outcome.verdict("falls") in {Verdict.PASSED, Verdict.INCONCLUSIVE}, outcome.detail("falls")
    assert outcome.verdict("jitters") is Verdict.INCONCLUSIVE, outcome.detail("jitters")
    assert "but it was disturbed: the encoders of l_elbow and of its motor were apart" in outcome.detail("jitters")


def test_each_sensor_of_a_message_of_many_has_its_own_load(outcome, measured):
    """All six are judged by the model, and the broken one fails alone; what has a port of its own is not read twice."""
    found = measured(outcome, "many", "force x")
    assert [one.subject for one in found] == [
        f"{MANY}/{side}_{limb}_ft_sensor" for limb, side in product(("arm", "leg", "foot"), "lr")
    ]
    broken = [one.subject for one in found if one.verdict is MeasurementVerdict.FAILED]
    assert broken == [f"{MANY}/l_arm_ft_sensor"]
    assert outcome.verdict("many") is Verdict.FAILED
    assert not measured(outcome, "healthy", "rate", MANY)


def test_a_known_load_may_be_given(outcome, measured):
    """It counts instead of the model's, and has six values."""
    assert outcome.verdict("expected") is Verdict.FAILED
    assert measured(outcome, "expected", "force z")[0].low == 495.0
    assert outcome.verdict("five") is Verdict.ERROR
    assert "six" in outcome.detail("five")


def test_a_slip_of_a_joint_is_no_noise():
    """One jerk of some hundredths of a second does not count; one in each tenth of a second does."""
    noise = load_module(find("test", "FtSensorTest"))._noise
    values = np.random.default_rng(1).normal(5.0, 0.002, 100)
    assert noise(values) == pytest.approx(0.002, rel=0.3)
    values[36:39] += (0.13, -0.6, 0.13)
    assert values.std() > 0.05 > 10 * noise(values)
    values[6::10] += 0.6
    assert noise(values) > 0.1


def test_few_values_all_count():
    """With less than two for each tenth of the time none is left out."""
    noise = load_module(find("test", "FtSensorTest"))._noise
    assert noise(np.array([0.0, 1.0, 0.0, 1.0])) == pytest.approx(np.std([0, 1, 0, 1], ddof=1))
