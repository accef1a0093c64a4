"""A robot of the network on topics of ROS 2: states of its parts, pictures, forces, and the time of a simulation.

It publishes only. Whoever commands a robot does so through its boards.
"""

from __future__ import annotations

import math
import threading
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, as_float, as_int
from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.types import IMAGE
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo, IEncoders, ITorqueControl, JointType
from rtf.ros2.errors import Ros2Error
from rtf.ros2.messages import Clock, Header, Image, JointState, Time, Vector3, Wrench, WrenchStamped

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.device import Device
    from rtf.robot.interfaces import FloatArray
    from rtf.ros2.node import Node

#: Pixel formats of YARP, and their encodings in ROS.
_ENCODINGS = {"rgb": "rgb8", "bgr": "bgr8", "rgba": "rgba8", "mono": "mono8", "mono16": "mono16", "flt1": "32FC1"}
_WRENCH = 6


class PartStates:
    """The state of a board as joint states: rad and rad/s of what turns, m and m/s of what slides."""

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

    def newest(self) -> JointState | None:
        """Return the state, or None if it is still the last one. Raises RobotError, also for a state that is old."""
        positions, times = self._encoders.encoders(), self._encoders.encoder_times()
        stamp = float(times.max())
        if stamp <= self._last:
            return None
        self._last = stamp
        speeds = self._encoders.encoder_speeds()
        efforts = [] if self._torques is None else self._torques().tolist()
        return JointState(
            Header(Time.of(stamp), ""),
            self._names,
            (positions * self._units).tolist(),
            (speeds * self._units).tolist(),
            efforts,
        )


class RobotBridge:
    """Publishes a robot of ``network`` on topics of ``node`` until it is closed. States have the ``rate`` in Hz."""

    def __init__(self, node: Node, network: Network, *, rate: float = 100.0) -> None:
        if not 0 < rate <= 1000:  # noqa: PLR2004 - boards run at 1 kHz
            raise Ros2Error(f"a rate is above 0 and up to 1000 Hz, not {rate:g}")
        self._node = node
        self._network = network
        self._period = 1.0 / rate
        self._parts: dict[str, PartStates] = {}
        self._opened = ExitStack()
        self._over = threading.Event()
        self._told: set[str] = set()
        self._states = node.publisher("joint_states", JointState)
        self._clock = node.publisher("/clock", Clock) if not isinstance(clock.current(), clock.SystemClock) else None
        self._thread = threading.Thread(target=self._run, name="rtf-ros2", daemon=True)

    def add_part(self, name: str, board: Device) -> None:
        """Publish the state of a board, on ``joint_states``. Raises RobotError."""
        self._parts[name] = PartStates(board)

    def add_camera(self, source: str, topic: str) -> None:
        """Publish the pictures of a port. Raises MiddlewareError, Ros2Error."""
        publisher = self._node.publisher(topic, Image)

        def pass_on(message: IncomingMessage) -> None:
            image = message.read(IMAGE)
            encoding = _ENCODINGS.get(str(image.format.code))
            if encoding is None:
                self._tell(f"{source}: ROS has no encoding for pictures {image.format.code}")
                return
            pixels = np.ascontiguousarray(image.pixels)
            height, width = pixels.shape[:2]
            step, data = pixels.nbytes // max(height, 1), pixels.tobytes()
            publisher.publish(Image(_header(message, topic), height, width, encoding, 0, step, data))

        self._listen(source, topic, pass_on)

    def add_wrench(self, source: str, topic: str) -> None:
        """Publish the forces and torques of a port of an analogue sensor: six numbers. Raises as above."""
        publisher = self._node.publisher(topic, WrenchStamped)

        def pass_on(message: IncomingMessage) -> None:
            values = [as_float(value) for value in message.read()]
            if len(values) != _WRENCH:
                self._tell(f"{source}: {len(values)} numbers are no force and torque")
                return
            wrench = Wrench(Vector3(*values[:3]), Vector3(*values[3:]))
            publisher.publish(WrenchStamped(_header(message, topic), wrench))

        self._listen(source, topic, pass_on)

    def start(self) -> None:
        """Begin to publish states."""
        self._thread.start()

    def close(self) -> None:
        """End. A second call has no effect."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        self._opened.close()

    def _listen(self, source: str, topic: str, pass_on: Callable[[IncomingMessage], None]) -> None:
        def guarded(message: IncomingMessage) -> None:
            try:
                pass_on(message)
            except Ros2Error as error:
                self._tell(str(error))

        name = f"/ros2/{self._node.name}/{topic.strip('/')}"
        port = self._opened.enter_context(Port(name, guarded, network=self._network, outputs=False))
        remote.connect(self._network, Contact(source), Contact(port.name), "tcp")

    def _run(self) -> None:
        """Publish each new state, and the time."""
        due = clock.current().now()
        while not self._over.is_set():
            now = clock.current().now()
            if self._clock is not None:
                self._publish("/clock", partial(self._clock.publish, Clock(Time.of(now))))
            for name, part in self._parts.items():
                self._publish(name, partial(self._publish_state, part))
            due = max(due + self._period, now)
            clock.current().sleep(max(due - clock.current().now(), 0.0))

    def _publish_state(self, part: PartStates) -> None:
        state = part.newest()
        if state is not None:
            self._states.publish(state)

    def _publish(self, what: str, work: Callable[[], None]) -> None:
        """Do something whose error is told once, until it works again."""
        try:
            work()
            self._told.discard(what)
        except RtfError as error:
            if what not in self._told:
                self._told.add(what)
                self._network.report(f"{what} is not published: {error}")

    def _tell(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._network.report(text)


def _header(message: IncomingMessage, topic: str) -> Header:
    """Return the header of a message: its stamp, else the time of its arrival, and the topic's folder as the frame."""
    stamp = Bottle.parse(message.envelope)
    sent = as_float(stamp[1]) if len(stamp) > 1 and as_int(stamp[0]) >= 0 else clock.current().now()
    return Header(Time.of(sent), topic.strip("/").rpartition("/")[0] or topic.strip("/"))
