"""The errors of topics."""

from __future__ import annotations

from rtf.ros.errors import RosError


class Ros2Error(RosError):
    """A topic, a node or a setting that cannot be used. The message says how to correct it."""


class MissingPackageError(Ros2Error, ImportError):
    """The package of the DDS is not installed."""


class MalformedMessageError(Ros2Error, ValueError):
    """A message whose bytes cannot be read, or that has a value which cannot be sent."""


class NoServiceError(Ros2Error, TimeoutError):
    """A service that is not there, or has not answered in time."""


class DescriptionError(Ros2Error, ValueError):
    """A description of a robot that cannot be used. The message says where, and what is wrong."""
