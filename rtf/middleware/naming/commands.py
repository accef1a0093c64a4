"""The commands of a name server, with answers identical to those of YARP's server.

A plain answer consists of lines without quotes and an end line; the answers to subscriptions and everything in ``bot``
form are one bottle. A command that fails or is not understood is answered by the end line alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, BottleError, Vocab, as_int, as_string, to_string
from rtf.middleware.errors import AddressError, ConnectError
from rtf.middleware.naming.port_query import PortQuery
from rtf.middleware.wire.name_server_lines import AUTOMATIC, END, PREFIX

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.naming.subscriptions import Subscriptions
    from rtf.middleware.naming.table import Table
    from rtf.middleware.wire.contact import Contact

_HELP_TITLE = "Here are some ways to use the name server:"
_HELP = (
    "+ help",
    "+ list [$prefix]",
    "+ register $portname",
    "+ register $portname $carrier $ipAddress $portNumber",
    "  (if you want a field set automatically, write '...')",
    "+ unregister $portname",
    "+ query $portname",
    "+ set $portname $property $value",
    "+ get $portname $property",
    "+ check $portname $property",
    "+ route $port1 $port2",
    "+ runners",
    "  (to get a list of the yarprun ports)",
)
#: Errors of a command. A failure to write the database is not among them.
_REFUSALS = (AddressError, ConnectError, BottleError)
_OK, _FAIL = Vocab("ok"), Vocab("fail")
_NOT_KNOWN = -2
_RELATION, _REQUEST = 4, 3
_WORDS_WITH_SUBJECT = 2


@dataclass(slots=True)
class Answer:
    """The answer to a command. ``plain``: lines, each a text or the words of a bottle; else one bottle."""

    plain: bool
    body: Bottle = field(default_factory=Bottle)

    def to_text(self) -> str:
        """Return the answer as sent to clients that use lines."""
        if not self.plain:
            return self.body.to_text() + "\r\n"
        lines = [_unquoted(item) if isinstance(item, Bottle) else to_string(item) for item in self.body]
        return "".join(f"{line}\r\n" for line in lines if line) + f"{END}\r\n"


def _unquoted(line: Bottle) -> str:
    return line.to_text().replace('"', "")


@dataclass(slots=True)
class _Request:
    """A command: its words, the caller's address, and whether the answer is for a machine."""

    words: Bottle
    origin: str
    bot: bool

    def text(self, index: int) -> str:
        """Return a word that is a string; empty for another type or a missing word."""
        return as_string(self.words.get(index))

    def written(self, index: int) -> str:
        """Return the text of a word of any type; empty for a missing word."""
        return to_string(self.words.get(index)) if index < len(self.words) else ""

    def field(self, index: int) -> str:
        """Return a field that the server may fill in: empty if it shall."""
        text = self.text(index)
        return "" if text == AUTOMATIC else text


