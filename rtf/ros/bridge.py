"""Publishes a robot of the network on topics: states of its parts, pictures, forces, and the time of a simulation.

It publishes only: a robot is commanded through its boards.
"""

from __future__ import annotations

import itertools
import threading
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from rtf.ros.errors import RosError
from rtf.ros.robot import PartStates, force_of, inertia_of, picture_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.device import Device
    from rtf.ros.topics import RobotTopics

T = TypeVar("T")
#: Looks at the states in the period of one message: with one, states of the same rate would be missed.
_LOOKS = 2
#: Parts of the period that are between two states of a part at least.
_SHORTEST = 0.75


class RobotBridge:
    """Publishes a robot of ``network`` on topics until it is closed. States have the ``rate`` in Hz.

    Its ports are ``PORTS/TOPIC``, such as ``/ros2/rtf/left/image_raw``.
    """

    def __init__(self, topics: RobotTopics, network: Network, *, ports: str, rate: float = 100.0) -> None:
        if not 0 < rate <= 1000:  # noqa: PLR2004 - boards run at 1 kHz
            raise RosError(f"a rate is above 0 and up to 1000 Hz, not {rate:g}")
        self._topics = topics
        self._network = network
        self._ports = ports
        self._period = 1.0 / rate
        self._parts: dict[str, PartStates] = {}
        self._opened = ExitStack()
        self._over = threading.Event()
        self._reported: set[str] = set()
        self._states = topics.joint_states("joint_states")
        self._clock = None if isinstance(clock.current(), clock.SystemClock) else topics.times("/clock")
        self._thread = threading.Thread(target=self._run, name="rtf-ros", daemon=True)

    def add_part(self, name: str, board: Device) -> None:
        """Publish the state of a board, on ``joint_states``. Raises RobotError."""
        self._parts[name] = PartStates(board)

    def add_camera(self, source: str, topic: str) -> None:
        """Publish the pictures of a port. Raises MiddlewareError, RosError."""
        self._listen(source, topic, picture_of, self._topics.pictures(topic))

    def add_wrench(self, source: str, topic: str) -> None:
        """Publish the forces and torques of a port of an analogue sensor: six numbers. Raises as above."""
        self._listen(source, topic, force_of, self._topics.forces(topic))

    def add_imu(self, source: str, topic: str) -> None:
        """Publish what a port of an inertial unit sends: twelve numbers. Raises as above."""
        self._listen(source, topic, inertia_of, self._topics.inertias(topic))

    def start(self) -> None:
        """Begin to publish states."""
        self._thread.start()

    def close(self) -> None:
        """End. A second call has no effect."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        self._opened.close()

    def _listen(
        self,
        source: str,
        topic: str,
        read: Callable[[IncomingMessage, str, str], T],
        publish: Callable[[T], object],
    ) -> None:
        """Publish what a port sends. The folder of the topic is the frame."""
        name = topic.strip("/")
        frame = name.rpartition("/")[0] or name

        def pass_on(message: IncomingMessage) -> None:
            try:
                publish(read(message, source, frame))
            except RosError as error:
                self._report_once(str(error))

        port = self._opened.enter_context(Port(f"{self._ports}/{name}", pass_on, network=self._network, outputs=False))
        remote.connect(self._network, Contact(source), Contact(port.name), "tcp")

    def _run(self) -> None:
        """Publish each new state, and the time."""
        due = clock.current().now()
        for look in itertools.count():
            if self._over.is_set():
                return
            now = clock.current().now()
            if self._clock is not None and look % _LOOKS == 0:
                self._publish("/clock", partial(self._clock, now))
            for name, part in self._parts.items():
                self._publish(name, partial(self._publish_state, part))
            due = max(due + self._period / _LOOKS, now)
            clock.current().sleep(max(due - clock.current().now(), 0.0))

    def _publish_state(self, part: PartStates) -> None:
        state = part.newest(_SHORTEST * self._period)
        if state is not None:
            self._states(state)

    def _publish(self, what: str, work: Callable[[], object]) -> None:
        """Do something whose error is reported once, until it works again."""
        try:
            work()
            self._reported.discard(what)
        except RtfError as error:
            if what not in self._reported:
                self._reported.add(what)
                self._network.report(f"{what} is not published: {error}")

    def _report_once(self, text: str) -> None:
        if text not in self._reported:
            self._reported.add(text)
            self._network.report(text)
