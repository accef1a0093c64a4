"""The errors of topics."""

from __future__ import annotations

from rtf.errors import RtfError


class Ros2Error(RtfError):
    """A topic, a node or a setting that cannot be used. The message says how to mend it."""


class MissingPackageError(Ros2Error, ImportError):
    """The package of the DDS is not installed."""
