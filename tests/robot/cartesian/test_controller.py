"""The Cartesian controller on a board whose joints do what they are told: motions, events, settings, faults."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Property
from rtf.robot.cartesian.controller import CartesianController
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard, FakeDriver
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import ControllerEvent
from rtf.robot.kinematics import pose_of, robot_chains, vector_of
from rtf.robot.model import load_robot

ICUB = load_robot("icub")
CHAIN = robot_chains(ICUB).chain("left_arm", "2.5").limited_by(ICUB.axes)
SHOULDER = CHAIN.joints[3:6]
START = np.array([0.0, 0.0, 0.0, -30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0])
ARM_ALONE = [False] * 3 + [True] * 7
PERIOD = 0.01


class Rig:
    """A board of the chain's joints at the start, its time, a controller on it, and its events."""

    def __init__(self, **options: object) -> None:
        self.now = 0.0
        self.board = FakeBoard("arm", driver=FakeDriver(lambda: self.now))
        limits = " ".join(f"({word} {' '.join(map(str, values))})" for word, values in
                          (("Min", CHAIN.minima), ("Max", CHAIN.maxima)))  # fmt: skip
        self.board.open(Property.parse(f"(GENERAL (Joints {len(CHAIN)})) (LIMITS {limits})"))
        self.board.set_control_modes(ControlMode.POSITION_DIRECT)
        self.board.set_positions(START)
        self.board.set_control_modes(ControlMode.POSITION)
        self.controller = CartesianController(
            self.board, CHAIN, **{"active": ARM_ALONE, "together": SHOULDER, "period": PERIOD, **options}
        )
        self.events: list[ControllerEvent] = []
        self.controller.observe_events(self.events.append)

    def run(self, seconds: float) -> None:
        """Let some time pass."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.controller.publish(self.now)

    @property
    def names(self) -> list[str]:
        """The names of the events."""
        return [event.name for event in self.events]

    def error(self, target: np.ndarray) -> tuple[float, float]:
        """How far the measured tip is from a pose, m and deg."""
        wanted, pose = pose_of(target), pose_of(self.controller.pose().vector)
        turn = np.arccos(np.clip((np.trace(wanted[:3, :3].T @ pose[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
        return float(np.linalg.norm(wanted[:3, 3] - pose[:3, 3])), float(np.degrees(turn))


def target_near(shares: tuple[float, ...]) -> np.ndarray:
    """The pose of a posture near the start that keeps limits and constraints."""
    for size in (30.0, 15.0, 5.0, 0.0):
        posture = START + np.concatenate([np.zeros(3), size * np.array(shares)])
        posture = np.clip(posture, CHAIN.minima + 2.0, CHAIN.maxima - 2.0)
        if not CHAIN.violations(posture):
            break
    return vector_of(CHAIN.pose(posture))


@settings(max_examples=12)
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 7).map(target_near))
def test_a_pose_within_reach_is_reached(target):
    """Within 2 mm and 1 deg at a tolerance of 1 mm; the motion is reported at both ends; the torso does not move."""
    rig = Rig()
    rig.controller.set_tolerance(0.001)
    rig.controller.go_to(target, 1.0)
    assert not rig.controller.motion_done()
    rig.run(3.0)
    assert rig.controller.motion_done()
    distance, angle = rig.error(target)
    assert distance <= 0.002
    assert angle <= 1.0
    assert rig.names == ["motion-onset", "motion-done"]
    assert not rig.board.encoders()[:3].any()
    assert set(rig.board.control_modes(range(3, 10))) == {ControlMode.POSITION_DIRECT}
    assert set(rig.board.control_modes(range(3))) == {ControlMode.POSITION}


def test_checkpoints_are_reported_on_the_way():
    """Each once, in their order, before the end; one at the very end, too."""
    rig = Rig()
    for share in (0.7, 0.2, 1.0):
        rig.controller.add_checkpoint(share)
    with pytest.raises(RefusedError, match=r"0 to 1, not 1\.5"):
        rig.controller.add_checkpoint(1.5)
    rig.controller.go_to(target_near((0.5,) * 7), 1.0)
    rig.run(2.0)
    assert rig.names == ["motion-onset", *["motion-ongoing"] * 3, "motion-done"]
    assert [event.checkpoint for event in rig.events[1:4]] == [0.2, 0.7, 1.0]
    assert sorted(event.time for event in rig.events[1:]) == [event.time for event in rig.events[1:]]
    rig.controller.remove_checkpoint(0.2)
    with pytest.raises(RefusedError, match=r"no checkpoint at 0\.2"):
        rig.controller.remove_checkpoint(0.2)


def test_a_target_out_of_reach_has_an_end_and_is_reported():
    """At the nearest pose: the solution is another one than the target."""
    rig = Rig()
    rig.controller.go_to([-1.5, -0.1, 0.1], 1.0)
    rig.run(2.5)
    assert rig.controller.motion_done()
    assert np.linalg.norm(rig.controller.desired().pose[:3] - [-1.5, -0.1, 0.1]) > 0.5
    assert rig.error(rig.controller.desired().pose)[0] < 0.01
    rig.controller.go_to([-1.5, -0.1, 0.1], 1.0)  # the same again ends, too
    rig.run(0.5)
    assert rig.controller.motion_done()


def test_a_question_moves_nothing():
    """The answer has the pose and all joints; a start has the active ones only."""
    rig = Rig()
    target = target_near((0.4,) * 7)
    found = rig.controller.ask(target)
    assert found.joints.size == len(CHAIN)
    assert found.pose == pytest.approx(target, abs=2e-3)
    assert rig.controller.ask(target, START[3:]).joints == pytest.approx(found.joints)
    with pytest.raises(RefusedError, match="7 joints are active"):
        rig.controller.ask(target, START)
    rig.run(0.1)
    assert rig.events == []
    assert rig.board.encoders() == pytest.approx(START)


def test_stop_holds_the_joints():
    """Where they are, with an event; one more stop is none."""
    rig = Rig()
    rig.controller.go_to(target_near((0.8,) * 7), 2.0)
    rig.run(0.8)
    assert np.abs(rig.controller.joint_velocities()).max() > 1.0
    assert np.linalg.norm(rig.controller.task_velocity()[:3]) > 0.01
    rig.controller.stop()
    where = rig.board.encoders()
    rig.controller.stop()
    rig.run(0.3)
    assert rig.names == ["motion-onset", "motion-done"]
    assert rig.board.encoders() == pytest.approx(where)
    assert not rig.controller.joint_velocities().any()


@pytest.mark.parametrize(
    "begin",
    [
        lambda controller: controller.go_to(target_near((0.5,) * 7), 1.0),
        lambda controller: controller.stream_velocity([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0]),
    ],
    ids=["target", "velocity"],
)
def test_a_stop_does_not_wait_for_a_motion(begin):
    """While a board does not answer: the stop returns, and the motion that was asked for before does not begin."""
    rig = Rig()
    asked, answered = threading.Event(), threading.Event()
    modes = rig.board.control_modes

    def late(joints: object = None) -> tuple[ControlMode, ...]:
        asked.set()
        answered.wait(20)
        return modes(joints)

    rig.board.control_modes = late
    with ThreadPoolExecutor(1) as pool:
        going = pool.submit(begin, rig.controller)
        asked.wait(20)
        rig.controller.stop()
        answered.set()
        with pytest.raises(RefusedError, match="it was stopped before the motion began"):
            going.result(20)
    rig.run(0.2)
    assert rig.events == []
    assert rig.board.encoders() == pytest.approx(START)


def test_a_joint_in_fault_ends_the_motion():
    """Within ten periods, with its name; and keeps the next one from beginning."""
    rig = Rig()
    rig.controller.go_to(target_near((0.8,) * 7), 2.0)
    rig.run(0.5)
    rig.board.set_control_modes(ControlMode.IDLE, 6)
    with pytest.raises(RefusedError, match="the motion was ended: l_elbow is in mode IDLE"):
        rig.run(0.2)
    where = rig.board.encoders()
    rig.run(0.2)
    assert rig.names == ["motion-onset", "motion-done"]
    assert rig.board.encoders() == pytest.approx(where)
    with pytest.raises(RefusedError, match="l_elbow is in mode IDLE: the chain is not moved"):
        rig.controller.go_to(target_near((0.1,) * 7))


def test_a_streamed_velocity_moves_the_tip():
    """At its speed and in its direction, until a velocity of 0."""
    rig = Rig()
    rig.controller.set_trajectory_time(0.3)
    rig.controller.set_tolerance(0.001)
    before = rig.controller.pose().vector
    rig.controller.stream_velocity([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0])
    rig.run(2.0)
    assert not rig.controller.motion_done()
    rig.controller.stream_velocity([0.0] * 7)
    rig.run(1.5)
    way = rig.controller.pose().vector[:3] - before[:3]
    assert way == pytest.approx([0.0, 0.0, 0.1], abs=0.004)
    assert rig.controller.motion_done()
    with pytest.raises(RefusedError, match="a velocity has seven numbers"):
        rig.controller.stream_velocity([0.1, 0.2])


def test_a_velocity_that_is_taken_back_at_once_moves_nothing():
    """The motion is done, although it never began."""
    rig = Rig()
    rig.controller.stream_velocity([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0])
    assert not rig.controller.motion_done()
    rig.controller.stream_velocity([0.0] * 7)
    assert rig.controller.motion_done()
    rig.run(0.1)
    assert rig.events == []


def test_tracking_keeps_the_pose_while_the_torso_moves():
    """The arm makes up for it; without tracking the hand goes along."""
    target = target_near((0.3,) * 7)
    for tracking in (True, False):
        rig = Rig()
        rig.controller.set_tracking(tracking)
        rig.controller.go_to(target, 0.5)
        rig.run(1.5)
        rig.board.set_control_modes(ControlMode.POSITION_DIRECT, 2)
        for _ in range(100):
            rig.board.set_positions(rig.board.encoder(2) + 0.1, 2)
            rig.run(0.01)
        rig.run(1.5)
        assert bool(rig.error(target)[0] < 0.01) is tracking


def test_joints_are_chosen():
    """The shoulder only together; what is missing stays; a motion is stopped, and other joints stand still."""
    rig = Rig()
    rig.controller.go_to(target_near((0.5,) * 7), 1.0)
    rig.run(0.1)
    assert rig.controller.set_active_joints([True, None, True]) == (True, False, True, *[True] * 7)
    assert rig.names == ["motion-onset", "motion-done"]
    assert rig.controller.set_active_joints([False] * 4)[3:6] == (True,) * 3
    with pytest.raises(RefusedError, match="has 10 joints, not 11"):
        rig.controller.set_active_joints([True] * 11)
    rig.controller.set_active_joints([False] * 10)
    with pytest.raises(RefusedError, match="no joint is active"):
        rig.controller.go_to(target_near((0.5,) * 7))


def test_a_tool_is_what_is_moved():
    """Its pose is that of the tip; it is taken off again."""
    rig = Rig()
    hand = rig.controller.pose().vector
    rig.controller.set_tip([0.1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    tool = rig.controller.pose().vector
    assert np.linalg.norm(tool[:3] - hand[:3]) == pytest.approx(0.1)
    rig.controller.go_to(tool[:3] + np.array([0.0, 0.0, 0.05]), 0.5)
    rig.run(1.5)
    assert rig.controller.pose().vector[:3] == pytest.approx(tool[:3] + np.array([0.0, 0.0, 0.05]), abs=0.01)
    rig.controller.set_tip([0.0] * 7)
    assert rig.controller.tip().tolist() == [0, 0, 0, 0, 0, 1, 0]


def test_settings_and_contexts():
    """What is stored comes back; the first is number 0; values are those that the robot can have."""
    rig = Rig()
    arm = rig.controller
    arm.set_trajectory_time(0.001)
    assert arm.trajectory_time() == pytest.approx(0.1)
    assert arm.set_rest_posture([500.0, 3.0])[:2].tolist() == [CHAIN.maxima[0], 3.0]
    assert arm.set_rest_weights([-1.0, 2.0])[:3].tolist() == [0.0, 2.0, 0.0]
    arm.set_limits(0, 0.0, 0.0)
    assert arm.limits(0) == (0.0, 0.0)
    with pytest.raises(RefusedError, match="limits of torso_pitch lie within"):
        arm.set_limits(0, -500.0, 0.0)
    with pytest.raises(RefusedError, match="joints 0 to 9, not 10"):
        arm.limits(10)
    arm.set_priority("orientation")
    arm.set_tweaks(Bottle.parse("(straightness 0.2)"))
    assert arm.tweaks() == Bottle.parse("(straightness 0.2)")
    for wrong in ("(speed 1)", "(straightness)", "straightness 0.2"):
        with pytest.raises(RefusedError, match="a tweak is"):
            arm.set_tweaks(Bottle.parse(wrong))
    context = arm.store_context()
    arm.restore_context(0)
    assert (arm.trajectory_time(), arm.priority(), arm.limits(0)[0]) == (2.0, "position", CHAIN.minima[0])
    arm.restore_context(context)
    assert (arm.trajectory_time(), arm.priority(), arm.limits(0)) == (pytest.approx(0.1), "orientation", (0.0, 0.0))
    arm.delete_contexts([context, 0, 77])
    arm.restore_context(0)
    with pytest.raises(RefusedError, match=f"there is no context {context}"):
        arm.restore_context(context)


@pytest.mark.parametrize("target", [[0.0, 1.0], [float("nan"), 0.0, 0.0], [0, 0, 0, 0, 0, 0, 1]])
def test_targets_that_are_none_are_refused(target):
    """Nothing moves, and the controller goes on."""
    rig = Rig()
    with pytest.raises(RefusedError):
        rig.controller.go_to(target)
    assert rig.controller.motion_done()
    assert rig.events == []
