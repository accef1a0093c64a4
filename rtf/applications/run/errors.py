"""The errors of running programs on a node."""

from __future__ import annotations

from rtf.errors import RtfError


class RunError(RtfError):
    """Something that a node was asked for cannot be done. The message names the node or the program, and what to do."""


class RequestError(RunError, ValueError):
    """A message that is no request."""


class StartError(RunError, OSError):
    """A program cannot be started. The message is the reason alone, as in ``No such file or directory``."""


class NodeError(RunError, ConnectionError):
    """A node does not answer, or not as a node does."""
