"""The picture of what both arms reach."""

from __future__ import annotations

import reach_picture as picture


def test_what_is_reached_is_green():
    """Both arms reach something in front of the robot, and nothing far away."""
    drawn = picture.draw(5)
    colours = {colour for _, colour in drawn.getcolors(1 << 20) or []}
    assert {picture.REACHED, picture.DISTANCES[-1][1], picture.INK} <= colours
