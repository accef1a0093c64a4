"""The interfaces of python-can: how a bus is opened, and what differs from one interface to another."""

from __future__ import annotations

import errno
import os
import socket
from typing import TYPE_CHECKING, Any

from rtf.robot.devices.can.bus_settings import MULTICAST, MULTICAST_GROUP
from rtf.robot.errors import DeviceError

try:
    import can
except ImportError as error:
    raise DeviceError("a CAN bus needs the package python-can: pip install 'rtf[can]'") from error

if TYPE_CHECKING:
    from rtf.robot.devices.can.bus_settings import BusSettings

__all__ = ["ECHOING", "FILTERING", "can", "is_busy", "open_interface"]

#: The interfaces that filter by identifier in hardware or in the kernel; others would do it in Python.
FILTERING = frozenset({"socketcan", "kvaser", "vector", "systec", "etas"})
#: The interfaces that hand what was sent back to the sender.
ECHOING = frozenset({MULTICAST, "yarp"})
#: Interfaces besides those that python-can has: buses of other programs through the network, and in datagrams. Tools of
#: python-can find them by the entry points of this package.
can.interfaces.BACKENDS["datagrams"] = ("rtf.robot.devices.can.datagrams", "DatagramBus")
can.interfaces.BACKENDS["yarp"] = ("rtf.robot.boards.can_over_yarp", "YarpBus")
_LOOPBACK = "127.0.0.1"
#: What an interface says, in an error of ``send``, whose queue is full.
_BUSY = frozenset({errno.ENOBUFS, errno.EAGAIN})


def open_interface(settings: BusSettings) -> can.BusABC:
    """Return the open bus. Raises DeviceError if it cannot be opened.

    The interface ``udp_multicast`` stays on this machine, unless the option ``hop_limit`` lets it go farther.
    """
    options: dict[str, Any] = dict(settings.options)  # Any: what an interface takes is its own matter
    local = settings.interface == MULTICAST and not options.get("hop_limit")
    if settings.interface == MULTICAST:
        options = {"fd": False, **options, "hop_limit": int(options.get("hop_limit", 0))}
    else:
        options = {"bitrate": settings.bitrate, **options}
    try:
        bus = can.Bus(interface=settings.interface, channel=settings.channel, ignore_config=True, **options)
        if local:
            _keep_local(bus, settings.channel)
    except (can.CanError, OSError, ValueError, TypeError, ImportError, NotImplementedError) as error:
        raise DeviceError(f"the CAN bus {settings.name} cannot be opened: {type(error).__name__}: {error}") from error
    return bus


def _keep_local(bus: can.BusABC, group: str) -> None:
    """Have a bus of datagrams send and receive on the loopback device only."""
    with socket.socket(fileno=os.dup(bus.fileno())) as same:
        if same.family != socket.AF_INET:
            bus.shutdown()
            raise ValueError(f"the group {group} is not one of IPv4; write such as {MULTICAST_GROUP}")
        member, loopback = socket.inet_aton(group), socket.inet_aton(_LOOPBACK)
        same.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")
        same.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, loopback)
        same.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member + loopback)
        same.setsockopt(socket.IPPROTO_IP, socket.IP_DROP_MEMBERSHIP, member + bytes(4))


def is_busy(error: can.CanError) -> bool:
    """Whether an error of ``send`` says that the frame may be sent later."""
    return isinstance(error, can.CanTimeoutError) or error.error_code in _BUSY
