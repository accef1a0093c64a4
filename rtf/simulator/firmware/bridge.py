"""A simulated bus that is also a bus of python-can, so that hosts of other programs reach the emulated boards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.messages import ADDRESSES, EVERYONE, HOST, POLLING, MessageClass
from rtf.robot.errors import BusError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.devices.can.bus_settings import BusSettings
    from rtf.robot.devices.can.messages import Frame
    from rtf.simulator.firmware.wire import Heard, Wire
    from rtf.simulator.simulation import Simulation

#: The identifiers of hosts: requests to boards, and the setpoints of drives. All others are those of the boards.
FROM_HOSTS = (
    *(kind << 8 | board for kind in POLLING for board in (*ADDRESSES, EVERYONE)),
    MessageClass.MOTOR_PERIODIC << 8 | HOST << 4 | EVERYONE,
)


class Bridge:
    """Passes what boards send on a wire to a bus of python-can, and what hosts send there to the wire.

    ``report`` is called with a sentence where the bus has a problem, once in a row. Raises DeviceError if it cannot be
    opened.
    """

    address: int | None = None

    def __init__(
        self, wire: Wire, settings: BusSettings, simulation: Simulation, report: Callable[[str], None]
    ) -> None:
        self.wire = wire
        self.dropped = 0  # frames of boards, if the bus did not take all of those that it got at once
        self._simulation = simulation
        self._bus = CanBus(settings, report=report)
        with simulation.lock:
            self.connection = wire.attach(self)
        self._end = self._bus.subscribe(self._from_host, FROM_HOSTS)

    def receive(self, frame: Frame, time: float) -> None:
        """Pass on what a board has sent."""
        self.receive_all([(frame, time)])

    def receive_all(self, heard: Heard) -> None:
        """Pass on what boards have sent."""
        try:
            self._bus.send(*(frame for frame, _ in heard))
        except BusError:  # the bus reports it
            self.dropped += len(heard)

    def _from_host(self, frame: Frame, stamp: float) -> None:
        """Put what a host has sent on the wire. Called by the thread of the bus."""
        del stamp
        with self._simulation.lock:
            self.connection.send(frame)

    def close(self) -> None:
        """Disconnect from both buses."""
        self._end()
        with self._simulation.lock:
            self.wire.detach(self.connection)
        self._bus.close()
