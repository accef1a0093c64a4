"""Images by ``mjpeg``: between ports, to browsers and YARP's readers, and from servers that send invalid data."""

from __future__ import annotations

import io
import socket
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image as Pictures

from rtf.bottle import Bottle
from rtf.middleware.carriers.mjpeg import MAX_PIXELS, decode_jpeg, encode_jpeg
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.types.image import Image
from rtf.middleware.wire.contact import Contact
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager

    from rtf.middleware.ports.network import Network

BOUNDARY = b"--boundarydonotcross\r\n"


def picture(red: int = 200) -> Image:
    """Return a picture of one colour with a dark corner."""
    pixels = np.full((48, 64, 3), (red, 40, 90), np.uint8)
    pixels[:16, :16] = 0
    return Image(pixels)


class TestPorts:
    """Ports of this library at both ends."""

    def test_pictures_and_envelopes_arrive(self, network: Network) -> None:
        """The reader connects to the camera; images arrive as rgb, up to the loss of JPEG, with their envelopes."""
        with (
            BufferedPort("/cam", Image.codec, network=network) as camera,
            BufferedPort("/view", Image.codec, network=network, strict=True) as viewer,
        ):
            viewer.add_output("mjpeg:/cam")
            eventually(lambda: camera.outputs, "the camera has no output")
            assert not camera.inputs, "a reader is an output only"
            camera.write(picture(), envelope="7 12.5", strict=True)
            got = viewer.receive(10)
            assert (got.sender, got.envelope) == ("/cam", "7 12.5")
            difference = np.abs(got.value.pixels.astype(int) - picture().pixels.astype(int))
            assert difference.mean() < 3

    def test_tools_ask_the_reader(self, network: Network) -> None:
        """Tools connect and disconnect by a request to the reader, which opens the connection."""
        camera, viewer = Contact("/cam"), Contact("/view")
        with BufferedPort("/cam", Image.codec, network=network) as one, Port("/view", network=network) as other:
            remote.connect(network, camera, viewer, "mjpeg")
            eventually(lambda: [caller.carrier for caller in other.inputs] == ["mjpeg"], "there is no input")
            remote.disconnect(network, camera, viewer)
            eventually(lambda: not other.inputs, "the input is still there")
            eventually(lambda: not one.outputs or one.write(picture()) is None, "the output is still there")

    def test_other_objects_end_the_connection(self, network: Network, said: list[str]) -> None:
        """A message that is no image ends the connection, and the reason is reported."""
        with Port("/words", network=network) as words, BufferedPort("/view", Image.codec, network=network) as viewer:
            viewer.add_output("mjpeg:/words")
            eventually(lambda: words.outputs, "there is no output")
            assert words.write(Bottle(["no picture"])) == 0
            assert not words.outputs
            assert any("mjpeg is for images only" in line for line in said), said

    def test_directions(self, network: Network) -> None:
        """A port without inputs cannot connect to a camera."""
        with Port("/cam", network=network) as camera, Port("/only", network=network, inputs=False) as only:
            with pytest.raises(ConnectError, match="Inputs not allowed"):
                only.add_output("mjpeg:/cam")
            assert not camera.outputs


class TestForeignReaders:
    """Requests as browsers and YARP's ports send them."""

    @pytest.mark.parametrize(
        "request_text",
        [
            b"GET /?action=stream HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: image/*\r\n\r\n",
            # YARP's own, with the end of the line in an odd place.
            b"GET /?action=stream\n\n HTTP/1.1\nHost: 127.0.0.1\r\n\n",
        ],
    )
    def test_stream(self, network: Network, request_text: bytes) -> None:
        """The response is a multipart document of JPEGs, each with its right length."""
        with BufferedPort("/cam", Image.codec, network=network) as camera:
            address = (camera.contact.host, camera.contact.port)
            with socket.create_connection(address, timeout=10) as peer, peer.makefile("rb") as stream:
                peer.sendall(request_text)
                assert stream.readline() == b"HTTP/1.0 200 OK\r\n"
                head = b"".join(iter(stream.readline, b"\r\n"))
                assert b"multipart/x-mixed-replace;boundary=boundarydonotcross" in head
                assert stream.readline() == BOUNDARY
                eventually(lambda: camera.outputs, "the reader is no output")
                for number in range(3):
                    camera.write(picture(number * 100), strict=True)
                    assert stream.readline() == b"Content-Type: image/jpeg\r\n"
                    length = int(stream.readline().removeprefix(b"Content-Length: "))
                    assert stream.readline() == b"\r\n"
                    with Pictures.open(io.BytesIO(stream.read(length))) as shown:
                        assert shown.size == (64, 48)
                    assert stream.readline() == b"\r\n"
                    assert stream.readline() == BOUNDARY

    def test_reader_that_leaves(self, network: Network) -> None:
        """The output is removed when its reader disconnects, also if the port sends nothing."""
        with BufferedPort("/cam", Image.codec, network=network) as camera:
            with socket.create_connection((camera.contact.host, camera.contact.port), timeout=10) as peer:
                peer.sendall(b"GET /?action=stream HTTP/1.1\r\n\r\n")
                eventually(lambda: camera.outputs, "the reader is no output")
            eventually(lambda: not camera.outputs, "the output is still there")
            eventually(
                lambda: "rtf-input /cam" not in [one.name for one in threading.enumerate()], "its thread is still there"
            )


