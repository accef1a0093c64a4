"""The port: waiting, lists of connections, and closing."""

from __future__ import annotations

import select
import socket
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle, BottleError
from rtf.middleware.errors import ConnectError, MiddlewareError, PortClosedError, WaitTimeoutError
from rtf.middleware.ports import port as ports
from rtf.middleware.ports.buffered import BufferedPort, Received
from rtf.middleware.ports.inputs import Input
from rtf.middleware.ports.outputs import Output
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.ports.sender import Sender
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.wire import framing
from rtf.middleware.wire.contact import Contact
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.carriers.base import Group
    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage


def in_thread(work: object, *arguments: object) -> threading.Thread:
    """Run a function in a thread."""
    thread = threading.Thread(target=work, args=arguments, daemon=True)  # type: ignore[arg-type]
    thread.start()
    return thread


class TestConnecting:
    """Two threads that make the same connection."""

    def test_two_who_connect_at_the_same_time_leave_one_connection(self, network: Network):
        """Both ends keep the same one of two simultaneous connections."""
        for number in range(150):
            names = f"/reader{number}", f"/writer{number}"
            with Port(names[0], network=network) as reader, Port(names[1], network=network) as writer:
                threads = [in_thread(writer.add_output, names[0]) for _ in range(2)]
                for thread in threads:
                    thread.join(10)
                assert len(writer.outputs) == 1
                written = in_thread(writer.write, Bottle([number]))
                assert reader.read(timeout=5) == Bottle([number])
                written.join(5)

    @pytest.mark.parametrize(
        "handshake",
        [framing.header(0), framing.header(3), b"CONNECT ", b"CONNACK "],
        ids=["udp", "fast_tcp", "text", "text_ack"],
    )
    def test_a_caller_is_listed_before_it_gets_its_reply(self, network: Network, handshake: bytes, monkeypatch):
        """A port lists a caller before it answers the handshake."""
        early: list[bool] = []
        joined = Port.input_opened

        def join(port: Port, caller: Input) -> None:
            early.append(bool(select.select([connection], [], [], 0.05)[0]))
            joined(port, caller)

        monkeypatch.setattr(Port, "input_opened", join)
        with Port("/reader", network=network) as reader:
            connection = socket.create_connection((reader.contact.host, reader.contact.port), timeout=10)
            with connection:
                connection.sendall(handshake + (b"/me\r\n" if handshake.startswith(b"CON") else framing.sender("/me")))
                assert connection.recv(8)
                assert [one.sender for one in reader.inputs] == ["/me"]
        assert early == [False]

    def test_ports_given_by_address_are_told_apart(self, network: Network):
        """Each is called after its address; a second connection to one replaces the first, and it can be removed."""
        with (
            Port("/one", network=network) as one,
            Port("/two", network=network) as two,
            Port("/w", network=network) as writer,
        ):
            here = [f"/{port.contact.host}:{port.contact.port}/" for port in (one, two)]
            for address in (*here, here[0]):
                writer.add_output(address)
            assert sorted(output.peer for output in writer.outputs) == sorted(here)
            thread = in_thread(writer.write, Bottle([1]))
            assert one.read(timeout=5) == two.read(timeout=5) == Bottle([1])
            thread.join()
            assert writer.remove_output(here[0])
            assert [output.peer for output in writer.outputs] == [here[1]]

    def test_a_caller_for_whom_no_thread_is_free_is_cut_off(self, network: Network, monkeypatch: pytest.MonkeyPatch):
        """The error is reported, and the port neither keeps the caller nor waits for it at the end."""
        reported: list[str] = []
        start = threading.Thread.start

        def refuse_inputs(thread: threading.Thread) -> None:
            if thread.name.startswith("rtf-input"):
                raise RuntimeError("can't start new thread")
            start(thread)

        monkeypatch.setattr(threading, "excepthook", lambda args: reported.append(str(args.exc_value)))
        with Port("/reader", network=network) as reader:
            with monkeypatch.context() as patch:
                patch.setattr(threading.Thread, "start", refuse_inputs)
                with socket.create_connection((reader.contact.host, reader.contact.port), timeout=2) as connection:
                    assert connection.recv(1) == b""
            eventually(lambda: reported == ["can't start new thread"], "the error is not reported")
            assert not reader._inputs
            with Port("/writer", network=network) as writer:
                writer.add_output("/reader")

    @pytest.mark.parametrize("stop", [KeyboardInterrupt, ConnectError])
    def test_a_port_whose_construction_is_stopped_is_closed(
        self, network: Network, monkeypatch: pytest.MonkeyPatch, stop: type[BaseException]
    ):
        """A port that nobody owns is not left registered, nor its thread and descriptors."""

        def announce(name: str) -> None:
            assert network.names.query(name)
            raise stop

        with monkeypatch.context() as patch:
            patch.setattr(network.names, "announce", announce)
            with pytest.raises(stop):
                Port("/port", network=network)
        assert network.names.query("/port") is None


