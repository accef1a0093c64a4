"""Loses messages, for tests of what depends on them: ``+percent.10``, always the same ones for a ``+seed.1``."""

from __future__ import annotations

import random

from rtf.bottle import Bottle, Property, as_float
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor


class Monitor(SettingsMonitor):
    """The setting ``percent`` is how many messages are lost on average."""

    percent = 10.0

    def setparam(self, settings: Bottle) -> None:
        self.percent = as_float(settings.find("percent")) if settings.check("percent") else self.percent
        if not 0 <= self.percent <= 100:  # noqa: PLR2004 - percent
            raise ValueError(f"{self.percent:g} percent cannot be lost")
        self._random = random.Random(as_float(settings.find("seed")))  # noqa: S311 - for tests

    def getparam(self) -> Property:
        return Property({"percent": self.percent})

    def accept(self, message: MonitoredMessage) -> bool:
        del message
        return self._random.uniform(0.0, 100.0) >= self.percent
