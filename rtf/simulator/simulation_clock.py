"""The clock of a simulation: served to other processes, and as the clock of this process."""

from __future__ import annotations

import threading
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.clocks.lockstep import LockstepServer
from rtf.robot.publishing import PublishingClock

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.clocks.lockstep import Participant
    from rtf.middleware.ports.network import Network
    from rtf.robot.publishing import Outlets, Publisher
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


class SimulationClock(PublishingClock):
    """The clock of a simulated robot in its own process. In lockstep each thread that sleeps takes part meanwhile.

    After the end of the simulated time, or when the clock was closed, it follows the machine's clock, so that no
    sleeper hangs.
    """

    def __init__(self, simulation: Simulation, server: LockstepServer, outlets: Outlets, *, lockstep: bool) -> None:
        self.outlets = outlets
        self._simulation = simulation
        self._server = server
        self._lockstep = lockstep
        self._local = threading.local()
        self._lock = threading.Lock()
        self._ended_at: tuple[float, float] | None = None  # of the machine's clock, and of this one

    def now(self) -> float:
        ended = self._end()
        return self._simulation.now if ended is None else ended[1] + clock.monotonic() - ended[0]

    def sleep(self, seconds: float) -> None:
        if seconds <= 0:
            return
        until = self.now() + seconds
        if not (self._wait_in_lockstep(until) if self._lockstep else self._wait(seconds)):
            clock.sleep(until - self.now())

    def _wait(self, seconds: float) -> bool:
        """Wait while the simulated time passes; return False if it has ended."""
        passed = threading.Event()
        if self._end() is None:
            with self._simulation.lock:
                self._simulation.after(seconds, passed.set, looks=True)
        while not passed.wait(_LOOK):
            if self._end() is not None:
                return False
        return True

    def _wait_in_lockstep(self, until: float) -> bool:
        participant: Participant | None = getattr(self._local, "participant", None)
        if participant is not None:
            return self._end() is None and self._server.wait_until(participant, until)
        with self.taking_part(threading.current_thread().name):
            return self._wait_in_lockstep(until)

    def taking_part(self, name: str) -> AbstractContextManager[object]:
        return _Participation(self._server, self._local, name) if self._lockstep else nullcontext()

    def publish_regularly(self, publisher: Publisher) -> Callable[[], None]:
        return self._simulation.publish_regularly(publisher)

    def close(self) -> None:
        self._end(closed=True)

    def _end(self, *, closed: bool = False) -> tuple[float, float] | None:
        """Return when the time ended, by both clocks; None while it passes."""
        with self._lock:
            if self._ended_at is None and (closed or self._server.broken is not None):
                self._ended_at = clock.monotonic(), self._simulation.now
            return self._ended_at


class _Participation(AbstractContextManager[None]):
    """The part that a thread takes in lockstep, from the construction on."""

    def __init__(self, server: LockstepServer, local: threading.local, name: str) -> None:
        self._server = server
        self._local = local
        self._participant = server.join(name)

    def __enter__(self) -> None:
        self._local.participant = self._participant

    def __exit__(self, *_: object) -> None:
        self._local.participant = None
        self._server.leave(self._participant)
