"""``http``: the page of a port, for any browser, and requests to the owner of the port by a form.

A connection carries one request. ``GET`` and ``HEAD`` show a page and change nothing; ``POST /rpc`` passes the text of
the form to the owner of the port, as a line of the carrier ``text`` would be, and shows the reply. A browser that also
shows foreign pages must not be made to send such a request by them: the form carries a secret of the port, and the
host that the browser believes to speak to must be an address or a name of this machine.

Requests are read by h11; nothing is stored of a request but its head of at most ``MAX_HEAD`` and a form of at most
``MAX_FORM`` bytes. The page itself is made in :mod:`rtf.middleware.carriers.http_page`.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import h11

from rtf.bottle import Bottle, BottleError
from rtf.middleware.carriers import http_page
from rtf.middleware.carriers.base import Carrier, InputLink
from rtf.middleware.carriers.stream import StreamClosedError
from rtf.middleware.errors import ProtocolError
from rtf.middleware.wire.protocol import Caller

if TYPE_CHECKING:
    from typing import NoReturn

    from rtf.middleware.carriers.base import CarrierPort
    from rtf.middleware.carriers.stream import Stream
    from rtf.middleware.types.codecs import Buffer
    from rtf.middleware.wire.protocol import Message

#: The longest head of a request, in bytes; browsers send less than two thousand.
MAX_HEAD = 1 << 14
#: The longest form, in bytes.
MAX_FORM = 1 << 16
#: Seconds that a browser may take for each part of its request, and to take each part of the answer.
_PATIENCE = 10.0
#: The start of a request for a stream of pictures, which is another carrier's.
STREAM = b"GET /?ac"
#: The methods whose name and a blank fit into eight bytes; all but the first three are refused.
_METHODS = (b"GET", b"HEAD", b"POST", b"PUT", b"DELETE", b"PATCH", b"OPTIONS")
#: Proof that a form comes from a page of this process.
_TOKEN = secrets.token_urlsafe(16)


class HttpInput(InputLink):
    """One request of a browser. A page is sent at once; a form is a message to the owner of the port."""

    def __init__(self, carrier: Carrier, stream: Stream, port: CarrierPort) -> None:
        super().__init__(carrier, stream, Caller("http"))  # no port's name: several browsers can ask at once
        self._port = port
        self._conversation = h11.Connection(h11.SERVER, max_incomplete_event_size=MAX_HEAD)
        self._sent = ""
        self._head_only = False

    def receive(self) -> Message:
        """Return the text of a form as a message that wants a reply. Everything else is answered here.

        Raises StreamClosedError when the request has been answered.
        """
        if self._sent:
            raise StreamClosedError("the request is answered")
        self._stream.limit_waiting(_PATIENCE)
        try:
            request, form = self._read_request()
        except h11.RemoteProtocolError as error:
            self._refuse(HTTPStatus(error.error_status_hint), f"A port does not understand this request: {error}.")
        self._check(request)
        path = urlsplit(request.target.decode("ascii", "replace")).path
        if path == "/rpc":
            self._sent = self._text_of(request, form)
            return "d", "", self._sent.encode("utf-8", "surrogateescape")
        if request.method not in (b"GET", b"HEAD"):
            self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, "Pages are read by GET.", ("Allow", "GET, HEAD"))
        if path != "/":
            self._refuse(HTTPStatus.NOT_FOUND, f"A port has one page, which is at / and not at {path}.")
        self._show(HTTPStatus.OK, http_page.of_port(self._port, _TOKEN))
        raise StreamClosedError("the page is sent")

    def _read_request(self) -> tuple[h11.Request, bytes]:
        request = self._next()
        if not isinstance(request, h11.Request):
            raise StreamClosedError("the browser closed the connection")
        self._head_only = request.method == b"HEAD"
        form = bytearray()
        while not isinstance(event := self._next(), h11.EndOfMessage):
            if not isinstance(event, h11.Data):
                raise StreamClosedError("the browser closed the connection within its request")
            form += event.data
            if len(form) > MAX_FORM:
                self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"A form has at most {MAX_FORM} bytes.")
        return request, bytes(form)

    def _next(self) -> h11.Event | type[h11.PAUSED]:
        while (event := self._conversation.next_event()) is h11.NEED_DATA:
            if self._conversation.they_are_waiting_for_100_continue:
                self._refuse(HTTPStatus.EXPECTATION_FAILED, "Send the form at once.")
            stream = self._stream
            if not stream.unread:
                try:
                    stream.more(1)
                except StreamClosedError:
                    self._conversation.receive_data(b"")
                    continue
            self._conversation.receive_data(bytes(stream.pop(stream.unread)))
        return event  # type: ignore[return-value]  # NEED_DATA has been handled

    def _check(self, request: h11.Request) -> None:
        """Refuse a request that a foreign page has made the browser send to this address under a name of its own."""
        hosts = [value.decode("ascii", "replace") for name, value in request.headers if name == b"host"]
        if any(not _is_this_machine(host) for host in hosts):
            self._refuse(
                HTTPStatus.MISDIRECTED_REQUEST,
                f"This port is not at {hosts[0]}. Write the address of the machine instead of a name.",
            )

    def _text_of(self, request: h11.Request, form: bytes) -> str:
        """Return the text that the form has for the owner. Refuses anything but the form of the port's own page."""
        if request.method != b"POST":
            self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, "Requests are sent by the form of the page.", ("Allow", "POST"))
        try:
            fields = parse_qs(form.decode(), max_num_fields=8, keep_blank_values=True)
        except ValueError:
            fields = {}
        if not secrets.compare_digest(fields.get("token", [""])[0].encode(), _TOKEN.encode()):
            self._refuse(
                HTTPStatus.FORBIDDEN, "This form is of another page. Load the page of this port and send it from there."
            )
        text = " ".join(fields.get("text", [""])[0].split())
        try:
            known = len(Bottle.parse(text))
        except BottleError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, f"{text} cannot be sent: {error}.")
        if not known:
            self._refuse(HTTPStatus.BAD_REQUEST, "The form is empty. Write what to send, such as: get encs")
        return text

    def answer(self, *reply: Buffer) -> None:
        """Show the reply of the owner."""
        text = b"".join(reply).decode("utf-8", "replace").strip()
        self._show(HTTPStatus.OK, http_page.of_port(self._port, _TOKEN, http_page.Exchange(self._sent, text)))

    def _refuse(self, status: HTTPStatus, why: str, *headers: tuple[str, str]) -> NoReturn:
        self._show(status, http_page.of_problem(f"{status} {status.phrase}", why), *headers)
        raise StreamClosedError(f"{status}: {why}")

    def _show(self, status: HTTPStatus, page: str, *headers: tuple[str, str]) -> None:
        body = page.encode("utf-8", "replace")
        conversation = self._conversation
        if conversation.our_state not in (h11.IDLE, h11.SEND_RESPONSE):
            raise ProtocolError("a browser spoke after its request")
        response = h11.Response(
            status_code=status,
            reason=status.phrase,
            headers=[
                ("Content-Type", "text/html; charset=utf-8"),
                ("Content-Length", str(len(body))),
                ("Content-Security-Policy", http_page.POLICY),
                ("X-Content-Type-Options", "nosniff"),
                ("Referrer-Policy", "no-referrer"),
                ("Cache-Control", "no-store"),
                ("Connection", "close"),
                *headers,
            ],
        )
        parts = [conversation.send(response)]
        if not self._head_only:
            parts.append(conversation.send(h11.Data(body)))
        parts.append(conversation.send(h11.EndOfMessage()))
        self._stream.send(*(part for part in parts if part))


class Http(Carrier):
    """Requests of browsers."""

    name = "http"
    header = b"GET / HT"
    text = True
    keeps_header = True

    def matches(self, header: bytes) -> bool:
        """Accept every request but that for a stream of pictures."""
        method, blank, _ = header.partition(b" ")
        return header != STREAM and bool(blank) and method in _METHODS

    def accept(self, stream: Stream, port: CarrierPort) -> InputLink:
        """Return the link: there is no handshake before the request."""
        return HttpInput(self, stream, port)


HTTP = Http()


def _is_this_machine(host: str) -> bool:
    """Return whether a host as browsers write it, such as ``10.0.0.1:10002``, is an address or this machine's name."""
    name = urlsplit(f"//{host}").hostname or ""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        own = socket.gethostname().lower()
        return name in ("localhost", own, own.partition(".")[0])
    return True
