"""The rules of ports for threads, under every schedule of small programs.

Ports are connected by ``local`` and without a handshake, so that only threads of the program take part.
"""

from __future__ import annotations

import socket
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any
from unittest import mock

import pytest

from rtf.bottle import Bottle
from rtf.middleware.carriers import local
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.errors import PortClosedError, WaitTimeoutError
from rtf.middleware.ports import buffered, message_handoff, outputs, port, sender
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.outputs import Output
from rtf.middleware.ports.port import Port
from schedules import explore, start, together

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from schedules import Control

MODULES = (port, buffered, outputs, message_handoff, sender, local)
#: The attributes that ports and their parts read without a lock.
SHARED = {Port: ("interrupted", "_closed", "_outputs"), BufferedPort: ("_ended", "_queue")}


class Deaf:
    """Replaces the listener, whose thread the programs do not need."""

    def add(self, listening: socket.socket, take: object) -> None:
        """See Listener."""

    def remove(self, listening: socket.socket) -> None:
        """See Listener."""
        listening.close()


class Scene:
    """A network for the ports of a program."""

    def __init__(self, network: Network) -> None:
        self.network = network

    def explore(self, program: Callable[[Control], None], preemptions: int = 2) -> None:
        """Run all schedules of a program with ports."""
        with mock.patch.object(port, "SHARED_LISTENER", Deaf()):
            explore(program, *MODULES, preemptions=preemptions, shared=SHARED)

    @contextmanager
    def pair(
        self, control: Control, reader: Callable[[], Port], writer: type[Port] = Port, *, connected: bool = True
    ) -> Iterator[tuple[Any, Any]]:
        """Yield two ports that are opened, connected and closed without other schedules."""
        with control.undisturbed():
            reads, writes = reader(), writer("/writer", network=self.network)
            if connected:
                writes.adopt(output_to(writes, reads))
        yield reads, writes
        with control.undisturbed():
            writes.close()
            reads.close()

    def reader(self, **options: object) -> BufferedPort[Bottle]:
        """Return a buffered port that keeps all messages."""
        return BufferedPort("/reader", network=self.network, strict=True, **options)  # type: ignore[arg-type]

    def plain(self) -> Port:
        """Return a plain port, whose writers wait for the reader."""
        return Port("/reader", network=self.network)


def output_to(writer: Port, reader: Port) -> Output:
    """Return a connection within this process, without a handshake."""
    link = local.LocalOutput(local.Local(), Stream(socket.socket()), writer.name, reader)
    return Output(link, reader.contact.by("local"), lambda: writer.network.dialect)


@pytest.fixture
def scene(network: Network) -> Scene:
    """The network of the programs."""
    return Scene(network)


class Readings:
    """The results of reading a port."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self.got: list[object] = []
        self.closed = 0
        self.late = 0

    def read(self, timeout: float | None = None) -> None:
        """Read once, and keep the result."""
        try:
            self.got.append(self.port.read(timeout=timeout)[0])
        except PortClosedError:
            self.closed += 1
        except WaitTimeoutError:
            self.late += 1


class TestEither:
    """Plain and buffered ports."""

    @pytest.fixture(params=[Scene.plain, Scene.reader], ids=["plain", "buffered"])
    def make(self, request: pytest.FixtureRequest, scene: Scene) -> Callable[[], Port]:
        """A function that makes the port."""
        return partial(request.param, scene)

    def test_read_with_a_limit_and_write_and_close(self, scene: Scene, make: Callable[[], Port]):
        """A read with a timeout has exactly one result: a message, a closed port, or the timeout."""

        def program(control: Control) -> None:
            with scene.pair(control, make) as (reader, writer):
                readings = Readings(reader)

                def read() -> None:
                    readings.read(timeout=1.0)

                def write() -> None:
                    writer.write(Bottle([7]))

                together(control, read, write, reader.close)
                assert len(readings.got) + readings.closed + readings.late == 1

        scene.explore(program)

    def test_two_readers_of_which_one_does_not_wait_long(self, scene: Scene, make: Callable[[], Port]):
        """A message goes to one of two readers, and is not lost if the other one times out."""

        def program(control: Control) -> None:
            with scene.pair(control, make) as (reader, writer):
                quick, patient = Readings(reader), Readings(reader)

                def quickly() -> None:
                    quick.read(timeout=1.0)

                def patiently() -> None:
                    patient.read()

                def write() -> None:
                    writer.write(Bottle([1]))

                short, long = start(control, quickly, patiently)
                control.pause("write", lambda: all(one.what == "be notified" or not one.alive for one in (short, long)))
                write()
                short.join()
                if quick.got:
                    write()
                long.join()
                assert patient.got == [1]

        scene.explore(program)

    def test_interrupt_wakes_readers(self, scene: Scene, make: Callable[[], Port]):
        """An interrupt wakes a waiting reader, also if the port is resumed at once.

        The second interrupt is only for a reader that did not wait yet.
        """

        def program(control: Control) -> None:
            with scene.pair(control, make) as (reader, _):
                readings = Readings(reader)
                (reading,) = start(control, readings.read)
                control.pause("interrupt")
                with control.undisturbed():
                    waited = reading.what == "be notified"
                    reader.interrupt()
                    reader.resume()
                if not waited:
                    reader.interrupt()
                reading.join()
                assert readings.closed == 1

        scene.explore(program)

    def test_resume_does_not_open_what_is_closed(self, scene: Scene, make: Callable[[], Port]):
        """A reader of a port that is closed gets an error, also if another thread resumes the port."""

        def program(control: Control) -> None:
            with scene.pair(control, make) as (reader, _):
                readings = Readings(reader)
                together(control, readings.read, reader.close, reader.resume)
                assert readings.closed == 1

        scene.explore(program)


class TestPort:
    """A plain port."""

    def test_write_write_read_close(self, scene: Scene):
        """A written message is read first; closing the reader ends the next write."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.plain) as (reader, writer):
                readings = Readings(reader)
                done = []

                def write() -> None:
                    done.extend(writer.write(Bottle([number])) for number in range(2))

                def read_and_close() -> None:
                    readings.read()
                    reader.close()

                together(control, write, read_and_close)
                assert readings.got == [0]
                assert done[0] == 1
                assert len(done) == 2

        scene.explore(program)

    def test_interrupt_and_resume_at_the_same_time(self, scene: Scene):
        """After interrupt and resume at once the parts of the port agree on its state."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.plain) as (reader, _):
                together(control, reader.interrupt, reader.resume)
                with control.undisturbed():
                    assert reader.interrupted is not reader._handoff._open

        scene.explore(program)

    def test_connecting_twice_leaves_one_connection(self, scene: Scene):
        """Two threads that connect the same ports leave one connection."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.plain) as (reader, writer):

                def connect() -> None:
                    writer.adopt(output_to(writer, reader))

                together(control, connect, connect)
                with control.undisturbed():
                    assert [output.peer for output in writer.outputs] == ["/reader"]

        scene.explore(program)


