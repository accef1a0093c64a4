"""Tests of torques and duty cycles on a part that is not simulated: questions, skipped and refused joints."""

import re
from contextlib import ExitStack

import numpy as np
import pytest

from harness import run_command, write_files
from rtf import clock
from rtf.middleware.naming import configuration
from rtf.middleware.naming.configuration import find_network
from rtf.middleware.naming.server import NameServer
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import RefusedError
from rtf.testing.events import Asked, FixtureIncident, Message, SubResultEnded
from rtf.testing.verdict import ExitCode, Severity, Verdict
from served import served


def entry(name, test, **parameters):
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}"><parameter name="part">arm</parameter>{rows} {test} </test>'


SUITE = "".join([
    entry("own-loop", "PositionControlAccuracyExternalPid"),
    entry("own-loop-raw", "PositionControlAccuracyExternalPid", Kp=50),
    entry("torque-unknown", "TorqueControlAccuracy"),
    entry("torque-dead", "TorqueControlAccuracy", joints="(0)"),
    entry("references-dead", "TorqueControlConsistency", joints="(0)"),
    entry("limp", "TorqueControlStiffDampCheck", joints="(1)"),
    entry("impedance", "TorqueControlStiffDampCheck", joints="(0 1)", stiffness="(1 0)", damping=0, duration=1),
])  # fmt: skip
BEYOND_LIMITS_SUITE = entry("beyond-limits", "MotorStiction", joints="(0 2)", outputMax=2, outputStep=1)
RUNAWAY_SUITE = entry("runaway", "TorqueControlConsistency", joints="(0)")
MOVERS = """
import os, signal
from rtf.robot_testing import Safety
from rtf.robot_testing.joints_test import JointsTest

class BringsHome(JointsTest):
    safety = Safety.MOTION
    def run(self):
        self.bring_home()

class Dies(JointsTest):
    safety = Safety.MOTION
    def run(self):
        self.robot_part.board.set_limits(0, *CHANGED)
        os.kill(os.getpid(), signal.SIGKILL)
"""
#: Limits of a joint that a test leaves changed, deg.
CHANGED = (-1.0, 1.0)
#: A joint that is far outside of its limits, and one that goes far in torque mode: by so many deg.
BEYOND_LIMITS, RUNAWAY, FAR = 2, 0, 15.0
#: Errors of a machine that is too busy for the periods of the boards and of the guards.
BUSY = re.compile(
    r"published no state|the last state .* is .* old|no state has arrived|the guard of the test did not watch"
    r"|points after the step are too few"
)


class Board(FakeBoard):
    """A board that keeps the moments of what it is told, with joints that go or are where they should not.

    With a fault it can also report gears of ratio 0, refuse to have limits restored, be at its target at once, or
    accept a position command in PWM mode.
    """

    def __init__(self, *arguments, fault="", **named):
        super().__init__(*arguments, **named)
        self.commands = []
        self.fault = fault
        self.accepted = {}  # targets that were accepted in PWM mode, deg

    def fill_state(self, state):
        """See IStateSource."""
        time = super().fill_state(state)
        if self.fault in ("beyond-limits", "no-gears"):
            state.joint_positions[BEYOND_LIMITS] = 300.0
        elif self.fault == "jumps":
            state.joint_positions[:] = self.target_positions()
        elif self.fault == "runaway":
            state.torques += 1e-3 * np.sin(1e4 * time)  # somebody measures them
            if self.control_modes(RUNAWAY)[0] is ControlMode.TORQUE:
                state.joint_positions[RUNAWAY] += FAR
        return time

    def gearbox_ratio(self, motor):
        """See IMotor."""
        return 0.0 if self.fault == "no-gears" else super().gearbox_ratio(motor)

    def set_limits(self, joint, minimum, maximum):
        """See IControlLimits."""
        if self.fault == "keeps-limits" and (minimum, maximum) != CHANGED:
            raise RefusedError(f"joint {joint} keeps its limits")
        super().set_limits(joint, minimum, maximum)

    def position_move(self, targets, joints=None):
        """See IPositionControl."""
        chosen = self._chosen(joints)
        if self.fault == "any-mode" and self.control_modes(chosen)[0] is ControlMode.PWM:
            self.accepted = dict(zip(chosen, targets, strict=True))
        super().position_move(targets, joints)

    def target_positions(self, joints=None):
        """See IPositionControl."""
        chosen = self._chosen(joints)
        targets = super().target_positions(chosen)
        return np.array([self.accepted.get(joint, target) for joint, target in zip(chosen, targets, strict=True)])

    def _note(self, what, joints):
        self.commands.append((clock.now(), what, [joints] if isinstance(joints, int) else joints))

    def set_control_modes(self, modes, joints=None):
        """See IControlMode."""
        self._note(modes if isinstance(modes, ControlMode) else modes[0], joints)
        super().set_control_modes(modes, joints)

    def set_interaction_modes(self, modes, joints=None):
        """See IInteractionMode."""
        self._note(modes if isinstance(modes, InteractionMode) else modes[0], joints)
        super().set_interaction_modes(modes, joints)

    def set_reference_duty_cycles(self, duties, motors=None):
        """See IPWMControl."""
        self._note("duty", motors)
        super().set_reference_duty_cycles(duties, motors)

    def set_impedance(self, joint, stiffness, damping):
        """See IImpedanceControl."""
        self._note((stiffness, damping), joint)
        super().set_impedance(joint, stiffness, damping)


