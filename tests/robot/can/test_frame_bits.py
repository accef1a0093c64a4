"""The length of frames in bits, against a computation bit by bit."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.messages import Frame


def by_the_bit(frame: Frame) -> int:
    """Return the length of a frame from its list of bits, as the standard describes it."""
    bits = [int(bit) for bit in f"0{frame.identifier:011b}000{len(frame.data):04b}"]
    bits += [int(bit) for byte in frame.data for bit in f"{byte:08b}"]
    register = 0
    for bit in bits:
        following = bit ^ register >> 14
        register = register << 1 & 0x7FFF
        if following:
            register ^= 0x4599
    bits += [int(bit) for bit in f"{register:015b}"]
    sent: list[int] = []
    run = 0
    for bit in bits:
        run = run + 1 if sent and sent[-1] == bit else 1
        sent.append(bit)
        if run == 5:
            sent.append(1 - bit)
            run = 1
    return len(sent) + 1 + 2 + 7 + 3  # delimiter, acknowledgement with its delimiter, end of frame, space


@given(st.integers(0, 0x7FF), st.binary(max_size=8) | st.sampled_from([bytes(8), b"\xff" * 8]))
def test_lengths_are_those_bit_by_bit(identifier: int, data: bytes):
    """The tables give the same length as the bits one after the other."""
    frame = Frame(identifier, data)
    assert frame_bits(frame) == by_the_bit(frame)
    assert 47 + 8 * len(data) <= frame_bits(frame) <= 47 + 8 * len(data) + (33 + 8 * len(data)) // 4
