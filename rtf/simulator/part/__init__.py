"""Parts of the simulated robot as control boards."""

from rtf.simulator.part.device import SimulatedPart

__all__ = ["SimulatedPart"]
