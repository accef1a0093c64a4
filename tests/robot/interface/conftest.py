"""Robots of scripted devices in this process; the fixtures check that they leave no thread and no descriptor."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest

import scripted_devices
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot import device
from rtf.robot.interface.device_thread import Patience
from rtf.robot.interface.robot_interface import Outcome, RobotInterface
from rtf.robot.interface.robot_reader import ReadResult, read_robot
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


@pytest.fixture
def network() -> Iterator[Network]:
    """A network of this process; it must leave no thread and no descriptor."""
    threads, descriptors = set(threading.enumerate()), open_descriptors()
    yield Network(LocalNames())
    scripted_devices.let_go()
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")


#: Short timeouts for robots with a device that hangs; all others have timeouts for a busy machine.
_SHORT = Patience(open=3.0, close=3.0, action=3.0, move=20.0, abort=3.0, grace=3.0, hurry=3.0)
_LONG = Patience(open=30.0, close=30.0, action=30.0, move=30.0, abort=30.0, grace=30.0, hurry=30.0)


class Bench:
    """Runs robots of scripted devices: ``logged`` has the robots' log messages, ``calls`` the calls of the devices."""

    #: Other timeouts than those for robots with such devices.
    patience: Patience | None = None

    def __init__(self, folder: Path, network: Network) -> None:
        self.folder = folder
        self.network = network
        self.logged: list[tuple[str, str]] = []
        self.calls = scripted_devices.CALLS

    def read(self, inside: str, attributes: str = 'build="1" portprefix="/bot"', **given: object) -> ReadResult:
        """Read a robot whose file has these elements in ``<robot>``."""
        path = self.folder / "robot.xml"
        path.write_text(scripted_devices.robot_xml(inside, attributes), encoding="utf-8")
        return read_robot(path, Property(given))

    def make(self, inside: str, *, autoclose: bool = False, attributes: str = 'build="1"') -> RobotInterface:
        """Return a robot with these elements, ready to be run."""
        hangs = any(word in inside for word in ("hang", "deaf"))
        return RobotInterface(
            self.read(inside, attributes).robot,
            network=self.network,
            patience=self.patience or (_SHORT if hangs else _LONG),
            log=lambda level, sentence: self.logged.append((str(level), sentence)),
            autoclose=autoclose,
        )

    def run(self, inside: str, attributes: str = 'build="1"') -> Outcome:
        """Run a robot until it is ready, close it, and return the outcome."""
        return self.make(inside, autoclose=True, attributes=attributes).run()

    def errors(self) -> list[str]:
        """The log messages of the level ERROR."""
        return [sentence for level, sentence in self.logged if level == "ERROR"]


@pytest.fixture
def bench(tmp_path: Path, network: Network, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A bench, with the types of the scripted devices in the table of devices."""
    monkeypatch.setattr(device, "SHIPPED", {**device.SHIPPED, **scripted_devices.SHIPPED})
    scripted_devices.begin()
    return Bench(tmp_path, network)


class Running:
    """A robot that runs in a thread of its own."""

    def __init__(self, interface: RobotInterface) -> None:
        self.interface = interface
        self.outcome: Outcome | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        self.outcome = self.interface.run()

    def end(self) -> Outcome:
        """Wait until the robot has ended, and return the outcome."""
        self._thread.join(30)
        assert self.outcome is not None
        return self.outcome


@pytest.fixture
def started() -> Iterator[Callable[[RobotInterface], Running]]:
    """Return a function that runs a robot in a thread; the robots are interrupted after the test."""
    running: list[Running] = []

    def start(interface: RobotInterface) -> Running:
        running.append(Running(interface))
        return running[-1]

    yield start
    scripted_devices.let_go()
    for one in running:
        one.interface.interrupt()
        one.end()
