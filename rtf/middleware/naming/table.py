"""The table of a network's ports: the contact and the properties of each.

All methods may be called from any thread. Everything is bounded, because any program may register: the length of names
and values, the number of ports, and the total size of properties. A request beyond a limit raises AddressError and
changes nothing.
"""

from __future__ import annotations

import re
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from rtf.middleware.errors import AddressError
from rtf.middleware.naming.pools import Numbers, Slots, group, group_slots, nameless
from rtf.middleware.naming.store import Memory, Store
from rtf.middleware.wire.contact import Contact, is_host
from rtf.middleware.wire.name_server_lines import AUTOMATIC

if TYPE_CHECKING:
    from collections.abc import Sequence

#: An alias: within the class, ``list`` is a method.
Contacts: TypeAlias = list[Contact]
Undone: TypeAlias = list[Contact | None]

MAX_PORTS = 20_000
MAX_NAME = 1000
#: The total size of all properties, in characters.
MAX_NOTED = 32 << 20
_MAX_VALUE = 4096
_MAX_NUMBER = 65535
#: Characters that would break a line of an answer, or its words.
_UNFIT = re.compile(r"[\s\x00-\x1f\x7f\"\ud800-\udfff]")


@dataclass(slots=True)
class Entry:
    """One port. ``slot`` and ``group`` are the pool numbers assigned to it, or 0."""

    contact: Contact
    properties: dict[str, tuple[str, ...]] = field(default_factory=dict)
    slot: int = 0
    group: int = 0

    def to_json(self) -> dict[str, Any]:
        """Return the entry for the store."""
        contact = self.contact
        place = {"host": contact.host, "port": contact.port, "carrier": contact.carrier}
        return {**place, "properties": self.properties, "slot": self.slot, "group": self.group}

    @classmethod
    def from_json(cls, name: str, value: dict[str, Any]) -> Entry:
        """Return the entry that ``to_json`` encoded."""
        contact = Contact(name, value["host"], value["port"], value["carrier"])
        properties = {key: tuple(values) for key, values in value["properties"].items()}
        return cls(contact, properties, value["slot"], value["group"])

    @property
    def size(self) -> int:
        """The size of the properties, in characters."""
        return sum(len(key) + sum(map(len, values)) for key, values in self.properties.items())


