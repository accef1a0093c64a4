"""The collector: all records of all senders go into the file, and a flood is kept from the others."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.logs.collector import Collector
from rtf.logs.query import Query
from rtf.logs.record import COLLECTOR, Level, LogRecord
from rtf.logs.store import LogFileError, LogStore
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import RAW

from .conftest import stored

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.middleware.ports.network import Network


def record(sender: str, number: int, size: int = 1) -> LogRecord:
    """One of several records."""
    return LogRecord(sender, Level.INFO, float(number + 1), f"{number}" + " " * size)


class HeldStore(LogStore):
    """A store whose disk does not answer until it is let go."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.held = threading.Event()
        self.let_go = threading.Event()

    def add(self, records) -> None:
        self.held.set()
        assert self.let_go.wait(30)
        super().add(records)


@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "text_ack", "local"])
def test_every_record_is_stored(network: Network, file: Path, carrier: str):
    """Records of any carrier are in the file, in order, when the collector is closed."""
    with LogStore(file) as store:
        collector = Collector(store, network=network)
        with Port("/log/vm/prog/1", network=network, inputs=False) as port:
            port.add_output(COLLECTOR, carrier)
            for number in range(300):
                port.write(record(port.name, number).to_bottle())
            port.write(Bottle.parse("1 2 (3 4)"))
        collector.close()
        assert (collector.written, collector.dropped) == (301, 0)
    found = stored(file)
    assert found[:-1] == [record("/log/vm/prog/1", number) for number in range(300)]
    assert (found[-1].sender, found[-1].message, found[-1].level) == ("/log/vm/prog/1", "1 2 (3 4)", Level.UNKNOWN)


def test_a_flood_takes_from_no_other_sender(network: Network, file: Path):
    """While nothing is written, a flood loses what exceeds its share, and says how much; another loses nothing."""
    store = HeldStore(file)
    with store, Collector(store, network=network, memory=400_000) as collector:
        with Port("/log/vm/flood/1", network=network) as flood, Port("/log/vm/calm/2", network=network) as calm:
            for port in (flood, calm):
                port.add_output(COLLECTOR, "tcp")  # its acknowledgement says that a record was taken or dropped
            calm.write(record(calm.name, 0).to_bottle())
            assert store.held.wait(30)
            for number in range(3000):
                flood.write(record(flood.name, number, 100).to_bottle())
            for number in range(1, 300):
                calm.write(record(calm.name, number).to_bottle())
        store.let_go.set()
        collector.close()
        assert stored(file, Query(process="calm")) == [record("/log/vm/calm/2", number) for number in range(300)]
        warnings = stored(file, Query(process="flood", component="rtf.logs", level=Level.WARNING))
        kept = stored(file, Query(process="flood", text=" " * 100))
    lost = sum(int(one.message.split()[0]) for one in warnings)
    assert lost == collector.dropped == 3000 - len(kept)
    assert kept == [record("/log/vm/flood/1", number, 100) for number in range(len(kept))]
    assert 500 < len(kept) < 1500


def test_hostile_messages_harm_no_one(network: Network, file: Path):
    """A message larger than the share is dropped and counted, nonsense is a record, and others are stored."""
    with LogStore(file) as store, Collector(store, network=network, memory=1 << 20) as collector:
        with Port("/log/vm/prog/1", network=network) as port, Port("/peer", network=network) as peer:
            port.add_output(COLLECTOR, "tcp")
            peer.add_output(COLLECTOR, "tcp")
            peer.write(b"\xff" * (2 << 20))
            peer.write(b"\x04\x01\x00\x00\x02\x00\x00\x00\xff\xff\xff\x7f", RAW)
            port.write(record(port.name, 0).to_bottle())
        assert collector.flush()
        assert (collector.written, collector.dropped) == (3, 1)
    assert [one.level for one in stored(file, Query(process="/peer", text="is no record"))] == [Level.UNKNOWN]
    assert [one.level for one in stored(file, Query(process="/peer", text="1 records"))] == [Level.WARNING]
    assert stored(file, Query(process="prog")) == [record("/log/vm/prog/1", 0)]


def test_a_full_disk_ends_the_collector_with_its_reason(network: Network, file: Path):
    """When the file cannot be written, the owner is called and the failure names the file; senders do not notice."""
    store = LogStore(file)
    failed = threading.Event()
    with Collector(store, network=network, failed=failed.set) as collector:
        with Port("/log/vm/prog/1", network=network) as port:
            port.add_output(COLLECTOR, "tcp")
            store.close()
            for number in range(3):
                assert port.write(record(port.name, number).to_bottle()) == 1
            assert failed.wait(30)
        assert isinstance(collector.failure, LogFileError)
        assert str(file) in str(collector.failure)


def test_programs_that_run_already_are_connected(network: Network, file: Path):
    """A collector that is started late gets the records of the programs that are there, and of no other ports."""
    with (
        Port("/log/vm/prog/1", network=network) as port,
        Port("/logger/other", network=network) as other,
        LogStore(file) as store,
        Collector(store, network=network) as collector,
    ):
        collector.connect_running()
        assert port.write(record(port.name, 0).to_bottle()) == 1
        assert other.write(record(other.name, 0).to_bottle()) == 0
    assert stored(file) == [record("/log/vm/prog/1", 0)]
