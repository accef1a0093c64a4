"""Camera: pictures arrive at their rate and size, and show the current scene."""

from __future__ import annotations

import math
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.bottle import Dialect, Property
from rtf.errors import RtfError
from rtf.middleware.types import IMAGE
from rtf.robot.sensors.camera import FrameGrabberClient
from rtf.robot_testing import MotionGuard, Part, likely_causes
from rtf.robot_testing.guard.simulated import is_simulated
from rtf.robot_testing.judging.picture_noise import picture_noise
from rtf.robot_testing.stream_test import RateTest
from rtf.robot_testing.streams.stream_statistics import within
from rtf.testing import Parameter
from rtf.testing.measurement import MeasurementVerdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from rtf.middleware.types import Image
    from rtf.robot_testing.streams.message import Message

#: Angle and speed of the simulated eyes' motion that changes the picture, deg and deg/s; and the speed beyond which
#: each picture has to differ: a third of a pixel (60 deg in 320) in the 33 ms between two.
_TURN, _TURNING_SPEED, _TURNING = 5.0, 10.0, 2.0
_EYES = ("eyes_tilt", "eyes_version")


class _Seen(NamedTuple):
    """The recorded properties of a picture."""

    width: int
    height: int
    code: str
    spread: float  # standard deviation of its pixels, of 255


