"""Which bus a device is on, as a configuration says it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_string, to_string
from rtf.robot.parameters import count, group_of, positive, wrong

if TYPE_CHECKING:
    from rtf.bottle import Property

#: The interfaces of buses in datagrams, one port a bus: that of python-can has a datagram for each frame, and ours one
#: for all that are sent at once. The group and the first port, unless others are chosen.
MULTICAST, DATAGRAMS = "udp_multicast", "datagrams"
GROUPS = frozenset({MULTICAST, DATAGRAMS})
MULTICAST_GROUP, MULTICAST_PORT = "239.74.163.2", 43113
#: The interface of the buses of a simulated robot in the same process.
SIMULATED = "simulated"
#: Bit/s of the iCub's buses, and the greatest of any classical one.
BITRATE, MOST_BITS = 1_000_000, 1_000_000
#: Frames that may wait to be sent, and for how many seconds, unless a configuration says otherwise.
QUEUE, TRANSMIT_TIMEOUT = 500, 0.1
_MOST_QUEUED, _MOST_PORT = 100_000, 65_000


@dataclass(frozen=True, slots=True)
class BusSettings:
    """A bus: the interface of python-can and its channel, and what its back-end needs beside them.

    Devices with the same interface and channel share a bus; buses of datagrams on one channel differ by the port.
    """

    interface: str
    channel: str
    bitrate: int = BITRATE
    queue: int = QUEUE
    transmit_timeout: float = TRANSMIT_TIMEOUT
    options: tuple[tuple[str, str | int | float | bool], ...] = ()

    @property
    def name(self) -> str:
        """The name of the bus, of which there is one in a process, such as ``socketcan can0``."""
        port = dict(self.options).get("port")
        return f"{self.interface} {self.channel}{'' if port is None else f':{port}'}"


def bus_settings(configuration: Property) -> BusSettings:
    """Return the bus of a configuration, in its group ``CAN`` if there is one.

    ``interface`` and ``channel`` are those of python-can, such as ``socketcan`` and ``can0``; ``bitrate`` is in bit/s.
    ``CanTxQueue`` is how many frames may wait to be sent, ``CanTxTimeout`` for how many milliseconds. A group
    ``OPTIONS`` inside has what else the interface needs.

    Files of real robots have the number of the bus instead, ``CanDeviceNum``. It stands for ``{}`` in the channel, and
    is added to ``port``, the first one of datagrams. Their interface and channel are those of the environment, as
    python-can has them (``CAN_INTERFACE``, ``CAN_CHANNEL``); without these ``socketcan`` and ``can{}``. The channel of
    a simulated bus is its name, ``busName``. Raises ConfigurationError.
    """
    group = group_of(configuration, "CAN") if configuration.check("CAN") else configuration
    number = _number(group)
    interface, channel = _interface(group, numbered=number is not None)
    if not interface or not channel:
        missing = "channel" if interface else "interface"
        raise wrong(configuration, "CAN", f"{missing} is missing; write such as interface socketcan, channel can0")
    options = dict(_options(group))
    if number is not None:
        channel = channel.replace("{}", str(number))
        if interface in GROUPS:
            options["port"] = count(group, "port", MULTICAST_PORT, _MOST_PORT) + number
    return BusSettings(
        interface,
        channel,
        count(group, "bitrate", BITRATE, MOST_BITS),
        count(group, "CanTxQueue", QUEUE, _MOST_QUEUED),
        positive(group, "CanTxTimeout", TRANSMIT_TIMEOUT * 1e3) * 1e-3,
        tuple(options.items()),
    )


def _number(group: Property) -> int | None:
    """Return the number of the bus, whose name may have capital letters or not; None without one."""
    key = next((key for key in group if key.lower() == "candevicenum"), None)
    value = None if key is None else group.find(key)
    if key is not None and (not isinstance(value, int) or value < 0):
        raise wrong(group, key, f"{to_string(value)} is not the number of a bus, from 0")
    return value  # type: ignore[return-value]  # None, or a number


def _interface(group: Property, *, numbered: bool) -> tuple[str, str]:
    """Return interface and channel, of the configuration or else, for a bus with a number, of the environment."""
    interface, channel = (as_string(group.get(key, "")) for key in ("interface", "channel"))
    if not numbered or (interface and channel):
        return interface, channel
    interface = interface or os.environ.get("CAN_INTERFACE", "socketcan")
    usual = {**dict.fromkeys(GROUPS, MULTICAST_GROUP), SIMULATED: as_string(group.get("busName", ""))}.get(interface)
    return interface, channel or usual or os.environ.get("CAN_CHANNEL", "can{}")


def _options(group: Property) -> list[tuple[str, str | int | float | bool]]:
    """Return the parameters for the interface alone."""
    options = group_of(group, "OPTIONS")
    found: list[tuple[str, str | int | float | bool]] = []
    for key in options:
        value = options.find(key)
        if value is None or isinstance(value, Bottle) or not isinstance(value, str | int | float | bool):
            raise wrong(options, key, "an option of an interface is a word, a number, or true or false")
        found.append((key, value))
    return found
