"""Port monitors: scripts that accept, change or drop messages of a connection, and arbitrate between connections."""

from rtf.middleware.monitors.monitor import MonitoredMessage, PortMonitor, SettingsMonitor

__all__ = ["MonitoredMessage", "PortMonitor", "SettingsMonitor"]
