"""``rtf rpc``, ``admin`` and ``rpcserver``: send requests to a port, and answer the requests of others."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from functools import partial
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Vocab, to_string
from rtf.cli.network.options import add_timeout, contact, make_network, make_parser, own_name
from rtf.cli.network.terminal import ENDING, Bell, complain, opened, progress, say, typed, typed_bottle
from rtf.errors import RtfError
from rtf.middleware.carriers.stream_carrier import TCP
from rtf.middleware.errors import ConnectError, MiddlewareError, NameNotFoundError, PortClosedError
from rtf.middleware.ports.dialect_probe import dialect_of_reader
from rtf.middleware.ports.outputs import Output
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types.codecs import BOTTLE, codec_of
from rtf.middleware.wire.outgoing_message import OutgoingMessage
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType
    from typing import Self

    from rtf.cli.parser import Parser
    from rtf.idl.typed import TypedCalls
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.record import Record
    from rtf.middleware.wire.contact import Contact

#: The name of a caller that has no port of its own.
_LABEL = "anon_rpc"


def rpc(words: Sequence[str]) -> ExitCode:
    """Send requests to the owner of a port."""
    parser = make_parser(
        "rpc",
        "Put questions to a port, one for each line of the standard input, or the one that is given.",
        "rtf rpc /robot/left_arm/rpc:i '[get] [axes]'\nrtf rpc /robot/left_arm/rpc:i < questions.txt\n"
        "rtf rpc --idl adder.thrift /adder add 2 3",
    )
    parser.add_argument(
        "--idl",
        metavar="FILE",
        help="an interface file, or the name of one of RTF's: check calls, and show results, by its services",
    )
    return _converse(parser, words, "d")


def admin(words: Sequence[str]) -> ExitCode:
    """Send admin requests to a port."""
    parser = make_parser(
        "admin",
        "Put questions of administration to a port itself, one for each line of the standard input, or the one given.",
        "rtf admin rpc /camera '[list] [out]'\nrtf admin rpc /camera '[help]'",
    )
    return _converse(parser, [*words[1:]] if words[:1] == ["rpc"] else words, "a")


def _converse(parser: Parser, words: Sequence[str], key: str) -> ExitCode:
    parser.add_argument("port", type=contact, metavar="/PORT", help="the port")
    parser.add_argument("question", nargs="*", metavar="WORD", help="ask this, and nothing else")
    add_timeout(parser, None, "how long an answer may take; without it as long as it takes")
    options = parser.parse_args(words)
    calls = _typed_calls(options.idl) if getattr(options, "idl", None) else None
    names = calls.names if calls else ()
    questions = iter([" ".join(options.question)]) if options.question else typed(">> ", names)
    network = make_network()
    with Caller(network, options.port) as caller:
        for question in questions:
            if not question.strip():
                continue
            if calls is not None:
                if not _call(caller, calls, question, options.timeout):
                    return ExitCode.FAILURES
                continue
            try:
                answer = caller.ask(key, typed_bottle(question), options.timeout)
            except MiddlewareError as error:
                complain(
                    f"{options.port.name} did not answer {question!r}: {error}", "'rtf ping' says whether it lives"
                )
                return ExitCode.FAILURES
            _show(options.port, answer)
    return ExitCode.PASSED


def _typed_calls(path: str) -> TypedCalls:
    from rtf.idl.typed import TypedCalls

    return TypedCalls(path)


def _call(caller: Caller, calls: TypedCalls, question: str, timeout: float | None) -> bool:
    """Call a function of an interface file, and show the result; returns whether there was one."""
    try:
        function, request = calls.request(typed_bottle(question))
        answer = caller.ask("d", request, timeout)
        say("(no answer)" if answer is None else calls.shown(function, answer))
    except RtfError as error:
        complain(f"{question!r}: {error}", "'help' lists the functions")
        return False
    return True


def _show(port: Contact, answer: Bottle | None) -> None:
    if answer is None:
        complain(f"{port.name} gives no answers.", "its program only listens; to send it messages use 'rtf write'")
    elif answer.get(0) == Vocab("many"):
        say("Responses:")
        for line in answer.tail():
            say(f"  {to_string(line)}")
    else:
        say(f"Response: {answer.to_text()}")


class Caller:
    """A connection for requests, over tcp and without a port of its own, for the time of the block.

    Raises NameNotFoundError and ConnectError.
    """

    def __init__(self, network: Network, target: Contact) -> None:
        found = network.resolve(target)
        if found is None:
            raise NameNotFoundError(f"no port {target.name} is registered")
        try:
            stream = network.reach(found)
        except ConnectError as error:
            raise ConnectError(f"{error}; 'rtf clean' forgets ports that are gone") from None
        try:
            self._link = TCP.call(stream, _LABEL)
            self._reader = Output(self._link, found, partial(dialect_of_reader, network, self._link.carrier, found))
        except MiddlewareError:
            stream.close()
            raise
        self._dialect = self._reader.dialect or network.dialect

    def ask(self, key: str, question: Bottle | Record, timeout: float | None = None) -> Bottle | None:
        """Send a request, and return the reply; None when the peer has none. Raises MiddlewareError."""
        link = self._link
        link.limit_waiting(timeout)
        link.send(self._reader.encoded(OutgoingMessage(key, question, codec_of(question), self._dialect)))
        if timeout is None and link.endpoint is not None:
            ENDING.wait(link.endpoint.fileno())
        answer, self._dialect = link.receive_reply_in_any(BOTTLE, self._dialect)
        link.finish()
        return answer  # type: ignore[return-value]  # which is what BOTTLE reads

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._link.close(politely=kind is None)


def rpcserver(words: Sequence[str]) -> ExitCode:
    """Answer requests until there are no more answers, or a signal comes."""
    parser = make_parser(
        "rpcserver",
        "Open a port and answer the questions that come to it, one after the other, with the lines of the standard"
        " input. Without a line left it ends.",
        "rtf rpcserver /oracle < answers.txt",
    )
    parser.add_argument("port", type=own_name, metavar="/PORT", help="the port to open; ... for any name")
    options = parser.parse_args(words)
    desk = _Desk()
    make = partial(RpcServer, options.port, desk.bring, network=make_network())
    with contextlib.suppress(KeyboardInterrupt), opened(make) as port:
        progress(f"Port {port.name} active at {port.contact}")
        try:
            desk.serve()
        finally:
            desk.close()
    return ExitCode.PASSED


class _Question:
    """One request, and the place for its reply."""

    def __init__(self, words: Bottle) -> None:
        self.words = words
        self.answer: Bottle | None = None
        self.settled = threading.Event()

    def settle(self, answer: Bottle | None) -> None:
        """Set the reply; None: there will be no reply."""
        self.answer = answer
        self.settled.set()


class _Desk:
    """The place where the threads of callers wait for the answers of the person who types."""

    def __init__(self) -> None:
        self._questions: deque[_Question] = deque()
        self._bell = Bell()
        self._lock = threading.Lock()
        self._open: set[_Question] | None = set()

    def bring(self, words: Bottle) -> Bottle:
        """Wait for the reply to a request. Raises PortClosedError when there will be none."""
        question = _Question(words)
        with self._lock:
            if self._open is None:
                raise PortClosedError("no more answers are given here")
            self._open.add(question)
        self._questions.append(question)
        self._bell.ring()
        question.settled.wait()
        if question.answer is None:
            raise PortClosedError("no more answers are given here")
        return question.answer

    def serve(self) -> None:
        """Show requests and read their replies."""
        answers = typed("Reply: ")
        while True:
            progress("Waiting for a message...")
            self._bell.wait()
            question = self._questions.popleft()
            say(f"Message: {question.words.to_text()}")
            answer = next(answers, None)
            if answer is None:
                return
            reply = typed_bottle(answer)
            with self._lock:
                if self._open is not None:
                    self._open.discard(question)
            question.settle(reply)

    def close(self) -> None:
        """Refuse all requests from now on, also those that wait."""
        with self._lock:
            waiting, self._open = self._open or set(), None
        for question in waiting:
            question.settle(None)
