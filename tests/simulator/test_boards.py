"""What the simulated motor boards do: modes, limits, faults, watchdogs, motors, and how exactly they move."""

from __future__ import annotations

import math
from importlib.util import find_spec

import numpy as np
import pytest

from icub import AXES, INDEX, PARTS, part_slice
from rtf.robot.control_modes import (
    POWERLESS,
    REQUESTS,
    STATES,
    USER_MODES,
    Answer,
    ControlMode,
    InteractionMode,
    answer,
)
from rtf.robot.devices.motor_board import ERROR_LIMIT, OVERCURRENT, OVERHEATED
from rtf.robot.errors import RefusedError
from rtf.robot.model.engine import mujoco
from rtf.simulator.boards import Boards
from rtf.simulator.motors import Windings

from .rig import Rig

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

ELBOW, SHOULDER, KNEE, NECK = "l_elbow", "l_shoulder_pitch", "l_knee", "neck_yaw"
ALL = np.arange(len(AXES))
#: The joints that carry weight and can be controlled by torque.
LIMBS = np.array([axis for axis in ALL if AXES[axis].part != "head" and AXES[axis].max_torque > 3.0])


@pytest.fixture
def rig() -> Rig:
    """A robot at home."""
    return Rig()


@pytest.fixture
def bare() -> Rig:
    """A robot without losses."""
    return Rig(frictionless=True)


class TestModes:
    """The table of modes, and the effect of a mode on the motor."""

    @pytest.mark.parametrize("state", STATES, ids=lambda mode: mode.word)
    def test_requests_lead_where_the_table_says(self, rig: Rig, state: ControlMode):
        """Each request in each state leads to the state of the table, or is refused."""
        axis = INDEX[ELBOW]
        for request in ControlMode:
            rig.boards.enter(axis, state)
            result, after = answer(state, request)
            if result is Answer.REFUSED:
                with pytest.raises(RefusedError, match="l_elbow"):
                    rig.boards.request_mode(axis, request)
            else:
                rig.boards.request_mode(axis, request)
            assert rig.mode(ELBOW) is after
        others = np.delete(rig.boards.mode, axis)
        assert (others == ControlMode.POSITION).all()

    @pytest.mark.parametrize("request_", [0, -1, 12345, 2**31 - 1])
    def test_what_is_no_mode_is_refused(self, rig: Rig, request_: int):
        """Unknown codes of modes change nothing."""
        with pytest.raises(RefusedError):
            rig.boards.request_mode(0, request_)
        with pytest.raises(RefusedError):
            rig.boards.request_interaction(INDEX[ELBOW], request_)
        assert rig.mode(AXES[0].name) is ControlMode.POSITION

    @pytest.mark.parametrize("mode", sorted(POWERLESS), ids=lambda mode: mode.word)
    def test_without_power_there_is_no_torque(self, rig: Rig, mode: ControlMode):
        """The joint falls, whatever its controller's integral was."""
        rig.run(0.2)
        before = rig.at(SHOULDER)
        assert abs(rig.torque(SHOULDER)) > 1.0
        rig.boards.enter(INDEX[SHOULDER], mode)
        rig.run(0.3)
        assert rig.torque(SHOULDER) == pytest.approx(0.0, abs=1e-9)  # its motors hold the joints beside it
        assert abs(rig.at(SHOULDER) - before) > 5.0

    def test_a_new_mode_keeps_every_joint_where_it_is(self, bare: Rig):
        """In all modes that hold, without friction: by less than half a degree."""
        bare.run(0.5)
        start = bare.boards.position
        way = (
            ControlMode.VELOCITY,
            ControlMode.POSITION_DIRECT,
            ControlMode.MIXED,
            ControlMode.TORQUE,
            ControlMode.POSITION,
            ControlMode.CURRENT,
            ControlMode.POSITION,
        )
        for mode in way:
            for axis in LIMBS.tolist():
                bare.boards.request_mode(axis, mode)
            assert bare.farthest(0.15, start, LIMBS) < 0.5, mode.word

    def test_a_moving_joint_is_held_by_the_mode_it_enters(self, rig: Rig):
        """The move ends, and the joint stays near where it was then."""
        rig.say(rig.boards.move, ELBOW, 90.0)
        rig.run(2.0)
        here = rig.at(ELBOW)
        rig.enter(ELBOW, ControlMode.VELOCITY)
        rig.run(1.0)
        assert rig.at(ELBOW) == pytest.approx(here, abs=1.0)

    def test_references_of_a_mode_that_begins(self, rig: Rig):
        """The present position, speed 0, the torque and current that hold the joint, and duty cycle 0."""
        rig.run(0.3)
        axis, boards = INDEX[SHOULDER], rig.boards
        current = float(boards.motors.current[axis])
        held = boards.measured_torques()[axis]
        assert abs(held) > 1.0
        boards.velocities[axis], boards.targets[axis] = 5.0, 0.0
        rig.enter(SHOULDER, ControlMode.TORQUE)
        assert boards.torques[axis] == pytest.approx(held)
        rig.enter(SHOULDER, ControlMode.CURRENT)
        assert boards.currents[axis] == pytest.approx(current, rel=0.05)
        assert boards.velocities[axis] == 0.0
        assert boards.targets[axis] == boards.direct[axis] == rig.at(SHOULDER)
        rig.enter(SHOULDER, ControlMode.IDLE)
        rig.enter(SHOULDER, ControlMode.TORQUE)
        assert boards.torques[axis] == 0.0

    def test_duty_cycles_begin_with_none_and_the_last_one_is_kept(self, rig: Rig):
        """After PWM mode the last duty cycle can be read, but drives nothing any more."""
        axis = INDEX[NECK]
        rig.enter(NECK, ControlMode.PWM)
        assert rig.boards.duties[axis] == 0.0
        rig.say(rig.boards.drive, NECK, 20.0)
        rig.run(0.001)
        assert rig.torque(NECK) == pytest.approx(0.2 * AXES[axis].max_torque, rel=0.01)
        rig.enter(NECK, ControlMode.POSITION)
        assert rig.boards.duties[axis] == 20.0
        rig.run(1.0)
        assert abs(rig.torque(NECK)) < 0.1 * AXES[axis].max_torque
        rig.enter(NECK, ControlMode.PWM)
        assert rig.boards.duties[axis] == 0.0
        rig.run(0.01)
        assert rig.boards.motor_duties()[axis] == 0.0


