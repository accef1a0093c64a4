"""Lets messages pass while the constraint of the connection holds: ``+constraint.not.e_reflex``."""

from __future__ import annotations

from rtf.bottle import Bottle, as_string
from rtf.middleware.monitors import PortMonitor


class Monitor(PortMonitor):
    """The setting ``constraint`` can be changed."""

    def setparam(self, settings: Bottle) -> None:
        if settings.check("constraint"):
            self.constraint = as_string(settings.find("constraint"))
