"""Faults of the simulated robot, which are injected and cleared at run time.

``base`` has the base classes, ``kinds`` finds a kind by its name, ``injection`` begins and ends faults at their times,
``catalogue`` formats the list of kinds. The other modules have the kinds, by layer.
"""

from rtf.simulator.faults import catalogue
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target
from rtf.simulator.faults.injection import ActiveFault, FaultInjector
from rtf.simulator.faults.kinds import KINDS, find_kind

__all__ = ["KINDS", "ActiveFault", "Fault", "FaultInjector", "Layer", "Parameter", "Target", "catalogue", "find_kind"]
