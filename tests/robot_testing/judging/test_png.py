"""PNG files of pictures."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from rtf.robot_testing.judging.png import png


@pytest.mark.parametrize(("channels", "mode"), [((), "L"), ((3,), "RGB")])
def test_every_pixel_is_in_the_file(channels: tuple[int, ...], mode: str):
    """Grey pictures stay grey, and colours keep their order."""
    pixels = np.random.default_rng(1).integers(0, 256, (3, 5, *channels), dtype=np.uint8)
    with Image.open(BytesIO(png(pixels))) as picture:
        assert (picture.format, picture.mode) == ("PNG", mode)
        assert np.array_equal(np.asarray(picture), pixels)