class Commands:
    """Answers commands from a table and its subscriptions.

    ``server`` is the contact of the server itself; ``changed`` is called with ``add`` or ``del`` and the name of a
    port, ``report`` with a sentence for each failure.
    """

    def __init__(
        self,
        table: Table,
        subscriptions: Subscriptions,
        server: Contact,
        changed: Callable[[str, str], None] | None = None,
        report: Callable[[str], None] | None = None,
    ) -> None:
        self._table = table
        self._subscriptions = subscriptions
        self._server = server
        self._changed = changed or _discard_notification
        self._report = report or _say_nothing
        self._known: dict[str, Callable[[_Request], Answer]] = {
            "register": self._register,
            "unregister": self._unregister,
            "query": self._query,
            "list": self._list,
            "runners": self._runners,
            "set": self._set,
            "get": self._get,
            "check": self._check,
            "route": self._route,
            "gc": self._gc,
            "help": self._help,
        }
        # These have no separate form for machines.
        self._of_subscriptions: dict[str, Callable[[_Request], Bottle]] = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "announce": self._announce,
            "topic": self._topic,
            "untopic": self._untopic,
            "type": self._type,
        }

    def answer(self, words: Bottle, origin: str) -> Answer:
        """Execute a command; ``origin`` is the caller's address. Raises MiddlewareError if the database fails."""
        request = _Request(words, origin, bot=as_string(words.find("format")) == "json")
        if request.written(0) == PREFIX:
            request.words = request.words.tail()
        word = request.written(0)
        if word in self._of_subscriptions:
            try:
                return Answer(plain=False, body=self._of_subscriptions[word](request))
            except _REFUSALS as error:
                self._report(str(error))
                return Answer(plain=False, body=Bottle([_FAIL]))
        if word == "bot":
            request.bot = True
            request.words = request.words.tail()
            word = request.written(0)
        command = self._known.get(word)
        try:
            return Answer(plain=True) if command is None else command(request)
        except _REFUSALS as error:
            self._report(str(error))
            return Answer(plain=True)

    # Ports -------------------------------------------------------------------------------------------------------

    def _register(self, request: _Request) -> Answer:
        name, carrier, host = request.text(1), request.field(2) or "tcp", request.field(3)
        port = max(0, as_int(request.words.get(4)))
        promise = request.field(5)
        if carrier == "topic":
            host = host or self._server.host
            if len(request.words) <= 4:  # noqa: PLR2004 - the position of the number
                port = self._server.port
        elif carrier != "mcast":
            host = host or request.origin or self._server.host
        self._subscriptions.went(name)
        contact = self._table.register(name, carrier, host, port, "" if promise == "*" else promise)
        self._notify("add", contact)
        return _flat(self._described(contact.name, contact, bot=request.bot), bot=request.bot)

    def _unregister(self, request: _Request) -> Answer:
        name = request.text(1)
        self._subscriptions.went(name)
        undone = self._table.unregister(name)
        for gone in filter(None, undone):
            if gone.name != name:
                self._subscriptions.went(gone.name)
            self._notify("del", gone)
        answer = _flat(self._described(name, None, bot=request.bot), bot=request.bot)
        # YARP's servers send this word for every port that the removed one owns, known or not.
        answer.body[:0] = ["old"] * (len(undone) - 1)
        return answer

    def _notify(self, what: str, contact: Contact) -> None:
        if contact.carrier != "mcast":
            self._changed(what, contact.name)

    def _query(self, request: _Request) -> Answer:
        asked = PortQuery.parse(request.text(1))
        contact = self._table.query(asked.name, asked.network)
        described = self._described(asked.name, contact, bot=request.bot)
        return Answer(plain=False, body=described) if request.bot else Answer(plain=True, body=Bottle([described]))

    def _list(self, request: _Request) -> Answer:
        return self._several(self._table.list(request.text(1)), request)

    def _runners(self, request: _Request) -> Answer:
        return self._several(self._table.runners(), request)

    def _several(self, contacts: list[Contact], request: _Request) -> Answer:
        body = Bottle(["ports"] if request.bot else [])
        for contact in contacts:
            body.append(self._described(contact.name, contact, bot=request.bot))
        return Answer(plain=not request.bot, body=body)

    @staticmethod
    def _described(name: str, contact: Contact | None, *, bot: bool) -> Bottle:
        if bot and contact is None:
            return Bottle(["port", ["error", _NOT_KNOWN, "port not known"]])
        if contact is None:
            return Bottle()
        host, port, carrier = contact.host, contact.port, contact.carrier
        if bot:
            return Bottle(["port", ["name", name], ["ip", host], ["port_number", port], ["carrier", carrier]])
        return Bottle(["registration", "name", name, "ip", host, "port", port, "type", carrier])

    # Properties --------------------------------------------------------------------------------------------------

    def _set(self, request: _Request) -> Answer:
        values = [to_string(value) for value in request.words[3:]]
        if not self._table.set(request.text(1), request.written(2), values):
            return _nothing(bot=request.bot)
        return self._get(request)

    def _get(self, request: _Request) -> Answer:
        name, key = request.text(1), request.written(2)
        values = self._table.get(name, key)
        if values is None:
            return _nothing(bot=request.bot)
        if request.bot:
            return Answer(plain=False, body=Bottle([_value(text) for text in values]))
        return Answer(plain=True, body=Bottle([["port", name, "property", key, "=", *values]]))

    def _check(self, request: _Request) -> Answer:
        name, key, value = request.text(1), request.written(2), request.written(3)
        values = self._table.get(name, key)
        if values is None:
            return Answer(plain=True)
        present = "true" if value in values else "false"
        return Answer(plain=True, body=Bottle([["port", name, "property", key, "value", value, "present", present]]))

    # Other commands ----------------------------------------------------------------------------------------------

    @staticmethod
    def _route(request: _Request) -> Answer:
        source, target = request.text(1), request.text(2)
        return Answer(plain=True, body=Bottle([["port", source, "route", target, "=", f"tcp:/{target}"]]))

    @staticmethod
    def _gc(_request: _Request) -> Answer:
        return Answer(plain=True, body=Bottle([["garbage collection done."]]))

    @staticmethod
    def _help(request: _Request) -> Answer:
        return Answer(plain=not request.bot, body=Bottle(_HELP if request.bot else (_HELP_TITLE, *_HELP)))

    # Subscriptions -----------------------------------------------------------------------------------------------

    def _subscribe(self, request: _Request) -> Bottle:
        if not request.text(2):
            return self._subscriptions.listed(request.text(1))
        return _judged(self._subscriptions.subscribe(request.text(1), request.text(2), request.text(3)))

    def _unsubscribe(self, request: _Request) -> Bottle:
        return _judged(self._subscriptions.unsubscribe(request.text(1), request.text(2)))

    def _announce(self, request: _Request) -> Bottle:
        activity = request.words.get(2)
        if isinstance(activity, int) and activity == 0:
            self._subscriptions.silent(request.text(1))
        else:
            self._subscriptions.came(request.text(1))
        return Bottle([_OK])

    def _topic(self, request: _Request) -> Bottle:
        if len(request.words) < _WORDS_WITH_SUBJECT:
            return Bottle(self._subscriptions.topics)
        return _judged(self._subscriptions.set_topic(request.text(1)))

    def _untopic(self, request: _Request) -> Bottle:
        return _judged(self._subscriptions.set_topic(request.text(1), active=False))

    def _type(self, request: _Request) -> Bottle:
        family, name = request.text(1), request.text(2)
        if len(request.words) == _RELATION:
            return _judged(self._subscriptions.set_type(family, name, request.text(3)))
        known = self._subscriptions.type_of(family, name) if len(request.words) == _REQUEST else ""
        return Bottle(["type", family, name, known]) if known else Bottle([_FAIL])


def _flat(described: Bottle, *, bot: bool) -> Answer:
    """Return the answer to a change. Machines get the words of the description as lines, as from YARP's server."""
    return Answer(plain=True, body=described if bot else Bottle([described]))


def _nothing(*, bot: bool) -> Answer:
    return Answer(plain=not bot)


def _judged(good: bool) -> Bottle:
    return Bottle([_OK if good else _FAIL])


def _value(text: str) -> Value:
    """Parse a property's text into a value."""
    values = Bottle.parse(text)
    return values[0] if len(values) == 1 else values or ""


def _say_nothing(_sentence: str) -> None:
    """Discard the message."""


def _discard_notification(_what: str, _name: str) -> None:
    """Discard the notification."""