class TestFaults:
    """Conditions that switch a joint off."""

    def assert_in_fault(self, rig: Rig, axis: str, code: int, words: str) -> None:
        """The joint has no power and reports the reason; only a forced idle ends the fault."""
        assert rig.mode(axis) is ControlMode.HARDWARE_FAULT
        assert rig.boards.faults[INDEX[axis]][0] == code
        assert words in rig.boards.faults[INDEX[axis]][1]
        assert axis in rig.boards.faults[INDEX[axis]][1]
        assert (np.delete(rig.boards.mode, INDEX[axis]) == ControlMode.POSITION).all()
        for mode in (*USER_MODES, ControlMode.IDLE):
            rig.enter(axis, mode)
            assert rig.mode(axis) is ControlMode.HARDWARE_FAULT
        rig.run(0.01)
        assert rig.torque(axis) == pytest.approx(0.0, abs=1e-9)
        rig.enter(axis, ControlMode.FORCE_IDLE)
        assert rig.mode(axis) is ControlMode.IDLE

    def test_over_current(self, rig: Rig):
        """More than the peak current for 50 milliseconds is a fault."""
        axis = INDEX["l_hip_roll"]
        rig.run(0.3)
        rig.boards.set_max_current(axis, abs(float(rig.boards.motor_currents()[axis])) / 2)
        rig.run(0.04)
        assert rig.mode("l_hip_roll") is ControlMode.POSITION
        rig.run(0.03)
        self.assert_in_fault(rig, "l_hip_roll", OVERCURRENT, "over-current")

    def test_no_current_at_all(self, rig: Rig):
        """It cannot bear that for a moment, and goes into fault again when it is switched on again."""
        rig.run(0.2)
        rig.boards.set_max_current(INDEX[SHOULDER], 0.0)
        self.assert_in_fault(rig, SHOULDER, OVERCURRENT, "more than 0 A")
        rig.enter(SHOULDER, ControlMode.POSITION)
        rig.run(0.3)
        assert rig.mode(SHOULDER) is ControlMode.HARDWARE_FAULT

    def test_over_temperature(self, rig: Rig):
        """A motor that is hotter than allowed is a fault."""
        rig.boards.temperature[INDEX[ELBOW]] = 95.0
        rig.run(0.02)
        self.assert_in_fault(rig, ELBOW, OVERHEATED, "too hot: more than 90 degrees")
        rig.run(0.02)
        assert rig.mode(ELBOW) is ControlMode.HARDWARE_FAULT  # it is still too hot

    def test_motors_get_warm(self, rig: Rig):
        """With nominal current 40 degrees above the surroundings in the end; most of it in ten minutes."""
        axis = INDEX[ELBOW]
        rig.enter(ELBOW, ControlMode.CURRENT)
        rig.model.dof_frictionloss[rig.simulation.plant.dofs[axis]] = 1000.0
        rig.say(rig.boards.drive_currents, ELBOW, AXES[axis].nominal_current)
        rig.run(0.4)
        assert rig.boards.temperature[axis] - 25.0 == pytest.approx(40.0 * 0.4 / 600.0, rel=0.05)

    def test_too_far_from_the_reference(self, rig: Rig):
        """A following error is a fault only where an error limit is set."""
        rig.boards.pid_error_limits[INDEX[ELBOW]] = 1.0
        rig.run(0.1)
        assert rig.mode(ELBOW) is ControlMode.POSITION
        for axis in (ELBOW, "r_elbow"):
            rig.model.dof_frictionloss[rig.simulation.plant.dofs[INDEX[axis]]] = 1000.0
            rig.say(rig.boards.move, axis, 80.0)
        rig.run(1.5)
        assert rig.mode("r_elbow") is ControlMode.POSITION
        self.assert_in_fault(rig, ELBOW, ERROR_LIMIT, "more than 1 degrees off")

    def test_a_fault_ends_a_motion(self, rig: Rig):
        """The joint does not continue its move after the fault."""
        rig.say(rig.boards.move, NECK, 40.0)
        rig.run(1.0)
        rig.boards.set_max_current(INDEX[NECK], 0.0)
        rig.run(0.2)
        here = rig.at(NECK)
        assert rig.mode(NECK) is ControlMode.HARDWARE_FAULT
        rig.boards.set_max_current(INDEX[NECK], 6.0)
        rig.enter(NECK, ControlMode.FORCE_IDLE)
        rig.enter(NECK, ControlMode.POSITION)
        rig.run(1.0)
        assert rig.at(NECK) == pytest.approx(here, abs=0.5)


