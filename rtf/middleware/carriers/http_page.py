"""The page of a port, and of a name server: text of anybody, escaped, in a document that runs no scripts."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import BottleError
from rtf.bottle.binary import decode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jinja2 import Template

    from rtf.bottle import Dialect
    from rtf.middleware.names import Contact
    from rtf.middleware.port import Port

_HERE = files("rtf.middleware.carriers")
_STYLE = _HERE.joinpath("http_page.css").read_text("utf-8")
_STYLE_HASH = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
#: What a page may do: show its own style and its own pictures, and send its own form.
POLICY = (
    f"default-src 'none'; style-src 'sha256-{_STYLE_HASH}'; img-src 'self' data:; form-action 'self'; "
    "base-uri 'none'; frame-ancestors 'none'"
)


#: The longest message whose contents are shown, in bytes.
MAX_SHOWN = 1 << 12


class Link(NamedTuple):
    """A port: its name, ``HOST:PORT`` of its page (empty: unknown), and a remark."""

    name: str
    address: str = ""
    about: str = ""

    @classmethod
    def to(cls, contact: Contact, about: str = "") -> Link:
        """Return a link to the page of a port."""
        host = f"[{contact.host}]" if ":" in contact.host else contact.host
        return cls(contact.name, f"{host}:{contact.port}" if contact.valid else "", about)


class Section(NamedTuple):
    """A titled list of ports."""

    title: str
    links: Sequence[Link]


class LastMessage(NamedTuple):
    """A message in text form, under a title that says whose it is."""

    title: str
    text: str


class Page(NamedTuple):
    """What a port shows of itself. ``pictures``: it sends images, which the page shows live."""

    kind: str
    sections: Sequence[Section]
    messages: Sequence[LastMessage] = ()
    accepts_requests: bool = True
    pictures: bool = False


class Exchange(NamedTuple):
    """A request that was sent by the form, and its reply."""

    request: str
    reply: str


def of_port(port: Port, token: str, exchange: Exchange | None = None) -> str:
    """Return the page of a port. ``token`` is the secret of its form."""
    return _template().render(
        style=_STYLE,
        title=port.name,
        address=f"{port.contact.host}:{port.contact.port}",
        page=port.page(),
        token=token,
        exchange=exchange,
    )


def of_problem(title: str, why: str) -> str:
    """Return the page that says why a request was refused."""
    return _template().render(style=_STYLE, title=title, problem=why)


def text_of(data: bytes, dialect: Dialect, *, in_lines: bool) -> str:
    """Return a received message in text form, or what is known of one that is no bottle."""
    if in_lines:
        return data.decode("utf-8", "replace")
    try:
        return decode(data, dialect).to_text()
    except BottleError:
        return f"{len(data)} bytes that are no bottle: {data[:64].hex(' ')}"


def too_long(size: int) -> str:
    """Return what is shown in place of a long message."""
    return f"{size} bytes; only messages of up to {MAX_SHOWN} bytes are shown"


@cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined  # imported here: only a port that is browsed needs it

    # Undefined values are errors, but for those that are tested for.
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(_HERE.joinpath("http_page.html.j2").read_text("utf-8"))