class TestBuffered:
    """A buffered port that keeps all messages."""

    def test_strict_writes_are_read_whatever_happens_to_the_writer(self, scene: Scene):
        """Strict messages arrive once and in order, also if the writer is interrupted between them."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.reader, BufferedPort) as (reader, writer):
                readings = Readings(reader)

                def write() -> None:
                    assert writer.write(Bottle([0]), strict=True) == 1
                    writer.interrupt()
                    assert writer.write(Bottle([1]), strict=True) == 1

                def read() -> None:
                    readings.read()
                    readings.read()

                together(control, read, write)
                assert readings.got == [0, 1]

        scene.explore(program)

    def test_strict_writers_wait_for_each_other(self, scene: Scene):
        """Two strict writes at once are both sent."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.reader, BufferedPort) as (reader, writer):
                taken = []

                def write() -> None:
                    taken.append(writer.write(Bottle([1]), strict=True))

                together(control, write, write)
                assert taken == [1, 1]
                with control.undisturbed():
                    assert writer.wait()
                    assert reader.pending == 2

        scene.explore(program)

    def test_read_and_interrupt(self, scene: Scene):
        """A reader gets messages in order until the interrupt, then an error."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.reader) as (reader, writer):
                readings = Readings(reader)

                def write() -> None:
                    assert [writer.write(Bottle([number])) for number in range(2)] == [1, 1]

                def read() -> None:
                    readings.read()
                    readings.read()

                together(control, write, read, reader.interrupt)
                assert readings.got == [0, 1][: len(readings.got)]
                assert len(readings.got) + readings.closed == 2

        scene.explore(program)

    def test_callback_interrupt_and_close(self, scene: Scene):
        """The callback's thread ends with the port, and calls at most once for each message."""

        def program(control: Control) -> None:
            called = []

            def make() -> Port:
                return scene.reader(callback=lambda received: called.append(received.value[0]))

            with scene.pair(control, make) as (reader, writer):

                def write() -> None:
                    writer.write(Bottle([0]))

                def write_and_interrupt() -> None:
                    write()
                    reader.interrupt()

                together(control, write_and_interrupt, reader.close)
            assert called in ([], [0])

        scene.explore(program)

    def test_callback_interrupt_and_resume(self, scene: Scene):
        """Messages before an interrupt reach the callback after the port is resumed."""

        def program(control: Control) -> None:
            called = []
            full = control.Event()

            def call(received: object) -> None:
                called.append(received.value[0])  # type: ignore[attr-defined]
                if len(called) == 2:
                    full.set()

            with scene.pair(control, lambda: scene.reader(callback=call)) as (reader, writer):
                with control.undisturbed():
                    writer.write(Bottle([0]))

                def write_later() -> None:
                    reader.interrupt()
                    reader.resume()
                    writer.write(Bottle([1]))

                together(control, write_later)
                full.wait()
            assert called == [0, 1]

        scene.explore(program)

    def test_connect_and_close(self, scene: Scene):
        """A connection that is made while the port closes leaves no thread."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.reader, BufferedPort, connected=False) as (reader, writer):

                def connect() -> None:
                    with suppress(PortClosedError):
                        writer.adopt(output_to(writer, reader))

                together(control, connect, writer.close)
                control.pause("be the only thread", lambda: len(control.enumerate()) == 1)
                with control.undisturbed():
                    assert writer.outputs == ()

        scene.explore(program)

    def test_connect_and_disconnect(self, scene: Scene):
        """A write reaches the listed outputs only, whatever the order of connecting and disconnecting."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.reader, BufferedPort, connected=False) as (reader, writer):

                def connect() -> None:
                    writer.adopt(output_to(writer, reader))

                def disconnect() -> None:
                    writer.remove_output("/reader")

                together(control, connect, disconnect)
                with control.undisturbed():
                    assert writer.write(Bottle([1]), strict=True) == len(writer.outputs)

        scene.explore(program)

    def test_strict_write_and_disconnect(self, scene: Scene):
        """Removing an output ends a strict write to it, and the output's thread."""

        def program(control: Control) -> None:
            with scene.pair(control, scene.reader, BufferedPort) as (reader, writer):

                def write() -> None:
                    writer.write(Bottle([7]), strict=True)

                def disconnect() -> None:
                    writer.remove_output("/reader")

                together(control, write, disconnect)
                control.pause("be the only thread", lambda: len(control.enumerate()) == 1)
                with control.undisturbed():
                    assert reader.pending <= 1

        scene.explore(program)
