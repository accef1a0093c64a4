"""The server of a YARP 3 control board: requests, streamed commands, and the streams of its state."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo
from rtf.robot.server.control_board_commands import StreamedCommands
from rtf.robot.server.control_board_requests import ControlBoardRequests
from rtf.robot.server.control_board_state import StateStreams

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.server.outlets import Outlets

#: Default period of the state, in seconds.
DEFAULT_PERIOD = 0.02


class ControlBoardServer:
    """The ports of a board: ``NAME/rpc:i``, ``NAME/command:i``, ``NAME/state:o`` and ``NAME/stateExt:o``.

    They are open from construction to ``close``. The owner calls ``publish`` every ``period`` seconds. ``outlets`` is
    explained at :class:`StateStreams`. Raises NotSupportedError for a device without the number of its axes, and the
    middleware's errors if the ports cannot be opened.
    """

    def __init__(
        self,
        device: object,
        name: str,
        *,
        network: Network,
        period: float = 0.01,
        outlets: Outlets | None = None,
    ) -> None:
        if not isinstance(device, IAxisInfo):
            raise NotSupportedError(f"{name}: a {type(device).__name__} is not a control board: it has no IAxisInfo")
        self.name = name
        self.period = period

        def report(sentence: str) -> None:
            network.report(f"{name}: {sentence}")

        requests = ControlBoardRequests(device, report)
        commands = StreamedCommands(device, report)
        with ExitStack() as opened:
            rpc = RpcServer(f"{name}/rpc:i", requests.answer, network=network, guarded=True)
            opened.callback(rpc.close)
            streamed = Port(f"{name}/command:i", commands.take, network=network, outputs=False, guarded=True)
            opened.callback(streamed.close)
            self._state = StateStreams(device, device.axes(), name, network=network, outlets=outlets)
            opened.callback(self._state.close)
            self._opened = opened.pop_all()

    def publish(self, now: float) -> None:
        """Publish the state."""
        self._state.publish(now)

    def settle(self) -> None:
        """Wait until everything published is sent, as far as the ports know."""
        self._state.settle()

    def close(self) -> None:
        """Close the ports after the commands in progress. A second call has no effect."""
        self._opened.close()
