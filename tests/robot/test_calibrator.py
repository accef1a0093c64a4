"""The calibrator: it finds the zeros in the configured order, moves within time limits, and can be aborted."""

from __future__ import annotations

import threading
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle, Property
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import Calibrator, Device, make_device
from rtf.robot.devices.calibrator import BoardCalibrator
from rtf.robot.devices.calibrator_settings import CalibratorSettings
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError, RefusedError, RobotError
from rtf.robot.interface.actions import TakesCalibrator
from rtf.robot.interfaces import CalibrationParameters, Pid, PidType
from rtf.robot.yarp3.client import RemoteControlBoard

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network

    from .sensor_bench import ManualClock

FULL = "(GENERAL (Joints 3) (AxisName (pitch roll yaw)))"
CONFIGURATION = """
(GENERAL (joints 3))
(CALIBRATION (calibrationType 3 3 5) (calibration1 11 12 13) (calibration2 21 22 23) (calibration3 31 32 33)
    (calibrationZero 1 2 3) (calibrationDelta 0.5 0 0) (calibrationTimeout 4 4 4)
    (startupPosition 10 20 30) (startupVelocity 10 10 10) (startupMaxPwm 40 0 200) (startupPosThreshold 2 2 2))
(HOME (PositionHome 5 5 5) (VelocityHome 10 10 10))
(PARK (positionPark (50 60 70)) (velocityPark (30 30 30)))
(CALIB_ORDER (0 1) (2))
"""
GAINS = Pid(kp=1.0, max_output=100.0, max_integral=50.0)


class Board(FakeBoard):
    """A board that is to be calibrated, and records calls. ``looked`` is called by each ``calibration_done``."""

    def __init__(self) -> None:
        super().__init__("head")
        self.open(Property.parse(FULL))
        self.calls: list[tuple[object, ...]] = []
        self.needed = dict.fromkeys(range(3), 3)  # looks until a joint is calibrated
        self.looked: Callable[[], object] = lambda: None
        self.weakest = [100.0] * 3
        for joint in range(3):
            self.set_pid(PidType.POSITION, joint, GAINS)
            self.board.calibrated[joint] = False

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """See IControlCalibration; the calibration ends after some calls of ``calibration_done``."""
        self.calls.append(("calibrate", joint, parameters))
        self.set_calibration_parameters(joint, parameters)

    def calibration_done(self, joint: int) -> bool:
        """See IControlCalibration."""
        self.looked()
        self.needed[joint] -= 1
        return self.needed[joint] <= 0

    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        """See IPidControl."""
        self.weakest[joint] = min(self.weakest[joint], pid.max_output)
        super().set_pid(kind, joint, pid)

    def position_move(self, targets: object, joints: object = None) -> None:
        """See IPositionControl."""
        self.calls.append(("move", joints, np.asarray(targets).tolist()))
        super().position_move(targets, joints)

    def stop(self, joints: object = None) -> None:
        """See IPositionControl."""
        self.calls.append(("stop", joints))
        super().stop(joints)

    def gains(self) -> list[Pid]:
        """Return the gains of the position controllers."""
        return [self.pid(PidType.POSITION, joint) for joint in range(3)]


def calibrator(text: str = CONFIGURATION, network: Network | None = None) -> BoardCalibrator:
    """A calibrator of a board of three joints."""
    made = make_device("icubCalibrator", Property.parse(text), name="head_calibrator", network=network)
    assert isinstance(made, BoardCalibrator)
    return made


def in_another_thread(job: Callable[[], object]) -> Callable[[], None]:
    """Return a function that runs the job in another thread, and waits for its end."""

    def done() -> None:
        thread = threading.Thread(target=job)
        thread.start()
        thread.join(10)

    return done


def test_groups_follow_each_other(stepped: ManualClock):
    """Joints of a list are calibrated together and go to their startup positions before the next list begins."""
    board = Board()
    calibrator().calibrate(board)
    assert [
        ("calibrate", 0, CalibrationParameters(3, 11, 21, 31, 0, 0, 1.5)),
        ("calibrate", 1, CalibrationParameters(3, 12, 22, 32, 0, 0, 2)),
        ("move", [0, 1], [10, 20]),
        ("calibrate", 2, CalibrationParameters(5, 13, 23, 33, 0, 0, 3)),
        ("move", [2], [30]),
    ] == board.calls
    assert board.encoders().tolist() == pytest.approx([10, 20, 30])


def test_controllers_are_weak_meanwhile(stepped: ManualClock):
    """During the calibration outputs are limited by startupMaxPwm, 0 is no limit; the gains are restored."""
    board = Board()
    calibrator().calibrate(board)
    assert board.weakest == [40, 100, 100]
    assert board.gains() == [GAINS] * 3


