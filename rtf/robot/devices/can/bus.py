"""A CAN bus of this process: one bus of python-can, one thread that reads it, and receivers by identifier.

What is sent goes to the interface at once. While that is busy, frames wait in the order of their identifiers, in which
they would win the arbitration; those that wait too long, by the robot's clock, are dropped, counted and reported, never
sent late.
"""

from __future__ import annotations

import heapq
import threading
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from rtf import clock
from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.interfaces import ECHOING, FILTERING, can, is_busy, open_interface
from rtf.robot.devices.can.messages import GREATEST_IDENTIFIER, Frame
from rtf.robot.errors import BusError, DeviceError, RobotError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from contextlib import AbstractContextManager

    from rtf.robot.devices.can.bus_settings import BusSettings

    #: Called in the thread of the bus with a frame and its time (s, the robot's clock). It must not wait.
    Receiver = Callable[[Frame, float], None]

_IDENTIFIERS = GREATEST_IDENTIFIER + 1
_BUS_OFF, _RESTARTED = 0x040, 0x100  # bits of error frames, from Linux' can/error.h, which python-can has everywhere
#: Seconds that a thread waits for a frame at most, and while frames wait to be sent.
_WAIT, _WAIT_TO_SEND = 0.02, 0.002
#: Seconds until a bus that is lost is opened again: the first time, and at most.
_FIRST_RETRY, _LAST_RETRY = 0.05, 2.0
#: The shortest time of a load, s.
_SHORTEST = 1e-6
#: So many errors of reading in a row, and the interface is taken for lost.
_LOST = 10
#: The time stamps of an interface are used if they are at most so many seconds from now; some count from its own start.
_NEAR = 1.0


@dataclass(slots=True)
class BusCounters:
    """What has happened on a bus since it was opened."""

    received: int = 0
    sent: int = 0
    error_frames: int = 0
    read_errors: int = 0
    expired: int = 0  # frames that waited too long, and were not sent
    refused: int = 0  # frames for which the queue was full, or the bus off
    bus_off: int = 0
    recovered: int = 0
    withheld: int = 0  # frames that were to be sent while sending was off


@dataclass(slots=True)
class Traffic:
    """The frames with one identifier: how many, and the last one with its time (s, the robot's clock)."""

    frames: int = 0
    latest: tuple[Frame, float] = Frame(0, b""), 0.0

    @property
    def data(self) -> bytes:
        """The data of the last frame."""
        return self.latest[0].data


class Load(NamedTuple):
    """The load of a bus in a time of some seconds: the share of the bits that it could carry, and frames a second."""

    share: float
    rate: float


