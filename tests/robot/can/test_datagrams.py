"""Buses in datagrams: all frames that are sent at once arrive, in their order, at all others, and at other programs."""

from __future__ import annotations

import socket
import struct
from contextlib import closing

import can
import pytest

from free_ports import free_port
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import DATAGRAMS, MULTICAST_GROUP, BusSettings
from rtf.robot.devices.can.interfaces import open_interface
from rtf.robot.devices.can.messages import Frame
from rtf.robot.errors import DeviceError
from waiting import eventually


def settings() -> BusSettings:
    """A bus of this test alone."""
    return BusSettings(DATAGRAMS, MULTICAST_GROUP, options=(("port", free_port(socket.SOCK_DGRAM)),))


def test_frames_arrive_in_their_order_and_not_at_their_sender():
    """More than a datagram has room for, of all lengths; a sender watches its own once."""
    given = settings()
    frames = [Frame(0x100 + number % 16, bytes([number]) * (number % 9)) for number in range(250)]
    with closing(CanBus(given)) as here, closing(CanBus(given)) as there, closing(CanBus(given)) as third:
        got, own = [], []
        there.subscribe(lambda frame, _: got.append(frame))
        here.watch(lambda frame, _: own.append(frame))
        here.send(*frames)
        expected = sorted(frames, key=lambda frame: frame.identifier)
        eventually(lambda: len(got) == len(frames), "frames are lost")
        eventually(lambda: third.counters.received == len(frames), "frames are lost")
        assert got == own == expected
        assert (here.counters.sent, here.counters.received, there.traffic[0x105].frames) == (250, 0, 16)


def test_a_host_that_falls_silent_sends_nothing():
    """Frames are counted, one by one, and lost."""
    with closing(CanBus(settings(), threaded=False)) as bus:
        bus.withhold(5.0)
        bus.send(Frame(0x101, b""), Frame(0x102, b""))
        assert (bus.counters.sent, bus.counters.withheld) == (0, 2)


def test_other_programs_of_python_can_read_and_write_it():
    """As a bus of python-can, frame by frame."""
    given = settings()
    with closing(CanBus(given, threaded=False)) as bus, open_interface(given) as other:
        bus.send(Frame(0x123, b"\x01\x02"), Frame(0x124, b""))
        first, second = other.recv(1.0), other.recv(1.0)
        assert first is not None
        assert second is not None
        assert (first.arbitration_id, bytes(first.data)) == (0x123, b"\x01\x02")
        assert (second.arbitration_id, bytes(second.data)) == (0x124, b"")
        assert other.recv(0.0) is None
        other.send(can.Message(arbitration_id=0x7, data=b"\x09", is_extended_id=False))
        assert bus.poll(1.0)
        assert bus.traffic[0x7].data == b"\x09"


def test_a_foreign_identifier_is_ignored():
    """A frame of another program with more than 11 bits of identifier is dropped; the frames after it arrive."""
    given = settings()
    got: list[Frame] = []
    with (
        closing(CanBus(given)) as bus,
        closing(CanBus(given, threaded=False)) as other,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign,
    ):
        bus.watch(lambda frame, _: got.append(frame))
        foreign.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        record = struct.pack("<HB8s", 0x900, 1, b"\x01")
        foreign.sendto(record, (MULTICAST_GROUP, int(dict(given.options)["port"])))
        other.send(Frame(0x7FF, b"\x02"))
        eventually(lambda: got, "the bus does not read any more")
    assert got == [Frame(0x7FF, b"\x02")]


@pytest.mark.parametrize("channel", ["nowhere", "127.0.0.1"])
def test_a_group_that_is_none_is_reported(channel: str):
    """With the bus, and the cause."""
    with pytest.raises(DeviceError, match=f"the CAN bus datagrams {channel} cannot be opened"):
        CanBus(BusSettings(DATAGRAMS, channel))
