"""The fingers, which the published description lacks: nine axes for each hand, one hinge each, nominal dynamics.

On the robot one motor bends several joints of a finger: a distal axis of 180 degrees bends two by 90, the little
fingers' axis of 270 degrees bends three, and the axis that spreads the fingers by 20 degrees has a range of 60. Here
each axis has one hinge, which turns by ``axis / ratio``; the gear of the actuator is the ratio, so that its length is
the angle of the axis and its force the torque at the axis.

Frame of the hand: the fingers point along x on the left and along -x on the right, the thumb's side is z, the back of
the hand y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rtf.simulator.axes import AXES, INDEX

_Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _Segment:
    """A rigid segment with its hinge, for the left hand, whose fingers point along x."""

    name: str  # of the axis, without the side
    parent: str  # likewise, or nothing for the palm
    position: _Vector  # of the hinge in the parent (m)
    axis: _Vector
    tip: _Vector  # the far end from the hinge
    radius: float
    mass: float  # kg


#: Bending goes from x, along the finger, to -y, the palm.
_BEND = (0.0, 0.0, -1.0)

_SEGMENTS = (
    _Segment("hand_finger", "", (0.070, 0.004, 0.010), (0.0, -1.0, 0.0), (0.010, 0.0, -0.004), 0.007, 0.008),
    _Segment("thumb_oppose", "", (0.045, -0.004, 0.055), (1.0, 0.0, 0.0), (0.004, 0.0, 0.010), 0.008, 0.010),
    _Segment("thumb_proximal", "thumb_oppose", (0.004, 0.0, 0.010), (0.0, 1.0, 0.0), (0.0, 0.0, 0.022), 0.008, 0.012),
    _Segment("thumb_distal", "thumb_proximal", (0.0, 0.0, 0.022), (0.0, 1.0, 0.0), (0.0, 0.0, 0.022), 0.007, 0.010),
    _Segment("index_proximal", "", (0.080, 0.004, 0.050), _BEND, (0.028, 0.0, 0.0), 0.007, 0.012),
    _Segment("index_distal", "index_proximal", (0.028, 0.0, 0.0), _BEND, (0.030, 0.0, 0.0), 0.006, 0.010),
    _Segment("middle_proximal", "", (0.082, 0.004, 0.030), _BEND, (0.030, 0.0, 0.0), 0.007, 0.012),
    _Segment("middle_distal", "middle_proximal", (0.030, 0.0, 0.0), _BEND, (0.030, 0.0, 0.0), 0.006, 0.010),
    _Segment("pinky", "hand_finger", (0.012, 0.0, -0.004), _BEND, (0.050, 0.0, -0.008), 0.008, 0.020),
)

#: Ratios of axis to hinge; 1 for all others.
_RATIOS = {"hand_finger": 3.0, "thumb_distal": 2.0, "index_distal": 2.0, "middle_distal": 2.0, "pinky": 3.0}


def ratio(axis: str) -> float:
    """Return the ratio of an axis to its hinge: 1 for all axes but some of the hands."""
    return _RATIOS.get(axis[2:], 1.0)


def add_fingers(hand: Any, side: str, geom_type: Any) -> list[Any]:
    """Add the fingers to the body of a hand, side ``l`` or ``r``; return the new geoms, one for each segment."""
    mirror = 1.0 if side == "l" else -1.0
    bodies = {"": hand}
    geoms = []
    for segment in _SEGMENTS:
        axis = AXES[INDEX[f"{side}_{segment.name}"]]
        body = bodies[segment.parent].add_body(name=f"{axis.name}_link", pos=_place(segment.position, mirror))
        bodies[segment.name] = body
        limits = [math.radians(limit) / ratio(axis.name) for limit in (axis.minimum, axis.maximum)]
        body.add_joint(name=axis.name, axis=_turn(segment.axis, mirror), range=limits, limited=True)
        ends = [0.0, 0.0, 0.0, *_place(segment.tip, mirror)]
        geoms.append(
            body.add_geom(
                type=geom_type, fromto=ends, size=[segment.radius, 0, 0], mass=segment.mass, name=f"{axis.name}_c"
            )
        )
    return geoms


def _place(vector: _Vector, mirror: float) -> list[float]:
    return [mirror * vector[0], vector[1], vector[2]]


def _turn(axis: _Vector, mirror: float) -> list[float]:
    """Mirror an axis of rotation at the plane normal to x: a rotation about x keeps its sense."""
    return [axis[0], mirror * axis[1], mirror * axis[2]]
