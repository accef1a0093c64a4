"""The parameters of a control board client."""

from __future__ import annotations

import itertools
import os
import socket
from dataclasses import dataclass, field

from rtf.bottle import Bottle, Property, as_int, as_string, to_string
from rtf.middleware.ports.qos import Qos, QosError
from rtf.robot import parameters

#: Default age after which a state is stale, in seconds; as in YARP.
TIMEOUT = 0.5
#: Default timeout of a reply, in seconds. Setting modes waits for the electronics, which can take more than a second.
RPC_TIMEOUT = 5.0
_MAX_TOS = 255
_serial = itertools.count(1)


@dataclass(frozen=True, slots=True)
class ClientSettings:
    """The parameters of a client.

    ``strict``: whether a streamed command waits for the previous one; None: only one for a single joint. A setting of
    ``local_qos`` or ``remote_qos`` that is None is left unchanged.
    """

    remote: str
    local: str
    carrier: str = "udp"
    timeout: float = TIMEOUT
    rpc_timeout: float = RPC_TIMEOUT
    strict: bool | None = None
    ignore_protocol: bool = False
    diagnostic: bool = False
    local_qos: Qos = field(default_factory=Qos)
    remote_qos: Qos = field(default_factory=Qos)

    @classmethod
    def read(cls, configuration: Property, carrier: str = "udp") -> ClientSettings:
        """Read them from a configuration; ``carrier`` is the default carrier. Raises ConfigurationError.

        ======================= ==================================================================================
        ``remote``              the name of the board, such as ``/icub/left_arm``; required
        ``local``               the prefix of the client's own ports; default: a unique one
        ``carrier``             for the state and the streamed commands: udp, tcp, fast_tcp …
        ``timeout``             the greatest age of a state, in seconds of the robot's clock
        ``rpcTimeout``          the timeout of a reply, in seconds
        ``writeStrict``         on: every streamed command waits for the previous one; off: none does
        ``ignoreProtocolCheck`` accept a board with another version of the protocol
        ``diagnostic``          report states that arrive too late
        ``local_qos``           a group of ``thread_priority``, ``thread_policy`` and ``packet_priority``, which is
        ``remote_qos``          ``LEVEL:HIGH``, ``DSCP:AF11`` or ``TOS:144``; ``enable 0`` switches the group off
        ======================= ==================================================================================
        """
        remote = parameters.port_name(configuration, "remote")
        return cls(
            remote,
            parameters.port_name(configuration, "local", "") or unique_local(remote),
            parameters.carrier(configuration, carrier),
            parameters.positive(configuration, "timeout", TIMEOUT),
            parameters.positive(configuration, "rpcTimeout", RPC_TIMEOUT),
            _strict(configuration),
            parameters.flag(configuration, "ignoreProtocolCheck"),
            parameters.flag(configuration, "diagnostic"),
            _qos(configuration, "local_qos"),
            _qos(configuration, "remote_qos"),
        )


def unique_local(remote: str) -> str:
    """Return a unique port prefix for a client without a given name."""
    return f"/rtf/{socket.gethostname()}/{os.getpid()}/{next(_serial)}{remote}"


def _strict(configuration: Property) -> bool | None:
    word = as_string(configuration.find("writeStrict"))
    if word not in ("", "on", "off"):
        raise parameters.wrong(configuration, "writeStrict", f"it is 'on' or 'off', not {word!r}")
    return {"": None, "on": True, "off": False}[word]


def _qos(configuration: Property, key: str) -> Qos:
    group = configuration.find(key)
    if isinstance(group, Bottle) or group is None:
        group = parameters.group_of(configuration, key)
    if not isinstance(group, Property):
        raise parameters.wrong(configuration, key, f"it is a group, not {to_string(group)}")
    if not parameters.flag(group, "enable", default=True):
        return Qos()
    try:
        tos = _tos(as_string(group.find("packet_priority")))
    except QosError as error:
        raise parameters.wrong(configuration, key, f"packet_priority: {error}") from None
    return Qos(tos, _number(group, "thread_policy"), _number(group, "thread_priority"))


def _number(group: Property, key: str) -> int | None:
    value = group.find(key)
    return None if value is None or as_int(value) < 0 else as_int(value)


def _tos(text: str) -> int | None:
    """Return the type of service of ``LEVEL:HIGH``, ``DSCP:AF11`` or ``TOS:144``, YARP's notation."""
    if not text:
        return None
    kind, _, value = text.partition(":")
    if kind == "LEVEL":
        return Qos.of_level(value).tos
    if kind == "DSCP":
        return Qos.of_dscp(value).tos
    if kind == "TOS" and value.isdigit() and int(value) <= _MAX_TOS:
        return int(value)
    raise QosError(f"{text!r} is not a packet priority; write one such as LEVEL:HIGH, DSCP:AF11 or TOS:144")