def test_home_and_park(stepped: ManualClock):
    """Homing and parking move all joints to their positions at the configured speeds."""
    board, moves = Board(), calibrator()
    moves.home(board)
    assert board.encoders().tolist() == pytest.approx([5, 5, 5])
    assert board.reference_speeds().tolist() == [10, 10, 10]
    moves.park(board)
    assert board.encoders().tolist() == pytest.approx([50, 60, 70])
    assert board.reference_speeds().tolist() == [30, 30, 30]
    assert set(board.control_modes()) == {ControlMode.POSITION}


def test_parked_joints_may_be_switched_off(stepped: ManualClock):
    """With powerOff parked joints are idle; one that did not arrive keeps its power, because it might fall."""
    board, text = Board(), CONFIGURATION.replace("(PARK", "(PARK (powerOff yes)")
    board.set_limits(1, 0, 40)
    with pytest.raises(DeviceError, match=r"joint 1 \(roll\) is at 40\.0 deg, not at 60\.0, in mode pos$"):
        calibrator(text).park(board)
    assert board.control_modes() == (ControlMode.IDLE, ControlMode.POSITION, ControlMode.IDLE)


def test_without_a_parking_pose_home_is_it(stepped: ManualClock):
    """Without a parking position the joints park at home, as the robots' files need it."""
    board = Board()
    calibrator(CONFIGURATION.replace("(PARK", "(NONE")).park(board)
    assert board.encoders().tolist() == pytest.approx([5, 5, 5])


def test_parking_takes_a_bounded_time(stepped: ManualClock):
    """After parkTimeout the error names the joints that did not arrive; they stop, and powerless ones are not moved."""
    board, text = Board(), CONFIGURATION.replace("(PARK", "(PARK (parkTimeout 1 1 1)")
    board.set_control_modes(ControlMode.IDLE, 2)
    began = stepped.time
    with pytest.raises(DeviceError, match=r"joint 0 .*joint 1 .*joint 2 \(yaw\) is at 0\.0 deg.*in mode idl"):
        calibrator(text).park(board)
    assert 1 <= stepped.time - began < 1.1
    assert ("move", [0, 1], [50, 60]) in board.calls
    assert board.motion_done()


def test_a_joint_that_breaks_is_not_waited_for(stepped: ManualClock):
    """Parking with a joint in fault ends when the other joints have arrived."""
    board = Board()
    board.set_max_current(0, 0.0)
    began = stepped.time
    with pytest.raises(DeviceError, match=r"joint 0 \(pitch\).*hwfa$"):
        calibrator().park(board)
    assert stepped.time - began < 3
    assert board.encoders([1, 2]).tolist() == pytest.approx([60, 70])


def test_joints_may_be_left_out(stepped: ManualClock):
    """Joints with disableHomeAndPark are not moved home."""
    board = Board()
    calibrator(CONFIGURATION.replace("(HOME", "(HOME (disableHomeAndPark 0 1 1)")).home(board)
    assert board.encoders().tolist() == pytest.approx([5, 0, 0])


def test_a_joint_that_cannot_be_calibrated(stepped: ManualClock):
    """A joint that exceeds its timeout is named and idle, the others stop, and the gains are restored."""
    board = Board()
    board.needed[1] = 10**9
    began = stepped.time
    with pytest.raises(DeviceError, match=r"head by head_calibrator: joint 1 \(roll\) not calibrated within 4 s"):
        calibrator().calibrate(board)
    assert 4 <= stepped.time - began < 4.1
    assert board.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.POSITION)
    assert board.calls[-1] == ("stop", [0, 1])
    assert board.gains() == [GAINS] * 3


def test_faults_are_left_if_that_is_asked_for(stepped: ManualClock):
    """The calibration clears faults only with clearHwFaultBeforeCalibration."""
    board = Board()
    board.set_max_current(1, 0.0)
    with pytest.raises(DeviceError, match="hwfa"):
        calibrator().calibrate(board)
    board.set_max_current(1, 5.0)
    text = CONFIGURATION.replace("(joints 3)", "(joints 3) (clearHwFaultBeforeCalibration true)")
    calibrator(text).calibrate(board)
    assert board.encoders().tolist() == pytest.approx([10, 20, 30])


def test_calibration_can_be_skipped(stepped: ManualClock, network: Network, said: list[str]):
    """With skipCalibration the zeros stay, which is reported, and the joints go to their startup positions."""
    board = Board()
    calibrator(CONFIGURATION.replace("(joints 3)", "(joints 3) (skipCalibration true)"), network).calibrate(board)
    assert [call[0] for call in board.calls] == ["move", "move"]
    assert said == ["head_calibrator: skipCalibration is set; head keeps its current zeros"]


