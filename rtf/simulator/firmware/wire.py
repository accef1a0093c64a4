"""A CAN bus in simulated time: arbitration, the time that frames take, errors, and nodes that go off the bus.

In each step of a millisecond the frames that wait are sent in the order of their identifiers, for as long as there is
time: a bus that is overloaded delays what has a high identifier. A frame that is disturbed is sent again, and counts as
an error of its sender; after too many errors the sender is off the bus, as of ISO 11898-1.
"""

from __future__ import annotations

from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING, Protocol

from rtf.robot.devices.can.frame_bits import frame_bits
from rtf.robot.devices.can.messages import EVERYONE, HOST, POLLING, MessageClass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.robot.devices.can.messages import Frame

    _Entry = tuple[int, Frame, "Connection"]  # identifier, frame and sender
    Heard = list[tuple[Frame, float]]  # frames with the times of their ends

#: Bits a second.
BIT_RATE = 1_000_000
_BITS_A_STEP = BIT_RATE // 1000
#: The frames of a node that may wait. Further ones are lost.
QUEUE = 64
#: An error counts eight for the sender and one for each receiver; a good frame takes one off.
_SENDER_ERROR, _RECEIVER_ERROR = 8, 1
#: The count of errors beyond which a sender goes off the bus.
BUS_OFF = 255
_MOST_RECEIVER_ERRORS = 127
#: Bits of an error frame, with the space after it.
_ERROR_BITS = 23
_identifier = itemgetter(0)
_PERIODIC_TO_BOARDS = MessageClass.MOTOR_PERIODIC << 8 | HOST << 4 | EVERYONE


class Node(Protocol):
    """What is connected to a wire. ``address``: of a board; None of one that gets all frames.

    One that has ``receive_all`` gets what boards broadcast by it, as a list of frames and times, at the end of a step.
    ``disturbed``, if there is one, is called for each error frame, as the controllers of hosts report them.
    """

    address: int | None
    connection: Connection

    def receive(self, frame: Frame, time: float) -> None:
        """Take a frame, at the simulated time (s) of its end. Called within a step."""


class Connection:
    """A node's controller on a wire: what it sends, and its counts of errors.

    ``lost`` counts the frames for which there was no room. ``off``: off the bus, until ``recover``.
    """

    def __init__(self, wire: Wire, node: Node) -> None:
        self.node = node
        self.sender_errors = self.receiver_errors = self.lost = self.waiting = 0
        self.off = False
        self.listens = node.address is None
        self.receive = node.receive
        self.receive_all: Callable[[Heard], None] = getattr(node, "receive_all", self._receive_each)
        self.disturbed: Callable[[], None] = getattr(node, "disturbed", lambda: None)
        self._wire = wire

    def send(self, frame: Frame) -> bool:
        """Queue a frame; return whether there was room, and the node is on the bus."""
        if self.off or self.waiting >= QUEUE:
            self.lost += 1
            return False
        self.waiting += 1
        self._wire.waiting.append((frame[0], frame, self))
        return True

    def _receive_each(self, heard: Heard) -> None:
        for frame, time in heard:
            self.receive(frame, time)

    def recover(self) -> None:
        """Return to the bus, without errors."""
        self.off, self.sender_errors, self.receiver_errors = False, 0, 0

    def count_error(self) -> None:
        """Note that a frame of this node was disturbed."""
        self.sender_errors += _SENDER_ERROR
        if self.sender_errors > BUS_OFF:
            self.off = True


