"""The dry friction of joints: a joint at rest stays at rest, a moving one is braked, and none is pushed."""

from __future__ import annotations

import copy
import dataclasses
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from icub import INDEX, build_icub
from rtf.robot.model.engine import mujoco
from rtf.simulator.friction import DryFriction
from rtf.simulator.plant import Options

from .rig import with_axes

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.simulator.plant import Plant

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

ELBOW, FINGER = INDEX["l_elbow"], INDEX["l_index_proximal"]


@cache
def built() -> Plant:
    """A robot with dry friction alone to brake it, to be copied."""
    return with_axes(build_icub(Options(damping=False, collision="none")), stribeck=0.0)


class Joint:
    """One joint of a robot that is free from gravity; ``engine``: with the engine's friction instead of ours.

    ``stribeck`` is what friction at rest has more, a share.
    """

    def __init__(self, axis: int, *, engine: bool = False, stribeck: float = 0.0) -> None:
        robot = dataclasses.replace(built(), model=copy.copy(built().model))
        robot = with_axes(robot, stribeck=stribeck)
        self.rubbed = 0.0  # Nm, by the friction in the last step
        robot.model.opt.gravity[:] = 0.0
        self.model, self.data = robot.model, robot.data()
        self.axis, self.dof = axis, int(robot.dofs[axis][0])
        self.ratio = float(robot.jacobian[axis, self.dof])
        self.most = float(robot.friction[self.dof])
        friction = None if engine else DryFriction(robot, self.data)
        self._rub: Callable[[], None] = (lambda: None) if friction is None else friction.step
        self.data.qpos[self.dof] = np.radians(45.0)  # away from its limits
        mujoco().mj_forward(self.model, self.data)
        if friction is not None:
            friction.reset()

    def run(self, seconds: float, torque: float = 0.0, drive: Callable[[int], float] = lambda _: 0.0) -> None:
        """Simulate with an external torque at the hinge and one of the drive, which may change each step."""
        for number in range(round(seconds / self.model.opt.timestep)):
            mujoco().mj_step1(self.model, self.data)
            self.data.qfrc_applied[self.dof] = torque
            self.data.ctrl[self.axis] = drive(number) / self.ratio
            before = float(self.data.qfrc_passive[self.dof])
            self._rub()
            self.rubbed = float(self.data.qfrc_passive[self.dof]) - before
            mujoco().mj_step2(self.model, self.data)

    @property
    def at(self) -> float:
        """Where it is (deg)."""
        return float(np.degrees(self.data.qpos[self.dof]))

    @property
    def speed(self) -> float:
        """How fast it is (deg/s)."""
        return float(np.degrees(self.data.qvel[self.dof]))

    def throw(self, speed: float) -> None:
        """Set its speed (deg/s)."""
        self.data.qvel[self.dof] = np.radians(speed)


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
@pytest.mark.parametrize("share", [-0.95, 0.5, 0.95])
def test_what_is_pushed_by_less_than_the_friction_stays(axis: int, share: float):
    """It moves by less than a tenth of a degree, once, and does not creep."""
    joint = Joint(axis)
    begin = joint.at
    joint.run(1.0, share * joint.most)
    there = joint.at
    assert 0 < abs(there - begin) < 0.1
    joint.run(5.0, share * joint.most)
    assert joint.at == pytest.approx(there, abs=1e-6)


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
@pytest.mark.parametrize("drive", [lambda number: (-0.9, 0.9)[number % 2], lambda number: 0.99 * number / 1000])
def test_what_is_driven_by_less_than_the_friction_does_not_move_at_all(axis: int, drive: Callable[[int], float]):
    """However the torque of the drive changes, no encoder counts."""
    joint = Joint(axis)
    begin = joint.at
    joint.run(1.0, drive=lambda number: drive(number) * joint.most)
    assert joint.at == pytest.approx(begin, abs=1e-6)
    assert joint.speed == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("engine", [False, True])