@pytest.mark.parametrize("look", [1, 2, 3, 5])
def test_abort_of_a_calibration(stepped: ManualClock, look: int):
    """An abort from another thread ends the calibration at once, stops the joints, and restores the gains."""
    board, made = Board(), calibrator()
    looks = iter(range(1, 10**6))
    abort = in_another_thread(made.abort)
    board.looked = lambda: abort() if next(looks) == look else None
    began = stepped.time
    with pytest.raises(DeviceError, match="the calibration of head by head_calibrator was aborted"):
        made.calibrate(board)
    assert stepped.time - began < 0.2
    assert board.calls[-1][0] == "stop"
    assert board.motion_done()
    assert board.gains() == [GAINS] * 3
    board.looked = lambda: None
    made.calibrate(board)


def test_abort_of_a_parking_by_the_machines_clock():
    """An abort ends a slow parking in real time, and stops the joints."""
    board, made = Board(), calibrator(CONFIGURATION.replace("(30 30 30)", "(1 1 1)"))
    moving, errors = threading.Event(), []
    begin = board.position_move

    def position_move(*arguments: object) -> None:
        begin(*arguments)
        moving.set()

    board.position_move = position_move

    def park() -> None:
        try:
            made.park(board)
        except DeviceError as error:
            errors.append(str(error))

    thread = threading.Thread(target=park)
    thread.start()
    assert moving.wait(10)
    made.abort()
    thread.join(5)
    assert errors == ["the parking of head by head_calibrator was aborted"]
    assert board.motion_done()


def test_abort_without_anything_going_on(stepped: ManualClock):
    """An abort of nothing does not affect the next calibration."""
    board, made = Board(), calibrator()
    made.abort()
    made.calibrate(board)


def test_one_thing_at_a_time(stepped: ManualClock):
    """During a calibration another action is refused, and the calibration goes on."""
    board, made = Board(), calibrator()
    refused: list[RobotError] = []

    def home() -> None:
        try:
            made.home(board)
        except RobotError as error:
            refused.append(error)

    begin = in_another_thread(home)
    board.looked = lambda: None if refused else begin()
    made.calibrate(board)
    assert [type(error) for error in refused] == [RefusedError]


def test_parking_ends_a_calibration(stepped: ManualClock):
    """Parking aborts a running calibration, and parks the joints that are calibrated."""
    board, made = Board(), calibrator()
    began, errors = threading.Event(), []
    board.needed[0] = 10**9
    board.looked = began.set

    def calibrate() -> None:
        try:
            made.calibrate(board)
        except DeviceError as error:
            errors.append(str(error))

    text = CONFIGURATION.replace("(calibrationTimeout 4 4 4)", "(calibrationTimeout 1e9 1e9 1e9)")
    made.open(Property.parse(text))
    thread = threading.Thread(target=calibrate)
    thread.start()
    assert began.wait(10)
    board.looked = lambda: None
    with pytest.raises(DeviceError, match=r"joint 0 .*in mode idl; joint 1 .*in mode idl$"):  # never calibrated
        made.park(board)
    thread.join(10)
    assert errors == ["the calibration of head by head_calibrator was aborted"]
    assert board.encoders(2).tolist() == pytest.approx([70])


def test_another_board(stepped: ManualClock):
    """A calibrator refuses a board with fewer joints, a device that is no board, and any board before it is opened."""
    other = FakeBoard("two")
    other.open(Property.parse("(GENERAL (Joints 2))"))
    with pytest.raises(DeviceError, match="head_calibrator is for 3 joints; two has 2"):
        calibrator().park(other)
    with pytest.raises(NotSupportedError):
        calibrator().park(calibrator())
    with pytest.raises(DeviceError, match="not open"):
        BoardCalibrator("new").calibrate(other)


