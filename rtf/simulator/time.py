"""The time of a simulation: served to other processes, and as the clock of this one."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.lockstep import LockstepServer

if TYPE_CHECKING:
    from rtf.middleware.network import Network
    from rtf.simulator.simulation import Simulation

CLOCK = "/clock"
#: While nobody takes part time goes on in steps of so many seconds.
_IDLE = 0.01
_CLOCK_PERIOD, _QUIET_CLOCK_PERIOD = 0.001, 0.01
#: Seconds of the machine's clock after which who sleeps looks whether the time still passes.
_LOOK = 0.5


def serve_time(simulation: Simulation, name: str, *, network: Network, lockstep: bool) -> LockstepServer:
    """Let time pass from now on, and tell it to who listens; every millisecond while somebody does.

    ``lockstep``: only while those who take part wait for it.
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
    """The time of a simulation that runs in this process. Who sleeps does not take part in lockstep.

    When that time has ended, or was closed, it goes on as the machine's does, so that nobody hangs.
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
            with self._simulation.gate:
                self._simulation.after(seconds, passed.set, looks=True)
        while not passed.wait(_LOOK):
            if self._end() is not None:
                clock.sleep(until - self.now())
                return

    def close(self) -> None:
        self._end(closed=True)

    def _end(self, *, closed: bool = False) -> tuple[float, float] | None:
        """When the time ended; None while it passes."""
        with self._lock:
            if self._ended_at is None and (closed or self._server.broken is not None):
                self._ended_at = clock.monotonic(), self._simulation.now
            return self._ended_at
