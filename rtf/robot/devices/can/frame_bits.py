"""How many bits a frame has on the bus, with those that are stuffed: for the load of a bus, and the time of a frame.

A data frame is: start, identifier (11), three control bits, length (4), data, checksum (15). From the start to the end
of the checksum, a bit of the other value is stuffed in after five equal ones. Then follow 13 bits without stuffing,
among them the acknowledgement, and the space between frames. Source: ISO 11898-1, the base format of classical frames.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Frame

#: Bits after the checksum: its delimiter, acknowledgement, end of frame, and the space to the next one.
_UNSTUFFED = 13
_POLYNOMIAL = 0x4599
_CHECKSUM = 15
#: After so many equal bits one is stuffed in.
_RUN = 5


def frame_bits(frame: Frame) -> int:
    """Return the length of a frame in bits, from its start to the earliest start of the next one: 47 to 135."""
    identifier, data = frame
    head = identifier << 7 | len(data)  # 19 bits, the highest of which is the start
    checksum = 0
    for byte in (head >> 16, head >> 8 & 0xFF, head & 0xFF, *data):
        checksum = (checksum << 8 & 0x7FFF) ^ _CHECKSUMS[checksum >> 7 ^ byte]
    # 34 bits and the data: the first two by themselves, then bytes. The start is 0.
    first = head >> 17 & 1
    stuffed, state = 0, _state(first, 1 if first else 2)
    bits = (head & 0x1FFFF) << 8 * len(data) | int.from_bytes(data, "big")
    bits = bits << _CHECKSUM | checksum
    for byte in bits.to_bytes(4 + len(data), "big"):
        extra, state = _STUFFING[state][byte]
        stuffed += extra
    return 34 + 8 * len(data) + stuffed + _UNSTUFFED


def _state(last: int, run: int) -> int:
    """Return the number of the state after ``run`` bits with the value ``last``."""
    return last * _RUN + run - 1


def _checksum(byte: int) -> int:
    """Return the checksum of a byte after a checksum of 0."""
    register = byte << 7
    for _ in range(8):
        register = register << 1 ^ (_POLYNOMIAL if register & 0x4000 else 0)
    return register & 0x7FFF


def _stuff(state: int, byte: int) -> tuple[int, int]:
    """Return how many bits are stuffed into a byte after a state, and the state after it."""
    last, run = state // _RUN, state % _RUN + 1
    stuffed = 0
    for place in range(7, -1, -1):
        bit = byte >> place & 1
        last, run = (bit, run + 1) if bit == last else (bit, 1)
        if run == _RUN:
            stuffed += 1
            last, run = 1 - bit, 1
    return stuffed, _state(last, run)


_CHECKSUMS = tuple(_checksum(byte) for byte in range(256))
_STUFFING = tuple(tuple(_stuff(state, byte) for byte in range(256)) for state in range(2 * _RUN))
