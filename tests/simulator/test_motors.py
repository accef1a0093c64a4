"""The motors of the simulated robot: windings, amplifiers, gears, and what their sensors show."""

from __future__ import annotations

import math
from importlib.util import find_spec

import numpy as np
import pytest

from icub import AXES, INDEX
from rtf.robot.control_modes import ControlMode
from rtf.simulator.motors import Windings

from .rig import Rig

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

PROSUP, ELBOW, FINGER, KNEE = "l_wrist_prosup", "l_elbow", "l_index_proximal", "l_knee"
ALL = np.arange(len(AXES))


@pytest.fixture
def rig() -> Rig:
    """A robot at home."""
    return Rig()


def spinning(*, friction: bool = True) -> Rig:
    """A robot without weight whose joints turn without end, so that motors reach their speeds."""
    options = {} if friction else {"frictionless": True}
    rig = Rig(collision="none", **options)
    rig.model.opt.gravity[:] = 0.0
    rig.model.jnt_limited[:] = 0
    rig.model.tendon_limited[:] = 0
    return rig


def drive(axis: str):
    """The drive of a joint."""
    return AXES[INDEX[axis]].drive


def driven(rig: Rig, axis: str, duty: float, seconds: float) -> None:
    """Drive a motor by a duty cycle for some time, which is commanded again and again."""
    rig.enter(axis, ControlMode.PWM)
    for _ in range(round(seconds / 0.25)):
        rig.say(rig.boards.drive, axis, duty)
        rig.run(0.25)


@pytest.mark.parametrize("axis", [PROSUP, "neck_yaw"])
@pytest.mark.parametrize("duty", [20.0, -20.0])
def test_a_motor_turns_as_fast_as_its_losses_allow(axis: str, duty: float):
    """In the end the torque of the remaining current is that of friction and damping, at a speed that follows."""
    rig, one, index = spinning(), drive(axis), INDEX[axis]
    for other in range(len(AXES)):
        if other != index:
            rig.boards.request_mode(other, ControlMode.POSITION)
    driven(rig, axis, duty, 1.0)
    speed = float(rig.data.actuator_velocity[index]) * math.copysign(1.0, one.turns)
    volts, constant = duty / 100.0 * one.supply, abs(one.output_constant)
    damping = float(rig.model.dof_damping[rig.simulation.plant.dofs[index][0]])
    dry = math.copysign(AXES[index].friction, duty)
    # constant (volts - constant speed) / resistance = dry + damping speed
    expected = (constant * volts / one.resistance - dry) / (constant**2 / one.resistance + damping)
    assert speed == pytest.approx(expected, rel=0.01)
    assert rig.boards.motors.current[index] == pytest.approx((volts - constant * speed) / one.resistance, rel=0.01)
    assert abs(speed) < abs(volts) / constant


def test_the_current_falls_with_the_speed():
    """While a voltage accelerates a motor, its current goes from that of a blocked one to a small rest."""
    rig, index = spinning(friction=False), INDEX[PROSUP]
    rig.enter(PROSUP, ControlMode.PWM)
    rig.say(rig.boards.drive, PROSUP, 30.0)
    currents, speeds = [], []
    for _ in range(40):
        rig.run(0.008)
        currents.append(rig.boards.motors.current[index])
        speeds.append(abs(rig.boards.motor_motion()[1][index]))
    assert currents[0] > 0.5 * 0.3 * AXES[index].peak_current
    assert currents[-1] < 0.1 * currents[0]
    assert (np.diff(currents) < 0.005).all()  # other joints jitter by the steps of their speeds
    assert (np.diff(speeds) > -110.0).all()  # three counts of its encoder


def test_a_blocked_motor_has_the_current_of_its_resistance(rig: Rig):
    """And its joint the torque of that current, whatever feeds it."""
    for axis in (PROSUP, KNEE):
        index, one = INDEX[axis], drive(axis)
        rig.model.dof_frictionloss[rig.simulation.plant.dofs[index]] = 1000.0
        rig.enter(axis, ControlMode.PWM)
        rig.say(rig.boards.drive, axis, 40.0)
        rig.run(0.1)
        assert rig.boards.motors.current[index] == pytest.approx(0.4 * one.supply / one.resistance, rel=1e-3)
        torque = 0.4 * one.supply / one.resistance * one.output_constant
        assert rig.data.actuator_force[index] == pytest.approx(torque, rel=1e-3)


@pytest.mark.parametrize("axis", [ELBOW, PROSUP, "torso_roll", "eyes_version"])
def test_electrical_power_is_heat_and_mechanical_power(axis: str):
    """What all motors draw is what their windings lose and what turns the axes, however these are coupled."""
    rig = Rig()
    motors, resistance = rig.boards.motors, np.array([one.drive.resistance for one in AXES])
    rig.boards.speeds[INDEX[axis]] = 60.0
    rig.say(rig.boards.move, axis, AXES[INDEX[axis]].minimum)
    for _ in range(20):
        rig.run(0.02)
        speeds = motors._turning.copy()
        duties, currents = rig.boards.motor_duties(), motors.current
        drawn = duties / 100.0 * motors.supply * currents
        work = float(rig.data.ctrl @ speeds)
        assert drawn.sum() == pytest.approx((resistance * currents**2).sum() + work, rel=1e-9)


