"""Cameras in motion: pictures move with the joints that turn the camera, as far as its field of view says."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.bottle import Property
from rtf.errors import RtfError
from rtf.middleware.types import IMAGE
from rtf.robot.control_modes import ControlMode
from rtf.robot.model.errors import MissingPackageError
from rtf.robot.sensors.camera import FrameGrabberClient
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.camera_turns import CameraTurns
from rtf.robot_testing.judging.picture_defects import colourfulness, line_ratio, still_edges
from rtf.robot_testing.judging.picture_sharpness import picture_sharpness
from rtf.robot_testing.judging.picture_shift import shift_between
from rtf.robot_testing.motion.start_position import bring
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.slides import in_units
from rtf.robot_testing.stream_test import StreamTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.bottle import Dialect
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part
    from rtf.robot_testing.judging.picture_shift import Shift

#: Time at rest before a picture, s: longer than the exposure and the transport of a camera of 10 Hz.
_REST = 0.3
#: Cameras that look the same way within this angle, deg, see mostly the same.
_SAME_WAY = 15.0
#: Another camera explains a picture if it leaves at most this share of what the own one leaves.
_BETTER = 0.3
#: Edges along a motion stay in their place: the least way of the pictures across it, px.
_ACROSS = 5.0
#: Where so many of the edges stay, per cent, the whole picture does, which is judged by its way.
_ALL = 90.0
#: The colour of these edges in the picture that is attached.
_MARK = (255, 0, 0)
#: The least colourfulness with which that of another camera is compared: of a scene with colours.
_COLOURED = 0.05


class _Look(NamedTuple):
    """A picture of each camera, and where its axis points in the frame of the robot, after a move."""

    pictures: dict[str, NDArray[np.uint8]]
    turns: dict[str, FloatArray]


class CameraMotion(StreamTest):
    """Turns the cameras a little by each joint that turns them in place, and measures how far the pictures move.

    The way is that of the joints by the model of the robot, times the focal length that the camera reports by its field
    of view. A camera that shows what another one should see is found by the joints that turn the two differently. The
    scene has to stand still, and to have structures.

    What stays in its place while a camera turns is a defect of the camera, and so are lines that do not fit. Cameras
    that look the same way have to show the same colours, as sharply.
    """

    aliases = ("cameraMotion",)
    tags = ("motion", "camera")
    judged_sensors = ("cameras",)
    safety = Safety.MOTION

    cameras = Parameter(list[str], "cameras by their names in robot.toml; none: all that are there", default=[])
    amplitude = Parameter(float, "way of each joint", unit="deg", default=4.0, low=1.0, high=15.0)
    speed = Parameter(float, "speed of the moves", unit="deg/s", default=20.0, low=1.0, high=60.0)
    field_of_view = Parameter(
        float, "horizontal field of view; 0: as the camera reports", unit="deg", default=0.0, low=0.0, high=170.0
    )
    # Lenses without a calibration have more distortion at the edges than in the middle, where pictures are compared.
    tolerance = Parameter(float, "greatest error of the way of a picture", unit="%", default=15.0, low=1.0)
    # A fourteenth of the way of 4 deg in 320 pixels of 60 deg.
    least_shift = Parameter(float, "error of a way that is no finding", unit="px", default=1.5, low=0.0)
    # Eyes are 7 cm apart, and see other things near by; automatic exposures differ by less.
    colours = Parameter(
        float, "greatest difference of the mean colours of two cameras that look the same way, of white; 100: any",
        unit="%", default=10.0, low=0.0, high=100.0,
    )  # fmt: skip
    # A blur of one pixel leaves half of a sharp picture; the eyes of a simulated robot, which see the same edges from
    # other sides, differ by 7 %.
    sharpness = Parameter(
        float, "least sharpness of a camera, of another one that looks the same way; 0: any", unit="%", default=60.0,
        low=0.0, high=100.0,
    )  # fmt: skip
    # Healthy pictures have none; a dead column of 240 pixels that shows a third of its length has this share of 320.
    still_edges = Parameter(
        float, "greatest share of pixels with an edge that stays in its place while the camera turns; 100: any",
        unit="%", default=0.1, low=0.0, high=100.0,
    )  # fmt: skip
    # Below 1 of any picture with edges that are longer than two lines; 1 of noise alone.
    difference_of_lines = Parameter(
        float, "greatest difference of neighbouring lines, of that of lines two apart; 0: any", default=1.2, low=0.0
    )
    # Exposure and white balance change it by less; a camera without colours has none.
    colourfulness = Parameter(
        float, "least colourfulness of a camera, of another one that looks the same way; 0: any", unit="%",
        default=50.0, low=0.0, high=100.0,
    )  # fmt: skip
    # Phase correlation of unrelated pictures has peaks below a hundredth.
    least_peak = Parameter(float, "least peak of the correlation of two pictures", default=0.03, low=0.0, high=1.0)

    def setup(self) -> None:
        """Find the cameras, and the joints that turn them."""
        super().setup()
        robot = robot_model(self)
        self.ports = {
            name: f"/{self.robot_name}/{table.port}"
            for name, table in robot.sensors.cameras.items()
            if (name in self.cameras if self.cameras else self._is_there(f"/{self.robot_name}/{table.port}"))
        }
        self.assert_error_if_false(
            self.ports, f"no camera of /{self.robot_name} is registered; start a simulated robot with cameras"
        )
        try:
            self.turns = CameraTurns(robot, {name: robot.sensors.cameras[name].camera for name in self.ports})
        except MissingPackageError as error:
            self.assert_error(f"the model of the robot is needed: {error}")
        self.moved = [
            (self.open_part(part), joint) for part, joint in self.turns.turning(self.amplitude) if self.has_part(part)
        ]
        if not self.moved:
            self.skip("no joint turns the cameras without moving them")
        for part in dict.fromkeys(part for part, _ in self.moved):
            part.set_mode(ControlMode.POSITION)
        self._last: dict[str, NDArray[np.uint8]] = {}

    def _is_there(self, port: str) -> bool:
        return self.network.names.query(port) is not None

    def run(self) -> None:
        """Move joint by joint, and compare the pictures before and after."""
        for name, port in self.ports.items():
            self.listener.add(port, look=partial(self._look, self._last, name, self.network.dialect))
        focal = {name: self._focal_length(name, port) for name, port in self.ports.items()}
        found: dict[str, list[tuple[str, Shift, dict[str, FloatArray]]]] = {name: [] for name in self.ports}
        looks: list[_Look] = []
        for number, (part, joint) in enumerate(self.moved):
            self.progress(number / len(self.moved), part.names[joint])
            before, after = self._looks(part, joint)
            looks += (before, after)
            expected = {name: focal[name] * (after.turns[name] - before.turns[name]) for name in self.ports}
            for name in self.ports:
                shift = shift_between(before.pictures[name], after.pictures[name])
                found[name].append((part.names[joint], shift, expected))
        for name, port in self.ports.items():
            with self.subresult(port):
                ways = np.array([expected[name] for *_, expected in found[name]])
                self._judge_defects(port, [look.pictures[name] for look in looks], ways)
                self._judge(name, port, found[name])
        for one, other in self.turns.alike(_SAME_WAY):
            with self.subresult(f"{self.ports[one]} and {self.ports[other]}"):
                self._compare_colours(one, other, looks[0].pictures)
                self._compare_colourfulness(one, other, looks[0].pictures)
                self._compare_sharpness(one, other, looks[0].pictures)

    @staticmethod
    def _look(last: dict[str, NDArray[np.uint8]], name: str, dialect: Dialect, data: bytes) -> None:
        """Keep a picture. Called in the thread of its connection."""
        last[name] = IMAGE.decode(data, dialect).to("rgb").pixels

    def _looks(self, part: Part, joint: int) -> tuple[_Look, _Look]:
        """Return what the cameras see before and after a move of a joint, which goes home afterwards."""
        home = part.home[joint]
        goal = home + self.amplitude if home + self.amplitude <= part.high[joint] else home - self.amplitude
        try:
            before = self._seen(part)
            bring(self, part, [joint], [goal], speed=self.speed)
            after = self._seen(part)
            bring(self, part, [joint], [home], speed=self.speed)
        except GuardError as error:
            self.blame(part, error, "does not move", joints=[joint])
        return before, after

    def _seen(self, part: Part) -> _Look:
        self._last.clear()
        part.wait(_REST)
        self._last.clear()
        there = part.wait_until(lambda: self._last.keys() >= self.ports.keys(), 2.0)
        missing = ", ".join(port for name, port in self.ports.items() if name not in self._last)
        self.assert_true(there, f"no picture of {missing} came in 2 s")
        for one in dict.fromkeys(one for one, _ in self.moved):
            self.turns.set(one.names, in_units(one.board, one.board.encoders()))
        return _Look(dict(self._last), self.turns.axes())

    def _focal_length(self, name: str, port: str) -> float:
        """Return the focal length of a camera (px), by its field of view."""
        camera = FrameGrabberClient(f"{name}-optics", network=self.network)
        try:
            camera.open(Property({"remote": port, "no_stream": True}))
            width, angle = camera.width(), self.field_of_view or camera.field_of_view()[0]
        except RtfError as error:
            self.assert_error(f"{port} does not report its field of view: {error}; give field_of_view")
        finally:
            camera.close()
        return width / 2.0 / math.tan(math.radians(angle) / 2.0)

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge_defects(self, port: str, pictures: list[NDArray[np.uint8]], ways: FloatArray) -> None:
        """Judge what is wrong with the pictures whatever they show; ``ways`` (moves, 2) are what they should move."""
        still, ratio = still_edges(pictures), float(np.median([line_ratio(picture) for picture in pictures]))
        across = np.linalg.svd(ways, compute_uv=False)[1:]  # along the direction in which they move less
        if across.size and across[0] > _ACROSS and still.of_edges < _ALL:
            hint = (
                f"{port}: {still.of_pixels:.2f} % of its pixels have an edge that stays in its place while the camera "
                f"turns; {likely_causes('camera still edges')}"
            )
            self.measure("edges that stand still", still.of_pixels, "%", high=self.still_edges, hint=hint)
            if still.of_pixels > self.still_edges:
                marked = np.where(still.where[:, :, None], np.array(_MARK, np.uint8), pictures[0])
                self.attach_picture(port, marked)
        if math.isfinite(ratio):
            hint = f"{port}: neighbouring lines differ more than others; {likely_causes('camera lines')}"
            self.measure("difference of lines", ratio, high=self.difference_of_lines or None, hint=hint)

    def _judge(self, name: str, port: str, found: list[tuple[str, Shift, dict[str, FloatArray]]]) -> None:
        seen = [(shift, expected) for _, shift, expected in found]
        measured = np.array([(shift.right, shift.down) for shift, _ in seen])
        wanted = {other: np.array([expected[other] for _, expected in seen]) for other in self.ports}
        for (joint, shift, _), way in zip(found, wanted[name], strict=True):
            self.measure(f"way of the picture with {joint}", math.hypot(shift.right, shift.down), "px")
            self.measure(f"expected with {joint}", float(np.linalg.norm(way)), "px")
        if max(shift.peak for shift, _ in seen) < self.least_peak:
            self.inconclusive(
                f"{port} shows too little structure, or a scene that moves: its pictures do not correlate"
            )
        left = {other: float(np.sqrt(np.mean((measured - way) ** 2))) for other, way in wanted.items()}
        own = left[name]
        if own > self.least_shift:
            self._explain(port, measured, wanted[name], {other: left[other] for other in left if other != name}, own)
        share = 100.0 * float((measured * wanted[name]).sum() / (wanted[name] ** 2).sum())
        hint = (
            f"{port}: its pictures move by {share:.0f} % of what its field of view says; {likely_causes('intrinsics')}"
        )
        self.measure("way of the pictures", share, "%", 100.0 - self.tolerance, 100.0 + self.tolerance, hint=hint)

    def _compare_colours(self, one: str, other: str, pictures: dict[str, NDArray[np.uint8]]) -> None:
        """Compare the mean colours of two cameras that see the same scene."""
        means = [pictures[name].reshape(-1, 3).mean(axis=0) / 2.55 for name in (one, other)]
        apart = np.abs(means[0] - means[1])
        shown = " and ".join(f"({', '.join(f'{share:.0f}' for share in mean)}) %" for mean in means)
        hint = (
            f"{self.ports[one]} and {self.ports[other]} see the same scene and show other colours: red, green and blue "
            f"are {shown}; {likely_causes('camera colours')}"
        )
        self.measure("difference of the colours", float(apart.max()), "%", high=self.colours, hint=hint)

    def _compare_colourfulness(self, one: str, other: str, pictures: dict[str, NDArray[np.uint8]]) -> None:
        """Compare how colourful two cameras show the same scene."""
        found = {name: colourfulness(pictures[name]) for name in (one, other)}
        grey, coloured = sorted(found, key=found.__getitem__)
        if found[coloured] < _COLOURED:
            self.report("the scene has no colours that could be compared")
            return
        share = 100.0 * found[grey] / found[coloured]
        hint = (
            f"{self.ports[grey]} has {share:.0f} % of the colours of {self.ports[coloured]}, which sees the same "
            f"scene; {likely_causes('camera grey')}"
        )
        self.measure("colourfulness", share, "%", low=self.colourfulness, hint=hint)

    def _compare_sharpness(self, one: str, other: str, pictures: dict[str, NDArray[np.uint8]]) -> None:
        """Compare the sharpness of two cameras that see the same scene."""
        found = {name: picture_sharpness(pictures[name]) for name in (one, other)}
        blurred, sharp = sorted(found, key=found.__getitem__)
        share = 100.0 * found[blurred] / found[sharp] if found[sharp] > 0.0 else math.nan
        if math.isnan(share):
            self.report(f"the sharpness of {self.ports[one]} and {self.ports[other]} is not compared: noise hides it")
            return
        hint = (
            f"{self.ports[blurred]} has {share:.0f} % of the sharpness of {self.ports[sharp]}, which sees the same "
            f"scene; {likely_causes('camera blurred')}"
        )
        self.measure("sharpness", share, "%", low=self.sharpness, hint=hint)

    def _explain(
        self, port: str, measured: FloatArray, wanted: FloatArray, others: dict[str, float], own: float
    ) -> None:
        """Fail for pictures that do not move, or that are those of another camera."""
        still = float(np.sqrt(np.mean(measured**2))) <= self.least_shift < float(np.sqrt(np.mean(wanted**2)))
        self.assert_fail_if_true(still, f"pictures of {port} do not move; {likely_causes('camera frozen')}")
        best = min(others, key=lambda other: others[other], default="")
        if best and others[best] < _BETTER * own:
            self.assert_fail(f"{port} shows what {self.ports[best]} should; {likely_causes('cameras swapped')}")
