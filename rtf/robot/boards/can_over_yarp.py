"""A CAN bus of another program as a bus of python-can: interface ``yarp``, channel such as ``/icubSim/can/head0``.

All frames of the bus arrive, with their times by the clock of that program. Only questions can be sent, see
:mod:`rtf.robot.boards.can_frames`. Tools of python-can see the bus as they would see another one.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import default_network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from rtf.robot.boards.can_frames import FRAMES, REQUESTS, unpack_frames
from rtf.robot.devices.can.interfaces import can
from rtf.robot.network.client_settings import RPC_TIMEOUT, unique_local
from rtf.robot.network.stream_client import RpcConnection

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.devices.can.messages import Frame

_OK = Vocab("ok")
#: Seconds of the robot's clock between two looks for a frame.
_LOOK = 0.002


class YarpBus(can.BusABC):
    """A bus whose frames the program that has it publishes. Raises CanInitializationError if there is none.

    ``network`` is that of the ports; None: that of the process. Other options of python-can are ignored.
    """

    def __init__(self, channel: str, *, network: Network | None = None, **_: object) -> None:
        super().__init__(channel=channel)
        self.channel_info = f"yarp {channel}"
        self._arrived: deque[tuple[Frame, float]] = deque()
        self._rpc: RpcConnection | None = None
        network = network or default_network()
        self._port = Port("", self._receive, network=network, outputs=False)
        try:
            remote.connect(network, Contact.parse(f"{channel}{FRAMES}"), Contact.parse(self._port.name), "tcp")
            local, there = unique_local(channel), f"{channel}{REQUESTS}"
            self._rpc = RpcConnection(local, there, patience=RPC_TIMEOUT, network=network)
        except RtfError as error:
            self.shutdown()
            raise can.CanInitializationError(f"no program publishes the bus {channel}: {error}") from error

    def _receive(self, delivery: IncomingMessage) -> None:
        frames = delivery.read().get(0)
        if isinstance(frames, bytes):
            self._arrived.extend(unpack_frames(frames))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a question. Raises CanOperationError if it is none, or the bus is lost."""
        del timeout
        self._request("ask", msg.arbitration_id, bytes(msg.data))

    def withhold(self, seconds: float) -> None:
        """Have the program send nothing for some seconds. Raises CanOperationError if it refuses."""
        self._request("withhold", seconds)

    def _request(self, *words: str | float | bytes) -> None:
        if self._rpc is None:
            raise can.CanOperationError(f"{self.channel_info} is closed")
        try:
            answer = self._rpc.ask(Bottle([*words]))
        except RtfError as error:
            raise can.CanOperationError(str(error)) from error
        if answer.get(0) != _OK:
            raise can.CanOperationError(str(answer.get(1)))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame; None if none comes within ``timeout`` s of the robot's clock."""
        time = clock.current()
        end = time.now() + (float("inf") if timeout is None else timeout)
        while True:
            while self._arrived:
                frame, stamp = self._arrived.popleft()
                message = can.Message(
                    timestamp=stamp, arbitration_id=frame.identifier, data=frame.data, is_extended_id=False
                )
                if self._matches_filters(message):
                    return message
            left = end - time.now()
            if left <= 0.0:
                return None
            time.sleep(min(_LOOK, left))

    def shutdown(self) -> None:
        """Close the ports; a second call has no effect."""
        if not self._is_shutdown:
            self._port.close()
            if self._rpc is not None:
                self._rpc.close()
                self._rpc = None
        super().shutdown()
