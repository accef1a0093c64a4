"""Drops messages that are like the last one: no number differs by more than ``+milli.50``, here 0.05."""

from __future__ import annotations

from rtf.bottle import Bottle, Property, as_float
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor


class Monitor(SettingsMonitor):
    """The setting ``milli`` is in thousandths of what the numbers are in."""

    milli = 1.0
    _last: Bottle | None = None

    def setparam(self, settings: Bottle) -> None:
        self.milli = as_float(settings.find("milli")) if settings.check("milli") else self.milli

    def getparam(self) -> Property:
        return Property({"milli": self.milli})

    def accept(self, message: MonitoredMessage) -> bool:
        if self._last is not None and _alike(self._last, message.bottle, self.milli / 1000.0):
            return False
        self._last = message.bottle
        return True


def _alike(one: Bottle, other: Bottle, width: float) -> bool:
    if len(one) != len(other):
        return False
    for first, second in zip(one, other, strict=True):
        if isinstance(first, Bottle) and isinstance(second, Bottle):
            alike = _alike(first, second, width)
        elif isinstance(first, (int, float)) and isinstance(second, (int, float)):
            alike = abs(first - second) <= width
        else:
            alike = first == second
        if not alike:
            return False
    return True