class CanBus:
    """A bus. All methods may be called from any thread, but ``poll`` by one at a time.

    ``report`` is called with a sentence when the bus is lost or found again, and when frames are dropped.
    Without ``threaded``, nothing is read but by ``poll``, or an interface calls ``take`` by itself: for simulations,
    whose time stands still meanwhile. These have a ``lock`` of their own, too, which their thread holds when it sends.
    """

    def __init__(
        self,
        settings: BusSettings,
        *,
        report: Callable[[str], None] = lambda _: None,
        threaded: bool = True,
        opener: Callable[[BusSettings], can.BusABC] = open_interface,
        lock: AbstractContextManager[object] | None = None,
    ) -> None:
        self.settings = settings
        self.name = settings.name
        self.counters = BusCounters()
        self.traffic: dict[int, Traffic] = {}
        self._report = report
        self._opener = opener
        self._receivers: list[tuple[Receiver, ...]] = [()] * _IDENTIFIERS
        self._subscribed: list[tuple[Receiver | None, frozenset[int]]] = []
        self._watchers: tuple[Receiver, ...] = ()
        self._withheld_until = 0.0  # s of the robot's clock
        #: Called when all boards have been reset on purpose, as by the reset of a simulation.
        self.on_restart: list[Callable[[], None]] = []
        #: Of the interface's sending side, the queue and the receivers.
        self.lock = lock or threading.RLock()
        self._waiting: list[tuple[int, int, float, bytes]] = []  # a heap: identifier, number, deadline, data
        self._numbers = count()
        self._claims: dict[str, object] = {}
        self._reported = ""
        self._failures = 0
        self._retry = _FIRST_RETRY
        self._open_again: clock.Deadline | None = None
        self._ended = threading.Event()
        self._bus: can.BusABC = opener(settings)
        self._thread: threading.Thread | None = None
        if threaded:
            self._thread = threading.Thread(target=self._read, name=f"rtf-can {self.name}", daemon=True)
            self._thread.start()

    @property
    def off(self) -> bool:
        """Whether the bus is off, or its interface lost."""
        return self._open_again is not None

    @property
    def threaded(self) -> bool:
        """Whether a thread reads the bus."""
        return self._thread is not None

    def claim(self, owner: object, *what: str) -> None:
        """Reserve axes or setpoints for one device, until it gives them up by ``disclaim``.

        Raises DeviceError if another device has one of them.
        """
        with self.lock:
            taken = [one for one in what if self._claims.get(one, owner) is not owner]
            if taken:
                raise DeviceError(f"another device has {taken[0]} on the CAN bus {self.name} already")
            self._claims.update(dict.fromkeys(what, owner))

    def disclaim(self, owner: object) -> None:
        """Give up what a device has reserved."""
        with self.lock:
            self._claims = {what: of for what, of in self._claims.items() if of is not owner}

    def close(self) -> None:
        """End the thread and close the interface; a second call has no effect."""
        self._ended.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        with self.lock:
            self._waiting.clear()
            self._bus.shutdown()

    def restarted(self) -> None:
        """Tell the devices that all boards have been reset on purpose, and have to be configured again."""
        for notify in self.on_restart:
            notify()

    # Receiving -----------------------------------------------------------------------------------------------------

    def subscribe(self, receive: Receiver | None, identifiers: Iterable[int] | None = None) -> Callable[[], None]:
        """Pass frames with these identifiers, or all frames, to a receiver. Return what ends that.

        Without a receiver the frames are only received: ``traffic`` has the last one of each identifier.
        """
        entry = (receive, frozenset(range(_IDENTIFIERS) if identifiers is None else identifiers))

        def end() -> None:
            with self.lock:
                if entry in self._subscribed:
                    self._subscribed.remove(entry)
                    self._fan_out()

        with self.lock:
            self._subscribed.append(entry)
            self._fan_out()
        return end

    def watch(self, receive: Receiver) -> Callable[[], None]:
        """Pass all frames to a receiver, also those that are sent here, in the threads of their senders.

        Return what ends that.
        """
        unsubscribe = self.subscribe(receive)
        with self.lock:
            self._watchers += (receive,)

        def end() -> None:
            with self.lock:
                self._watchers = tuple(one for one in self._watchers if one is not receive)
            unsubscribe()

        return end

    def _fan_out(self) -> None:
        """Note the receivers of each identifier, and have the interface filter, if it can."""
        receivers: list[tuple[Receiver, ...]] = [()] * _IDENTIFIERS
        for receive, identifiers in self._subscribed:
            if receive is not None:
                for identifier in identifiers:
                    receivers[identifier] += (receive,)
        self._receivers = receivers
        self._filter()

    def _filter(self) -> None:
        if self.settings.interface in FILTERING:
            wanted = sorted(frozenset().union(*(identifiers for _, identifiers in self._subscribed)))
            with suppress(can.CanError):  # as the next frame that is read reports it
                self._bus.set_filters(
                    [
                        can.typechecking.CanFilter(can_id=one, can_mask=_IDENTIFIERS - 1, extended=False)
                        for one in wanted
                    ]
                    if len(wanted) < _IDENTIFIERS
                    else None
                )

    def poll(self, timeout: float = 0.0) -> bool:
        """Read a frame, or those that an interface has, within ``timeout`` s; pass them on, and send what waits.

        Return whether there were any.
        """
        if self._open_again is not None and not self._try_again(timeout):
            return False
        if self._waiting:
            self._flush()
            timeout = min(timeout, _WAIT_TO_SEND)
        recv_all = getattr(self._bus, "recv_all", None)
        try:
            if recv_all is not None:
                heard = recv_all(timeout)
                self._failures = 0
                self.take_all(heard)
                return bool(heard)
            message = self._bus.recv(timeout)
        except (can.CanError, OSError, ValueError) as error:  # ValueError: a socket that was closed
            self._unreadable(error)
            return True
        if message is None:
            return False
        self._failures = 0
        if message.is_error_frame:
            self._error_frame(message.arbitration_id)
        elif not (message.is_extended_id or message.is_remote_frame or message.is_fd):
            stamp = message.timestamp
            if self._thread is not None:  # without one, a simulation makes the stamps
                now = clock.current().now()
                stamp = stamp if abs(stamp - now) <= _NEAR else now
            self.take(Frame(message.arbitration_id, bytes(message.data)), stamp)
        return True

    def take(self, frame: Frame, stamp: float) -> None:
        """Pass a frame to its receivers."""
        self.take_all([(frame, stamp)])

    def take_all(self, heard: Iterable[tuple[Frame, float]]) -> None:
        """Pass frames, with their times, to their receivers. One loop, as it runs for every frame."""
        all_traffic, all_receivers = self.traffic, self._receivers
        for latest in heard:
            identifier = latest[0][0]
            traffic = all_traffic.get(identifier)
            if traffic is None:
                traffic = all_traffic[identifier] = Traffic()
            traffic.frames += 1
            traffic.latest = latest
            self.counters.received += 1
            for receive in all_receivers[identifier]:
                try:
                    receive(*latest)
                except RobotError as error:
                    self._report_once(f"the CAN bus {self.name}: {error}")

    def _read(self) -> None:
        while not self._ended.is_set():
            self.poll(_WAIT)

    # Sending -------------------------------------------------------------------------------------------------------

    def send(self, *frames: Frame) -> None:
        """Send frames, those with lower identifiers first, and with equal ones in their order.

        Raises BusError, and counts the frames that are not sent, if the bus is off or too many frames wait already.
        """
        ordered = sorted(frames, key=_identifier) if len(frames) > 1 else frames
        with self.lock:
            if self._transmit_all(ordered):
                return
            for number, frame in enumerate(ordered):
                if self.off:
                    self.counters.refused += len(ordered) - number
                    raise BusError(f"the CAN bus {self.name} is off: {len(ordered) - number} frames are not sent")
                if self._waiting or not self._transmit(frame.identifier, frame.data):
                    self._queue(frame)
            self._transmit_waiting()

    def withhold(self, seconds: float) -> None:
        """Send nothing for ``seconds`` of the robot's time, as if the host had died: frames are dropped and counted."""
        self._withheld_until = clock.current().now() + seconds

    def _queue(self, frame: Frame) -> None:
        if len(self._waiting) >= self.settings.queue:
            self.counters.refused += 1
            raise BusError(f"the CAN bus {self.name} is busy: {len(self._waiting)} frames wait to be sent already")
        deadline = clock.current().now() + self.settings.transmit_timeout
        heapq.heappush(self._waiting, (frame.identifier, next(self._numbers), deadline, frame.data))

    @property
    def _withholds(self) -> bool:
        """Whether nothing is to be sent now."""
        return bool(self._withheld_until) and clock.current().now() < self._withheld_until

    def _transmit_all(self, frames: Sequence[Frame]) -> bool:
        """Hand frames to an interface that takes them at once; False if it does not, and they go one by one."""
        send_all = getattr(self._bus, "send_all", None)
        if send_all is None or self.off or self._waiting or self._withholds:
            return False
        with suppress(can.CanError):  # which comes again with the first of them
            send_all(frames)
            for identifier, data in frames:
                self._note_sent(identifier, data)
            return True
        return False

    def _transmit(self, identifier: int, data: bytes) -> bool:
        """Hand a frame to the interface; False while that is busy."""
        if self._withholds:
            self.counters.withheld += 1
            return True
        try:
            self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False), timeout=0)
        except can.CanError as error:
            if is_busy(error):
                return False
            self._lose(f"cannot be written: {error}")
            self.counters.refused += 1
            raise BusError(f"the CAN bus {self.name} cannot be written: {error}") from error
        self._note_sent(identifier, data)
        return True

    def _note_sent(self, identifier: int, data: bytes) -> None:
        """Count a frame that was sent, and show it to the watchers if it does not come back."""
        self.counters.sent += 1
        if self.settings.interface not in ECHOING:
            latest = Frame(identifier, data), clock.current().now()
            traffic = self.traffic.setdefault(identifier, Traffic())
            traffic.frames, traffic.latest = traffic.frames + 1, latest
            for watch in self._watchers:
                watch(*latest)

    def _transmit_waiting(self) -> None:
        """Hand over what waits, in its order, until the interface is busy."""
        while self._waiting and self._transmit(self._waiting[0][0], self._waiting[0][3]):
            heapq.heappop(self._waiting)

    def _flush(self) -> None:
        """Send what waits, and drop what has waited too long."""
        with self.lock:
            now = clock.current().now()
            late = [entry for entry in self._waiting if entry[2] < now]
            if late:
                self._waiting = [entry for entry in self._waiting if entry[2] >= now]
                heapq.heapify(self._waiting)
                self.counters.expired += len(late)
                self._report_once(
                    f"the CAN bus {self.name} is busy: {len(late)} frames waited too long and were not sent"
                )
            with suppress(BusError):  # which is reported
                self._transmit_waiting()

    # Errors of the bus -----------------------------------------------------------------------------------------------

    def _error_frame(self, bits: int) -> None:
        self.counters.error_frames += 1
        if bits & _BUS_OFF:
            with self.lock:
                self.counters.bus_off += 1
                self._lose("is off: too many errors of transmission; look at its wiring and termination")
        elif bits & _RESTARTED:
            self.counters.recovered += 1

    def _unreadable(self, error: Exception) -> None:
        """Take note of something that could not be read: a damaged frame, or an interface that is gone."""
        self.counters.read_errors += 1
        self._failures += 1
        if self._failures >= _LOST and not self._ended.is_set():
            with self.lock:
                self._lose(f"cannot be read: {error}")

    def _lose(self, why: str) -> None:
        """Drop what waits, and plan to open the interface again. With the lock held."""
        self.counters.refused += len(self._waiting)
        self._waiting.clear()
        self._failures = 0
        self._open_again = clock.Deadline.after(self._retry)
        self._report_once(f"the CAN bus {self.name} {why}")

    def _try_again(self, timeout: float) -> bool:
        """Open the interface again, if it is time to. Return whether the bus is on."""
        planned = self._open_again
        if planned is None or not planned.expired:
            self._ended.wait(min(timeout, planned.remaining() if planned else 0.0))
            return False
        with self.lock:
            self._bus.shutdown()
            try:
                self._bus = self._opener(self.settings)
            except RobotError as error:
                self._retry = min(2 * self._retry, _LAST_RETRY)
                self._open_again = clock.Deadline.after(self._retry)
                self._report_once(str(error))
                return False
            self._open_again, self._retry = None, _FIRST_RETRY
            self.counters.recovered += 1
            self._filter()
        self._reported = ""
        self._report(f"the CAN bus {self.name} is on again")
        return True

    def _report_once(self, sentence: str) -> None:
        """Report a sentence, once in a row."""
        if sentence != self._reported:
            self._reported = sentence
            self._report(sentence)


