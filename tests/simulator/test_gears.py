"""Gears with play and elasticity: rotor and joint are two bodies, and what goes between them is physics."""

from __future__ import annotations

from functools import cache, partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest

from icub import AXES, INDEX, build_icub
from rtf.robot.control_modes import ControlMode
from rtf.robot.model.engine import mujoco
from rtf.robot.model.errors import RobotModelError
from rtf.simulator.plant import Options
from rtf.simulator.simulation import Simulation

from .rig import Rig, with_axes

if TYPE_CHECKING:
    from rtf.simulator.gears import GearProperties, Gears
    from rtf.simulator.plant import Plant

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

#: The first joint above the fixed root: whatever the others do, nothing but its gear changes its momentum.
ROOT = "torso_pitch"
DEGREE = np.radians(1.0)


def loosen(gears: GearProperties, *, axis: int, play: float, twist: float) -> None:
    """Give a gear a play (deg), and a twist by the greatest torque of its motor (deg)."""
    gears.play[axis] += play * DEGREE
    gears.compliance[axis] += twist * DEGREE / AXES[axis].max_torque


class Floating(Rig):
    """A robot without weight, friction and power, whose root joint has a gear."""

    def __init__(self, play: float = 0.0, twist: float = 0.0) -> None:
        super().__init__(frictionless=True, collision="none")
        self.model.opt.gravity[:] = 0.0
        for axis in AXES:
            self.enter(axis.name, ControlMode.IDLE)
        self.axis = INDEX[ROOT]
        self.dof = int(self.simulation.plant.dofs[self.axis][0])
        self.gears.faults.append(partial(loosen, axis=self.axis, play=play, twist=twist))
        self.gears.refresh()
        self.rotor = float(self.gears._rotors[self.axis]) * 0.9  # kg m², as a tenth turns with the joint
        self.joint = float(self.simulation.plant.axis_inertia(self.simulation.plant.data())[self.axis])

    @property
    def gears(self) -> Gears:
        """The gears of its boards."""
        return self.boards.motors.gears

    def throw_rotor(self, speed: float) -> None:
        """Give the rotor a speed (deg/s of the joint)."""
        self.gears._speed[self.axis] = speed * DEGREE

    @property
    def lead(self) -> float:
        """How far the rotor is ahead of the joint (deg)."""
        return float(self.gears.angles()[self.axis] - self.data.actuator_length[self.axis]) / DEGREE

    @property
    def speeds(self) -> tuple[float, float]:
        """Those of rotor and joint (deg/s)."""
        return (
            float(self.gears.speeds()[self.axis]) / DEGREE,
            float(self.data.actuator_velocity[self.axis]) / DEGREE,
        )


def test_an_open_play_transmits_nothing():
    """The joint stays to the last bit until the rotor has passed half the play, and is hit then."""
    rig = Floating(play=2.0)
    rig.throw_rotor(10.0)
    rig.run(0.09)
    assert rig.lead == pytest.approx(0.9, abs=0.01)
    assert rig.speeds[1] == 0.0
    rig.run(0.03)
    assert rig.speeds[1] > 0.1


@pytest.mark.parametrize(("play", "twist"), [(2.0, 0.0), (0.0, 2.0), (2.0, 2.0)])
def test_what_a_rotor_loses_its_joint_gets(play: float, twist: float):
    """The momentum of both together stays, whatever goes on between them, and the energy never grows."""
    rig = Floating(play, twist)
    rig.throw_rotor(30.0)
    before, energy = rig.rotor * 30.0 * DEGREE, np.inf
    for _ in range(300):
        rig.run(0.001)
        rotor, _ = rig.speeds
        mass = full_mass(rig)
        momentum = rig.rotor * rotor * DEGREE + float(mass[rig.dof] @ rig.data.qvel)
        assert momentum == pytest.approx(before, rel=0.03)
        spring = float(rig.gears._stiffness[0]) * max(0.0, abs(rig.lead * DEGREE) - play * DEGREE / 2) ** 2
        total = (rig.rotor * (rotor * DEGREE) ** 2 + rig.data.qvel @ mass @ rig.data.qvel + spring) / 2
        assert total < 1.02 * min(energy, rig.rotor * (30.0 * DEGREE) ** 2 / 2)
        energy = total
    assert energy < 0.9 * rig.rotor * (30.0 * DEGREE) ** 2 / 2


