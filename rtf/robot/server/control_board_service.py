"""A control board on the network, as YARP 4.0 has it: a service, streamed commands, and the streams of its state."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.middleware.port import Port
from rtf.middleware.rpc import RpcServer
from rtf.robot.control_board_messages import in_its_dialect
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo
from rtf.robot.server.board_service import BoardService
from rtf.robot.server.control_board import DEFAULT_PERIOD, ControlBoardServer
from rtf.robot.server.control_board_commands import StreamedCommands
from rtf.robot.server.control_board_state import StateStreams

if TYPE_CHECKING:
    from rtf.middleware.network import Network
    from rtf.robot.server.outlets import Outlets


class ControlBoardServiceServer:
    """The ports of a device: ``NAME/nws/rpc:i``, ``NAME/command:i``, ``NAME/state:o`` and ``NAME/stateExt:o``.

    They speak YARP 4.0, whatever the network does. With ``questions`` there is ``NAME/rpc:i`` as well, so that clients
    of YARP 3 are served at the same time; of the streams there is one of each in any case, which then speak what the
    network does.

    They are open from its making to ``close``. Somebody calls ``publish`` every ``period`` seconds. ``outlets``
    are told of at :class:`StateStreams`; they have a network of their own. Raises NotSupportedError for a device that
    does not say how many axes it has, and the middleware's errors when the ports cannot be opened.
    """

    def __init__(
        self,
        device: object,
        name: str,
        *,
        network: Network,
        period: float = DEFAULT_PERIOD,
        outlets: Outlets | None = None,
        questions: bool = False,
    ) -> None:
        if not isinstance(device, IAxisInfo):
            raise NotSupportedError(f"{name}: a {type(device).__name__} is no control board: it has no IAxisInfo")
        self.name = name
        self.period = period
        streaming = network if questions else in_its_dialect(network)
        with ExitStack() as opened:
            self._streams: ControlBoardServer | StateStreams
            if questions:
                self._streams = ControlBoardServer(device, name, network=network, period=period, outlets=outlets)
            else:
                commands = StreamedCommands(device, lambda sentence: network.report(f"{name}: {sentence}"))
                opened.enter_context(Port(f"{name}/command:i", commands.take, network=streaming, outputs=False))
                self._streams = StateStreams(device, device.axes(), name, network=streaming, outlets=outlets)
            opened.callback(self._streams.close)
            service = BoardService(device, name, network=network)
            opened.enter_context(RpcServer(f"{name}/nws/rpc:i", service.answer, network=in_its_dialect(network)))
            self._opened = opened.pop_all()

    def publish(self, now: float) -> None:
        """See Publisher."""
        self._streams.publish(now)

    def settle(self) -> None:
        """Wait until what was published in step has been dealt with."""
        self._streams.settle()

    def close(self) -> None:
        """Close the ports; what is carried out at the moment is waited for. Doing so again changes nothing."""
        self._opened.close()
