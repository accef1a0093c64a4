"""Base classes and tools for tests of robots: guarded and recorded parts, joint routines, statistics.

A test derives from :class:`RobotTest`. It declares its :class:`Safety` class and opens parts; each part of a test that
moves the robot has a guard that watches it and restores it afterwards, with any result of the test. The package
connects the xUnit core, which does not know robots, with the robot layer, which does not know tests.
"""

from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.safety import Safety
from rtf.robot_testing.guard.snapshot import Snapshot
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.judging.statistics import Fit, Periods, confidence, delay_between, fit_line, periods_of
from rtf.robot_testing.motion.part import Arrival, Part
from rtf.robot_testing.motion.trace import Trace
from rtf.robot_testing.robot_test import RobotTest

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
