"""Quality of service: the settings of sockets and threads, and refused requests."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle, Property
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.qos import DSCP, LEVELS, Qos, QosError, set_thread_priority
from rtf.middleware.wire.contact import Contact
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.qos import Connection


@pytest.fixture
def reader(network: Network) -> Iterator[BufferedPort[Bottle]]:
    """A port with an input."""
    with BufferedPort("/reader", network=network) as made:
        yield made


@pytest.fixture
def writer(network: Network, reader: Port) -> Iterator[Port]:
    """A port that writes to ``reader`` in the thread of the caller."""
    with Port("/writer", network=network) as made:
        made.add_output("/reader")
        eventually(lambda: reader.inputs, "the writer has not come")
        yield made


@pytest.fixture
def real_time() -> None:
    """Skip the test if this user may not use real-time priorities."""
    refused: list[QosError] = []

    def attempt() -> None:
        try:
            set_thread_priority(threading.get_native_id(), os.SCHED_FIFO, 1)
        except QosError as error:
            refused.append(error)

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    if refused:
        pytest.skip(str(refused[0]))


def tos(connection: Connection) -> int:
    """Return the type of service of the connection's packets."""
    assert connection.socket is not None
    return connection.socket.getsockopt(socket.IPPROTO_IP, socket.IP_TOS)


def scheduled(thread: int) -> tuple[int, int]:
    """Return policy and priority of a thread, as the kernel has them."""
    return os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority


def command(port: Port, name: str, settings: str) -> str:
    """Send a request to a port as a person types it, and return the reply."""
    return remote.administer(port.network, port.contact, Bottle.parse(f"prop set {name} {settings}")).to_text()


class TestTables:
    """The names and numbers of levels and classes."""

    def test_levels(self):
        """YARP's four levels have their types of service."""
        assert {level: Qos.of_level(level).tos for level in LEVELS} == {"LOW": 40, "NORM": 0, "HIGH": 144, "CRIT": 176}

    def test_classes(self):
        """Every DSCP class is known by name, in any case, and by number."""
        numbers = {"CS0": 0, "CS7": 56, "AF11": 10, "AF12": 12, "AF43": 38, "VA": 44, "EF": 46}
        assert {name: Qos.of_dscp(name.lower()).tos for name in numbers} == {
            name: number << 2 for name, number in numbers.items()
        }
        assert len(DSCP) == 22
        assert Qos.of_dscp("63").tos == 252

    @pytest.mark.parametrize("wrong", ["", "64", "-1", "AF44", "HIGH"])
    def test_no_class(self, wrong: str):
        """The error about an unknown class lists the known ones."""
        with pytest.raises(QosError, match=r"is not a DSCP class; the known ones are CS0, .*, EF"):
            Qos.of_dscp(wrong)

    def test_no_level(self):
        """The error about an unknown level lists the known ones."""
        with pytest.raises(QosError, match="'MAX' is not a packet priority; the known ones are LOW, NORM, HIGH, CRIT"):
            Qos.of_level("MAX")

    def test_settings(self):
        """Settings are the same after encoding and decoding; those to be kept are sent as -1, as YARP does."""
        text = Bottle(Qos(tos=40).to_settings()).to_text()
        assert text == "(sched ((policy -1) (priority -1))) (qos ((tos 40)))"
        for one in (Qos(), Qos(40), Qos(0, 1, 30), Qos(policy=0, priority=0)):
            assert Qos.from_property(Property.from_bottle(Bottle(one.to_settings()))) == one


