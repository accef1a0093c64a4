"""The picture of what both arms reach, in the documentation: ``python tools/reach_picture.py FILE [CELLS]``.

Seen from above, in a plane at the height of the belly, palms inwards with the fingers forwards: green where the pose is
met, else the colour of how far the nearest position is.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from rtf.robot.kinematics import InverseKinematics, robot_chains
from rtf.robot.model import load_robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.kinematics import Chain
    from rtf.robot.model import RobotModel

#: The plane (m): its height, and the ranges of x, which points backwards, and of y, to the right.
HEIGHT, FRONT, SIDES = 0.1, (-0.65, 0.05), (-0.55, 0.55)
ORIENTATION = (0.0, 0.70711, -0.70711, np.pi)
REACHED, PAPER, INK = (47, 133, 90), (255, 255, 255), (31, 41, 51)
#: Colours of distances (m): the first that is not exceeded.
DISTANCES = ((0.01, (255, 224, 130)), (0.03, (255, 183, 77)), (0.1, (239, 108, 80)), (np.inf, (150, 60, 90)))
WIDTH, MARGIN, LINE = 460, 30, 22
CELLS = 33


def errors(robot: RobotModel, chain: Chain, cells: int) -> NDArray[np.float64]:
    """Return how far the nearest positions are from the places of a grid (m), 0 where the pose is met."""
    inverse, home = InverseKinematics(chain), [robot.axis(joint).home for joint in chain.joints]
    found = np.empty((cells * 7 // 11, cells))
    for row, x in enumerate(np.linspace(*FRONT, found.shape[0])):
        for column, y in enumerate(np.linspace(*SIDES, found.shape[1])):
            solution = inverse.solve([x, y, HEIGHT, *ORIENTATION], home, priority="orientation")
            found[row, column] = 0.0 if solution.reached else max(solution.position_error, 1e-9)
    return found


def coloured(found: NDArray[np.float64]) -> Image.Image:
    """Return the grid as a picture, forwards upwards, the robot's left on the left."""
    colours = [
        [REACHED if not one else next(colour for limit, colour in DISTANCES if one <= limit) for one in row]
        for row in found
    ]
    height = WIDTH * found.shape[0] // found.shape[1]
    return Image.fromarray(np.array(colours, dtype=np.uint8)).resize((WIDTH, height), Image.Resampling.NEAREST)


def draw(cells: int = CELLS) -> Image.Image:
    """Return the whole picture."""
    robot = load_robot("icub")
    chains = [robot_chains(robot).chain(name, "2.5").limited_by(robot.axes) for name in ("left_arm", "right_arm")]
    maps = [coloured(errors(robot, chain, cells)) for chain in chains]
    size = (2 * WIDTH + 3 * MARGIN, maps[0].height + 2 * MARGIN + 3 * LINE)
    picture = Image.new("RGB", size, PAPER)
    pen = ImageDraw.Draw(picture)
    for place, (title, one) in enumerate(zip(("left arm and torso", "right arm and torso"), maps, strict=True)):
        left = MARGIN + place * (WIDTH + MARGIN)
        pen.text((left, MARGIN - 4), title, INK, font_size=16)
        picture.paste(one, (left, MARGIN + LINE))
        x, y = left + WIDTH / 2, MARGIN + LINE + one.height * FRONT[0] / (FRONT[0] - FRONT[1])
        pen.ellipse((x - 5, y - 5, x + 5, y + 5), INK)  # the waist
    legend = [("met", REACHED), *((_below(limit), colour) for limit, colour in DISTANCES)]
    left, top = MARGIN, size[1] - MARGIN
    for text, colour in legend:
        pen.rectangle((left, top, left + 14, top + 14), colour)
        pen.text((left + 20, top - 2), text, INK, font_size=14)
        left += 150
    return picture


def _below(limit: float) -> str:
    return f"up to {limit * 1e3:.0f} mm off" if limit < np.inf else "further"


if __name__ == "__main__":
    draw(int(sys.argv[2]) if len(sys.argv) > 2 else CELLS).save(Path(sys.argv[1]), optimize=True)  # noqa: PLR2004
