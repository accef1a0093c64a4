"""What two eyes see: points, pixels and targets, with the cameras of the eyes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, as_string
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import FixationPoint, GazeAngles, MonoPixel, MonoPixelWithVergence
from rtf.robot.kinematics import Eyes, Pinhole, triangulated
from rtf.robot.network.elements import inner, number, shown
from rtf.robot.network.request_table import array, floats, vector

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.interfaces import Eye, FloatArray, GazeTarget, Values

SIDES: tuple[Eye, Eye] = ("left", "right")
_PROJECTION = 12  # numbers of a matrix (3, 4)


@dataclass(slots=True)
class EyeViews:
    """The cameras of two eyes; ``cameras`` may lack some, whose pixels are then refused.

    ``extrinsics`` are the poses of the cameras in the frames of the eyes (4, 4), which ``eyes`` has in its chains.
    """

    eyes: Eyes
    cameras: Mapping[Eye, Pinhole]
    extrinsics: Mapping[Eye, FloatArray] = field(default_factory=dict)

    def camera(self, eye: Eye) -> Pinhole:
        """Return the camera of an eye. Raises RefusedError if it is not known."""
        if eye not in self.cameras:
            raise RefusedError(f"the camera of the {eye} eye is not configured: CAMERA_CALIBRATION_{eye.upper()}")
        return self.cameras[eye]

    def pose(self, eye: Eye, positions: FloatArray) -> FloatArray:
        """Return the pose of an eye's camera (4, 4), with the positions of all joints (deg)."""
        return self.eyes.poses(positions)[SIDES.index(eye)]

    def pixel_of(self, eye: Eye, point: Values, positions: FloatArray) -> FloatArray:
        """Return where an eye sees a point. Raises RefusedError for one behind it."""
        return self.camera(eye).pixel_of(vector(point, 3), self.pose(eye, positions))

    def point_on_plane(self, eye: Eye, pixel: Values, plane: Values, positions: FloatArray) -> FloatArray:
        """Return where what an eye sees at a pixel meets a plane. Raises RefusedError if it does not."""
        return self.camera(eye).point_on(vector(pixel, 2), vector(plane, 4), self.pose(eye, positions))

    def point_of(self, target: GazeTarget, positions: FloatArray) -> FloatArray:
        """Return the point of a target (m). Raises RefusedError for what is none."""
        if isinstance(target, FixationPoint):
            return vector(target.point, 3)
        if isinstance(target, GazeAngles):
            return self.eyes.point_of(vector(target[:3], 3), positions if target.relative else None)
        if isinstance(target, MonoPixel | MonoPixelWithVergence):
            vector(target[1:], 3)
            depth = target.depth if isinstance(target, MonoPixel) else self.eyes.distance(target.vergence)
            if depth <= 0.0:
                raise RefusedError(f"a depth of {depth:g} m is not in front of the eye")
            pixel, pose = (target.u, target.v), self.pose(target.eye, positions)
            return self.camera(target.eye).point_at(pixel, depth, pose)
        cameras = [self.camera(eye) for eye in SIDES]
        pixels = [vector(pixel, 2) for pixel in target]
        return triangulated(pixels, cameras, self.eyes.poses(positions))

    # Tweaks ----------------------------------------------------------------------------------------------------------

    def tweaks(self) -> Bottle:
        """Return intrinsics, sizes and extrinsics; empty lists for cameras that are not known."""
        pairs = []
        for eye in SIDES:
            camera = self.cameras.get(eye)
            pairs.append(Bottle([f"camera_intrinsics_{eye}", floats(camera.matrix.ravel()) if camera else Bottle()]))
            if camera is not None:
                pairs += [Bottle([f"camera_{what}_{eye}", getattr(camera, what)]) for what in ("width", "height")]
            pose = self.extrinsics.get(eye, np.eye(4))
            pairs.append(Bottle([f"camera_extrinsics_{eye}", floats(pose.ravel()) if camera else Bottle()]))
        return Bottle(pairs)

    def set_tweaks(self, tweaks: Bottle) -> None:
        """Set intrinsics of cameras. Raises RefusedError for other tweaks; all of them are checked first."""
        cameras = dict(self.cameras)
        for one in tweaks:
            key, value = inner(one, 2)
            eye = next((eye for eye in SIDES if as_string(key) == f"camera_intrinsics_{eye}"), None)
            if eye is None:
                raise RefusedError(f"a tweak is (camera_intrinsics_left (...)), or of the right eye, not {shown(key)}")
            fx, _, cx, _, _, fy, cy, _, *_ = array(value, _PROJECTION)
            if not (fx > 0.0 and fy > 0.0):
                raise RefusedError(f"the focal lengths of the {eye} eye are above 0, not {fx:g} and {fy:g}")
            cameras[eye] = replace(self.camera(eye), fx=number(fx), fy=number(fy), cx=number(cx), cy=number(cy))
        self.cameras = cameras
