"""Devices that do what their configuration says: work, fail, throw, hang; and the folder by which a program finds them.

The parameter called like a method says what it does: ``fail`` (DeviceError), ``throw`` (ValueError), ``exit``
(SystemExit), ``hang`` (until ``let_go``), ``wait`` (until it is aborted), ``deaf`` (hangs, whatever it is told),
``crash`` (takes the process with it). What is called is noted in ``CALLS``, and in the file ``log`` if there is one.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import to_string
from rtf.robot.device import Calibrator, Device
from rtf.robot.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.bottle import Property

CALLS: list[str] = []
_released = threading.Event()

SHIPPED = {
    "scripted": "scripted_devices:Scripted",
    "scriptedCalibrator": "scripted_devices:ScriptedCalibrator",
    "scriptedBoard": "scripted_devices:ScriptedBoard",
    "robotDescription_nws_yarp": "scripted_devices:ScriptedBoard",
    "plain": "scripted_devices:Plain",
    "notADevice": "scripted_devices:let_go",
    "notThere": "scripted_devices:Missing",
}


def let_go() -> None:
    """End the wait of every method that hangs."""
    _released.set()


def begin() -> None:
    """Clear the recorded calls; methods that hang from now on do not return."""
    CALLS.clear()
    _released.clear()


class Plain(Device):
    """A device without optional interfaces."""

    def open(self, configuration: Property) -> None:
        """See Device."""

    def close(self) -> None:
        """See Device."""


class Scripted(Device):
    """A device with optional interfaces."""

    configuration: Property | None = None

    def _do(self, what: str, *more: object) -> None:
        words = " ".join(map(str, (self.name, what, *more)))
        CALLS.append(words)
        assert self.configuration is not None
        log = self.configuration.find("log")
        if log is not None:
            with Path(to_string(log)).open("a", encoding="utf-8") as stream:
                stream.write(f"{words}\n")
        getattr(self, f"_{to_string(self.configuration.find(what)) or 'work'}")()

    def _work(self) -> None:
        """All is well."""

    def _fail(self) -> None:
        raise DeviceError("as it was told to")

    def _throw(self) -> None:
        raise ValueError("as it was told to")

    def _exit(self) -> None:
        sys.exit(7)

    def _hang(self) -> None:
        _released.wait()

    _deaf = _hang

    def _crash(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def open(self, configuration: Property) -> None:
        """See Device."""
        self.configuration = configuration
        self._do("open")

    def close(self) -> None:
        """See Device."""
        if self.configuration is not None:
            self._do("close")

    def attach(self, devices: Mapping[str, Device]) -> None:
        """See Device."""
        self._do("attach", *(f"{key}={device.name}" for key, device in devices.items()))

    def detach(self) -> None:
        """See Device."""
        self._do("detach")

    def custom(self, parameters: Property) -> None:
        """Called for ``custom``."""
        self._do("custom", parameters.to_text())

    def configure(self, parameters: Property) -> None:
        """Called for ``configure``."""
        self._do("configure", parameters.to_text())


class ScriptedBoard(Scripted):
    """A device that gets calibrators and descriptions."""

    def set_calibrator(self, calibrator: Calibrator) -> None:
        """Called before a calibration."""
        self._do("set_calibrator", calibrator.name)

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Report the description of the robot."""
        (description,) = devices.values()
        self._do("attach", description.name, *description.devices)


class ScriptedCalibrator(Scripted, Calibrator):
    """A calibrator; what waits ends when it is told to abort."""

    def __init__(self, name: str = "", **more: object) -> None:
        super().__init__(name, **more)
        self._aborted = threading.Event()

    def _wait(self) -> None:
        self._aborted.wait()
        raise DeviceError("aborted")

    def calibrate(self, target: Device) -> None:
        """See Calibrator."""
        self._aborted.clear()
        self._do("calibrate", target.name)

    def home(self, target: Device) -> None:
        """See Calibrator."""

    def park(self, target: Device) -> None:
        """See Calibrator."""
        self._aborted.clear()
        self._do("park", target.name)

    def abort(self) -> None:
        """See Calibrator."""
        self._do("abort")
        self._aborted.set()


def install(folder: Path) -> Path:
    """Return a folder that, on its path, makes a program find these devices as those of an installed package."""
    info = folder / "scripted_devices-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: scripted-devices\nVersion: 1.0\n")
    lines = "".join(f"{kind} = {home}\n" for kind, home in SHIPPED.items())
    (info / "entry_points.txt").write_text(f"[rtf.devices]\n{lines}")
    return folder


DOCTYPE = (
    '<?xml version="1.0" encoding="UTF-8" ?>\n'
    '<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN"'
    ' "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">\n'
)


def robot_xml(inside: str, attributes: str = 'build="1" portprefix="/bot"') -> str:
    """A robot's file with this inside."""
    return f'{DOCTYPE}<robot name="bot" {attributes} xmlns:xi="http://www.w3.org/2001/XInclude">\n{inside}\n</robot>\n'


def device_xml(name: str, kind: str = "scripted", inside: str = "", **parameters: str) -> str:
    """A device with parameters."""
    given = "".join(f'<param name="{key}">{value}</param>' for key, value in parameters.items())
    return f'<device name="{name}" type="{kind}">{given}{inside}</device>\n'


def action_xml(kind: str, phase: str = "startup", level: int = 1, **parameters: object) -> str:
    """An action with parameters."""
    given = "".join(f'<param name="{key}">{value}</param>' for key, value in parameters.items())
    return f'<action phase="{phase}" level="{level}" type="{kind}">{given}</action>'
