"""Safety classes of tests: what the robot may do while a test runs."""

from __future__ import annotations

from enum import IntEnum


class Safety(IntEnum):
    """The safety classes in increasing order of risk. On a real robot all above ``STILL`` need permission."""

    STILL = 0  # it only reads
    MOTION = 1  # joints move under position control, within their limits
    EFFORT = 2  # motors are driven by torque, current or duty cycle, or joints are compliant
    FAULT = 3  # joints are driven into faults, against limits, or without power

    @property
    def word(self) -> str:
        """The name in lower case, for tables."""
        return self.name.lower()
