"""The simulation: physics and boards in fixed steps, and a queue of events between the steps.

Time is counted in steps of one millisecond, so that rounding never shifts a message. Events (messages to publish,
delayed messages, faults that begin) are in a queue; between two of them the loop only computes.
"""

from __future__ import annotations

import heapq
import itertools
import math
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf import clock
from rtf.robot.model.engine import mujoco
from rtf.simulator.boards import Boards
from rtf.simulator.friction import DryFriction
from rtf.simulator.plant import TIMESTEP

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.publishing import Publisher
    from rtf.simulator.plant import Plant

#: The greatest lag (s) behind the machine's clock that the loop catches up.
_LATE = 0.1
#: The number of steps between two pauses of a paced loop, if no event comes before.
_STRIDE = 10
#: The number of random numbers that are drawn at once.
_DRAWN = 4096


class Simulation:
    """A simulated robot. ``advance`` is called by one thread at a time; commands of others hold ``lock``.

    ``factor`` is the greatest real-time factor; None: as fast as possible. ``seed`` is that of all random numbers: two
    simulations with the same seed and the same commands at the same steps are identical to the last bit.
    """

    def __init__(self, plant: Plant, *, seed: int = 0, factor: float | None = None) -> None:
        self.plant = plant
        self.seed = seed
        self.factor = factor
        self.random = np.random.default_rng(seed)
        self.data: Any = plant.data()
        self.friction = DryFriction(plant, self.data)
        self.boards = Boards(plant, self.data, seed)
        gears = self.boards.motors.gears
        gears.on_change = self.friction.adapt
        if len(gears.flexible):
            self.friction.adapt()
        self.friction.reset()
        self.lock = self.boards.lock
        self.on_reset: list[Callable[[], None]] = []
        self.settle: list[Callable[[], None]] = []
        self._noise = np.empty(0)
        self._noise_used = 0
        self._step1, self._step2 = mujoco().mj_step1, mujoco().mj_step2
        self._without_sensors = int(mujoco().mjtDisableBit.mjDSBL_SENSOR)
        self._queue: list[tuple[int, int, Callable[[], None], bool]] = []
        self._order = itertools.count()
        self._publishers: dict[float, tuple[Publisher, ...]] = {}  # by their periods
        self._thread = 0  # that of ``advance``, while it computes
        self._halfway = False  # the physics are between the halves of a step, and unchanged since
        self._paced: tuple[float, float, float] | None = None  # a moment of the machine's clock, the time at it, factor

    @property
    def now(self) -> float:
        """Seconds since the beginning."""
        return self.boards.now

    @property
    def is_computing_here(self) -> bool:
        """Whether this thread computes: what it calls, such as an event, must not wait for the time to pass."""
        return self._thread == threading.get_ident()

    def noise(self, count: int) -> FloatArray:
        """Return ``count`` standard normal random numbers, as a view that must not be changed.

        They are drawn many at a time, which takes a tenth of the time.
        """
        begin, end = self._noise_used, self._noise_used + count
        if end > len(self._noise):
            self._noise = self.random.standard_normal(max(_DRAWN, count))
            begin, end = 0, count
        self._noise_used = end
        return self._noise[begin:end]

    def at(self, tick: int, happening: Callable[[], None], *, looks: bool = False) -> None:
        """Schedule an event at a step. The loop calls it with the lock held; events of one step in their order.

        ``looks``: the event only reads, so the physics engine need not be updated after it.
        """
        heapq.heappush(self._queue, (tick, next(self._order), happening, looks))

    def after(self, seconds: float, happening: Callable[[], None], *, looks: bool = False) -> None:
        """Schedule an event ``seconds`` from now, at the next step at the earliest."""
        self.at(self.boards.tick + max(1, round(seconds / TIMESTEP)), happening, looks=looks)

    def publish_regularly(self, publisher: Publisher) -> Callable[[], None]:
        """Call a publisher at every multiple of its period from now on, each rounded to a step.

        Return what ends that. Both may be called in any thread.
        """
        period = max(1.0, publisher.period / TIMESTEP)  # in steps

        def leave() -> None:
            with self.lock:
                self._publishers[period] = tuple(one for one in self._publishers[period] if one is not publisher)

        with self.lock:
            known = period in self._publishers
            self._publishers[period] = (*self._publishers.get(period, ()), publisher)
            if not known:
                self._begin_publishing(period)
        return leave

    @property
    def publishers(self) -> list[Publisher]:
        """What it publishes regularly now."""
        with self.lock:
            return [one for several in self._publishers.values() for one in several]

    def _begin_publishing(self, period: float) -> None:
        times = itertools.count(math.ceil(self.boards.tick / period))

        def happening() -> None:
            now = self.now
            for each in self._publishers[period]:
                each.publish(now)
            self.at(round(next(times) * period), happening, looks=True)

        self.at(round(next(times) * period), happening, looks=True)

    def advance(self, until: float) -> float:
        """Advance the time to ``until`` seconds; return the time.

        When it returns all published messages have been delivered to the readers that acknowledge.
        """
        end = math.ceil(round(until / TIMESTEP, 6))
        self.lock.acquire()
        self._halfway = False
        self._thread = threading.get_ident()
        try:
            while self.boards.tick < end:
                self._happen()
                until_event = self._queue[0][0] if self._queue else end
                until_pause = end if self.factor is None else self.boards.tick + _STRIDE
                self._compute(min(end, until_event, until_pause))
                if self.factor is not None:
                    self._pace(self.factor)
            self._happen()
            self.refresh()
        finally:
            self._thread = 0
            self.lock.release()
        for settle in self.settle:
            settle()
        return self.now

    def refresh(self) -> None:
        """Update the measurements to the current time; the state of the physics does not change."""
        if not self._halfway:
            self._step1(self.plant.model, self.data)
            self._halfway = True
        self.boards.measure()

    def _happen(self) -> None:
        """Run the events that are due."""
        queue, tick = self._queue, self.boards.tick
        if queue and queue[0][0] <= tick:
            self.refresh()
            while queue and queue[0][0] <= tick:
                _, _, happening, looks = heapq.heappop(queue)
                happening()
                self._halfway = self._halfway and looks

    def _compute(self, end: int) -> None:
        """Step until ``end``, before which there is no event. Not split into functions: nearly all time is spent here.

        The sensors are computed in the last step, and in a step before the lock is yielded.
        """
        boards, lock, options = self.boards, self.lock, self.plant.model.opt
        first, second, step, rub = self._step1, self._step2, boards.step, self.friction.step
        model, data = self.plant.model, self.data
        halfway, self._halfway = self._halfway, False
        seeing = options.disableflags
        blind = seeing | self._without_sensors
        options.disableflags = blind
        try:
            for left in range(end - boards.tick - 1, -1, -1):
                wanted = lock.waiting
                if wanted or not left:
                    options.disableflags = seeing
                if halfway:
                    halfway = False
                else:
                    first(model, data)
                step()
                rub()
                second(model, data)
                if wanted:
                    lock.yield_to_waiting()
                    options.disableflags = blind
        finally:
            options.disableflags = seeing

    def _pace(self, factor: float) -> None:
        """Wait for the machine's clock; other threads may command meanwhile."""
        machine, now = clock.monotonic(), self.now
        if self._paced is None or self._paced[2] != factor:
            self._paced = machine, now, factor
        wait = self._paced[0] + (now - self._paced[1]) / factor - machine
        if wait < -_LATE:
            self._paced = machine, now, factor  # too late to catch up
        elif wait > 0:
            self.lock.release()
            try:
                clock.sleep(wait)
            finally:
                self.lock.acquire()

    def pace(self, factor: float | None) -> None:
        """Set the greatest real-time factor; None: as fast as possible.

        Called with the lock held.
        """
        self.factor = factor
        self._paced = None  # the pace starts anew, otherwise the loop would catch up with the past

    @contextmanager
    def held_at_home(self) -> Iterator[None]:
        """Hold the robot at home and at rest, as a stand does, whatever its motors do, for as long as this lasts.

        Controllers with an integral hold it afterwards, as those of a simulated robot do from its start.
        """

        def hold(now: float) -> None:
            del now
            self.data.qpos[:] = self.plant.home
            self.data.qvel[:] = 0.0

        with self.lock:
            self.boards.each_step.append(hold)
        try:
            yield
        finally:
            with self.lock:
                self.boards.each_step.remove(hold)
                controllers = self.boards.controllers
                for axis, torque in enumerate(self.boards.gravity().tolist()):
                    if controllers.ki[axis]:
                        controllers.set_integral(axis, torque)

    def reset(self) -> None:
        """Reset the robot to its state after the start: at home, at rest and healthy. The time is not reset."""
        self.lock.acquire()
        try:
            self._halfway = False
            for clean in self.on_reset:
                clean()
            self.plant.reset(self.data)
            self.boards.reset()
            self.friction.reset()
            self.random = np.random.default_rng(self.seed)
            self._noise = np.empty(0)
        finally:
            self.lock.release()