class TestWatchdogs:
    """A joint stops when its client no longer sends."""

    def test_speeds(self, rig: Rig):
        """In velocity and mixed mode a speed is forgotten after half a second without a new one."""
        for axis, mode in ((NECK, ControlMode.VELOCITY), ("torso_yaw", ControlMode.MIXED)):
            rig.enter(axis, mode)
            rig.say(rig.boards.run, axis, 20.0, 1000.0)
        rig.run(Boards.watchdog - 0.02)
        for axis in (NECK, "torso_yaw"):
            assert rig.boards.velocity[INDEX[axis]] == pytest.approx(20.0, abs=1.0)
        rig.run(0.3)
        for axis in (NECK, "torso_yaw"):
            assert rig.boards.velocity[INDEX[axis]] == pytest.approx(0.0, abs=0.5)
            assert rig.at(axis) == pytest.approx(20.0 * Boards.watchdog, abs=0.6)

    @pytest.mark.parametrize(
        ("mode", "command", "value"),
        [
            (ControlMode.TORQUE, "exert", 0.5),
            (ControlMode.CURRENT, "drive_currents", 0.4),
            (ControlMode.PWM, "drive", 10.0),
        ],
        ids=lambda value: value.word if isinstance(value, ControlMode) else None,
    )
    def test_torques_currents_and_duty_cycles(self, rig: Rig, mode: ControlMode, command: str, value: float):
        """They are 0 half a second after the last command, and not before; a new one works again."""
        rig.enter(NECK, mode)
        for _ in range(3):
            rig.say(getattr(rig.boards, command), NECK, value)
            rig.run(Boards.watchdog - 0.02)
            assert rig.boards.output[INDEX[NECK]] == pytest.approx(10.0, rel=0.01)
        rig.run(0.04)
        assert rig.boards.output[INDEX[NECK]] == pytest.approx(0.0, abs=0.1)
        rig.say(getattr(rig.boards, command), NECK, -value)
        rig.run(0.01)
        assert rig.boards.output[INDEX[NECK]] == pytest.approx(-10.0, rel=0.01)

    def test_currents_of_coupled_joints(self, rig: Rig):
        """Currents are of motors: a group that is driven by the currents it is held with, is held."""
        group = [INDEX[f"l_shoulder_{name}"] for name in ("pitch", "roll", "yaw")]
        rig.run(0.3)
        held, currents = rig.boards.measured_torques()[group], rig.boards.motors.current[group].copy()
        for axis in group:
            rig.boards.request_mode(axis, ControlMode.CURRENT)
        rig.boards.drive_currents(group, currents)
        rig.run(0.01)
        assert rig.boards.measured_torques()[group] == pytest.approx(held, abs=0.05)
        assert rig.boards.motors.current[group] == pytest.approx(currents, rel=0.05)

    def test_currents_have_the_signs_of_the_duty_cycles(self, rig: Rig):
        """For each motor, whatever the sign of its gear and its couplings."""
        rig.run(0.3)
        duties, currents = rig.boards.motor_duties(), rig.boards.motor_currents()
        assert (rig.boards.gearbox < 0).any()
        # At rest the supply would drive the peak current; the noise is half a per cent of that.
        assert currents / rig.boards.peak_current == pytest.approx(duties / 100.0, abs=5 * 0.005)

    def test_positions(self, rig: Rig):
        """Moves reach their target, and direct positions are held."""
        rig.enter("r_elbow", ControlMode.POSITION_DIRECT)
        rig.say(rig.boards.follow, "r_elbow", 48.0)
        rig.boards.speeds[INDEX[ELBOW]] = 20.0
        rig.say(rig.boards.move, ELBOW, 75.0)
        rig.run(2.5)
        assert rig.at(ELBOW) == pytest.approx(75.0, abs=0.1)
        assert rig.at("r_elbow") == pytest.approx(48.0, abs=0.1)

    def test_a_position_move_in_mixed_mode_is_not_cut_short(self, rig: Rig):
        """The watchdog of the speed that the move replaced does not end it."""
        rig.enter(ELBOW, ControlMode.MIXED)
        rig.say(rig.boards.run, ELBOW, 5.0, 1000.0)
        rig.run(0.1)
        rig.say(rig.boards.move, ELBOW, 60.0)
        rig.run(2.5)
        assert rig.at(ELBOW) == pytest.approx(60.0, abs=0.1)


