"""Clocks of a network: time that a port publishes, and lockstep with a simulator."""
