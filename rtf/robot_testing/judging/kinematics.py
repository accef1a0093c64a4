"""Forward kinematics of a robot from its URDF description; independent of all other implementations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from rtf.errors import RtfError

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from lxml.etree import _Element

    from rtf.robot.interfaces import FloatArray

_FIXED, _SLIDING = "fixed", "prismatic"
_TURNING = ("revolute", "continuous")
_AXES = 3


class DescriptionError(RtfError, ValueError):
    """A robot description that cannot be used; the message names the file and the joint or link."""


class _Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    child: str
    origin: FloatArray  # 4x4, of the child in the parent when the joint is at 0
    axis: FloatArray  # in the child's frame, of length 1
    low: float  # rad or m
    high: float


class KinematicModel:
    """A tree of links. Transforms are 4x4, of a link's frame in the root frame; angles are in rad."""

    def __init__(self, joints: Mapping[str, _Joint], place: str = "") -> None:
        self.place = place
        self._joints = dict(joints)
        self._above = {joint.child: joint for joint in joints.values()}
        self.links = {joint.parent for joint in joints.values()} | set(self._above)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a URDF file. Raises DescriptionError."""
        from lxml import etree

        try:
            root = etree.parse(path, etree.XMLParser(resolve_entities=False, no_network=True)).getroot()
        except (OSError, etree.XMLSyntaxError) as error:
            raise DescriptionError(f"{path}: cannot read a robot description (URDF): {error}") from None
        joints = [_read_joint(element, str(path)) for element in root.iterfind("joint")]
        if not joints:
            raise DescriptionError(f"{path}: it has no joint")
        if len({joint.child for joint in joints}) < len(joints):
            raise DescriptionError(f"{path}: a link is the child of two joints")
        return cls({joint.name: joint for joint in joints}, str(path))

    def chain(self, link: str) -> list[str]:
        """Return the joints that move a link, from the root on. Raises DescriptionError for an unknown link."""
        return [joint.name for joint in self._path(link) if joint.kind != _FIXED]

    def limits(self, joint: str) -> tuple[float, float]:
        """Return the limits of a joint (rad)."""
        return self._joints[joint].low, self._joints[joint].high

    def transform(self, link: str, angles: Mapping[str, float]) -> FloatArray:
        """Return the pose of a link; joints without an angle are at 0. Raises DescriptionError for an unknown link."""
        found: FloatArray = np.eye(4)
        for joint in self._path(link):
            found = found @ joint.origin
            if joint.kind != _FIXED:
                found = found @ _moved(joint, angles.get(joint.name, 0.0))
        return found

    def _path(self, link: str) -> list[_Joint]:
        if link not in self.links:
            raise DescriptionError(f"{self.place}: there is no link {link!r}")
        path: list[_Joint] = []
        while link in self._above:
            joint = self._above[link]
            if len(path) > len(self._above):
                raise DescriptionError(f"{self.place}: the joints above {joint.child!r} form a cycle")
            path.append(joint)
            link = joint.parent
        return path[::-1]


def _read_joint(element: _Element, place: str) -> _Joint:
    name = element.get("name", "")
    where = f"{place}:{element.sourceline}: joint {name!r}"
    ends = [found.get("link", "") if (found := element.find(end)) is not None else "" for end in ("parent", "child")]
    kind = element.get("type", "")
    if not name or not all(ends) or kind not in (_FIXED, _SLIDING, *_TURNING):
        raise DescriptionError(f"{where}: unsupported type {kind!r}, or a link is missing: {ends[0]!r} to {ends[1]!r}")
    origin, limit = element.find("origin"), element.find("limit")
    translation = _numbers(origin, "xyz", (0.0, 0.0, 0.0), where)
    rotation = _numbers(origin, "rpy", (0.0, 0.0, 0.0), where)
    axis = _numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0), where)
    length = float(np.linalg.norm(axis))
    if kind != _FIXED and length == 0.0:
        raise DescriptionError(f"{where}: its axis has no direction")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_of(*rotation), translation
    low, high = (math.nan, math.nan) if limit is None else (_number(limit, end, where) for end in ("lower", "upper"))
    return _Joint(name, kind, ends[0], ends[1], pose, axis / (length or 1.0), low, high)


def _numbers(element: _Element | None, key: str, default: tuple[float, ...], where: str) -> FloatArray:
    text = None if element is None else element.get(key)
    try:
        values = np.array(default if text is None else [float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (_AXES,) or not np.isfinite(values).all():
        raise DescriptionError(f"{where}: {key} has to be three numbers, not {text!r}")
    return values


def _number(element: _Element, key: str, where: str) -> float:
    text = element.get(key, "0")
    try:
        return float(text)
    except ValueError:
        raise DescriptionError(f"{where}: {key} has to be a number, not {text!r}") from None


def _moved(joint: _Joint, value: float) -> FloatArray:
    pose = np.eye(4)
    if joint.kind == _SLIDING:
        pose[:3, 3] = joint.axis * value
    else:
        pose[:3, :3] = rotation_about(joint.axis * value)
    return pose


def rotation_of(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return the rotation about the fixed axes x, y and z in this order (rad), 3x3."""
    about = (np.array([0.0, 0.0, yaw]), np.array([0.0, pitch, 0.0]), np.array([roll, 0.0, 0.0]))
    z, y, x = (rotation_about(vector) for vector in about)
    return z @ y @ x


def rotation_about(vector: FloatArray) -> FloatArray:
    """Return the rotation about a vector by its length (rad), 3x3: Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return turned


def rotation_vector(rotation: FloatArray) -> FloatArray:
    """Return the axis of a rotation, scaled to its angle (rad, at most pi): the inverse of ``rotation_about``."""
    twice = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(twice)) / 2, (float(np.trace(rotation)) - 1.0) / 2
    angle = math.atan2(sine, cosine)
    if sine > 1e-6:  # noqa: PLR2004 - above it the direction is well defined
        return twice / (2 * sine) * angle
    if cosine > 0:
        return twice / 2
    # Half a turn: the axis is the only direction that stays.
    column = int(np.argmax(np.diag(rotation)))
    axis: FloatArray = rotation[:, column] + np.eye(3)[column]
    axis *= angle / float(np.linalg.norm(axis))
    return axis
