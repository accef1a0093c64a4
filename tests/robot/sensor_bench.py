"""Sensors and a clock that tests control, and readers of streams."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.clock import Clock
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorReading, SensorStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.sensors.measurements import Measurements


def connect(network: Network, source: str, target: str) -> None:
    """Connect two ports, as a user would."""
    remote.connect(network, Contact(source), Contact(target), "tcp")


class ManualClock(Clock):
    """A clock that is set by the test."""

    def __init__(self, time: float = 100.0) -> None:
        self.time = time

    def now(self) -> float:
        """See Clock."""
        return self.time

    def sleep(self, seconds: float) -> None:
        """See Clock; the time goes on at once."""
        self.time += seconds


class ScriptedSensors(IMultipleAnalogSensors):
    """Sensors whose readings, status and errors are set by the test."""

    def __init__(self, measurements: Measurements | None = None) -> None:
        self.measurements = measurements or [[], [], [], [], [SensorReading(np.array([36.6]), 1.0)]]
        self.status = SensorStatus.OK
        self.failure: Exception | None = None

    def sensors(self, category: SensorCategory) -> Sequence[SensorInfo]:
        """See IMultipleAnalogSensors."""
        count = len(self.measurements[category]) if category < len(self.measurements) else 0
        return [SensorInfo(f"s{index}", "frame") for index in range(count)]

    def sensor_status(self, category: SensorCategory, index: int) -> SensorStatus:
        """See IMultipleAnalogSensors."""
        return self.status

    def read_sensor(self, category: SensorCategory, index: int) -> SensorReading:
        """See IMultipleAnalogSensors."""
        if self.failure is not None:
            raise self.failure
        try:
            return self.measurements[category][index]
        except IndexError:
            raise RefusedError(f"there is no {category.name} {index}") from None
