"""The errors of robot devices."""

from __future__ import annotations

from rtf.errors import RtfError


class RobotError(RtfError):
    """Base class of device errors. The message names the device, the joint and a hint."""


class RefusedError(RobotError, ValueError):
    """The device refuses a request: a joint it does not have, a mode that is not allowed, an invalid value."""


class NotSupportedError(RobotError, NotImplementedError):
    """The device does not have the interface, or not this part of it."""


class StaleStateError(RobotError, TimeoutError):
    """The latest state is too old to be used, or none has arrived yet."""


class NoAnswerError(RobotError, ConnectionError):
    """The remote device does not answer, or its answer is invalid."""


class UnreachableError(NoAnswerError):
    """The remote device is gone, and reconnecting failed."""


class DeviceError(RobotError, RuntimeError):
    """A device cannot be opened, or an action of it failed."""


class BusError(DeviceError, ConnectionError):
    """A bus of boards is off, or does not take what is to be sent."""


class ConfigurationError(RobotError, ValueError):
    """A configuration is invalid. The message begins with the location."""


class MessageError(RobotError, ValueError):
    """A frame on a bus is no message of its protocol, or a value does not fit into a message."""
