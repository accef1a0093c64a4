"""A simulated bus as a bus of python-can, for drivers in the process of the simulation.

It has no thread: what arrives is taken by who asks, and a driver whose cycles run in the simulation's thread never
waits. In other threads ``recv`` waits by the robot's clock.
"""

from __future__ import annotations

import errno
from collections import deque
from typing import TYPE_CHECKING

from rtf import clock
from rtf.robot.devices.can.bus import CanBus, provide, unshare
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.interfaces import can
from rtf.robot.devices.can.messages import Frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.simulator.firmware.boards_on_buses import Firmware
    from rtf.simulator.firmware.wire import Wire

#: The interface of the buses of a simulated robot, in configurations.
INTERFACE = "simulated"
#: The frames that may wait to be read. Further ones push out the oldest.
_UNREAD = 10_000
#: Seconds of the robot's clock between two looks for a frame.
_LOOK = 0.001


class SimulatedBus(can.BusABC):
    """A host on a wire."""

    address: int | None = None

    def __init__(self, wire: Wire, firmware: Firmware) -> None:
        super().__init__(channel=wire.name)
        self.channel_info = f"{INTERFACE} {wire.name}"
        self._wire = wire
        self._simulation = firmware.simulation
        self._arrived: deque[tuple[Frame, float]] = deque(maxlen=_UNREAD)
        with firmware.simulation.lock:
            self.connection = wire.attach(self)

    def receive(self, frame: Frame, time: float) -> None:
        """Keep a frame. Called within a step of the simulation."""
        self._arrived.append((frame, time))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame. Raises CanOperationError if there is no room, or the host is off the bus."""
        del timeout
        with self._simulation.lock:
            taken = self.connection.send(Frame(msg.arbitration_id, bytes(msg.data)))
        if not taken:
            off = self.connection.off
            raise can.CanOperationError("off the bus" if off else "no room", None if off else errno.ENOBUFS)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame, with the simulated time of its end; None if none comes within ``timeout`` s."""
        if not self._arrived and not self._wait(timeout):
            return None
        frame, stamp = self._arrived.popleft()
        return can.Message(timestamp=stamp, arbitration_id=frame.identifier, data=frame.data, is_extended_id=False)

    def _wait(self, timeout: float | None) -> bool:
        """Wait for a frame; return whether there is one."""
        if timeout == 0.0 or self._simulation.is_computing_here:
            return False
        time = clock.current()
        end = time.now() + (float("inf") if timeout is None else timeout)
        while not self._arrived and time.now() < end:
            time.sleep(_LOOK)
        return bool(self._arrived)

    def shutdown(self) -> None:
        """Leave the wire; a second call has no effect."""
        if not self._is_shutdown:
            with self._simulation.lock:
                self._wire.detach(self.connection)
        super().shutdown()


def provide_buses(firmware: Firmware, report: Callable[[str], None]) -> Callable[[], None]:
    """Share all buses of a simulated robot with the drivers of this process. Return what ends that."""
    buses = [
        CanBus(
            BusSettings(INTERFACE, name),
            report=report,
            threaded=False,
            opener=lambda _settings, wire=wire: SimulatedBus(wire, firmware),  # type: ignore[misc]  # bound at once
        )
        for name, wire in firmware.wires.items()
    ]
    for bus in buses:
        provide(bus)

    def end() -> None:
        for bus in buses:
            unshare(bus)

    return end
