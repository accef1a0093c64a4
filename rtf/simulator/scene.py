"""The visible scene: the robot's covers, a floor, and some objects in front of the robot.

Nothing of it collides, so the mechanics are the same with and without it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.model.engine import mujoco
from rtf.simulator import collisions, meshes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.model.file import Bench, Cut

#: The camera that shows all of the robot.
OUTSIDE = "outside"
#: Width and height of the largest picture of a camera, in pixels.
LARGEST_PICTURE = (1280, 960)
#: The name of the red ball's shape.
BALL = "red_ball"
#: A red ball and a green box where a robot's cameras look (m).
BALL_RADIUS = 0.035
BOX_HALF = 0.04
RED = (0.9, 0.05, 0.05, 1.0)
GREEN = (0.05, 0.7, 0.1, 1.0)

#: Direction and intensity of the lights; the second one comes from the right and gives the shapes contrast.
_LIGHTS = (((0.5, 0.3, -0.8), 0.6), ((0.6, -0.7, -0.2), 0.25))
_SKY, _HORIZON = (0.35, 0.5, 0.7), (0.85, 0.9, 0.95)
_SKIN = (0.75, 0.75, 0.78, 1.0)


def add_scene(spec: Any, bench: Bench, published: list[Any], attached: list[Any], *, keep_meshes: bool) -> None:
    """Make the robot visible, with simplified or ``published`` covers, and add the surroundings."""
    if not keep_meshes:
        for geom in published:
            if geom.meshname and spec.mesh(geom.meshname).file.lower().endswith(".stl"):
                _lighten(spec.mesh(geom.meshname), geom, bench.cut)
    # Shapes that also collide are in a group that is not shown.
    for geom in [*published, *attached]:
        geom.group = collisions.VISUAL_GROUP
    for geom in attached:
        geom.rgba = _SKIN
    _add_surroundings(spec.worldbody, bench)
    _add_sky(spec)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = LARGEST_PICTURE
    spec.visual.quality.offsamples = 0  # smooth edges would double the time of a picture


def _add_sky(spec: Any) -> None:
    """Make the background bright, as in a room."""
    spec.add_texture(
        name="sky",
        type=mujoco().mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco().mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=_HORIZON,
        rgb2=_SKY,
        width=64,
        height=64,
    )


def _lighten(mesh: Any, geom: Any, cut: Cut | None) -> None:
    """Replace the mesh of a file by a simplified one."""
    corners = meshes.read_stl(Path(mesh.file)) * np.abs(np.asarray(mesh.scale, dtype=np.float32))
    if cut is not None and geom.parent.name in cut.links:
        corners = corners[_is_within(cut, corners + np.asarray(geom.pos, dtype=np.float32))]
    vertices, faces = meshes.clustered(corners, meshes.CELL)
    mesh.file = ""
    mesh.scale = [1, 1, 1]
    mesh.uservert = vertices.ravel()
    mesh.userface = faces.ravel()


def _is_within(cut: Cut, corners: NDArray[np.float32]) -> NDArray[np.bool_]:
    centres = corners.mean(axis=1)
    inside: NDArray[np.bool_] = (np.abs(centres[:, 0]) < cut.length) & (centres[:, 2] < cut.width)
    return inside


def _add_surroundings(world: Any, bench: Bench) -> None:
    types = mujoco().mjtGeom
    looks = [
        world.add_geom(
            name="floor", type=types.mjGEOM_PLANE, pos=[0, 0, bench.floor], size=[4, 4, 0.1], rgba=[0.5, 0.55, 0.6, 1]
        )
    ]
    if bench.ball is not None:
        looks.append(
            world.add_geom(name=BALL, type=types.mjGEOM_SPHERE, pos=bench.ball, size=[BALL_RADIUS, 0, 0], rgba=RED)
        )
    if bench.box is not None:
        looks.append(
            world.add_geom(name="green_box", type=types.mjGEOM_BOX, pos=bench.box, size=[BOX_HALF] * 3, rgba=GREEN)
        )
    for geom in looks:
        collisions.make_visual(geom)
    sun = mujoco().mjtLightType.mjLIGHT_DIRECTIONAL
    for direction, strength in _LIGHTS:
        world.add_light(type=sun, pos=[0, 0, 3], dir=direction, diffuse=[strength] * 3, castshadow=False)
    world.add_camera(name=OUTSIDE, pos=bench.outside, quat=_looking(bench.outside, bench.centre), fovy=45)


def _looking(place: tuple[float, float, float], at: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return the quaternion of an upright camera at ``place`` that looks at a point."""
    backwards = np.subtract(place, at)
    backwards /= np.linalg.norm(backwards)
    right = np.cross((0.0, 0.0, 1.0), backwards)
    right /= np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(backwards, right), backwards])
    quaternion = np.zeros(4)
    mujoco().mju_mat2Quat(quaternion, rotation.ravel())
    return quaternion
