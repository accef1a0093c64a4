"""The tests of torques against references, gravity, and impedance on the simulated robot."""

from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot_testing import GuardError
from rtf.testing.events import Message
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import find
from rtf.testing.verdict import Inconclusive, Severity, Verdict


def entry(name, test, inject="", **parameters):
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}"><parameter name="inject">"{inject}"</parameter>{rows} {test} </test>'


ARM = {"part": "left_arm", "joints": "(2 3)"}
ELBOW = {"part": "left_arm", "joints": "(3)", "duration": 5}
ROLL = {"part": "left_arm", "joints": "(1)", "postures": 4, "speed": 60}
SUITE = "".join([
    entry("references", "TorqueControlConsistency", **ARM),
    entry("references-lost", "TorqueControlConsistency", "missed_command l_elbow", **ARM),
    entry("references-wrong-mode", "TorqueControlConsistency", "wrong_mode l_elbow", part="left_arm", joints="(3)"),
    entry("references-weak", "TorqueControlConsistency", "motor_weak l_shoulder_roll", part="left_arm", joints="(0 1)"),
    entry("references-off", "TorqueControlConsistency", **ARM, zero="(0 45 90)"),
    entry("gravity", "TorqueControlGravityConsistency", **ROLL),
    entry("gravity-bias", "TorqueControlGravityConsistency", "torque_bias l_shoulder_roll", **ROLL),
    entry("gravity-sign", "TorqueControlGravityConsistency", "torque_scale l_shoulder_roll factor=-1", **ROLL),
    entry("gravity-friction", "TorqueControlGravityConsistency", "friction l_elbow",
          **{**ROLL, "joints": "(1 3)", "postures": 3}),
    entry("gravity-no-model", "TorqueControlGravityConsistency", **ROLL, model="nowhere.urdf"),
    entry("impedance", "TorqueControlStiffDampCheck", **ELBOW),
    entry("impedance-scale", "TorqueControlStiffDampCheck", "torque_scale l_elbow factor=1.5", **ELBOW),
    entry("impedance-weak", "TorqueControlStiffDampCheck", "motor_weak l_shoulder_roll",
          part="left_arm", joints="(0 1)"),
    entry("impedance-strict", "TorqueControlStiffDampCheck", **ELBOW, correlation=1.0, slope=99),
    entry("impedance-jam", "TorqueControlStiffDampCheck", "jam l_elbow", **ELBOW),
])  # fmt: skip


#: The test of gravity, of which the tenth measurement fails: the second of the two in the last posture.
HALFWAY = """
import sys
from rtf.robot.errors import RobotError
from rtf.testing.plugins import shipped_folder
sys.path.insert(0, str(shipped_folder("test")))
from torque_control_gravity_consistency import TorqueControlGravityConsistency

class Halfway(TorqueControlGravityConsistency):
    count = 0
    def _measure(self, *arguments):
        self.count += 1
        if self.count == 10:
            raise RobotError("nothing came any more")
        return super()._measure(*arguments)
"""


@pytest.fixture(scope="module")
def outcome(run_on_robot, tmp_path_factory):
    """One robot for all of them."""
    plugin = tmp_path_factory.mktemp("plugins") / "halfway.py"
    plugin.write_text(HALFWAY)
    halfway = entry("gravity-halfway", str(plugin), **{**ROLL, "postures": 5})
    return run_on_robot(SUITE + halfway, parts="left_arm")


@pytest.mark.parametrize("name", ["references", "gravity", "impedance"])
def test_a_healthy_joint_passes(outcome, name):
    """References, the model's torques of gravity, and the response to a push agree with what is measured."""
    assert outcome.verdict(name) is Verdict.PASSED, outcome.detail(name)


def test_references_are_commanded_in_all_forms(outcome, measured):
    """Single joints, a group, and the whole part; each is read back at three torques."""
    for change in ("+0.1 Nm", "+0 Nm", "-0.1 Nm"):
        found = measured(outcome, "references", f"reference that is read back, {change}")
        assert {one.subject for one in found} == {
            f"{joint} {form}" for joint in ("l_shoulder_yaw", "l_elbow") for form in ("single", "group", "all")
        }


def test_gravity_is_measured(outcome, measured):
    """The gain by the model's torques is 1, and the offset is 0."""
    (gain,) = measured(outcome, "gravity", "gain")
    (offset,) = measured(outcome, "gravity", "offset")
    assert gain.value == pytest.approx(1.0, abs=0.2)
    assert offset.value == pytest.approx(0.0, abs=0.5)


def test_friction_is_not_taken_for_gravity(outcome, measured):
    """Also in a joint that is held while another one moves between postures."""
    assert outcome.verdict("gravity-friction") is Verdict.PASSED, outcome.detail("gravity-friction")
    assert {one.subject for one in measured(outcome, "gravity-friction", "greatest error")} == {
        "l_shoulder_roll",
        "l_elbow",
    }