class TestPackets:
    """The type of service, at the end of the connection that was asked."""

    @pytest.mark.parametrize("carrier", ["tcp", "fast_tcp", "udp", "mcast", "text_ack"])
    @pytest.mark.parametrize(
        ("settings", "wanted"),
        [
            ("(qos ((priority HIGH)))", 144),
            ("(qos ((priority [LOW])))", 40),
            ("(qos ((dscp AF11)))", 40),
            ("(qos ((dscp 46)))", 184),
            ("(qos ((tos 40)))", 40),
            ("(sched ((priority -1) (policy -1))) (qos ((tos 40)))", 40),
        ],
    )
    def test_from_the_wire(self, writer: Port, reader: Port, carrier: str, settings: str, wanted: int):
        """A request sets the type of service by level, class or number, for every carrier; a query returns it."""
        before = {*reader.inputs}
        writer.add_output("/reader", carrier)
        eventually(lambda: {*reader.inputs} - before, "the writer has not come again")
        assert command(writer, "/reader", settings) == "[ok]"
        assert tos(writer.outputs[0]) == wanted
        assert remote.connection_qos(writer.network, writer.contact, Contact("/reader"))[0].tos == wanted
        assert command(writer, "/reader", "(qos ((priority NORM)))") == "[ok]"
        assert tos(writer.outputs[0]) == 0

    def test_from_code(self, writer: Port, reader: Port):
        """A port sets the type of service of its own end only."""
        writer.set_qos("/reader", Qos.of_level("CRIT"))
        reader.set_qos("/writer", Qos.of_dscp("EF"))
        assert (tos(writer.outputs[0]), tos(reader.inputs[0])) == (176, 184)
        writer.set_qos("/reader", Qos())
        assert tos(writer.outputs[0]) == 176
        with pytest.raises(ConnectError, match="/writer is not connected with /nobody"):
            writer.set_qos("/nobody", Qos())

    def test_from_elsewhere(self, writer: Port, reader: Port):
        """A third party sets both ends, with the same or with different settings."""
        network, source, target = writer.network, Contact("/writer"), Contact("/reader")
        remote.set_connection_qos(network, source, target, Qos.of_level("HIGH"))
        assert (tos(writer.outputs[0]), tos(reader.inputs[0])) == (144, 144)
        remote.set_connection_qos(network, source, target, Qos(), Qos.of_level("LOW"))
        assert [end.tos for end in remote.connection_qos(network, source, target)] == [144, 40]
        assert (tos(writer.outputs[0]), tos(reader.inputs[0])) == (144, 40)

    def test_no_connection(self, writer: Port):
        """The error about a missing connection names both ports."""
        network, ends = writer.network, (Contact("/writer"), Contact("/nobody"))
        with pytest.raises(ConnectError, match=r"/writer did not set .* for its connection with /nobody"):
            remote.set_connection_qos(network, *ends, Qos(tos=40))
        with pytest.raises(ConnectError, match="/writer: cannot find any connection to/from /nobody"):
            remote.connection_qos(network, *ends)

    @pytest.mark.parametrize("wrong", ["(priority MAX)", "(dscp AF44)", "(dscp 64)", "(tos 256)"])
    def test_unknown_names(self, writer: Port, said: list[str], wrong: str):
        """A request with an unknown name is refused and reported by the port, and changes nothing."""
        writer.set_qos("/reader", Qos(tos=40))
        assert command(writer, "/reader", f"(qos ({wrong}))") == "[fail]"
        assert tos(writer.outputs[0]) == 40
        assert len(said) == 1
        assert said[0].startswith("a request for the connection with /reader is refused: ")


