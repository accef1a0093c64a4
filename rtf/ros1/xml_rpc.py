"""XML-RPC between nodes and their master: a client and a server with limits, and without entities.

Python's own has none: a request of a kilobyte could fill the memory.
"""

from __future__ import annotations

import sys
import threading
import xmlrpc.client
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError, ParserCreate

from rtf.middleware.carriers.uncaught import report_uncaught
from rtf.ros1.errors import MasterError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

#: The longest request and reply: the state of a large system, or the description of a robot.
MAX_BODY = 16 << 20
#: How deep values may be nested.
_DEEPEST = 32
#: How long a node or the master may take to answer (s).
PATIENCE = 5.0


def address(uri: str) -> tuple[str, int]:
    """Return host and port of an address such as ``http://localhost:11311``. Raises MasterError."""
    try:
        parts = urlsplit(uri)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or not port:
        raise MasterError(f"{uri[:200]!r} is no address; write it as in http://localhost:11311")
    return host, port


def call(uri: str, method: str, *parameters: Any) -> Any:
    """Call a function at an address, and return its value. Raises MasterError."""
    host, port = address(uri)
    try:
        body = xmlrpc.client.dumps(parameters, method, allow_none=True).encode()
    except (TypeError, OverflowError, UnicodeError) as error:
        raise MasterError(f"{method} cannot be sent: {error}") from None
    try:
        connection = HTTPConnection(host, port, timeout=PATIENCE)
        try:
            connection.request("POST", "/RPC2", body, {"Content-Type": "text/xml"})
            response = connection.getresponse()
            answer = response.read(MAX_BODY + 1)
        finally:
            connection.close()
        if response.status != 200 or len(answer) > MAX_BODY:  # noqa: PLR2004 - OK
            raise MasterError(f"{uri} answered {method} with {response.status} and {len(answer)} bytes")
        return _read(answer)[0][0]
    except xmlrpc.client.Fault as fault:
        raise MasterError(f"{uri} refused {method}: {fault.faultString[:200]}") from None
    except (OSError, HTTPException, UnicodeError) as error:
        raise MasterError(f"{uri} does not answer {method}: {error}") from None
    except _UNREADABLE as error:
        raise MasterError(f"{uri} answered {method} with what is no XML-RPC: {error}") from None


class Server:
    """Answers calls at a host, on a free port, in threads of its own. ``answer`` gets the function and its parameters.

    ``answer`` may raise LookupError for a function that is not there, and TypeError for wrong parameters.
    """

    def __init__(self, host: str, answer: Callable[[str, Sequence[Any]], Any]) -> None:
        class Handler(_Handler):
            answering = staticmethod(answer)

        self._server = _HttpServer((host, 0), Handler)
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), name="rtf-ros1-xmlrpc")
        self._thread.daemon = True
        self._thread.start()

    def close(self) -> None:
        """End. Calls that are being answered go on."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _HttpServer(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002 - as it is called
        """Report an error like that of any thread; a caller that has gone while it was answered is none."""
        error = sys.exc_info()[1]
        if error is not None and not isinstance(error, OSError):
            report_uncaught(error)


class _Handler(BaseHTTPRequestHandler):
    answering: Callable[[str, Sequence[Any]], Any]
    timeout = PATIENCE

    def do_POST(self) -> None:
        """Answer a call."""
        size = self.headers.get("Content-Length", "")
        if not size.isdecimal() or len(size) > len(str(MAX_BODY)) or int(size) > MAX_BODY:
            self.send_error(413 if size.isdecimal() else 411)
            return
        body = self._respond(self.rfile.read(int(size)))
        self.send_response(200)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _respond(self, request: bytes) -> bytes:
        try:
            parameters, method = _read(request)
            value = self.answering(method or "", parameters)
            return xmlrpc.client.dumps((value,), methodresponse=True, allow_none=True).encode()
        except (LookupError, TypeError, xmlrpc.client.Fault, *_UNREADABLE) as error:
            return xmlrpc.client.dumps(xmlrpc.client.Fault(1, f"{error}")).encode()

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


class _RefusedXmlError(ValueError):
    """A document that is well-formed, but not taken."""


_UNREADABLE = (ExpatError, _RefusedXmlError, xmlrpc.client.Error, ValueError, TypeError, LookupError)


def _read(document: bytes) -> tuple[tuple[Any, ...], str | None]:
    """Return the parameters of a document, and the name of the function. Raises one of _UNREADABLE."""
    # The class is the one that Python's own reader uses; it keeps the elements that it has seen.
    reader = xmlrpc.client.Unmarshaller()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > 4 * _DEEPEST:  # a list is four elements
            raise _RefusedXmlError(f"values are nested more than {_DEEPEST} deep")
        reader.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        reader.end(tag)

    parser = ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = reader.data
    parser.StartDoctypeDeclHandler = _refuse_doctype
    reader.xml(None, None)  # type: ignore[arg-type]  # texts are decoded already
    parser.Parse(document, True)
    return cast("tuple[tuple[Any, ...], str | None]", (reader.close(), reader.getmethodname()))


def _refuse_doctype(*_: object) -> None:
    raise _RefusedXmlError("a document type is not accepted")
