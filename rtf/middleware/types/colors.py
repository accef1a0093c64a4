"""Conversion between pixel formats: mono, rgb, bgr, rgba, bgra, hsv, with eight bits per channel.

As in YARP, grey is the mean of red, green and blue, and pixels without an alpha channel are opaque. YARP names hue,
saturation and value but does not compute them; here each ranges from 0 to 255, the hue once around the circle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import BottleTypeError

if TYPE_CHECKING:
    from typing import TypeAlias

    from numpy.typing import NDArray

    Pixels: TypeAlias = NDArray[np.uint8]

#: The position of red, green, blue and, if present, alpha.
_ORDER = {"rgb": (0, 1, 2), "bgr": (2, 1, 0), "rgba": (0, 1, 2, 3), "bgra": (2, 1, 0, 3)}
_CODES = (*_ORDER, "mono", "hsv")
_MOST = 255
_CIRCLE, _SEXTANTS = 256, 6


def convert(pixels: Pixels, source: str | int, target: str | int) -> Pixels:
    """Return the pixels in another format, in memory of their own. Raises BottleTypeError for unknown formats."""
    if source not in _CODES or target not in _CODES:
        raise BottleTypeError(
            f"pixels {source!r} cannot be converted to {target!r}; conversions exist between {', '.join(_CODES)}"
        )
    if target in _ORDER:
        return _colored(pixels, str(source), str(target))
    if target == "mono":
        return _grey(pixels, str(source))
    return _hsv(*_parts(pixels, str(source)))


def _parts(pixels: Pixels, source: str) -> tuple[Pixels, Pixels, Pixels]:
    """Return the red, green and blue channels."""
    if source == "mono":
        return pixels, pixels, pixels
    if source == "hsv":
        pixels, source = _rgb_of_hsv(pixels), "rgb"
    red, green, blue = (pixels[..., place] for place in _ORDER[source][:3])
    return red, green, blue


def _colored(pixels: Pixels, source: str, target: str) -> Pixels:
    order = _ORDER[target]
    made = np.empty((*pixels.shape[:2], len(order)), np.uint8)
    for place, part in zip(order, _parts(pixels, source), strict=False):
        made[..., place] = part
    if len(order) > 3:  # noqa: PLR2004 - red, green, blue and the opacity
        made[..., 3] = pixels[..., 3] if len(_ORDER.get(source, ())) == len(order) else _MOST
    return made


def _grey(pixels: Pixels, source: str) -> Pixels:
    if source == "mono":
        return pixels.copy()
    red, green, blue = _parts(pixels, source)
    total = red.astype(np.uint16)
    total += green
    total += blue
    total //= 3
    return total.astype(np.uint8)


def _hsv(red: Pixels, green: Pixels, blue: Pixels) -> Pixels:
    value = np.maximum(np.maximum(red, green), blue)
    span = (value - np.minimum(np.minimum(red, green), blue)).astype(np.int16)
    r, g, b = (part.astype(np.int16) for part in (red, green, blue))
    # The largest channel determines the third of the hue circle, the difference of the others the place in it.
    sextants = np.where(value == red, g - b, np.where(value == green, b - r + 2 * span, r - g + 4 * span))
    made = np.empty((*value.shape, 3), np.uint8)
    turned = sextants * (np.float32(_CIRCLE / _SEXTANTS) / np.maximum(span, 1).astype(np.float32))
    made[..., 0] = np.rint(turned).astype(np.int16) & (_CIRCLE - 1)
    made[..., 1] = np.rint(span * (np.float32(_MOST) / np.maximum(value, 1).astype(np.float32)))
    made[..., 2] = value
    return made


def _rgb_of_hsv(pixels: Pixels) -> Pixels:
    turns = pixels[..., 0] * np.float32(_SEXTANTS / _CIRCLE)
    value = pixels[..., 2].astype(np.float32)
    chroma = value * pixels[..., 1] / np.float32(_MOST)
    made = np.empty((*pixels.shape[:2], 3), np.uint8)
    for place, start in enumerate((5, 3, 1)):
        # Each channel is at its maximum for two sextants, zero for two, and rises and falls in between.
        way = turns + np.float32(start)
        way[way >= _SEXTANTS] -= _SEXTANTS
        made[..., place] = np.rint(value - chroma * np.clip(np.minimum(way, 4 - way), 0, 1))
    return made
