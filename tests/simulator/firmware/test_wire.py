"""Tests of the bus in simulated time: order, time, errors, and who gets what."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.messages import Frame
from rtf.simulator.firmware.wire import BIT_RATE, BUS_OFF, QUEUE, Wire

if TYPE_CHECKING:
    from collections.abc import Iterator

STEP = 0.001


class Listener:
    """A node that keeps what it gets."""

    def __init__(self, wire: Wire, address: int | None = None) -> None:
        self.address = address
        self.got: list[tuple[float, Frame]] = []
        self.connection = wire.attach(self)

    def receive(self, frame: Frame, time: float) -> None:
        """Keep the frame."""
        self.got.append((time, frame))

    @property
    def frames(self) -> list[Frame]:
        """The frames without their times."""
        return [frame for _, frame in self.got]


def run(wire: Wire, seconds: float, begin: float = 0.0) -> None:
    """Run a wire."""
    for step in range(round(seconds / STEP)):
        wire.step(begin + step * STEP)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(0x100, 0x1FF), st.binary(max_size=8)), max_size=QUEUE))
def test_frames_are_sent_in_the_order_of_their_identifiers_and_take_their_time(given_frames: list[tuple[int, bytes]]):
    """Of equal identifiers the first comes first; a frame arrives when its bits, and those before it, have passed."""
    wire = Wire("arm")
    board, host = Listener(wire, 1), Listener(wire)
    frames = [Frame(*one) for one in given_frames]
    for frame in frames:
        assert board.connection.send(frame)
    run(wire, 0.05)
    expected = sorted(frames, key=lambda frame: frame.identifier)
    assert host.frames == expected
    total = 0
    for (time, _), frame in zip(host.got, expected, strict=True):
        total += frame_bits(frame)
        assert abs(time - total / BIT_RATE) < 1e-9
    assert wire.bits == total


def test_requests_reach_their_board_and_broadcasts_the_host():
    """A board gets what is for it or for all; a host gets everything but its own."""
    wire = Wire("arm")
    first, second, host, other = Listener(wire, 1), Listener(wire, 2), Listener(wire), Listener(wire)
    for identifier in (0x001, 0x70F, 0x10F):
        host.connection.send(Frame(identifier, b"\x07"))
    second.connection.send(Frame(0x121, bytes(8)))
    run(wire, 0.005)
    assert [frame.identifier for frame in first.frames] == [0x001, 0x10F, 0x70F]
    assert [frame.identifier for frame in second.frames] == [0x10F, 0x70F]
    assert [frame.identifier for frame in host.frames] == [0x121]
    assert [frame.identifier for frame in other.frames] == [0x001, 0x10F, 0x121, 0x70F]


def test_an_overloaded_bus_delays_what_has_a_high_identifier_and_counts_what_has_no_room():
    """A node that never stops sending with a low identifier keeps the others from sending."""
    wire = Wire("arm")
    babbling, board, host = Listener(wire, 1), Listener(wire, 2), Listener(wire)
    board.connection.send(Frame(0x121, bytes(8)))
    for step in range(20):
        for _ in range(12):
            babbling.connection.send(Frame(0x010, bytes(8)))
        wire.step(step * STEP)
    assert Frame(0x121, bytes(8)) not in host.frames
    assert babbling.connection.lost > 0
    run(wire, 0.05, 0.02)
    assert host.frames[-1] == Frame(0x121, bytes(8))
    assert babbling.connection.waiting == board.connection.waiting == 0


def test_two_nodes_with_one_identifier_spoil_each_other_and_go_off_the_bus():
    """Frames with the same identifier and other data are errors of both senders, which give up; the rest go on."""
    wire = Wire("arm")
    first, second, third, host = Listener(wire, 1), Listener(wire, 1), Listener(wire, 3), Listener(wire)
    first.connection.send(Frame(0x111, b"\x01"))
    second.connection.send(Frame(0x111, b"\x02"))
    third.connection.send(Frame(0x131, b"\x03"))
    run(wire, 0.01)
    assert first.connection.off
    assert second.connection.off
    assert not first.connection.send(Frame(0x111, b"\x01"))
    assert host.frames == [Frame(0x131, b"\x03")]
    assert first.connection.sender_errors > BUS_OFF
    assert host.connection.receiver_errors > 0
    first.connection.recover()
    assert first.connection.send(Frame(0x111, b"\x01"))
    run(wire, 0.01, 0.01)
    assert host.frames[-1] == Frame(0x111, b"\x01")


def test_a_disturbed_frame_is_sent_again():
    """An error costs time, is counted, and reported to hosts; a good frame takes one off the count."""
    wire = Wire("arm")
    board, host = Listener(wire, 1), Listener(wire)
    disturbed: list[bool] = []
    errors: Iterator[bool] = iter([True, True, False])
    wire.disturbances.append(lambda _frame, _time: next(errors))
    host.connection.disturbed = lambda: disturbed.append(True)
    board.connection.send(Frame(0x111, b"\x01"))
    run(wire, 0.002)
    assert host.frames == [Frame(0x111, b"\x01")]
    assert len(disturbed) == 2
    assert board.connection.sender_errors == 2 * 8 - 1
    assert wire.bits > frame_bits(Frame(0x111, b"\x01"))


def test_filters_lose_duplicate_and_change_frames():
    """What is delivered in place of a frame is a matter of the filters, one after the other."""
    wire = Wire("arm")
    board, host = Listener(wire, 1), Listener(wire)
    wire.filters.append(lambda frame, _time: [] if frame.data == b"\x01" else [frame, frame])
    wire.filters.append(lambda frame, _time: [Frame(0x122, frame.data)])
    board.connection.send(Frame(0x111, b"\x01"))
    board.connection.send(Frame(0x111, b"\x02"))
    run(wire, 0.002)
    assert host.frames == [Frame(0x122, b"\x02")] * 2


def test_a_node_that_is_detached_gets_and_sends_nothing():
    """What it had queued is lost."""
    wire = Wire("arm")
    board, host = Listener(wire, 1), Listener(wire)
    board.connection.send(Frame(0x111, b"\x01"))
    wire.detach(board.connection)
    host.connection.send(Frame(0x001, b"\x07"))
    run(wire, 0.002)
    assert not host.got
    assert not board.got
