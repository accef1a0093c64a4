"""The server of a control board: requests of YARP 3, of YARP 4 or of both, streamed commands, streams of its state."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.bottle import Dialect
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo
from rtf.robot.network.state_streams import StateStreams
from rtf.robot.network.streamed_commands import StreamedCommands
from rtf.robot.yarp3.server import ControlBoardRequests
from rtf.robot.yarp4.server import BoardService

if TYPE_CHECKING:
    from collections.abc import Collection

    from rtf.middleware.ports.network import Network
    from rtf.robot.network.outlets import Outlets

#: Default period of the state, in seconds.
DEFAULT_PERIOD = 0.02


class ControlBoardServer:
    """The ports of a board: ``NAME/command:i``, ``NAME/state:o``, ``NAME/stateExt:o``, and those of its requests.

    ``protocols`` says which requests are answered, by default those of the network's dialect: ``NAME/rpc:i`` answers
    the words of YARP 3, ``NAME/nws/rpc:i`` is the service of YARP 4, which has its dialect on every network. With the
    service alone the streams have that dialect, too, otherwise that of the network.

    The ports are open from construction to ``close``. The owner calls ``publish`` every ``period`` seconds. ``outlets``
    is explained at :class:`StateStreams`; outlets have a network of their own. Raises NotSupportedError for a device
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
        protocols: Collection[Dialect] | None = None,
    ) -> None:
        if not isinstance(device, IAxisInfo):
            raise NotSupportedError(f"{name}: a {type(device).__name__} is not a control board: it has no IAxisInfo")
        self.name = name
        self.period = period
        protocols = protocols or (network.dialect,)
        newer = network.in_dialect(Dialect.YARP4)
        streaming = network if Dialect.YARP3 in protocols else newer

        def report(sentence: str) -> None:
            network.report(f"{name}: {sentence}")

        with ExitStack() as opened:
            if Dialect.YARP3 in protocols:
                words = ControlBoardRequests(device, report)
                opened.enter_context(RpcServer(f"{name}/rpc:i", words.answer, network=network, guarded=True))
            if Dialect.YARP4 in protocols:
                service = BoardService(device, name, network=network)
                opened.enter_context(RpcServer(f"{name}/nws/rpc:i", service.answer, network=newer, guarded=True))
            commands = StreamedCommands(device, report)
            opened.enter_context(
                Port(f"{name}/command:i", commands.take, network=streaming, outputs=False, guarded=True)
            )
            self._state = StateStreams(device, device.axes(), name, network=streaming, outlets=outlets)
            opened.callback(self._state.close)
            self._opened = opened.pop_all()

    def publish(self, now: float) -> None:
        """Publish the state."""
        self._state.publish(now)

    def settle(self) -> None:
        """Wait until all readers that acknowledge have processed what was published."""
        self._state.settle()

    def close(self) -> None:
        """Close the ports after the commands in progress. A second call has no effect."""
        self._opened.close()
