"""The base of the errors of ROS."""

from __future__ import annotations

from rtf.errors import RtfError


class RosError(RtfError):
    """A topic, a node or a setting that cannot be used. The message says how to correct it."""