@pytest.mark.parametrize("axis", [ELBOW, FINGER])
def test_a_drive_that_grows_moves_it_beyond_the_friction(axis: int, engine: bool):
    """Not before, and soon after, as with the friction of the engine."""
    joint = Joint(axis, engine=engine)
    begin = joint.at
    joint.run(1.0, drive=lambda number: 0.98 * joint.most * number / 1000)
    assert joint.at == pytest.approx(begin, abs=1e-3)
    joint.run(0.5, drive=lambda number: (0.98 + number / 1000) * joint.most)
    assert joint.at > begin + 0.1


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
@pytest.mark.parametrize("share", [1.1, 2.0, -3.0])
def test_what_is_pushed_by_more_moves_as_with_the_engines_own(axis: int, share: float):
    """The friction is taken from the torque, to either side; how it begins to slide may differ."""
    gained = []
    for joint in (Joint(axis), Joint(axis, engine=True)):
        joint.run(0.02, share * joint.most)
        before = joint.speed
        joint.run(0.05, share * joint.most)
        gained.append(joint.speed - before)
    assert abs(gained[1]) > 1.0
    assert gained[0] == pytest.approx(gained[1], rel=0.05)


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
def test_what_is_thrown_comes_to_rest_as_with_the_engines_own(axis: int):
    """It comes to rest after the same way, and stays there."""
    ours, theirs = Joint(axis), Joint(axis, engine=True)
    ways = []
    for joint in (ours, theirs):
        begin = joint.at
        joint.throw(60.0)
        joint.run(0.5)
        ways.append(joint.at - begin)
        assert joint.speed == pytest.approx(0.0, abs=0.05)
    assert ways[1] > 1.0
    assert ways[0] == pytest.approx(ways[1], rel=0.03)


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
def test_what_is_stopped_is_not_pushed_on(axis: int):
    """Friction does not press a joint against the stop that has ended its motion."""
    joint = Joint(axis)
    joint.throw(150.0)
    joint.run(0.02)
    joint.data.qvel[:] = 0.0
    there = joint.at
    joint.run(0.5)
    assert there - 0.03 < joint.at < there + 0.001


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
def test_friction_is_greatest_at_rest(axis: int):
    """With half as much again at rest, it bears 1.45 times the dry friction, and not 1.55 times."""
    joint = Joint(axis, stribeck=0.5)
    begin = joint.at
    for share in np.linspace(0.0, 1.45, 200):
        joint.run(0.005, share * joint.most)
    assert abs(joint.at - begin) < 0.3
    joint.run(0.3, 1.55 * joint.most)
    assert joint.at > begin + 1.0


@pytest.mark.parametrize("speed", [0.2, 3.0, 60.0])
def test_friction_falls_with_the_speed(speed: float):
    """By the form of Hess and Soom: half of what it has more is left at 3 deg/s, nearly nothing at 60."""
    joint = Joint(ELBOW, stribeck=0.5)
    joint.throw(60.0)
    joint.run(0.02)
    for _ in range(20 + round(200 / speed)):  # a fifth of a degree, as the spring has to be stretched anew
        joint.throw(speed)
        joint.run(0.001, -joint.rubbed)
    wanted = joint.most * (1 + 0.5 / (1 + (speed / 3.0) ** 2))
    assert -joint.rubbed == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("axis", [ELBOW, FINGER])
def test_friction_gives_no_energy(axis: int):
    """However the joint is driven, what its friction gives in all is no more than its spring can hold."""
    joint = Joint(axis, stribeck=0.5)
    random = np.random.default_rng(1)
    given = most = 0.0
    for _ in range(60):
        torque, before = float(random.uniform(-3, 3)) * joint.most, joint.data.qpos[joint.dof]
        for _ in range(20):
            joint.run(0.001, torque)
            given += joint.rubbed * float(joint.data.qpos[joint.dof] - before)
            before = joint.data.qpos[joint.dof]
            most = max(most, given)
    deflection = np.radians(0.3)  # the greatest one of the test above
    assert given < -10.0 * joint.most * deflection
    assert most <= 1.5 * joint.most * deflection / 2


@pytest.mark.parametrize(("stribeck", "sticks"), [(0.0, False), (0.5, True)])
def test_a_joint_that_is_pulled_slowly_sticks_and_slips(stribeck: float, sticks: bool):
    """Pulled by a soft spring at 2 deg/s: without more friction at rest it follows, with it it moves in jerks."""
    joint = Joint(ELBOW, stribeck=stribeck)
    begin, speeds = joint.at, []
    for number in range(3000):
        ahead, faster = begin + 2.0 * number / 1000 - joint.at, 2.0 - joint.speed
        joint.run(0.001, 20.0 * np.radians(ahead) + 0.1 * np.radians(faster))
        speeds.append(joint.speed)
    later = np.array(speeds[1500:])
    assert bool(np.mean(np.abs(later) < 0.1) > 0.3) is sticks
    assert bool(later.max() > 4.0) is sticks


def test_without_friction_nothing_is_added():
    """A robot that was built without has none."""
    robot = build_icub(Options(friction=False, collision="none"))
    data = robot.data()
    friction = DryFriction(robot, data)
    data.qvel[:] = 1.0
    mujoco().mj_step1(robot.model, data)
    before: Any = data.qfrc_passive.copy()
    friction.step()
    assert np.array_equal(data.qfrc_passive, before)


def test_what_faults_add_is_added():
    """A jam is the engine's, on top of the friction."""
    joint = Joint(ELBOW)
    joint.model.dof_frictionloss[joint.dof] += 5.0
    begin = joint.at
    joint.run(0.5, 4.0)
    assert joint.at == pytest.approx(begin, abs=0.01)
    joint.run(0.5, 10.0)
    assert joint.at > begin + 1.0
