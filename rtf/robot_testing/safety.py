"""How dangerous a test is: what a robot may do while it runs."""

from __future__ import annotations

from enum import IntEnum


class Safety(IntEnum):
    """The classes, from harmless on. On a real robot all above ``STILL`` need permission and an operator."""

    STILL = 0  # it only listens and asks
    MOTION = 1  # joints move under position control, within their limits
    EFFORT = 2  # motors are driven by torque, current or duty cycle, or joints are compliant
    FAULT = 3  # joints are driven into faults, against limits, or without power

    @property
    def word(self) -> str:
        """The word for lists."""
        return self.name.lower()
