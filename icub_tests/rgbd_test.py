"""Depth camera: pictures and depths belong together, keep their rate, and the depths of known places are right."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.bottle import Bottle, Dialect, Property, as_float
from rtf.errors import RtfError
from rtf.middleware.types import IMAGE
from rtf.robot.interfaces import RgbdPart
from rtf.robot.sensors.rgbd import COLOUR, DEPTH, DEPTH_FORMAT, RgbdClient
from rtf.robot_testing import likely_causes
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.stream_test import RateTest
from rtf.robot_testing.streams.stream_statistics import within
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rtf.bottle import Value
    from rtf.middleware.types import Image
    from rtf.robot.interfaces import Intrinsics
    from rtf.robot_testing.streams.message import Message

#: Half the side of the square of pixels whose median is the depth of a known place.
_HALF = 2
_NUMBERS = 3  # of a known place
_WHITE = 255


class _Known(NamedTuple):
    """A place in the images, as shares of width and height from the top left, and its depth in m."""

    x: float
    y: float
    depth: float


class _Seen(NamedTuple):
    """The recorded properties of an image; the last four of a depth image only."""

    width: int
    height: int
    code: str
    measured: float = 0.0  # share of the pixels
    least: float = 0.0  # m
    greatest: float = 0.0  # m
    known: tuple[float, ...] = ()  # m; NaN where nothing was measured


class RgbdTest(RateTest):
    """Checks a depth camera: rates, sizes and times of pictures and depths, known depths, and the optics it reports.

    The known places are those of ``[sensors.depth_cameras]`` in robot.toml, seen while the robot is at home, or those
    of the parameter ``known``, such as a wall that the camera faces. Without any, no depth is compared.
    """

    aliases = ("rgbdTest", "rgbd", "depthCamera")
    tags = ("streams", "camera")
    judged_sensors = ("depth_cameras",)

    port = Parameter(str, "the name of the camera; none: those of the model", default="", aliases=("portname",))
    time = Parameter(float, "how long images are counted", unit="s", default=2.0, low=0.1)
    frequency = Parameter(float, "images a second", unit="Hz", default=30.0, low=0.01)
    tolerance = Parameter(float, "tolerance of the rate", unit="Hz", default=2.5, low=0.0)
    # As for pictures: reading one takes longer than reading numbers, and senders skip busy readers.
    max_loss = Parameter(float, "share of images that may be missing", unit="%", default=10.0, low=0.0, high=100.0)
    max_jitter = Parameter(
        float, "greatest delay of nine of ten images behind the quickest one (lower confidence bound)", unit="ms",
        default=30.0, low=0.0,
    )  # fmt: skip
    known = Parameter(Bottle, "known places: ((x y depth) ...), from left and top, 0 to 1, and in m", default=Bottle())
    # Two per cent at two metres is the usual accuracy of active depth cameras.
    depth_tolerance = Parameter(float, "tolerance of a known depth", unit="%", default=2.0, low=0.0, high=100.0)
    # Half the time between two images: those of one moment are nearer to each other than to any other.
    max_offset = Parameter(float, "greatest time between a depth and its picture", unit="ms", default=16.0, low=0.0)
    least_measured = Parameter(float, "least share of pixels with a depth", unit="%", default=20.0, low=0.0, high=100.0)
    # As of CameraTest; two measured depths always differ by their noise.
    max_repeated = Parameter(float, "depths that may equal the one before", unit="%", default=5.0, low=0.0, high=100.0)
    optics_tolerance = Parameter(
        float, "tolerance of the focal lengths, of those by the field of view", unit="%", default=2.0, low=0.0
    )

    def parameter_problems(self) -> list[str]:
        """Add the errors of known places that are none."""
        wrong = [row for row in self.lines(self.known) if not _is_known(row)]
        source = self.parameter_source("known")
        return [
            *(f"known: ({Bottle(row).to_text()}) is no place such as (0.5 0.5 1.2) ({source})" for row in wrong),
            *super().parameter_problems(),
        ]

    def setup(self) -> None:
        """Find the cameras and their known places."""
        super().setup()
        described = {
            f"/{self.robot_name}/{camera.port}": [_Known(*one.at, one.depth) for one in camera.known]
            for camera in robot_model(self).sensors.depth_cameras.values()
        }
        given = [_Known(*map(as_float, row)) for row in self.lines(self.known)]
        names = [self.port] if self.port else [*described]
        self.cameras = {name: given or described.get(name, []) for name in names}
        self.assert_error_if_false(
            names, "the robot's model has no depth camera; give its name as portname, such as /icub/depthCamera"
        )
        self._last: dict[str, Image] = {}

    def run(self) -> None:
        """Record the images of all cameras, then judge those of each."""
        there = [name for name, known in self.cameras.items() if self._listen_to(name, known)]
        if there:
            self.listen(self.time)
        for name in there:
            with self.subresult(name):
                self._judge(name)

    def _listen_to(self, name: str, known: Sequence[_Known]) -> bool:
        """Record both streams of a camera: the facts of each image, and the last image itself."""
        try:
            for ending in (COLOUR, DEPTH):
                look = partial(self._look, self._last, f"{name}/{ending}", self.network.dialect, known)
                self.listener.add(f"{name}/{ending}", look=look)
        except RtfError as error:
            with self.subresult(name):
                self.assert_fail(f"cannot connect to {name}: {error}; was the robot started with cameras?")
            return False
        return True

    @staticmethod
    def _look(last: dict[str, Image], name: str, dialect: Dialect, known: Sequence[_Known], data: bytes) -> _Seen:
        """Decode an image. Called in the thread of its connection."""
        image = last[name] = IMAGE.decode(data, dialect)
        seen = _Seen(image.width, image.height, str(image.code))
        return seen if image.code != DEPTH_FORMAT else _measured(seen, image.pixels, known)

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge(self, name: str) -> None:
        colours, depths = (self._judge_stream(name, ending) for ending in (COLOUR, DEPTH))
        sizes = {(one.width, one.height) for one in (*_seen(colours), *_seen(depths))}
        self.check_fail_if_true(len(sizes) > 1, f"pictures and depths of {name} have different sizes: {sorted(sizes)}")
        self._judge_times(colours, depths)
        self._attach(name)
        seen = _seen(depths)
        self.assert_fail_if_true(
            any(one.code != DEPTH_FORMAT for one in seen), f"the depths of {name} are of the format {seen[-1].code!r}"
        )
        self._judge_depths(name, seen)
        hint = f"the depths of {name} do not change; {likely_causes('depth frozen')}"
        self.measure("repeated depths", _repeated(depths), "%", high=self.max_repeated, hint=hint)
        self._judge_optics(name, seen[-1])

    def _judge_stream(self, name: str, ending: str) -> list[Message]:
        port = f"{name}/{ending}"
        recorder = self.listener.recorders[port]
        if recorder.problems:
            self.assert_fail(f"{len(recorder.problems)} messages of {port} are no images: {recorder.problems[0]}")
        with self.subresult(ending):
            self.judge(self.judged(recorder.messages, self.time, port), self.frequency, self.tolerance)
        return within(recorder.messages, self.warm_up, self.time)

    def _judge_times(self, colours: Sequence[Message], depths: Sequence[Message]) -> None:
        """Judge the time between each depth and the picture that is nearest to it."""
        taken = np.array([one.moment for one in colours])
        offsets = [1e3 * float(np.abs(taken - one.moment).min()) for one in depths]
        hint = "depths are not taken with their pictures, or one of both is missing"
        self.measure("time between depth and picture", float(np.median(offsets)), "ms", high=self.max_offset, hint=hint)

    def _judge_depths(self, name: str, seen: Sequence[_Seen]) -> None:
        hint = f"{name} measures few depths; {likely_causes('depth missing')}"
        self.measure(
            "pixels with a depth", 100.0 * min(one.measured for one in seen), "%", low=self.least_measured, hint=hint
        )
        self.measure("least depth", min(one.least for one in seen), "m")
        self.measure("greatest depth", max(one.greatest for one in seen), "m")
        places = self.cameras[name]
        if not places:
            self.report(f"no depth of {name} is compared: no place with a known depth is given")
        for place, measured in zip(places, np.array([one.known for one in seen]).T, strict=True):
            self._judge_place(name, place, measured)

    def _judge_place(self, name: str, place: _Known, measured: NDArray[np.float64]) -> None:
        where = f"({place.x:g}, {place.y:g})"
        with self.subresult(where):
            self.assert_fail_if_true(
                np.isnan(measured).all(), f"{name} measures nothing at {where}; {likely_causes('depth missing')}"
            )
            found, share = float(np.nanmedian(measured)), self.depth_tolerance / 100.0
            hint = f"{name} measures {found:.3f} m at {where}, not {place.depth:g} m; {likely_causes('depth scale')}"
            low, high = place.depth * (1.0 - share), place.depth * (1.0 + share)
            self.measure("depth", found, "m", low=low, high=high, hint=hint)

    def _judge_optics(self, name: str, seen: _Seen) -> None:
        """Compare what the camera says of itself: its sizes, its fields of view and its projections."""
        camera = RgbdClient(name, network=self.network)
        try:
            camera.open(Property({"remote": name}))
        except RtfError as error:
            camera.close()
            self.assert_fail(f"{name} does not answer requests: {error}")
        try:
            for part in RgbdPart:
                size = camera.size(part)
                self.check_equal(size, (seen.width, seen.height), f"reported size of the {part.value} images")
                self._judge_projection(camera, part, size)
            near, far = camera.clip_planes()
        finally:
            camera.close()
        hint = f"{name} has depths out of its clip planes; {likely_causes('depth scale')}"
        tolerance = 1.0 + self.depth_tolerance / 100.0
        self.measure("least depth, of the near plane", seen.least, "m", low=near / tolerance, hint=hint)
        self.measure("greatest depth, of the far plane", seen.greatest, "m", high=far * tolerance, hint=hint)

    def _judge_projection(self, camera: RgbdClient, part: RgbdPart, size: tuple[int, int]) -> None:
        projection = camera.intrinsics(part)
        inside = 0.0 <= projection.centre_x <= size[0] and 0.0 <= projection.centre_y <= size[1]
        centre = f"{projection.centre_x:g}, {projection.centre_y:g}"
        self.check_fail_if_false(inside, f"the centre of the {part.value} images, ({centre}), is not inside of them")
        try:
            angles = camera.field_of_view(part)
        except RtfError as error:
            self.report(f"the field of view of the {part.value} images is not reported: {error}")
            return
        self._judge_focal_lengths(part, projection, size, angles)

    def _judge_focal_lengths(
        self, part: RgbdPart, projection: Intrinsics, size: tuple[int, int], angles: tuple[float, float]
    ) -> None:
        share = self.optics_tolerance / 100.0
        for axis, focal, pixels, angle in zip("xy", projection[:2], size, angles, strict=True):
            wanted = pixels / 2.0 / math.tan(math.radians(angle) / 2.0)
            hint = f"{angle:g} deg in {pixels} pixels are a focal length of {wanted:.1f}; {likely_causes('intrinsics')}"
            low, high = wanted * (1.0 - share), wanted * (1.0 + share)
            self.measure(f"focal length {axis}, {part.value}", focal, "px", low=low, high=high, hint=hint)

    def _attach(self, name: str) -> None:
        """Attach the last images: near is bright."""
        try:
            picture = self._last[f"{name}/{COLOUR}"].to("rgb").pixels
        except RtfError as error:
            self.report(f"the pixels of {name} cannot be shown: {error}")
        else:
            self.attach_picture(name, picture)
        depth = self._last[f"{name}/{DEPTH}"]
        if depth.code == DEPTH_FORMAT:
            far = float(np.nanmax(depth.pixels, initial=0.0)) or 1.0
            grey = np.nan_to_num(_WHITE * (1.0 - depth.pixels / far)).clip(0, _WHITE).astype(np.uint8)
            grey[~_is_measured(depth.pixels)] = 0
            self.attach_picture(name, np.repeat(grey[:, :, np.newaxis], 3, axis=2), "-depth")


def _is_known(row: Sequence[Value]) -> bool:
    if len(row) != _NUMBERS or not all(isinstance(one, int | float) for one in row):
        return False
    x, y, depth = map(as_float, row)
    return 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0 and 0.0 < depth < math.inf


def _is_measured(depth: NDArray[np.float32]) -> NDArray[np.bool_]:
    measured: NDArray[np.bool_] = np.isfinite(depth) & (depth > 0.0)
    return measured


def _measured(seen: _Seen, depth: NDArray[np.float32], known: Sequence[_Known]) -> _Seen:
    """Return the facts of a depth image."""
    values = depth[_is_measured(depth)]
    return seen._replace(
        measured=values.size / max(1, depth.size),
        least=float(values.min()) if values.size else math.nan,
        greatest=float(values.max()) if values.size else math.nan,
        known=tuple(_depth_at(depth, place) for place in known),
    )


def _depth_at(depth: NDArray[np.float32], place: _Known) -> float:
    """Return the median depth of the pixels about a place; NaN if none of them is measured."""
    height, width = depth.shape
    column, row = (round(share * size - 0.5) for share, size in ((place.x, width), (place.y, height)))
    part = depth[max(0, row - _HALF) : row + _HALF + 1, max(0, column - _HALF) : column + _HALF + 1]
    values = part[_is_measured(part)]
    return float(np.median(values)) if values.size else math.nan


def _seen(messages: Sequence[Message]) -> list[_Seen]:
    return [message.content for message in messages if isinstance(message.content, _Seen)]


def _repeated(found: Sequence[Message]) -> float:
    """Return the share of the depths (%) that equal the one before; 0 for a single one."""
    digests = np.array([message.digest for message in found])
    return 100.0 * float(np.mean(digests[1:] == digests[:-1])) if digests.size > 1 else 0.0
