"""What goes wrong with robots."""

from __future__ import annotations

from rtf.errors import RtfError


class RobotError(RtfError):
    """Base of what goes wrong with a device. The sentence names the device, the joint and the hint."""


class RefusedError(RobotError, ValueError):
    """The device does not do what it was asked: a joint it does not have, a mode that is not allowed, a bad value."""


class NotSupportedError(RobotError, NotImplementedError):
    """The device does not have the interface, or not this part of it."""


class StaleStateError(RobotError, TimeoutError):
    """The last state that came is too old to be acted upon, or none has come yet."""


class NoAnswerError(RobotError, ConnectionError):
    """The device at the other end of the network does not answer, or answers what makes no sense."""


class UnreachableError(NoAnswerError):
    """The device at the other end of the network is gone, and could not be connected to again."""


class DeviceError(RobotError, RuntimeError):
    """A device cannot be opened, or an action of it failed."""


class ConfigurationError(RobotError, ValueError):
    """A configuration says what cannot be; the sentence begins with the place."""
