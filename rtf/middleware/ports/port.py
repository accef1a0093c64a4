"""The port: a registered name, its incoming connections (inputs) and its outgoing connections (outputs).

As a rule each input has a thread of its own, in which its messages are delivered one after the other. Outputs are
written to in the thread of the caller of ``write``. Subclasses define what a delivery does.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Self, TypeVar, overload

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.bottle.binary import encode
from rtf.middleware.carriers import local, registry
from rtf.middleware.carriers.socket_watcher import SHARED_LISTENER
from rtf.middleware.carriers.stream import Stream
from rtf.middleware.errors import ConnectError, MiddlewareError, NameNotFoundError, PortClosedError, ProtocolError
from rtf.middleware.ports import access, admin, describe, priority
from rtf.middleware.ports.disconnect_sources import disconnect_sources
from rtf.middleware.ports.inputs import Input
from rtf.middleware.ports.message_handoff import MessageHandoff
from rtf.middleware.ports.multicast_groups import MulticastGroups
from rtf.middleware.ports.outputs import Output, connect, send_to_all
from rtf.middleware.ports.port_monitors import PortMonitors
from rtf.middleware.ports.port_page import LastMessages, page_of
from rtf.middleware.types.codecs import BOTTLE, codec_of
from rtf.middleware.wire import modifiers
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.incoming_message import IncomingMessage, LocalMessage
from rtf.middleware.wire.outgoing_message import OutgoingMessage

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from types import TracebackType

    from rtf.errors import RtfError
    from rtf.middleware.carriers.base import Group
    from rtf.middleware.monitors.attached import Attached
    from rtf.middleware.monitors.script import ScriptName
    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.qos import Connection, Qos
    from rtf.middleware.types.codecs import Buffer, Codec
    from rtf.middleware.wire.page import Page

Receiver = Callable[[IncomingMessage], None]
T = TypeVar("T")

#: Maximum number of inputs of a port. Further callers are refused, which bounds threads and memory.
MAX_INPUTS = 1024
_CLOSING = 5.0


class Port:
    """A port, open from construction to ``close``. ``receive`` is called with each message, in the thread of its input.

    Without ``receive`` messages and their senders wait until ``read`` or ``request`` is called. ``network`` is the
    network that the port belongs to; None: that of the process. ``inputs`` and ``outputs`` allow the directions;
    ``rpc`` declares that the port is for requests and replies. ``nonblocking`` promises that ``receive`` returns at
    once, because it only stores the message; it may then be called in a thread that reads other connections, too.
    ``guarded``: only the network's ``writers`` may send messages to it, as to a port whose messages move a robot.
    Raises AddressError, and ConnectError if the name server or the address cannot be used.
    """

    def __init__(
        self,
        name: str,
        receive: Receiver | None = None,
        *,
        network: Network | None = None,
        inputs: bool = True,
        outputs: bool = True,
        rpc: bool = False,
        nonblocking: bool = False,
        promise: str = "",
        guarded: bool = False,
    ) -> None:
        from rtf.middleware.ports.network import default_network

        self.network = network or default_network()
        self.allows_inputs = inputs
        self.allows_outputs = outputs
        self.rpc = rpc
        self.nonblocking = nonblocking
        self.promise = promise
        self.guarded = guarded
        self.properties = Property()
        self.interrupted = False
        self.interruptions = 0  # lets a waiting thread notice an interruption that is already over
        self.envelope = ""
        self._last = LastMessages()  # for the page of the port
        self._receive = receive
        self._handoff = MessageHandoff(name)
        self._lock = threading.Lock()
        self._writing = threading.Lock()
        self._dialled = threading.Condition(self._lock)
        self._dialling: set[str] = set()  # peers with a connection attempt in progress
        self._inputs: dict[Input, None] = {}
        self._priorities = priority.PriorityGroup(lambda text: self.network.report(f"{self.name}: {text}"))
        self._monitors = PortMonitors(lambda text: self.network.report(f"{self.name}: {text}"))
        self._outputs: tuple[Output, ...] = ()
        self._groups = MulticastGroups()
        self._closed = False
        self._listening, self.contact = self.network.open_address(name, promise)
        try:
            local.enrol(self)
            SHARED_LISTENER.add(self._listening, self._called)
            self.network.names.announce(self.contact.name)
        except BaseException:  # such as a stop of the test
            self.close()
            raise

    @property
    def name(self) -> str:
        """The registered name."""
        return self.contact.name

    # Reading -----------------------------------------------------------------------------------------------------

    def request(self, timeout: float | None = None) -> AbstractContextManager[IncomingMessage]:
        """Wait for the next message, to be read and replied to in the block: ``with port.request() as message: …``.

        The sender waits until the block is left. Raises WaitTimeoutError, and PortClosedError if the port is
        interrupted or closed meanwhile.
        """
        self._check_open()
        return self._handoff.take(timeout)

    @overload
    def read(self, *, timeout: float | None = None) -> Bottle: ...
    @overload
    def read(self, codec: Codec[T], timeout: float | None = None) -> T: ...
    def read(self, codec: Codec[Any] = BOTTLE, timeout: float | None = None) -> Any:
        """Return the object in the next message. Its sender continues when it is decoded.

        Raises the same errors as ``request``.
        """
        with self.request(timeout) as delivery:
            return delivery.read(codec)

    # Writing -----------------------------------------------------------------------------------------------------

    def write(self, value: object, codec: Codec[object] | None = None, *, envelope: str | None = None) -> int:
        """Send an object to every output and wait for those that acknowledge. Return how many outputs succeeded.

        ``envelope`` is a text that travels beside the object, and beside all that follow until another one is given.
        """
        message = self._message(value, codec, envelope)
        if message is None:
            return 0
        with self._writing:
            return send_to_all(self._outputs, message, self._lost)

    def _message(self, value: object, codec: Codec[Any] | None, envelope: str | None) -> OutgoingMessage | None:
        """Return an object as a message to the outputs, and keep it for the page; None if there are no outputs."""
        self._check_open()
        if envelope is None:
            envelope = self.envelope
        self.envelope = envelope
        if not self._outputs:
            return None
        codec = codec or codec_of(value)
        message = self._last.written = OutgoingMessage("D", value, codec, self.network.dialect, envelope)
        return message

    def _lost(self, output: Output, error: BaseException) -> None:
        """Remove an output whose connection failed during a write."""
        known = self._forget(output)
        output.close(politely=False)
        if known:  # else another thread has ended the connection
            self.network.report(f"Removing output from {self.name} to {output.peer}: {error}")

    # Outputs -----------------------------------------------------------------------------------------------------

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The outgoing connections."""
        return self._outputs

    def add_output(self, target: str | Contact, carrier: str = "") -> Contact:
        """Connect to a port, given by name (``/x``, ``udp://x``) or by address. Return its resolved contact.

        An existing connection to the same port is replaced; ports of which only addresses are given are told apart by
        these. By a carrier whose reader opens the connection, such as
        ``mjpeg``, the port becomes an input. Raises ConnectError, NameNotFoundError.
        """
        self._check_open()
        contact = Contact.parse(target) if isinstance(target, str) else target
        found = self.network.resolve(contact)
        if found is None:
            raise NameNotFoundError(f"Do not know how to connect to {contact.name}")
        found = found.named().by(carrier or contact.carrier or found.carrier or "tcp")
        priority.check_output(found.carrier)
        if registry.by_name(found.carrier).pull:
            self._pull(found)
            return found
        if not self.allows_outputs:
            raise ConnectError("Outputs not allowed")
        with self._one_at_a_time(found.name):
            self.remove_output(found.name)
            output = connect(self.network, self, found)
            try:
                self._monitors.at_output(output, self.name, found)
            except BaseException:
                output.close()
                raise
            self._take_in(output)
        return found

    @contextlib.contextmanager
    def _one_at_a_time(self, peer: str) -> Iterator[None]:
        """Serialise connection attempts to the same port.

        The peer keeps the connection that arrived last; of two concurrent ones this end would keep the other.
        """
        with self._dialled:
            self._dialled.wait_for(lambda: peer not in self._dialling)
            self._dialling.add(peer)
        try:
            yield
        finally:
            with self._dialled:
                self._dialling.discard(peer)
                self._dialled.notify_all()

    def adopt(self, output: Output) -> None:
        """Use a connection that the peer has opened as an output. Raises ConnectError if outputs are not allowed.

        A lost peer is noticed only by the next write, so the number of outputs is limited.
        """
        if not self.allows_outputs:
            raise ConnectError("Outputs not allowed")
        if len(self._outputs) >= MAX_INPUTS:
            raise ConnectError(f"{self.name} sends to {MAX_INPUTS} ports already")
        self.remove_output(output.peer)
        self._take_in(output)

    def end_output(self, output: Output) -> None:
        """Remove an output whose reader is gone. Any thread."""
        self._forget(output)
        output.close(politely=False)

    def _take_in(self, output: Output) -> None:
        output.source, output.others = self.name, self._output_monitors
        with self._lock:
            output.port_monitor = self._monitors.of("out")
            welcome = not self._closed
            older = [one for one in self._outputs if one.peer == output.peer]  # made by another thread in the meantime
            if welcome:
                self._outputs = (*self._outputs, output)
        if not welcome:
            output.close(politely=False)
            raise PortClosedError(f"{self.name} is closed")
        for one in older:
            self._forget(one)
            one.close()
        self.network.notice(f"Sending output from {self.name} to {output.peer} using {output.carrier}")
        self.connected(output)

    def _pull(self, source: Contact) -> None:
        """Open a connection by which the port at ``source`` sends to this one."""
        if not self.allows_inputs:
            raise ConnectError("Inputs not allowed")
        stream = self.network.reach(source)
        try:
            link = registry.by_name(source.carrier).pull_from(stream, source)
            link.modifiers = modifiers.split(source.carrier)[1]
            if not self._start_input(Input(self, stream, link)):
                raise ConnectError(f"{self.name} is closed, or receives from {MAX_INPUTS} ports already")
        except (MiddlewareError, OSError) as error:
            stream.close()
            raise ConnectError(f"Cannot connect to {source.name}: {error}") from None

    def multicast_group(self, interface: str) -> Group:
        """Return the multicast group that this port sends to on an interface. The first call creates it."""
        return self._groups.on(interface, self.name, self.network.names)

    def remove_output(self, name: str) -> bool:
        """End the output to a port. Return False if there is none."""
        gone = [output for output in self._outputs if output.peer == name]
        for output in gone:
            self._forget(output)
            output.close()
        return bool(gone)

    def _forget(self, output: Output) -> bool:
        """Take an output out of the list. Return whether it was there: several threads may notice the loss."""
        with self._lock:
            known = output in self._outputs
            self._outputs = tuple(one for one in self._outputs if one is not output)
        if known:
            self.network.notice(f"Removing output from {self.name} to {output.peer}")
        self.disconnected(output)
        return known

    def connected(self, output: Output) -> None:
        """Hook for subclasses: an output was added."""

    def disconnected(self, output: Output) -> None:
        """Hook for subclasses: an output was removed."""

    # Pages ---------------------------------------------------------------------------------------------------------

    def page(self) -> Page:
        """Return what the port shows of itself in a browser. Any thread."""
        return page_of(
            self._last,
            self.outputs,
            self.inputs,
            promise=self.promise,
            requests=self.allows_inputs,
            pictures=self.allows_outputs and self.promise == "yarp/image",
        )

    # Inputs ------------------------------------------------------------------------------------------------------

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The incoming connections whose handshake is done, without those that became outputs."""
        with self._lock:
            return tuple(one for one in self._inputs if one.link is not None and not one.turned)

    def remove_input(self, name: str) -> bool:
        """End the inputs from a port. Return False if there is none."""
        gone = [one for one in self.inputs if one.sender == name]
        for one in gone:
            one.close()
        return bool(gone)

    def _called(self, connection: socket.socket) -> None:
        """Accept a connection. Runs in the listener's thread."""
        with contextlib.suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        taken = False
        try:
            taken = self._start_input(Input(self, Stream(connection)))
        finally:
            if not taken:
                connection.close()

    def _start_input(self, caller: Input) -> bool:
        """Add an input and start its thread. Return False if the port is closed or has too many."""
        with self._lock:
            if len(self._inputs) >= MAX_INPUTS:
                self._make_room()
            welcome = not self._closed and len(self._inputs) < MAX_INPUTS
            if welcome:
                caller.start()  # under the lock, and first: an input in the table has a running thread
                self._inputs[caller] = None
        return welcome

    def _make_room(self) -> None:
        """Drop the oldest connection without a handshake: a real caller sends it at once."""
        silent = next((one for one in self._inputs if one.link is None), None)
        if silent is not None:
            del self._inputs[silent]
            silent.close()

    def input_opened(self, caller: Input) -> None:
        """Add an input whose handshake is done and end an older one from the same port. Runs in the input's thread."""
        assert caller.link is not None
        caller.priority = priority.of_input(caller.sender, caller.link.modifiers)
        self._monitors.at_input(caller, self.name)
        if caller.priority is not None:
            self._priorities.add(caller.priority)
        if not caller.sender.startswith("/"):
            return
        for other in self.inputs:
            if other is caller:
                break  # later connections follow in the table; they may have been faster with the handshake
            if other.sender == caller.sender:
                other.close()
        caller.announced = True
        self.network.notice(f"Receiving input from {caller.sender} to {self.name} using {caller.carrier}")

    def input_closed(self, caller: Input) -> None:
        """Remove an input that has ended. Runs in the input's thread."""
        with self._lock:
            self._inputs.pop(caller, None)
        if caller.priority is not None:
            self._priorities.discard(caller.priority)
        if caller.monitor is not None:
            caller.monitor.end()
        if caller.announced:
            self.network.notice(f"Removing input from {caller.sender} to {self.name}")

    def report_broken_input(self, caller: Input, error: RtfError) -> None:
        """Report a protocol error of a caller. Runs in the input's thread, which ends."""
        self.network.report(f"{self.name}: {caller.sender or 'a caller'} was cut off: {error}")

    def dispatch(self, caller: Input, key: str, text: str, data: Buffer) -> Sequence[Buffer]:
        """Execute a message. Return the bytes of the reply. Runs in the thread of the input."""
        link = caller.link
        assert link is not None
        if key in _DATA:
            if self.guarded and not self.network.writers.allows(link.sender, caller.socket):
                raise ProtocolError("it is not among the allowed writers of this port")
            if caller.priority is not None and not self._priorities.accepts(caller.priority, clock.current().now()):
                return _NO_REPLY if key == "d" and not link.carrier.text else ()
            asks, in_lines, own = key == "d", link.carrier.text, len(data) > link.reuses
            delivery = IncomingMessage(link.sender, text, data, caller.dialect, asks, in_lines, own)
            if caller.monitor is None and self._monitors.of("in") is None:
                self.deliver(delivery)
            else:
                passed = self._monitors.deliver(
                    delivery, caller, self.name, others=self._input_monitors, deliver=self.deliver
                )
                if passed is None:
                    return _NO_REPLY if asks and not in_lines else ()
                delivery = passed
            caller.dialect = delivery.dialect
            self._last.receive(caller, data)
            return delivery.answer or (_NO_REPLY if asks and not in_lines else ())
        if key == "a":
            delivery = IncomingMessage(link.sender, "", data, caller.dialect, wants_reply=True, text=link.carrier.text)
            request = delivery.read()
            allowed = not admin.changes(request) or self._may_administer(caller)
            delivery.reply(admin.answer(self, request) if allowed else admin.NOT_ALLOWED)
            return delivery.answer
        allowed = not describe.changes(key, text) or self._may_administer(caller) or self._ends_own(caller, text)
        answer = describe.answer(self, key, text) if allowed else f"{describe.NOT_ALLOWED}\r\n"
        return (answer.encode("utf-8", "surrogateescape"),) if link.carrier.text else ()

    def _input_monitors(self) -> list[Attached]:
        return [one.monitor for one in self.inputs if one.monitor is not None]

    def _output_monitors(self) -> list[Attached]:
        return [one.monitor for one in self._outputs if one.monitor is not None]

    def attach_monitor(self, way: str, name: ScriptName | None) -> bool:
        """Have a script look at all messages that come ``in`` or go ``out``; None ends that, and says if there was one.

        Messages that ports of this process pass as objects (``local``) are not among them. Raises ConnectError.
        """
        before = self._monitors.attach(way, name, self.name)
        if way == "out":
            with self._lock:
                for output in self._outputs:
                    output.port_monitor = self._monitors.of("out")
        if before is not None:
            before.end()  # last: a message may pass meanwhile
        return before is not None

    def port_monitor(self, way: str) -> Attached | None:
        """The script that looks at all messages in a direction."""
        return self._monitors.of(way)

    def _may_administer(self, caller: Input) -> bool:
        """Return whether a caller may change connections: by its address, as callers for that have no names."""
        return self.network.admins.allows("", caller.socket)

    def _ends_own(self, caller: Input, text: str) -> bool:
        """Return whether a caller ends a connection from its own machine, as senders of datagrams do."""
        own = access.address_of(caller.socket)
        return text[:1] == "~" and any(
            one.sender == text[1:] and access.address_of(one.socket) == own for one in self.inputs
        )

    def hand_over(self, sender: str, message: OutgoingMessage) -> tuple[object, Codec[object]] | None:
        """Deliver an object from a port of this process, in that port's thread. Return the reply and its codec."""
        handed = LocalMessage(sender, message)
        self.deliver(handed)
        return handed.replied

    @property
    def closed(self) -> bool:
        """Whether the port is closed."""
        return self._closed

    def deliver(self, delivery: IncomingMessage) -> None:
        """Pass a message to the owner. Overridden by subclasses."""
        if self.interrupted:
            return
        if self._receive is not None:
            self._receive(delivery)
        else:
            self._handoff.offer(delivery)

    # Quality of service ------------------------------------------------------------------------------------------

    def set_qos(self, peer: str, wanted: Qos) -> None:
        """Set the priorities of the connections with a port, in both directions.

        Raises ConnectError if there is none, and QosError if they cannot be set. The other end is not changed;
        :func:`rtf.middleware.ports.remote.set_connection_qos` sets both ends.
        """
        connections: list[Connection] = [one for one in (*self.outputs, *self.inputs) if one.peer == peer]
        if not connections:
            raise ConnectError(f"{self.name} is not connected with {peer}")
        for connection in connections:
            connection.apply(wanted)

    # Closing -----------------------------------------------------------------------------------------------------

    def interrupt(self) -> None:
        """Wake all threads that wait in the port. Messages that arrive are discarded until ``resume``."""
        with self._lock:
            self.interrupted = True
            self.interruptions += 1
            self._handoff.set_open(is_open=False)

    def resume(self) -> None:
        """Accept messages again. Has no effect on a closed port."""
        with self._lock:
            if not self._closed:
                self.interrupted = False
                self._handoff.set_open(is_open=True)

    def close(self) -> None:
        """End all connections and unregister the name. A second call has no effect."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self.interrupt()
        SHARED_LISTENER.remove(self._listening)
        for output in self._outputs:
            self._forget(output)
            output.close()
        with self._lock:
            callers = [*self._inputs]
        disconnect_sources(self.network, self.name, callers)
        for caller in callers:
            caller.close()
        deadline = clock.Deadline.after(_CLOSING)
        for caller in callers:
            caller.join(deadline.remaining())
        self._monitors.end()
        with contextlib.suppress(MiddlewareError):  # a name server that is gone has forgotten the names
            for name in (*self._groups.close(), self.name):
                self.network.names.unregister(name)

    def _check_open(self) -> None:
        if self._closed:
            raise PortClosedError(f"the port {self.name} is closed")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


_DATA = ("D", "d")
_NO_REPLY: tuple[Buffer, ...] = (encode(Bottle()),)