class LoadMeter:
    """Measures the load of a bus, from the construction on. Not thread-safe."""

    def __init__(self, bus: CanBus) -> None:
        self._bus = bus
        self._begin, self._before = self._look()

    def _look(self) -> tuple[float, dict[int, int]]:
        return clock.current().now(), {number: one.frames for number, one in list(self._bus.traffic.items())}

    def load(self) -> Load:
        """Return the load since the last call, in the robot's time; an identifier counts as long as its last frame."""
        (begin, before), (now, frames) = (self._begin, self._before), self._look()
        self._begin, self._before = now, frames
        seconds = max(now - begin, _SHORTEST)
        new = {number: total - before.get(number, 0) for number, total in frames.items()}
        bits = sum(more * frame_bits(Frame(number, self._bus.traffic[number].data)) for number, more in new.items())
        return Load(bits / seconds / self._bus.settings.bitrate, sum(new.values()) / seconds)


def _identifier(frame: Frame) -> int:
    return frame.identifier


# Buses that devices share ---------------------------------------------------------------------------------------------

_shared: dict[str, list[CanBus]] = {}
_sharing = threading.Lock()


def share(settings: BusSettings, report: Callable[[str], None]) -> CanBus:
    """Return the bus of this interface, channel and port, which is opened if this process has not done so.

    Each call is followed by one of ``unshare``. Raises DeviceError if the bus cannot be opened, or is open with other
    settings.
    """
    with _sharing:
        users = _shared.setdefault(settings.name, [])
        bus = users[0] if users else CanBus(settings, report=report)
        users.append(bus)
    if bus.settings != settings:
        unshare(bus)
        raise BusError(f"the CAN bus {settings.name} is open with other settings: {bus.settings}")
    return bus


def provide(bus: CanBus) -> None:
    """Share a bus that is open already; ``unshare`` ends that."""
    with _sharing:
        _shared[bus.name] = [bus]


def unshare(bus: CanBus) -> None:
    """Give a shared bus back; it is closed with the last of its users."""
    with _sharing:
        users = _shared.get(bus.name, [])
        users.remove(bus)
        if users:
            return
    bus.close()
