"""The parts of a simulated robot as drivers on its CAN buses have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property
from rtf.robot.devices.can.motion_control import CanMotionControl
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.devices.remapper import ControlBoardRemapper
from rtf.simulator.firmware.configuration import can_configuration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack

    from rtf.middleware.ports.network import Network
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
