"""The port: a name in the network, inputs that arrive at it, outputs that leave it.

Each input has a thread of its own, as a rule, in which its messages are delivered, one after the other; outputs are
written to in the thread of whoever writes. What a delivery means is the business of the kinds of ports that are built
on this one.
"""

from __future__ import annotations

import contextlib
import errno
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Self, TypeVar, overload

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.bottle.binary import encode
from rtf.middleware import admin, describe, leaving
from rtf.middleware.carriers import local, registry
from rtf.middleware.codecs import BOTTLE, codec_of
from rtf.middleware.delivery import Delivery, HandedOver
from rtf.middleware.errors import ConnectError, MiddlewareError, NameNotFoundError, PortClosedError
from rtf.middleware.inputs import Input
from rtf.middleware.listener import SHARED
from rtf.middleware.names import Contact
from rtf.middleware.outgoing import Outgoing
from rtf.middleware.outputs import Output, send_to_all
from rtf.middleware.rendezvous import Rendezvous

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from types import TracebackType

    from rtf.errors import RtfError
    from rtf.middleware.carriers.base import Buffer
    from rtf.middleware.carriers.datagram import Group
    from rtf.middleware.codecs import Codec
    from rtf.middleware.network import Network
    from rtf.middleware.qos import Connection, Qos

Receiver = Callable[[Delivery], None]
T = TypeVar("T")

#: Callers that a port has at a time; further ones are refused, so that a flood costs bounded threads and memory.
MAX_INPUTS = 1024
_CLOSING = 5.0
#: Datagrams leave from the number of the handshake, which somebody else may have for datagrams; the next is another.
_ATTEMPTS = 5


