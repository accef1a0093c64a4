"""Tests of efforts on boards as iCubs have them: coupled joints change modes together, and no torque range is known."""

import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.testing.verdict import Verdict

simulated_part = pytest.importorskip("rtf.simulator.part")

#: Joints of the torso whose modes change together: roll and pitch, which share their motors.
ROLL, PITCH = 1, 2
#: What each may go while the other one is tested, deg.
ASTRAY = 15.0


def entry(name, test, **parameters):
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}"><parameter name="part">torso</parameter>{rows} {test} </test>'


SUITE = "".join([
    entry("stiction", "MotorStiction", joints="(1)", repeat=1, threshold=2),
    entry("signs", "MotorEncodersSignCheck", joints="(1)", PosThreshold=2),
    entry("own-loop", "PositionControlAccuracyExternalPid", joints="(1)", cycles=2, step=3),
    entry("torque-steps", "TorqueControlAccuracy", joints="(1)", cycles=2),
    entry("torques", "TorqueControlConsistency", joints="(1)"),
    entry("gravity", "TorqueControlGravityConsistency", joints="(1 2)", postures=2, swing=8, offset=3, error=4),
    entry("impedance", "TorqueControlStiffDampCheck", joints="(0)"),
    entry("modes", "ControlModes", joints="(0)", faults="false"),
])  # fmt: skip
#: By what joints are commanded in each of the tests that leave one without its controller, and in which mode.
EFFORTS = {
    "stiction": ("set_reference_duty_cycles", ControlMode.PWM),
    "signs": ("set_reference_duty_cycles", ControlMode.PWM),
    "own-loop": ("set_reference_duty_cycles", ControlMode.PWM),
    "torque-steps": ("set_reference_torques", ControlMode.TORQUE),
    "torques": ("set_reference_torques", ControlMode.TORQUE),
}


@pytest.fixture(scope="module")
def recording(record_on_robot):
    """The run on a torso with such boards."""
    part = simulated_part.SimulatedPart
    change = part.set_control_modes

    def change_together(self, modes, joints=None):
        chosen = [*range(self.size)] if joints is None else [joints] if isinstance(joints, int) else [*joints]
        each = [modes] * len(chosen) if isinstance(modes, ControlMode) else [*modes]
        for mode, joint in zip(each, chosen, strict=True):
            group = [ROLL, PITCH] if joint in (ROLL, PITCH) else [joint]
            change(self, [mode] * len(group), group)

    def refuse(self, joint):
        raise RefusedError(f"{self.part} joint {joint}: it is not reported")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(part, "set_control_modes", change_together)
        patch.setattr(part, "torque_range", refuse)
        return record_on_robot(SUITE, "torso")


@pytest.mark.parametrize("test", [*EFFORTS, "gravity", "impedance", "modes"])
def test_a_healthy_part_passes(recording, test):
    """A missing torque range, and modes that change together, fail no joint."""
    assert recording.outcome.verdict(test) is Verdict.PASSED, recording.outcome.detail(test)


@pytest.mark.parametrize("test", EFFORTS)
def test_a_joint_that_loses_its_controller_with_another_is_commanded_what_held_it(recording, test):
    """It is commanded the effort that held it from the moment when the other one enters the mode, and moves little."""
    method, mode = EFFORTS[test]
    entered = next(one for one in recording.commands(test, "set_control_modes", ROLL) if one.value(ROLL) is mode)
    commands = recording.commands(test, method, PITCH)
    assert commands[0].time == entered.time
    held = commands[0].value(PITCH)
    assert abs(held) > 1.0
    home, *_ = (one.positions[PITCH] for one in recording.during(test))
    assert all(abs(one.positions[PITCH] - home) < ASTRAY for one in recording.during(test))


def test_a_torque_is_commanded_where_no_range_is_reported(recording):
    """A small one, in every mode that ignores it."""
    commands = recording.values("modes", "set_reference_torques", 0)
    assert commands
    assert {abs(one) for one in commands} == {0.5}
