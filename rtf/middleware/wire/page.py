"""The contents of a port's page in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import BottleError
from rtf.bottle.binary import decode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.wire.contact import Contact

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
    """The contents of a port's page. ``pictures``: the port sends images, which the page shows live."""

    kind: str
    sections: Sequence[Section]
    messages: Sequence[LastMessage] = ()
    accepts_requests: bool = True
    pictures: bool = False


def text_of(data: bytes, dialect: Dialect, *, in_lines: bool) -> str:
    """Return a received message in text form, or a description of one that is no bottle."""
    if in_lines:
        return data.decode("utf-8", "replace")
    try:
        return decode(data, dialect).to_text()
    except BottleError:
        return f"{len(data)} bytes that are no bottle: {data[:64].hex(' ')}"


def too_long(size: int) -> str:
    """Return what is shown in place of a long message."""
    return f"{size} bytes; only messages of up to {MAX_SHOWN} bytes are shown"
