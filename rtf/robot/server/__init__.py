"""Servers: what puts a device on the network."""
