"""The clock of a simulation: served to other processes, and as the clock of this process."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.clocks.lockstep import LockstepServer

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.simulator.simulation import Simulation

CLOCK = "/clock"
#: Step of the time while there is no participant, s.
_IDLE = 0.01
_CLOCK_PERIOD, _QUIET_CLOCK_PERIOD = 0.001, 0.01
#: Period of a sleeper's check whether the simulated time still passes, s of the machine's clock.
_LOOK = 0.5


def serve_time(simulation: Simulation, name: str, *, network: Network, lockstep: bool) -> LockstepServer:
    """Start the simulated time, and publish it every millisecond while there are readers.

    ``lockstep``: time passes only while all participants wait for it.
    """
    server = LockstepServer(
        name, simulation.advance, network=network, idle=None if lockstep else _IDLE, reset=simulation.reset
    )

    def publish() -> None:
        heard = server.heard
        if heard:
            server.publish(simulation.now)
        simulation.after(_CLOCK_PERIOD if heard else _QUIET_CLOCK_PERIOD, publish, looks=True)

    simulation.at(0, publish, looks=True)
    return server


class SimulationClock(clock.Clock):
    """The clock of a simulation in this process. A sleeper is no participant in lockstep.

    After the end of the simulated time, or when the clock was closed, it follows the machine's clock, so that no
    sleeper hangs.
    """

    def __init__(self, simulation: Simulation, server: LockstepServer) -> None:
        self._simulation = simulation
        self._server = server
        self._lock = threading.Lock()
        self._ended_at: tuple[float, float] | None = None  # of the machine's clock, and of this one

    def now(self) -> float:
        ended = self._end()
        return self._simulation.now if ended is None else ended[1] + clock.monotonic() - ended[0]

    def sleep(self, seconds: float) -> None:
        if seconds <= 0:
            return
        until = self.now() + seconds
        passed = threading.Event()
        if self._end() is None:
            with self._simulation.lock:
                self._simulation.after(seconds, passed.set, looks=True)
        while not passed.wait(_LOOK):
            if self._end() is not None:
                clock.sleep(until - self.now())
                return

    def close(self) -> None:
        self._end(closed=True)

    def _end(self, *, closed: bool = False) -> tuple[float, float] | None:
        """Return when the time ended, by both clocks; None while it passes."""
        with self._lock:
            if self._ended_at is None and (closed or self._server.broken is not None):
                self._ended_at = clock.monotonic(), self._simulation.now
            return self._ended_at