def full_mass(rig: Rig) -> np.ndarray:
    """Return the mass matrix of all joints at their positions now."""
    data = rig.simulation.plant.data()
    data.qpos[:] = rig.data.qpos
    mujoco().mj_forward(rig.model, data)
    inverse = np.empty((rig.model.nv, rig.model.nv))
    mujoco().mj_solveM(rig.model, data, inverse, np.eye(rig.model.nv))
    return np.linalg.inv(inverse)


def test_an_elastic_gear_swings_as_two_bodies_on_a_spring():
    """Rotor and joint swing against each other with the frequency that their inertias and the spring give."""
    rig = Floating(twist=2.0)
    rig.throw_rotor(10.0)
    leads = []
    for _ in range(400):
        rig.run(0.001)
        leads.append(rig.lead)
    crossings = np.flatnonzero(np.diff(np.sign(leads)))
    period = 2e-3 * float(crossings[4] - crossings[0]) / 4
    expected = 2 * np.pi / np.sqrt(float(rig.gears._stiffness[0]) * (1 / rig.rotor + 1 / rig.joint))
    assert period == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize("torque", [5.0, -5.0])
def test_a_torque_closes_the_play_and_twists_the_gear(torque: float):
    """A motor works against a push: it leads by half the play and by what the torque twists, and the joint gets it."""
    rig = Floating(play=2.0, twist=1.0)
    rig.enter(ROOT, ControlMode.TORQUE)
    rig.push(ROOT, -torque / float(rig.simulation.plant.jacobian[rig.axis, rig.dof]))
    for _ in range(20):
        rig.say(rig.boards.exert, ROOT, torque)
        rig.run(0.1)
    twist = torque / AXES[rig.axis].max_torque
    assert rig.lead == pytest.approx(np.sign(torque) + twist, rel=0.02)
    assert rig.torque(ROOT) == pytest.approx(torque, rel=0.02)


@cache
def loose() -> Plant:
    """A robot all of whose gears have play and bend."""
    return with_axes(build_icub(Options(collision="none")), play=1.0, stiffness=300.0)


def test_no_gear_becomes_unstable():
    """All gears at once, with the least stiffness that is no defect, on a robot that falls together: bounded motion."""
    simulation = Simulation(loose())
    for axis in range(len(AXES)):
        simulation.boards.request_mode(axis, ControlMode.IDLE)
    for _ in range(10):
        simulation.advance(simulation.now + 0.2)
        gears = simulation.boards.motors.gears
        apart = np.abs(gears.angles() - simulation.data.actuator_length)
        assert np.abs(simulation.data.actuator_velocity).max() < 60.0
        assert apart.max() < 3.0 * DEGREE
    assert not any(warning.number for warning in simulation.data.warning)


def test_play_of_a_robot_file_is_held_from_the_start():
    """The rotors start where they hold their joints: nothing falls through its play at the first step."""
    simulation = Simulation(loose())
    start = simulation.data.actuator_length.copy()
    simulation.advance(0.02)
    assert np.abs(simulation.data.actuator_length - start).max() < 0.2 * DEGREE


def test_a_gear_without_a_rotor_is_refused():
    """A rotor without inertia cannot have a side of its own; the message says what to write."""
    plant = build_icub(Options(collision="none"))
    plant.model.dof_armature[:] = 0.0
    with pytest.raises(RobotModelError, match=r"neck_pitch has play or a stiffness, so it needs an armature"):
        Simulation(with_axes(plant, play=1.0, armature=None))


def test_a_gear_that_is_repaired_leaves_nothing():
    """With play for a while, the model is the same to the last bit afterwards, and rotors are not asked any more."""
    rig = Rig(collision="none")
    gears, before = rig.boards.motors.gears, rig.model.dof_armature.copy()
    gears.faults.append(partial(loosen, axis=INDEX["l_elbow"], play=1.0, twist=0.1))
    gears.refresh()
    assert (rig.model.dof_armature != before).any()
    rig.run(0.1)
    assert not np.array_equal(gears.angles(), rig.data.actuator_length)
    gears.faults.clear()
    gears.refresh()
    assert np.array_equal(rig.model.dof_armature, before)
    assert np.array_equal(gears.angles(), rig.data.actuator_length)
