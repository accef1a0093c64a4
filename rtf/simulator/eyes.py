"""The eyes, which the robot's published description lacks: a common tilt, and a pan for each eye.

The axes of the robot are version and vergence: ``left = version + vergence / 2``, ``right = version - vergence / 2``.
Each axis is a fixed tendon over the two pan hinges: its length is the angle of the axis, its force the torque:
version ``(left + right) / 2``, vergence ``left - right``. Axes in the head's frame (x to the robot's left, y up,
z forward): tilt about -x, so that a positive angle looks up; pan about -y, so that a positive one looks to the right.
"""

from __future__ import annotations

import math
from typing import Any

from rtf.simulator.axes import AXES, INDEX

#: Between the eyes on the tilt axis, and from there to each eye's centre, in the head's frame (m).
_TILT_POSITION = (0.0, 0.1049, 0.0456)
_HALF_BASELINE = 0.034
_BALL_RADIUS = 0.02
_BALL_MASS = 0.03
_FRAME_MASS = 0.05
_FRAME_INERTIA = 5e-5
#: A camera looks along its -z with x to the right: half a turn about the head's y.
_FORWARD = (0.0, 0.0, 1.0, 0.0)
#: From the eye's centre to the lens, so that the inside of the eye is not in the picture.
_LENS = 0.022
_FIELD_OF_VIEW = 42.0  # deg, vertical
#: Share of each pan hinge in the axes, left and right.
TENDONS = {"eyes_version": (0.5, 0.5), "eyes_vergence": (1.0, -1.0)}
PAN_JOINTS = ("l_eye_pan_joint", "r_eye_pan_joint")


def add_eyes(head: Any) -> None:
    """Add both eyes with their cameras to the body of the head."""
    tilt = AXES[INDEX["eyes_tilt"]]
    frame = head.add_body(name="eyes_tilt_frame", pos=_TILT_POSITION)
    _inertial(frame, _FRAME_MASS, _FRAME_INERTIA)
    frame.add_joint(
        name=tilt.name, axis=[-1, 0, 0], range=[math.radians(tilt.minimum), math.radians(tilt.maximum)], limited=True
    )
    for side, place in (("l", _HALF_BASELINE), ("r", -_HALF_BASELINE)):
        eye = frame.add_body(name=f"{side}_eye", pos=[place, 0, 0])
        _inertial(eye, _BALL_MASS, 0.4 * _BALL_MASS * _BALL_RADIUS**2)
        eye.add_joint(name=f"{side}_eye_pan_joint", axis=[0, -1, 0])
        eye.add_camera(
            name="left_eye" if side == "l" else "right_eye", pos=[0, 0, _LENS], quat=_FORWARD, fovy=_FIELD_OF_VIEW
        )


def add_tendons(spec: Any) -> None:
    """Add the tendons of version and vergence over the two pans."""
    for name, shares in TENDONS.items():
        axis = AXES[INDEX[name]]
        limits = [math.radians(axis.minimum), math.radians(axis.maximum)]
        tendon = spec.add_tendon(name=name, range=limits, limited=True)
        for joint, share in zip(PAN_JOINTS, shares, strict=True):
            tendon.wrap_joint(joint, share)


def pan_angles(version: float, vergence: float) -> tuple[float, float]:
    """Return the angles of the left and the right eye, in the unit of the arguments."""
    return version + vergence / 2, version - vergence / 2


def _inertial(body: Any, mass: float, inertia: float) -> None:
    body.mass = mass
    body.inertia = [inertia] * 3
    body.ipos = [0, 0, 0]
    body.explicitinertial = True
