"""Robots in this process, made of scripted devices; nothing of them is left afterwards."""

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
    """A network of this process; no thread and no descriptor of it is left."""
    threads, descriptors = set(threading.enumerate()), open_descriptors()
    yield Network(LocalNames())
    scripted_devices.let_go()
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")


#: For robots with a device that hangs, which is noticed soon; all others have the time of a busy machine.
_SHORT = Patience(open=1.0, close=1.0, action=1.0, move=20.0, abort=1.0, grace=1.0, hurry=1.0)
_LONG = Patience(open=30.0, close=30.0, action=30.0, move=30.0, abort=30.0, grace=30.0, hurry=30.0)


class Bench:
    """Runs robots. ``told`` is what they said, ``calls`` what was called of their devices."""

    #: Other timeouts than those for robots with such devices.
    patience: Patience | None = None

    def __init__(self, folder: Path, network: Network) -> None:
        self.folder = folder
        self.network = network
        self.told: list[tuple[str, str]] = []
        self.calls = scripted_devices.CALLS

    def read(self, inside: str, attributes: str = 'build="1" portprefix="/bot"', **given: object) -> ReadResult:
        """Read a robot with this inside."""
        path = self.folder / "robot.xml"
        path.write_text(scripted_devices.robot_xml(inside, attributes), encoding="utf-8")
        return read_robot(path, Property(given))

    def make(self, inside: str, *, autoclose: bool = False, attributes: str = 'build="1"') -> RobotInterface:
        """A robot that can be run."""
        hangs = any(word in inside for word in ("hang", "deaf"))
        return RobotInterface(
            self.read(inside, attributes).robot,
            network=self.network,
            patience=self.patience or (_SHORT if hangs else _LONG),
            log=lambda level, sentence: self.told.append((str(level), sentence)),
            autoclose=autoclose,
        )

    def run(self, inside: str, attributes: str = 'build="1"') -> Outcome:
        """Run a robot that ends as soon as it is ready."""
        return self.make(inside, autoclose=True, attributes=attributes).run()

    def errors(self) -> list[str]:
        """What was told as an error."""
        return [sentence for level, sentence in self.told if level == "ERROR"]


@pytest.fixture
def bench(tmp_path: Path, network: Network, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """Robots whose devices are scripted."""
    monkeypatch.setattr(device, "SHIPPED", {**device.SHIPPED, **scripted_devices.SHIPPED})
    scripted_devices.begin()
    return Bench(tmp_path, network)


class Running:
    """A robot that runs in a thread."""

    def __init__(self, interface: RobotInterface) -> None:
        self.interface = interface
        self.outcome: Outcome | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        self.outcome = self.interface.run()

    def end(self) -> Outcome:
        """Wait for its end."""
        self._thread.join(30)
        assert self.outcome is not None
        return self.outcome


@pytest.fixture
def started() -> Iterator[Callable[[RobotInterface], Running]]:
    """Runs robots in threads; they have ended afterwards."""
    running: list[Running] = []

    def start(interface: RobotInterface) -> Running:
        running.append(Running(interface))
        return running[-1]

    yield start
    scripted_devices.let_go()
    for one in running:
        one.interface.interrupt()
        one.end()
