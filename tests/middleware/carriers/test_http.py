"""The web pages of a port and of a name server, requested by an HTTP client, and hostile requests."""

from __future__ import annotations

import re
import socket
import threading
from http.client import HTTPConnection
from typing import TYPE_CHECKING
from urllib.parse import urlencode

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.middleware.carriers.http import MAX_FORM, MAX_HEAD
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.page import MAX_SHOWN
from waiting import eventually

if TYPE_CHECKING:
    from rtf.middleware.wire.incoming_message import IncomingMessage

HOSTILE = '<script>alert("x")</script>'


def ask(
    port: Port | NameServer, method: str = "GET", path: str = "/", body: str = "", **headers: str
) -> tuple[int, str, dict[str, str]]:
    """Send one request. Return status, page and the reply's headers."""
    connection = HTTPConnection(port.contact.host, port.contact.port, timeout=10)
    try:
        connection.request(method, path, body or None, headers)
        reply = connection.getresponse()
        return reply.status, reply.read().decode(), {name.lower(): value for name, value in reply.getheaders()}
    finally:
        connection.close()


def token_of(page: str) -> str:
    """Return the secret in the form of a page."""
    found = re.search(r'name="token" value="([^"]+)"', page)
    assert found is not None
    return found[1]


def echo(message: IncomingMessage) -> None:
    """Reply with the request itself."""
    message.reply(message.read())


class TestPage:
    """The page of a port."""

    def test_connections_and_messages_are_escaped(self, network: Network) -> None:
        """Names and messages are escaped in the page, and its content policy allows no scripts."""
        with (
            Port("/to/<script>alert(1)</script>", echo, network=network) as reader,
            Port("/from", network=network) as writer,
        ):
            writer.add_output(reader.name)
            assert writer.write(Bottle([1.5, HOSTILE])) == 1
            status, page, headers = ask(reader)
            assert status == 200
            assert "<script" not in page
            assert "&lt;script&gt;alert(" in page
            assert "1.5" in page
            assert "/from" in page
            assert "default-src 'none'" in headers["content-security-policy"]
            assert "script-src" not in headers["content-security-policy"]
            assert headers["x-content-type-options"] == "nosniff"
            assert "1.5" in ask(writer)[1]

    def test_long_messages_are_named_by_size(self, network: Network) -> None:
        """Instead of a message of more than MAX_SHOWN bytes the page shows its size."""
        with Port("/to", echo, network=network) as reader, Port("/from", network=network) as writer:
            writer.add_output(reader.name)
            writer.write(Bottle(["x" * MAX_SHOWN]))
            assert "xxxx" not in ask(reader)[1]
            assert str(MAX_SHOWN) in ask(writer)[1]

    def test_looking_changes_nothing(self, network: Network) -> None:
        """GET and HEAD send nothing to the port's owner, and leave no connection."""
        received: list[Bottle] = []
        with Port("/to", lambda message: received.append(message.read()), network=network) as port:
            assert ask(port, path="/?data=stop&cmd=stop")[0] == 200
            assert ask(port, "HEAD")[:2] == (200, "")
            assert ask(port, path="/rpc?text=stop")[0] == 405
            assert ask(port, path="/elsewhere")[0] == 404
            eventually(lambda: not port.inputs, "a browser is still an input")
        assert received == []


