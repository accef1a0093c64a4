"""Campaigns: many runs of robot tests over robots, units, faults, severities and seeds, and what they teach.

``outcomes`` is what one run of one test came to. The engine makes outcomes; ``report`` evaluates them and runs nothing.
"""

from rtf.campaigns.outcomes import Measured, Outcome

__all__ = ["Measured", "Outcome"]
