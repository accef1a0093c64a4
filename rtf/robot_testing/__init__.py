"""What tests of robots have in common: the robot and its time, parts that move and are recorded, the guard, statistics.

A test derives from :class:`RobotTest`; it says which parts it works with and how safe it is, and gets parts that are
guarded: whatever becomes of the test, they are put back as they were. This is the layer between the xUnit core, which
knows no robots, and the robot layer, which knows no tests.
"""

from rtf.robot_testing.case import RobotTest
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.guard import GuardError, Limits, MotionGuard
from rtf.robot_testing.part import Arrival, Part
from rtf.robot_testing.safety import Safety
from rtf.robot_testing.snapshot import Snapshot
from rtf.robot_testing.statistics import Fit, Periods, confidence, delay_between, fit_line, periods_of
from rtf.robot_testing.trace import Trace

__all__ = [
    "Arrival",
    "Fit",
    "GuardError",
    "Limits",
    "MotionGuard",
    "Part",
    "Periods",
    "RobotTest",
    "Safety",
    "Snapshot",
    "Trace",
    "confidence",
    "delay_between",
    "fit_line",
    "likely_causes",
    "periods_of",
]
