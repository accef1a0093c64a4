"""The requests of gaze control as one table, see :mod:`rtf.robot.network.request_table`.

The protocol is version 2.0 of ``iKinGazeCtrl`` of the iCub and of its client ``gazecontrollerclient``, which writes
strings. A target has the same elements in a request, in ``get 3D`` and on the port of its kind.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Value, as_vocab
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces.gaze import (
    Eye,
    FixationPoint,
    GazeAngles,
    GazeTarget,
    MonoPixel,
    MonoPixelWithVergence,
    StereoPixels,
)
from rtf.robot.network.elements import inner, number, shown, whole
from rtf.robot.network.request_table import (
    FLOAT,
    FLOATS,
    NOTHING,
    PAIRS,
    POSE,
    POSITION_SIZE,
    RANGE,
    Kind,
    Request,
    RequestTable,
    alone,
    array,
    common,
    finite,
    floats,
    row,
    setting,
    vector,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.interfaces import FloatArray, Values

#: The joints of the head, and those of torso and head.
HEAD_SIZE, JOINTS_SIZE = 6, 9
_ABSOLUTE, _RELATIVE, _VERGENCE = "abs", "rel", "ver"
_PIXEL_SIZE, _PLANE_SIZE = 2, 4
#: A vergence that stands for eyes that are free.
_FREE = -1.0
#: The form of each kind of target in requests, and the end of its port.
FORMS: dict[type[GazeTarget], tuple[str, str]] = {
    FixationPoint: ("3D", "xd"),
    GazeAngles: ("ang", "angles"),
    MonoPixel: ("mono", "mono"),
    MonoPixelWithVergence: ("mono", "mono"),
    StereoPixels: ("stereo", "stereo"),
}


# Targets --------------------------------------------------------------------------------------------------------------


def target_elements(target: GazeTarget) -> list[Value]:
    """Return the elements of a target. Raises RefusedError unless all its numbers are finite."""
    if isinstance(target, FixationPoint):
        return [*vector(target.point, POSITION_SIZE).tolist()]
    if isinstance(target, GazeAngles):
        return [_RELATIVE if target.relative else _ABSOLUTE, *map(finite, target[:3])]
    if isinstance(target, StereoPixels):
        return [finite(one) for pixel in target for one in vector(pixel, _PIXEL_SIZE)]
    pixel: list[Value] = [target.eye, finite(target.u), finite(target.v)]
    if isinstance(target, MonoPixelWithVergence):
        return [*pixel, _VERGENCE, finite(target.vergence)]
    return [*pixel, finite(target.depth)]


def point_of(values: Sequence[Value]) -> FixationPoint:
    """Decode the first three numbers as a point. Raises RefusedError."""
    return FixationPoint(_numbers(values, POSITION_SIZE))


def angles_of(values: Sequence[Value]) -> GazeAngles:
    """Decode a word and three angles. Raises RefusedError."""
    word = as_vocab(values[0] if values else None).text
    if word not in (_ABSOLUTE, _RELATIVE):
        raise RefusedError(f"angles are {_ABSOLUTE} or {_RELATIVE}, not {shown(values[0] if values else None)}")
    azimuth, elevation, vergence = _numbers(values[1:], POSITION_SIZE).tolist()
    return GazeAngles(azimuth, elevation, vergence, word == _RELATIVE)


def mono_of(values: Sequence[Value]) -> MonoPixel | MonoPixelWithVergence:
    """Decode an eye, its pixel, and a depth or ``ver`` and a vergence. Raises RefusedError.

    A depth has to be a floating-point number, as with the original, which distinguishes it from a word by that.
    """
    eye = eye_of(values[0] if values else None)
    u, v = _numbers(values[1:], _PIXEL_SIZE).tolist()
    match [*values[3:5]]:
        case [float() as depth, *_]:
            return MonoPixel(eye, u, v, number(depth))
        case [word, vergence] if as_vocab(word).text == _VERGENCE:
            return MonoPixelWithVergence(eye, u, v, number(vergence))
    raise RefusedError(f"a pixel needs a depth, or ver and a vergence, not {Bottle(values[3:5]).to_text()}")


def stereo_of(values: Sequence[Value]) -> StereoPixels:
    """Decode the four numbers of two pixels. Raises RefusedError."""
    ul, vl, ur, vr = _numbers(values, 2 * _PIXEL_SIZE).tolist()
    return StereoPixels((ul, vl), (ur, vr))


#: What decodes the message of each port of targets.
TARGETS: dict[str, Callable[[Sequence[Value]], GazeTarget]] = {
    "xd": point_of,
    "angles": angles_of,
    "mono": mono_of,
    "stereo": stereo_of,
}


def eye_of(value: Value | None) -> Eye:
    """Return an eye. Raises RefusedError."""
    word = as_vocab(value).text
    if word == "left":
        return "left"
    if word == "righ":
        return "right"
    raise RefusedError(f"an eye is left or right, not {shown(value)}")


def _numbers(values: Sequence[Value], count: int) -> FloatArray:
    """Return the first numbers of a list. Raises RefusedError if there are not as many."""
    return array(Bottle(values[:count]), count)


# Kinds ----------------------------------------------------------------------------------------------------------------


def _pixel_and_plane(eye: Eye, pixel: Values, plane: Values) -> Bottle:
    return Bottle([eye, *vector(pixel, _PIXEL_SIZE).tolist(), *vector(plane, _PLANE_SIZE).tolist()])


def _plane_of(values: Sequence[Value]) -> tuple[Eye, FloatArray, FloatArray]:
    [given] = _lists(values, 1)
    numbers = _numbers(given[1:], _PIXEL_SIZE + _PLANE_SIZE)
    return eye_of(given[0]), numbers[:_PIXEL_SIZE], numbers[_PIXEL_SIZE:]


def _eye_and_point(values: Sequence[Value]) -> tuple[Eye, FloatArray]:
    [given] = _lists(values, 1)
    return eye_of(given[0] if given else None), _numbers(given[1:], POSITION_SIZE)


def _lists(values: Sequence[Value], count: int) -> list[Bottle]:
    """Return lists. Raises RefusedError unless there are as many, none of them empty."""
    found = [inner(one) for one in values]
    if len(found) != count or not all(found):
        raise RefusedError(f"{count} list is needed, not {Bottle(values).to_text()[:80]}")
    return found


def _target(decode: Callable[[Sequence[Value]], GazeTarget]) -> Kind:
    return alone(lambda target: Bottle(target_elements(target)), lambda value: decode([*inner(value)]))


def _vector(size: int) -> Kind:
    return alone(lambda values: floats(vector(values, size)), lambda value: array(value, size))


def _part(value: Value) -> str:
    return "head" if as_vocab(value).text == "head" else eye_of(value)


def _flag(value: Value) -> bool:
    return whole(value) != 0


def _vergence(values: Sequence[Value]) -> tuple[float | None]:
    vergence = number(values[0] if values else None)
    return (None if vergence < 0.0 else vergence,)


_TARGET = {end: _target(decode) for end, decode in TARGETS.items()}
_FLAG = alone(int, _flag)
_PART = alone(str, _part)
_VECTOR = {size: _vector(size) for size in (_PIXEL_SIZE, POSITION_SIZE, HEAD_SIZE)}
_EYE_POINT = Kind(lambda eye, point: [Bottle([eye, *vector(point, POSITION_SIZE).tolist()])], _eye_and_point)
_EYE_PLANE = Kind(lambda *given: [_pixel_and_plane(*given)], _plane_of)
#: The blocked vergence twice: the client of the original wants more than one element after ``[ack]``.
_BLOCKED = Kind(lambda vergence: [_FREE if vergence is None else finite(vergence)] * 2, _vergence)
_BOUNDS = Kind(lambda low, high: [finite(low), finite(high)], lambda values: tuple(_numbers(values, 2).tolist()))


# The table ------------------------------------------------------------------------------------------------------------


def _targets() -> list[Request]:
    rows = []
    for form, end in dict.fromkeys(FORMS.values()):
        rows.append(row(f"look {form}", "look_at", _TARGET[end], key=f"look {form}"))
        if form != "3D":  # a point is one
            rows.append(row(f"get 3D {form}", "point_of", _TARGET[end], _VECTOR[POSITION_SIZE], key=f"point {form}"))
    return rows


def _neck(axis: str) -> list[Request]:
    fixed = (axis,)
    return [
        row(f"get {axis}", "neck_range", NOTHING, RANGE, key=f"range {axis}", fixed=fixed),
        row(f"bind {axis}", "bind_neck", _BOUNDS, key=f"bind {axis}", fixed=fixed),
        row(f"clear {axis}", "clear_neck", key=f"clear {axis}", fixed=fixed),
    ]


TABLE = RequestTable(
    (
        *common(silent=False),
        *_targets(),
        *_neck("pitch"),
        *_neck("roll"),
        *_neck("yaw"),
        row("get eyes", "blocked_vergence", NOTHING, _BLOCKED),
        row("bind eyes", "bind_eyes", FLOAT),
        row("clear eyes", "clear_eyes"),
        row("get 3D proj", "point_on_plane", _EYE_PLANE, _VECTOR[POSITION_SIZE]),
        row("get 2D", "pixel_of", _EYE_POINT, _VECTOR[_PIXEL_SIZE]),
        row("get ang", "angles_of", _VECTOR[POSITION_SIZE], _VECTOR[POSITION_SIZE]),
        row("get pose", "pose", _PART, POSE),
        row("get des", "desired", NOTHING, _VECTOR[HEAD_SIZE]),
        row("get vel", "joint_velocities", NOTHING, _VECTOR[HEAD_SIZE]),
        row("get done", "motion_done", NOTHING, _FLAG),
        row("get sdon", "saccade_done", NOTHING, _FLAG),
        *setting("Tneck", "neck_trajectory_time", FLOAT),
        *setting("Teyes", "eyes_trajectory_time", FLOAT),
        *setting("vor", "vor_gain", FLOAT),
        *setting("ocr", "ocr_gain", FLOAT),
        *setting("sacc", "saccades", _FLAG),
        *setting("sinh", "saccades_inhibition_period", FLOAT),
        *setting("sact", "saccades_activation_angle", FLOAT),
        *setting("ntol", "neck_tolerance", FLOAT),
        *setting("track", "tracking", _FLAG),
        *setting("stab", "stabilization", _FLAG),
        *setting("pid", "stereo_options", PAIRS),
        row("susp", "suspend"),
        row("run", "resume"),
        row("status", "status", NOTHING, alone(str, str)),
        row("register ongoing", "add_checkpoint", FLOAT),
        row("unregister ongoing", "remove_checkpoint", FLOAT),
        row("list ongoing", "checkpoints", NOTHING, FLOATS),
    ),
    spell=str,
)