class CameraTest(RateTest):
    """Checks every picture of a camera: rate, size, format, contrast, noise, and repeated pictures.

    On a real robot nothing moves: two pictures of a real camera always differ. A simulated scene is static; if too many
    pictures were equal there, the simulated eyes are turned a little, and the pictures of that motion are judged.
    """

    aliases = ("cameraTest", "camera", "Camera")
    tags = ("streams", "camera")
    judged_sensors = ("cameras",)

    port = Parameter(str, "the camera's port; none: all of the robot", default="", key="portname", aliases=("port",))
    time = Parameter(
        float, "how long pictures are counted", unit="s", default=2.0, low=0.1, key="measure_time", aliases=("time",)
    )
    frequency = Parameter(
        float, "pictures a second", unit="Hz", default=30.0, low=0.01, key="expected_frequency", aliases=("frequency",)
    )
    # As in the original, of 30 pictures.
    tolerance = Parameter(float, "pictures more or less in the whole time", unit="count", default=5.0, low=0.0)
    # Twice the bound for small messages: reading a picture takes longer, and senders skip busy readers.
    max_loss = Parameter(float, "share of pictures that may be missing", unit="%", default=10.0, low=0.0, high=100.0)
    max_jitter = Parameter(
        float, "greatest delay of nine of ten pictures behind the quickest one (lower confidence bound)", unit="ms",
        default=30.0, low=0.0,
    )  # fmt: skip
    width = Parameter(int, "pixels a row; 0: as the camera reports", unit="px", default=0, low=0)
    height = Parameter(int, "rows; 0: likewise", unit="px", default=0, low=0)
    format = Parameter(str, "format of the pixels, such as rgb; none: any, but always the same", default="")
    # The noise of a sensor in the dark is less, the contrast of a white wall in daylight is more.
    contrast = Parameter(
        float, "least standard deviation of the pixels, in per cent of white", unit="%", default=1.0, low=0.0
    )
    # A usual camera has 1 % in the light of a room, and 3 % with its greatest gain.
    noise = Parameter(float, "greatest standard deviation of a pixel from its neighbours, of white", unit="%",
                      default=5.0, low=0.0)  # fmt: skip
    # Ideally none; a driver that is polled asynchronously to its camera repeats one of some dozens.
    max_repeated = Parameter(
        float,
        "pictures that may equal the one before; set 100, and max_run 0, for the static scene of another simulator",
        unit="%",
        default=5.0,
        low=0.0,
        high=100.0,
    )
    max_run = Parameter(int, "pictures in a row that may be the same; 0: any number", unit="count", default=3, low=0)
    eyes = Parameter(str, "the part of the simulated eyes", default="head")

    def setup(self) -> None:
        """Find the cameras."""
        super().setup()
        self._last: dict[str, Image] = {}
        begin = f"/{self.robot_name}/cam/"
        self.ports = [self.port] if self.port else [name for name in self.known_ports("") if _is_camera(name, begin)]
        self.assert_error_if_false(
            self.ports,
            f"no camera below {begin} is registered at the name server; give its port as portname, "
            "and start a simulated robot with cameras",
        )

    def run(self) -> None:
        """Count the pictures of all cameras, then look at those of each."""
        there = [name for name in self.ports if self._listen_to(name)]
        if there:
            self.listen(self.time)
        windows = {name: within(self.listener.recorders[name].messages, self.warm_up, self.time) for name in there}
        # Only simulated eyes are turned: a real robot is never moved.
        simulated = is_simulated(self.network, self.robot_name, self.eyes)
        turned = self._turned(there) if simulated and self._stands(windows.values()) else {}
        for name in there:
            with self.subresult(name):
                self._judge(name, turned.get(name))

    def _listen_to(self, name: str) -> bool:
        """Record a camera: the facts of each picture, and the last picture itself."""
        try:
            self.listener.add(name, look=partial(self._look, self._last, name, self.network.dialect))
        except RtfError as error:
            with self.subresult(name):
                self.assert_fail(f"cannot connect to {name}: {error}")
        return name in self.listener.recorders

    @staticmethod
    def _look(last: dict[str, Image], name: str, dialect: Dialect, data: bytes) -> _Seen:
        """Decode a picture. Called in the thread of its connection."""
        image = last[name] = IMAGE.decode(data, dialect)
        return _Seen(image.width, image.height, str(image.code), float(image.pixels.std()))

    def _stands(self, windows: Iterable[Sequence[Message]]) -> bool:
        """Whether too many pictures of a camera were equal: its scene may be static."""
        most = self.max_run or math.inf
        return any(_repeated(found) > self.max_repeated or _longest_run(found) > most for found in windows)

    def _turned(self, names: Sequence[str]) -> dict[str, list[Message]]:
        """Turn the eyes and back; return the pictures taken while they turned."""
        before = {name: len(self.listener.recorders[name].messages) for name in names}
        part = self._open_eyes()
        joints = [part.joint(name) for name in _EYES]
        start = part.board.encoders(joints)
        with part.recorded() as trace:
            try:
                there = part.move(start + _TURN, joints, speed=_TURNING_SPEED)
                self.require(there, "its viewing direction", part, joints, start + _TURN)
            finally:
                part.move(start, joints, speed=_TURNING_SPEED)
        times, speeds = trace.time, np.abs(trace.velocities[:, joints]).max(axis=1)
        return {
            name: [
                message
                for message in self.listener.recorders[name].messages[before[name] :]
                if np.interp(message.moment, times, speeds, 0.0, 0.0) > _TURNING
            ]
            for name in names
        }

    def _open_eyes(self) -> Part:
        """Open the part of the simulated eyes with a guard of its own: the safety class of the test is STILL."""
        still = self.open_part(self.eyes)
        guard = MotionGuard(
            still.board, f"/{self.robot_name}/{self.eyes}", clock=self.clock, report=self.report, limits=self.limits
        )
        self.add_cleanup(guard.restore)
        return Part(self.eyes, still.board, self.clock, guard)

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge(self, name: str, turned: list[Message] | None) -> None:
        recorder = self.listener.recorders[name]
        if recorder.problems:
            self.assert_fail(f"{len(recorder.problems)} messages of {name} are no pictures: {recorder.problems[0]}")
        found = self.judged(recorder.messages, self.time, name)
        self.judge(found, self.frequency, self.tolerance / self.time)
        seen = [message.content for message in found if isinstance(message.content, _Seen)]
        self._judge_size(name, seen)
        picture = self._picture(name)
        if picture is not None:
            self.attach_picture(name, picture)
        least = min(one.spread for one in seen) / 2.55
        hint = f"pictures of {name} show nothing: all pixels are alike; {likely_causes('camera dark')}"
        contrast = self.measure("contrast", least, "%", low=self.contrast, hint=hint)
        if picture is not None:
            self._judge_noise(name, picture)
        if contrast.verdict is not MeasurementVerdict.FAILED:
            self._judge_content(name, found if turned is None else turned)

    def _judge_noise(self, name: str, picture: NDArray[np.uint8]) -> None:
        hint = f"pictures of {name} are noisy; {likely_causes('camera noise')}"
        self.measure("noise", picture_noise(picture) / 2.55, "%", high=self.noise, hint=hint)

    def _judge_size(self, name: str, seen: Sequence[_Seen]) -> None:
        width, height = self._wanted_size(name)
        kinds = sorted({one[:3] for one in seen})
        self.check_fail_if_true(len(kinds) > 1, f"size and format of the pictures of {name} change: {kinds}")
        self._measure_side("width", seen[-1].width, width)
        self._measure_side("height", seen[-1].height, height)
        if self.format:
            self.check_equal(seen[-1].code, self.format, f"format of the pixels of {name}")

    def _measure_side(self, side: str, found: int, wanted: int) -> None:
        limit = wanted or None
        hint = f"the {side} is {found} and should be {wanted}; {likely_causes('camera size')}"
        self.measure(side, found, "px", low=limit, high=limit, hint=hint)

    def _wanted_size(self, name: str) -> tuple[int, int]:
        """Return the size of the parameters, or the size that the camera reports; 0 if it does not."""
        if self.width and self.height:
            return self.width, self.height
        camera = FrameGrabberClient(name, network=self.network)
        try:
            camera.open(Property({"remote": name, "no_stream": True}))
            said = camera.width(), camera.height()
        except RtfError as error:
            self.report(f"{name} does not report the size of its pictures: {error}")
            said = 0, 0
        finally:
            camera.close()
        return self.width or said[0], self.height or said[1]

    def _judge_content(self, name: str, found: Sequence[Message]) -> None:
        self.assert_true(len(found) > 1, f"{len(found)} pictures came while the eyes of {name} were turned")
        hint = f"pictures of {name} do not change; {likely_causes('camera frozen')}"
        self.measure("repeated pictures", _repeated(found), "%", high=self.max_repeated, hint=hint)
        most = self.max_run or None
        self.measure("same picture in a row", _longest_run(found), "count", high=most, hint=hint)

    def _picture(self, name: str) -> NDArray[np.uint8] | None:
        """Return the last picture in colours; None, with a report, if its format has none that can be shown."""
        try:
            return self._last[name].to("rgb").pixels
        except RtfError as error:
            self.report(f"the pixels of {name} cannot be shown, and their noise is not judged: {error}")
            return None


def _is_camera(name: str, begin: str) -> bool:
    """Whether a port streams pictures; the ports below it answer requests."""
    return name.startswith(begin) and "/" not in name.removeprefix(begin)


def _repeated(found: Sequence[Message]) -> float:
    """Return the share of the pictures (%) that equal the one before; 0 for a single picture."""
    digests = np.array([message.digest for message in found])
    return 100.0 * float(np.mean(digests[1:] == digests[:-1])) if digests.size > 1 else 0.0


def _longest_run(found: Sequence[Message]) -> int:
    """Return the length of the longest run of equal pictures."""
    return max(sum(1 for _ in same) for _, same in groupby(message.digest for message in found)) if found else 0
