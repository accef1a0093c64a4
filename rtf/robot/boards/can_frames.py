"""The frames of a CAN bus on the network, for tests and tools that have no access to the bus itself.

``NAME/frames:o`` has all frames that the process sends and receives on the bus: each message is one blob of records of
nineteen bytes, little endian: time (s, 64-bit float), identifier (16 bits), number of bytes, eight bytes of data.
``NAME/rpc:i`` takes two requests, and answers ``[ok]``, or ``[fail]`` and a sentence:

- ``ask IDENTIFIER BLOB`` sends a frame that asks a board for something. Commands and settings are refused: nothing can
  be moved through this port.
- ``withhold SECONDS`` has the process send nothing for some seconds, as if it had died, to see that boards stop then.
"""

from __future__ import annotations

import struct
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Vocab, as_float, as_int, as_string
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types.codecs import BOTTLE
from rtf.robot.devices.can import motor_messages, sensor_messages
from rtf.robot.devices.can.bus_device import CanBusDevice
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.messages import Dialect, Frame, Question, Setting
from rtf.robot.errors import BusError, MessageError, NotSupportedError, RefusedError
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.stream_server import StreamServer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.devices.can.bus import CanBus
    from rtf.robot.publishing import Outlets

#: The endings of the ports.
FRAMES, REQUESTS = "/frames:o", "/rpc:i"
#: Seconds between two messages of frames.
FRAMES_PERIOD = 0.01
#: The greatest time for which nothing is sent (s): a board without a watchdog goes on meanwhile.
LONGEST = 5.0
_RECORD = struct.Struct("<dHB8s")
#: Frames that wait for the next message at most; they are older than a second then.
_MOST = 20_000
_OK, _FAIL = Vocab("ok"), Vocab("fail")
#: What boards may be asked for. A search makes them stop their motors.
_QUESTIONS = frozenset(
    one.get
    for module in (motor_messages, sensor_messages)
    for one in vars(module).values()
    if isinstance(one, Question | Setting) and one is not sensor_messages.DISCOVER
)


def _is_question(frame: Frame) -> bool:
    """Whether a frame asks a board of one of the dialects for something."""
    for dialect in (Dialect.JOINT, Dialect.FOC):
        with suppress(MessageError):
            if decode(*frame, dialect).message in _QUESTIONS:
                return True
    return False


def pack_frames(frames: Iterator[tuple[Frame, float]]) -> bytes:
    """Return frames and their times as records."""
    return b"".join([_RECORD.pack(time, one[0], len(one[1]), one[1]) for one, time in frames])


def unpack_frames(data: bytes) -> list[tuple[Frame, float]]:
    """Return the frames of records, with their times. Raises MessageError for other bytes."""
    try:
        return [(Frame(number, text[:size]), time) for time, number, size, text in _RECORD.iter_unpack(data)]
    except struct.error as error:
        raise MessageError(f"{len(data)} bytes are no frames: {error}") from error


class CanFramesServer(StreamServer[Bottle]):
    """Publishes the frames of a bus while there are readers, and passes their questions on.

    Raises ConnectError and AddressError.
    """

    def __init__(
        self, bus: CanBus, name: str, *, network: Network, period: float = FRAMES_PERIOD, outlets: Outlets | None = None
    ) -> None:
        super().__init__(name, network=network, period=period, strict=True, outlets=outlets)
        self._bus = bus
        self._frames: deque[tuple[Frame, float]] = deque(maxlen=_MOST)
        self._end: Callable[[], None] | None = None
        self.open_ports([f"{name}{FRAMES}"], BOTTLE)
        self._opened.enter_context(RpcServer(f"{name}{REQUESTS}", self.answer, network=network, guarded=True))

    def publish(self, now: float) -> None:
        """Publish, and watch the bus only while there are readers."""
        if self.heard:
            self._watch()
        else:
            self._stop()
        super().publish(now)

    def _watch(self) -> None:
        """Watch the bus from now on. May be called in any thread."""
        with self._bus.lock:  # of a simulation, whose loop publishes with it held
            if self._end is None:
                self._end = self._bus.watch(self._take)

    def _take(self, frame: Frame, stamp: float) -> None:
        self._frames.append((frame, stamp))

    def measure(self, now: float) -> tuple[Bottle, float] | None:
        frames = pack_frames(self._frames.popleft() for _ in range(len(self._frames)))
        return (Bottle([frames]), now) if frames else None

    def _stop(self) -> None:
        with self._bus.lock:
            if self._end is not None:
                self._end()
                self._end = None
                self._frames.clear()

    def answer(self, request: Bottle) -> Bottle:
        """Return the answer to a request. May be called in any thread."""
        word = as_string(request.get(0))
        try:
            if word == "ask":
                self._ask(as_int(request.get(1)), request.get(2))
            elif word == "withhold":
                self._withhold(as_float(request.get(1)))
            else:
                return Bottle([_FAIL, f"{word[:20]!r} is not a request; the requests are ask and withhold"])
        except (RefusedError, BusError, MessageError) as error:
            return Bottle([_FAIL, f"{self.name}: {error}"])
        return Bottle([_OK])

    def _ask(self, identifier: int, data: object) -> None:
        if not isinstance(data, bytes):
            raise RefusedError("a frame has an identifier and a blob")
        if not _is_question(Frame(identifier, data)):
            raise RefusedError(f"the frame {identifier:#05x} is no question; only questions are passed on")
        if self.heard:  # a reader that has just begun sees the question, too
            self._watch()
        self._bus.send(Frame(identifier, data))

    def _withhold(self, seconds: float) -> None:
        if not 0.0 <= seconds <= LONGEST:
            raise RefusedError(f"nothing can be sent for 0 to {LONGEST:g} s, not {seconds:g} s")
        self._bus.withhold(seconds)

    def close(self) -> None:
        super().close()
        self._stop()


class CanFramesDevice(PublishingDevice):
    """``canBus_nws_yarp``: the frames of the device ``canBus`` that it is attached to; ``period`` in s."""

    default_period = FRAMES_PERIOD

    def serve(self, device: Device) -> CanFramesServer:
        if not isinstance(device, CanBusDevice):
            raise NotSupportedError(f"{self.name} publishes the frames of a canBus, not of {type(device).__name__}")
        return CanFramesServer(
            device.bus, self.port_name, network=self.network, period=self.period, outlets=self.outlets
        )
