"""What this process keeps of each domain: its setting, and the types of its topics.

The library finds a type by its identifier and compiles it anew for each topic, without holding it: if the last topic of
the type has just been closed, its thread that collects garbage frees the type meanwhile, and the process crashes. So
each type has a topic that lasts as long as the process, of a participant that has nothing else; and topics are opened
one after the other.
"""

from __future__ import annotations

import os
import threading
from typing import TypeVar

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.topic import Topic

M = TypeVar("M", bound=IdlStruct)
#: The setting without one of the user: the interface of loopback, and no multicast.
_LOOPBACK = """\
<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
_lock = threading.Lock()
#: Domains that have the setting.
_restricted: dict[int, Domain] = {}
#: By domain, the participant of the topics that last.
_keepers: dict[int, DomainParticipant] = {}
_kept: dict[tuple[int, type[IdlStruct]], Topic[IdlStruct]] = {}


def open_participant(domain: int) -> DomainParticipant:
    """Open a participant, on this machine unless the user has CYCLONEDDS_URI. Raises DDSException."""
    with _lock:
        return _opened(domain)


def _opened(domain: int) -> DomainParticipant:
    if "CYCLONEDDS_URI" not in os.environ and domain not in _restricted:
        _restricted[domain] = Domain(domain, _LOOPBACK)
    return DomainParticipant(domain)


def open_topic(participant: DomainParticipant, domain: int, name: str, kind: type[M]) -> Topic[M]:
    """Open a topic by its name on the network, of a participant in ``domain``. Raises DDSException."""
    with _lock:
        if (domain, kind) not in _kept:
            if domain not in _keepers:
                _keepers[domain] = _opened(domain)
            _kept[domain, kind] = Topic(_keepers[domain], f"kept_{len(_kept)}", kind)
        return Topic(participant, name, kind)