def test_every_motor_turns_its_encoder_upwards_with_a_positive_current():
    """And brakes itself: the voltage that it induces has the sign of its speed."""
    rig = spinning()
    motors = rig.boards.motors
    turns = rig.boards._turns
    for axis in ALL.tolist():
        currents = np.zeros(len(AXES))
        currents[axis] = 1.0
        torques = motors._to_torques @ currents
        assert torques @ turns[axis] > 0, AXES[axis].name  # the torques of a positive current do work on its rotor
        induced = motors._to_voltages @ turns[axis]
        assert induced[axis] > 0, AXES[axis].name


def test_currents_stay_within_their_limits(rig: Rig):
    """A controlled one within its peak current, any within what the supply and the limit of the duty cycle drive."""
    boards, index = rig.boards, INDEX[ELBOW]
    rig.model.dof_frictionloss[rig.simulation.plant.dofs[index]] = 1000.0
    rig.say(boards.move, ELBOW, 100.0)
    rig.run(1.0)
    assert abs(boards.motors.current[index]) == pytest.approx(AXES[index].peak_current, rel=1e-3)
    boards.peak_current[index] = 2.0
    boards.configure(index)
    rig.run(0.01)
    assert abs(boards.motors.current[index]) == pytest.approx(2.0)
    boards.peak_current[index], boards.duty_limit[index] = 100.0, 20.0
    boards.configure(index)
    rig.run(0.01)
    assert abs(boards.motors.current[index]) == pytest.approx(
        0.2 * drive(ELBOW).supply / drive(ELBOW).resistance, rel=1e-3
    )
    assert abs(boards.motor_duties()[index]) == pytest.approx(20.0)


def test_a_motor_that_is_turned_too_fast_brakes():
    """Beyond the speed at which it induces the voltage of its supply, it generates, although it has no power."""
    rig, index = spinning(friction=False), INDEX[ELBOW]
    rig.enter(ELBOW, ControlMode.IDLE)
    free = drive(ELBOW).supply / drive(ELBOW).output_constant  # rad/s
    dof = int(rig.simulation.plant.dofs[index][0])
    rig.data.qvel[dof] = 0.5 * free
    rig.run(0.004)
    assert rig.boards.motors.current[index] == 0.0
    rig.data.qvel[dof] = 2.0 * free
    rig.run(0.008)
    assert rig.boards.motors.current[index] < 0.0
    assert abs(rig.data.qvel[dof]) < 2.0 * free


def test_an_amplifier_whose_motor_is_cut_off_gives_its_whole_duty_cycle(rig: Rig):
    """As it controls a current that cannot flow; one that sets a voltage shows what its controller wants."""
    rig.run(0.2)
    cut = [INDEX[KNEE], INDEX["neck_pitch"]]

    def change(windings: Windings) -> None:
        windings.conductances[cut] = 0.0

    wanted = rig.boards.motor_duties()[cut]
    rig.boards.motors.faults.append(change)
    rig.boards.motors.refresh()
    rig.run(0.001)
    assert rig.boards.motors.current[cut].tolist() == [0.0, 0.0]
    knee, neck = rig.boards.motor_duties()[cut]
    assert knee == 100.0 * np.sign(wanted[0])
    assert neck == pytest.approx(wanted[1], abs=1.0)


def test_an_amplifier_that_controls_its_current_shows_the_resistance_of_the_circuit(rig: Rig):
    """A burnt contact of twice the winding: the knee is held by the same current, which needs three times the duty."""
    rig.run(0.5)
    index, motors = INDEX[KNEE], rig.boards.motors
    current, before = motors.current[index], rig.boards.motor_duties()[index]
    assert abs(before) > 0.5

    def change(windings: Windings) -> None:
        windings.conductances[index] /= 3.0

    motors.faults.append(change)
    motors.refresh()
    rig.run(0.1)
    assert motors.current[index] == pytest.approx(current, rel=0.05)
    assert rig.boards.motor_duties()[index] == pytest.approx(3.0 * before, rel=0.05)


def test_what_sensors_show_of_a_current(rig: Rig):
    """The current with noise of half a per cent of the peak, in whole steps; the same whoever asks, and how often."""
    rig.run(0.3)
    shown, true, index = [], [], INDEX["l_shoulder_pitch"]
    for _ in range(400):
        rig.run(0.001)
        shown.append(rig.boards.motor_currents()[index])
        assert rig.boards.motor_currents()[index] == shown[-1]
        true.append(rig.boards.motors.current[index])
    steps = np.array(shown) / 0.001
    assert steps == pytest.approx(np.rint(steps), abs=1e-6)
    assert np.std(np.array(shown) - true) == pytest.approx(0.005 * AXES[index].peak_current, rel=0.2)
    again, other = Rig(), Rig()
    other.boards.motors._noise[:] = 0.0
    for one in (again, other):
        one.run(0.7)
    assert again.boards.motor_currents()[index] == shown[-1]
    assert other.boards.motor_currents()[index] != shown[-1]


def test_a_free_arm_follows_fast_moves():
    """At 60 deg/s all joints of an arm stay within a degree, those whose motors brake by themselves, too."""
    rig = Rig(collision="none")
    rig.run(0.2)
    own = [INDEX[name] for name in INDEX if name.startswith("l_") and AXES[INDEX[name]].part == "left_arm"]
    rig.boards.speeds[own] = 60.0
    targets = np.array([min(AXES[axis].home + 30.0, AXES[axis].maximum) for axis in own])
    rig.boards.move(np.array(own), targets)
    most = 0.0
    for _ in range(60):
        rig.run(0.01)
        most = max(most, float(np.abs(rig.boards.error[own]).max()))
    assert most < 1.0
    rig.run(0.3)
    assert rig.boards.position[own] == pytest.approx(targets, abs=0.3)