class TestWriting:
    """A plain port: several threads that write and connect."""

    def test_each_message_has_its_own_envelope(self, network: Network, monkeypatch: pytest.MonkeyPatch):
        """A message that another thread writes meanwhile has its own envelope, and changes no other one."""
        got: list[tuple[object, str]] = []

        def find_codec(value: object) -> object:
            if value == Bottle([1]):
                writer.write(Bottle([2]), envelope="2 0.2")
            return codec_of(value)

        monkeypatch.setattr(ports, "codec_of", find_codec)
        with (
            Port("/reader", lambda delivery: got.append((delivery.read()[0], delivery.envelope)), network=network),
            Port("/writer", network=network) as writer,
        ):
            writer.add_output("/reader")
            writer.write(Bottle([1]), envelope="1 0.1")
        assert got == [(2, "2 0.2"), (1, "1 0.1")]

    def test_writes_do_not_wait_for_the_name_server(self, network: Network, monkeypatch: pytest.MonkeyPatch):
        """While a name server does not answer the request for a multicast group, messages are written to others."""
        written: list[bool] = []
        register = network.names.register

        def slowly(name: str, **details: object) -> Contact:
            if "/net=" in name:
                thread = in_thread(writer.write, Bottle([1]))
                thread.join(2)
                written.append(not thread.is_alive())
            return register(name, **details)  # type: ignore[arg-type]

        monkeypatch.setattr(network.names, "register", slowly)
        with (
            BufferedPort("/reader", network=network) as reader,
            BufferedPort("/other", network=network),
            Port("/writer", network=network) as writer,
        ):
            writer.add_output("/reader")
            writer.add_output("/other", "mcast")
            assert written[0]
            assert reader.read(timeout=5) == Bottle([1])

    def test_a_closed_port_registers_no_group(self, network: Network):
        """A port that is closed while it connects by multicast leaves no group registered."""

        class ClosedMeanwhile(Port):
            def multicast_group(self, interface: str) -> Group:
                self.close()
                return super().multicast_group(interface)

        with Port("/reader", network=network):
            writer = ClosedMeanwhile("/writer", network=network)
            with pytest.raises(MiddlewareError, match="/writer is closed"):
                writer.add_output("/reader", "mcast")
            assert [contact.name for contact in network.names.list()] == ["/reader"]


