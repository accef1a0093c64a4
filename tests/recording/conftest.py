"""A network of this process, samples, and stores of both formats."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import strategies as st

from rtf.bottle import Bottle, Float32, Int64, Vocab
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.types import Image, Stamp
from rtf.recording import Sample, open_recording

if TYPE_CHECKING:
    from pathlib import Path

PLACES = {"dumper": "run", "mcap": "run.mcap"}


@pytest.fixture
def network() -> Network:
    """A network of this process alone."""
    return Network(LocalNames())


@pytest.fixture(params=PLACES)
def place(request, tmp_path: Path) -> Path:
    """Where a recording of each format is written."""
    return tmp_path / PLACES[request.param]


def read_all(path: Path) -> list[Sample]:
    """All messages of a recording, in the order of their times."""
    recording = open_recording(path)
    return [*recording.samples([stream.source for stream in recording.streams])]


finite = st.floats(allow_nan=False, allow_infinity=False)
#: Strings without the words that YARP's text form reads as something else, and what UTF-8 has no bytes for.
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=8).filter(
    lambda text: text not in ("null", "nan", "inf", "true", "false")
)
words = st.sampled_from(["set", "pos", "a1", "many"]).map(Vocab)
integers = st.integers(-(1 << 31), (1 << 31) - 1)
#: What the text form keeps.
textual = st.recursive(
    integers | finite | texts | words | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4).map(Bottle),
    max_leaves=12,
)
bottles = st.lists(textual, max_size=6).map(Bottle)
#: What only binary forms keep, too.
exact_bottles = st.lists(
    textual | st.integers(-(1 << 63), (1 << 63) - 1).map(Int64) | st.floats(width=32, allow_nan=False).map(Float32),
    max_size=6,
).map(Bottle)
stamps = st.builds(Stamp, st.integers(0, (1 << 31) - 1), st.floats(0, 1e10)) | st.just(Stamp())
times = st.floats(0, 4e9)
_FORMATS = {"mono": (np.uint8, 0), "rgb": (np.uint8, 3), "bgr": (np.uint8, 3), "dec": (np.float32, 0)}
_MORE = {"rgba": (np.uint8, 4), "mo16": (np.uint16, 0), "grbg": (np.uint8, 0), "hsv": (np.uint8, 3)}


def _images(formats: dict[str, tuple[type, int]]) -> st.SearchStrategy[Image]:
    def made(code: str, height: int, width: int, seed: int) -> Image:
        dtype, channels = formats[code]
        shape = (height, width, channels) if channels else (height, width)
        return Image(np.random.default_rng(seed).integers(0, 255, shape).astype(dtype), code)

    return st.builds(made, st.sampled_from([*formats]), st.integers(1, 9), st.integers(1, 9), st.integers(0, 9))


images = _images(_FORMATS)
more_images = _images(_FORMATS | _MORE)
