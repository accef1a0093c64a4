"""Drops messages that come too fast: ``+rate.10`` lets ten a second through."""

from __future__ import annotations

from rtf import clock
from rtf.bottle import Bottle, Property, as_float
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor


class Monitor(SettingsMonitor):
    """The setting ``rate`` is in Hz."""

    rate = 10.0
    _next = float("-inf")

    def setparam(self, settings: Bottle) -> None:
        rate = as_float(settings.find("rate")) if settings.check("rate") else self.rate
        if not rate > 0:
            raise ValueError(f"a rate is greater than 0 Hz, not {rate:g}")
        self.rate = rate

    def getparam(self) -> Property:
        return Property({"rate": self.rate})

    def accept(self, message: MonitoredMessage) -> bool:
        del message
        now = clock.current().now()
        if now < self._next:
            return False
        self._next = (
            max(self._next + 1.0 / self.rate, now) if self._next > now - 1.0 / self.rate else now + 1.0 / self.rate
        )
        return True
