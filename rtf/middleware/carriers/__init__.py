"""Carriers: the transports of a message from one port to another."""