class TestThreads:
    """Policy and priority of the threads of connections."""

    @pytest.mark.usefixtures("real_time")
    def test_of_an_input(self, writer: Port, reader: Port):
        """A request changes the thread of the input, and no other."""
        assert command(reader, "/writer", "(sched ((priority 30) (policy 1)))") == "[ok]"
        assert scheduled(reader.inputs[0].thread) == (os.SCHED_FIFO, 30)
        assert scheduled(threading.get_native_id()) == (os.SCHED_OTHER, 0)
        there = remote.connection_qos(reader.network, Contact("/writer"), Contact("/reader"))[1]
        assert there == Qos(0, os.SCHED_FIFO, 30)
        assert command(reader, "/writer", "(sched ((priority 7) (policy 2)))") == "[ok]"
        assert scheduled(reader.inputs[0].thread) == (os.SCHED_RR, 7)

    @pytest.mark.usefixtures("real_time")
    def test_of_an_output(self, network: Network, reader: Port):
        """The output of a buffered port has a thread, whose priority can be set."""
        with BufferedPort("/buffered", network=network) as port:
            port.add_output("/reader")
            eventually(lambda: port.outputs[0].thread, "its thread has not begun")
            port.set_qos("/reader", Qos(policy=os.SCHED_FIFO, priority=5))
            assert scheduled(port.outputs[0].thread) == (os.SCHED_FIFO, 5)

    def test_of_an_output_without_a_thread(self, writer: Port, said: list[str]):
        """An output without a thread refuses a real-time priority, and accepts the normal one."""
        with pytest.raises(QosError, match="the connection with /reader has no thread of its own"):
            writer.set_qos("/reader", Qos(policy=os.SCHED_FIFO, priority=5))
        assert command(writer, "/reader", "(sched ((priority 30) (policy 1)))") == "[fail]"
        assert "no thread of its own" in said[-1]
        assert command(writer, "/reader", "(sched ((priority 0) (policy 0))) (qos ((tos 40)))") == "[ok]"
        assert tos(writer.outputs[0]) == 40

    @pytest.mark.parametrize("wrong", ["(policy 1)", "(policy 1) (priority 100)", "(policy 99)", "(priority 5)"])
    def test_what_there_is_not(self, writer: Port, reader: Port, wrong: str):
        """An invalid policy or priority is refused, and changes nothing."""
        assert command(reader, "/writer", f"(sched ({wrong}))") == "[fail]"
        assert scheduled(reader.inputs[0].thread) == (os.SCHED_OTHER, 0)


_CHILD = """
import contextlib, json, os, sys
from pathlib import Path
from rtf.bottle import Bottle
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port

said = []
network = Network(LocalNames(), report=said.append)

def ask(port, text):
    return remote.administer(network, port.contact, Bottle.parse(text)).to_text()

with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
    writer.add_output("/reader")
    ask(reader, "[ver]")  # everything that this takes is loaded now
    if sys.argv[1] == "without rights" and os.geteuid() == 0:
        os.setresuid(65534, 65534, 65534)
    answers = [ask(reader, "prop set " + request) for request in json.loads(sys.argv[2])]
    policies = set()
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # it has just answered, and ended
            thread = int(task.name)
            policies.add((os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority))
    facts = ask(reader, "prop get /reader")
print(json.dumps({"answers": answers, "policies": sorted(policies), "said": said, "facts": facts}))
"""


def in_a_process(rights: str, *settings: str) -> dict[str, object]:
    """Send requests to ports in another process, with or without rights; return replies, policies and reports."""
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, rights, json.dumps(settings)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert not done.stderr
    found: dict[str, object] = json.loads(done.stdout)
    return found


class TestProcess:
    """A request with the port's own name, which applies to all threads of its process."""

    @pytest.mark.usefixtures("real_time")
    def test_all_threads(self):
        """The request changes all threads, and the port's description has the new policy."""
        found = in_a_process("with rights", "/reader (process ((priority 30) (policy 1)))")
        assert found["answers"] == ["[ok]"]
        assert found["policies"] == [[os.SCHED_FIFO, 30]]
        assert "(policy 1) (priority 30)))" in str(found["facts"])

    def test_without_rights(self):
        """Without the right the request fails, changes nothing, and is reported with the missing right."""
        settings = ("/reader (process ((priority 30) (policy 1)))", "/writer (sched ((priority 30) (policy 1)))")
        found = in_a_process("without rights", *settings)
        assert found["answers"] == ["[fail]", "[fail]"]
        assert found["policies"] == [[os.SCHED_OTHER, 0]]
        text = (
            "this user may not give a thread policy 1 and priority 30: real-time needs CAP_SYS_NICE, or a line for "
            "rtprio in /etc/security/limits.conf"
        )
        assert found["said"] == [
            f"a request for this process is refused: {text}",
            f"a request for the connection with /writer is refused: {text}",
        ]

    def test_nothing_wanted(self):
        """A request for the normal policy is granted without any right."""
        settings = ("/reader (process ((priority 0)))", "/reader (process ((priority 0) (policy 0)))", "/reader 5")
        assert in_a_process("without rights", *settings)["answers"] == ["[ok]"] * 3
