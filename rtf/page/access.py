"""Access control of the server: the checks of every request, and the security headers of every response.

Reading needs no token; stopping the run and answering its questions does. Pages of another origin get nothing: the Host
header must name this server, which prevents DNS rebinding, and so must the Origin header, if there is one.
"""

from __future__ import annotations

import hmac
import ipaddress
import logging
import platform
from typing import TYPE_CHECKING

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse

from rtf.page.settings import LOG_NAME, WILDCARDS, bracketed

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: The content security policy of the page: its own files, its own server, and pictures that it draws itself.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
#: The policy of a file of the run: nothing is allowed.
FILE_POLICY = "default-src 'none'; frame-ancestors 'none'; sandbox"

_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
)
_HTTP_PORT = 80
_log = logging.getLogger("rtf.page")


class Access:
    """The names, the origin and the token of a server; without a token nothing can be controlled."""

    def __init__(self, host: str, port: int, token: str = "") -> None:
        names = {"127.0.0.1", "localhost", "::1"}
        if host not in names:  # deliberately on another address
            node = platform.node().lower()
            names |= {host.lower(), node, f"{node}.local"} - WILDCARDS
        ports = {f":{port}", *([""] if port == _HTTP_PORT else [])}
        self._hosts = frozenset(bracketed(name) + port for name in names for port in ports)
        self._any_address = host in WILDCARDS
        self._ports = ports
        self._token = token.encode()

    def knows_host(self, host: str) -> bool:
        """Return whether a Host header names this server. If it listens on every interface, any IP address does."""
        if host.lower() in self._hosts:
            return True
        if not self._any_address:
            return False
        return any(host.endswith(port) and _is_address(host.removesuffix(port)) for port in self._ports)

    def knows_origin(self, origin: str) -> bool:
        """Return whether an Origin header names this server."""
        scheme, separator, host = origin.partition("://")
        return scheme == "http" and bool(separator) and self.knows_host(host)

    def may_control(self, authorization: str) -> bool:
        """Return whether an Authorization header has the token, in constant time."""
        scheme, _, token = authorization.partition(" ")
        return bool(self._token) and scheme.lower() == "bearer" and hmac.compare_digest(token.encode(), self._token)


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


class Guard:
    """ASGI middleware that checks access, adds the security headers, and writes errors to the log."""

    def __init__(self, app: ASGIApp, access: Access, *, log: str = f"{LOG_NAME} in the run folder") -> None:
        self._app = app
        self._access = access
        self._log = log

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        begun = False

        async def send_guarded(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                message["headers"] = _with_ours(message["headers"])
            await send(message)

        try:
            app = self._refusal(Headers(scope=scope)) or self._app
            await app(scope, receive, send_guarded)
        except Exception:
            if begun:
                raise  # it is logged, and the response ends here
            _log.exception("%s %r", scope["method"], scope["path"])
            sorry = PlainTextResponse(f"internal error; see {self._log}\n", 500)
            await sorry(scope, receive, send_guarded)

    def _refusal(self, headers: Headers) -> PlainTextResponse | None:
        if not self._access.knows_host(headers.get("host", "")):
            return PlainTextResponse("this server does not have that host name\n", 403)
        origin = headers.get("origin")
        if origin is not None and not self._access.knows_origin(origin):
            return PlainTextResponse("requests from pages of another origin are refused\n", 403)
        return None


def _with_ours(headers: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    given = {name for name, _ in headers}
    policy = [] if b"content-security-policy" in given else [(b"content-security-policy", POLICY.encode())]
    return [*headers, *policy, *(header for header in _HEADERS if header[0] not in given)]
