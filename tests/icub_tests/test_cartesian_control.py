"""The tests of Cartesian control on the simulated robot, whose configuration has controllers of its arms.

More faults are in the claims of these tests, which the proof tries.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from harness import Outcome, run_command, write_files
from robot_outcomes import failed_parts, said
from rtf.testing.events import Attached
from rtf.testing.verdict import Verdict

LEFT = "/icubSim/cartesianController/left_arm"
P2P, TOLERANCE = "CartesianControlSimpleP2pMovement", "CartesianControlReachingTolerance"
#: Name, test, parameters.
CASES = {
    "p2p": (P2P, {}),
    "original": ("CartesianControlReachingToleranceTest", {"arm-type": "right", "robot": "icubSim"}),
    "far": (P2P, {"target": "(-1.0 -0.1 0.0)"}),
    "frame": (P2P, {"inject": f"controller_frame {LEFT} shift=20"}),
    "late": (TOLERANCE, {"inject": f"latency {LEFT}/state:o delay=0.08"}),
    "limit": (P2P, {"inject": "wrong_upper_limit l_elbow"}),
    "stop": (P2P, {"inject": f"controller_stop_ignored {LEFT}"}),
    "early": (P2P, {"inject": f"controller_early {LEFT}"}),
    "quick": (P2P, {"inject": f"controller_quick {LEFT}"}),
    "foreign": (P2P, {"controller": "/icubSim/cartesianController/left_hand"}),
}
HEAD = """<suite name="s">
<fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names" param="--config {config}">
<parameter name="arguments">(--lockstep yes)</parameter> robotinterface </fixture>
"""


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """One run of all of them, on one robot."""
    folder = tmp_path_factory.mktemp("cartesian")
    config = Path(__file__).parents[2] / "suites" / "robots" / "icubSim" / "icubSim.xml"
    tests = ""
    for name, (test, parameters) in CASES.items():
        rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
        tests += f'<test name="{name}">{rows} {test} </test>\n'
    write_files(folder, {"suite.xml": f"{HEAD.format(config=config)}{tests}</suite>"})
    return run_command(folder, "--suite", "suite.xml", limit=240.0)


@pytest.mark.parametrize("name", ["p2p", "original"])
def test_a_healthy_arm_reaches_its_targets(outcome: Outcome, measured, name: str):
    """By the controller's word and by the encoders, in time, in one sweep, away from limits; with a picture."""
    assert outcome.verdict(name) is Verdict.PASSED, outcome.detail(name)
    tolerance = 0.01 if name.startswith("p2p") else 0.02
    for who in ("the controller", "the encoders"):
        assert all(0.0 < one.value <= tolerance for one in measured(outcome, name, f"left by {who}"))
    assert all(1.0 <= one.value <= 1.6 for one in measured(outcome, name, "duration"))
    assert all(1.7 <= one.value <= 2.3 for one in measured(outcome, name, "peak of the speed by its mean"))
    assert all(one.value < 0.02 for one in measured(outcome, name, "delay of the poses"))
    pictures = [one for one in outcome.of(Attached) if one.test.endswith(f"/{name}")]
    assert [one.media_type for one in pictures] == ["image/png"] * 2


def test_a_stop_is_obeyed(outcome: Outcome, measured):
    """By a healthy controller within a tenth of the way that is left; one that goes on fails, and is there already."""
    (way,) = measured(outcome, "p2p", "way after a stop")
    assert 0.0 < way.value < 10.0
    assert outcome.verdict("stop") is Verdict.FAILED
    assert failed_parts(outcome, "stop") == ["stopped", "back to the pose"]
    assert measured(outcome, "stop", "way after a stop")[0].value > 80.0
    assert f"{LEFT} goes on after it was stopped" in said(outcome, "stop")


def test_the_word_and_the_time_of_a_controller_are_judged(outcome: Outcome):
    """One that is done while its joints still move, and one that is twice as quick as it was asked to be."""
    assert outcome.verdict("early") is Verdict.FAILED
    assert failed_parts(outcome, "early") == []
    assert f"{LEFT} says that its motion is done, and it is not: " in outcome.detail("early")
    assert outcome.verdict("quick") is Verdict.FAILED
    assert failed_parts(outcome, "quick") == ["to the position", "back to the pose"]


def test_the_torso_keeps_to_its_limits_on_the_way_back(outcome: Outcome, measured):
    """It turns on the way there."""
    held = measured(outcome, "p2p", "held")
    assert {one.subject for one in held} == {"torso_pitch", "torso_roll", "torso_yaw"}
    assert all(abs(one.value) < 1.0 for one in held)


def test_a_target_out_of_reach_is_reported(outcome: Outcome, measured):
    """The controller ends at the nearest pose, and calls it done; the distance from the target fails."""
    assert outcome.verdict("far") is Verdict.FAILED
    assert measured(outcome, "far", "solution from target")[0].value > 300.0
    assert f"the solution of {LEFT} misses the target; likely: a target out of reach" in said(outcome, "far")


def test_a_wrong_frame_of_the_hand_is_found(outcome: Outcome, measured):
    """Only the encoders and the tables of the robot know it: by its own word the controller has arrived."""
    assert outcome.verdict("frame") is Verdict.FAILED
    assert measured(outcome, "frame", "controller from encoders")[0].value == pytest.approx(20.0, abs=0.1)
    assert measured(outcome, "frame", "left by the controller")[0].value < 0.01
    assert f"{LEFT} reports another pose than the encoders" in said(outcome, "frame")


def test_late_poses_are_measured(outcome: Outcome, measured):
    """By what they are behind the encoders; each reach reports it."""
    assert outcome.verdict("late") is Verdict.FAILED
    delays = [one.value for one in measured(outcome, "late", "delay of the poses")]
    assert delays == pytest.approx([0.08, 0.08], abs=0.012)


def test_a_limit_of_another_board_is_named(outcome: Outcome):
    """By its joint, in a sub-result of that."""
    assert outcome.verdict("limit") is Verdict.FAILED
    assert failed_parts(outcome, "limit") == ["l_elbow"]
    assert "the upper limit of /icubSim/cartesianController/left_arm is 106.0 deg, that of its board 116.0" in said(
        outcome, "limit"
    )


def test_without_a_controller_there_is_an_error(outcome: Outcome):
    """It names what is missing, and what to do."""
    assert outcome.verdict("foreign") is Verdict.ERROR
    detail = outcome.detail("foreign")
    assert "there is no Cartesian controller /icubSim/cartesianController/left_hand; start it" in detail
