"""Faults of the simulated robot: each a small object in its layer, put in and taken out at run time.

``base`` says what a fault is, ``kinds`` finds them by name, ``injection`` puts them in at their time; the other modules
are the layers. ``catalogue`` writes them down.
"""

from rtf.simulator.faults import catalogue
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target
from rtf.simulator.faults.injection import ActiveFault, FaultInjector
from rtf.simulator.faults.kinds import KINDS, find_kind

__all__ = ["KINDS", "ActiveFault", "Fault", "FaultInjector", "Layer", "Parameter", "Target", "catalogue", "find_kind"]
