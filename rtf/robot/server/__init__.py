"""Servers: they put a device on the network."""
