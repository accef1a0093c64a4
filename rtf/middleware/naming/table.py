"""The names of a network: which port is where, and what was noted about it.

All may be called from any thread. Everything is bounded, because anybody may register: names and values in their
length, ports in their number, what is noted in all. What goes beyond raises AddressError, and nothing has changed
then.
"""

from __future__ import annotations

import re
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from rtf.middleware.errors import AddressError
from rtf.middleware.names import Contact, is_host
from rtf.middleware.naming.lines import AUTOMATIC
from rtf.middleware.naming.pools import Numbers, Slots, group, group_slots, nameless
from rtf.middleware.naming.store import Memory, Store

if TYPE_CHECKING:
    from collections.abc import Sequence

#: In a class that has a method called list, the type is not called so.
Contacts: TypeAlias = list[Contact]
Undone: TypeAlias = list[Contact | None]

MAX_PORTS = 20_000
MAX_NAME = 1000
#: Characters of all that is noted about all ports.
MAX_NOTED = 32 << 20
_MAX_VALUE = 4096
_MAX_NUMBER = 65535
#: What would break a line of an answer, or its words.
_UNFIT = re.compile(r"[\s\x00-\x1f\x7f\"\ud800-\udfff]")


@dataclass(slots=True)
class Entry:
    """One port. ``slot`` and ``group`` are what was handed out to it, 0 when nothing was."""

    contact: Contact
    properties: dict[str, tuple[str, ...]] = field(default_factory=dict)
    slot: int = 0
    group: int = 0

    def to_json(self) -> dict[str, Any]:
        """For the store."""
        contact = self.contact
        place = {"host": contact.host, "port": contact.port, "carrier": contact.carrier}
        return {**place, "properties": self.properties, "slot": self.slot, "group": self.group}

    @classmethod
    def from_json(cls, name: str, value: dict[str, Any]) -> Entry:
        """What ``to_json`` made."""
        contact = Contact(name, value["host"], value["port"], value["carrier"])
        properties = {key: tuple(values) for key, values in value["properties"].items()}
        return cls(contact, properties, value["slot"], value["group"])

    @property
    def size(self) -> int:
        """The characters that are noted."""
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
        """Register a port, whether the name is known or not. An empty or automatic field is filled in.

        A name that begins with ``=`` gets one in front of it. ``host`` is needed, but for multicast.
        """
        slot = group_slot = 0
        with self.lock:
            check_fit(name, carrier, promise)
            if host and not is_host(host):
                raise AddressError(f"{host[:80]!r} is no host: write an address such as 10.0.0.2, or '...'")
            if not 0 <= port <= _MAX_NUMBER:
                raise AddressError(f"{port} is no number of a port; write one up to {_MAX_NUMBER}, or '...'")
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
        """Forget a port and what it owns; returns what is gone, with None for each that was not known."""
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

    # Asking ------------------------------------------------------------------------------------------------------

    def query(self, name: str, network: str = "") -> Contact | None:
        """Where a port is; ``network`` picks, among its addresses, one that begins like this."""
        with self.lock:
            entry = self._entries.get(name)
            if entry is None:
                return None
            contact = entry.contact
            fitting = [ip for ip in entry.properties.get("ips", ()) if network and ip.startswith(network)]
            return Contact(name, fitting[0], contact.port, contact.carrier) if fitting else contact

    def list(self, prefix: str = "") -> Contacts:
        """All ports, or those at or below a name, in the order of their names."""
        below = prefix if prefix.endswith("/") else f"{prefix}/"
        with self.lock:
            names = sorted(self._entries)
            return [
                self._entries[name].contact for name in names if not prefix or name == prefix or name.startswith(below)
            ]

    def runners(self) -> Contacts:
        """The ports that start programs."""
        with self.lock:
            entries = [self._entries[name] for name in sorted(self._entries)]
        return [entry.contact for entry in entries if "true" in entry.properties.get("yarprun", ())]

    # Notes -------------------------------------------------------------------------------------------------------

    def set(self, name: str, key: str, values: Sequence[str]) -> bool:
        """Note a set of values, in the place of those before; none: forget them. False when nobody knows the port."""
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
                    f"too much is noted about {name}: {_MAX_VALUE} characters are the most a value may have"
                )
            self._noted = grown
            self.store.put("port", name, entry.to_json())
            return True

    def get(self, name: str, key: str) -> tuple[str, ...] | None:
        """What is noted; None when nobody knows the port."""
        with self.lock:
            entry = self._entries.get(name)
            return None if entry is None else entry.properties.get(key, ())

    # What an earlier server knew ---------------------------------------------------------------------------------

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
    """Raise AddressError for a word that an answer cannot hold: too long, or with blanks or quotes in it."""
    for word in words:
        if len(word) > MAX_NAME or _UNFIT.search(word):
            raise AddressError(
                f"{word[:80]!r} cannot be registered: a name has no blanks or quotes and at most {MAX_NAME} characters"
            )
