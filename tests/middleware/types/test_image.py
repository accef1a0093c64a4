"""Images: the bytes of the header, padding, pixel formats, conversions, and copies."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, BottleError, BottleTypeError, Dialect, Vocab
from rtf.bottle.binary import decode
from rtf.middleware.types import IMAGE, Image, ImageCodec
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.types.pixels import pixel_format

THREE, FOUR = Dialect.YARP3, Dialect.YARP4
#: The headers that cameras of YARP 3.12 and 4.0 sent before 320 x 240 pixels.
CAMERA = {
    THREE: "000100000400000009000000 6d617400 09000000 72676200 0101000005000000"
    "03000000 00840300 08000100 40010000 f0000000 0c000000 00840300",
    FOUR: "000100000400000009000000 6d617400 09000000 72676200 0101000005000000"
    "03000000 00840300 08000000 40010000 f0000000 0c000000 00840300",
}
CODES = {
    "mono": 1, "mo16": 2, "rgb": 3, "rgba": 4, "bgra": 4, "bgr": 3, "int": 4, "hsv": 3, "sign": 1, "rgb-": 3,
    "rgbi": 12, "dec": 4, "rgb.": 12, "hsv.": 12, "grbg": 1, "bggr": 1, "gbrg": 1, "rggb": 1, "gr16": 2,
    "bg16": 2, "gb16": 2, "rg16": 2, "yuva": 1, "yuvb": 1, "yuvc": 1, "yuvd": 1,
}  # fmt: skip


def bytes_of(image: Image, dialect: Dialect = THREE) -> bytes:
    """Return the encoded image."""
    return b"".join(IMAGE.encode(image, dialect))


def header(**changes: int) -> bytes:
    """Return a 16 x 4 rgb image as bytes, with these fields of its header changed."""
    fields = [256, 4, 9, Vocab("mat").value, 9, Vocab("rgb").value, 257, 5, 3, 192, 65544, 16, 4, 12, 192]
    names = ["list", "parts", "word", "mat", "word2", "code", "numbers", "five"]
    names += ["depth", "size", "quantum", "width", "height", "blob", "blob_size"]
    for name, value in changes.items():
        fields[names.index(name)] = value
    return struct.pack("<15i", *fields) + bytes(192)


@pytest.mark.parametrize("dialect", Dialect)
def test_the_header_of_real_cameras(dialect: Dialect):
    """The sixty bytes of the header are those of a real camera, in both dialects."""
    image = Image(np.zeros((240, 320, 3), np.uint8))
    head, pixels = IMAGE.encode(image, dialect)
    assert head.hex() == CAMERA[dialect].replace(" ", "")
    assert len(head) == 60
    assert len(pixels) == 230400
    assert IMAGE.decode(bytes.fromhex(CAMERA[dialect]) + bytes(pixels), dialect) == image


def test_pixels_are_not_copied():
    """Pixels are encoded and adopted without a copy; ``decode`` copies them."""
    pixels = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
    head, body = IMAGE.encode(Image(pixels), THREE)
    assert np.shares_memory(np.frombuffer(body, np.uint8), pixels)
    data = bytearray(bytes(head) + bytes(body))
    adopted, copied = IMAGE.adopt(data, THREE), IMAGE.decode(data, THREE)
    assert adopted == copied == Image(pixels)
    assert np.shares_memory(adopted.pixels, np.frombuffer(data, np.uint8))
    assert not np.shares_memory(copied.pixels, np.frombuffer(data, np.uint8))
    assert copied.pixels.flags.writeable
    assert not IMAGE.adopt(bytes(data), THREE).pixels.flags.writeable


def test_rows_are_filled_up_to_the_quantum():
    """Rows are padded to the quantum, and the decoded pixels have no padding."""
    pixels = np.arange(1, 31, dtype=np.uint8).reshape(2, 5, 3)
    data = bytes_of(Image(pixels))
    assert struct.unpack_from("<i", data, 36) == (32,)
    assert data[60:] == bytes(range(1, 16)) + b"\0" + bytes(range(16, 31)) + b"\0"
    read = IMAGE.adopt(bytearray(data), THREE)
    assert read.pixels.shape == (2, 5, 3)
    assert read.pixels.strides == (16, 3, 1)
    np.testing.assert_array_equal(read.pixels, pixels)
    assert bytes_of(read) == data


@settings(deadline=None)
@given(
    st.integers(1, 9), st.integers(1, 9), st.sampled_from(sorted(CODES)), st.integers(1, 33), st.sampled_from(Dialect)
)
def test_every_format_survives(height: int, width: int, code: str, quantum: int, dialect: Dialect):
    """An image of any size, format and padding is the same after encoding and decoding."""
    kind = pixel_format(code)
    shape = kind.shape(height, width)
    raw = np.random.default_rng(1).integers(0, 100, shape)
    image = Image(raw.astype(kind.dtype), code, quantum)
    data = bytes_of(image, dialect)
    read = IMAGE.decode(data, dialect)
    assert read == image
    assert (read.code, read.quantum, read.width, read.height) == (code, quantum, width, height)
    assert bytes_of(read, dialect) == data


@pytest.mark.parametrize(("code", "depth"), CODES.items())
def test_pixels_have_their_size(code: str, depth: int):
    """Each pixel code has its number of bytes."""
    assert pixel_format(code).depth == depth
    assert pixel_format(Vocab(code).value) is pixel_format(code)


def test_formats_that_are_not_known_are_bytes():
    """Unknown pixel codes decode to bytes; a negative code is the number of bytes of a pixel."""
    image = Image(np.zeros((2, 2, 5), np.uint8), -5)
    assert struct.unpack_from("<i", bytes_of(image), 20) == (-5,)
    assert IMAGE.decode(bytes_of(image), THREE) == image
    new = IMAGE.decode(header(code=Vocab("new").value), THREE)
    assert (new.code, new.pixels.shape, new.pixels.dtype) == ("new", (4, 16, 3), np.uint8)
    with pytest.raises(BottleError, match="known codes: mono"):
        Image(np.zeros((2, 2), np.uint8), "new")


@pytest.mark.parametrize(
    ("dtype", "channels", "code"),
    [("u1", 1, "mono"), ("u2", 1, "mo16"), ("u1", 3, "rgb"), ("u1", 4, "rgba"), ("f4", 1, "dec"), ("i4", 1, "int")],
)
def test_an_array_is_the_usual_image(dtype: str, channels: int, code: str):
    """The default pixel code of an array follows from its type and channels."""
    shape = (2, 3) if channels == 1 else (2, 3, channels)
    image = Image(np.zeros(shape, dtype))
    assert image.code == code
    assert codec_of(image) is IMAGE
    assert IMAGE.decode(b"".join(IMAGE.encode(image.pixels, THREE)), THREE) == image


@pytest.mark.parametrize(
    ("pixels", "code", "message"),
    [
        (np.zeros((2, 3)), None, "needs a pixel code"),
        (np.zeros(3, np.uint8), None, "needs a pixel code"),
        (np.zeros((2, 3), np.uint8), "rgb", r"640 x 480 pixels 'rgb' are an array of uint8 of shape \(480, 640, 3\)"),
        (np.zeros(3, np.uint8), "mono", "of shape"),
        (np.zeros((2, 3), np.int8), "mono", "one of int8"),
    ],
)
def test_pixels_must_be_those_of_the_format(pixels: np.ndarray, code: str | None, message: str):
    """The error about pixels that do not fit the code says what it needs."""
    with pytest.raises(BottleTypeError, match=message):
        Image(pixels, code)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"list": 257}, "not an image"),
        ({"mat": 1}, "not an image"),
        ({"blob": 4}, "not an image"),
        ({"depth": 4}, "have 3 bytes, not 4"),
        ({"width": -16, "height": -4}, "-16 x -4"),
        ({"size": -1, "blob_size": -1}, "-1 bytes"),
        ({"size": 191}, "191 bytes, of which 192"),
        ({"width": 17}, "17 x 4 pixels 'rgb'"),
        ({"height": 2**31 - 1}, "do not make"),
        ({"width": 2**31 - 1, "height": 2**31 - 1}, "do not make"),
        ({"code": Vocab("new").value, "depth": 0}, "is not a pixel size"),
        ({"code": Vocab("new").value, "depth": 2**31 - 1}, "is not a pixel size"),
        ({"code": -(2**31)}, "is not a pixel size"),
        ({"code": -4}, "have 4 bytes, not 3"),
    ],
)
def test_broken_headers_are_refused(changes: dict[str, int], message: str):
    """A header with contradicting sizes is refused with the reason."""
    with pytest.raises(BottleError, match=message):
        IMAGE.decode(header(**changes), THREE)


@pytest.mark.parametrize("quantum", [8, 0x10008, 0, 1, 0x20010, 0x10000])
def test_the_quantum_is_read_in_both_forms(quantum: int):
    """The quantum is one number or two, and is ignored if the rows fit without padding."""
    assert IMAGE.decode(header(quantum=quantum), THREE).pixels.shape == (4, 16, 3)


def test_an_image_without_pixels():
    """An image without pixels is valid, with any width or height."""
    empty = Image(np.zeros((0, 0, 3), np.uint8))
    assert bytes_of(empty) == header(width=0, height=0, size=0, blob_size=0)[:60]
    for width, height in [(0, 0), (0, 2**31 - 1), (2**31 - 1, 0)]:
        read = IMAGE.decode(header(width=width, height=height, size=0, blob_size=0)[:60], THREE)
        assert read.pixels.shape == (height, width, 3)
        assert IMAGE.adopt(header(width=width, height=height, size=0, blob_size=0)[:60], THREE).pixels.size == 0


def test_the_text_of_an_image():
    """As text an image has its codes, numbers and bytes, and can be read again."""
    image = Image(np.arange(6, dtype=np.uint8).reshape(1, 2, 3))
    assert IMAGE.to_text(image) == "[mat] [rgb] (3 8 8 2 1) {0 1 2 3 4 5 0 0}"
    assert IMAGE.from_text("[mat] [rgb] (3 8 8 2 1) {0 1 2 3 4 5 0 0}") == image
    assert decode(bytes_of(image)) == Bottle.parse("[mat] [rgb] (3 8 65544 2 1) {0 1 2 3 4 5 0 0}")


# Other pixels -------------------------------------------------------------------------------------------------------

COLORS = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 33], [7, 7, 7]]], np.uint8)


def test_parts_change_places():
    """Conversions swap red and blue, and keep the opacity or set it to full."""
    rgb = Image(COLORS)
    np.testing.assert_array_equal(rgb.to("bgr").pixels, COLORS[..., ::-1])
    rgba = rgb.to("rgba")
    assert (rgba.pixels[..., 3] == 255).all()
    rgba.pixels[..., 3] = 9
    bgra = rgba.to("bgra")
    np.testing.assert_array_equal(bgra.pixels[..., :3], COLORS[..., ::-1])
    assert (bgra.pixels[..., 3] == 9).all()
    assert bgra.to("rgb") == rgb
    assert rgb.to("rgb") is rgb


def test_grey_is_the_mean():
    """Grey is the mean of the channels, rounded down; a colour from grey has equal channels."""
    grey = Image(COLORS).to("mono")
    np.testing.assert_array_equal(grey.pixels, [[85, 85, 85, 21, 7]])
    assert Image(COLORS).to("bgra").to("mono") == grey
    np.testing.assert_array_equal(grey.to("rgb").pixels, np.repeat(grey.pixels[..., None], 3, axis=2))


def test_hue_saturation_and_value():
    """Pure colours have hues a third of the circle apart and full saturation; grey has neither."""
    hsv = Image(COLORS).to("hsv").pixels[0]
    np.testing.assert_array_equal(hsv[:3], [[0, 255, 255], [85, 255, 255], [171, 255, 255]])
    np.testing.assert_array_equal(hsv[4], [0, 0, 7])
    np.testing.assert_array_equal(Image(COLORS).to("mono").to("hsv").pixels[0, 0], [0, 0, 85])


def test_colours_come_back_from_hue():
    """Converting to hsv and back changes a channel by at most 3."""
    pixels = np.random.default_rng(3).integers(0, 256, (100, 100, 3)).astype(np.uint8)
    back = Image(pixels).to("hsv").to("rgb").pixels
    assert np.abs(back.astype(int) - pixels).max() <= 3
    assert Image(pixels).to("hsv").to("mono").pixels.shape == (100, 100)


def test_a_receiver_gets_the_pixels_it_asked_for():
    """A codec with a pixel code converts every image to it, or names the known conversions."""
    data = bytes_of(Image(COLORS))
    assert ImageCodec("mono").decode(data, THREE) == Image(COLORS).to("mono")
    assert ImageCodec("bgr").adopt(data, THREE).code == "bgr"
    assert ImageCodec("rgb").decode_from(data, THREE) == (Image(COLORS), len(data))
    with pytest.raises(BottleTypeError, match="'rgb' cannot be converted to 'dec'; conversions exist between rgb, bgr"):
        ImageCodec("dec").decode(data, THREE)
