"""The iCub's model, and its axes and parts by name, for tests."""

from pathlib import Path

from rtf.robot.model import load_robot
from rtf.simulator.plant import Options, Plant, build

ICUB = load_robot("icub")
AXES, INDEX = ICUB.axes, ICUB.index
#: The axes of each part with physics.
PARTS = {name: part.axes for name, part in ICUB.parts.items()}
COUPLINGS = {name: part.couplings for name, part in ICUB.parts.items()}
part_slice = ICUB.part_slice


def joint_to_motor(part: str):
    """Return the couplings of a part."""
    return ICUB.parts[part].joint_to_motor


def build_icub(options: Options | None = None) -> Plant:
    """Build a new model of it."""
    return build(ICUB, options)


def robot_description() -> Path:
    """Return the path of its published description."""
    return ICUB.description
