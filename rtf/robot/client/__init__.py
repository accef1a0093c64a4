"""Clients: devices that are served by another process."""
