"""The line protocol of name servers: encoding of commands and decoding of registrations."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, to_string
from rtf.bottle import to_text as value_text
from rtf.middleware.errors import AddressError
from rtf.middleware.wire.contact import Contact, is_host
from rtf.middleware.wire.protocol import Receiver

if TYPE_CHECKING:
    from rtf.middleware.wire.protocol import Messages

PREFIX = "NAME_SERVER"
QUERY = f"{PREFIX} query"
#: The last line of an answer.
END = "*** end of message"
#: The text of a field that the server shall fill in.
AUTOMATIC = "..."
#: The longest command, in bytes. The longest useful one names every carrier and address of a machine.
MAX_COMMAND = 1 << 14
_KEYWORD = "registration"
_NUMBER = re.compile(r"[0-9]{1,5}")
_MOST = 65535


def registration(contact: Contact) -> str:
    """Return the line by which a name server describes the contact of a port."""
    return f"{_KEYWORD} name {contact.name} ip {contact.host} port {contact.port} type {contact.carrier}"


def read_registration(line: str) -> Contact | None:
    """Parse the contact of a port: the words after ``name``, ``ip``, ``port`` and ``type``. None for another line."""
    words = line.split()
    if not words or words[0] != _KEYWORD:
        return None
    said = dict(zip(words[1::2], words[2::2], strict=False))
    number = said.get("port", "")
    if "name" not in said or not is_host(said.get("ip", "")):
        return None
    if not _NUMBER.fullmatch(number) or int(number) > _MOST:
        return None
    return Contact(said["name"], said["ip"], int(number), said.get("type", "tcp"))


def word(text: str) -> str:
    """Encode one word of a command: unchanged if it parses as itself, else in quotes."""
    if any(letter in text for letter in "\r\n\0"):
        raise AddressError(f"{text!r} cannot be sent to a name server: it has more than one line")
    try:
        items = Bottle.parse(text)
    except BottleError:
        return value_text(text)
    return text if len(items) == 1 and to_string(items[0]) == text else value_text(text)


def command(*words: str) -> str:
    """Encode a command of several words."""
    return " ".join(map(word, words))


def register_command(name: str, carrier: str, host: str, port: int, promise: str) -> str:
    """Encode a registration, with as few fields as possible."""
    fields: list[str] = []
    if carrier or host or port:
        fields = [carrier, host, str(port or "")]
    elif promise:
        fields = ["", "", "-1"]
    return " ".join(
        word(field) if field else AUTOMATIC for field in ["register", name, *fields, *filter(None, [promise])]
    )


class CommandReceiver(Receiver):
    """The receiving end of commands. A line without the prefix is an empty command."""

    def messages(self) -> Messages:
        while True:
            prefix, _, words = (yield from self.inbox.line(MAX_COMMAND)).partition(b" ")
            yield "d", "", words if prefix == PREFIX.encode() else b""
