"""A part of the simulated robot as a device: the interfaces of a control board over some of the boards' axes."""

from rtf.simulator.part.device import SimulatedPart

__all__ = ["SimulatedPart"]