class TestImpedance:
    """Compliant joints, which need no friction to be still."""

    def test_a_push_moves_a_compliant_joint_by_torque_over_stiffness(self, bare: Rig):
        """It returns afterwards; the stiff joint of the other arm does not move."""
        axis = INDEX[ELBOW]
        bare.boards.request_interaction(axis, InteractionMode.COMPLIANT)
        bare.run(0.5)
        start = bare.boards.position
        stiffness = float(bare.boards.stiffness[axis])
        for torque in (5 * stiffness, -5 * stiffness):
            bare.push(ELBOW, torque)
            bare.push("r_elbow", torque)
            bare.run(2.0)
            assert bare.at(ELBOW) - start[axis] == pytest.approx(torque / stiffness, rel=0.1)
            assert bare.at("r_elbow") == pytest.approx(start[INDEX["r_elbow"]], abs=0.2)
        bare.push(ELBOW, 0.0)
        bare.push("r_elbow", 0.0)
        bare.run(2.0)
        assert bare.boards.position == pytest.approx(start, abs=0.2)

    def test_becoming_compliant_and_stiff_keeps_the_joint_where_it_is(self, bare: Rig):
        """Against gravity and without friction, too."""
        bare.run(0.5)
        start = bare.boards.position
        for mode in (InteractionMode.COMPLIANT, InteractionMode.STIFF):
            for axis in np.flatnonzero(bare.boards.torque_controlled).tolist():
                bare.boards.request_interaction(axis, mode)
            assert bare.farthest(0.6, start) < 0.5, mode.word

    def test_a_joint_that_was_pushed_away_does_not_snap_back_when_it_gets_stiff(self, bare: Rig):
        """It is held at its present position."""
        axis = INDEX[ELBOW]
        bare.boards.request_interaction(axis, InteractionMode.COMPLIANT)
        bare.push(ELBOW, 10 * float(bare.boards.stiffness[axis]))
        bare.run(2.0)
        here = bare.boards.position
        assert here[axis] > 53.0
        bare.boards.request_interaction(axis, InteractionMode.STIFF)
        assert bare.farthest(1.0, here, [axis]) < 0.5

    def test_getting_stiff_does_not_end_a_move(self, bare: Rig):
        """The joint reaches its target."""
        bare.boards.request_interaction(INDEX[ELBOW], InteractionMode.COMPLIANT)
        bare.boards.speeds[INDEX[ELBOW]] = 20.0
        bare.say(bare.boards.move, ELBOW, 75.0)
        bare.run(0.7)
        bare.boards.request_interaction(INDEX[ELBOW], InteractionMode.STIFF)
        bare.run(2.0)
        assert bare.at(ELBOW) == pytest.approx(75.0, abs=0.1)

    def test_joints_without_torque_sensing_cannot_be_compliant(self, rig: Rig):
        """Arms down to the forearm, torso and legs can; neck, eyes, wrists and fingers refuse."""
        can = {AXES[axis].name for axis in np.flatnonzero(rig.boards.torque_controlled).tolist()}
        assert len(can) == 2 * 5 + 3 + 2 * 6
        for axis in AXES:
            if axis.name in can:
                rig.boards.request_interaction(INDEX[axis.name], InteractionMode.COMPLIANT)
            else:
                with pytest.raises(RefusedError, match=axis.name):
                    rig.boards.request_interaction(INDEX[axis.name], InteractionMode.COMPLIANT)

    def test_the_offset_is_a_torque(self, bare: Rig):
        """A compliant joint moves to where offset and spring are in balance."""
        axis = INDEX[ELBOW]
        bare.boards.request_interaction(axis, InteractionMode.COMPLIANT)
        start = bare.at(ELBOW)
        bare.boards.impedance_offset[axis] = 4 * float(bare.boards.stiffness[axis])
        bare.boards.refresh(axis)
        bare.run(2.0)
        assert bare.at(ELBOW) - start == pytest.approx(4.0, rel=0.1)