class TestRequests:
    """The form on the page, by which a request is sent."""

    def test_reply_is_shown(self, network: Network) -> None:
        """The text of the form is a request to the port's owner, and the page shows the reply."""
        with Port("/rpc", echo, network=network) as port:
            token = token_of(ask(port)[1])
            status, page, _ = ask(port, "POST", "/rpc", urlencode({"token": token, "text": f'get 2.5 "{HOSTILE}"'}))
            assert status == 200
            assert "get 2.5" in page
            assert "<script" not in page

    @pytest.mark.parametrize("form", ["", "text=stop", "token=x&text=stop", "token=&text=stop", "%ff=%fe"])
    def test_form_of_another_page_is_refused(self, network: Network, form: str) -> None:
        """A form without the secret of the page is refused, so that pages of other sites cannot send requests."""
        received: list[Bottle] = []
        with Port("/rpc", lambda message: received.append(message.read()), network=network) as port:
            assert ask(port, "POST", "/rpc", form)[0] == 403
        assert received == []

    @pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost.evil"])
    def test_foreign_host_is_refused(self, network: Network, host: str) -> None:
        """A request with a foreign host name is refused, so that the page of another site cannot read this one."""
        with Port("/rpc", echo, network=network) as port:
            assert ask(port, Host=host)[0] == 421

    @pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:1", "[::1]:5", "localhost:10000", socket.gethostname()])
    def test_names_of_this_machine(self, network: Network, host: str) -> None:
        """Requests with an address or a name of this machine are answered."""
        with Port("/rpc", echo, network=network) as port:
            assert ask(port, Host=host)[0] == 200

    def test_text_that_is_no_bottle(self, network: Network) -> None:
        """An empty form is refused with a hint."""
        with Port("/rpc", echo, network=network) as port:
            token = token_of(ask(port)[1])
            status, page, _ = ask(port, "POST", "/rpc", urlencode({"token": token, "text": "  "}))
            assert status == 400
            assert "Write what to send" in page

    @pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "POST"])
    def test_other_methods(self, network: Network, method: str) -> None:
        """The page allows GET and HEAD only."""
        with Port("/rpc", echo, network=network) as port:
            status, _, headers = ask(port, method)
            assert status == 405
            assert headers["allow"] == "GET, HEAD"

    def test_too_large(self, network: Network) -> None:
        """Heads and forms above their limits are refused."""
        with Port("/rpc", echo, network=network) as port:
            assert ask(port, path="/" + "x" * (2 * MAX_HEAD))[0] == 431
            assert ask(port, "POST", "/rpc", "x" * (MAX_FORM + 1))[0] == 413


class TestNameServer:
    """The page of a name server."""

    def test_ports_and_connections(self) -> None:
        """The page lists all ports with links to their pages and their outputs, and marks those that do not answer."""
        with NameServer() as server:
            network = Network(server.names)
            with Port("/to", echo, network=network) as reader, BufferedPort("/from", network=network) as writer:
                writer.add_output("/to")
                server.names.register("/dead", carrier="tcp", host="127.0.0.1", port=1)
                status, page, _ = ask(server)
                assert status == 200
                assert f'<a href="http://127.0.0.1:{reader.contact.port}/">/to</a>' in page
                assert re.search(r">/from</a> <span[^>]*>sends to /to<", page)
                assert re.search(r">/dead</a> <span[^>]*>does not answer<", page)


class TestHostile:
    """Bytes that are no request."""

    @settings(max_examples=40, deadline=None)
    @given(
        start=st.sampled_from([b"GET / HT", b"GET /x H", b"POST /rp", b"HEAD / H", b"PUT / HT"]),
        rest=st.binary(max_size=300)
        | st.lists(
            st.sampled_from(
                [
                    b"TP/1.1\r\n",
                    b"Host: x\r\n",
                    b"Content-Length: -1\r\n",
                    b"Expect: 100-continue\r\n",
                    b"Transfer-Encoding: chunked\r\n",
                    b"Content-Length: 99999999999\r\n",
                    b"\r\n",
                    b"ffffffff\r\n",
                    b"\n",
                ]
            )
        ).map(b"".join),
    )
    @example(start=b"GET / HT", rest=b"TP/1.1\r\n\r\n")
    def test_the_port_survives(self, start: bytes, rest: bytes) -> None:
        """Any bytes are answered with HTTP or with nothing, and the port serves the next request."""
        port = _shared_port()
        with socket.create_connection((port.contact.host, port.contact.port), timeout=10) as peer:
            peer.sendall(start + rest)
            peer.shutdown(socket.SHUT_WR)
            reply = b"".join(iter(lambda: peer.recv(1 << 16), b""))
        assert reply == b"" or reply.startswith(b"HTTP/1.1 "), reply
        assert ask(port)[0] == 200
        assert threading.active_count() < 50


_ports: list[Port] = []


def _shared_port() -> Port:
    """Return one port for all examples of a test."""
    if not _ports:
        _ports.append(Port("/hostile", echo, network=Network(LocalNames())))
    return _ports[0]
