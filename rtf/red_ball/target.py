"""Where the ball is in the frame of the root: what the tracker says, and where the eye was at that moment."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.middleware.types import VECTOR
from rtf.red_ball.eyes import in_root
from rtf.red_ball.history import positions_of
from rtf.robot.network.latest_message import LatestMessage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.red_ball.eyes import Cameras
    from rtf.red_ball.history import Positions
    from rtf.robot.interfaces import FloatArray

_NUMBERS = 7
#: The greatest distance of a ball from the root that is believed (m).
_FARTHEST = 3.0


class Ball(NamedTuple):
    """A ball that was seen."""

    place: FloatArray  # its centre in the frame of the root (m)
    time: float  # of its picture, in seconds of the robot's clock


class Target:
    """The port for the tracker's places, and the last place. Raises DeviceError if the port cannot be opened."""

    def __init__(self, name: str, cameras: Cameras, parts: Sequence[Positions], *, network: Network) -> None:
        self._reader = LatestMessage(name, VECTOR, timeout=np.inf, network=network)
        self._cameras = cameras
        self._parts = parts
        self._looked = -np.inf
        self.ball: Ball | None = None

    @property
    def name(self) -> str:
        """The name of the port."""
        return self._reader.name

    def connect(self, tracker: str, carrier: str) -> None:
        """Connect a tracker's port. Raises DeviceError."""
        self._reader.connect(tracker, carrier)

    def look(self) -> Ball | None:
        """Return the ball, where it was last seen; None before. Raises StaleStateError for a picture without a pose."""
        latest = self._reader.latest
        if latest is None or latest.time == self._looked:
            return self.ball
        values = latest.value
        if values.shape == (_NUMBERS,) and np.isfinite(values).all() and values[-1] == 1.0:
            pose, _ = self._cameras.eyes.poses(positions_of(self._cameras.joints, self._parts, latest.time))
            place = in_root(values[:3], pose)
            if np.linalg.norm(place) < _FARTHEST:
                self.ball = Ball(place, latest.at)
        self._looked = latest.time
        return self.ball

    def forget(self) -> None:
        """Forget the ball: only pictures that come from now on count."""
        self.ball = None
        latest = self._reader.latest
        self._looked = -np.inf if latest is None else latest.time

    def close(self) -> None:
        """Close the port."""
        self._reader.close()
