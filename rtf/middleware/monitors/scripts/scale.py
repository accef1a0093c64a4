"""Multiplies all numbers: ``+unit.deg_to_rad``, ``+unit.rad_to_deg``, or ``+milli.2500`` for a factor of 2.5."""

from __future__ import annotations

import math

from rtf.bottle import Bottle, Property, Value, as_float, as_string
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor

_UNITS = {
    "deg_to_rad": math.pi / 180.0,
    "rad_to_deg": 180.0 / math.pi,
    "m_to_mm": 1000.0,
    "mm_to_m": 0.001,
}


class Monitor(SettingsMonitor):
    """Of the settings, ``unit`` is a conversion by name, ``milli`` a factor in thousandths, ``factor`` one as it is."""

    factor = 1.0

    def setparam(self, settings: Bottle) -> None:
        if settings.check("unit"):
            self.factor = _UNITS[as_string(settings.find("unit"))]
        if settings.check("milli"):
            self.factor = as_float(settings.find("milli")) / 1000.0
        if settings.check("factor"):
            self.factor = as_float(settings.find("factor"))

    def getparam(self) -> Property:
        return Property({"factor": self.factor})

    def update(self, message: MonitoredMessage) -> object:
        return Bottle(self._scaled(value) for value in message.bottle)

    def _scaled(self, value: Value) -> Value:
        if isinstance(value, Bottle):
            return Bottle(self._scaled(one) for one in value)
        return value * self.factor if isinstance(value, (int, float)) else value
