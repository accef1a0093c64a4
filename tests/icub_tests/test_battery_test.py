"""BatteryTest on simulated robots with batteries, and on one without."""

import re

import pytest

from rtf.robot.model import find_robot
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

BENCH = find_robot("bench")
CASES = {
    "healthy": "",
    "weak": "battery_weak battery",
    "old": "battery_weak battery share=0.75",
    "frozen": "battery_frozen battery",
    "elsewhere": "imu_frozen imu_1",
    "incomplete": "loss /benchSim/battery/data:o",
}
SUITE = (
    "".join(
        f'<test name="{name}"><parameter name="inject">"{inject}"</parameter> BatteryTest </test>'
        for name, inject in CASES.items()
    )
    + '<test name="hot"><parameter name="hottest">20</parameter> BatteryTest </test>'
    '<test name="absent"><parameter name="portname">/benchSim/accumulator/data:o</parameter> BatteryTest </test>'
)
RATIO = "charge lost, of the charge drawn"


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them on the bench."""
    return run_on_robot(SUITE, model=BENCH)


def test_the_charge_of_a_healthy_battery_agrees_with_its_current(outcome, measured):
    """To one per cent, and the rounding of the gauge."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    (ratio,) = measured(outcome, "healthy", RATIO)
    assert ratio.value == pytest.approx(100.0, abs=3.0)
    (drawn,) = measured(outcome, "healthy", "charge drawn")
    assert 0.03 < drawn.value < 0.1


@pytest.mark.parametrize(("name", "expected"), [("weak", 200.0), ("old", 133.3)])
def test_lost_capacity_is_found(outcome, measured, name, expected):
    """The charge falls faster by the share that is left."""
    assert outcome.verdict(name) is Verdict.FAILED
    (ratio,) = measured(outcome, name, RATIO)
    assert ratio.verdict is MeasurementVerdict.FAILED
    assert ratio.value == pytest.approx(expected, rel=0.03)
    assert "old or dead cells" in outcome.detail(name)


def test_a_frozen_gauge_is_found(outcome):
    """The failure says that the gauge does not change, and not that the battery loses nothing."""
    assert outcome.verdict("frozen") is Verdict.FAILED
    assert "repeats one reading" in outcome.detail("frozen")


@pytest.mark.parametrize("name", ["elsewhere", "incomplete"])
def test_other_faults_are_not_its_business(outcome, name):
    """It passes with faults of other sensors and with lost messages: the current is integrated by the stamps."""
    assert outcome.verdict(name) is Verdict.PASSED


def test_bounds_and_ports_are_checked(outcome, measured):
    """A battery that is too hot, and a missing port, are failures."""
    assert outcome.verdict("hot") is Verdict.FAILED
    (highest,) = measured(outcome, "hot", "highest temperature")
    assert (highest.value, highest.high) == (25.0, 20.0)
    assert outcome.verdict("absent") is Verdict.FAILED
    assert "cannot connect" in outcome.detail("absent")


def test_a_coarse_gauge_needs_a_longer_test(run_on_robot, tmp_path):
    """The test does not pass without having seen the charge fall, and says how long it takes."""
    text = BENCH.read_text(encoding="utf-8").replace("charge_step = 0.001", "charge_step = 1.0")
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    description = BENCH.parent / "bench.xml"
    (tmp_path / "bench.xml").write_text(description.read_text(encoding="utf-8"), encoding="utf-8")
    outcome = run_on_robot('<test name="short"> BatteryTest </test>', model=tmp_path / "robot.toml")
    assert outcome.verdict("short") is Verdict.INCONCLUSIVE
    found = re.search(r"less than 5 steps of 1 %: (\d+) s would be enough", outcome.detail("short"))
    assert found
    assert 500 < int(found[1]) < 2000


def test_a_robot_without_a_battery_is_no_failure_of_its_battery(run_on_robot):
    """The error names the place where a battery is described."""
    outcome = run_on_robot('<test name="none"> BatteryTest </test>', parts="head")
    assert outcome.verdict("none") is Verdict.ERROR
    assert "icub has no battery" in outcome.detail("none")
    assert "[sensors.battery]" in outcome.detail("none")
