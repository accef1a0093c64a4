"""The tracker of the red ball: pictures come in, and its place goes out, on the ports of ``pf3dTracker``.

================= ====================================================================================================
``NAME/video:i``  pictures of the left eye
``NAME/right:i``  pictures of the right eye; without a connection the distance is that by the size of the ball
``NAME/data:o``   for each picture seven numbers: x, y, z (m, in the frame of the left camera: to the right, down,
                  ahead), likelihood (0 to 1), u, v (px), and 1.0 if it is seen, else 0.0; with the stamp of the picture
``NAME/video:o``  the pictures of the left eye with the outline of the ball
================= ====================================================================================================

A picture is evaluated before its message is acknowledged: in lockstep the place is there before the time goes on.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.types import IMAGE, VECTOR, Image, Stamp
from rtf.red_ball.detection import find_ball
from rtf.red_ball.eyes import in_root, pinhole
from rtf.red_ball.history import positions_of
from rtf.red_ball.stereo import Located, locate
from rtf.robot.errors import StaleStateError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.red_ball.detection import SeenBall
    from rtf.red_ball.eyes import Cameras
    from rtf.red_ball.history import Positions
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.kinematics import Pinhole

#: Pictures of both eyes whose stamps differ by less are of one moment (s).
_TOGETHER = 0.005
#: How long a picture of the left eye waits for its pair (s), and the pictures that are kept of each eye.
_LATEST, _KEPT = 0.5, 32
#: A stamp that is earlier than the last one by more (s) is not a repetition, but the clock was set back.
_CLOCK_SET_BACK = 1.0
#: How long a reader may take to acknowledge a place in lockstep (s).
_PATIENCE = 5.0
_GREEN = (0, 255, 0)
_NUMBERS = 7


class _Picture(NamedTuple):
    pixels: NDArray[np.uint8]
    stamp: Stamp


class Tracker:
    """The tracker, from its construction to ``close``.

    ``radius`` is that of the ball (m), ``field_of_view`` the vertical one of the cameras (deg). ``cameras`` and
    ``head`` are needed for the right eye. ``acknowledged``: a place has been received by all readers before the message
    with the picture is acknowledged. Raises MiddlewareError.
    """

    def __init__(
        self,
        name: str,
        *,
        network: Network,
        radius: float,
        field_of_view: float,
        cameras: Cameras | None = None,
        head: Positions | None = None,
        acknowledged: bool = False,
    ) -> None:
        self._network = network
        self._radius = radius
        self._field_of_view = field_of_view
        self._cameras = cameras
        self._head = head
        self._acknowledged = acknowledged
        self._lock = threading.Lock()
        self._lefts: deque[_Picture] = deque(maxlen=_KEPT)
        self._rights: deque[_Picture] = deque(maxlen=_KEPT)
        self._done = -np.inf  # the time of the latest picture that was evaluated
        self._reported = ""
        with ExitStack() as opened:
            self._data = opened.enter_context(BufferedPort(f"{name}/data:o", VECTOR, network=network, inputs=False))
            self._shown = opened.enter_context(BufferedPort(f"{name}/video:o", IMAGE, network=network, inputs=False))
            self.right = opened.enter_context(Port(f"{name}/right:i", self._take_right, network=network, outputs=False))
            self.left = opened.enter_context(Port(f"{name}/video:i", self._take_left, network=network, outputs=False))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close the ports."""
        self._opened.close()

    # Pictures, in the threads of their connections -------------------------------------------------------------------

    def _take_left(self, delivery: IncomingMessage) -> None:
        picture = _picture(delivery)
        with self._lock:
            time = picture.stamp.time
            newest = self._lefts[-1].stamp.time if self._lefts else self._done
            if newest - _CLOCK_SET_BACK < time <= newest:
                return  # it came twice, by two connections
            if time < newest:
                self._lefts.clear()
                self._rights.clear()
            self._lefts.append(picture)
            self._evaluate_pairs()

    def _take_right(self, delivery: IncomingMessage) -> None:
        picture = _picture(delivery)
        with self._lock:
            self._rights.append(picture)
            self._evaluate_pairs()

    def _evaluate_pairs(self) -> None:
        """Evaluate the pictures of the left eye whose pair has come, or will not come. Called with the lock held.

        Several pictures of one eye may come before those of the other.
        """
        while self._lefts:
            left = self._lefts[0]
            time = left.stamp.time
            right = next((one for one in self._rights if abs(one.stamp.time - time) < _TOGETHER), None)
            gone = any(one.stamp.time > time + _TOGETHER for one in self._rights) or not self.right.inputs
            if right is None and not gone and self._lefts[-1].stamp.time < time + _LATEST:
                return
            self._lefts.popleft()
            self._evaluate(left, right)

    def _evaluate(self, left: _Picture, right: _Picture | None) -> None:
        """Find the ball, and send its place. Called with the lock held."""
        self._done = left.stamp.time
        height, width = left.pixels.shape[:2]
        camera = pinhole(width, height, self._field_of_view)
        seen = find_ball(left.pixels, camera, self._radius)
        other = None if right is None else find_ball(right.pixels, camera, self._radius)
        found = self._located(seen, other, camera, left.stamp.time)
        self._say(found.problem)
        there = found.place is not None and not found.problem and found.place[2] > 0.0
        place = found.place if there else None
        values = [0.0] * _NUMBERS
        if place is not None:
            likelihood = max(one.likelihood for one in (seen, other) if one is not None)
            values = [*place, likelihood, *camera.pixel_of(place, np.eye(4)), 1.0]
        self._send(np.array(values), left, camera, place)

    def _located(self, left: SeenBall | None, right: SeenBall | None, camera: Pinhole, time: float) -> Located:
        """Return where the ball is in the frame of the left camera, by the eyes that see it."""
        if right is None or self._cameras is None or self._head is None:
            return Located(None if left is None else left.place)
        try:
            pose, opposite = self._cameras.eyes.poses(positions_of(self._cameras.joints, [self._head], time))
        except StaleStateError as error:
            return Located(None, f"the state of the head is lost: {error}")
        across = np.linalg.inv(pose) @ opposite
        return Located(in_root(right.place, across)) if left is None else locate(left, right, camera, across)

    def _send(self, values: FloatArray, left: _Picture, camera: Pinhole, place: FloatArray | None) -> None:
        envelope = str(left.stamp)
        self._data.write(values, envelope=envelope)
        if self._shown.outputs:
            shown = left.pixels.copy()
            if place is not None:
                shown[_circle(shown, camera, place, self._radius)] = _GREEN
            self._shown.write(Image(shown), envelope=envelope)
        if self._acknowledged:
            self._data.wait(_PATIENCE)

    def _say(self, problem: str) -> None:
        """Report a problem when it begins."""
        kind = problem.partition(":")[0]
        if kind and kind != self._reported:
            self._network.report(problem)
        self._reported = kind


def _picture(delivery: IncomingMessage) -> _Picture:
    stamp = Stamp.parse(delivery.envelope) or Stamp()
    return _Picture(delivery.read(IMAGE).to("rgb").pixels, stamp)


def _circle(picture: NDArray[np.uint8], camera: Pinhole, place: FloatArray, radius: float) -> NDArray[np.bool_]:
    """Return the pixels of a circle about a ball."""
    u, v = camera.pixel_of(place, np.eye(4))
    rows, columns = np.ogrid[: picture.shape[0], : picture.shape[1]]
    away = np.hypot(columns + 0.5 - u, rows + 0.5 - v)
    line: NDArray[np.bool_] = np.abs(away - camera.fx * radius / place[2] - 2.0) < 1.0
    return line