def test_a_push_is_answered_by_stiffness_and_damping(outcome, measured):
    """The joint is moved far enough, and both slopes are what was set."""
    for what, least in (("stiffness", 2.0), ("damping", 10.0)):
        (moved,) = measured(outcome, "impedance", f"moved, {what}")
        (share,) = measured(outcome, "impedance", f"{what}, share of what was set")
        assert moved.value > least
        assert share.value == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("name", "what", "joint"),
    [
        ("references-lost", "reference that is read back, +0 Nm", "l_elbow"),
        ("gravity-bias", "offset", "l_shoulder_roll"),
        ("gravity-sign", "gain", "l_shoulder_roll"),
        ("impedance-scale", "stiffness, share of what was set", "l_elbow"),
    ],
)
def test_a_fault_is_found_at_its_joint_only(outcome, measured, name, what, joint):
    """The value that the fault changes leaves its limits there, and nowhere else."""
    assert outcome.verdict(name) is Verdict.FAILED
    found = measured(outcome, name, what)
    assert any(one.margin < 0 for one in found if joint in one.subject)
    assert all(one.margin >= 0 for one in found if joint not in one.subject)


@pytest.mark.parametrize("name", ["references-weak", "impedance-weak"])
def test_a_weak_motor_that_two_joints_share_is_the_fault_of_its_own(outcome, name):
    """Its torque lacks at both; the other one is inconclusive, and names it."""
    said = [event for event in outcome.of(Message, test=f"s/{name}") if event.subject]
    failed = {event.subject.split()[0] for event in said if event.severity is Severity.FAILURE}
    (doubt, *_) = (event for event in said if event.subject.startswith("l_shoulder_pitch"))
    assert failed == {"l_shoulder_roll"}
    assert "the motor of l_shoulder_roll gives" in doubt.detail
    assert any(
        "the motor of l_shoulder_roll gives" in event.detail and "magnets" in event.detail
        for event in said
        if event.severity is Severity.FAILURE
    )


@pytest.mark.parametrize(("noise", "least"), [(0.0, 0.995), (1.0, 0.94), (3.0, 0.6)])
def test_noise_of_speeds_is_no_damping(noise: float, least: float):
    """Noise makes the slope of a line flatter by its share of the variance."""
    test = load_test(find("test", "TorqueControlStiffDampCheck"))
    random = np.random.default_rng(5)
    speeds = 7.0 * np.sin(np.arange(0.0, 10.0, 0.01) * 2 * np.pi)
    share = test._share_of_motion("j0", "damping", speeds + noise * random.normal(size=speeds.size))
    assert share == pytest.approx(24.5 / (24.5 + noise**2), abs=0.06)
    assert share >= least


def test_more_noise_than_motion_says_nothing():
    """The test is inconclusive."""
    test = load_test(find("test", "TorqueControlStiffDampCheck"))
    with pytest.raises(Inconclusive, match="is noise: move it further"):
        test._share_of_motion("j0", "damping", np.random.default_rng(5).normal(size=1000))


def test_an_operator_who_moves_a_joint_too_far_says_nothing_of_it():
    """The test is inconclusive. In the simulator, where only the test pushes, the joint has run away."""
    test = load_test(find("test", "TorqueControlStiffDampCheck"))
    part = SimpleNamespace(
        names=["j0"],
        board=SimpleNamespace(encoder=lambda _: 26.0),
        shown=lambda _, degrees, spec: f"{degrees:{spec}} deg",
    )
    for test.pushed, ends in ((False, Inconclusive), (True, GuardError)):
        with pytest.raises(ends, match="more than 25 deg from home"):
            test._look_after(part, 0, 0.0)


def test_a_torque_that_follows_nothing_is_said_so(outcome):
    """The failure has likely causes, and the parameters have their units."""
    assert outcome.verdict("impedance-strict") is Verdict.FAILED
    said = [one.detail for one in outcome.of(Message, test="s/impedance-strict", severity=Severity.FAILURE)]
    assert "l_elbow: the torque does not follow how far it gives way; likely: " in said[0]
    assert "l_elbow: the torque does not follow how fast it gives way; likely: " in said[1]
    given = type(load_test(find("test", "TorqueControlStiffDampCheck"))).declarations()
    assert (given["stiffness"].unit, given["damping"].unit) == ("Nm/deg", "Nm*s/deg")


def test_joints_that_do_not_obey_fail(outcome):
    """One that does not enter torque mode, and one that does not give way to a push."""
    assert outcome.verdict("references-wrong-mode") is Verdict.FAILED
    assert "l_elbow is not in torque mode" in outcome.detail("references-wrong-mode")
    assert outcome.verdict("impedance-jam") is Verdict.FAILED
    assert "does not give way" in outcome.detail("impedance-jam")


def test_parameters_that_do_not_fit_are_errors(outcome):
    """Too many values, and a model that is not there: the error says what and where."""
    assert outcome.verdict("references-off") is Verdict.ERROR
    assert "zero has 3 values" in outcome.detail("references-off")
    assert outcome.verdict("gravity-no-model") is Verdict.ERROR
    assert "nowhere.urdf" in outcome.detail("gravity-no-model")


def test_what_was_measured_before_something_went_wrong_is_judged(outcome, measured):
    """Of whole postures only."""
    assert outcome.verdict("gravity-halfway") is Verdict.ERROR
    assert outcome.detail("gravity-halfway") == "l_shoulder_roll in all postures: RobotError: nothing came any more"
    (found,) = measured(outcome, "gravity-halfway", "offset", "l_shoulder_roll")
    assert found.value == pytest.approx(0.0, abs=0.5)
