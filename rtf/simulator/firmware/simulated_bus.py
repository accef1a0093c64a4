"""A simulated bus as a bus of the drivers in the process of the simulation.

It has no thread: a frame is taken by the receivers within the step in which it passes, and a driver whose cycles run in
the simulation's thread never waits. In other threads ``poll`` waits by the robot's clock.
"""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING

from rtf import clock
from rtf.robot.devices.can.bus import CanBus, provide, unshare
from rtf.robot.devices.can.bus_settings import SIMULATED, BusSettings
from rtf.robot.devices.can.interfaces import can
from rtf.robot.devices.can.messages import Frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.simulator.firmware.boards_on_buses import Firmware
    from rtf.simulator.firmware.wire import Wire
    from rtf.simulator.simulation import Simulation

#: Seconds of the robot's clock between two looks for a frame.
_LOOK = 0.001


class SimulatedBus(CanBus):
    """A host on a wire."""

    def __init__(self, wire: Wire, firmware: Firmware, report: Callable[[str], None]) -> None:
        self._wire = wire
        self._simulation = firmware.simulation
        super().__init__(
            BusSettings(SIMULATED, wire.name),
            report=report,
            threaded=False,
            opener=self._attach,
            lock=firmware.simulation.lock,
        )
        self._simulation.on_reset.append(self.restarted)

    def close(self) -> None:
        if self.restarted in self._simulation.on_reset:
            self._simulation.on_reset.remove(self.restarted)
        super().close()

    def _attach(self, _settings: BusSettings) -> can.BusABC:
        return _Host(self._wire, self._simulation, self)


class _Host(can.BusABC):
    """A host on a wire as an interface of python-can, but for frames that arrive: the bus gets them."""

    address: int | None = None

    def __init__(self, wire: Wire, simulation: Simulation, bus: CanBus) -> None:
        super().__init__(channel=wire.name)
        self.channel_info = f"{SIMULATED} {wire.name}"
        self.receive, self.receive_all = bus.take, bus.take_all
        self._counters = bus.counters
        self._wire = wire
        self._simulation = simulation
        with simulation.lock:
            self.connection = wire.attach(self)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame. Raises CanOperationError if there is no room, or the host is off the bus."""
        del timeout
        with self._simulation.lock:
            taken = self.connection.send(Frame(msg.arbitration_id, bytes(msg.data)))
        if not taken:
            off = self.connection.off
            raise can.CanOperationError("off the bus" if off else "no room", None if off else errno.ENOBUFS)

    def disturbed(self) -> None:
        """Count an error frame."""
        self._counters.error_frames += 1

    def recv(self, timeout: float | None = None) -> None:
        """Let some time pass, as frames arrive meanwhile; return at once in the thread of the simulation."""
        if timeout and not self._simulation.is_computing_here:
            clock.current().sleep(min(timeout, _LOOK))

    def shutdown(self) -> None:
        """Leave the wire; a second call has no effect."""
        if not self._is_shutdown:
            with self._simulation.lock:
                self._wire.detach(self.connection)
        super().shutdown()


def provide_buses(firmware: Firmware, report: Callable[[str], None]) -> Callable[[], None]:
    """Share all buses of a simulated robot with the drivers of this process. Return what ends that."""
    buses = [SimulatedBus(wire, firmware, report) for wire in firmware.wires.values()]
    for bus in buses:
        provide(bus)

    def end() -> None:
        for bus in buses:
            unshare(bus)

    return end
