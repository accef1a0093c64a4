"""The parts and sensors of a simulated robot as drivers on its CAN buses have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property
from rtf.robot.devices.can.motion_control import CanMotionControl
from rtf.robot.devices.can.sensors import CanInertial, CanMais, CanSkin, CanStrain
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.devices.remapper import ControlBoardRemapper
from rtf.simulator.firmware.configuration import can_configuration, sensor_configuration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.devices.can.sensor_base import CanSensors
    from rtf.simulator.firmware.boards_on_buses import Firmware


def open_can_parts(
    firmware: Firmware, parts: Sequence[str], network: Network, opened: ExitStack
) -> dict[str, ControlBoard | ControlBoardRemapper]:
    """Open the drivers of parts, which are closed with ``opened``. A part on several buses is a remapper over them.

    The buses must be shared already, and the time must pass. Raises the errors of drivers.
    """
    found: dict[str, ControlBoard | ControlBoardRemapper] = {}
    boards = firmware.simulation.boards
    for part in parts:
        own = {wire: _open(firmware, wire, network, opened) for wire in firmware.wires_of(part)}
        first, *others = own.values()
        if not others:
            found[part] = first
            continue
        names = Bottle([boards.names[axis] for board in firmware.boards_of(part) for axis in board.axes])
        remapper = ControlBoardRemapper(part, network=network)
        remapper.open(Property({"axesNames": names}))
        opened.callback(remapper.close)
        remapper.attach(own)
        found[part] = remapper
    return found


def _open(firmware: Firmware, wire: str, network: Network, opened: ExitStack) -> ControlBoard:
    board = ControlBoard.over(CanMotionControl)(wire, network=network)
    board.open(can_configuration(firmware, wire))
    opened.callback(board.close)
    return board


def open_can_sensors(firmware: Firmware, network: Network, opened: ExitStack) -> dict[Device, CanSensors]:
    """Open the drivers of all sensors with boards, which are closed with ``opened``; by the sensors that measure.

    As :func:`open_can_parts` otherwise.
    """
    found: dict[Device, CanSensors] = {}
    for placed in firmware.sensors:
        kind, configuration = sensor_configuration(placed)
        driver = found[placed.sensor] = _DRIVERS[kind](placed.sensor.name, network=network)
        driver.open(configuration)
        opened.callback(driver.close)
    return found


_DRIVERS: dict[str, type[CanSensors]] = {
    "canBusStrain": CanStrain,
    "canBusMais": CanMais,
    "canBusInertialMTB": CanInertial,
    "canBusSkin": CanSkin,
}
