"""The server of a YARP 4.0 control board: a service, streamed commands, and the streams of its state."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.bottle import Dialect
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo
from rtf.robot.server.board_service import BoardService
from rtf.robot.server.control_board import DEFAULT_PERIOD, ControlBoardServer
from rtf.robot.server.control_board_commands import StreamedCommands
from rtf.robot.server.control_board_state import StateStreams

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.server.outlets import Outlets


class ControlBoardServiceServer:
    """The ports of a board: ``NAME/nws/rpc:i``, ``NAME/command:i``, ``NAME/state:o`` and ``NAME/stateExt:o``.

    They speak YARP 4.0 in every dialect of the network. With ``requests`` there is ``NAME/rpc:i`` as well, so
    that clients of YARP 3 are served at the same time; the streams, of which there is one each in any case, then have
    the dialect of the network.

    They are open from construction to ``close``. The owner calls ``publish`` every ``period`` seconds. ``outlets`` is
    explained at :class:`StateStreams`; outlets have a network of their own. Raises NotSupportedError for a device
    without the number of its axes, and the middleware's errors if the ports cannot be opened.
    """

    def __init__(
        self,
        device: object,
        name: str,
        *,
        network: Network,
        period: float = DEFAULT_PERIOD,
        outlets: Outlets | None = None,
        requests: bool = False,
    ) -> None:
        if not isinstance(device, IAxisInfo):
            raise NotSupportedError(f"{name}: a {type(device).__name__} is not a control board: it has no IAxisInfo")
        self.name = name
        self.period = period
        streaming = network if requests else network.in_dialect(Dialect.YARP4)
        with ExitStack() as opened:
            self._streams: ControlBoardServer | StateStreams
            if requests:
                self._streams = ControlBoardServer(device, name, network=network, period=period, outlets=outlets)
            else:
                commands = StreamedCommands(device, lambda sentence: network.report(f"{name}: {sentence}"))
                opened.enter_context(
                    Port(f"{name}/command:i", commands.take, network=streaming, outputs=False, guarded=True)
                )
                self._streams = StateStreams(device, device.axes(), name, network=streaming, outlets=outlets)
            opened.callback(self._streams.close)
            service = BoardService(device, name, network=network)
            opened.enter_context(
                RpcServer(f"{name}/nws/rpc:i", service.answer, network=network.in_dialect(Dialect.YARP4), guarded=True)
            )
            self._opened = opened.pop_all()

    def publish(self, now: float) -> None:
        """Publish the state."""
        self._streams.publish(now)

    def settle(self) -> None:
        """Wait until all readers that acknowledge have processed what was published."""
        self._streams.settle()

    def close(self) -> None:
        """Close the ports after the commands in progress. A second call has no effect."""
        self._opened.close()
