"""A robot of the network as ROS describes robots: states of joints, pictures and forces, in SI units.

The classes are those of neither ROS 1 nor ROS 2, whose messages differ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, as_float, as_int
from rtf.middleware.types import IMAGE
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo, IEncoders, ITorqueControl, JointType
from rtf.ros.errors import RosError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.types import Image
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.device import Device
    from rtf.robot.interfaces import FloatArray

#: Pixel formats of YARP, and their encodings in ROS.
_ENCODINGS = {"rgb": "rgb8", "bgr": "bgr8", "rgba": "rgba8", "mono": "mono8", "mo16": "mono16", "dec": "32FC1"}
_WRENCH, _INERTIAL = 6, 12


@dataclass(frozen=True, slots=True)
class JointStates:
    """States of joints at a time (s): rad, rad/s, Nm; m, m/s, N of what slides. Efforts may be empty."""

    time: float
    names: list[str]
    positions: FloatArray
    speeds: FloatArray
    efforts: FloatArray


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of a time (s), with an encoding of ROS; ``step`` is the length of a row in bytes."""

    time: float
    frame: str
    height: int
    width: int
    encoding: str
    step: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Force:
    """A force (N) and a torque (Nm) of a time (s): six numbers."""

    time: float
    frame: str
    values: list[float]


@dataclass(frozen=True, slots=True)
class Inertia:
    """What an inertial unit measures at a time (s): a unit quaternion x, y, z, w; rad/s; m/s²."""

    time: float
    frame: str
    orientation: list[float]
    speed: list[float]
    acceleration: list[float]


class PartStates:
    """The state of a board as joint states."""

    def __init__(self, board: Device) -> None:
        """Ask the board for its axes. Raises RobotError."""
        axes = board.view(IAxisInfo)  # type: ignore[type-abstract]  # it is only looked for
        self._names = list(axes.axis_names())
        turns = [axes.joint_type(joint) is not JointType.PRISMATIC for joint in range(axes.axes())]
        self._units = np.where(turns, math.pi / 180.0, 1.0)
        self._encoders = board.view(IEncoders)  # type: ignore[type-abstract]  # it is only looked for
        self._torques: Callable[[], FloatArray] | None = None
        try:
            torques = board.view(ITorqueControl)  # type: ignore[type-abstract]  # it is only looked for
            torques.torques()
            self._torques = torques.torques
        except NotSupportedError:
            pass  # a board without torques: efforts are empty, as ROS says it
        self._last = -math.inf

    def newest(self, least: float = 0.0) -> JointStates | None:
        """Return the state; None if it is that of before, or at most ``least`` seconds younger.

        Raises RobotError, also for a state that is old.
        """
        stamp = float(self._encoders.encoder_times().max())
        if stamp <= self._last + least:
            return None
        positions = self._encoders.encoders()
        self._last = stamp
        speeds = self._encoders.encoder_speeds()
        efforts = np.zeros(0) if self._torques is None else self._torques()
        return JointStates(stamp, self._names, positions * self._units, speeds * self._units, efforts)


def picture_of(message: IncomingMessage, source: str, frame: str) -> Picture:
    """Return the picture that a port of pictures has sent. Raises MiddlewareError, RosError."""
    return picture_from(message.read(IMAGE), _time_of(message), source, frame)


def picture_from(image: Image, time: float, source: str, frame: str) -> Picture:
    """Return a picture for ROS. Raises RosError."""
    encoding = _ENCODINGS.get(str(image.format.code))
    if encoding is None:
        raise RosError(f"{source}: ROS has no encoding for pictures {image.format.code}")
    pixels = np.ascontiguousarray(image.pixels)
    height, width = pixels.shape[:2]
    step = pixels.nbytes // max(height, 1)
    return Picture(time, frame, height, width, encoding, step, pixels.tobytes())


def force_of(message: IncomingMessage, source: str, frame: str) -> Force:
    """Return the force that a port of an analogue sensor has sent: six numbers. Raises as above."""
    values = [as_float(value) for value in message.read()]
    if len(values) != _WRENCH:
        raise RosError(f"{source}: {len(values)} numbers are no force and torque")
    return Force(_time_of(message), frame, values)


def inertia_of(message: IncomingMessage, source: str, frame: str) -> Inertia:
    """Return what a port ``inertial`` has sent: twelve numbers, in the order of YARP's. Raises as above."""
    values = [as_float(value) for value in message.read()]
    if len(values) != _INERTIAL:
        raise RosError(f"{source}: {len(values)} numbers are no orientation, acceleration, speed and magnetic field")
    turn = quaternion_of(*values[:3])
    return Inertia(_time_of(message), frame, turn, np.radians(values[6:9]).tolist(), values[3:6])


def quaternion_of(roll: float, pitch: float, yaw: float) -> list[float]:
    """Return the quaternion x, y, z, w of angles in deg: about x, then about y, then about z, as fixed axes."""
    (r, p, y), (a, b, c) = (
        [function(math.radians(angle) / 2) for angle in (roll, pitch, yaw)] for function in (math.sin, math.cos)
    )
    return [
        r * b * c - a * p * y,
        a * p * c + r * b * y,
        a * b * y - r * p * c,
        a * b * c + r * p * y,
    ]


def _time_of(message: IncomingMessage) -> float:
    """Return the stamp of a message, else the time of its arrival."""
    stamp = Bottle.parse(message.envelope)
    return as_float(stamp[1]) if len(stamp) > 1 and as_int(stamp[0]) >= 0 else clock.current().now()
