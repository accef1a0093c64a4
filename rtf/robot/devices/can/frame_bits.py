"""How many bits a frame has on the bus, with those that are stuffed: for the load of a bus, and the time of a frame.

A data frame is: start, identifier (11), three control bits, length (4), data, checksum (15). From the start to the end
of the checksum, a bit of the other value is stuffed in after five equal ones. Then follow 13 bits without stuffing,
among them the acknowledgement, and the space between frames. Source: ISO 11898-1, the base format of classical frames.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Frame

#: Bits before the data; with the checksum, and those after it: its delimiter, acknowledgement, end of frame, and the
#: space to the next one.
_HEAD = 19
_FIXED = _HEAD + 15 + 13
_POLYNOMIAL, _CHECKSUM_MASK = 0x4599, 0x7FFF
#: After so many equal bits one is stuffed in.
_RUN = 5


def frame_bits(frame: Frame) -> int:
    """Return the length of a frame in bits, from its start to the earliest start of the next one: 47 to 135."""
    identifier, data = frame
    checksum, stuffed, state = _head(identifier, len(data))
    for byte in data:
        checksum = (checksum << 8 & _CHECKSUM_MASK) ^ _CHECKSUMS[checksum >> 7 ^ byte]
        extra, state = _STUFFING[state][byte]
        stuffed += extra
    extra, state = _STUFFING[state][checksum >> 7]
    return _FIXED + 8 * len(data) + stuffed + extra + _STUFFING_OF_7[state][checksum & 0x7F][0]


@cache
def _head(identifier: int, size: int) -> tuple[int, int, int]:
    """Return the checksum, the number of stuffed bits, and the state after the bits before the data."""
    head = identifier << 7 | size
    checksum = 0
    for byte in head.to_bytes(3, "big"):  # with leading zeros, which do not change it
        checksum = (checksum << 8 & _CHECKSUM_MASK) ^ _CHECKSUMS[checksum >> 7 ^ byte]
    # The start is the first bit, and 0.
    return checksum, *_stuff(0, head, _HEAD - 1)


def _checksum(byte: int) -> int:
    """Return the checksum of a byte after a checksum of 0."""
    register = byte << 7
    for _ in range(8):
        register = register << 1 ^ (_POLYNOMIAL if register & 0x4000 else 0)
    return register & _CHECKSUM_MASK


def _stuff(state: int, bits: int, size: int) -> tuple[int, int]:
    """Return how many bits are stuffed into ``size`` bits after a state, and the state after them.

    A state is the value of the last bit, and the length of the run that it ends.
    """
    last, run = state // _RUN, state % _RUN + 1
    stuffed = 0
    for place in range(size - 1, -1, -1):
        bit = bits >> place & 1
        last, run = (bit, run + 1) if bit == last else (bit, 1)
        if run == _RUN:
            stuffed += 1
            last, run = 1 - bit, 1
    return stuffed, last * _RUN + run - 1


_CHECKSUMS = tuple(_checksum(byte) for byte in range(256))
_STUFFING = tuple(tuple(_stuff(state, byte, 8) for byte in range(256)) for state in range(2 * _RUN))
_STUFFING_OF_7 = tuple(tuple(_stuff(state, bits, 7) for bits in range(128)) for state in range(2 * _RUN))
