"""The errors of robot models."""

from __future__ import annotations

from rtf.robot.errors import ConfigurationError, RobotError


class RobotModelError(ConfigurationError):
    """A robot that cannot be found, read or built. The message begins with the file, and the line where it is known."""


class MissingPackageError(RobotError, ImportError):
    """An optional package, such as the physics engine or a robot's description, is not installed."""
