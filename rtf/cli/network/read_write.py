"""``rtf read`` and ``rtf write``: open a port, print the messages that it receives, send what is typed."""

from __future__ import annotations

import contextlib
import os
import threading
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf import clock
from rtf.bottle import Bottle, as_float, as_int
from rtf.cli.network.options import add_carrier, contact, make_network, make_parser, own_name
from rtf.cli.network.terminal import Bell, complain, opened, progress, say, typed, typed_bottle
from rtf.cli.parser import seconds
from rtf.middleware.naming.configuration import opening
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.contact import Contact
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Value
    from rtf.cli.parser import Parser
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.incoming_message import IncomingMessage

#: Standard input, from which people type what the carrier ``human`` needs.
_KEYBOARD = 0
_KEYWORDS = ("envelope", "envelope2", "once")
#: Characters that ``trim`` leaves of a message by default.
_TRIM = 80


class _ReadOptions(NamedTuple):
    """The options of the words behind the port's name."""

    sources: tuple[Contact, ...]
    envelope: bool
    once: bool
    trim: int


def read(words: Sequence[str]) -> ExitCode:
    """Print messages until a signal, or until a message that says that it is the last."""
    parser = make_parser(
        "read",
        "Open a port and print each message that comes to it, a line each, until Ctrl-C.",
        "rtf read /viewer /camera/state:o\nrtf read ... fast_tcp://camera/state:o envelope once",
    )
    parser.add_argument("port", type=own_name, metavar="/PORT", help="the port to open; ... for any name")
    parser.add_argument(
        "words",
        nargs="*",
        metavar="/SOURCE|WORD",
        help="ports to read from, and: once (one message), envelope (its envelope, too), trim [N] (N characters of it)",
    )
    add_carrier(parser)
    parser.add_argument(
        "--idl", metavar="FILE[:TYPE]", help="an interface file, and its structure that the messages are"
    )
    options = parser.parse_args(words)
    read_options = _read_options(parser, options.words)
    if options.idl:
        from rtf.idl.typed import message_type

        codec: Codec[Any] = message_type(options.idl).codec
    else:
        codec = BOTTLE
    network = make_network()
    network.keyboard = _KEYBOARD
    name = opening(os.environ, options.port).name
    if name and remote.exists(network, Contact(name)):
        complain(f"There is a port {name} already.", "choose another name, or end the program that has it")
        return ExitCode.FAILURES
    printer = _Printer(read_options, codec)
    make = partial(Port, options.port, printer.receive, network=network, outputs=False)
    with contextlib.suppress(KeyboardInterrupt), opened(make) as port:
        progress(f"Port {port.name} active at {port.contact}")
        for source in read_options.sources:
            progress(remote.connect(network, source, Contact(port.name), source.carrier or options.carrier))
        printer.wait()
    if printer.failure is not None:
        raise printer.failure
    return ExitCode.PASSED


def _read_options(parser: Parser, words: Sequence[str]) -> _ReadOptions:
    """Read YARP's words, which have no dashes in front of them."""
    sources: list[Contact] = []
    said: set[str] = set()
    trim = 0
    rest = [*words]
    while rest:
        word = rest.pop(0)
        if word == "trim":
            trim = int(rest.pop(0)) if rest and rest[0].isdecimal() else _TRIM
        elif word in _KEYWORDS:
            said.add(word)
        elif "/" in word:
            sources.append(contact(word))
        else:
            parser.error(f"{word!r} is neither a port nor one of {', '.join(_KEYWORDS)}, trim")
    return _ReadOptions(tuple(sources), not said.isdisjoint(("envelope", "envelope2")), "once" in said, trim)


class _Printer:
    """Prints messages in the threads of their senders, which wait for it, so that nothing is lost or queued."""

    def __init__(self, read_options: _ReadOptions, codec: Codec[Any]) -> None:
        self._read_options = read_options
        self._codec = codec
        self._printing = threading.Lock()
        self._over = False
        self._bell = Bell()
        self.failure: OSError | None = None

    def receive(self, delivery: IncomingMessage) -> None:
        """Print one message."""
        message = delivery.read(self._codec)
        with self._printing:
            if self._over:
                return
            try:
                self._print(message, delivery.envelope)
            except OSError as error:  # the reader of the output is gone, or the disk is full: for the main thread
                self.failure = error
                self._finish()

    def _print(self, message: Any, envelope: str) -> None:  # of the codec
        if self._codec is BOTTLE:
            text = message.to_text()
            code, words = message.get(0), message.get(1)
        else:
            text, code, words = repr(message), None, None
        # What programs send that talk to people: a number, which is 1 at the end, and a line.
        if type(code) is int and isinstance(words, str) and len(message) == _SPEECH:
            if code == 1:
                self._finish()
                return
            text = words
        if self._read_options.trim:
            text = text[: self._read_options.trim]
        say(f"{_envelope_text(envelope)} {text}" if self._read_options.envelope and envelope else text)
        if self._read_options.once:
            self._finish()

    def wait(self) -> None:
        """Return at the end: the last message was printed, or the output cannot be written."""
        self._bell.wait()

    def _finish(self) -> None:
        self._over = True
        self._bell.ring()


_SPEECH = 2


def _envelope_text(envelope: str) -> str:
    """Return a stamp as a count and a time of four decimals, anything else as it is."""
    parts = Bottle.parse(envelope)
    if len(parts) == _SPEECH and all(map(_is_number, parts)):
        return f"{as_int(parts[0])} {as_float(parts[1]):.4f}"
    return envelope


def _is_number(value: Value) -> bool:
    return isinstance(value, int | float)


_LOOK_AGAIN = 0.01


def write(words: Sequence[str]) -> ExitCode:
    """Send each line as a message, until there are no more."""
    parser = make_parser(
        "write",
        'Open a port and send each line of the standard input as a message: words, numbers, "texts", (lists), [vocabs].'
        " A line waits until every reader has got it.",
        "echo '[set] [pos] 0 10.0' | rtf write /tester /robot/command:i",
    )
    parser.add_argument("port", type=own_name, metavar="/PORT", help="the port to open; ... for any name")
    parser.add_argument("targets", type=contact, nargs="*", metavar="/TARGET", help="ports to send to")
    add_carrier(parser)
    parser.add_argument(
        "--await-reader", metavar="S", type=seconds, help="send nothing before a port reads; give up after S seconds"
    )
    options = parser.parse_args(words)
    network = make_network()
    network.keyboard = _KEYBOARD
    make = partial(Port, options.port, network=network, inputs=False)
    with contextlib.suppress(KeyboardInterrupt), opened(make) as port:
        progress(f"Port {port.name} active at {port.contact}")
        for target in options.targets:
            found = port.add_output(target, target.carrier or options.carrier)
            progress(f"Added connection from {port.name} to {found.carrier}:/{target.name}")
        if options.await_reader is not None and not _has_reader(port, options.await_reader):
            complain(f"{port.name} has no reader after {options.await_reader:g} s", f"rtf connect {port.name} /READER")
            return ExitCode.FAILURES
        for line in typed():
            port.write(typed_bottle(line))
    return ExitCode.PASSED


def _has_reader(port: Port, patience: float) -> bool:
    deadline = clock.Deadline.after(patience)
    while not port.outputs and not deadline.expired:
        clock.sleep(_LOOK_AGAIN)
    return bool(port.outputs)
