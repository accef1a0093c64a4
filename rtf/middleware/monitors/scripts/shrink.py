"""Makes pictures smaller: ``+by.4`` leaves every fourth pixel of every fourth row."""

from __future__ import annotations

from rtf.bottle import Bottle, Property, as_int
from rtf.middleware.monitors import MonitoredMessage, SettingsMonitor
from rtf.middleware.types import IMAGE, Image


class Monitor(SettingsMonitor):
    """The setting ``by`` is a whole number."""

    by = 2

    def setparam(self, settings: Bottle) -> None:
        self.by = as_int(settings.find("by")) if settings.check("by") else self.by
        if self.by < 1:
            raise ValueError(f"a picture cannot be shrunk by {self.by}")

    def getparam(self) -> Property:
        return Property({"by": self.by})

    def update(self, message: MonitoredMessage) -> object:
        image = message.read(IMAGE)
        return Image(image.pixels[:: self.by, :: self.by].copy(), image.format)
