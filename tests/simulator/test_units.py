"""The population of a robot: units that differ as robots of one series do."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

from rtf.robot.model import load_robot

pytestmark = pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")


def plant(unit: int):
    """The bench as a unit."""
    from rtf.simulator.plant import Options, build

    return build(load_robot("bench"), Options(unit=unit))


def simulated(unit: int):
    """A simulation of a unit."""
    from rtf.simulator.simulation import Simulation

    return Simulation(plant(unit))


def test_unit_0_is_the_nominal_robot():
    """All its factors are 1, and all its offsets 0."""
    from rtf.simulator.units import SPREADS, Unit

    for name in SPREADS:
        assert Unit().draw(name, 3).tolist() == [0.0, 0.0, 0.0]
        assert Unit().factors(name, 2, 1).tolist() == [[1.0], [1.0]]


def test_units_differ_within_the_spreads():
    """A number always draws the same unit; masses, inertias and frictions are those of the nominal robot, nearly."""
    nominal, one, again, other = plant(0), plant(1), plant(1), plant(2)
    moving = slice(1, None)  # the first body is the world
    for what, most in (
        ("body_mass", 0.05),
        ("body_inertia", 0.05),
        ("dof_armature", 0.05),
        ("dof_frictionloss", 0.3),
    ):
        usual, drawn = (np.asarray(getattr(each.model, what))[moving] for each in (nominal, one))
        ratios = drawn[usual > 0] / usual[usual > 0]
        assert np.all(np.abs(ratios - 1.0) <= most), what
        assert not np.any(ratios == 1.0), what
        assert np.array_equal(np.asarray(getattr(again.model, what))[moving], drawn)
        assert not np.array_equal(np.asarray(getattr(other.model, what))[moving], drawn)
    assert np.array_equal(one.inertia, nominal.inertia)  # for which the controllers are made


def test_the_motors_of_units_have_other_torque_constants():
    """By up to 8 %, which the boards do not know: as much less or more of torque, and of induced voltage."""
    nominal, unit = (simulated(number).boards.motors for number in (0, 1))
    ratios = np.diag(unit._to_torques) / np.diag(nominal._to_torques)
    assert np.all((np.abs(ratios - 1.0) <= 0.08) & (ratios != 1.0))
    assert np.diag(unit._to_voltages) / np.diag(nominal._to_voltages) == pytest.approx(ratios)
    currents = np.array([1.0, 2.0])
    assert unit.torques_of(currents).tolist() == nominal.torques_of(currents).tolist()


def test_a_unit_is_at_home_by_its_encoders():
    """The joints are up to 0.3 deg elsewhere, and the controllers, whose gains differ by up to 10 %, hold them."""
    nominal, unit = simulated(0), simulated(3)
    for simulation in (nominal, unit):
        simulation.advance(0.5)
        assert simulation.boards.position.tolist() == pytest.approx([0.0, 30.0], abs=0.01)
    shifts = np.degrees(unit.data.qpos - nominal.data.qpos)
    assert np.all(np.abs(shifts) <= 0.3 + 0.01)
    assert np.all(np.abs(shifts) > 0.01)
    gains = np.array([[(pid.kp, pid.kd, pid.ki) for pid in each.boards.pids] for each in (nominal, unit)])
    ratios = gains[1] / gains[0]
    assert np.all((ratios > 0.9) & (ratios < 1.1) & (ratios != 1.0))


def test_a_joint_at_its_limit_does_not_press_against_a_stop():
    """The stops leave room for the offset of the encoder, so it arrives and needs no more than its weight."""
    from rtf.simulator.part import SimulatedPart

    for unit in (1, 2):
        simulation = simulated(unit)
        boards, arm = simulation.boards, SimulatedPart("arm", simulation.boards)
        arm.set_reference_speeds([60.0, 60.0])
        arm.position_move(boards.maximum)
        simulation.advance(4.0)
        assert boards.position.tolist() == pytest.approx(boards.maximum.tolist(), abs=0.05)
        held = boards.plant.friction * [1 + axis.stribeck for axis in simulation.plant.robot.axes]
        assert np.all(np.abs(boards.output * boards.newton_metres - boards.gravity()) < held + 0.01)


def test_sensors_are_mounted_askew():
    """By up to half a degree about each axis: an inertial unit shows gravity in a slightly different direction."""
    shown = []
    for unit in (0, 1, 2):
        simulation = simulated(unit)
        simulation.advance(0.5)
        shown.append(simulation.data.sensordata[simulation.plant.imus[0].accelerometer].copy())
    for one in shown[1:]:
        cosine = one @ shown[0] / np.linalg.norm(one) / np.linalg.norm(shown[0])
        # The offsets of two encoders, which tilt the link, and the mounting about two axes.
        assert 0.0 < np.degrees(np.arccos(cosine)) < 2 * 0.3 + np.hypot(0.5, 0.5)
