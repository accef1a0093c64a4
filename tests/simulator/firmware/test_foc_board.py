"""The board that drives a motor, emulated: its states, setpoints, watchdog and settings, and the driver over it."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.codes import BoardMode, BoardType, FocFault, FocPidParameter, FocPidType, MotorFlag
from rtf.robot.devices.can.messages import HOST, Dialect
from rtf.robot.model import load_robot
from rtf.simulator.errors import SimulatorError
from rtf.simulator.faults import find_kind
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.configuration import can_configuration
from rtf.simulator.firmware.foc_board import POWERED
from rtf.simulator.plant import Options, build
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Frame, Message, Question, Setting

ADDRESS = 1


class DriveBench:
    """The bench with two joints, whose motors have a board each, and a host that sends setpoints."""

    address = None

    def __init__(self) -> None:
        self.simulation = Simulation(build(load_robot("bench"), Options()))
        self.firmware = Firmware(self.simulation, drives=["arm"])
        (self.wire,) = self.firmware.wires.values()
        self.board = self.firmware.drives[0]
        self.connection = self.wire.attach(self)
        self.got: list[tuple[float, Decoded]] = []

    def receive(self, frame: Frame, time: float) -> None:
        """Keep a message."""
        self.got.append((time, decode(*frame, Dialect.FOC)))

    def run(self, seconds: float) -> None:
        """Simulate."""
        self.simulation.advance(self.simulation.now + seconds)

    def send(self, message: Message, *values: float | bytes) -> None:
        """Send a command, which has arrived afterwards."""
        self.connection.send(message.frame(ADDRESS, *values))
        self.run(0.002)

    def ask(self, question: Question | Setting, *values: float | bytes) -> tuple[float | bytes, ...]:
        """Return the one answer to a question."""
        self.got.clear()
        self.send(question.get, *values)
        (answer,) = [one.values for _, one in self.got if one.message is question.value]
        return answer

    def drive(self, word: int, seconds: float = 0.001) -> None:
        """Send a setpoint every millisecond."""
        for _ in range(round(seconds * 1000)):
            self.connection.send(m.SETPOINTS[1].frame(HOST, word, 0))
            self.run(0.001)

    def feedback(self, message: Message) -> tuple[float, ...]:
        """Return the values of the latest message of a kind, of the board of the tests."""
        return next(one.values for _, one in reversed(self.got) if one.message is message and one.source == ADDRESS)  # type: ignore[return-value]  # all numbers of these are

    def gains(self) -> list[int]:
        """Return the controller of the velocity, as the configuration of the driver has it."""
        group = can_configuration(self.firmware, "arm0").find_group("FOC")
        assert group is not None
        (found,) = [list(entry[1:]) for entry in group[1:] if entry[0] == "VelocityPid0"]
        return found

    def configure(self) -> None:
        """Agree on the protocol, and set what a driver sets."""
        self.ask(m.VERSION, 1, 6)
        self.send(m.CURRENT_LIMITS.set, 5000, 10000, 15000)
        kp, _, ki, integral, output, shift, offset = self.gains()
        self.send(m.VELOCITY_PID.set, kp, ki, 0, shift)
        self.send(m.VELOCITY_PID_LIMITS.set, offset, output, integral)
        self.send(m.MOTOR_CONFIGURATION.set, MotorFlag.QUADRATURE_ENCODER, 14400, 0, 7, 0)


@pytest.fixture
def bench() -> DriveBench:
    """The bench, configured."""
    made = DriveBench()
    made.configure()
    return made


def test_a_board_is_configured_after_the_protocol_is_agreed():
    """Settings are refused before; an older host is reported, and cannot configure."""
    bench = DriveBench()
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.NOT_CONFIGURED,)
    bench.send(m.MOTOR_CONFIGURATION.set, 1, 14400, 0, 7, 0)
    assert bench.ask(m.MOTOR_CONFIGURATION) == (0, 0, 0, 0, 0)
    assert bench.ask(m.VERSION, 2, 0)[-1] == 0
    bench.drive(0, 0.002)
    assert bench.feedback(m.FOC_STATUS)[3] == FocFault.PROTOCOL_MISMATCH
    assert bench.ask(m.VERSION, 1, 6) == (BoardType.FOC_2, 3, 5, 0, 1, 6, 1)
    bench.send(m.MOTOR_CONFIGURATION.set, 1, 14400, 0, 7, 0)
    assert bench.ask(m.MOTOR_CONFIGURATION) == (1, 14400, 0, 7, 0)
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.IDLE,)


def test_faults_of_boards_strike_a_drive(bench: DriveBench):
    """Its positions stand still while its speeds do not; without a watchdog it goes on; both end."""
    bench.send(m.SET_CONTROL_MODE, BoardMode.OPEN_LOOP)
    bench.drive(0)
    stuck, endless = (find_kind(kind)(bench, "arm0:1") for kind in ("can_encoder_frame_stuck", "can_watchdog_off"))  # type: ignore[arg-type]  # it has what a fault needs of a robot
    before = bench.feedback(m.FOC_FEEDBACK)
    stuck.start()
    bench.drive(3200, 0.1)
    (_, speed, position), bench.got = bench.feedback(m.FOC_FEEDBACK), []
    assert (abs(speed) > 10, abs(position - before[2]) < 2 * abs(before[1]) + 2) == (True, True)
    stuck.end()
    endless.start()
    bench.drive(3200)
    assert abs(bench.feedback(m.FOC_FEEDBACK)[2] - position) > 100
    bench.run(1.5)
    assert bench.board.mode is BoardMode.OPEN_LOOP
    endless.end()
    bench.run(0.01)
    assert bench.board.mode is BoardMode.HARDWARE_FAULT


def test_a_board_takes_another_address(bench: DriveBench):
    """Its setpoint is the word of the new one then, and it answers there; what is no address is dropped."""
    bench.send(m.BOARD_ID.set, 0)
    bench.send(m.BOARD_ID.set, 4)
    bench.got.clear()
    bench.connection.send(m.SETPOINTS[3].frame(HOST, 0, 0, 0, 0))
    bench.run(0.002)
    assert {one.source for _, one in bench.got} == {2, 4}


def test_modes_are_entered_from_idle_only(bench: DriveBench):
    """From one mode with power there is no way to another one but through idle."""
    for before, after in itertools.permutations(sorted(POWERED), 2):
        bench.send(m.SET_CONTROL_MODE, BoardMode.IDLE)
        bench.send(m.SET_CONTROL_MODE, before)
        bench.send(m.SET_CONTROL_MODE, after)
        assert bench.ask(m.FOC_CONTROL_MODE) == (before,)
    bench.send(m.SET_CONTROL_MODE, BoardMode.FORCE_IDLE)
    bench.send(m.SET_CONTROL_MODE, BoardMode.POSITION)
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.IDLE,)
    assert bench.simulation.boards.mode[0] == ControlMode.IDLE


def test_each_setpoint_is_answered_by_two_frames(bench: DriveBench):
    """By the boards that it has a word for; a frame that is too short is for others."""
    bench.got.clear()
    bench.drive(0, 0.01)
    bench.run(0.002)
    kinds = [(one.source, one.message.name) for _, one in bench.got]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        (board, name): 10 for board in (1, 2) for name in ("foc_feedback", "foc_status")
    }
    bench.got.clear()
    bench.connection.send(m.SETPOINTS[0].frame(HOST, 0))
    bench.run(0.002)
    assert {one.source for _, one in bench.got} == {1}


def test_currents_duties_and_velocities_reach_the_motor(bench: DriveBench):
    """Each in the unit of its mode: mA, parts of 32000, and parts of a turn a millisecond."""
    boards = bench.simulation.boards
    bench.send(m.SET_CONTROL_MODE, BoardMode.CURRENT)
    bench.drive(300, 0.05)
    assert boards.motors.current[0] == pytest.approx(0.3, abs=0.01)
    assert bench.feedback(m.FOC_FEEDBACK)[0] == pytest.approx(300, abs=60)
    bench.send(m.SET_CONTROL_MODE, BoardMode.IDLE)
    bench.send(m.SET_CONTROL_MODE, BoardMode.OPEN_LOOP)
    bench.drive(-1600, 0.02)
    assert boards.duties[0] == pytest.approx(-5.0)
    assert bench.feedback(m.FOC_STATUS)[2] == pytest.approx(-1600, abs=200)
    bench.send(m.SET_CONTROL_MODE, BoardMode.IDLE)
    bench.send(m.SET_CONTROL_MODE, BoardMode.SPEED_CURRENT)
    bench.drive(120, 0.4)
    _, velocity, position = bench.feedback(m.FOC_FEEDBACK)
    assert velocity == pytest.approx(120, abs=12)
    assert position == pytest.approx(boards.motor_motion()[0][0] * 65536 / 360, abs=300)


def test_without_setpoints_the_motor_is_switched_off(bench: DriveBench):
    """After a second, by a fault that only a forced idle ends."""
    bench.send(m.SET_CONTROL_MODE, BoardMode.CURRENT)
    bench.drive(100, 0.01)
    bench.run(0.95)
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.CURRENT,)
    bench.run(0.1)
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.HARDWARE_FAULT,)
    assert bench.simulation.boards.mode[0] == ControlMode.IDLE
    bench.drive(100, 0.002)
    assert bench.feedback(m.FOC_STATUS)[3] == FocFault.SETPOINT_EXPIRED
    for mode in (BoardMode.CURRENT, BoardMode.IDLE):
        bench.send(m.SET_CONTROL_MODE, mode)
        assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.HARDWARE_FAULT,)
    bench.send(m.SET_CONTROL_MODE, BoardMode.FORCE_IDLE)
    bench.drive(100, 0.002)
    assert bench.feedback(m.FOC_STATUS)[0::3] == (BoardMode.IDLE, 0)


def test_a_motor_with_too_much_current_is_a_fault(bench: DriveBench):
    """The overload limit of the host counts; the motor is off."""
    bench.send(m.CURRENT_LIMITS.set, 100, 3000, 500)
    bench.send(m.SET_CONTROL_MODE, BoardMode.CURRENT)
    bench.drive(3000, 0.2)
    status = bench.feedback(m.FOC_STATUS)
    assert (status[0], status[3]) == (BoardMode.HARDWARE_FAULT, FocFault.OVERCURRENT)
    bench.send(m.SET_CONTROL_MODE, BoardMode.FORCE_IDLE)
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.IDLE,)


def test_parameters_in_floating_point_need_a_lock(bench: DriveBench):
    """They are those of the integer messages, too; each has its own answer."""
    velocity, kp = FocPidType.VELOCITY, FocPidParameter.KP
    bench.send(m.FOC_PID_PARAMETER.set, velocity, kp, 2.5)
    assert bench.board.gains.kp != 2.5
    bench.send(m.FOC_PID_PARAMETER.set, velocity, FocPidParameter.LOCK, 0.0)
    bench.send(m.FOC_PID_PARAMETER.set, velocity, kp, 2.5)
    bench.send(m.FOC_PID_PARAMETER.set, velocity, FocPidParameter.KI, 0.25)
    bench.send(m.FOC_PID_PARAMETER.set, velocity, FocPidParameter.UNLOCK, 0.0)
    assert (bench.board.gains.kp, bench.board.gains.ki) == (2.5, 0.25)
    assert bench.ask(m.FOC_PID_PARAMETER, velocity, kp) == (velocity, kp, 2.5)
    assert bench.ask(m.FOC_PID_PARAMETER, FocPidType.CURRENT, kp) == (FocPidType.CURRENT, kp, 0.0)


def test_a_reset_forgets_all(bench: DriveBench):
    """The motor is off, and nothing is configured."""
    bench.send(m.SET_CONTROL_MODE, BoardMode.SPEED_CURRENT)
    bench.board.reset()
    assert bench.ask(m.FOC_CONTROL_MODE) == (BoardMode.NOT_CONFIGURED,)
    assert bench.ask(m.VELOCITY_PID) == (0, 0, 0, 0)
    assert bench.simulation.boards.mode[0] == ControlMode.IDLE


def test_coupled_motors_cannot_have_such_boards():
    """A board drives a motor, and its driver takes that for a joint."""
    with pytest.raises(SimulatorError, match="the motors of torso are coupled"):
        Firmware(Simulation(build(load_robot("icub"), Options())), ["torso"], drives=["torso"])


def test_the_driver_moves_joints_by_such_boards():
    """Positions, velocities, currents and duty cycles; the fault of a lost host; and a reset of the robot ends all."""
    network = Network(LocalNames())
    robot = load_robot("bench")
    with SimulatedRobot(robot, network=network, lockstep=True, can=True, drives=["arm"]) as made:
        arm, wait = made.parts["arm"], clock.current().sleep
        arm.set_reference_speeds([30.0, 30.0])
        arm.position_move([10.0, 30.0])
        wait(2.0)
        assert arm.motion_done()
        assert arm.encoders() == pytest.approx([10.0, 30.0], abs=0.1)
        arm.set_control_modes(ControlMode.VELOCITY, 0)
        arm.velocity_move(10.0, 0)
        wait(0.4)
        assert arm.encoder_speeds(0)[0] == pytest.approx(10.0, abs=1.0)
        for mode in (ControlMode.PWM, ControlMode.CURRENT, ControlMode.POSITION):
            arm.set_control_modes(mode, 0)
            wait(0.1)
            assert arm.control_modes(0) == (mode,)
        assert np.array(arm.temperatures()) == pytest.approx(made.simulation.boards.temperature, abs=1.0)
        assert made.firmware is not None
        (wire,) = made.firmware.wires.values()
        wire.filters.append(lambda frame, _time: () if frame.identifier == 0x10F else (frame,))
        wait(1.2)
        wire.filters.clear()
        wait(0.7)  # silent boards are asked again every half second
        assert arm.control_modes(0) == (ControlMode.HARDWARE_FAULT,)
        assert "board 1 reports setpoint expired" in arm.last_joint_fault(0)[1]
        made.firmware.drives[1].reset()  # which loses its power, and its settings
        made.simulation.reset()
        wait(0.5)
        assert arm.control_modes() == (ControlMode.POSITION, ControlMode.POSITION)
        arm.position_move([5.0, 20.0])
        wait(2.5)
        assert arm.encoders() == pytest.approx([5.0, 20.0], abs=0.1)


def test_one_silent_board_leaves_the_others_standing_and_speaking():
    """Without setpoints they would go on at their last velocity, and fall silent, too."""
    network = Network(LocalNames())
    said: list[str] = []
    network.report = said.append
    with SimulatedRobot(load_robot("bench"), network=network, lockstep=True, can=True, drives=["arm"]) as made:
        arm, wait = made.parts["arm"], clock.current().sleep
        arm.set_control_modes([ControlMode.VELOCITY] * 2)
        arm.velocity_move([10.0, 10.0])
        wait(0.3)
        assert made.firmware is not None
        made.firmware.drives[0].connection.off = True
        wait(0.3)
        assert made.simulation.boards.velocity[1] == pytest.approx(0.0, abs=1.0)
        assert not any("[1, 2]" in sentence for sentence in said)
