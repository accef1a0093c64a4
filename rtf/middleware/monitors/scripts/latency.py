"""Delays messages, for tests of what depends on them: ``+ms.20``, and ``+jitter.5`` ms more at most."""

from __future__ import annotations

import random

from rtf import clock
from rtf.bottle import Bottle, Property, as_float
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor

#: Longer delays would be taken for a script that hangs.
_MOST = 500.0


class Monitor(SettingsMonitor):
    """The settings ``ms`` and ``jitter`` are in ms; ``seed`` begins the random numbers."""

    ms = 10.0
    jitter = 0.0

    def setparam(self, settings: Bottle) -> None:
        self.ms = as_float(settings.find("ms")) if settings.check("ms") else self.ms
        self.jitter = as_float(settings.find("jitter")) if settings.check("jitter") else self.jitter
        if not 0 <= self.ms + max(self.jitter, 0.0) <= _MOST:
            raise ValueError(f"a latency is 0 to {_MOST:g} ms")
        self._random = random.Random(as_float(settings.find("seed")))  # noqa: S311 - for tests

    def getparam(self) -> Property:
        return Property({"ms": self.ms, "jitter": self.jitter})

    def accept(self, message: MonitoredMessage) -> bool:
        del message
        clock.sleep((self.ms + self._random.uniform(0.0, self.jitter)) / 1000.0)
        return True
