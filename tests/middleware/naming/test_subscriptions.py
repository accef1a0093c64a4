"""Persistent connections: when they are made and removed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.middleware.naming import subscriptions as module
from rtf.middleware.naming.pools import Numbers
from rtf.middleware.naming.store import Database
from rtf.middleware.naming.subscriptions import Subscriptions
from rtf.middleware.naming.table import Table

if TYPE_CHECKING:
    from pathlib import Path


class Hub:
    """A table with subscriptions, and the connections that they requested."""

    def __init__(self, table: Table | None = None) -> None:
        self.table = table or Table(Numbers(1, 99))
        self.wanted: list[tuple[str, str, bool]] = []
        self.subscriptions = Subscriptions(self.table)
        self.subscriptions.connect = lambda *command: self.wanted.append(command)

    def come(self, *names: str, carrier: str = "tcp") -> None:
        """Register ports, and announce them."""
        for name in names:
            self.table.register(name, carrier, "127.0.0.1", 0)
            self.subscriptions.came(name)

    def go(self, name: str) -> None:
        """Unregister a port."""
        self.subscriptions.went(name)
        self.table.unregister(name)

    def settings(self) -> list[tuple[str, str, bool]]:
        """Return the requests since the last call."""
        wanted, self.wanted = self.wanted, []
        return wanted


@pytest.fixture
def hub() -> Hub:
    """A hub without ports."""
    return Hub()


def test_connected_when_both_are_there(hub: Hub):
    """Ports are connected whenever both are present, in any order and after each return."""
    assert hub.subscriptions.subscribe("/a", "fast_tcp://b")
    hub.come("/a")
    assert hub.settings() == []
    hub.come("/b")
    assert hub.settings() == [("/a", "fast_tcp://b", True)]
    hub.go("/b")
    assert hub.settings() == [("/a", "fast_tcp://b", False)]
    hub.come("/b")
    assert hub.settings() == [("/a", "fast_tcp://b", True)]
    hub.go("/a")
    hub.come("/a")
    assert hub.settings() == [("/a", "fast_tcp://b", False), ("/a", "fast_tcp://b", True)]


def test_connected_at_once(hub: Hub):
    """Subscribing connects ports that are present, and unsubscribing ends the subscription."""
    hub.come("/a", "/b")
    hub.subscriptions.subscribe("/a", "/b")
    assert hub.settings() == [("/a", "/b", True)]
    hub.subscriptions.unsubscribe("tcp://a", "/b")
    hub.come("/a")
    assert hub.settings() == []


def test_only_ports_that_listen(hub: Hub):
    """A name is connected only if it is registered and announced."""
    hub.subscriptions.subscribe("/a", "/b")
    hub.come("/a")
    hub.table.register("/b", "tcp", "127.0.0.1", 5)
    hub.subscriptions.came("/nobody")
    assert hub.settings() == []
    hub.subscriptions.came("/b")
    assert hub.settings() == [("/a", "/b", True)]


@pytest.mark.parametrize(
    ("mode", "goes", "left"), [("from", "/a", 1), ("from", "/b", 2), ("to", "/a", 2), ("to", "/b", 1)]
)
def test_modes(hub: Hub, mode: str, goes: str, left: int):
    """A subscription with mode ``from`` ends with its source, one with ``to`` with its target."""
    hub.subscriptions.subscribe("/a", "/b", mode)
    assert hub.subscriptions.listed().to_text().endswith(f"(mode {mode}))")
    hub.come("/a", "/b")
    hub.go(goes)
    assert len(hub.subscriptions.listed()) == left


def test_listed(hub: Hub):
    """Subscriptions are listed in order, all or those of one port."""
    hub.subscriptions.subscribe("/x", "udp://b")
    hub.subscriptions.subscribe("/a", "/b")
    hub.subscriptions.subscribe("topic:/t", "/c")
    assert hub.subscriptions.listed().to_text() == (
        'subscriptions (subscription (src "/a") (dest "/b")) (subscription (src "topic:/t") (dest "/c") (topic 1 0))'
        ' (subscription (src "/x") (dest "udp://b"))'
    )
    assert hub.subscriptions.listed("/x").to_text() == 'subscriptions (subscription (src "/x") (dest "udp://b"))'
    hub.subscriptions.subscribe("/x", "/b")
    assert hub.subscriptions.listed("/x").to_text() == 'subscriptions (subscription (src "/x") (dest "/b"))'


def test_topics(hub: Hub):
    """All sources of a topic are connected with all its targets, in any order of arrival."""
    hub.come("/a1", "/a2", "/b1")
    hub.come("/t", carrier="topic")
    for source in "/a1", "/a2":
        hub.subscriptions.subscribe(source, "topic:/t")
    assert hub.settings() == []
    hub.subscriptions.subscribe("topic:/t", "/b1")
    assert sorted(hub.settings()) == [("/a1", "/b1", True), ("/a2", "/b1", True)]
    hub.subscriptions.subscribe("topic:/t", "/b2")
    hub.come("/b2")
    assert sorted(hub.settings()) == [("/a1", "/b2", True), ("/a2", "/b2", True)]
    hub.go("/a1")
    assert sorted(hub.settings()) == [("/a1", "/b1", False), ("/a1", "/b2", False)]
    hub.subscriptions.set_topic("/t", active=False)
    hub.come("/a1")
    assert hub.settings() == []
    hub.subscriptions.set_topic("/t")
    assert len(hub.settings()) == 4


def test_a_port_that_was_just_announced_is_believed(hub: Hub, monkeypatch: pytest.MonkeyPatch):
    """A report that a port is silent is ignored shortly after its announcement, and believed later."""
    hub.subscriptions.subscribe("/a", "/b")
    hub.come("/a")
    hub.subscriptions.silent("/a")
    hub.come("/b")
    assert hub.settings() == [("/a", "/b", True)]
    monkeypatch.setattr(module, "_FRESH", -1.0)
    hub.subscriptions.silent("/a")
    hub.subscriptions.came("/b")
    assert hub.settings() == []


def test_bounded(hub: Hub, monkeypatch: pytest.MonkeyPatch):
    """Subscriptions, topics and types have a greatest number; replacing one is always possible."""
    monkeypatch.setattr(module, "MAX_SUBSCRIPTIONS", 2)
    assert hub.subscriptions.subscribe("/a", "/1")
    assert hub.subscriptions.subscribe("/a", "/2")
    assert not hub.subscriptions.subscribe("/a", "/3")
    assert hub.subscriptions.subscribe("/a", "/2", "from")
    assert hub.subscriptions.set_topic("/t1")
    assert hub.subscriptions.set_topic("/t2")
    assert not hub.subscriptions.set_topic("/t3")
    assert hub.subscriptions.set_topic("/t1")
    assert hub.subscriptions.set_type("a", "b", "c")
    assert hub.subscriptions.set_type("a", "c", "c")
    assert not hub.subscriptions.set_type("a", "d", "c")


def test_survive_in_a_file(tmp_path: Path):
    """Subscriptions, topics and types survive a restart; ports that were present count as present."""
    first = Hub(Table(Numbers(1, 99), Database(tmp_path / "names.db")))
    first.subscriptions.subscribe("/a", "udp://b", "to")
    first.subscriptions.subscribe("/a", "topic:/t")
    first.subscriptions.subscribe("/gone", "/b")
    first.subscriptions.unsubscribe("/gone", "/b")
    first.subscriptions.set_type("x", "y", "z")
    first.come("/a")
    first.table.store.close()
    second = Hub(Table(Numbers(1, 99), Database(tmp_path / "names.db")))
    assert second.subscriptions.listed() == first.subscriptions.listed()
    assert second.subscriptions.topics == ["/t"]
    assert second.subscriptions.type_of("x", "y") == "z"
    second.come("/b")
    assert second.settings() == [("/a", "udp://b", True)]
    second.table.store.close()
