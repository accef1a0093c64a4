"""A CAN bus over the network: its frames are published, questions pass, and commands do not."""

from __future__ import annotations

import threading
import uuid
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.can_frames import CanFramesServer, pack_frames, unpack_frames
from rtf.robot.boards.can_over_yarp import YarpBus
from rtf.robot.device import SHIPPED, make_device
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can import sensor_messages as sensor
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.exchange import Exchange
from rtf.robot.devices.can.interfaces import can
from rtf.robot.devices.can.messages import Frame
from rtf.robot.errors import MessageError
from rtf.robot.publishing import PeriodicPublishing
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.robot.devices.can.bus import Receiver

NAME = "/icub/can/can0"


@pytest.fixture
def channel() -> str:
    """The name of a bus of this test alone."""
    return uuid.uuid4().hex


@pytest.fixture
def network() -> Network:
    """The network of the ports."""
    return Network(LocalNames())


@pytest.fixture
def bus(channel: str) -> Iterator[CanBus]:
    """The bus of the program that drives the boards."""
    made = CanBus(BusSettings("virtual", channel))
    yield made
    made.close()


@pytest.fixture
def boards(channel: str) -> Iterator[CanBus]:
    """The other end, where a board answers about its version."""
    made = CanBus(BusSettings("virtual", channel))
    answer = motor.VERSION.value.frame(2, 4, 3, 5, 0, 1, 6, 1)
    made.subscribe(lambda _frame, _stamp: made.send(answer), [motor.VERSION.get.identifier(2)])
    yield made
    made.close()


@pytest.fixture
def published(bus: CanBus, network: Network) -> Iterator[CanFramesServer]:
    """What publishes the frames of the bus."""
    server = CanFramesServer(bus, NAME, network=network)
    publishing = PeriodicPublishing(server, name="frames", report=print)
    yield server
    publishing.stop()
    server.close()


@pytest.fixture
def remote(published: CanFramesServer, network: Network) -> Iterator[CanBus]:
    """The bus as a test sees it."""
    made = CanBus(BusSettings("yarp", NAME), threaded=False, opener=lambda _: YarpBus(NAME, network=network))
    yield made
    made.close()


def test_records_hold_frames_and_times():
    """Also those without data; other bytes are refused."""
    frames = [(Frame(0x7FF, b""), 1.25), (Frame(0x121, bytes(range(8))), 2.5)]
    assert unpack_frames(pack_frames(iter(frames))) == frames
    with pytest.raises(MessageError, match="5 bytes are no frames"):
        unpack_frames(bytes(5))


def test_a_question_reaches_a_board_and_its_answer_comes_back(remote: CanBus, boards: CanBus):
    """The tools and tests ask through the network as on the bus; question and answer are both seen, with times."""
    exchange = Exchange(remote, timeout=2.0)
    seen: list[tuple[Frame, float]] = []
    remote.watch(lambda frame, stamp: seen.append((frame, stamp)))
    begin = clock.current().now()
    assert exchange.version(2).firmware == (3, 5, 0)
    assert [frame.identifier for frame, _ in seen] == [0x002, 0x020]
    assert all(begin - 1.0 < stamp < begin + 5.0 for _, stamp in seen)
    assert boards.counters.received


@pytest.mark.parametrize(
    "frame",
    [
        motor.POSITION_MOVE.frame(2, 1000, 100),
        motor.POSITION_PID.set.frame(2, 1, 2, 3, 4),
        motor.SET_CONTROL_MODE.frame(2, 1),
        motor.SETPOINTS[0].frame(0, 100),
        sensor.DISCOVER.get.frame(15),  # boards stop their motors then
        sensor.JUMP_TO_LOADER.frame(2),
        Frame(0x002, b"\xff"),
    ],
)
def test_commands_are_refused(frame: Frame, published: CanFramesServer, boards: CanBus, network: Network):
    """What moves or changes something is not sent, whoever asks; the answer says why."""
    raw = YarpBus(NAME, network=network)
    try:
        with pytest.raises(can.CanOperationError, match=NAME):
            raw.send(can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False))
    finally:
        raw.shutdown()
    assert boards.counters.received == 0
    assert published.answer(Bottle.parse("jump 1")).to_text().startswith("[fail]")
    assert published.answer(Bottle.parse("ask 2 text")).to_text().startswith("[fail]")