class TestMotors:
    """Torques, duty cycles, gears and encoders."""

    def test_torque_mode_exerts_the_torque(self, rig: Rig):
        """What the sensor shows is what was asked for, also when the motor is weaker than it should be."""
        axis = INDEX[KNEE]

        def weaken(windings: Windings) -> None:
            windings.constants[axis] *= 0.8

        rig.enter(KNEE, ControlMode.TORQUE)
        for torque in (3.0, -4.5):
            rig.say(rig.boards.exert, KNEE, torque)
            rig.run(0.05)
            assert rig.boards.measured_torques()[axis] == pytest.approx(torque, abs=0.15)  # noise and offset
        rig.boards.motors.faults.append(weaken)
        rig.boards.motors.refresh()
        for _ in range(4):
            rig.say(rig.boards.exert, KNEE, 3.0)
            rig.run(0.4)
        assert rig.boards.measured_torques()[axis] == pytest.approx(3.0, abs=0.15)

    def test_torques_are_cut_off_at_what_the_drive_can_give(self, rig: Rig):
        """And currents and duty cycles at their peaks."""
        axis = INDEX[NECK]
        rig.say(rig.boards.exert, NECK, 1e9)
        rig.say(rig.boards.drive_currents, NECK, -1e9)
        rig.say(rig.boards.drive, NECK, 1e9)
        assert rig.boards.torques[axis] == AXES[axis].max_torque
        assert rig.boards.currents[axis] == -AXES[axis].peak_current
        assert rig.boards.duties[axis] == 100.0

    def test_a_duty_cycle_must_overcome_friction(self, rig: Rig):
        """Below two per cent a joint stands, above it moves."""
        rig.run(0.1)
        rig.enter(NECK, ControlMode.PWM)
        start = rig.at(NECK)
        rig.say(rig.boards.drive, NECK, 1.5)
        rig.run(0.4)
        assert rig.at(NECK) == pytest.approx(start, abs=0.02)
        rig.say(rig.boards.drive, NECK, 4.0)
        rig.run(0.4)
        assert rig.at(NECK) - start > 1.0

    @pytest.mark.parametrize("part", PARTS)
    def test_a_positive_duty_cycle_makes_the_motors_encoder_count_up(self, part: str):
        """For every motor, whichever way round it is mounted and whatever it is coupled with; negative ones: down."""
        rig = Rig(collision="none")
        rig.model.opt.gravity[:] = 0.0
        own = ALL[part_slice(part)]
        for axis in own.tolist():
            for duty in (30.0, -30.0):
                rig.simulation.reset()
                for neighbour in own.tolist():
                    rig.boards.request_mode(neighbour, ControlMode.PWM)
                before = rig.boards.motor_motion()[0]
                rig.say(rig.boards.drive, AXES[axis].name, duty)
                rig.run(0.04)
                # Away from a limit that it may stand at.
                moved = rig.boards.motor_motion()[0][axis] - before[axis]
                at_limit = rig.at(AXES[axis].name) <= AXES[axis].minimum or AXES[axis].name == "eyes_vergence"
                assert moved * duty > 0 or (at_limit and duty < 0), (AXES[axis].name, duty, moved)
                assert rig.boards.motor_duties()[axis] == pytest.approx(duty)

    def test_motor_encoders_turn_with_gears_and_couplings(self, rig: Rig):
        """Shoulder, torso and eyes move several motors, everything else its own."""
        axes = np.array([axis.home for axis in AXES])
        moved = {"l_shoulder_pitch": -20, "l_shoulder_roll": 30, "l_shoulder_yaw": 12, "l_elbow": 50, "neck_yaw": 9}
        moved |= {"torso_roll": 8, "torso_pitch": 14, "eyes_version": 5, "eyes_vergence": 20, "l_hip_pitch": 7}
        for name, angle in moved.items():
            axes[INDEX[name]] = angle
        rig.data.qpos[:] = rig.simulation.plant.pose(np.radians(axes))
        rig.simulation.refresh()
        expected = {
            "l_shoulder_pitch": 100 * -20,
            "l_shoulder_roll": 100 * 1.625 * (30 + 20),
            "l_shoulder_yaw": 100 * 1.625 * 12,
            "l_elbow": 100 * 50,
            "r_shoulder_roll": -100 * 1.625 * (45 + 30),
            "torso_roll": -100 * (8 - 14) / 2,
            "torso_pitch": -100 * (8 + 14) / 2,
            "eyes_version": 50 * (5 - 20),
            "eyes_vergence": 50 * (5 + 20),
            "l_hip_pitch": -150 * 7,
            "neck_yaw": 100 * 9,
        }
        turned = rig.boards.motor_motion()[0]
        for name, angle in expected.items():
            counted = 360.0 / AXES[INDEX[name]].rotor_resolution
            assert turned[INDEX[name]] == pytest.approx(angle, abs=counted / 2 + 1e-6), name

    def test_encoders_count_ticks(self, rig: Rig):
        """Positions are whole numbers of ticks, of the joint and of the rotor."""
        rig.say(rig.boards.move, ELBOW, 60.0)
        rig.run(0.313)
        ticks = rig.boards.position * np.array([axis.encoder_resolution for axis in AXES])
        assert ticks == pytest.approx(np.rint(ticks), abs=1e-6)
        then = rig.data.actuator_length - 0.001 * rig.data.actuator_velocity  # they are used a millisecond later
        assert ticks / 182.044 == pytest.approx(np.degrees(then), abs=0.5 / 182.044 + 1e-4)
        turns = rig.boards.motor_motion()[0] * np.array([axis.rotor_resolution for axis in AXES]) / 360.0
        assert turns == pytest.approx(np.rint(turns), abs=1e-5)

    def test_setting_encoders_shifts_what_they_show_and_moves_nothing(self, rig: Rig):
        """The next move goes as far as the numbers say."""
        axis = INDEX[ELBOW]
        rig.run(0.2)
        true = math.degrees(rig.data.actuator_length[axis])
        rig.boards.shift_encoders(np.array([axis]), np.array([30.0]))
        assert rig.at(ELBOW) == pytest.approx(30.0, abs=0.01)
        rig.run(0.5)
        assert math.degrees(rig.data.actuator_length[axis]) == pytest.approx(true, abs=0.05)
        rig.boards.speeds[axis] = 20.0
        rig.say(rig.boards.move, ELBOW, 40.0)
        rig.run(1.5)
        assert rig.at(ELBOW) == pytest.approx(40.0, abs=0.1)
        assert math.degrees(rig.data.actuator_length[axis]) == pytest.approx(true + 10.0, abs=0.1)
        motor = rig.boards.motor_motion()[0][axis]
        rig.boards.shift_motor_encoders(np.array([axis]), np.array([7.5]))
        assert rig.boards.motor_motion()[0][axis] == pytest.approx(7.5, abs=0.03)
        assert motor != pytest.approx(7.5)


