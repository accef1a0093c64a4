"""The programs of the demonstration: how they find the robot, and how they begin and end."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Property
from rtf.errors import RtfError
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, clock_from_environment
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.red_ball.demo import TRACKER, Demo
from rtf.red_ball.eyes import cameras_of
from rtf.red_ball.history import Positions
from rtf.red_ball.tracker import Tracker
from rtf.robot.boards.client import connect
from rtf.robot.errors import DeviceError
from rtf.robot.interface.signals import signal_listener
from rtf.robot.sensors.camera import FrameGrabberClient
from rtf.simulator.scene import BALL_RADIUS

if TYPE_CHECKING:
    import signal
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.red_ball.demo import DemoSettings
    from rtf.robot.model import RobotModel

FINE, FAILED = 0, 1
#: The carrier of pictures and states: it waits until a message has been received.
CARRIER = "tcp"
#: How long programs wait for the robot, by default, and between two looks (s).
PATIENCE, _LOOK = 20.0, 0.1


def say(sentence: str) -> None:
    """Print a sentence."""
    print(sentence, file=sys.stderr, flush=True)  # noqa: T201 - a program prints


def use_clock(name: str) -> None:
    """Have this process live by a clock, as if it were named in the environment: ``/clock``, or ``lockstep:/clock``."""
    if name:
        os.environ[CLOCK_VARIABLE] = name


def in_lockstep() -> bool:
    """Return whether this process lives in the time of a simulator that waits for it."""
    return os.environ.get(CLOCK_VARIABLE, "").startswith("lockstep:")


def await_ports(names: Sequence[str], network: Network, patience: float) -> None:
    """Wait for ports, as the robot may still be starting. Raises DeviceError with those that are missing."""
    deadline = clock.Deadline.after(patience)
    missing = list(names)
    while missing := [name for name in missing if not remote.exists(network, Contact(name))]:
        if deadline.expired:
            raise DeviceError(f"there is no {', '.join(missing)} after {patience:g} s; is it running?")
        clock.sleep(_LOOK)


def run_program(name: str, start: Callable[[ExitStack], Callable[[threading.Event], object] | None]) -> int:
    """Start a program, and run it until a signal ends it; return the exit code. For the main thread.

    ``start`` opens all that is closed at the end, and may return what is run until the event is set.
    """
    end = threading.Event()

    def on_signal(number: signal.Signals) -> None:
        say(f"{number.name}: ends")
        end.set()
        clock.current().close()  # in lockstep its time may never pass

    with signal_listener(on_signal), ExitStack() as opened:
        try:
            run = start(opened)
        except (RtfError, OSError) as error:
            say(f"FAILED: {name} could not be started: {error}")
            return FAILED
        say(f"READY {name}")
        try:
            (run or threading.Event.wait)(end)
        except (RtfError, OSError) as error:
            if not end.is_set():
                say(f"FAILED: {name}: {error}")
                return FAILED
    return FINE


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