class TestRemoteCalibrator:
    """Clients use the calibrator of a board, also through the network."""

    def test_without_one(self):
        """A board without a calibrator says that it has none, and calls raise NotSupportedError."""
        board = Board()
        assert isinstance(board, TakesCalibrator)
        assert not board.has_calibrator()
        for call in (board.calibrate_part, board.home_part, board.park_part, board.quit_calibrate, board.quit_park):
            with pytest.raises(NotSupportedError, match="head has no calibrator"):
                call()
        with pytest.raises(NotSupportedError):
            board.calibrate_joint(0)

    def test_parts_only(self):
        """A calibrator without IRemoteCalibrator's single joints calibrates parts, and refuses joints."""

        class Parts(Calibrator):
            def open(self, configuration: Property) -> None: ...
            def close(self) -> None: ...
            def calibrate(self, target: Device) -> None: ...
            def home(self, target: Device) -> None: ...
            def park(self, target: Device) -> None: ...
            def abort(self) -> None: ...

        board = Board()
        board.set_calibrator(Parts("parts"))
        board.calibrate_part()
        with pytest.raises(NotSupportedError, match=r"parts \(Parts\) calibrates whole parts only"):
            board.park_joint(0)

    def test_through_the_network(self, stepped: ManualClock, network: Network):
        """Requests for the part and for single joints reach the calibrator; its errors reach the client."""
        board = Board()
        board.set_calibrator(calibrator(network=network))
        with (
            closing(ControlBoardServer(board, "/robot/head", network=network)),
            RpcClient("/client", "/robot/head/rpc:i", network=network) as asking,
            closing(RemoteControlBoard("client", network=network)) as client,
        ):
            client.open(Property({"remote": "/robot/head", "local": "/local", "carrier": "tcp"}))
            assert str(asking.call(Bottle.parse("[get] [reca] [isca]"))) == "[is] [reca] 1 [ok]"
            assert client.has_calibrator()
            client.calibrate_joint(2)
            assert board.encoders().tolist() == pytest.approx([0, 0, 30])
            client.calibrate_part()
            assert board.encoders().tolist() == pytest.approx([10, 20, 30])
            client.home_joint(1)
            assert board.encoders().tolist() == pytest.approx([10, 5, 30])
            client.home_part()
            client.park_joint(0)
            assert board.encoders().tolist() == pytest.approx([50, 5, 5])
            client.park_part()
            assert board.encoders().tolist() == pytest.approx([50, 60, 70])
            client.quit_calibrate()
            client.quit_park()
            with pytest.raises(RobotError):
                client.park_joint(3)


class TestConfiguration:
    """The configuration of a calibrator, and its errors, which name the list."""

    @pytest.mark.parametrize(
        ("old", "new", "said"),
        [
            ("(joints 3)", "", "joints: 0 is not a whole number"),
            ("(calibration2 21 22 23)", "", "CALIBRATION calibration2: it is missing; it has 3 numbers"),
            ("(calibration2 21 22 23)", "(calibration2 21 22)", "CALIBRATION calibration2: 21 22 is not a list of 3"),
            ("(startupVelocity 10 10 10)", "(startupVelocity 10 fast 10)", "startupVelocity: 10 fast 10 is not a list"),
            ("(VelocityHome 10 10 10)", "(VelocityHome 10 -1 10)", "HOME velocityHome: joint 1 has a negative"),
            ("(0 1) (2)", "(0 1) (3)", "CALIB_ORDER: 3 are not joints from 0 to 2"),
            ("(0 1) (2)", "(0 1) (1 2)", "CALIB_ORDER: a joint is there twice"),
            ("(HOME", "(HOUSE", "HOME positionHome: it is missing"),
        ],
    )
    def test_what_is_wrong(self, old: str, new: str, said: str):
        """A calibrator with an invalid configuration is not opened."""
        with pytest.raises(ConfigurationError) as caught:
            calibrator(CONFIGURATION.replace(old, new))
        assert said in str(caught.value)

    @pytest.mark.parametrize("order", ["(0 1) (2)", "((0 1) (2))"])
    def test_the_order(self, order: str):
        """CALIB_ORDER has lists of joints, or one list of them; without it all joints are calibrated together."""
        read = CalibratorSettings.read
        assert read(Property.parse(CONFIGURATION.replace("(0 1) (2)", order))).order == ((0, 1), (2,))
        assert read(Property.parse(CONFIGURATION.replace("CALIB_ORDER", "NONE"))).order == ((0, 1, 2),)

    def test_older_names(self):
        """The names PositionZero and velocityZero are accepted for startupPosition and startupVelocity."""
        text = CONFIGURATION.replace("startupPosition", "PositionZero").replace("startupVelocity", "velocityZero")
        assert CalibratorSettings.read(Property.parse(text)).startup.positions.tolist() == [10, 20, 30]

    @given(text=st.text(alphabet="() 0123-.eaCALIBRTONHMEjoints\"'[]{}", max_size=60))
    def test_whatever_is_written(self, text: str):
        """Any text instead of the lists raises ConfigurationError."""
        configuration = Property.parse(CONFIGURATION)
        configuration.put("CALIB_ORDER", text)
        configuration.put("CALIBRATION", text)
        with pytest.raises(ConfigurationError):
            CalibratorSettings.read(configuration)