class Port:
    """A port, open from its making to ``close``. ``receive`` is called with each delivery, in its input's thread.

    Without ``receive`` messages wait, and their senders with them, until somebody calls ``read`` or ``request``.
    ``network`` is the network it is part of; without one that of the process. ``inputs`` and ``outputs`` say which
    directions are allowed, ``rpc`` that it answers questions or asks them. ``keeps``: ``receive`` never waits, as it
    only keeps what it is given, and may be called in a thread that reads other connections, too. Raises AddressError,
    and ConnectError when the name server or the address cannot be had.
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
        keeps: bool = False,
        promise: str = "",
    ) -> None:
        from rtf.middleware.network import default_network

        self.network = network or default_network()
        self.allows_inputs = inputs
        self.allows_outputs = outputs
        self.rpc = rpc
        self.keeps = keeps
        self.promise = promise
        self.properties = Property()
        self.interrupted = False
        self.interruptions = 0  # so that who waits knows of one that is over already
        self.envelope = ""
        self._receive = receive
        self._rendezvous = Rendezvous(name)
        self._lock = threading.Lock()
        self._writing = threading.Lock()
        self._dialled = threading.Condition(self._lock)
        self._dialling: set[str] = set()  # peers that are being connected to
        self._inputs: dict[Input, None] = {}
        self._outputs: tuple[Output, ...] = ()
        self._groups: dict[str, Group] = {}
        self._closed = False
        self._listening, self.contact = self.network.open_address(name, promise)
        local.enrol(self)
        SHARED.add(self._listening, self._called)
        try:
            self.network.names.announce(self.contact.name)
        except MiddlewareError:
            self.close()
            raise

    @property
    def name(self) -> str:
        """The registered name."""
        return self.contact.name

    # Reading -----------------------------------------------------------------------------------------------------

    def request(self, timeout: float | None = None) -> AbstractContextManager[Delivery]:
        """The next message, to be read and replied to in the block: ``with port.request() as delivery: …``.

        Its sender waits until the block is left. Raises WaitTimeoutError, and PortClosedError when the port is
        interrupted or closed meanwhile.
        """
        self._check_open()
        return self._rendezvous.take(timeout)

    @overload
    def read(self, *, timeout: float | None = None) -> Bottle: ...
    @overload
    def read(self, codec: Codec[T], timeout: float | None = None) -> T: ...
    def read(self, codec: Codec[Any] = BOTTLE, timeout: float | None = None) -> Any:
        """The object in the next message; its sender goes on when it has been read. Errors as for ``request``."""
        with self.request(timeout) as delivery:
            return delivery.read(codec)

    # Writing -----------------------------------------------------------------------------------------------------

    def write(self, value: object, codec: Codec[object] | None = None, *, envelope: str | None = None) -> int:
        """Send an object to every output, and wait until all that acknowledge have dealt with it. Returns how many did.

        ``envelope`` is a text that travels beside it, and beside all that follows until there is another one.
        """
        self._check_open()
        if envelope is not None:
            self.envelope = envelope
        outputs = self._outputs
        if not outputs:
            return 0
        message = Outgoing("D", value, codec or codec_of(value), self.network.dialect, self.envelope)
        with self._writing:
            return send_to_all(outputs, message, self._lost)

    def _lost(self, output: Output, error: BaseException) -> None:
        """An output broke while it was written to."""
        self._forget(output)
        output.close(politely=False)
        self.network.report(f"Removing output from {self.name} to {output.peer}: {error}")

    # Outputs -----------------------------------------------------------------------------------------------------

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The connections it sends through."""
        return self._outputs

    def add_output(self, target: str | Contact, carrier: str = "") -> Contact:
        """Connect to a port, which is named (``/x``, ``udp://x``) or addressed. Returns where it was found.

        A connection to the same port that exists already is replaced. Raises ConnectError, NameNotFoundError.
        """
        self._check_open()
        if not self.allows_outputs:
            raise ConnectError("Outputs not allowed")
        contact = Contact.parse(target) if isinstance(target, str) else target
        found = self.network.resolve(contact)
        if found is None:
            raise NameNotFoundError(f"Do not know how to connect to {contact.name}")
        found = found.by(carrier or contact.carrier or found.carrier or "tcp")
        with self._one_at_a_time(found.name):
            self.remove_output(found.name)
            self._take_in(self._connect(found))
        return found

    @contextlib.contextmanager
    def _one_at_a_time(self, peer: str) -> Iterator[None]:
        """Let nobody else connect to the same port meanwhile.

        It keeps the connection that came last; of two that crossed this end would keep the other.
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
        """Send through a connection that somebody else has made. Raises ConnectError where it may not.

        Whether the other end is still there shows when it is written to, so there are only so many of them.
        """
        if not self.allows_outputs:
            raise ConnectError("Outputs not allowed")
        if len(self._outputs) >= MAX_INPUTS:
            raise ConnectError(f"{self.name} sends to {MAX_INPUTS} ports already")
        self.remove_output(output.peer)
        self._take_in(output)

    def _take_in(self, output: Output) -> None:
        with self._lock:
            welcome = not self._closed
            older = [one for one in self._outputs if one.peer == output.peer]  # which somebody else has just made
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

    def _connect(self, target: Contact) -> Output:
        carrier = registry.by_name(target.carrier)
        for left in reversed(range(_ATTEMPTS)):
            stream = self.network.reach(target)
            try:
                link = carrier.connect(stream, self, target)
                stream.limit_waiting(None)
                break
            except (MiddlewareError, OSError) as error:
                stream.close()
                taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
                if not (taken and left):
                    raise ConnectError(f"Cannot connect to {target.name}: {error}") from None
        return Output(link, target)

    def multicast_group(self, interface: str) -> Group:
        """The group that this port sends to on an interface; made when it is first asked for."""
        from rtf.middleware.carriers.datagram import Group

        with self._writing:
            if interface not in self._groups:
                self._groups[interface] = Group(self, interface)
            return self._groups[interface]

    def remove_output(self, name: str) -> bool:
        """End the connection to a port; False when there is none."""
        gone = [output for output in self._outputs if output.peer == name]
        for output in gone:
            self._forget(output)
            output.close()
        return bool(gone)

    def _forget(self, output: Output) -> None:
        with self._lock:
            known = output in self._outputs
            self._outputs = tuple(one for one in self._outputs if one is not output)
        if known:  # several threads may find out at the same time
            self.network.notice(f"Removing output from {self.name} to {output.peer}")
        self.disconnected(output)

    def connected(self, output: Output) -> None:
        """An output was made. For kinds of ports that do more with it."""

    def disconnected(self, output: Output) -> None:
        """An output is gone. Likewise."""

    # Inputs ------------------------------------------------------------------------------------------------------

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The connections it receives from, as far as their callers have said who they are."""
        with self._lock:
            return tuple(one for one in self._inputs if one.link is not None)

    def remove_input(self, name: str) -> bool:
        """Hang up on a port that sends; False when there is none of this name."""
        gone = [one for one in self.inputs if one.sender == name]
        for one in gone:
            one.close()
        return bool(gone)

    def _called(self, connection: socket.socket) -> None:
        """Somebody has connected. In the listener's thread."""
        with contextlib.suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        caller = Input(self, connection)
        with self._lock:
            if len(self._inputs) >= MAX_INPUTS:
                self._make_room()
            welcome = not self._closed and len(self._inputs) < MAX_INPUTS
            if welcome:
                self._inputs[caller] = None
                caller.start()  # under the lock, so that whoever finds it here finds its thread running
        if not welcome:
            connection.close()

    def _make_room(self) -> None:
        """Send away whoever has been silent longest about what it wants: a real caller says so at once."""
        silent = next((one for one in self._inputs if one.link is None), None)
        if silent is not None:
            del self._inputs[silent]
            silent.close()

    def joined(self, caller: Input) -> None:
        """A caller has said who it is: an older connection from the same port is replaced. In the caller's thread."""
        if not caller.sender.startswith("/"):
            return
        for other in self.inputs:
            if other is caller:
                break  # those behind it came later, and may have been quicker to say who they are
            if other.sender == caller.sender:
                other.close()
        caller.official = True
        self.network.notice(f"Receiving input from {caller.sender} to {self.name} using {caller.carrier}")

    def left(self, caller: Input) -> None:
        """A caller is gone. In its thread."""
        with self._lock:
            self._inputs.pop(caller, None)
        if caller.official:
            self.network.notice(f"Removing input from {caller.sender} to {self.name}")

    def complain(self, caller: Input, error: RtfError) -> None:
        """A caller said what it may not. In its thread, which ends now; nobody else notices."""
        self.network.report(f"{self.name}: {caller.sender or 'a caller'} was cut off: {error}")

    def dispatch(self, caller: Input, key: str, text: str, data: Buffer) -> Sequence[Buffer]:
        """Do what a message asks for; returns the bytes of the reply. In the caller's thread."""
        link = caller.link
        assert link is not None
        if key in _DATA:
            asks, in_lines, own = key == "d", link.carrier.text, len(data) > link.reuses
            delivery = Delivery(link.sender, text, data, caller.dialect, asks, in_lines, own)
            self.deliver(delivery)
            caller.dialect = delivery.dialect
            return delivery.answer or (_NO_REPLY if asks and not in_lines else ())
        if key == "a":
            delivery = Delivery(link.sender, "", data, caller.dialect, wants_reply=True, text=link.carrier.text)
            delivery.reply(admin.answer(self, delivery.read()))
            return delivery.answer
        answer = describe.answer(self, key, text)
        return (answer.encode("utf-8", "surrogateescape"),) if link.carrier.text else ()

    def hand_over(self, sender: str, message: Outgoing) -> tuple[object, Codec[object]] | None:
        """Take an object from another port of this process, in its thread; returns the reply and its codec."""
        handed = HandedOver(sender, message)
        self.deliver(handed)
        return handed.replied

    @property
    def closed(self) -> bool:
        """Whether it is closed."""
        return self._closed

    def deliver(self, delivery: Delivery) -> None:
        """Give a message to the owner. Overridden by ports that do more with it."""
        if self.interrupted:
            return
        if self._receive is not None:
            self._receive(delivery)
        else:
            self._rendezvous.bring(delivery)

    # Quality of service ------------------------------------------------------------------------------------------

    def set_qos(self, peer: str, wanted: Qos) -> None:
        """Give the connections with a port, to and from it, other priorities.

        Raises ConnectError when there is none, and QosError when it cannot be done. The other end has its own: see
        :func:`rtf.middleware.remote.set_connection_qos` for both.
        """
        connections: list[Connection] = [one for one in (*self.outputs, *self.inputs) if one.peer == peer]
        if not connections:
            raise ConnectError(f"{self.name} is not connected with {peer}")
        for connection in connections:
            connection.apply(wanted)

    # The end -----------------------------------------------------------------------------------------------------

    def interrupt(self) -> None:
        """Wake whoever waits in the port. Messages that arrive are thrown away until ``resume``."""
        with self._lock:
            self.interrupted = True
            self.interruptions += 1
            self._rendezvous.set_open(is_open=False)

    def resume(self) -> None:
        """Take messages again. A port that is closed stays so."""
        with self._lock:
            if not self._closed:
                self.interrupted = False
                self._rendezvous.set_open(is_open=True)

    def close(self) -> None:
        """Take leave of everybody and give the name back. Doing so again changes nothing."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self.interrupt()
        SHARED.remove(self._listening)
        for output in self._outputs:
            self._forget(output)
            output.close()
        with self._lock:
            callers = [*self._inputs]
        leaving.ask_to_stop(self.network, self.name, callers)
        for caller in callers:
            caller.close()
        deadline = clock.Deadline.after(_CLOSING)
        for caller in callers:
            caller.join(deadline.remaining())
        with contextlib.suppress(MiddlewareError):  # a name server that is gone knows nothing of it any more
            for name in (*(group.contact.name for group in self._groups.values()), self.name):
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
