"""The driver of motor boards: start-up, modes, setpoints, feedback, faults, and boards that do not answer."""

from __future__ import annotations

from contextlib import ExitStack, closing, suppress
from typing import TYPE_CHECKING

import can
import pytest
from can.interfaces.virtual import VirtualBus

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.bus import CanBus, provide, unshare
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.codes import BoardMode, BoardType, FocFault, JointFault
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.errors import BusError, ConfigurationError, DeviceError, RefusedError, StaleStateError
from rtf.robot.interfaces import CalibrationParameters
from scripted_boards import ScriptedBoard
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

TICKS = 100.0
JOINTS = """(GENERAL (Joints 3) (AxisName (a b c)) (Encoder 100 -100 100) (Zeros 0 10 0) (ampsToSensor 1000)
    (fullscalePWM 1000) (newtonsToSensor 10))
(CAN (interface virtual) (channel {}) (CanAddresses 3 4) (CanTimeout 200))
(LIMITS (jntPosMin -30 -30 -30) (jntPosMax 30 30 30) (motorOverloadCurrents 5 5 5))
(PIDS (Pid0 100 10 1 500 900 4 0) (Pid1 100 10 1 500 900 4 0) (Pid2 100 10 1 500 900 4 0))"""
MOTORS = """(GENERAL (Joints 2) (Gearbox_M2J 100 -100))
(CAN (interface virtual) (channel {}) (CanAddresses 1 3) (CanTimeout 200))
(LIMITS (jntPosMin -30 -30) (jntPosMax 30 30) (jntVelMax 100 100) (motorPeakCurrents 5 5))
(FOC (MotorPoles 7 7) (HasHallSensor 1 1) (PositionGain 5) (CurrentPid0 8 0 2 100 200 10 0))"""


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A virtual channel of this test alone."""
    return request.node.name.replace("[", "_").rstrip("]")


def boards(channel: str, kind: BoardType, *addresses: int) -> list[ScriptedBoard]:
    """Return boards on a channel."""
    return [ScriptedBoard(BusSettings("virtual", channel), address, kind) for address in addresses]


@pytest.fixture
def joints(channel: str) -> Iterator[tuple[ScriptedBoard, ...]]:
    """Two boards with two axes each."""
    with ExitStack() as stack:
        yield tuple(stack.enter_context(closing(one)) for one in boards(channel, BoardType.MC_4DC, 3, 4))


@pytest.fixture
def motors(channel: str) -> Iterator[tuple[ScriptedBoard, ...]]:
    """Two boards with a motor each."""
    with ExitStack() as stack:
        yield tuple(stack.enter_context(closing(one)) for one in boards(channel, BoardType.FOC_2, 1, 3))


def opened(text: str, channel: str) -> ControlBoard:
    """Return an open control board over the driver."""
    made = make_device("canMotionControl", Property.parse(text.format(channel)))
    assert isinstance(made, ControlBoard)
    return made


@pytest.fixture
def arm(joints: tuple[ScriptedBoard, ...], channel: str) -> Iterator[ControlBoard]:
    """Three joints on the two boards."""
    del joints
    with closing(opened(JOINTS, channel)) as device:
        yield device


@pytest.fixture
def drives(motors: tuple[ScriptedBoard, ...], channel: str) -> Iterator[ControlBoard]:
    """Two joints on the boards that drive motors."""
    del motors
    with closing(opened(MOTORS, channel)) as device:
        yield device


def soon(condition: Callable[[], object]) -> None:
    """Wait until a condition holds; on a busy machine a state may be stale meanwhile."""

    def holds() -> bool:
        with suppress(StaleStateError):
            return bool(condition())
        return False

    eventually(holds, "it has not come about")


# Boards of joints -------------------------------------------------------------------------------------------------


def test_boards_are_configured(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """Each axis gets its controller, limits and time-outs as the file says, and then its mode."""
    first, second = joints
    assert arm.axes() == 3
    assert first.values["position_pid", 0] == (100, 1, 10, 4)
    assert first.values["position_limits", 1] == (0, 900, 500)
    assert (first.values["min_position", 0], first.values["max_position", 0]) == ((-3000,), (3000,))
    assert (first.values["min_position", 1], first.values["max_position", 1]) == ((-4000,), (2000,))
    assert first.latest("set_current_limit") == (5000,)
    assert first.latest("set_velocity_timeout", 1) == (1000,)
    soon(lambda: second.latest("set_control_mode") == (BoardMode.POSITION,))
    assert second.latest("set_control_mode", 1) is None  # the board has an axis that is not used
    assert first.mask & 1


def test_setpoints_are_sent_once(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """A move is one message, in ticks of the axis; the same target again is another one."""
    first, second = joints
    soon(lambda: first.count("position_move") == 2)  # the axes are held where they are
    arm.set_reference_speeds([20.0, 20.0, 40.0])
    arm.position_move([5.0, 5.0, 5.0])
    soon(lambda: second.latest("position_move") == (500, 400))
    soon(lambda: first.latest("position_move", 1) == (-1500, 200))
    assert first.count("position_move") == 4
    arm.position_move(5.0, 0)
    soon(lambda: first.count("position_move") == 5)
    arm.set_control_modes(ControlMode.POSITION_DIRECT, 0)
    arm.set_positions(1.0, 0)
    soon(lambda: first.latest("command_position") == (100,))
    arm.set_control_modes(ControlMode.PWM, 0)
    arm.set_reference_duty_cycles(10.0, 0)
    soon(lambda: first.latest("set_open_loop") == (100,))
    soon(lambda: first.latest("set_open_loop") == (0,))  # which has expired


def test_velocities_are_repeated_and_end(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """A velocity is repeated before the board's time-out, and ends by the host's own if nobody renews it."""
    first, _ = joints
    arm.set_control_modes(ControlMode.VELOCITY, 1)
    arm.velocity_move(-10.0, 1)
    soon(lambda: first.latest("velocity_move", 1) is not None)
    sent = next(values for what, _, values in list(first.commands) if what == "velocity_move")
    assert sent == (16, 2)  # 10 deg/s of 100 ticks, in ticks/ms, times 16
    soon(lambda: first.count("velocity_move") >= 3)
    soon(lambda: first.latest("velocity_move", 1)[0] == 0)


def test_measurements_are_those_of_the_boards(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """Positions, speeds, currents and duty cycles arrive in the robot's units, with the time of their frames."""
    first, _ = joints
    first.positions[:], first.speeds[:], first.duties[:], first.currents[:] = [500, 500], [32, 32], [250, 0], [1500, 0]
    soon(lambda: arm.encoders().tolist() == [5.0, -15.0, 0.0])
    soon(lambda: arm.currents().tolist() == [1.5, 0.0, 0.0])
    soon(lambda: arm.encoder_speeds()[:2].tolist() == [10.0, -10.0])
    soon(lambda: arm.duty_cycles()[0] == 25.0)
    soon(lambda: abs(arm.encoder_times()[0] - clock.now()) < 1.0)


