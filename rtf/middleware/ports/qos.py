"""Quality of service: the priority of packets and of the threads that handle them.

Packets carry a type of service (TOS), which is given as a level, as the name or number of a DSCP class, or as a number.
Threads have a policy (0 OTHER, 1 FIFO, 2 RR) and a priority. Real-time policies need a privilege that ordinary users
rarely have; without it the request is refused with an error.
"""

from __future__ import annotations

import os
import socket
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, Vocab, as_int, as_string
from rtf.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.monitors.attached import Attached
    from rtf.middleware.ports.priority import Priority

#: DSCP classes by name (RFC 2474, 2597, 3246, 5865).
DSCP = {
    **{f"CS{number}": 8 * number for number in range(8)},
    **{f"AF{group}{drop}": 8 * group + 2 * drop for group in range(1, 5) for drop in range(1, 4)},
    "VA": 44,
    "EF": 46,
}
#: YARP's levels of packet priority, as DSCP.
LEVELS = {"LOW": 10, "NORM": 0, "HIGH": 36, "CRIT": 44}
_MAX_DSCP, _MAX_TOS = 63, 255


class QosError(MiddlewareError, PermissionError):
    """A priority is invalid, or this user may not set it."""


@dataclass(frozen=True, slots=True)
class Qos:
    """The requested quality of service of a connection; None leaves a setting unchanged."""

    tos: int | None = None
    policy: int | None = None
    priority: int | None = None

    @classmethod
    def of_level(cls, level: str) -> Qos:
        """Return the setting for one of the packet priorities :data:`LEVELS`."""
        return cls(tos=_tos_of(LEVELS, level, "packet priority"))

    @classmethod
    def of_dscp(cls, name: str) -> Qos:
        """Return the setting for one of the classes :data:`DSCP`, or for a DSCP number."""
        if name.isdigit() and int(name) <= _MAX_DSCP:
            return cls(tos=int(name) << 2)
        return cls(tos=_tos_of(DSCP, name, "DSCP class"))

    @classmethod
    def from_property(cls, settings: Property) -> Qos:
        """Read ``(sched ((priority 30) (policy 1))) (qos ((priority HIGH)))`` and its variants. Raises QosError."""
        sched, packets = _inner(settings, "sched"), _inner(settings, "qos")
        found = cls(policy=_number(sched, "policy"), priority=_number(sched, "priority"))
        tos = _number(packets, "tos")
        if packets.check("priority"):
            tos = cls.of_level(_text(packets, "priority")).tos
        elif packets.check("dscp"):
            tos = cls.of_dscp(_text(packets, "dscp")).tos
        if tos is not None and not 0 <= tos <= _MAX_TOS:
            raise QosError(f"a type of service is from 0 to {_MAX_TOS}, not {tos}")
        return cls(tos, found.policy, found.priority)

    def to_settings(self) -> list[Bottle]:
        """Return the settings as YARP's library sends them: unchanged ones are -1."""
        sched = {"policy": _or_default(self.policy), "priority": _or_default(self.priority)}
        return [Bottle(["sched", Property(sched)]), Bottle(["qos", Property({"tos": _or_default(self.tos)})])]


def _or_default(number: int | None) -> int:
    return -1 if number is None else number


def _tos_of(table: dict[str, int], name: str, what: str) -> int:
    code = table.get(name.upper())
    if code is None:
        raise QosError(f"{name!r} is not a {what}; the known ones are {', '.join(table)}")
    return code << 2


def _inner(settings: Property, key: str) -> Property:
    group = settings.find(key)
    if isinstance(group, Property):
        return group
    return Property.from_bottle(group) if isinstance(group, Bottle) else Property()


def _number(settings: Property, key: str) -> int | None:
    value = settings.find(key)
    return None if value is None or as_int(value) < 0 else as_int(value)


def _text(settings: Property, key: str) -> str:
    value = settings.find(key)
    return value.text if isinstance(value, Vocab) else as_string(value) or str(as_int(value))


def set_packet_priority(connection: socket.socket, tos: int) -> None:
    """Set the type of service of all packets of a socket. Raises QosError."""
    try:
        if connection.family == socket.AF_INET6:
            connection.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_TCLASS, tos)
        elif connection.family == socket.AF_INET:
            connection.setsockopt(socket.IPPROTO_IP, socket.IP_TOS, tos)
    except OSError as error:
        raise QosError(f"the type of service {tos} cannot be set: {error.strerror}") from None


