"""What goes wrong: wrong types, half messages, hostile lengths, bombs, lost masters and peers. The node goes on."""

from __future__ import annotations

import os
import socket
import struct
import threading
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros1.test_types import nested

from rtf.middleware.carriers.stream import Stream
from rtf.ros1 import xml_rpc
from rtf.ros1.errors import MasterError, NoServiceError, PeerError
from rtf.ros1.master import call_node
from rtf.ros1.node import Node
from rtf.ros1.tcpros import encode_header, frame, read_header
from rtf.ros1.types import message_type, service_type
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from ros1.conftest import Ros

    from rtf.ros1.node import Node

STRING, TRIGGER = message_type("std_msgs/String"), service_type("std_srvs/Trigger")
HELLO = frame(STRING.encode(STRING("hello")))
HEADER = {"callerid": "/hostile", "md5sum": STRING.md5sum, "type": "std_msgs/String"}


class Hostile:
    """A node that is known to the master, and sends what it is told: a list of bytes for each connection."""

    def __init__(self, ros: Ros, *answers: bytes) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self._answers = answers
        self._server = xml_rpc.Server("127.0.0.1", lambda _, __: [1, "", ["TCPROS", "127.0.0.1", self.port]])
        self.uri = f"http://127.0.0.1:{self._server.port}/"
        self.master = ros.uri
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        for answer in self._answers:
            connected, _ = self._listening.accept()
            with connected:
                stream = Stream(connected)
                stream.run(read_header(stream))
                connected.sendall(answer)

    def register(self, what: str, *parameters: Any) -> None:
        """Tell the master of a topic or service."""
        code, sentence, _ = xml_rpc.call(self.master, f"register{what}", "/hostile", *parameters, self.uri)
        assert code == 1, sentence

    def close(self) -> None:
        """End, after all connections have been served."""
        self._thread.join()
        self._server.close()
        self._listening.close()


@contextmanager
def hostile(ros: Ros, *answers: bytes) -> Iterator[Hostile]:
    """A node that publishes ``/chatter`` in this way, one answer for each connection that is made."""
    peer = Hostile(ros, *answers)
    peer.register("Publisher", "/chatter", "std_msgs/String")
    try:
        yield peer
    finally:
        peer.close()
        xml_rpc.call(ros.uri, "unregisterPublisher", "/hostile", "/chatter", peer.uri)
        xml_rpc.call(ros.uri, "unregisterService", "/hostile", "/beep", f"rosrpc://127.0.0.1:{peer.port}")


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        (encode_header(HEADER) + HELLO[:6], "the connection was lost within a message"),
        (encode_header(HEADER) + HELLO + HELLO[:3], "the connection was lost within a message"),
        (encode_header(HEADER) + b"\xff" * 4, "a message of 4294967295 bytes; at most"),
        (encode_header(HEADER) + frame(b"\xff" * 8), "8 bytes are no std_msgs/String"),
        (
            encode_header({**HEADER, "md5sum": "0" * 32, "type": "lab/Other"}),
            f"it sends lab/Other ({'0' * 32}), not std",
        ),
        (encode_header({"error": "not for you"}), "it refuses: not for you"),
        (encode_header(HEADER)[:9], "the peer closed the connection"),
        (b"\xff" * 20, "a header of 4294967295 bytes; at most"),
        (b"\x08\0\0\0\xff\xff\xff\0abcd", "a field of 16777215 bytes in a header with 4 left"),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)
def test_a_publisher_that_violates_the_protocol(
    ros: Ros, node: Callable[..., Node], said: list[str], answer: bytes, complaint: str
):
    """It is told what is wrong, once; the next connection is fine."""
    got: list[str] = []
    with hostile(ros, answer, encode_header(HEADER) + HELLO):
        node("listener").subscribe("chatter", STRING, lambda message: got.append(message.data))
        eventually(lambda: said and got, f"nothing was reported or came: {said} {got}")
    assert complaint in said[0]
    assert said[0].startswith("/chatter of http://127.0.0.1:")
    assert got[-1] == "hello"


def test_a_definition_bomb_is_refused(ros: Ros, node: Callable[..., Node], said: list[str]):
    """By a subscriber that takes any type."""
    got: list[Any] = []
    bomb = {**HEADER, "type": "p/T0", "message_definition": nested(10_000)}
    good = {**HEADER, "message_definition": STRING.definition}
    with hostile(ros, encode_header(bomb), encode_header({"type": "x"}), encode_header(good) + HELLO):
        node("listener").subscribe("chatter", None, got.append)
        eventually(lambda: got, f"nothing came: {said}")
    assert "types are nested more than 50 deep" in said[0]
    assert "'x' is no type" in said[1]