class Wire:
    """A bus. Not thread-safe: used within the steps of a simulation.

    ``disturbances`` are asked for each frame whether it is damaged; ``filters`` return what is delivered in place of a
    frame. Both are faults, and empty on a healthy bus. ``bits`` and ``frames`` count what has passed.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.bits = self.frames = 0
        self.disturbances: list[Callable[[Frame, float], bool]] = []
        self.filters: list[Callable[[Frame, float], Iterable[Frame]]] = []
        self._nodes: list[Connection] = []
        self._receivers: dict[int, list[Connection]] = {}  # by identifier, as far as they were asked for
        self._listeners: list[Connection] = []  # that get all frames
        self.waiting: list[_Entry] = []  # what takes part in the arbitration, in the order of arrival
        self.sender: Connection | None = None  # of the frame that the filters get
        self._overrun = 0  # bits of the step that the last frame took beyond its end

    def attach(self, node: Node) -> Connection:
        """Connect a node. Several boards may have one address, as by a mistake."""
        connection = Connection(self, node)
        self._nodes.append(connection)
        self.forget_addresses()
        return connection

    def detach(self, connection: Connection) -> None:
        """Disconnect a node; what it still had to send is lost."""
        self._nodes.remove(connection)
        self.forget_addresses()
        self._forget(connection)

    def forget_addresses(self) -> None:
        """Look again for whom frames are: nodes, or the address of one, have changed."""
        self._receivers.clear()
        self._listeners = [one for one in self._nodes if one.listens]

    def recover(self) -> None:
        """Return all nodes to the bus, without errors."""
        for connection in self._nodes:
            connection.recover()

    def step(self, now: float) -> None:
        """Send for a millisecond, from the simulated time ``now`` (s) on. One loop, as it runs for every frame."""
        waiting, used = self.waiting, self._overrun
        heard: Heard = []
        place = ordered = 0  # the next frame, and how many are in the order of their identifiers
        while used < _BITS_A_STEP:
            if ordered != len(waiting):  # others have been sent
                del waiting[:place]
                waiting.sort(key=_identifier)
                place, ordered = 0, len(waiting)
            if place == ordered:
                break
            identifier, frame, sender = waiting[place]
            following = place + 1
            alike = following < ordered and waiting[following][0] == identifier
            rivals = self._rivals(place) if alike else ()
            if rivals or (self.disturbances and self._disturbed(frame, now + used / BIT_RATE)):
                used += _ERROR_BITS
                del waiting[:place]
                self._count_errors([sender, *rivals])
                place, ordered = 0, -1
                continue
            place = following
            used += frame_bits(frame)
            time = now + used / BIT_RATE
            self.frames += 1
            sender.waiting -= 1
            if sender.sender_errors:
                sender.sender_errors -= 1
            receivers = self._receivers.get(identifier)
            if receivers is None:
                receivers = self._receivers[identifier] = self._receivers_of(identifier)
            if receivers is self._listeners and not sender.listens and not self.filters:
                heard.append((frame, time))
            else:
                self._forward_broadcasts(heard)
                self._deliver(frame, sender, time)
        del waiting[:place]
        self._forward_broadcasts(heard)
        self.bits += used - self._overrun
        self._overrun = max(0, used - _BITS_A_STEP)

    def _disturbed(self, frame: Frame, time: float) -> bool:
        return any(damaged(frame, time) for damaged in self.disturbances)

    def _rivals(self, place: int) -> list[Connection]:
        """Return the other nodes that have a frame with the same identifier and other data: they spoil each other."""
        identifier, frame, sender = self.waiting[place]
        rivals: list[Connection] = []
        for other, theirs, node in islice(self.waiting, place + 1, None):
            if other != identifier:
                break
            if node is not sender and theirs != frame and node not in rivals:
                rivals.append(node)
        return rivals

    def _count_errors(self, senders: list[Connection]) -> None:
        """Count an error of senders, whose frames go on to wait."""
        for connection in self._nodes:
            connection.disturbed()
            if connection in senders:
                connection.count_error()
            elif connection.receiver_errors < _MOST_RECEIVER_ERRORS:
                connection.receiver_errors += _RECEIVER_ERROR
        for sender in senders:
            if sender.off:  # what it had to send is lost
                sender.lost += sender.waiting
                self._forget(sender)

    def _forget(self, sender: Connection) -> None:
        """Drop what a node has to send."""
        sender.waiting = 0
        self.waiting[:] = [entry for entry in self.waiting if entry[2] is not sender]

    def _forward_broadcasts(self, heard: Heard) -> None:
        """Give what boards have broadcast to those that get all frames; the list is empty afterwards."""
        for listener in self._listeners if heard else ():
            if not listener.off:
                listener.receiver_errors = max(0, listener.receiver_errors - len(heard))
                listener.receive_all(heard[:])
        heard.clear()

    def _deliver(self, frame: Frame, sender: Connection, time: float) -> None:
        """Pass on what faults make of a frame."""
        self.sender = sender
        frames: Iterable[Frame] = (frame,)
        for faulty in self.filters:
            frames = [after for before in frames for after in faulty(before, time)]
        for each in frames:
            self.hand_over(each, time, sender)

    def hand_over(self, frame: Frame, time: float, sender: Connection | None = None) -> None:
        """Give a frame to the nodes that it is for, but its sender."""
        receivers = self._receivers.get(frame[0])
        if receivers is None:
            receivers = self._receivers[frame[0]] = self._receivers_of(frame[0])
        for receiver in receivers:
            if receiver is not sender and not receiver.off:
                if receiver.receiver_errors:
                    receiver.receiver_errors -= 1
                receiver.receive(frame, time)

    def _receivers_of(self, identifier: int) -> list[Connection]:
        """Return the nodes that take frames with an identifier: boards take requests and setpoints only."""
        kind, source, destination = identifier >> 8, identifier >> 4 & 0xF, identifier & 0xF
        if identifier != _PERIODIC_TO_BOARDS and (kind not in POLLING or source != HOST):
            return self._listeners
        addresses = {None, destination}
        return [one for one in self._nodes if destination == EVERYONE or one.node.address in addresses]