def packet_priority(connection: socket.socket | None) -> int:
    """Return the type of service of a socket's packets; 0 for other kinds of sockets."""
    try:
        if connection is not None and connection.family == socket.AF_INET:
            return connection.getsockopt(socket.IPPROTO_IP, socket.IP_TOS)
    except OSError:
        return 0  # it was closed meanwhile
    return 0


def set_thread_priority(thread: int, policy: int | None, priority: int | None) -> None:
    """Set the policy and priority of a thread, given by its kernel thread id. Raises QosError."""
    try:
        chosen = os.sched_getscheduler(thread) if policy is None else policy
        os.sched_setscheduler(thread, chosen, os.sched_param(priority or 0))
    except ProcessLookupError:
        return  # it has just ended
    except PermissionError:
        raise QosError(
            f"this user may not give a thread policy {policy} and priority {priority}: real-time needs CAP_SYS_NICE, "
            "or a line for rtprio in /etc/security/limits.conf"
        ) from None
    except OSError as error:
        raise QosError(f"policy {policy} with priority {priority} cannot be set: {error.strerror}") from None


def thread_facts(thread: int) -> dict[str, int]:
    """Return the policy, the priority and the id of a thread."""
    try:
        return {
            "policy": os.sched_getscheduler(thread),
            "priority": os.sched_getparam(thread).sched_priority,
            "tid": thread,
        }
    except OSError:
        return {"policy": 0, "priority": 0, "tid": thread}  # it has just ended


def set_process_priority(policy: int | None, priority: int | None) -> None:
    """Set the policy and priority of all threads of this process; new ones inherit them. Raises QosError."""
    done: dict[int, tuple[int, int]] = {}
    try:
        while new := _threads() - done.keys():  # an unchanged thread may have started another one meanwhile
            for thread in new:
                facts = thread_facts(thread)
                done[thread] = facts["policy"], facts["priority"]
                set_thread_priority(thread, policy, priority)
    except QosError:
        for thread, before in done.items():
            set_thread_priority(thread, *before)
        raise


def _threads() -> set[int]:
    return {int(task.name) for task in Path("/proc/self/task").iterdir()}


def set_process(settings: Property, report: Callable[[str], None]) -> bool:
    """Apply ``(process ((priority 30) (policy 1)))`` or ``(sched …)``. Return whether all of it succeeded."""
    process = _inner(settings, "process")
    if not process.check("policy") and not process.check("priority"):
        process = _inner(settings, "sched")
    try:
        policy, priority = _number(process, "policy"), _number(process, "priority")
        if policy is not None or priority is not None:
            set_process_priority(policy, priority)
    except QosError as error:
        report(f"a request for this process is refused: {error}")
        return False
    return True


class Connection(ABC):
    """One end of a connection, as the admin protocol sees it."""

    #: The kernel's id of the thread that handles the connection; 0 if it has none, and ``instead`` says why.
    thread = 0
    instead = "it is sent in the thread of the writer"
    #: The priority of its messages among those of the other inputs of the port, if it has one.
    priority: Priority | None = None
    #: The script that looks at its messages, if there is one.
    monitor: Attached | None = None

    @property
    @abstractmethod
    def peer(self) -> str:
        """The name of the port at the other end."""

    @property
    @abstractmethod
    def carrier(self) -> str:
        """The name of the carrier, with modifiers."""

    @property
    @abstractmethod
    def connectionless(self) -> bool:
        """Whether the carrier sends datagrams."""

    @property
    @abstractmethod
    def socket(self) -> socket.socket | None:
        """The socket of the connection; None if there is none."""

    def apply(self, wanted: Qos) -> None:
        """Set the requested priorities. Raises QosError; the packets may have been set before it."""
        if wanted.tos is not None and self.socket is not None:
            set_packet_priority(self.socket, wanted.tos)
        if self.thread:
            if wanted.policy is not None or wanted.priority is not None:
                set_thread_priority(self.thread, wanted.policy, wanted.priority)
        elif wanted.policy or wanted.priority:
            raise QosError(f"the connection with {self.peer} has no thread of its own: {self.instead}")

    def configure(self, settings: Property, report: Callable[[str], None]) -> bool:
        """Apply the settings of an admin request. Return whether all of them could be set."""
        try:
            self.apply(Qos.from_property(settings))
        except QosError as error:
            report(f"a request for the connection with {self.peer} is refused: {error}")
            return False
        return True

    def describe(self) -> Bottle:
        """Return the thread's and the packets' settings as the admin protocol reports them."""
        facts = thread_facts(self.thread) if self.thread else {"tid": 0, "priority": 0, "policy": 0}
        return Bottle([["sched", Property(facts)], ["qos", Property({"tos": packet_priority(self.socket)})]])
