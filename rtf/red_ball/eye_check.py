"""What is wrong with eyes that see a ball which is moved: the wrong one is named."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.red_ball.stereo import locate

if TYPE_CHECKING:
    from rtf.red_ball.detection import SeenBall
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.kinematics import Pinhole

#: A picture of a ball that moved by centimetres moves by more than this (px).
_STILL = 1.0


class Look(NamedTuple):
    """What both eyes see of the ball at a moment."""

    left: SeenBall | None
    right: SeenBall | None


def frozen(before: Look, after: Look) -> list[str]:
    """Return the eyes, ``left`` or ``right``, whose picture did not change while the ball moved."""
    names = []
    for name, first, second in zip(Look._fields, before, after, strict=True):
        if first is None or second is None:
            continue
        if np.linalg.norm(first.pixel - second.pixel) < _STILL:
            names.append(name)
    return names


def swapped(look: Look, camera: Pinhole, across: FloatArray) -> bool:
    """Return whether each eye shows what the other one should. Both have to look beside the ball, else it is the same.

    ``across`` is the pose of the right camera in the frame of the left (4, 4).
    """
    if look.left is None or look.right is None:
        return False
    return bool(locate(look.left, look.right, camera, across).problem) and not (
        locate(look.right, look.left, camera, across).problem
    )
