"""Ports and a model of what they promise, driven side by side through any sequence of calls: they always agree.

The ports are real, and so are their connections. Calls that wait are made in threads of their own and have begun to
wait before the next call is made, so that the model knows what must come of them; orders of what happens at the same
moment are left to the schedules that are explored elsewhere.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from rtf.bottle import Bottle
from rtf.errors import RtfError
from rtf.middleware.errors import NameNotFoundError, PortClosedError, WaitTimeoutError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

PLAIN, STRICT, NEWEST = "plain", "strict", "newest"
WRITERS = ("/writer/0", "/writer/1")
CARRIERS = st.sampled_from(["tcp", "local"])
#: Seconds for a message that should come at once.
SOON = 5.0


@dataclass
class Model:
    """The model of a port with inputs. Results are values, numbers, or the classes of errors."""

    kind: str
    connected: set[str] = field(default_factory=set)
    interrupted: bool = False
    closed: bool = False
    dropped: int = 0
    #: The messages that can be read: of a plain port with the writers that wait for them, of a buffered one without.
    queue: list[tuple[str, int]] = field(default_factory=list)

    @property
    def busy(self) -> set[str]:
        """The writers that wait until their message is read."""
        return {writer for writer, _ in self.queue} if self.kind == PLAIN else set()

    @property
    def pending(self) -> int:
        """The number of messages in the queue."""
        return len(self.queue)

    def arrives(self, writer: str) -> bool:
        """Return whether a message that is written now can be read."""
        return writer in self.connected and not self.interrupted

    def write(self, writer: str, value: int) -> int:
        """Return the number of readers that the write reaches."""
        if self.arrives(writer):
            if self.kind == NEWEST and self.queue:
                self.queue.clear()
                self.dropped += 1
            self.queue.append((writer, value))
        return int(writer in self.connected)

    def read(self) -> int | type[Exception]:
        """Return the first value, or the class of the error."""
        if self.queue and not (self.kind == PLAIN and self.closed):
            return self.queue.pop(0)[1]
        return PortClosedError if self.interrupted else WaitTimeoutError

    def interrupt(self) -> None:
        """Interrupt: writers stop waiting, and a plain port keeps no message."""
        self.interrupted = True
        if self.kind == PLAIN:
            self.queue.clear()

    def resume(self) -> None:
        """Resume, unless the port is closed."""
        self.interrupted = self.closed

    def close(self) -> None:
        """Close: interrupt for good, and remove the connections."""
        self.interrupt()
        self.closed = True
        self.connected.clear()


class Call:
    """A call in a thread of its own, and its result."""

    def __init__(self, work: Callable[[], object]) -> None:
        self._work = work
        self._result: object = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def result(self) -> object:
        """The value that the call returned, or the class of its error; the call must end soon."""
        self._thread.join(SOON)
        assert not self._thread.is_alive(), "the call has not come back"
        return self._result

    @property
    def waits(self) -> bool:
        """Whether the call has not returned."""
        return self._thread.is_alive()

    def _run(self) -> None:
        self._result = outcome(self._work)


def outcome(work: Callable[[], object]) -> object:
    """Return the result of a call, or the class of its error."""
    try:
        return work()
    except RtfError as error:
        return type(error)


class Ports(RuleBasedStateMachine):
    """A port with inputs, two writers, and the model."""

    kind = PLAIN

    def __init__(self) -> None:
        super().__init__()
        self.network = Network(LocalNames())
        self.written = 0
        self.writes: dict[str, Call] = {}
        self.reading: Call | None = None

    @initialize(carriers=st.tuples(CARRIERS, CARRIERS))
    def open(self, carriers: tuple[str, str]) -> None:
        """Make the ports, and connect them."""
        kind = self.kind
        self.model = Model(kind)
        self.reader: Any = (
            Port("/reader", network=self.network)
            if kind == PLAIN
            else BufferedPort("/reader", strict=kind == STRICT, network=self.network)
        )
        self.writers = {name: Port(name, network=self.network) for name in WRITERS}
        for writer, carrier in zip(WRITERS, carriers, strict=True):
            self.connect(writer, carrier)

    # What writers do

    @rule(writer=st.sampled_from(WRITERS), carrier=CARRIERS)
    def reconnect(self, writer: str, carrier: str) -> None:
        """Connect a writer at any time."""
        self.connect(writer, carrier)

    def connect(self, writer: str, carrier: str) -> None:
        """Connect a writer, which replaces its connection; a closed port cannot be connected."""
        if writer in self.model.busy:
            return
        made = outcome(lambda: self.writers[writer].add_output("/reader", carrier).name)
        if self.model.closed:
            assert made is NameNotFoundError
        else:
            assert made == "/reader"
            self.model.connected.add(writer)
            eventually(lambda: self.listed() == sorted(self.model.connected), "the reader does not list its callers")

    @precondition(lambda self: self.written % 4 == 3)  # so that most of what is written arrives
    @rule(writer=st.sampled_from(WRITERS))
    def disconnect(self, writer: str) -> None:
        """Disconnect; the result tells whether there was a connection, unless the port is closed."""
        if writer in self.model.busy:
            return
        was = self.writers[writer].remove_output("/reader")
        assert was == (writer in self.model.connected) or self.model.closed
        self.model.connected.discard(writer)

    @rule(writers=st.lists(st.sampled_from(WRITERS), min_size=1, max_size=3))
    def write(self, writers: list[str]) -> None:
        """Write several messages in a row."""
        for writer in writers:
            self.write_once(writer)

    def write_once(self, writer: str) -> None:
        """Write; to a plain port the call waits, otherwise it returns."""
        if writer in self.model.busy:
            return
        number = self.written = self.written + 1
        first = not self.model.queue
        call = Call(lambda: self.writers[writer].write(Bottle([number])))
        expected = self.model.write(writer, number)
        if not self.model.arrives(writer) or self.model.kind != PLAIN:
            assert call.result() == expected
        else:
            self.writes[writer] = call
        if self.reading is not None and self.model.queue:
            self.end_reading()
        elif first:
            self.await_message()

    def await_message(self) -> None:
        """Wait until the message of a plain port's writer has arrived, so that a later write arrives later."""
        if self.model.busy:
            eventually(lambda: self.reader._handoff._waiting is not None, "the message does not come")

    # What the reader does

    @precondition(lambda self: self.reading is None)
    @rule()
    def read(self) -> None:
        """Read the next value, which ends its writer's wait, or get the error."""
        limit = SOON if self.model.queue else 0.0
        self.compare_reading(outcome(lambda: self.reader.read(timeout=limit)[0]))

    @precondition(lambda self: self.reading is None and not self.model.queue and not self.model.interrupted)
    @rule()
    def begin_to_read(self) -> None:
        """Begin to read in a thread, which waits for a message."""
        plain = self.model.kind == PLAIN
        changed = self.reader._handoff._changed if plain else self.reader._arrived
        self.reading = Call(lambda: self.reader.read()[0])
        eventually(lambda: changed._waiters, "nobody waits")

    @precondition(lambda self: self.reading is None and self.model.kind != PLAIN)
    @rule()
    def poll(self) -> None:
        """Poll, which never waits and never raises."""
        got = self.reader.poll()
        assert (None if got is None else got[0]) == (self.model.read() if self.model.queue else None)

    @precondition(lambda self: self.written % 3 == 2)
    @rule(how_often=st.integers(1, 2))
    def interrupt(self, how_often: int) -> None:
        """Interrupt, which ends all waits."""
        for _ in range(how_often):
            self.reader.interrupt()
        self.model.interrupt()
        self.end_waiting({1})

    @rule()
    def interrupt_and_resume(self) -> None:
        """Interrupt and resume at once: readers are woken, and waiting messages may stay."""
        if self.model.busy:
            return
        self.reader.interrupt()
        self.reader.resume()
        reading, self.reading = self.reading, None
        assert reading is None or reading.result() is PortClosedError
        self.model.resume()

    @rule()
    def resume(self) -> None:
        """Resume, which does not change a closed port."""
        self.reader.resume()
        self.model.resume()

    @precondition(lambda self: self.written > 4)  # else most sequences are those of closed ports
    @rule()
    def close(self) -> None:
        """Close, which ends all waits; a message that was not read may be lost."""
        self.reader.close()
        self.model.close()
        self.end_waiting({0, 1})

    @invariant()
    def agree(self) -> None:
        """Compare all properties with the model."""
        assert self.reader.interrupted == self.model.interrupted
        assert self.reader.closed == self.model.closed
        if self.model.kind != PLAIN:
            assert (self.reader.pending, self.reader.dropped) == (self.model.pending, self.model.dropped)
        eventually(lambda: self.listed() == sorted(self.model.connected), "the reader does not list its callers")
        assert {writer for writer, call in self.writes.items() if call.waits} >= self.model.busy
        if not self.model.closed:
            assert {name for name, port in self.writers.items() if port.outputs} == self.model.connected

    # How results are compared

    def listed(self) -> list[str]:
        """The callers that the reader lists."""
        return sorted(one.sender for one in self.reader.inputs)

    def compare_reading(self, got: object) -> None:
        """Compare the result of a read with the model; a writer that waited for it has returned."""
        before = self.model.busy
        assert got == self.model.read()
        for writer in before - self.model.busy:
            assert self.writes.pop(writer).result() == 1
        self.await_message()

    def end_reading(self) -> None:
        """Check that the waiting read returns."""
        assert self.reading is not None
        got, self.reading = self.reading.result(), None
        self.compare_reading(got)

    def end_waiting(self, written: set[int]) -> None:
        """Check that all waiting calls return."""
        if self.reading is not None:
            self.end_reading()
        for call in self.writes.values():
            assert call.result() in written
        self.writes.clear()

    def teardown(self) -> None:
        """Close all ports."""
        if hasattr(self, "reader"):
            for port in (self.reader, *self.writers.values()):
                port.close()


@pytest.mark.parametrize("kind", [PLAIN, STRICT, NEWEST])
def test_ports_keep_what_the_model_promises(network: Network, kind: str):
    """Values, order, counts and errors are those of the model, and nothing is left open."""
    run_state_machine_as_test(
        type("Ports", (Ports,), {"kind": kind}),
        settings=settings(
            max_examples=60, stateful_step_count=25, deadline=None, suppress_health_check=[HealthCheck.too_slow]
        ),
    )
