"""A picture of a path in space: its projections onto three planes, with its target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing.judging.png import png

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.interfaces import FloatArray

#: The planes by the numbers of their axes, across and up, with their names.
_PLANES = ((1, 0, "from above"), (1, 2, "from behind"), (0, 2, "from the side"))
_NAMES = "xyz"
_SIZE, _MARGIN, _MARK = 300, 45, 4  # px
_LEAST = 0.02  # m, side of a panel
_COLOURS = ((31, 119, 180), (255, 127, 14), (44, 160, 44))
_INK, _TARGET = (60, 60, 60), (214, 39, 40)


def path_picture(paths: Mapping[str, FloatArray], target: FloatArray) -> bytes:
    """Return a PNG file of paths (samples, 3) in m, each in a colour of its own; the target is a cross.

    All three planes have one scale, whose side is written below.
    """
    from PIL import Image, ImageDraw

    points = np.vstack([*paths.values(), target])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    side = max(_LEAST, float(np.ptp(points, axis=0).max()))
    scale = (_SIZE - 2 * _MARGIN) / side
    picture = Image.new("RGB", (_SIZE * len(_PLANES), _SIZE), "white")
    draw = ImageDraw.Draw(picture)
    for number, (across, up, view) in enumerate(_PLANES):
        centre = np.array([_SIZE * (number + 0.5), _SIZE / 2])

        def places(values: FloatArray, across: int = across, up: int = up, centre: FloatArray = centre) -> FloatArray:
            plane = (np.atleast_2d(values) - middle)[:, [across, up]] * scale
            shown: FloatArray = centre + plane * (1.0, -1.0)
            return shown

        left = _SIZE * number
        draw.rectangle((left + 4, 4, left + _SIZE - 5, _SIZE - 5), outline=_INK)
        draw.text((left + 12, 10), f"{view}: {_NAMES[across]} to the right, {_NAMES[up]} up", fill=_INK)
        for colour, path in zip(_COLOURS, paths.values(), strict=False):
            draw.line([tuple(place) for place in places(path).tolist()], fill=colour, width=2)
        [(x, y)] = places(target)
        draw.line((x - _MARK, y - _MARK, x + _MARK, y + _MARK), fill=_TARGET, width=2)
        draw.line((x - _MARK, y + _MARK, x + _MARK, y - _MARK), fill=_TARGET, width=2)
    for number, (colour, name) in enumerate(zip(_COLOURS, paths, strict=False)):
        draw.text((12 + 150 * number, _SIZE - 22), name, fill=colour)
    draw.text((2 * _SIZE + 12, _SIZE - 22), f"inner side {1e3 * side:.0f} mm", fill=_INK)
    return png(np.asarray(picture))
