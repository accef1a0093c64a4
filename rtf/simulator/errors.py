"""Errors of the simulator before it runs."""

from __future__ import annotations

from rtf.errors import RtfError


class SimulatorError(RtfError):
    """Base class of the simulator's errors."""


class RenderingError(SimulatorError, RuntimeError):
    """The machine has no working back-end for rendering."""