class TestControllers:
    """Gains and limits of the position controllers."""

    def weaken(self, rig: Rig, axis: str, share: float) -> None:
        """Let a joint have no more than a share of its duty cycle."""
        pid = rig.boards.pids[INDEX[axis]]
        rig.boards.set_pid(INDEX[axis], pid._replace(max_output=pid.max_output * share))

    @pytest.mark.parametrize("axis", ["l_shoulder_pitch", "r_elbow", "l_hip_pitch", "neck_pitch", "torso_yaw"])
    def test_a_joint_with_less_output_still_reaches_its_limits(self, rig: Rig, axis: str):
        """With 30 per cent, and never with more."""
        self.weaken(rig, axis, 0.3)
        rig.boards.speeds[INDEX[axis]] = 30.0
        for limit in (AXES[INDEX[axis]].minimum, AXES[INDEX[axis]].maximum):
            rig.say(rig.boards.move, axis, limit)
            while not rig.boards.trajectories.done(np.array([INDEX[axis]]), rig.boards.tick)[0]:
                rig.run(0.05)
                assert abs(rig.boards.output[INDEX[axis]]) <= 30.0 + 1e-9
            rig.run(1.0)
            assert rig.at(axis) == pytest.approx(limit, abs=0.2)

    @pytest.mark.parametrize("share", [0.0, 0.01])
    def test_a_joint_with_too_little_output_does_not_move(self, rig: Rig, share: float):
        """It stalls; it reports neither the end of its move nor a fault."""
        self.weaken(rig, NECK, share)
        rig.say(rig.boards.move, NECK, 30.0)
        rig.run(4.0)
        assert abs(rig.at(NECK)) < 1.0
        assert abs(rig.boards.output[INDEX[NECK]]) <= 100 * share
        assert rig.boards.error[INDEX[NECK]] == pytest.approx(30.0, abs=1.0)
        assert rig.mode(NECK) is ControlMode.POSITION

    def test_a_controller_that_is_switched_off_gives_nothing(self, rig: Rig):
        """The output is 0, and holds the joint again when the controller is switched on."""
        rig.run(0.2)
        rig.boards.pid_enabled[INDEX[SHOULDER]] = False
        rig.boards.refresh(INDEX[SHOULDER])
        rig.run(0.05)
        assert rig.torque(SHOULDER) == 0.0

    def test_stiction_and_offset_add_to_the_output(self, rig: Rig):
        """In per cent of duty cycle, with the sign of the error."""
        axis = INDEX[NECK]
        pid = rig.boards.pids[axis]._replace(kp=0.0, kd=0.0, ki=0.0, stiction_up=1.0, stiction_down=-0.5, offset=0.25)
        rig.boards.set_pid(axis, pid)
        for reference, percent in ((10.0, 1.25), (-10.0, -0.25)):
            rig.say(rig.boards.follow, NECK, reference)
            rig.run(0.01)
            expected = percent if pid.kp else 0.25
            assert rig.boards.output[axis] == pytest.approx(expected, abs=1e-6)
        rig.boards.set_pid(axis, pid._replace(kp=1e-9))
        for reference, percent in ((10.0, 1.25), (-10.0, -0.25)):
            rig.say(rig.boards.follow, NECK, reference)
            rig.run(0.01)
            assert rig.boards.output[axis] == pytest.approx(percent, abs=1e-6)

    def test_moves_beyond_the_limits_end_at_them(self, rig: Rig):
        """Position moves, speeds and direct positions."""
        axis = INDEX[NECK]
        rig.boards.speeds[axis] = 100.0
        rig.say(rig.boards.move, NECK, 500.0)
        rig.run(1.2)
        assert rig.at(NECK) == pytest.approx(50.0, abs=0.1)
        rig.enter(NECK, ControlMode.VELOCITY)
        for _ in range(5):
            rig.say(rig.boards.run, NECK, -1000.0, 500.0)
            rig.run(0.4)
        assert rig.boards.velocities[axis] == -AXES[axis].max_velocity
        assert rig.at(NECK) == pytest.approx(-50.0, abs=0.2)
        rig.enter(NECK, ControlMode.POSITION_DIRECT)
        rig.say(rig.boards.follow, NECK, -51.0)
        assert rig.boards.direct[axis] == -50.0

    def test_a_stop_ends_within_the_stopping_distance_and_that_is_the_target(self, rig: Rig):
        """A move is stopped halfway."""
        rig.boards.speeds[INDEX[NECK]] = 40.0
        rig.say(rig.boards.move, NECK, 40.0)
        rig.run(0.5)
        here, speed = rig.at(NECK), float(rig.boards.velocity[INDEX[NECK]])
        rig.say(rig.boards.stop, NECK)
        rig.run(1.0)
        assert rig.at(NECK) - here == pytest.approx(speed**2 / 2000.0, abs=0.6)
        assert rig.at(NECK) == pytest.approx(rig.boards.targets[INDEX[NECK]], abs=0.1)

    @pytest.mark.parametrize("share", [0.25, 0.75])
    def test_all_axes_follow_moves_and_settle(self, share: float):
        """All 53 at once to a quarter or three quarters of their ranges: a degree on the way, a tenth at the end."""
        rig = Rig(collision="none")
        low, high = (np.array([getattr(axis, name) for axis in AXES]) for name in ("minimum", "maximum"))
        targets = low + share * (high - low)
        rig.boards.speeds[:] = np.maximum(np.abs(targets - rig.boards.position) / 2.5, 1.0)
        rig.boards.move(ALL, targets)
        squares = []
        for _ in range(300):
            rig.run(0.01)
            squares.append(rig.boards.error**2)
        rig.run(1.0)
        assert np.sqrt(np.mean(squares, axis=0)).max() < 1.0
        assert np.abs(rig.boards.position - targets).max() < 0.1


