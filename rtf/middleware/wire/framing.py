"""The wire format of a connection: numbers, headers, message indexes and port commands.

Pure functions and constants; nothing here reads a socket. All integers are little-endian.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from rtf.middleware.errors import ProtocolError

#: The base to which a carrier's number is added in its header.
_BASE = 7777
#: The number at the start of each message: the size of the rest of the index head.
_INDEX = 10
#: The longest name in a header, in bytes; YARP's programs have the same limit.
MAX_NAME = 1000
#: The largest message, in bytes. Larger ones are refused before memory is allocated.
MAX_MESSAGE = 1 << 30

_number = struct.Struct("<2si2s")
_int32 = struct.Struct("<i")


def yarp_number(value: int) -> bytes:
    """Encode an integer as in handshakes and acknowledgements: ``YA``, the number, ``RP``."""
    return _number.pack(b"YA", value, b"RP")


def read_number(data: bytes | bytearray | memoryview, start: int = 0) -> int:
    """Decode an integer between ``YA`` and ``RP``. Raises ProtocolError if the letters are missing."""
    before, value, after = _number.unpack_from(data, start)
    if before != b"YA" or after != b"RP":
        raise ProtocolError(f"expected a number between YA and RP, got {bytes(data[start : start + 8])!r}")
    return value  # type: ignore[no-any-return]


ACK = yarp_number(0)
_START = yarp_number(_INDEX)
#: For each number of blocks, the index up to the lengths.
_HEADS = [_START + bytes([count, 1]) + b"\xff" * 8 for count in range(256)]
_NO_REPLIES = _int32.pack(0)
_lengths_of_two = struct.Struct("<iii")


def header(specifier: int) -> bytes:
    """Return the eight bytes with which a connection of a binary carrier begins."""
    return yarp_number(_BASE + specifier)


def specifier(data: bytes) -> int:
    """Return the carrier's number in a header, or -1 if it is not a binary carrier's."""
    return read_number(data) - _BASE if data[:2] == b"YA" and data[6:8] == b"RP" else -1


def sender(name: str) -> bytes:
    """Encode the name of a connecting port."""
    raw = name.encode("utf-8", "surrogateescape")
    return _int32.pack(len(raw) + 1) + raw + b"\0"


def index(*lengths: int) -> bytes:
    """Return the index of a message with blocks of these lengths."""
    return _HEADS[len(lengths)] + struct.pack(f"<{len(lengths)}i", *lengths) + _NO_REPLIES


#: The size of an index before the lengths.
INDEX_SIZE = 18
_TEXT = b"~\0\0\1"


def index_rest(data: bytes | bytearray | memoryview, start: int = 0) -> tuple[int, int]:
    """Return how many lengths, and how many bytes in total, follow the first eighteen bytes of an index."""
    if data[start : start + 8] != _START:
        raise ProtocolError(f"expected a message, got {bytes(data[start : start + 8])!r}")
    blocks = data[start + 8]
    return blocks, 4 * (blocks + data[start + 9])


def message_size(data: bytes | bytearray | memoryview, start: int, blocks: int) -> int:
    """Return the size of a message from the lengths of its blocks. Raises ProtocolError for invalid lengths."""
    lengths: tuple[int, ...] = struct.unpack_from(f"<{blocks}i", data, start)
    size = sum(lengths)
    if blocks and (min(lengths) < 0 or size > MAX_MESSAGE):
        raise ProtocolError(f"a message of {size} bytes; at most {MAX_MESSAGE} are accepted")
    return size


class Command(NamedTuple):
    """A port command: its letter, the text that came with it, and the offset of the data."""

    key: str
    text: str
    data: int


_PLAIN = {letter: b"\0\0\0\0~" + letter.encode() + b"\0\1" for letter in "dDaq"}
_SINGLE = {command: Command(letter, "", 8) for letter, command in _PLAIN.items()}
#: The smallest size of a command, in bytes.
COMMAND_SIZE = 8


def command(key: str, envelope: str = "") -> bytes:
    """Encode a port command; ``envelope`` travels beside the data of ``d`` and ``D``."""
    return _PLAIN[key] if not envelope else command_text(f"{key} {envelope}")


def front(key: str, envelope: str, size: int) -> bytes:
    """Return all bytes before the data of a message: index and command."""
    said = command(key, envelope)
    return _HEADS[2] + _lengths_of_two.pack(len(said), size, 0) + said


def command_text(text: str) -> bytes:
    """Encode a command that is a text, such as ``~/name``."""
    raw = text.encode("utf-8", "surrogateescape") + b"\0"
    return _int32.pack(len(raw)) + _TEXT + raw


def command_text_size(head: bytes | bytearray | memoryview) -> int:
    """Return how many bytes of text follow the first eight of a command."""
    if head[4] != ord("~"):
        raise ProtocolError(f"expected a port command, got {bytes(head)!r}")
    (length,) = _int32.unpack_from(head, 0)
    if head[5]:
        return 0
    if not 1 <= length <= MAX_NAME:
        raise ProtocolError(f"a port command of {length} characters")
    return length  # type: ignore[no-any-return]


def read_command(data: bytes | bytearray | memoryview) -> Command:
    """Decode the command at the start of a message."""
    known = _SINGLE.get(bytes(data[:8]))
    if known is not None:
        return known
    if len(data) < COMMAND_SIZE or data[4] != ord("~"):
        raise ProtocolError(f"expected a port command, got {bytes(data[:8])!r}")
    if data[5]:
        return Command(chr(data[5]), "", COMMAND_SIZE)
    (length,) = _int32.unpack_from(data, 0)
    end = COMMAND_SIZE + length
    if length < 1 or end > len(data):
        raise ProtocolError(f"a port command of {length} characters in a message of {len(data)} bytes")
    raw = bytes(data[COMMAND_SIZE:end]).split(b"\0", 1)[0]
    return text_command(raw.decode("utf-8", "surrogateescape"), end)


def text_command(text: str, data: int = 0) -> Command:
    """Split a text command into its letter and what follows."""
    key = text[:1]
    if key in ("d", "D"):
        # "d ENVELOPE"; control characters end an envelope.
        envelope = text[2:]
        if not envelope.isprintable():
            end = next((place for place, letter in enumerate(envelope) if letter < " "), len(envelope))
            envelope = envelope[:end]
        return Command(key, envelope, data)
    return Command(key, text, data)
