"""The configuration on the page about CAN is one that the driver takes."""

from __future__ import annotations

import re
from pathlib import Path

from rtf.robot.boards.can_frames import CanFramesDevice
from rtf.robot.device import SHIPPED
from rtf.robot.devices.can.axis_settings import can_settings
from rtf.robot.devices.can.bus_settings import BusSettings, bus_settings
from rtf.robot.interface.robot_reader import read_robot

PAGE = Path(__file__).parents[2] / "docs" / "can.md"


def blocks() -> list[str]:
    """The XML on the page: the driver of the boards, and what publishes frames."""
    return re.findall(r"```xml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def devices(folder: Path, text: str):
    """Return the devices of a file of a robot with these."""
    file = folder / "robot.xml"
    file.write_text(f'<robot name="icub" build="1" portprefix="icub"><devices>{text}</devices></robot>')
    return read_robot(file).robot.devices


def test_frames_are_published_as_the_page_says(tmp_path: Path):
    """The bus, and the server that is attached to it, with the name that tests expect."""
    _, text = blocks()
    bus, server = devices(tmp_path, text)
    assert bus_settings(bus.configuration) == BusSettings("socketcan", "can0")
    made = CanFramesDevice("frames")
    made.open(server.configuration)
    assert made.port_name == "/icub/can/can0"
    assert server.kind in SHIPPED


def test_the_configuration_is_taken(tmp_path: Path):
    """The file of a robot with the device of the page has its axes, limits, scales and bus."""
    device, _ = blocks()
    (entry,) = devices(tmp_path, device)
    settings = can_settings(entry.configuration)
    assert [one.axis.name for one in settings.axes] == ["neck_pitch", "neck_roll", "neck_yaw", "eyes_tilt"]
    assert [(one.board, one.index) for one in settings.axes] == [(1, 0), (1, 1), (2, 0), (2, 1)]
    assert settings.axes[3].scale.ticks == -182.044
    assert settings.axes[0].axis.minimum == -30
    assert settings.axes[0].scale.raw_pid(settings.axes[0].axis.pid)[:4] == (300, 1, 10, 6)
    assert bus_settings(entry.configuration) == BusSettings("socketcan", "can0")
