"""Lists of peers: who may send to a guarded port, and who may change connections."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle, Vocab
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.access import Access
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.wire.contact import Contact
from waiting import eventually

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network


class TestLists:
    """How a list is read."""

    @pytest.mark.parametrize("word", ["tester", "10.0.0.256", "10.0.0.7/24", "10.0.0.0/33", ""])
    def test_what_is_no_peer(self, word: str) -> None:
        """A word that is neither a name nor an address is an error, so that a slip cannot allow more than was meant."""
        with pytest.raises(AddressError, match="no peer"):
            Access.parse([word])

    def test_empty_list_allows_everyone(self) -> None:
        """An empty list allows every peer, as in YARP."""
        assert Access.parse([]).allows("/anyone", None)

    @given(st.text(), st.lists(st.sampled_from(["/tester/*", "10.0.0.0/24"]), min_size=1))
    def test_unlisted_names_are_not_allowed(self, name: str, words: list[str]) -> None:
        """Without an address only a listed name is allowed."""
        assert Access.parse(words).allows(name, None) == ("/tester/*" in words and name.startswith("/tester/"))

    @pytest.mark.parametrize(("word", "allowed"), [("127.0.0.0/8", True), ("127.0.0.1", True), ("10.0.0.0/8", False)])
    def test_addresses(self, word: str, allowed: bool) -> None:
        """A list of addresses is compared with the address of the connection."""
        with (
            socket.create_server(("127.0.0.1", 0)) as listening,
            socket.create_connection(listening.getsockname()) as one,
        ):
            assert Access.parse([word]).allows("/anyone", one) is allowed


class TestWriters:
    """Messages to a guarded port."""

    def test_unlisted_writer_is_cut_off(self, network: Network, said: list[str]) -> None:
        """A message of an unlisted writer does not reach the owner, and is reported; listed writers go on."""
        network.writers = Access.parse(["/tester/*"])
        received: list[Bottle] = []
        with (
            Port("/board", lambda message: received.append(message.read()), network=network, guarded=True),
            Port("/tester/a", network=network) as listed,
            Port("/stranger", network=network) as stranger,
        ):
            for writer in (listed, stranger):
                writer.add_output("/board")
            stranger.write(Bottle(["move"]))
            eventually(lambda: any("not among the allowed writers" in line for line in said), "nothing is reported")
            assert listed.write(Bottle(["hold"])) == 1
        assert received == [Bottle(["hold"])]

    @pytest.mark.parametrize("carrier", ["udp", "text_ack", "fast_tcp", "unix_stream"])
    def test_other_carriers(self, network: Network, said: list[str], carrier: str) -> None:
        """The list applies to every carrier."""
        network.writers = Access.parse(["10.0.0.7"])
        received: list[Bottle] = []
        with (
            Port("/board", lambda message: received.append(message.read()), network=network, guarded=True),
            Port("/stranger", network=network) as stranger,
        ):
            stranger.add_output("/board", carrier)
            stranger.write(Bottle(["move"]))
            eventually(lambda: any("not among the allowed writers" in line for line in said), "nothing is reported")
        assert received == []

    def test_requests(self, network: Network) -> None:
        """A client that is not listed gets no reply."""
        network.writers = Access.parse(["/tester/*"])
        with RpcServer("/board/rpc:i", lambda request: request, network=network, guarded=True):
            with RpcClient("/tester/rpc", "/board/rpc:i", network=network) as listed:
                assert listed.call(Bottle(["get"]), timeout=10) == Bottle(["get"])
            with RpcClient("/stranger", "/board/rpc:i", network=network) as stranger, pytest.raises(MiddlewareError):
                stranger.call(Bottle(["set"]), timeout=10)


class TestAdministrators:
    """Commands that change connections."""

    def test_only_questions_are_answered(self, network: Network) -> None:
        """An unlisted peer may ask and connect, but not change connections by admin or text commands."""
        network.admins = Access.parse(["10.0.0.7"])
        a, b = Contact("/a"), Contact("/b")
        with Port("/a", network=network) as source, Port("/b", lambda _: None, network=network):
            assert remote.exists(network, a)
            with pytest.raises(ConnectError, match="Not allowed"):
                remote.connect(network, a, b)
            for words in (["set", "out", "/b"], ["prop", "set", "/b"]):
                request = Bottle([*map(Vocab, words[:2]), words[2]])
                assert remote.administer(network, a, request)[0] == Vocab("fail")
            with remote.talk(network, a) as ask:
                assert ask("/b")[0].startswith("Not allowed")
            assert source.outputs == ()
            source.add_output("/b")
            assert source.outputs[0].dialect is network.dialect

    def test_sender_of_datagrams_ends_its_own_connection(self, network: Network) -> None:
        """An unlisted sender of datagrams may end its own connection by a text command."""
        network.admins = Access.parse(["10.0.0.7"])
        with Port("/a", network=network) as source, Port("/b", lambda _: None, network=network) as target:
            source.add_output("/b", "udp")
            eventually(lambda: target.inputs, "there is no input")
            source.remove_output("/b")
            eventually(lambda: not target.inputs, "the input is still there")
