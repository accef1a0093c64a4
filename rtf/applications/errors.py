"""The errors of applications."""

from __future__ import annotations

from rtf.errors import RtfError


class ApplicationError(RtfError):
    """Something that was asked for an application cannot be done. The message names it, and what to do."""


class DeployerError(ApplicationError, OSError):
    """A module cannot be started, or asked after, where it belongs."""


class TakenError(ApplicationError):
    """Another manager of this machine, the process ``pid``, runs the application."""

    def __init__(self, pid: int) -> None:
        super().__init__(f"the application is run by process {pid}; 'rtf app stop' stops it")
        self.pid = pid