def run(folder, suite, fault=""):
    """Run tests on ``/bot/arm`` and ``/bot/head``, which may move; return the outcome, and the commands to the arm.

    In real time a machine that is too busy proves nothing: the calling test is skipped.
    """
    movers = MOVERS.replace("CHANGED", repr(CHANGED))
    write_files(folder, {"suite.xml": f'<suite name="s">{suite}</suite>', "movers.py": movers})
    with pytest.MonkeyPatch.context() as patch, ExitStack() as opened:
        patch.setenv("YARP_CONFIG_HOME", str(folder / "user"))
        configuration.write_place(opened.enter_context(NameServer()).contact)
        network = find_network()
        opened.callback(network.names.close)
        board = Board("arm", network=network, fault=fault)
        opened.enter_context(served(board, "/bot/arm", network=network, period=0.01))
        opened.enter_context(served(Board("head", network=network), "/bot/head", network=network, period=0.01))
        words = ("--suite", "suite.xml", "--allow-motion", "--answer", "yes")
        outcome = run_command(folder, *words, YARP_ROBOT_NAME="bot", RTF_CLOCK="", YARP_CLOCK="")
    for test in outcome.results.tests.values():
        if test.verdict is Verdict.ERROR and test.last is not None and BUSY.search(test.last.detail):
            pytest.skip(f"this machine is too busy for the periods of the boards and the guards: {test.last.detail}")
    return outcome, board.commands


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The run of all tests that need such a board only."""
    return run(tmp_path_factory.mktemp("real"), SUITE)


@pytest.mark.parametrize(
    ("test", "verdict", "words"),
    [
        ("own-loop", Verdict.SKIPPED, "give Kp"),
        ("own-loop-raw", Verdict.ERROR, "Kp 50, more than 20"),
        ("torque-unknown", Verdict.SKIPPED, "arm does not report which joints have torque control"),
        ("torque-dead", Verdict.ERROR, "joint0 (0 Nm); likely: no torque estimates: wholeBodyDynamics"),
        ("references-dead", Verdict.ERROR, "joint0 (0 Nm); likely: no torque estimates: wholeBodyDynamics"),
        ("limp", Verdict.SKIPPED, "no joint of arm has stiffness or damping: give"),
    ],
)
def test_what_cannot_be_tested_is_not_begun(ran, test, verdict, words):
    """The reason is reported with a hint; no joint has lost its controller."""
    outcome, commands = ran
    assert outcome.verdict(test) is verdict, outcome.detail(test)
    assert words in outcome.detail(test)
    assert not {what for _, what, _ in commands} & {ControlMode.PWM, ControlMode.TORQUE, "duty"}


def test_the_operator_is_asked_before_a_joint_gives_way(ran):
    """While the question is open the joint is held."""
    outcome, commands = ran
    (asked,) = (one for one in outcome.of(Asked, test="s/impedance") if "becomes compliant" in one.text)
    compliant = [time for time, what, _ in commands if what is InteractionMode.COMPLIANT]
    softened = [time for time, what, _ in commands if what == (1.0, 0.0)]
    assert len(compliant) == len(softened) == 1
    assert asked.time < softened[0] < compliant[0]


def test_a_joint_without_stiffness_and_damping_is_left_out(ran):
    """It has no verdict."""
    outcome, _ = ran
    ended = {one.subject: one for one in outcome.of(SubResultEnded, test="s/impedance")}
    assert ended["joint1"].verdict is Verdict.SKIPPED


def test_a_joint_far_outside_of_its_limits_is_not_driven(tmp_path):
    """It fails by its name, idle from the beginning to the end, and the others are tested.

    That nothing is known of couplings is said once.
    """
    outcome, commands = run(tmp_path, BEYOND_LIMITS_SUITE, "beyond-limits")
    failures = {one.subject: one.detail for one in outcome.of(Message, severity=Severity.FAILURE)}
    assert "joint2 is not driven: it was excluded and left idle. Its encoder shows 300.0 deg" in failures["joint2"]
    assert "joint0 does not move" in failures["joint0"]
    (warning,) = outcome.of(Message, severity=Severity.WARNING)
    assert "arm does not report the coupling of its motors" in warning.detail
    driven = {joint for _, what, joints in commands if what == "duty" for joint in joints or ()}
    assert driven == {0}
    modes = [
        what
        for _, what, joints in commands
        if isinstance(what, ControlMode) and BEYOND_LIMITS in (joints or [BEYOND_LIMITS])
    ]
    assert modes[-1] is ControlMode.IDLE
    assert ControlMode.PWM not in modes


def test_a_joint_that_runs_away_by_what_should_hold_it_fails(tmp_path):
    """It is held at once, and said how far it went, whatever its torques were until then."""
    outcome, commands = run(tmp_path, RUNAWAY_SUITE, "runaway")
    detail = outcome.detail("runaway")
    busy = "this machine is too busy" in detail
    assert outcome.verdict("runaway") is (Verdict.INCONCLUSIVE if busy else Verdict.FAILED), detail
    moved = "joint0 moved by 15.0 deg at torques within 0.1 Nm of its holding torque"
    assert any(moved in event.detail for event in outcome.of(Message))
    assert [what for _, what, _ in commands if isinstance(what, ControlMode)][-1] is ControlMode.POSITION


def mover(name, test, part):
    """An entry of one of the tests above on a part."""
    return f'<test name="{name}"><parameter name="part">{part}</parameter> movers.py::{test} </test>'


def test_a_joint_outside_of_its_limits_costs_its_part_only_whatever_its_gears_are(tmp_path):
    """The test of that part says so, though the board knows no couplings and has no gears; the head is tested."""
    suite = mover("arm", "BringsHome", "arm") + mover("head", "BringsHome", "head")
    outcome, commands = run(tmp_path, suite, "no-gears")
    detail = outcome.detail("arm")
    busy = "this machine is too busy" in detail
    assert outcome.verdict("arm") is (Verdict.INCONCLUSIVE if busy else Verdict.FAILED), detail
    assert "joint2 (/bot/arm joint 2) is at 300.0 deg, beyond its limits; it was stopped" in detail
    assert outcome.verdict("head") is Verdict.PASSED, outcome.detail("head")
    assert outcome.of(FixtureIncident) == []
    last = [
        what for _, what, joints in commands if isinstance(what, ControlMode) and joints in (None, [BEYOND_LIMITS])
    ][-1]
    assert last is ControlMode.IDLE


def test_a_part_that_cannot_be_restored_costs_its_own_tests_only(tmp_path):
    """Its further tests have the reason, those of other parts run, and the run fails."""
    suite = mover("dies", "Dies", "arm") + mover("arm", "BringsHome", "arm") + mover("head", "BringsHome", "head")
    outcome, _ = run(tmp_path, suite, "keeps-limits")
    assert [outcome.verdict(name) for name in ("dies", "arm", "head")] == [Verdict.ERROR, Verdict.ERROR, Verdict.PASSED]
    assert (
        "/bot/arm cannot be opened: it could not be restored after an earlier test, and is not moved: "
        "/bot/arm could not be restored: " in outcome.detail("arm")
    )
    assert "/bot/arm refused '[set] [llim] 0 0.0 100.0'" in outcome.detail("arm")
    (incident,) = outcome.of(FixtureIncident)
    assert "teardown() raised FixtureCollapsed: /bot/arm could not be restored" in incident.cause
    assert outcome.exit_code == ExitCode.FAILURES


def test_a_board_that_is_at_its_target_by_its_first_state_passes(tmp_path):
    """A step begins at the position before the command, whatever was recorded first."""
    outcome, _ = run(tmp_path, entry("motors", "MotorTest", distance=2), "jumps")
    assert outcome.verdict("motors") is Verdict.PASSED, outcome.detail("motors")


def test_a_command_that_its_mode_does_not_take_is_not_called_lost(tmp_path):
    """The board obeyed a position in PWM mode: the failure blames its firmware."""
    outcome, _ = run(tmp_path, entry("references", "MovementReferences", joints="(0)"), "any-mode")
    assert outcome.verdict("references") is Verdict.FAILED
    (failure,) = outcome.of(Message, severity=Severity.FAILURE)
    assert "joint0: target position after a move in PWM mode is " in failure.detail
    assert failure.detail.endswith("likely: firmware that breaks the rules of the control modes")


def test_torque_control_that_is_not_reported_is_not_counted_against_a_board(tmp_path):
    """Its joints become compliant although it reports no torque control: that is a warning."""
    outcome, commands = run(tmp_path, entry("modes", "ControlModes", joints="(0)", faults="false"))
    detail = outcome.detail("modes")
    busy = "this machine is too busy" in detail
    assert outcome.verdict("modes") is (Verdict.INCONCLUSIVE if busy else Verdict.PASSED), detail
    (warning,) = outcome.of(Message, severity=Severity.WARNING)
    assert "arm does not report which joints have torque control: torque mode is not tested" in warning.detail
    assert InteractionMode.COMPLIANT in {what for _, what, _ in commands}
