"""A ball in the pictures of two eyes: where it is, and whether they agree.

The rays of both eyes meet at the ball, and its size says how far away it is. Where these disagree something is wrong
with an eye: it shows an old picture, or that of the other one, or its joint is not where its encoder says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import triangulated

if TYPE_CHECKING:
    from rtf.red_ball.detection import SeenBall
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.kinematics import Pinhole

#: The largest distance (px) of the picture of the ball from where the rays meet, and how much its distance by its size
#: may differ from that by both eyes. A healthy eye has a tenth of both, see docs/red-ball.md.
MOST_APART, MOST_DIFFERENCE = 4.0, 0.2


class Located(NamedTuple):
    """A ball in the frame of the left camera (m), None if no eye sees it; or why it cannot be said where it is."""

    place: FloatArray | None
    problem: str = ""


def locate(left: SeenBall, right: SeenBall, camera: Pinhole, across: FloatArray) -> Located:
    """Return where a ball is that both eyes see; ``across`` is the pose of the right one in the frame of the left."""
    poses = (np.eye(4), across)
    try:
        place = triangulated([left.pixel, right.pixel], [camera, camera], poses)
        apart = [
            float(np.linalg.norm(camera.pixel_of(place, pose) - seen.pixel))
            for seen, pose in zip((left, right), poses, strict=True)
        ]
    except RefusedError as error:
        return Located(None, f"the eyes do not agree: {error}")
    if max(apart) > MOST_APART:
        return Located(None, f"the eyes do not agree: their rays pass {max(apart):.1f} px from each other")
    by_both, by_size = float(np.linalg.norm(place)), float(np.linalg.norm(left.place))
    if abs(by_size / by_both - 1.0) > MOST_DIFFERENCE:
        return Located(
            None, f"the eyes do not agree: by both the ball is {by_both:.2f} m away, by its size {by_size:.2f} m"
        )
    return Located(place)