class TestReading:
    """A plain port: writers wait until their message is read."""

    def test_writer_waits_for_the_reader(self, network: Network):
        """A write returns after the message has been read."""
        written = threading.Event()
        with Port("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/reader")
            thread = in_thread(lambda: (writer.write(Bottle([1])), written.set()))
            with reader.request(timeout=5) as delivery:
                assert not written.is_set()
                assert delivery.read() == Bottle([1])
                assert not written.is_set()
            assert written.wait(5)
            thread.join()

    def test_messages_of_one_sender_keep_their_order(self, network: Network):
        """Messages of one writer are read in order."""
        with Port("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/reader", "fast_tcp")
            for number in range(100):
                writer.write(Bottle([number]))
            assert [reader.read(timeout=5)[0] for _ in range(100)] == [*range(100)]

    def test_reader_that_waits_too_long_gets_an_error(self, network: Network):
        """A read that times out raises an error with the port's name."""
        with Port("/reader", network=network) as reader, pytest.raises(WaitTimeoutError, match="/reader within"):
            reader.read(timeout=0.01)

    @pytest.mark.parametrize("end", ["interrupt", "close"])
    def test_reader_is_woken(self, network: Network, end: str):
        """Interrupting or closing a port ends a read."""
        woken: list[BaseException] = []
        reader = Port("/reader", network=network)

        def wait() -> None:
            try:
                reader.read()
            except PortClosedError as error:
                woken.append(error)

        thread = in_thread(wait)
        getattr(reader, end)()
        thread.join(5)
        reader.close()
        assert woken

    def test_interrupted_port_throws_messages_away(self, network: Network):
        """An interrupted port drops messages without delaying writers, until it is resumed."""
        with Port("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/reader")
            reader.interrupt()
            assert writer.write(Bottle([1])) == 1
            reader.resume()
            thread = in_thread(writer.write, Bottle([2]))
            assert reader.read(timeout=5) == Bottle([2])
            thread.join()

    def test_a_reader_may_reply(self, network: Network):
        """A reader can reply within the block of ``request``."""
        with Port("/server", network=network) as server, RpcClient("/client", "/server", network=network) as client:

            def serve() -> None:
                with server.request(timeout=5) as delivery:
                    delivery.reply(Bottle(["pong", *delivery.read()]))

            thread = in_thread(serve)
            assert client.call(Bottle(["ping"]), timeout=5) == Bottle(["pong", "ping"])
            thread.join()