class TestForeignCameras:
    """Sources that are no ports."""

    @pytest.mark.parametrize(
        ("answer", "complaint"),
        [
            (b"HTTP/1.1 404 Not Found\r\n\r\n", "sends no pictures"),
            (b"nonsense\r\n\r\n", "sends no pictures"),
            (b"", "closed the connection"),
        ],
    )
    def test_refusal(self, network: Network, answer: bytes, complaint: str) -> None:
        """Connecting to a source that does not send images raises ConnectError."""
        with camera_that_sends(answer) as number, Port("/view", network=network) as viewer:
            with pytest.raises(ConnectError, match=complaint):
                viewer.add_output(Contact("/cam", "127.0.0.1", number, "mjpeg"))
            assert not viewer.inputs

    @pytest.mark.parametrize(
        ("part", "complaint"),
        [
            (b"Content-Type: image/jpeg\r\nContent-Length: 99999999999\r\n\r\n", "at most"),
            (b"Content-Type: image/jpeg\r\nContent-Length: -5\r\n\r\n", "at most"),
            (b"Content-Type: image/jpeg\r\n\r\n", "at most"),
            (b"Content-Type: text/html\r\nContent-Length: 4\r\n\r\nabcd", "not a JPEG"),
            (b"Content-Type: image/jpeg\r\nContent-Length: 4\r\n\r\nabcd", "not a JPEG"),
        ],
    )
    def test_nonsense(self, network: Network, said: list[str], part: bytes, complaint: str) -> None:
        """An invalid part ends the connection with a report, and its announced size is not allocated."""
        answer = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=x\r\n\r\n--x\r\n" + part
        with camera_that_sends(answer) as number, Port("/view", network=network) as viewer:
            viewer.add_output(Contact("/cam", "127.0.0.1", number, "mjpeg"))
            eventually(lambda: any(complaint in line for line in said), "nothing was reported")
            eventually(lambda: not viewer.inputs, "the input is still there")


def camera_that_sends(answer: bytes) -> AbstractContextManager[int]:
    """Listen, send ``answer`` to the first caller when it has asked, and close. Yields the port number."""
    from contextlib import contextmanager

    @contextmanager
    def serve() -> Iterator[int]:
        with socket.create_server(("127.0.0.1", 0)) as listening:

            def run() -> None:
                peer, _ = listening.accept()
                with peer:
                    peer.recv(1 << 12)
                    peer.sendall(answer)
                    peer.shutdown(socket.SHUT_WR)
                    peer.recv(1)

            thread = threading.Thread(target=run)
            thread.start()
            yield listening.getsockname()[1]
            thread.join(10)

    return serve()


class TestCodec:
    """The encoding of images as JPEG."""

    @settings(deadline=None, max_examples=20)
    @given(
        pixels=arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40), st.just(3))),
        envelope=st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=50),
    )
    def test_size_and_envelope_survive(self, pixels: np.ndarray, envelope: str) -> None:
        """Size and envelope of an image are the same after encoding and decoding."""
        back, text = decode_jpeg(encode_jpeg(Image(pixels), envelope))
        assert (back.width, back.height, text) == (pixels.shape[1], pixels.shape[0], envelope)

    @settings(deadline=None)
    @given(data=st.binary(max_size=200))
    def test_nonsense_is_a_protocol_error(self, data: bytes) -> None:
        """Bytes that are no JPEG raise ProtocolError."""
        with pytest.raises(ProtocolError):
            decode_jpeg(data)

    def test_too_many_pixels(self) -> None:
        """A JPEG that announces more than MAX_PIXELS is refused."""
        jpeg = io.BytesIO()
        Pictures.new("L", (9_000, 8_192)).save(jpeg, "JPEG")
        with pytest.raises(ProtocolError, match=str(MAX_PIXELS)):
            decode_jpeg(jpeg.getvalue())
