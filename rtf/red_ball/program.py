"""The programs of the demonstration: how they find the robot, and what they open."""

from __future__ import annotations

import os
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Property
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, clock_from_environment
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.red_ball.demo import TRACKER, Demo
from rtf.red_ball.eyes import cameras_of
from rtf.red_ball.history import Positions
from rtf.red_ball.tracker import Tracker
from rtf.robot.boards.client import connect
from rtf.robot.interface.network_program import PATIENCE, await_ports
from rtf.robot.sensors.camera import FrameGrabberClient
from rtf.simulator.scene import BALL_RADIUS

if TYPE_CHECKING:
    import threading
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.red_ball.demo import DemoSettings
    from rtf.robot.model import RobotModel

#: The carrier of pictures and states: it waits until a message has been received.
CARRIER = "tcp"


def in_lockstep() -> bool:
    """Return whether this process lives in the time of a simulator that waits for it."""
    return os.environ.get(CLOCK_VARIABLE, "").startswith("lockstep:")


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """The settings of the tracker. ``robot`` is the beginning of the names of the robot's ports."""

    model: RobotModel
    robot: str = "icubSim"
    name: str = TRACKER
    radius: float = BALL_RADIUS  # m
    field_of_view: float = 0.0  # vertical, deg; 0: ask the left camera
    one_eye: bool = False
    patience: float = PATIENCE  # how long it waits for the robot (s)


def start_demo(settings: DemoSettings, network: Network, opened: ExitStack) -> Callable[[threading.Event], object]:
    """Open the demonstration, in the time of the robot; return its loop. Raises RtfError."""
    hands = (f"/{settings.robot}/cartesianController/{side}_arm/state:o" for side in settings.sides)
    tracker = [f"{settings.tracker}/data:o"] if settings.tracker else []
    await_ports([f"{settings.gaze}/rpc", *hands, *tracker], network, settings.patience)
    opened.enter_context(clock.use(clock_from_environment(network)))
    return opened.enter_context(closing(Demo(settings, network=network))).run


def start_tracker(settings: TrackerSettings, network: Network, opened: ExitStack) -> Tracker:
    """Open the tracker, and connect it to the eyes and the head of a robot. Raises RtfError."""
    tables = settings.model.sensors.cameras
    eyes = {name: f"/{settings.robot}/{tables[name].port}" for name in ("left", "right") if name in tables}
    await_ports([*eyes.values(), f"/{settings.robot}/head/stateExt:o"], network, settings.patience)
    view = settings.field_of_view or _field_of_view(eyes["left"], network)
    cameras = head = None
    if not settings.one_eye:
        cameras = cameras_of(settings.model)
        board = opened.enter_context(connect(f"/{settings.robot}/head", carrier=CARRIER, network=network))
        head = Positions(board)
    tracker = opened.enter_context(
        closing(
            Tracker(
                settings.name,
                network=network,
                radius=settings.radius,
                field_of_view=view,
                cameras=cameras,
                head=head,
                acknowledged=in_lockstep(),
            )
        )
    )
    if not settings.one_eye:  # first, so that the first picture of the left eye finds its pair
        remote.connect(network, Contact(eyes["right"]), Contact(tracker.right.name), CARRIER)
    remote.connect(network, Contact(eyes["left"]), Contact(tracker.left.name), CARRIER)
    return tracker


def _field_of_view(port: str, network: Network) -> float:
    """Ask a camera for its vertical field of view (deg). Raises RtfError."""
    with closing(FrameGrabberClient("optics", network=network)) as camera:
        camera.open(Property({"remote": port, "no_stream": True}))
        return camera.field_of_view()[1]