def test_a_question_and_the_loop_of_a_simulation_do_not_wait_for_each_other(
    channel: str, network: Network, monkeypatch: pytest.MonkeyPatch
):
    """The loop publishes with the lock of the bus held; a question takes no other lock before that one."""
    lock = threading.RLock()
    begun, publishing = threading.Event(), threading.Event()
    with ExitStack() as opened:
        bus = opened.enter_context(closing(CanBus(BusSettings("virtual", channel), threaded=False, lock=lock)))
        server = opened.enter_context(closing(CanFramesServer(bus, NAME, network=network)))
        opened.callback(YarpBus(NAME, network=network).shutdown)
        watch = bus.watch

        def watch_late(receive: Receiver) -> Callable[[], None]:
            begun.set()
            publishing.wait(20)
            assert lock.acquire(timeout=1.0), "the loop holds the lock, and waits for the question"
            lock.release()
            return watch(receive)

        monkeypatch.setattr(bus, "watch", watch_late)
        pool = opened.enter_context(ThreadPoolExecutor(1))
        asked = pool.submit(server.answer, Bottle(["ask", *motor.CONTROL_MODE.get.frame(2)]))
        assert begun.wait(20)
        held = lock.acquire(blocking=False)
        publishing.set()
        if not held:
            lock.acquire()
        server.publish(1.0)
        lock.release()
        assert asked.result(20) == Bottle.parse("[ok]")
        assert bus.counters.sent == 1


def test_a_host_can_fall_silent_for_a_time(remote: CanBus, bus: CanBus, published: CanFramesServer, network: Network):
    """Frames are dropped and counted, and sent again afterwards; for longer than some seconds is refused."""
    raw = YarpBus(NAME, network=network)
    raw.withhold(0.2)
    bus.send(motor.CONTROL_MODE.get.frame(2))
    assert (bus.counters.withheld, bus.counters.sent) == (1, 0)

    def sent() -> bool:
        bus.send(motor.CONTROL_MODE.get.frame(2))
        return bus.counters.sent > 0

    eventually(sent, "nothing is sent again")
    with pytest.raises(can.CanOperationError, match="0 to 5 s, not 60 s"):
        raw.withhold(60.0)
    raw.shutdown()


def test_a_missing_program_is_reported(network: Network):
    """The name of the bus is in the error, and a closed bus sends nothing."""
    with pytest.raises(can.CanInitializationError, match="/nobody"):
        YarpBus("/nobody", network=network)


def test_the_frames_of_a_device_are_published(channel: str, network: Network):
    """``canBus_nws_yarp`` is attached to a ``canBus``, and to nothing else."""
    assert "canBus_nws_yarp" in SHIPPED
    device = make_device("canBus", Property.parse(f"(CAN (interface virtual) (channel {channel}))"))
    server = make_device("canBus_nws_yarp", Property.parse("(name /frames)"), network=network)
    try:
        with pytest.raises(Exception, match="not of CanFramesDevice"):
            server.attach({"self": server})
        server.attach({"bus": device})
        watching = YarpBus("/frames", network=network)
        other = CanBus(BusSettings("virtual", channel))

        def seen() -> bool:
            other.send(motor.STATUS.frame(2, 0, 0, 0, 0, 0, 0, 0, 0))
            return watching.recv(0.05) is not None

        eventually(seen, "no frame arrives")
        other.close()
        watching.shutdown()
    finally:
        server.close()
        device.close()