class TestBuffered:
    """A buffered port: readers and writers do not wait for each other."""

    def test_newest_is_kept(self, network: Network):
        """A message that was not read is replaced by the next one, and counted as dropped."""
        with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/reader")
            for number in range(10):
                writer.write(Bottle([number]))
            assert reader.pending == 1
            assert reader.read(timeout=5) == Bottle([9])
            assert reader.dropped == 9

    def test_strict_keeps_all(self, network: Network):
        """A strict port keeps all messages, in order."""
        with (
            BufferedPort("/reader", strict=True, network=network) as reader,
            Port("/writer", network=network) as writer,
        ):
            writer.add_output("/reader")
            for number in range(10):
                writer.write(Bottle([number]))
            assert reader.pending == 10
            assert [reader.read(timeout=5)[0] for _ in range(10)] == [*range(10)]

    def test_poll_does_not_wait(self, network: Network):
        """``poll`` returns a message or None, without waiting."""
        with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            assert reader.poll() is None
            writer.add_output("/reader")
            writer.write(Bottle([1]))
            assert reader.poll() == Bottle([1])
            assert reader.poll() is None

    def test_callback_gets_each_in_a_thread_of_its_own(self, network: Network):
        """The callback gets value, sender and envelope, in a thread of the port."""
        got: list[tuple[object, ...]] = []

        def call(received: object) -> None:
            got.append((*received, threading.current_thread().name))  # type: ignore[misc]

        with BufferedPort("/reader", callback=call, network=network), Port("/writer", network=network) as writer:
            writer.add_output("/reader")
            writer.write(Bottle([1]), envelope="7 0.5")
            eventually(lambda: got, "the callback was not called")
        assert got == [(Bottle([1]), "/writer", "7 0.5", "rtf-callback /reader")]

    def test_an_error_of_the_callback_costs_no_other_object(self, network: Network, monkeypatch: pytest.MonkeyPatch):
        """An error of the callback reaches threading.excepthook, and later objects are passed on."""
        reported: list[str] = []
        monkeypatch.setattr(threading, "excepthook", lambda args: reported.append(str(args.exc_value)))
        got: list[object] = []

        def call(received: Received[Bottle]) -> None:
            got.append(received.value[0])
            if got == [0]:
                raise ValueError("no zero")

        with (
            BufferedPort("/reader", strict=True, callback=call, network=network),
            Port("/writer", network=network) as writer,
        ):
            writer.add_output("/reader")
            for number in range(3):
                writer.write(Bottle([number]))
            eventually(lambda: got == [0, 1, 2], "objects are missing", 2.0)
        assert reported == ["no zero"]

    @pytest.mark.parametrize("error", [ValueError, BottleError])
    def test_an_error_of_a_local_reader_ends_its_connection(
        self, network: Network, said: list[str], monkeypatch: pytest.MonkeyPatch, error: type[Exception]
    ):
        """It is raised in the writer's thread: it is reported there, and a strict write that waits is over."""
        waiting = threading.Event()
        wait = Sender.wait
        monkeypatch.setattr(Sender, "wait", lambda self, timeout=None: (waiting.set(), wait(self, timeout))[1])

        def fail(delivery: IncomingMessage) -> None:
            assert waiting.wait(10)
            raise error("a bad message")

        with Port("/reader", fail, network=network), BufferedPort("/writer", network=network) as writer:
            writer.add_output("/reader", "local")
            assert writer.write(Bottle([1])) == 1
            assert writer.write(Bottle([2]), strict=True) == 0
            eventually(lambda: said, "nothing is reported", 2.0)
            assert writer.outputs == ()
            assert writer.write(Bottle([3]), strict=True) == 0
        assert said == ["Removing output from /writer to /reader: a bad message"]

    def test_busy_reader_is_skipped(self, network: Network):
        """A write skips an output that is still busy; a strict one waits for it."""
        leave = threading.Event()
        seen: list[object] = []

        def slowly(delivery: IncomingMessage) -> None:
            seen.append(delivery.read()[0])
            leave.wait(5)

        with Port("/reader", slowly, network=network), BufferedPort("/writer", network=network) as writer:
            writer.add_output("/reader")
            assert writer.write(Bottle([0])) == 1
            eventually(lambda: seen == [0], "the first was not delivered")
            assert writer.write(Bottle([1])) == 0
            leave.set()
            for number in range(2, 20):
                assert writer.write(Bottle([number]), strict=True) == 1
            assert writer.wait(timeout=5)
        assert seen == [0, *range(2, 20)]

    def test_replier_answers_questions(self, network: Network):
        """Requests go to the replier, not into the queue."""

        def reply(delivery: IncomingMessage) -> None:
            delivery.reply(Bottle(["ok"]))

        with (
            BufferedPort("/reader", replier=reply, network=network) as reader,
            RpcClient("/client", "/reader", network=network) as client,
        ):
            assert client.call(Bottle(["?"]), timeout=5) == Bottle(["ok"])
            assert reader.pending == 0

    def test_object_may_be_changed_after_the_write(self, network: Network):
        """A change of the object after ``write`` does not change the message."""
        with BufferedPort("/reader", network=network) as reader, BufferedPort("/writer", network=network) as writer:
            writer.add_output("/reader")
            bottle = Bottle([1])
            writer.write(bottle)
            bottle.append(2)
            assert reader.read(timeout=5) == Bottle([1])


