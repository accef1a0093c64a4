"""Sets an event with each message: ``+name.e_reflex+ms.2000`` for two seconds; without ``ms`` for ever."""

from __future__ import annotations

from rtf.bottle import Bottle, Property, as_float, as_string
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor


class Monitor(SettingsMonitor):
    """Of the settings, ``name`` is that of the event, and ``ms`` its lifetime."""

    name = ""
    lifetime: float | None = None

    def setparam(self, settings: Bottle) -> None:
        self.name = as_string(settings.find("name")) if settings.check("name") else self.name
        self.lifetime = as_float(settings.find("ms")) / 1000.0 if settings.check("ms") else self.lifetime
        if not self.name:
            raise ValueError("an event has a name, as in name.e_reflex")

    def getparam(self) -> Property:
        return Property({"name": self.name, "ms": -1.0 if self.lifetime is None else 1000.0 * self.lifetime})

    def accept(self, message: MonitoredMessage) -> bool:
        del message
        self.set_event(self.name, self.lifetime)
        return True
