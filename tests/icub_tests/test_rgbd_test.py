"""RgbdTest on simulated benches with a depth camera, and on a robot without one."""

import pytest

from pictures import needs_pictures
from rtf.robot.model import find_robot
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

CASES = {
    "healthy": "",
    "frozen": "depth_frozen depth",
    "short": "depth_scale depth factor=0.9",
    "millimetres": "depth_scale depth factor=1000",
    "slow": "wrong_rate /benchSim/depthCamera/depthImage:o",
    "elsewhere": "imu_frozen imu_1",
}


def entry(name: str, **parameters: object) -> str:
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}">{rows} RgbdTest </test>'


SUITE = "".join(
    [
        *(entry(name, inject=f'"{inject}"', time=1) for name, inject in CASES.items()),
        entry("given", known="((0.5 0.95 1.3))", depth_tolerance=1, time=0.5),
        entry("sky", known="((0.02 0.02 2))", time=0.5),
        entry("place", known="((0.5 2 1))"),
        entry("absent", portname="/benchSim/other"),
    ]
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them on the bench."""
    return run_on_robot(SUITE, model=find_robot("bench"), cameras="yes")


@needs_pictures
class TestOnTheBench:
    """One run."""

    def test_a_healthy_camera_passes(self, outcome, measured):
        """The depth of the floor is right, and picture and depth have the same time."""
        assert outcome.verdict("healthy") is Verdict.PASSED
        (depth,) = measured(outcome, "healthy", "depth")
        assert depth.value == pytest.approx(1.281, abs=0.005)
        (offset,) = measured(outcome, "healthy", "time between depth and picture")
        assert offset.value == pytest.approx(0.0, abs=1e-6)
        focal = measured(outcome, "healthy", "focal length x, depth")
        assert [one.value for one in focal] == [pytest.approx(289.7, abs=0.1)]

    def test_frozen_depths_are_found(self, outcome, measured):
        """Although the pictures change."""
        assert outcome.verdict("frozen") is Verdict.FAILED
        (repeated,) = measured(outcome, "frozen", "repeated depths")
        assert repeated.value == 100.0
        assert "do not change" in outcome.detail("frozen")

    @pytest.mark.parametrize(("name", "factor"), [("short", 0.9), ("millimetres", 1000.0)])
    def test_a_wrong_scale_is_found(self, outcome, measured, name, factor):
        """By the known depth; millimetres are out of the clip planes, too."""
        assert outcome.verdict(name) is Verdict.FAILED
        (depth,) = measured(outcome, name, "depth")
        assert depth.verdict is MeasurementVerdict.FAILED
        assert depth.value == pytest.approx(1.281 * factor, rel=0.005)

    def test_the_rate_is_judged(self, outcome):
        """Of both streams."""
        assert outcome.verdict("slow") is Verdict.FAILED
        assert "depthImage:o" in outcome.detail("slow")

    def test_other_faults_are_not_its_business(self, outcome):
        """It passes with a fault of another sensor."""
        assert outcome.verdict("elsewhere") is Verdict.PASSED

    def test_known_places_are_a_parameter(self, outcome):
        """A wrong depth fails, as does one where nothing can be measured; a place out of the images is refused."""
        assert outcome.verdict("given") is Verdict.FAILED
        assert "not 1.3 m" in outcome.detail("given")
        assert outcome.verdict("sky") is Verdict.FAILED
        assert "measures nothing at (0.02, 0.02)" in outcome.detail("sky")
        assert outcome.verdict("place") is Verdict.ERROR
        assert "(0.5 2 1) is no place" in outcome.detail("place")

    def test_an_absent_camera_fails(self, outcome):
        """The failure names it."""
        assert outcome.verdict("absent") is Verdict.FAILED
        assert "cannot connect to /benchSim/other" in outcome.detail("absent")


def test_a_robot_without_depth_camera_is_no_failure(run_on_robot):
    """The error names the parameter to set."""
    outcome = run_on_robot('<test name="none"> RgbdTest </test>', parts="head")
    assert outcome.verdict("none") is Verdict.ERROR
    assert "no depth camera; give its name as portname" in outcome.detail("none")