def test_a_fault_is_shown_and_left_by_force_idle(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """A board that reports a fault puts its axis, and no other one, into fault, with the cause in words."""
    joints[0].fail(1, JointFault.OVERCURRENT | JointFault.HALL)
    soon(lambda: arm.control_modes()[1] is ControlMode.HARDWARE_FAULT)
    assert arm.last_joint_fault(1) == (23, "b: board 3 reports overcurrent, hall")
    soon(lambda: arm.control_modes()[0] is ControlMode.POSITION)
    arm.set_control_modes(ControlMode.POSITION, 1)
    soon(lambda: arm.control_modes()[1] is ControlMode.HARDWARE_FAULT)
    arm.set_control_modes(ControlMode.FORCE_IDLE, 1)
    soon(lambda: joints[0].mode[1] is BoardMode.IDLE)
    soon(lambda: arm.control_modes()[1] is ControlMode.IDLE)


def test_old_names_of_modes_are_known(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """The old impedance modes are position and velocity mode; a mode that the boards do not have is refused."""
    arm.set_control_modes(ControlMode.IMPEDANCE_VELOCITY, 0)
    soon(lambda: joints[0].mode[0] is BoardMode.VELOCITY)
    assert arm.control_modes()[0] is ControlMode.VELOCITY
    with pytest.raises(RefusedError, match="does not have the mode icur"):
        arm.set_control_modes(ControlMode.CURRENT, 0)


def test_a_mode_that_is_not_taken_is_a_fault(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """A board that ignores a request is found out, and its axis loses its power."""
    soon(lambda: joints[1].mode[0] is BoardMode.POSITION)
    joints[1].deaf = {"set_control_mode"}
    arm.set_control_modes(ControlMode.VELOCITY, 2)
    soon(lambda: arm.control_modes()[2] is ControlMode.HARDWARE_FAULT)
    assert arm.last_joint_fault(2) == (10, "c: board 4 is in the mode position instead of velocity")


def test_a_board_that_is_reset_is_a_fault_and_configured_again(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """After a reset, positions are asked for again, the axes are in fault, and all settings are sent once more."""
    joints[0].reset()
    soon(lambda: joints[0].mask != 0)
    soon(lambda: arm.control_modes()[0] is ControlMode.HARDWARE_FAULT)
    assert arm.last_joint_fault(0)[1] == "a: board 3 was reset: it is not configured"
    arm.set_control_modes(ControlMode.FORCE_IDLE, 0)
    soon(lambda: joints[0].values.get(("position_pid", 0)) == (100, 1, 10, 4))


def test_a_silent_board_is_reported(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """Old positions are not taken for new ones: reading raises StaleStateError until the board sends again."""
    joints[1].silent = True

    def is_stale() -> bool:
        try:
            arm.encoders()
        except StaleStateError:
            return True
        return False

    soon(is_stale)
    joints[1].silent = False
    soon(lambda: not is_stale())


def test_what_is_lost_with_the_bus_is_not_sent_later(joints: tuple[ScriptedBoard, ...], channel: str):
    """A move that cannot be sent puts its axis into fault, and its board is switched off when the bus is on again."""

    class Cut(VirtualBus):
        out = False

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            if Cut.out:
                raise can.CanOperationError("the cable is out")
            super().send(msg, timeout)

        def recv(self, timeout: float | None = None) -> can.Message | None:
            if Cut.out:
                raise can.CanOperationError("the cable is out")
            return super().recv(timeout)

    def opener(settings: BusSettings) -> can.BusABC:
        if Cut.out:
            raise DeviceError("the cable is out")
        return Cut(channel=settings.channel)

    bus = CanBus(BusSettings("virtual", channel), opener=opener)
    provide(bus)
    with closing(opened(JOINTS, channel)) as arm:
        soon(lambda: joints[0].count("position_move") == 2)  # the axes are held where they are
        Cut.out = True
        arm.position_move(9.0, 0)
        soon(lambda: arm.last_joint_fault(0)[0] == 12)
        with pytest.raises(BusError):
            arm.set_limits(1, -20.0, 20.0)
        Cut.out = False
        soon(lambda: joints[0].mode[0] is BoardMode.IDLE)
        assert arm.control_modes()[:2] == (ControlMode.HARDWARE_FAULT, ControlMode.POSITION)
        arm.set_control_modes(ControlMode.FORCE_IDLE, 1)
        soon(lambda: joints[0].values["min_position", 1] == (-3000,))  # what was lost of axis 1, too
        assert (900,) not in [values[:1] for what, _, values in joints[0].commands if what == "position_move"]
    unshare(bus)


def test_a_calibration_ends_with_that_of_the_board(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """The board gets the parameters; once it has finished, the axis is in position mode."""
    arm.calibrate_axis(0, CalibrationParameters(3, 10, 20, 30))
    soon(lambda: joints[0].latest("calibrate") == (3, 10, 20, 30))
    soon(lambda: arm.control_modes()[0] is ControlMode.CALIBRATING)
    joints[0].mode[0] = BoardMode.IDLE
    joints[0].status()
    soon(lambda: arm.control_modes()[0] is ControlMode.POSITION)
    soon(lambda: joints[0].mode[0] is BoardMode.POSITION)


def test_boards_and_bus_are_variables(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """Types, versions and errors of the boards, and load and counters of the bus, can be asked for, by clients too."""
    expected = Bottle.parse('(3 MC_4DC "1.2.3" "1.6" 4 5) (4 MC_4DC "1.2.3" "1.6" 0 0)')

    def sent() -> bool:  # again and again: the board sends states of its own, without errors
        joints[0].send(motor.STATUS, 0, BoardMode.POSITION, 0, BoardMode.POSITION, 0, 0, 4, 5)
        return bool(arm.variable("canBoards") == expected)

    soon(sent)
    soon(lambda: float(arm.variable("canBus").find("load")) > 0)
    counted = Property.from_bottle(arm.variable("canBus"))
    assert counted.find("received") > 0
    assert counted.find("bus_off") == 0


def test_closing_switches_off(joints: tuple[ScriptedBoard, ...], channel: str):
    """A closed device leaves boards without power, which send nothing."""
    with closing(opened(JOINTS, channel)):
        pass
    soon(lambda: joints[0].mode == [BoardMode.IDLE] * 2 and joints[0].mask == 0)


def test_limits_that_do_not_fit_are_reported(arm: ControlBoard, joints: tuple[ScriptedBoard, ...]):
    """A limit beyond the range of ticks is sent as the greatest one."""
    arm.set_limits(0, -30.0, 1e8)
    soon(lambda: joints[0].values["max_position", 0] == ((1 << 31) - 1,))


# Boards of motors -------------------------------------------------------------------------------------------------


def test_drives_get_setpoints_every_period(drives: ControlBoard, motors: tuple[ScriptedBoard, ...]):
    """One frame has the setpoints of all boards; a position is held by velocities."""
    first, third = motors
    assert first.values["motor_configuration", 0] == (2, 0, 0, 7, 0)
    assert first.values["current_pid", 0] == (8, 2, 0, 10)
    soon(lambda: first.mode[0] is BoardMode.SPEED_CURRENT)
    drives.set_control_modes(ControlMode.CURRENT, 1)
    drives.set_reference_currents(2.0, 1)
    soon(lambda: third.words == (0, 0, 2000))
    drives.set_control_modes(ControlMode.PWM, 1)
    drives.set_reference_duty_cycles(-50.0, 1)
    soon(lambda: third.words[2] == -16000)
    first.positions[0] = -round(65536 * 100 / 360)  # a degree of the joint below its setpoint
    soon(lambda: first.words[0] == round(5 * 100 / (360 / 65.536)))


def test_drives_measure_joints_through_their_gearboxes(drives: ControlBoard, motors: tuple[ScriptedBoard, ...]):
    """A rotor's position and speed are those of the joint times the gearbox, with its sign."""
    _, third = motors
    third.positions[0], third.speeds[0], third.currents[0] = 65536 * 10, 100, -700
    soon(lambda: drives.encoders()[1] == pytest.approx(-36.0))
    soon(lambda: drives.motor_encoders()[1] == pytest.approx(3600.0))
    soon(lambda: drives.encoder_speeds()[1] == pytest.approx(-5.4931640625))
    soon(lambda: drives.currents()[1] == -0.7)


def test_faults_of_drives(drives: ControlBoard, motors: tuple[ScriptedBoard, ...]):
    """A drive in fault says why; other modes than those it has are refused."""
    motors[0].fail(0, FocFault.SETPOINT_EXPIRED)
    soon(lambda: drives.control_modes()[0] is ControlMode.HARDWARE_FAULT)
    assert drives.last_joint_fault(0)[1] == "joint0: board 1 reports setpoint expired"
    with pytest.raises(RefusedError):
        drives.set_control_modes(ControlMode.TORQUE, 1)


# Boards that cannot be used ---------------------------------------------------------------------------------------


def test_settings_that_are_not_taken_are_reported(joints: tuple[ScriptedBoard, ...], channel: str):
    """What can be read back is compared with what was sent."""
    joints[0].deaf = {"set_max_position"}
    with pytest.raises(DeviceError, match=r"a: board 3 has not taken set_max_position: it has \(0,\), not \(3000,\)"):
        opened(JOINTS, channel)


def test_two_boards_with_one_address_are_reported(joints: tuple[ScriptedBoard, ...], channel: str):
    """A question has two answers then."""
    joints[1].twins = 2
    with pytest.raises(DeviceError, match=r"two boards on virtual .* have the address 4: disconnect one"):
        opened(JOINTS, channel)


def test_other_boards_are_refused(joints: tuple[ScriptedBoard, ...], channel: str):
    """A board of another type or protocol, and one that is not there, are named."""
    joints[0].kind = BoardType.STRAIN
    with pytest.raises(DeviceError, match=r"board 3 on virtual .* is no motor board but a STRAIN"):
        opened(JOINTS, channel)
    joints[0].kind, joints[0].acknowledged = BoardType.MC_4DC, 0
    with pytest.raises(DeviceError, match=r"speaks version 1.6 of the protocol, not 1.6"):
        opened(JOINTS, channel)
    joints[0].silent = True
    with pytest.raises(DeviceError, match="does not answer get_version within 1 ms, asked 3 times"):
        opened(JOINTS.replace("(CanTimeout 200)", "(CanTimeout 1) (CanRetries 2)"), channel)


def test_an_axis_belongs_to_one_device(arm: ControlBoard, joints: tuple[ScriptedBoard, ...], channel: str):
    """A second device on the same boards is refused, and the first one keeps its power."""
    with pytest.raises(DeviceError, match="another device has axis 0 of board 3"):
        opened(JOINTS, channel)
    arm.position_move(2.0, 0)
    soon(lambda: joints[0].latest("position_move") == (200, 100))
    assert joints[0].mode[0] is BoardMode.POSITION


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("(CanAddresses 3 4)", "(CanAddresses 3 3)", "CanAddresses"),
        ("(CanAddresses 3 4)", "(CanAddresses 3 15)", "CanAddresses"),
        ("(Encoder 100 -100 100)", "(Encoder 100 0 100)", "joint 1 is 0"),
        ("(Encoder 100 -100 100)", "(Encoder 100 100)", "list of 3 numbers"),
        ("(Pid0 100 10 1 500 900 4 0)", "(Pid0 100 10 1 500 900 40 0)", "Pid0"),
        ("(jntPosMin -30 -30 -30)", "(jntPosMin -30 40 -30)", "minimum of joint 1"),
        ("(interface virtual)", "", "interface is missing"),
    ],
)
def test_wrong_configurations_are_reported(before: str, after: str, said: str):
    """The error names the key."""
    with pytest.raises(ConfigurationError, match=said):
        opened(JOINTS.replace(before, after), "unused")
