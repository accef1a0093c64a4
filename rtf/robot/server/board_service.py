"""The service of a YARP 4.0 control board."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_board_messages import MESSAGES, prototype
from rtf.robot.return_value import ReturnValue
from rtf.robot.server.device_service import DeviceService

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.service_rows import Message


class BoardService(DeviceService):
    """The functions of a board, independent of the port."""

    def __init__(self, device: object, name: str, *, network: Network) -> None:
        def target(message: Message) -> object | None:
            return device if message.interface is None or isinstance(device, message.interface) else None

        super().__init__(
            MESSAGES,
            target,
            name,
            prototype=prototype,
            missing=ReturnValue.METHOD_FAILED,  # as YARP's boards answer
            network=network,
        )
