"""The bus: receivers, queues, errors and load, on the interfaces of python-can that need no hardware."""

from __future__ import annotations

import os
import socket
import threading
from queue import Queue
from typing import TYPE_CHECKING, ClassVar

import can
import pytest
from can.interfaces.virtual import VirtualBus

from rtf import clock
from rtf.bottle import Property
from rtf.robot.device import make_device
from rtf.robot.devices.can.bus import CanBus, LoadMeter, share, unshare
from rtf.robot.devices.can.bus_device import CanBusDevice
from rtf.robot.devices.can.bus_settings import BusSettings, bus_settings
from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.interfaces import open_interface
from rtf.robot.devices.can.messages import Frame
from rtf.robot.errors import BusError, ConfigurationError, DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator

PATIENCE = 10.0
PING = Frame(0x123, b"abc")


class Failing(VirtualBus):
    """A virtual bus that is busy, breaks or goes off when a test says so, as interfaces of hardware do."""

    busy: ClassVar[bool] = False
    broken: ClassVar[bool] = False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.broken:
            raise can.CanOperationError("the cable is out")
        if self.busy:
            raise can.CanOperationError("no buffer space available", 105)
        super().send(msg, timeout)


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A virtual channel of this test alone."""
    return request.node.name


@pytest.fixture
def failing() -> Iterator[type[Failing]]:
    """The class of a bus that fails on demand."""
    yield Failing
    Failing.busy = Failing.broken = False


@pytest.fixture(params=["virtual", "udp_multicast"])
def pair(request: pytest.FixtureRequest, channel: str) -> Iterator[tuple[CanBus, CanBus]]:
    """Two buses on one channel, as two programs would have them."""
    datagrams = request.param == "udp_multicast"
    settings = BusSettings(
        request.param, "239.74.163.77" if datagrams else channel, options=(("port", 43991),) if datagrams else ()
    )
    buses = [CanBus(settings) for _ in range(2)]
    yield buses[0], buses[1]
    for bus in buses:
        bus.close()


def test_frames_go_to_their_receivers(pair: tuple[CanBus, CanBus]):
    """A receiver gets the frames with its identifiers, in order and with the time; one without identifiers gets all."""
    here, there = pair
    some: Queue[tuple[Frame, float]] = Queue()
    every: Queue[tuple[Frame, float]] = Queue()
    end = there.subscribe(lambda frame, stamp: some.put((frame, stamp)), [0x123])
    there.subscribe(lambda frame, stamp: every.put((frame, stamp)))
    here.send(Frame(0x124, b""), PING, Frame(0x7FF, bytes(8)))
    got = [every.get(timeout=PATIENCE)[0] for _ in range(3)]
    assert got == [PING, Frame(0x124, b""), Frame(0x7FF, bytes(8))]
    frame, stamp = some.get(timeout=PATIENCE)
    assert frame == PING
    assert abs(stamp - clock.now()) < PATIENCE
    end()
    here.send(PING)
    assert every.get(timeout=PATIENCE)[0] == PING
    assert some.empty()


def test_load_is_that_of_the_bits(pair: tuple[CanBus, CanBus]):
    """The load is the bits of the frames in the time since the last question, at both ends of a bus."""
    here, there = pair
    done = threading.Event()
    there.subscribe(lambda _frame, _stamp: done.set(), [0x001])
    begin = clock.monotonic()
    meter = LoadMeter(there)
    here.send(*[PING] * 50)
    here.send(Frame(0x001, b""))
    assert done.wait(PATIENCE)
    load = meter.load()
    seconds = clock.monotonic() - begin
    least = (50 * frame_bits(PING) + frame_bits(Frame(1, b""))) / 1e6 / seconds
    assert least <= load.share
    assert load.rate >= 51 / seconds
    assert there.traffic[0x123].frames == 50


def test_a_busy_interface_is_served_in_the_order_of_identifiers(channel: str, failing: type[Failing]):
    """What waits is sent lowest identifier first, and with equal identifiers in order."""
    got: Queue[Frame] = Queue()
    receiver = CanBus(BusSettings("virtual", channel))
    receiver.subscribe(lambda frame, _stamp: got.put(frame))
    bus = CanBus(
        BusSettings("virtual", channel, transmit_timeout=PATIENCE),
        threaded=False,
        opener=lambda one: failing(channel=one.channel),
    )
    failing.busy = True
    for identifier, data in [(0x300, b"1"), (0x100, b"2"), (0x300, b"3"), (0x7FF, b"4"), (0x100, b"5")]:
        bus.send(Frame(identifier, data))
    failing.busy = False
    bus.poll()
    assert [got.get(timeout=PATIENCE).data for _ in range(5)] == [b"2", b"5", b"1", b"3", b"4"]
    bus.close()
    receiver.close()


def test_what_waits_is_sent_with_the_next_frame(channel: str, failing: type[Failing]):
    """Nothing waits for the thread of a bus while the interface is free: the next frame takes along what waits."""
    got: Queue[Frame] = Queue()
    receiver = CanBus(BusSettings("virtual", channel))
    receiver.subscribe(lambda frame, _stamp: got.put(frame))
    bus = CanBus(BusSettings("virtual", channel), threaded=False, opener=lambda one: failing(channel=one.channel))
    failing.busy = True
    bus.send(Frame(0x300, b"1"))
    failing.busy = False
    bus.send(Frame(0x100, b"2"))
    assert [got.get(timeout=PATIENCE).data for _ in range(2)] == [b"2", b"1"]
    bus.close()
    receiver.close()


def test_what_cannot_be_sent_is_reported(channel: str, failing: type[Failing]):
    """A full queue refuses frames; frames that waited too long are dropped, counted and reported."""
    said: list[str] = []
    bus = CanBus(
        BusSettings("virtual", channel, queue=2, transmit_timeout=1e-9),
        report=said.append,
        threaded=False,
        opener=lambda one: failing(channel=one.channel),
    )
    failing.busy = True
    bus.send(PING, PING)
    with pytest.raises(BusError, match="2 frames wait"):
        bus.send(PING)
    bus.poll()
    assert (bus.counters.refused, bus.counters.expired, bus.counters.sent) == (1, 2, 0)
    assert said == [f"the CAN bus virtual {channel} is busy: 2 frames waited too long and were not sent"]
    bus.close()


@pytest.mark.parametrize("how", ["written", "off"])
def test_a_lost_bus_is_reported_and_opened_again(channel: str, failing: type[Failing], how: str):
    """After an error of writing, or when the interface says that it is off, nothing is sent until it is open again."""
    said: Queue[str] = Queue()
    bus = CanBus(BusSettings("virtual", channel), report=said.put, opener=lambda one: failing(channel=one.channel))
    if how == "written":
        failing.broken = True
        with pytest.raises(BusError, match="the cable is out"):
            bus.send(PING)
        failing.broken = False
        assert "cannot be written" in said.get(timeout=PATIENCE)
    else:
        with can.Bus(interface="virtual", channel=channel) as interface:
            interface.send(can.Message(arbitration_id=0x40, is_error_frame=True))
        assert "is off" in said.get(timeout=PATIENCE)
        assert bus.counters.bus_off == 1
    assert "is on again" in said.get(timeout=PATIENCE)
    bus.send(PING)
    assert bus.counters.recovered == 1
    bus.close()


def test_nothing_is_sent_while_a_bus_is_off(channel: str, failing: type[Failing]):
    """``send`` raises BusError at once, and says how many frames are not sent."""
    bus = CanBus(BusSettings("virtual", channel), threaded=False, opener=lambda one: failing(channel=one.channel))
    failing.broken = True
    with pytest.raises(BusError):
        bus.send(PING)
    assert bus.off
    with pytest.raises(BusError, match="is off: 2 frames"):
        bus.send(PING, PING)
    bus.close()


def test_datagrams_that_are_no_frames_are_counted():
    """A damaged datagram is an error of reading; the bus goes on."""
    settings = BusSettings("udp_multicast", "239.74.163.78", options=(("port", 43992),))
    bus, got = CanBus(settings), Queue()
    bus.subscribe(lambda frame, _stamp: got.put(frame))
    raw = open_interface(settings)
    raw._multicast.send(b"\xc1 no frame")
    raw.send(can.Message(arbitration_id=0x123, data=b"abc", is_extended_id=False))
    assert got.get(timeout=PATIENCE) == PING
    assert bus.counters.read_errors == 1
    raw.shutdown()
    bus.close()


def test_datagrams_stay_on_this_machine():
    """A bus of datagrams is bound to the loopback device, and its datagrams live for no hop, unless asked otherwise."""
    raw = open_interface(BusSettings("udp_multicast", "239.74.163.79", options=(("port", 43993),)))
    with socket.socket(fileno=os.dup(raw.fileno())) as same:
        assert same.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16) == b"lo\0"
        assert same.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    raw.shutdown()


def test_interfaces_that_can_filter_do(channel: str):
    """They get the identifiers that somebody receives, and none when somebody receives all."""
    asked: list[object] = []

    class Filtering(VirtualBus):
        def set_filters(self, filters: can.typechecking.CanFilters | None = None) -> None:
            asked.append(filters if filters is None else [one["can_id"] for one in filters])

    bus = CanBus(BusSettings("socketcan", channel), threaded=False, opener=lambda one: Filtering(channel=one.channel))
    asked.clear()
    bus.subscribe(lambda _frame, _stamp: None, [0x123, 0x131])
    end = bus.subscribe(lambda _frame, _stamp: None)
    end()
    assert asked == [[0x123, 0x131], None, [0x123, 0x131]]
    bus.close()


def test_devices_share_a_bus(channel: str):
    """The same interface and channel are one bus, closed with its last user; other settings are refused."""
    settings = BusSettings("virtual", channel)
    first, second = share(settings, print), share(settings, print)
    assert first is second
    with pytest.raises(DeviceError, match="open with other settings"):
        share(BusSettings("virtual", channel, queue=7), print)
    unshare(second)
    first.send(PING)
    unshare(first)
    third = share(settings, print)
    assert third is not first
    unshare(third)
    ports = [
        share(BusSettings("udp_multicast", "239.74.163.80", options=(("port", port),)), print)
        for port in (43994, 43995)
    ]
    assert [bus.name for bus in ports] == ["udp_multicast 239.74.163.80:43994", "udp_multicast 239.74.163.80:43995"]
    for bus in ports:
        unshare(bus)


def test_the_device_keeps_a_bus_open(channel: str):
    """``canBus`` has the bus of its group CAN while it is open; devices on the bus share it."""
    device = make_device("canBus", Property.parse(f"(CAN (interface virtual) (channel {channel}))"))
    assert isinstance(device, CanBusDevice)
    shared = share(BusSettings("virtual", channel), print)
    assert device.bus is shared
    unshare(shared)
    device.bus.send(PING)
    device.close()
    with pytest.raises(DeviceError, match="canBus is not open"):
        _ = device.bus


def test_settings_are_read():
    """The group CAN names interface, channel and options."""
    text = "(CAN (interface udp_multicast) (channel 239.1.2.3) (CanTxTimeout 50) (OPTIONS (port 5000) (hop_limit 2)))"
    assert bus_settings(Property.parse(text)) == BusSettings(
        "udp_multicast", "239.1.2.3", transmit_timeout=0.05, options=(("port", 5000), ("hop_limit", 2))
    )
    with pytest.raises(ConfigurationError, match="interface is missing"):
        bus_settings(Property.parse("(CAN (channel can0))"))


def test_an_unknown_interface_is_reported():
    """The error names the bus, and what python-can says."""
    with pytest.raises(DeviceError, match=r"the CAN bus teleport 1 cannot be opened: .*teleport"):
        CanBus(BusSettings("teleport", "1"))


@pytest.mark.parametrize(
    ("text", "environment", "expected"),
    [
        ("(CAN (CanDeviceNum 3) (CanMyAddress 0))", {}, "socketcan can3"),
        ("(canDeviceNum 2) (canAddress 13)", {"CAN_CHANNEL": "vcan{}"}, "socketcan vcan2"),
        ("(CanDeviceNum 2)", {"CAN_INTERFACE": "pcan", "CAN_CHANNEL": "PCAN_USBBUS{}"}, "pcan PCAN_USBBUS2"),
        ("(CanDeviceNum 2)", {"CAN_INTERFACE": "udp_multicast"}, "udp_multicast 239.74.163.2:43115"),
        ("(CAN (interface udp_multicast) (CanDeviceNum 1) (port 5000))", {}, "udp_multicast 239.74.163.2:5001"),
        ("(CAN (interface simulated) (channel) (CanDeviceNum 1) (busName arm0))", {}, "simulated arm0"),
    ],
)
def test_the_number_of_a_bus(text: str, environment: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch):
    """Files of real robots have numbers: interface and channel are those of the environment, or usual ones."""
    for name in ("CAN_INTERFACE", "CAN_CHANNEL"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert bus_settings(Property.parse(text)).name == expected


def test_a_number_that_is_none():
    """It is named."""
    with pytest.raises(ConfigurationError, match="CanDeviceNum: ecan is not the number of a bus"):
        bus_settings(Property.parse("(CAN (CanDeviceNum ecan))"))
