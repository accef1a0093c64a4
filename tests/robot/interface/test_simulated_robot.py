"""The shipped configuration of the simulated robot: it starts, calibrates, answers, parks, and leaves no port."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from icub import PARTS
from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.devices.calibrator import BoardCalibrator
from rtf.robot.errors import ConfigurationError, DeviceError, RefusedError, StaleStateError
from rtf.robot.interface.robot_reader import read_robot
from rtf.robot.interfaces import IAnalogSensor, IEncoders, IPositionControl, PidType, SensorCategory
from rtf.robot.sensors.analog_sensors import AnalogSensorsClient
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.simulator.control_client import SimulatorControl
from rtf.simulator.part import SimulatedPart
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

SHIPPED = Path(__file__).parents[3] / "suites" / "robots" / "icubSim" / "icubSim.xml"
_LIMIT = 60.0


class Program:
    """The robot interface in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self._err = folder / "stderr.txt"
        with self._err.open("wb") as err:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "rtf", "robotinterface", "--config", str(SHIPPED), "--factor", "10"],
                stdin=subprocess.DEVNULL,
                stderr=err,
                env={**os.environ, "NO_COLOR": "1"},
                cwd=folder,
            )

    @property
    def said(self) -> str:
        """The program's messages up to now."""
        return self._err.read_text(encoding="utf-8")

    def until(self, text: str) -> None:
        """Wait until a text is among the program's messages."""
        eventually(lambda: text in self.said or self.process.poll() is not None, f"{text!r} does not come", _LIMIT)
        assert text in self.said, self.said


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Program]:
    """The running program, with a name server of its own."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
    monkeypatch.setenv("YARP_DATA_HOME", str(tmp_path / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_ROBOT_NAME", "RTF_CLOCK", "YARP_CLOCK"):
        monkeypatch.delenv(name, raising=False)
    with NameServer() as server:
        configuration.write_place(server.contact)
        made = Program(tmp_path)
        yield made
        if made.process.poll() is None:
            made.process.kill()
        made.process.wait()


def test_from_start_to_end(program: Program):
    """Each part is calibrated at startup and parked at the end; between, boards, calibrators and sensors answer."""
    program.until("icubSim is ready")
    for part in PARTS:
        assert f"calibrate of {part}_calibrator (startup, level 10) done" in program.said
    network = Network(configuration.find_names())
    with (
        closing(RemoteControlBoard("client", network=network)) as arm,
        closing(AnalogSensorsClient("client", network=network)) as sensors,
        RpcClient("/asks", "/icubSim/yarprobotinterface", network=network) as asking,
    ):
        arm.open(Property({"remote": "/icubSim/left_arm", "local": "/client/left_arm", "carrier": "tcp"}))
        sensors.open(Property({"remote": "/icubSim/FTs", "local": "/client/FTs", "carrier": "tcp"}))
        assert arm.has_calibrator()
        assert set(arm.control_modes()) == {ControlMode.POSITION}
        assert arm.encoders([0, 1, 3]).tolist() == pytest.approx([-30, 45, 45], abs=0.5)
        arm.park_joint(3)
        assert arm.encoders(3)[0] == pytest.approx(60, abs=2.0)
        assert len(sensors.sensors(SensorCategory.FORCE_TORQUE)) == 6
        eventually(lambda: _reads(sensors), "no measurement of the force-torque sensors comes")
        names = {contact.name for contact in network.names.list("/icubSim")}
        assert {
            f"/icubSim/{one}" for one in ("inertial", "left_foot/analog:o", "left_hand/analog:o", "head/stateExt:o")
        } <= names
        assert {f"/icubSim/skin/{side}_{part}" for side in ("left", "right") for part in ("hand", "forearm")} <= names
        assert str(asking.call(Bottle.parse("quit"), timeout=10)) == "bye"
    assert program.process.wait(_LIMIT) == 0, program.said
    for part in PARTS:
        assert f"park of {part}_calibrator (interrupt1, level 1) done" in program.said
    assert [contact.name for contact in network.names.list("/icubSim")] == []
    assert "[ERROR]" not in program.said, program.said


def _reads(sensors: AnalogSensorsClient) -> bool:
    try:
        return sensors.read_sensor(SensorCategory.FORCE_TORQUE, 0).values.shape == (6,)
    except StaleStateError:  # no message has come yet
        return False


def test_its_files_are_sound():
    """The reader reads the shipped files without warnings, and each calibrator can be made from its file."""
    reading = read_robot(SHIPPED)
    assert reading.warnings == ()
    for entry in reading.robot.devices:
        if entry.kind == "icubCalibrator":
            make_device(entry.kind, entry.configuration.copy()).close()


def test_the_time_of_the_simulation_is_that_of_the_process(network: Network):
    """While the robot is open, this process uses simulated time; a second robot or a wrong parameter opens nothing."""
    before = clock.current()
    robot = make_device("simulatedICub", Property({"factor": 20.0}), network=network)
    with closing(robot):
        time = clock.current()
        here = time.now()
        assert here < 3600.0  # counted from its beginning, and not that of the machine
        time.sleep(1.0)
        assert time.now() - here >= 1.0
        with pytest.raises(DeviceError, match="there is a port /clock already"):
            make_device("simulatedICub", network=network)
        assert clock.current() is time
    assert clock.current() is before
    for wrong in ({"factor": 0}, {"seed": -1}, {"collision": "hard"}):
        with pytest.raises(ConfigurationError):
            make_device("simulatedICub", Property(wrong), network=network)
    late = time.now()
    time.sleep(0.01)
    assert time.now() >= late + 0.01


def test_it_has_the_control_port_and_the_faults_of_a_simulated_robot(network: Network):
    """Faults of joints and sensors act on attached devices; the control port cannot end the program."""
    robot = make_device("simulatedICub", Property({"factor": 20.0}), network=network)
    with closing(robot), SimulatorControl("icubSim", network=network) as control:
        sensor = make_device("simulatedForceTorque", Property({"sensor": "l_arm_ft_sensor"}))
        sensor.attach({"robot": robot})
        torso = make_device("simulatedBoard", Property({"part": "torso"}), name="torso")
        torso.attach({"robot": robot})
        readings = sensor.view(IAnalogSensor)
        clock.current().sleep(0.1)  # before the first step no motor carries the arm
        before = readings.read().values
        control.inject("ft_bias", "left_arm", {"force": 50.0})
        clock.current().sleep(0.1)
        assert readings.read().values[0] - before[0] == pytest.approx(50.0, abs=2.0)
        control.inject("motor_dead", "torso_yaw")
        torso.view(IPositionControl).position_move(10.0, 0)
        clock.current().sleep(2.0)
        assert torso.view(IEncoders).encoder(0) == pytest.approx(0.0, abs=2.0)
        assert control.clear() == 2
        clock.current().sleep(3.0)
        assert torso.view(IEncoders).encoder(0) == pytest.approx(10.0, abs=1.0)
        with pytest.raises(RefusedError, match="end 'rtf robotinterface'"):
            control.quit()


def test_abort_on_the_simulated_robot(network: Network):
    """An aborted calibration stops the moving joints and restores the controllers."""
    entry = read_robot(SHIPPED).robot.device("left_arm_calibrator")
    assert entry is not None
    board = make_device("simulatedBoard", Property({"part": "left_arm"}), name="left_arm")
    calibrator = make_device(entry.kind, entry.configuration.copy(), name="calibrator", network=network)
    assert isinstance(calibrator, BoardCalibrator)
    with closing(make_device("simulatedICub", Property({"factor": 4.0}), network=network)) as robot:
        board.attach({"robot": robot})
        arm = board.implementation
        assert isinstance(arm, SimulatedPart)
        before = arm.pids(PidType.POSITION)
        arm.set_reference_speeds([100.0, 100.0], [0, 1])
        arm.position_move([-80.0, 100.0], [0, 1])
        eventually(lambda: arm.motion_done([0, 1]), "the arm does not move away")
        with ThreadPoolExecutor(1) as pool:
            calibration = pool.submit(calibrator.calibrate, arm)
            eventually(lambda: not arm.motion_done(1), "the arm does not move home")
            assert arm.pids(PidType.POSITION) != before
            calibrator.abort()
            with pytest.raises(DeviceError, match="aborted"):
                calibration.result(10)
        eventually(arm.motion_done, "the arm does not stop")
        assert arm.encoders(1)[0] > 46
        assert arm.pids(PidType.POSITION) == before
        calibrator.calibrate(arm)
        assert arm.encoders([0, 1]).tolist() == pytest.approx([-30, 45], abs=2)