class Table:
    """All ports of a network. Without ``numbers`` ports choose their own, and are registered with 0 until then."""

    def __init__(self, numbers: Numbers | None = None, store: Store | None = None, groups: Slots | None = None) -> None:
        self.lock = threading.RLock()
        self.store = store or Memory()
        self._numbers = numbers
        self._names = Slots(MAX_PORTS)
        self._groups = groups or group_slots()
        self._entries: dict[str, Entry] = {}
        self._noted = 0
        self._load()

    # Registering -------------------------------------------------------------------------------------------------

    def register(self, name: str, carrier: str, host: str, port: int, promise: str = "") -> Contact:
        """Register a port, known or not. An empty or automatic field is filled in.

        A generated name is put before a name that begins with ``=``. ``host`` is required, except for multicast.
        """
        slot = group_slot = 0
        with self.lock:
            check_fit(name, carrier, promise)
            if host and not is_host(host):
                raise AddressError(f"{host[:80]!r} is not a host: write an address such as 10.0.0.2, or '...'")
            if not 0 <= port <= _MAX_NUMBER:
                raise AddressError(f"{port} is not a port number; write one up to {_MAX_NUMBER}, or '...'")
            if len(self._entries) >= MAX_PORTS and name not in self._entries:
                raise AddressError(f"{MAX_PORTS} ports are registered already; 'rtf clean' removes those that are gone")
            if not name or name == AUTOMATIC or name.startswith("="):
                slot = self._free_name()
                name = nameless(slot) + (name if name.startswith("=") else "")
            self._remove(name)
            if carrier == "mcast" and not host:
                group_slot = self._groups.take()
                host = group(group_slot)
            if not port and self._numbers is not None:
                port = self._take_number(name)
            entry = Entry(Contact(name, host, port, carrier), slot=slot, group=group_slot)
            if promise:
                entry.properties["type"] = (promise,)
            self._enter(entry)
            self.store.put("port", name, entry.to_json())
            return entry.contact

    def unregister(self, name: str) -> Undone:
        """Remove a port and the ports that it owns. Return their contacts, with None for each unknown one."""
        gone: Undone = []
        with self.lock:
            pending = [name]
            while pending:
                entry = self._remove(pending.pop())
                gone.append(entry.contact if entry else None)
                pending += entry.properties.get("owns", ()) if entry else ()
        return gone

    def _free_name(self) -> int:
        while True:
            slot = self._names.take()
            if nameless(slot) not in self._entries:
                self.store.put("counter", "names", self._names.last)
                return slot

    def _take_number(self, name: str) -> int:
        assert self._numbers is not None
        number = self._numbers.take(name)
        self.store.put("number", str(number), name)
        self.store.put("counter", "numbers", self._numbers.cursor)
        return number

    def _enter(self, entry: Entry) -> None:
        self._entries[entry.contact.name] = entry
        self._noted += entry.size
        if self._numbers is not None:
            self._numbers.hold(entry.contact.port)

    def _remove(self, name: str) -> Entry | None:
        entry = self._entries.pop(name, None)
        if entry is None:
            return None
        self._noted -= entry.size
        if self._numbers is not None:
            self._numbers.release(entry.contact.port)
        if entry.slot:
            self._names.give_back(entry.slot)
        if entry.group:
            self._groups.give_back(entry.group)
        self.store.drop("port", name)
        return entry

    # Queries -----------------------------------------------------------------------------------------------------

    def query(self, name: str, network: str = "") -> Contact | None:
        """Return the contact of a port; ``network`` selects the one of its addresses that begins with it."""
        with self.lock:
            entry = self._entries.get(name)
            if entry is None:
                return None
            contact = entry.contact
            fitting = [ip for ip in entry.properties.get("ips", ()) if network and ip.startswith(network)]
            return Contact(name, fitting[0], contact.port, contact.carrier) if fitting else contact

    def list(self, prefix: str = "") -> Contacts:
        """Return all ports, or those at or below a name, sorted by name."""
        below = prefix if prefix.endswith("/") else f"{prefix}/"
        with self.lock:
            names = sorted(self._entries)
            return [
                self._entries[name].contact for name in names if not prefix or name == prefix or name.startswith(below)
            ]

    def runners(self) -> Contacts:
        """Return the ports of yarprun servers, which start programs."""
        with self.lock:
            entries = [self._entries[name] for name in sorted(self._entries)]
        return [entry.contact for entry in entries if "true" in entry.properties.get("yarprun", ())]

    # Properties --------------------------------------------------------------------------------------------------

    def set(self, name: str, key: str, values: Sequence[str]) -> bool:
        """Store a set of values, replacing earlier ones; an empty set removes the key.

        Return False for an unknown port.
        """
        kept = tuple(sorted(set(values)))
        with self.lock:
            entry = self._entries.get(name)
            if entry is None:
                return False
            before = entry.size
            old = entry.properties.pop(key, ())
            if kept:
                entry.properties[key] = kept
            grown = self._noted + entry.size - before
            if grown > MAX_NOTED or max(map(len, (key, *kept))) > _MAX_VALUE:
                entry.properties.pop(key, None)
                if old:
                    entry.properties[key] = old
                raise AddressError(
                    f"the properties of {name} are too large: a value may have at most {_MAX_VALUE} characters"
                )
            self._noted = grown
            self.store.put("port", name, entry.to_json())
            return True

    def get(self, name: str, key: str) -> tuple[str, ...] | None:
        """Return the values of a property; None for an unknown port."""
        with self.lock:
            entry = self._entries.get(name)
            return None if entry is None else entry.properties.get(key, ())

    # Restoring the state of an earlier server --------------------------------------------------------------------

    def _load(self) -> None:
        counters = dict(self.store.load("counter"))
        for name, value in self.store.load("port"):
            self._enter(Entry.from_json(name, value))
        entries = self._entries.values()
        self._names.resume(counters.get("names", 0), {entry.slot for entry in entries if entry.slot})
        self._groups.resume(0, {entry.group for entry in entries if entry.group})
        numbers = self._numbers
        if numbers is None:
            return
        for number, name in self.store.load("number"):
            if numbers.first <= int(number) <= numbers.last:
                numbers.remember(int(number), name)
        cursor = counters.get("numbers", 0)
        if numbers.first <= cursor <= numbers.last:
            numbers.cursor = cursor


def check_fit(*words: str) -> None:
    """Raise AddressError for a word that an answer cannot hold: too long, or with blanks or quotes."""
    for word in words:
        if len(word) > MAX_NAME or _UNFIT.search(word):
            raise AddressError(
                f"{word[:80]!r} cannot be registered: a name has no blanks or quotes and at most {MAX_NAME} characters"
            )
