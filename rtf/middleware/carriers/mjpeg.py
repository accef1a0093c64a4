"""``mjpeg``: pictures as JPEG, in the form that browsers and network cameras use.

It is a *pull* carrier: the reader opens the connection and asks for a stream, and the port at the other end sends to it
from then on. The reader may be a port, a port of YARP, or a browser; the sender may be a network camera. A message is
one part of a ``multipart/x-mixed-replace`` document; the envelope is a comment within the JPEG.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Dialect
from rtf.errors import RtfError
from rtf.middleware.carriers.base import Carrier, InputLink, OutputLink
from rtf.middleware.carriers.stream_carrier import StreamInput
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.types.image import Image
from rtf.middleware.wire.protocol import Caller, Receiver

if TYPE_CHECKING:
    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.inbox import Inbox, Reading, Steps
    from rtf.middleware.wire.outgoing_message import OutgoingMessage
    from rtf.middleware.wire.protocol import Message, Messages

IMAGE = Image.codec
_BOUNDARY = b"--boundarydonotcross\r\n"
_GREETING = (
    b"HTTP/1.0 200 OK\r\n"
    b"Connection: close\r\n"
    b"Cache-Control: no-store\r\n"
    b"Content-Type: multipart/x-mixed-replace;boundary=boundarydonotcross\r\n"
    b"X-Content-Type-Options: nosniff\r\n"
    b"Cross-Origin-Resource-Policy: same-origin\r\n"
    b"\r\n" + _BOUNDARY
)
#: The most lines before a blank one, in a request, a reply, or the head of a part.
_MOST_LINES = 100
#: The largest picture that is received: of its JPEG in bytes, and of its pixels.
MAX_JPEG = 1 << 26
MAX_PIXELS = 1 << 26
#: 85 of 100 shows no artefacts at the size of a camera's picture, in a tenth of its bytes.
_QUALITY = 85


class MjpegReceiver(Receiver):
    """The receiving end: parts of a document, each with a picture."""

    def messages(self) -> Messages:
        """Receive pictures, as encoded images in ``rgb``."""
        while True:
            while not (head := (yield from _head(self.inbox))):
                pass  # a blank line ends the part before
            data = yield from self.inbox.take(_length(head))
            picture, envelope = decode_jpeg(bytes(data))
            del data  # its memory is reused if nothing refers to it
            yield "D", envelope, b"".join(IMAGE.encode(picture, Dialect.YARP3))


class MjpegRequest(InputLink):
    """The request of a reader. It asks at once that the connection is reversed."""

    def __init__(self, carrier: Carrier, stream: Stream) -> None:
        host, number = stream.socket.getpeername()[:2]
        # Not the name of a port: a reader does not give one, and each is an output of its own.
        super().__init__(carrier, stream, Caller(f"mjpeg-{host}:{number}"))

    def receive(self) -> Message:
        """Return the command that reverses the connection."""
        return "r", "", b""

    def answer(self, *reply: Buffer) -> None:
        """Announce the stream."""
        self._stream.send(_GREETING, *reply)

    def reversed(self, stream: Stream) -> OutputLink:
        return MjpegOutput(self.carrier, stream)


class MjpegOutput(OutputLink):
    """The sending end. Nothing is acknowledged, so a slow reader is noticed when the network's buffers are full."""

    def send(self, message: OutgoingMessage) -> None:
        """Send a picture. Raises ProtocolError for any other object, which ends the connection."""
        try:
            image = IMAGE.decode(b"".join(message.blocks), message.dialect)
            jpeg = encode_jpeg(image, message.envelope)
        except RtfError as error:
            raise ProtocolError(f"mjpeg is for images only: {error}") from None
        self._stream.send(
            b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(jpeg), jpeg, b"\r\n" + _BOUNDARY
        )


class Mjpeg(Carrier):
    """Pictures, to a browser or another port."""

    name = "mjpeg"
    header = b"GET /?ac"
    has_dialects = False
    pull = True

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Read the rest of the request."""
        if not port.allows_outputs:
            raise ConnectError("Outputs not allowed")
        stream.run(_head(stream))
        return MjpegRequest(self, stream)

    def pull_from(self, stream: Stream, source: Contact) -> InputLink:
        """Ask a port or a network camera for its pictures."""
        stream.run(_ask(stream, source))
        return StreamInput(self, stream, MjpegReceiver(stream, acknowledged=False), Caller(source.name))


MJPEG = Mjpeg()


def _ask(inbox: Inbox, source: Contact) -> Steps[None]:
    """Send a request for pictures and read the head of the answer."""
    host = f"[{source.host}]" if ":" in source.host else source.host
    yield f"GET /?action=stream HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
    status = yield from inbox.line()
    if status.split(b" ")[1:2] != [b"200"]:
        raise ProtocolError(f"{source.name or source} sends no pictures; it answered {status[:80]!r}")
    yield from _head(inbox)


def _head(inbox: Inbox) -> Reading[list[bytes]]:
    """Read the lines up to a blank one, which is read, too."""
    lines: list[bytes] = []
    while line := (yield from inbox.line()):
        lines.append(line)
        if len(lines) > _MOST_LINES:
            raise ProtocolError(f"a request or a part with more than {_MOST_LINES} lines before its end")
    return lines


def _length(head: list[bytes]) -> int:
    fields = dict(line.lower().split(b":", 1) for line in head if b":" in line)
    if not fields.get(b"content-type", b"").strip().startswith(b"image/jpeg"):
        raise ProtocolError(f"a part of the stream is not a JPEG: {b', '.join(head)[:200]!r}")
    text = fields.get(b"content-length", b"").strip()
    size = int(text) if text.isdigit() and len(text) < 12 else -1  # noqa: PLR2004 - digits of a length
    if not 0 <= size <= MAX_JPEG:
        raise ProtocolError(f"a picture of {text[:20]!r} bytes; at most {MAX_JPEG} are accepted")
    return size


def encode_jpeg(image: Image, envelope: str = "") -> bytes:
    """Return an image as JPEG, with the envelope in its comment. ``mono`` becomes grey, all else ``rgb``."""
    from PIL import Image as Pictures

    pixels = image.pixels if image.code == "mono" else image.to("rgb").pixels
    comment = {"comment": envelope.encode("utf-8", "surrogateescape") + b"\0"} if envelope else {}
    jpeg = io.BytesIO()
    Pictures.fromarray(np.ascontiguousarray(pixels)).save(jpeg, "JPEG", quality=_QUALITY, **comment)
    return jpeg.getvalue()


def decode_jpeg(data: bytes) -> tuple[Image, str]:
    """Return the image in a JPEG, as ``rgb``, and its comment. Raises ProtocolError."""
    from PIL import Image as Pictures

    try:
        with Pictures.open(io.BytesIO(data), formats=["JPEG"]) as picture:
            if picture.width * picture.height > MAX_PIXELS:
                raise ProtocolError(f"a picture of {picture.width} x {picture.height} pixels; at most {MAX_PIXELS}")
            comment = picture.info.get("comment", b"")
            return Image(np.array(picture.convert("RGB"))), comment.rstrip(b"\0").decode("utf-8", "surrogateescape")
    except (OSError, ValueError, SyntaxError, Pictures.DecompressionBombError) as error:
        raise ProtocolError(f"this is not a JPEG: {error}") from None