class TestRpc:
    """Requests and replies."""

    def test_each_client_gets_its_own_answers(self, network: Network):
        """Each of several clients gets the replies to its own requests."""

        def client(number: int, wrong: list[object]) -> None:
            with RpcClient(f"/client/{number}", "/server", network=network) as port:
                for count in range(100):
                    answer = port.call(Bottle([number, count]), timeout=10)
                    if answer != Bottle([number, count, "ok"]):
                        wrong.append(answer)

        wrong: list[object] = []
        with RpcServer("/server", lambda question: Bottle([*question, "ok"]), network=network):
            threads = [in_thread(client, number, wrong) for number in range(8)]
            for thread in threads:
                thread.join(30)
        assert wrong == []

    def test_server_takes_no_output_and_client_one(self, network: Network):
        """A server has no outputs and a client has one, with YARP's errors."""
        with RpcServer("/server", lambda question: question, network=network) as server:
            with pytest.raises(ConnectError, match="Outputs not allowed"):
                server.add_output("/server")
            with (
                RpcClient("/client", "/server", network=network) as client,
                pytest.raises(ConnectError, match="RPC output already connected"),
            ):
                client.add_output("/server")

    def test_answer_that_does_not_come_is_not_waited_for(self, network: Network):
        """A request that times out closes its connection, so that its late reply is not taken for the next."""
        leave = threading.Event()

        def slowly(question: Bottle) -> Bottle:
            if question[0] == "slow":
                leave.wait(5)
            return question

        with (
            RpcServer("/server", slowly, network=network),
            RpcClient("/client", "/server", network=network) as client,
        ):
            with pytest.raises(WaitTimeoutError):
                client.call(Bottle(["slow"]), timeout=0.05)
            leave.set()
            with pytest.raises(ConnectError):
                client.call(Bottle(["quick"]), timeout=1)
            client.add_output("/server")
            assert client.call(Bottle(["quick"]), timeout=5) == Bottle(["quick"])

    def test_handler_that_breaks_costs_its_client_the_connection(self, network: Network, said: list[str]):
        """An error of the handler closes the client's connection, and is reported; the server goes on."""

        def handle(question: Bottle) -> Bottle:
            raise ConnectError(f"no {question[0]} here")

        with RpcServer("/server", handle, network=network):
            with RpcClient("/client", "/server", network=network) as client, pytest.raises(MiddlewareError):
                client.call(Bottle(["luck"]), timeout=5)
            eventually(lambda: any("no luck here" in line for line in said), "nobody was reported")
            with RpcClient("/other", "/server", network=network) as client, pytest.raises(MiddlewareError):
                client.call(Bottle(["luck"]), timeout=5)


class TestManyReaders:
    """Ports with several readers."""

    def test_all_readers_get_everything(self, network: Network):
        """A write reaches all readers, and returns their number."""
        readers = [BufferedPort(f"/reader/{number}", strict=True, network=network) for number in range(20)]
        with Port("/writer", network=network) as writer:
            for number, reader in enumerate(readers):
                writer.add_output(reader.name, ("tcp", "fast_tcp", "local", "unix_stream")[number % 4])
            for number in range(20):
                assert writer.write(Bottle([number])) == 20
            for reader in readers:
                assert [reader.read(timeout=5)[0] for _ in range(20)] == [*range(20)]
        for reader in readers:
            reader.close()

    def test_a_broken_reader_affects_no_other(self, network: Network):
        """If one reader fails, the others get the same message."""
        with BufferedPort("/good", strict=True, network=network) as good, Port("/writer", network=network) as writer:
            with socket.create_server(("127.0.0.1", 0)) as listening:
                thread = in_thread(_accept_and_break, listening)
                writer.add_output(Contact("/bad", "127.0.0.1", listening.getsockname()[1], "tcp"))
                writer.add_output("/good")
                thread.join(5)
                for number in range(5):
                    writer.write(Bottle([number]))
            assert [good.read(timeout=5)[0] for _ in range(5)] == [*range(5)]
            assert [output.peer for output in writer.outputs] == ["/good"]


def _accept_and_break(listening: socket.socket) -> None:
    connection, _ = listening.accept()
    connection.recv(100)
    connection.sendall(b"YA\x01\x00\x00\x00RP")
    connection.close()


