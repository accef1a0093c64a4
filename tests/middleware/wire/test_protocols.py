"""Whole connections through the protocols without a socket, in both roles, with the bytes split in any way."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from byte_driver import End, cut
from hypothesis import example, given, settings
from hypothesis import strategies as st

from replaying import VERSIONS, recordings, segments
from rtf.bottle import Bottle, BottleError, Dialect
from rtf.bottle.binary import encode
from rtf.middleware.errors import ProtocolError
from rtf.middleware.types import VECTOR, ProtocolVersion, Stamp
from rtf.middleware.types.codecs import BOTTLE, RAW
from rtf.middleware.types.plain import BYTES
from rtf.middleware.wire import authentication, binary, framing, lines
from rtf.middleware.wire.inbox import CHUNK, MAX_LINE, Inbox
from rtf.middleware.wire.name_server_lines import PREFIX, CommandReceiver
from rtf.middleware.wire.outgoing_message import OutgoingMessage
from rtf.middleware.wire.protocol import Caller, StreamProtocol, read_header
from rtf.middleware.wire.unframed import UnframedReceiver, UnframedSender

if TYPE_CHECKING:
    from byte_driver import Cuts

    from replaying import Segment
    from rtf.middleware.types.codecs import Codec

TALK = '1 2.5 hello "two words" (1 2 3) [pos] {10 20 30} -7 "say \\"hi\\"" (1.5 2.5) (a (b c) [ok]) true 3000000000'
MESSAGES = (TALK, "[get] [encs]", "end")
PROTOCOLS = (binary.TCP, binary.FAST_TCP, lines.TEXT, lines.TEXT_ACK)
_DATA = Path(__file__).parents[2] / "data" / "yarp_wire"

version = pytest.mark.parametrize("version", VERSIONS)
carrier = pytest.mark.parametrize("carrier", [protocol.name for protocol in PROTOCOLS])
cuts = st.frozensets(st.integers(1, 4000), max_size=40) | st.integers(1, 20)
ENVELOPES = st.text(st.characters(min_codepoint=32, exclude_categories=["Cs"]), min_size=1, max_size=60)


class Accepted(NamedTuple):
    """The events and the sent bytes of the accepting side."""

    protocol: str
    caller: Caller
    messages: list[tuple[str, str, bytes]]
    sent: bytes


def said(talk: list[Segment], way: str) -> bytes:
    """Return all bytes of one direction."""
    return b"".join(data for direction, data in talk if direction == way)


def accept(pieces: list[bytes], number: int, replies: list[bytes | None] | None = None) -> Accepted:
    """Play the accepting side from the header to the end, with these replies to requests."""
    end = End(pieces)
    header = end.run(read_header(end.inbox))
    protocol = next(one for one in PROTOCOLS if one.header == header)
    end.inbox.pop(len(header))
    receiver = protocol.receiver(end.inbox, acknowledged=protocol.acknowledged)
    caller = end.run(receiver.greeting())
    end.sent += receiver.welcome(caller, number)
    left = iter(replies or [])
    messages = []
    arriving = end.receive(receiver.messages())
    while not end.done:
        message = next(arriving)
        messages.append(message)
        end.sent += ((next(left) or b"") if message[0] in "ad" else b"") + receiver.acknowledgement
    return Accepted(protocol.name, caller, messages, end.sent)


def call(
    protocol: StreamProtocol, name: str, messages: list[OutgoingMessage], pieces: list[bytes]
) -> tuple[bytes, list[object]]:
    """Play the connecting side up to the message ``q``; return the sent bytes, and the replies."""
    end = End(pieces)
    sender = protocol.sender(end.inbox, acknowledged=protocol.acknowledged)
    end.run(sender.greet(protocol.header, name))
    replies = []
    for message in messages:
        if message.key == "q":
            end.sent += sender.end()
            end.repeat(sender.acknowledgements)
            continue
        end.sent += b"".join(sender.message(message))
        if message.key != "D":
            end.repeat(partial(sender.reply, RAW, message.dialect))
            replies.append(sender.answer)
        end.repeat(sender.acknowledgements)
    assert end.done
    assert sender.due == 0
    return end.sent, replies


@version
@carrier
class TestPorts:
    """The recorded conversations of a writer and a reader, by each carrier."""

    def talk(self, version: str, carrier: str) -> list[Segment]:
        """Return the conversation."""
        return segments(recordings(version, "ports.json")[carrier])

    @given(places=cuts)
    @settings(deadline=None, max_examples=30)
    def test_accepting(self, version: str, carrier: str, places: Cuts):
        """The accepting side has the same events for any pieces, and sends the recorded bytes."""
        talk = self.talk(version, carrier)
        expected = said(talk, "<")
        number = framing.read_number(expected) if expected.startswith(b"YA") else 0
        got = accept(cut(said(talk, ">"), places), number)
        assert (got.protocol, got.caller) == (carrier, Caller(f"/wr_{carrier}"))
        assert [key for key, _, _ in got.messages] == ["D", "D", "D", "q"]
        for (_, envelope, data), text in zip(got.messages, MESSAGES, strict=False):
            bottle = Bottle.parse(text)
            in_lines = carrier.startswith("text")
            assert envelope == ""
            assert data == (bottle.to_text().encode() if in_lines else encode(bottle, VERSIONS[version]))
        assert got.sent == expected

    @given(places=cuts)
    @settings(deadline=None, max_examples=30)
    def test_connecting(self, version: str, carrier: str, places: Cuts):
        """The connecting side sends the recorded bytes, for any pieces of the answers."""
        talk = self.talk(version, carrier)
        protocol = next(one for one in PROTOCOLS if one.name == carrier)
        messages = [OutgoingMessage("D", Bottle.parse(text), BOTTLE, VERSIONS[version]) for text in MESSAGES]
        messages.append(OutgoingMessage("q", b"", RAW, VERSIONS[version]))
        sent, _ = call(protocol, f"/wr_{carrier}", messages, cut(said(talk, "<"), places))
        assert sent == said(talk, ">")


@version
@given(places=cuts)
@settings(deadline=None, max_examples=15)
def test_questions(version: str, places: Cuts):
    """Both sides of every recorded request have the recorded bytes and replies."""
    dialect = VERSIONS[version]
    for conversation in (*recordings(version, "robot.json")["questions"], recordings(version, "ports.json")["admin"]):
        talk = segments(conversation)
        asked, answered = said(talk, ">"), said(talk, "<")
        number = framing.read_number(answered)
        replies = replies_in(answered, dialect)[: asked.count(framing.command("d")) + asked.count(framing.command("a"))]
        got = accept(cut(asked, places), number, replies)
        assert got.sent == answered
        questions = [OutgoingMessage(key, data, RAW, dialect) for key, _, data in got.messages]
        sent, heard = call(binary.TCP, got.caller.name, questions, cut(answered, places))
        assert heard == replies
        assert sent == asked


def replies_in(answered: bytes, dialect: Dialect) -> list[bytes | None]:
    """Return the replies before each acknowledgement, None where there is none."""
    rest, replies = answered[8:], []
    while rest:
        reply, size = (None, 0) if rest.startswith(framing.ACK) else RAW.decode_from(rest, dialect)
        replies.append(reply)
        assert rest[size:].startswith(framing.ACK)
        rest = rest[size + len(framing.ACK) :]
    return replies


@version
@given(places=cuts)
@settings(deadline=None, max_examples=15)
def test_stream_of_an_arm(version: str, places: Cuts):
    """A recorded stream gives the same messages and consecutive stamps for any pieces."""
    asked = said(segments(recordings(version, "robot.json")["state"]), ">")

    def events(pieces: list[bytes]) -> list[tuple[str, str, bytes]]:
        end = End(pieces)
        end.inbox.pop(len(end.run(read_header(end.inbox))))
        receiver = binary.BinaryReceiver(end.inbox, acknowledged=True)
        assert end.run(receiver.greeting()) == Caller("/icubSim/left_arm/state:o")
        messages = end.receive(receiver.messages())
        got = [next(messages) for _ in range(asked.count(framing.yarp_number(10)))]
        assert end.done
        return got

    got = events(cut(asked, places))
    assert got == events([asked])
    stamps = [Stamp.parse(envelope).count for key, envelope, _ in got if key == "D"]
    assert stamps == [*range(stamps[0], stamps[0] + len(stamps))]
    assert len(stamps) > 20
    assert {VECTOR.decode(data, VERSIONS[version]).shape for key, _, data in got if key == "D"} == {(16,)}


@version
@given(places=cuts)
@settings(deadline=None, max_examples=15)
def test_commands_to_a_name_server(version: str, places: Cuts):
    """Each recorded line is one command, without its prefix."""
    for talk in json.loads((_DATA / version / "name_server_names.json").read_text("utf-8")):
        asked = "".join(text for way, text in talk if way == ">")
        if not asked.startswith(PREFIX):
            continue
        expected = [line.removeprefix(f"{PREFIX} ").rstrip("\r").encode() for line in asked.splitlines()]
        end = End(cut(asked.encode(), places))
        commands = end.receive(CommandReceiver(end.inbox, acknowledged=False).messages())
        assert [next(commands) for _ in expected] == [("d", "", line) for line in expected]
        assert end.done


@pytest.mark.parametrize("dialect", Dialect)
@given(places=cuts, envelope=ENVELOPES, acknowledged=st.booleans())
@settings(deadline=None, max_examples=30)
def test_unix_stream(dialect: Dialect, places: Cuts, envelope: str, *, acknowledged: bool):
    """The receiver decodes what the sender encodes, also if its first guess at the dialect is wrong."""
    sending = End(cut(b"ACK\0" * len(MESSAGES) if acknowledged else b"", places))
    sender = UnframedSender(sending.inbox, acknowledged=acknowledged)
    bottles = [Bottle.parse(text) for text in MESSAGES]
    for bottle in bottles:
        sending.sent += b"".join(sender.message(OutgoingMessage("D", bottle, BOTTLE, dialect, envelope)))
    sending.repeat(sender.acknowledgements)
    sending.sent += sender.end()
    receiving = End(cut(sending.sent, places))
    receiver = UnframedReceiver(receiving.inbox, acknowledged=acknowledged)
    received = receiving.receive(receiver.messages())
    for bottle in bottles:
        assert next(received) == ("D", envelope, encode(bottle, dialect))
    assert next(received)[0] == "q"
    assert receiver.acknowledgement == (b"ACK\0" if acknowledged else b"")
    assert receiving.done


@given(places=cuts)
@settings(deadline=None, max_examples=30)
def test_no_reply(places: Cuts):
    """An acknowledgement without a reply gives None, in any pieces."""
    for sender_of, acknowledgement in ((binary.BinarySender, framing.ACK), (UnframedSender, b"ACK\0")):
        end = End(cut(acknowledgement, places))
        sender = sender_of(end.inbox, acknowledged=True)
        sender.message(OutgoingMessage("d", Bottle([1]), BOTTLE, Dialect.YARP3))
        end.repeat(partial(sender.reply, BOTTLE, Dialect.YARP3))
        assert sender.answer is None
        end.repeat(sender.acknowledgements)
        assert end.done


@given(st.lists(st.text("ab \\\"'()[]", max_size=12), max_size=4), cuts)
@example(["(", "(a", ") 1", ")"], 1)
@settings(deadline=None, max_examples=50)
def test_data_in_several_lines(texts: list[str], places: Cuts):
    """Lines are joined while a bracket or quote is open, for any pieces."""
    data = "".join(f"d\r\n{text}\r\n" for text in texts).encode() + b"?\r\n"

    def events(pieces: list[bytes]) -> list[tuple[str, str, bytes]]:
        end = End(pieces)
        got = []
        try:
            got.extend(end.receive(lines.LineReceiver(end.inbox, acknowledged=True).messages()))
        except AssertionError:  # all have arrived
            return got
        raise AssertionError("messages have no end")

    assert events(cut(data, places)) == events([data])


@given(places_of_caller=cuts, places_of_called=cuts, same=st.booleans())
@settings(deadline=None, max_examples=30)
def test_authentication(places_of_caller: Cuts, places_of_called: Cuts, *, same: bool):
    """Ends with the same key accept each other, and ends with different keys do not."""
    called, caller = Inbox(), Inbox()
    accepting = authentication.accept(called, b"secret")
    connecting = authentication.connect(caller, b"secret" if same else b"another")
    ends = {accepting: (called, caller, places_of_called), connecting: (caller, called, places_of_caller)}
    waiting: dict[object, list[bytes]] = {accepting: [], connecting: []}
    running = [accepting, connecting]
    refused = False
    while running:
        steps = running.pop(0)
        own, _, _ = ends[steps]
        try:
            step = next(steps)
        except StopIteration:
            continue
        except ProtocolError:
            refused = True
            break
        other = connecting if steps is accepting else accepting
        if isinstance(step, bytes):
            waiting[other] += cut(step, ends[other][2])
        elif waiting[steps]:
            own.feed(waiting[steps].pop(0))
        running.append(steps)
    assert refused is not same


@given(ENVELOPES, st.binary(max_size=200), cuts)
@settings(deadline=None)
def test_envelopes(envelope: str, body: bytes, places: Cuts):
    """Envelope and data of two messages in a row are read, for any pieces."""
    end = End(cut(2 * (framing.front("D", envelope, len(body)) + body), places))
    messages = end.receive(binary.BinaryReceiver(end.inbox, acknowledged=True).messages())
    assert [next(messages), next(messages)] == [("D", envelope, body)] * 2
    assert end.done


@pytest.mark.parametrize("text_size", [-1, 0, 40, 1 << 20])
def test_an_envelope_that_does_not_fit_into_its_message_is_refused(text_size: int):
    """An envelope whose size does not fit its message is refused."""
    front = framing.front("D", "1 2", 4)
    at = len(front) - len("D 1 2\0") - 8
    end = End([front[:at] + text_size.to_bytes(4, "little", signed=True) + front[at + 4 :] + bytes(4)])
    with pytest.raises(ProtocolError):
        next(end.receive(binary.BinaryReceiver(end.inbox, acknowledged=True).messages()))


def test_bytes_out_of_step_are_refused():
    """A message with its first byte missing is refused."""
    end = End([(framing.front("D", "", 4) + bytes(40))[1:]])
    with pytest.raises(ProtocolError, match="expected a message"):
        next(end.receive(binary.BinaryReceiver(end.inbox, acknowledged=True).messages()))


@pytest.mark.parametrize("piece", [1 << 12, 100_000])
def test_large_data_stay_where_they_arrived(piece: int):
    """Large data are not copied: they are handed out in the buffer that received them."""
    body = bytes(range(256)) * 3600
    wire = framing.front("D", "", len(body)) + body
    inbox = Inbox()
    messages = binary.BinaryReceiver(inbox, acknowledged=True).messages()
    at = 0
    places = []
    while isinstance(step := next(messages), int):
        room = inbox.room(step)
        size = min(piece, len(room), len(wire) - at)
        room[:size] = wire[at : at + size]
        inbox.end += size
        at += size
        places.append(id(inbox.memory))
    key, _, data = step
    assert (key, bytes(data)) == ("D", body)
    assert isinstance(data, memoryview)
    assert data.obj is inbox.memory
    assert len(set(places)) == 2, "the memory was replaced more than once"


def test_what_is_announced_is_not_allocated():
    """The size of a message is not allocated before its bytes arrive."""
    inbox = Inbox()
    messages = binary.BinaryReceiver(inbox, acknowledged=True).messages()
    inbox.feed(framing.front("D", "", framing.MAX_MESSAGE - 8) + bytes(CHUNK))
    wanted = next(messages)
    assert wanted == framing.MAX_MESSAGE - 8
    inbox.room(wanted)
    assert len(inbox.memory) < 16 << 20


def test_a_long_line_is_read_in_large_pieces():
    """A long line that is complete is read in a few pieces."""
    inbox, line, waits = Inbox(), b"d" * (MAX_LINE - 1) + b"\n", 0
    reading = inbox.line()
    for size in reading:
        room = inbox.room(size)
        piece = line[inbox.end : inbox.end + len(room)]
        room[: len(piece)] = piece
        inbox.end += len(piece)
        waits += 1
    assert waits < 12


def test_a_line_without_an_end_is_refused():
    """A line longer than MAX_LINE is refused."""
    end = End([b"d" * CHUNK] * (MAX_LINE // CHUNK + 1))
    with pytest.raises(ProtocolError, match="a line of more than"):
        next(end.receive(lines.LineReceiver(end.inbox, acknowledged=False).messages()))


@given(st.binary(max_size=300), cuts)
@settings(deadline=None, max_examples=100)
def test_any_bytes(data: bytes, places: Cuts):
    """Each receiver has the same events for any pieces of any bytes, and raises only its own errors."""
    for receiver in (binary.BinaryReceiver, lines.LineReceiver, UnframedReceiver, CommandReceiver):
        outcomes = []
        for pieces in ([data], cut(data, places)):
            end = End(pieces)
            got: list[object] = []
            try:
                got.extend(end.receive(receiver(end.inbox, acknowledged=True).messages()))
            except AssertionError:  # all have arrived
                got.append("more")
            except (ProtocolError, ValueError) as error:
                got.append(type(error))
            outcomes.append(got)
        assert outcomes[0] == outcomes[1]


@pytest.mark.parametrize(
    ("value", "codec"),
    [
        (Bottle.parse(TALK), BOTTLE),
        (np.arange(500.0), VECTOR),
        (ProtocolVersion(0, 3, 12, 3), ProtocolVersion.codec),
    ],
)
def test_a_reply_is_read_while_it_arrives(value: object, codec: Codec[object]):
    """A reply is complete with its last byte, in any pieces and of any codec."""
    data = b"".join(codec.encode(value, Dialect.YARP3))
    for step in (1, 7, len(data)):
        end = End([*cut(data[:-1], step), data[-1:] + framing.ACK])
        sender = binary.BinarySender(end.inbox, acknowledged=True)
        end.repeat(partial(sender.reply, codec, Dialect.YARP3))
        assert b"".join(codec.encode(sender.answer, Dialect.YARP3)) == data
        assert end.inbox.window() == framing.ACK


def test_a_reply_that_is_no_object_is_refused_while_it_arrives():
    """An invalid reply is refused, whether it arrives at once or in pieces."""
    good = encode(Bottle.parse(TALK))
    bad = good[:-20] + b"\2\0\0\0" + good[-16:]
    for pieces in ([bad], [bad[:100], bad[100:]]):
        end = End(pieces)
        with pytest.raises(BottleError, match="not the code"):
            end.repeat(partial(binary.BinarySender(end.inbox, acknowledged=True).reply, BOTTLE, Dialect.YARP3))


def test_a_slow_peer_costs_no_more_than_a_quick_one():
    """The work for a reply that arrives byte by byte grows linearly, counted by function calls."""

    def drip(count: int) -> int:
        end = End(cut(encode(Bottle([["a", index] for index in range(count)])), 1))
        sender, calls = binary.BinarySender(end.inbox, acknowledged=True), 0

        def counted(frame: object, event: str, argument: object) -> None:
            nonlocal calls
            calls += event in ("call", "c_call")

        sys.setprofile(counted)
        try:
            end.repeat(partial(sender.reply, BOTTLE, Dialect.YARP3))
        finally:
            sys.setprofile(None)
        return calls

    assert drip(1000) < 11 * drip(100)


def test_a_question_in_text_is_answered_up_to_the_acknowledgement():
    """The reply to a text request has the lines before the acknowledgement; without those there is none."""
    end = End([b"Welcome admin\r\n1 2\r\n", b"3\r\n<ACK>\r\n"])
    sender = lines.LineSender(end.inbox, acknowledged=True)
    end.run(sender.greet(lines.TEXT_ACK.header, "admin"))
    assert end.run(sender.ask("a", "[list] [in]")) == ["1 2", "3"]
    assert end.sent == b"CONNACK admin\r\na\r\n[list] [in]\r\n"
    silent = End([])
    sender = lines.LineSender(silent.inbox, acknowledged=False)
    sender.message(OutgoingMessage("d", b"x", BYTES, Dialect.YARP3))
    silent.repeat(partial(sender.reply, BOTTLE, Dialect.YARP3))
    assert sender.answer is None
