"""Buses of this machine in datagrams: the interface ``datagrams``, with a group and a port as ``udp_multicast`` has.

A datagram has all frames that are sent at once, and what is sent does not come back. So a robot's boards in one
process, and their drivers in another one, cost a fraction of what a datagram for each frame does. None leaves the
machine.
"""

from __future__ import annotations

import socket
import struct
from collections import deque
from contextlib import suppress
from select import select
from typing import TYPE_CHECKING

from rtf import clock
from rtf.robot.devices.can.bus_settings import MULTICAST_PORT
from rtf.robot.devices.can.interfaces import can
from rtf.robot.devices.can.messages import GREATEST_IDENTIFIER, Frame, make_frame

if TYPE_CHECKING:
    from collections.abc import Sequence

_LOOPBACK = "127.0.0.1"
#: A frame: its identifier, the number of its bytes, and these.
_RECORD = struct.Struct("<HB8s")
#: Frames and bytes of a datagram at most, and bytes that wait to be read: half a second of ten full buses.
_MOST, _LONGEST, _BUFFER = 100, 2048, 1 << 20


class DatagramBus(can.BusABC):
    """A bus of all programs that have this group and port. Raises OSError for a group that is none."""

    def __init__(self, channel: str, *, port: int = MULTICAST_PORT, **_: object) -> None:
        super().__init__(channel=channel)
        self.channel_info = f"datagrams {channel}:{port}"
        self._group = channel, port
        self._arrived: deque[tuple[Frame, float]] = deque()
        self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            group, loopback = socket.inet_aton(channel), socket.inet_aton(_LOOPBACK)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, loopback)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            self._sender.bind((_LOOPBACK, 0))
            self._own = self._sender.getsockname()
            self._receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._receiver.bind(self._group)
            self._receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + loopback)
            self._receiver.setblocking(False)
        except OSError:
            self.shutdown()
            raise

    def send_all(self, frames: Sequence[Frame]) -> None:
        """Send frames at once. Raises CanOperationError."""
        for first in range(0, len(frames), _MOST):
            records = [_RECORD.pack(one[0], len(one[1]), one[1]) for one in frames[first : first + _MOST]]
            try:
                self._sender.sendto(b"".join(records), self._group)
            except OSError as error:
                raise can.CanOperationError(str(error), error.errno) from error

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame. Raises CanOperationError."""
        del timeout
        self.send_all([Frame(msg.arbitration_id, bytes(msg.data))])

    def recv_all(self, timeout: float | None = None) -> list[tuple[Frame, float]]:
        """Return the frames that have arrived, with the time of the robot's clock; none after ``timeout`` s.

        Raises OSError, and ValueError if the bus is closed.
        """
        heard: list[tuple[Frame, float]] = []
        if select([self._receiver], [], [], timeout)[0]:
            now = clock.current().now()
            with suppress(BlockingIOError):
                while True:
                    data, sender = self._receiver.recvfrom(_LONGEST)
                    if sender != self._own and not len(data) % _RECORD.size:
                        heard += [
                            (make_frame((number, text[:size])), now)
                            for number, size, text in _RECORD.iter_unpack(data)
                            if number <= GREATEST_IDENTIFIER
                        ]
        return heard

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """Return the next frame, for other users than our buses."""
        if not self._arrived:
            self._arrived.extend(self.recv_all(timeout))
        if not self._arrived:
            return None, False
        (number, data), now = self._arrived.popleft()
        return can.Message(timestamp=now, arbitration_id=number, data=data, is_extended_id=False), False

    def fileno(self) -> int:
        """Return the descriptor that can be read when frames have arrived."""
        return self._receiver.fileno()

    def shutdown(self) -> None:
        """Close the bus; a second call has no effect."""
        self._sender.close()
        self._receiver.close()
        super().shutdown()