class TestEnd:
    """Closing."""

    def test_closed_port_says_so(self, network: Network):
        """Every call of a closed port raises PortClosedError."""
        port = Port("/port", network=network)
        port.close()
        port.close()
        for ask in (lambda: port.write(Bottle()), lambda: port.read(timeout=1), lambda: port.add_output("/port")):
            with pytest.raises(PortClosedError, match="/port is closed"):
                ask()
        assert network.names.query("/port") is None

    def test_close_is_possible_in_a_callback(self, network: Network):
        """A callback can close its own port."""
        closed = threading.Event()

        def close(delivery: IncomingMessage) -> None:
            server.close()
            closed.set()

        server = Port("/server", close, network=network)
        with Port("/writer", network=network) as writer:
            writer.add_output("/server")
            writer.write(Bottle([1]))
            assert closed.wait(5)

    def test_the_request_that_ends_a_server_is_answered(self, network: Network, monkeypatch: pytest.MonkeyPatch):
        """The reply is sent, although the port closes while its handler runs."""
        closing, join = threading.Event(), Input.join
        monkeypatch.setattr(Input, "join", lambda self, timeout: (closing.set(), join(self, timeout)))

        def end(request: Bottle) -> str:
            in_thread(server.close)
            assert closing.wait(10)
            return f"{request} ends it"

        server = RpcServer("/server", end, network=network)
        with RpcClient("/client", "/server", network=network) as client:
            assert client.call(Bottle(["quit"]), timeout=10) == Bottle(["quit ends it"])
            eventually(lambda: network.names.query("/server") is None, "the server is not closed")

    @pytest.mark.parametrize(
        "end", [BufferedPort.close, lambda writer: writer.remove_output("/reader")], ids=["close", "remove_output"]
    )
    def test_the_last_message_is_sent_before_the_end(
        self,
        network: Network,
        said: list[str],
        monkeypatch: pytest.MonkeyPatch,
        end: Callable[[BufferedPort[Bottle]], object],
    ):
        """What was written before the connection is ended arrives, however late its thread is."""
        late = threading.Event()
        run, join, close = Sender._run, Sender.join, Output.close
        monkeypatch.setattr(Sender, "_run", lambda self: (late.wait(10), run(self)))
        monkeypatch.setattr(Sender, "join", lambda self, timeout: (late.set(), join(self, timeout)))
        monkeypatch.setattr(Output, "close", lambda self, **how: (close(self, **how), late.set()))
        got: list[object] = []
        with (
            Port("/reader", lambda delivery: got.append(delivery.read()), network=network),
            BufferedPort("/writer", network=network) as writer,
        ):
            writer.add_output("/reader")
            assert writer.write(Bottle([1])) == 1
            end(writer)
            assert got == [Bottle([1])]
        assert said == []

    def test_close_ends_a_write_that_hangs(self, network: Network):
        """Closing a writer ends its write to a reader that does not read."""
        with Port("/reader", network=network):
            writer = Port("/writer", network=network)
            writer.add_output("/reader")
            thread = in_thread(_ignore, writer.write, Bottle([1]))
            eventually(writer.outputs[0].lock.locked, "the write has not begun")
            writer.close()
            thread.join(5)
            assert not thread.is_alive()

    def test_thousand_connections_leave_nothing(self, network: Network):
        """A thousand connections leave no descriptor and no thread."""
        with BufferedPort("/reader", network=network) as reader, Port("/writer", network=network) as writer:
            writer.add_output("/reader")  # now everything is there that will be
            writer.remove_output("/reader")
            eventually(lambda: not reader.inputs, "an input is left")
            before = open_descriptors()
            for count in range(250):
                for carrier in ("tcp", "fast_tcp", "udp", "text_ack"):
                    writer.add_output("/reader", carrier)
                if count % 50 == 49:
                    eventually(lambda: len(reader.inputs) <= 2, "inputs pile up")
            writer.remove_output("/reader")
            eventually(lambda: open_descriptors() <= before, "descriptors pile up")


def _ignore(work: object, *arguments: object) -> None:
    try:
        work(*arguments)  # type: ignore[operator]
    except MiddlewareError:
        return
