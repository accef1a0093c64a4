"""Which bus a device is on, as a configuration says it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_string
from rtf.robot.parameters import count, group_of, positive, wrong

if TYPE_CHECKING:
    from rtf.bottle import Property

#: Bit/s of the iCub's buses, and the greatest of any classical one.
BITRATE, MOST_BITS = 1_000_000, 1_000_000
#: Frames that may wait to be sent, and for how many seconds, unless a configuration says otherwise.
QUEUE, TRANSMIT_TIMEOUT = 500, 0.1
_MOST_QUEUED = 100_000


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
    """Return the bus of a configuration with a group ``CAN``.

    ``interface`` and ``channel`` are those of python-can, such as ``socketcan`` and ``can0``; ``bitrate`` is in bit/s.
    ``CanTxQueue`` is how many frames may wait to be sent, ``CanTxTimeout`` for how many milliseconds. A group
    ``OPTIONS`` inside has what else the interface needs. Raises ConfigurationError.
    """
    group = group_of(configuration, "CAN")
    interface, channel = (as_string(group.find(key)) for key in ("interface", "channel"))
    if not interface or not channel:
        missing = "channel" if interface else "interface"
        raise wrong(configuration, "CAN", f"{missing} is missing; write such as interface socketcan, channel can0")
    return BusSettings(
        interface,
        channel,
        count(group, "bitrate", BITRATE, MOST_BITS),
        count(group, "CanTxQueue", QUEUE, _MOST_QUEUED),
        positive(group, "CanTxTimeout", TRANSMIT_TIMEOUT * 1e3) * 1e-3,
        tuple(_options(group)),
    )


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