@pytest.mark.parametrize(
    ("sent", "complaint"),
    [
        (b"\xff" * 8, "a header of 4294967295 bytes; at most"),
        (encode_header({"a": "b"}), "a peer wants nothing, which /talker has not"),
        (encode_header({"callerid": "/x", "topic": "/no"}), "/x wants /no, which /talker has not"),
        (
            encode_header({"callerid": "/x", "topic": "/chatter", "md5sum": "0" * 32, "type": "*"}),
            f"/x wants /chatter with md5sum '{'0' * 32}'; /talker has {STRING.md5sum}",
        ),
        (
            encode_header({"callerid": "/x", "topic": "/chatter", "md5sum": "*", "type": "lab/Other"}),
            "/x wants /chatter with type 'lab/Other'; /talker has std_msgs/String",
        ),
        (
            encode_header({"callerid": "/x", "service": "/beep", "md5sum": "0"}),
            "/x calls /beep with md5sum '0'; /talker",
        ),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)
def test_a_subscriber_that_violates_the_protocol(
    node: Callable[..., Node], said: list[str], sent: bytes, complaint: str
):
    """It is answered with an error, and others get their messages."""
    talker, got = node("talker"), list[str]()
    chatter = talker.publisher("chatter", STRING)
    talker.serve("beep", TRIGGER, lambda _: TRIGGER.response())
    with socket.create_connection(talker._contents.tcpros) as peer:
        peer.sendall(sent)
        stream = Stream(peer)
        assert complaint in stream.run(read_header(stream))["error"]
    assert complaint in said[0]
    node("listener").subscribe("chatter", STRING, lambda message: got.append(message.data))
    eventually(lambda: chatter.subscribers == 1, "it is not connected")
    chatter.publish(STRING("hello"))
    eventually(lambda: got == ["hello"], "nothing came")


def test_half_a_header_and_half_a_request(node: Callable[..., Node], said: list[str]):
    """They end with their connection."""
    talker, caller = node("talker"), node("caller")
    talker.serve("beep", TRIGGER, lambda _: TRIGGER.response(message="beep"))
    header = encode_header({"callerid": "/x", "service": "/beep", "md5sum": "*"})
    for sent in (header[:5], header + b"\x05\0\0\0", b""):
        with socket.create_connection(talker._contents.tcpros) as peer:
            peer.sendall(sent)
    with socket.create_connection(talker._contents.tcpros) as peer:
        peer.sendall(header + struct.pack("<I", 1 << 31))
        stream = Stream(peer)
        stream.run(read_header(stream))
        assert "a message of 2147483648 bytes" in stream.run(read_header(stream))["error"]
    assert caller.client("beep", TRIGGER).call().message == "beep"
    eventually(lambda: talker._peers.connected <= 1, "connections are left")


@pytest.mark.parametrize(
    ("answer", "kind", "complaint"),
    [
        (
            encode_header({"md5sum": TRIGGER.md5sum}) + b"\1\x08\0\0\0ab",
            PeerError,
            "/beep was lost while it was",
        ),
        (encode_header({"md5sum": TRIGGER.md5sum}) + b"\1" + b"\xff" * 4, PeerError, "a message of 4294967295 bytes"),
        (encode_header({"md5sum": "0"}), PeerError, "/beep has md5sum '0', not 937c"),
        (encode_header({"error": "no"}), PeerError, "/beep refuses: no"),
        (b"\xff" * 8, PeerError, "a header of 4294967295 bytes"),
        (b"", PeerError, "/beep at rosrpc://127"),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)
def test_a_service_that_violates_the_protocol(
    ros: Ros, node: Callable[..., Node], answer: bytes, kind: type[Exception], complaint: str
):
    """The caller is told."""
    with hostile(ros, answer) as peer:
        code, _, _ = xml_rpc.call(
            ros.uri, "registerService", "/hostile", "/beep", f"rosrpc://127.0.0.1:{peer.port}", peer.uri
        )
        assert code == 1
        with pytest.raises(kind, match=complaint):
            node("caller").client("beep", TRIGGER).call()


def test_a_service_whose_node_has_died(ros: Ros, node: Callable[..., Node]):
    """The master still has it."""
    xml_rpc.call(ros.uri, "registerService", "/dead", "/dead/beep", "rosrpc://127.0.0.1:9", "http://127.0.0.1:9/")
    with pytest.raises(NoServiceError, match=r"/dead/beep at rosrpc://127\.0\.0\.1:9 cannot be reached"):
        node("caller").client("/dead/beep", TRIGGER).call()


def test_a_publisher_that_is_killed_is_missed_and_found_again(ros: Ros, node: Callable[..., Node], said: list[str]):
    """It is still known to the master; another one takes its place."""
    got: list[str] = []
    received = node("listener").subscribe("killed", STRING, lambda message: got.append(message.data))
    command = ("rostopic", "pub", "-r", "50", "/killed", "std_msgs/String", "data: hello")
    for _ in range(2):
        got.clear()
        with ros.running(*command):
            eventually(lambda: got, "nothing came")
        eventually(lambda: not received.publishers, "it is not missed")
    eventually(lambda: any("does not answer requestTopic" in one for one in said), f"it was not reported: {said}")


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (("publisherUpdate", "/m", "/chatter", [1]), "has a topic and a list of addresses"),
        (("publisherUpdate", "/m", "/chatter", ["http://127.0.0.1:9/"] * 1001), "1001 publishers of /chatter"),
        (("publisherUpdate", "/m"), "missing 2 required positional arguments"),
        (("requestTopic", "/m", "/nothing", [["TCPROS"]]), "/talker does not publish /nothing"),
        (("requestTopic", "/m", "/chatter", [["UDPROS"], 3]), "/talker publishes /chatter by TCPROS only"),
        (("requestTopic", "/m", {"a": 1}, 3), "unhashable"),
        (("getParam", "/m"), "/talker has no function getParam"),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_calls_that_are_none_are_refused(node: Callable[..., Node], call: tuple[Any, ...], complaint: str):
    """With a fault or a code; those that are some are answered."""
    talker = node("talker")
    talker.publisher("chatter", STRING)
    with pytest.raises(MasterError, match=complaint):
        call_node(talker._contents.uri, *call)
    assert call_node(talker._contents.uri, "getPublications", "/m") == [["/chatter", "std_msgs/String"]]


def test_what_is_no_master_is_reported():
    """A node, for instance."""
    with (
        closing(xml_rpc.Server("127.0.0.1", lambda _, __: [1, "", "seven"])) as other,
        pytest.raises(MasterError, match="answered getPid with 'seven'; is it a master"),
    ):
        Node("one", master=f"http://127.0.0.1:{other.port}")


def test_a_master_that_dies_and_returns(ros: Ros, node: Callable[..., Node], said: list[str]):
    """Connections go on meanwhile; then the new master knows all of it, and new nodes find it."""
    talker, listener, got = node("talker"), node("listener"), list[str]()
    listener.subscribe("chatter", STRING, lambda message: got.append(message.data))
    chatter = talker.publisher("chatter", STRING)
    talker.serve("beep", TRIGGER, lambda _: TRIGGER.response())
    eventually(lambda: chatter.subscribers == 1, "it is not connected")
    ros.stop()
    eventually(lambda: sum("is lost" in one for one in said) == 2, f"it was not missed: {said}")
    chatter.publish(STRING("meanwhile"))
    eventually(lambda: got == ["meanwhile"], "the connection has ended")
    ros.start()
    eventually(lambda: sum("is back" in one for one in said) == 2, f"it was not found: {said}")
    late = node("late")
    late.subscribe("chatter", STRING, lambda message: got.append(message.data))
    eventually(lambda: chatter.subscribers == 2, "the late one did not find it")
    assert late.client("beep", TRIGGER).call() == TRIGGER.response()
    assert len(said) == 4


def test_any_bytes_end_their_connection_only(node: Callable[..., Node]):
    """On both of its sockets; the node answers as before."""
    talker = node("talker")

    @given(st.lists(st.binary(max_size=60), max_size=4))
    def check(data: list[bytes]) -> None:
        for port in (talker._contents.tcpros[1], talker._server.port):
            with socket.create_connection(("127.0.0.1", port)) as peer, suppress(OSError):
                for piece in data:
                    peer.sendall(piece)
        assert call_node(talker._contents.uri, "getPid", "/tests") == os.getpid()

    check()
