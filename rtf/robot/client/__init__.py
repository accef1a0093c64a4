"""Clients: devices at the other end of the network."""