class TestCalibration:
    """The chain of modes after a calibration was asked for."""

    def chain(self, rig: Rig, seconds: float) -> list[ControlMode]:
        """The modes that the elbow goes through."""
        seen = [rig.mode(ELBOW)]
        for _ in range(round(seconds / 0.005)):
            rig.run(0.005)
            if rig.mode(ELBOW) is not seen[-1]:
                seen.append(rig.mode(ELBOW))
        return seen

    def test_the_chain(self, rig: Rig):
        """Calibrating, done, position; no other mode is taken meanwhile, and the joint does not move."""
        axis = INDEX[ELBOW]
        start = rig.at(ELBOW)
        rig.boards.calibrate(axis)
        assert not rig.boards.calibrated[axis]
        rig.enter(ELBOW, ControlMode.VELOCITY)
        rig.enter(ELBOW, ControlMode.FORCE_IDLE)
        seen = self.chain(rig, 0.8)
        assert seen == [ControlMode.CALIBRATING, ControlMode.CALIBRATION_DONE, ControlMode.POSITION]
        assert rig.boards.calibrated[axis]
        assert rig.at(ELBOW) == pytest.approx(start, abs=0.1)

    def test_a_fault_ends_it(self, rig: Rig):
        """The joint stays in fault, and is not calibrated."""
        rig.boards.calibrate(INDEX[ELBOW])
        rig.run(0.1)
        rig.boards.set_max_current(INDEX[ELBOW], 0.0)
        assert self.chain(rig, 0.8) == [ControlMode.HARDWARE_FAULT]
        assert not rig.boards.calibrated[INDEX[ELBOW]]
        with pytest.raises(RefusedError, match="l_elbow is in fault"):
            rig.boards.calibrate(INDEX[ELBOW])
        assert rig.mode(ELBOW) is ControlMode.HARDWARE_FAULT

    def test_asked_for_twice_it_begins_anew(self, rig: Rig):
        """The second request replaces the first, and takes half a second."""
        rig.boards.calibrate(INDEX[ELBOW])
        rig.run(0.3)
        rig.boards.calibrate(INDEX[ELBOW])
        rig.run(0.3)
        assert rig.mode(ELBOW) is ControlMode.CALIBRATING
        assert self.chain(rig, 0.5)[-1] is ControlMode.POSITION
        rig.enter(ELBOW, ControlMode.VELOCITY)
        assert self.chain(rig, 0.5) == [ControlMode.VELOCITY]


def test_requests_and_states_are_all_tried():
    """The table of modes has not grown a state that these tests leave out."""
    assert set(REQUESTS) | set(STATES) | {ControlMode.UNKNOWN} == set(ControlMode)
    assert mujoco() is not None
