"""The files of the drivers of emulated boards, and the iCub that is made of them."""

from __future__ import annotations

import threading
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.robot.device import make_device
from rtf.robot.devices.can.bus_settings import BusSettings, bus_settings
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.errors import StaleStateError
from rtf.robot.interface.robot_reader import read_robot
from rtf.robot.interfaces import IAxisInfo, IEncoders, IMultipleAnalogSensors, SensorCategory, SensorStatus
from rtf.robot.model import load_robot
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.bridge import Bridge
from rtf.simulator.firmware.robot_files import robot_files
from rtf.simulator.plant import Options, build
from rtf.simulator.robot_sensors import RobotSensors
from rtf.simulator.simulation import Simulation
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.device import Device

ICUB = Path(__file__).parents[3] / "suites" / "robots" / "icubCan"
LEGS = ("left_leg", "right_leg")


def firmware_of(robot: str, *drives: str, factor: float | None = None) -> Firmware:
    """Return the boards of a robot."""
    simulation = Simulation(build(load_robot(robot), Options()), factor=factor)
    return Firmware(simulation, sensors=RobotSensors(simulation), drives=drives)


def test_the_files_of_the_icub_are_those_of_its_boards():
    """After a change of boards or gains: rtf can-boards --drives left_leg,right_leg --files suites/robots/icubCan."""
    files = robot_files(firmware_of("icub", *LEGS))
    assert set(files) == {one.name for one in ICUB.glob("*.xml")} - {"icubCan.xml", "simulation.xml"}
    for name, text in files.items():
        assert (ICUB / name).read_text(encoding="utf-8") == text, name


def test_the_icub_is_read_without_warnings():
    """With boards elsewhere and with simulated ones; each bus has its own port or name."""
    elsewhere = read_robot(ICUB / "icubCan.xml", Property({"port": 50000}))
    simulated = read_robot(ICUB / "icubCan.xml", Property.parse("(enable_tags (simulated)) (interface simulated)"))
    assert elsewhere.warnings == simulated.warnings == ()
    boards = [entry for entry in elsewhere.robot.devices if entry.kind == "canBusMotionControl"]
    ports = [dict(bus_settings(entry.configuration).options)["port"] for entry in boards]
    assert sorted(ports) == [*range(50000, 50010)]
    first, *others = simulated.robot.devices
    assert first.kind == "simulatedICub"
    named = [bus_settings(entry.configuration).channel for entry in others if entry.kind == "canBusMotionControl"]
    assert named == [entry.name for entry in boards]


@pytest.fixture
def served() -> Iterator[Firmware]:
    """The boards of the bench in real time, on virtual buses."""
    made = firmware_of("bench", factor=1.0)
    ended = threading.Event()

    def run() -> None:
        while not ended.is_set():
            made.simulation.advance(made.simulation.now + 0.02)

    with ExitStack() as opened:
        for number, wire in enumerate(made.wires.values()):
            bridge = Bridge(wire, BusSettings("virtual", f"robot-files-{number}"), made.simulation, print)
            opened.enter_context(closing(bridge))
        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        yield made
        ended.set()
        thread.join()


def _measures(board: Device) -> bool:
    """Whether a board has positions; on a busy machine they may be stale."""
    with suppress(StaleStateError):
        return bool(np.isfinite(board.view(IEncoders).encoders()).all())
    return False


def test_drivers_from_the_files_reach_the_boards(served: Firmware, tmp_path: Path):
    """Every device of a bus opens on the interface of the command line, and measures."""
    includes = []
    for name, text in robot_files(served).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
        includes.append(f'<xi:include href="{name}"/>')
    robot = tmp_path / "bench.xml"
    robot.write_text(
        '<?xml version="1.0" encoding="UTF-8" ?>\n'
        '<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" '
        '"http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">\n'
        '<robot name="bench" build="1" portprefix="/bench" xmlns:xi="http://www.w3.org/2001/XInclude">'
        f"<devices>{''.join(includes)}</devices></robot>",
        encoding="utf-8",
    )
    given = Property({"interface": "virtual", "channel": "robot-files-{}"})
    entries = {entry.name: entry for entry in read_robot(robot, given).robot.devices}
    with ExitStack() as opened:
        board, imu = (
            opened.enter_context(closing(make_device(entries[name].kind, entries[name].configuration)))
            for name in ("arm0", "inertial")
        )
        assert board.view(IAxisInfo).axis_names() == served.simulation.boards.names
        eventually(lambda: _measures(board), "no positions")
        sensors = imu.view(IMultipleAnalogSensors)
        for category in (SensorCategory.GYROSCOPE, SensorCategory.ORIENTATION):
            eventually(lambda which=category: sensors.sensor_status(which, 0) is SensorStatus.OK, "no values")
    assert [one.board_type for one in served.all_boards] == [BoardType.BLL, BoardType.MTB4]
