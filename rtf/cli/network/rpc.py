"""``rtf rpc`` and ``rtf admin``: put questions to a port and print the answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Vocab, to_string
from rtf.cli.network.options import add_timeout, contact, make_network, make_parser
from rtf.cli.network.terminal import ENDING, complain, say, typed
from rtf.middleware.carriers.tcp import Tcp
from rtf.middleware.codecs import BOTTLE
from rtf.middleware.errors import ConnectError, MiddlewareError, NameNotFoundError
from rtf.middleware.outgoing_message import OutgoingMessage
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType
    from typing import Self

    from rtf.cli.parser import Parser
    from rtf.middleware.names import Contact
    from rtf.middleware.network import Network

#: What a caller is called that has no port of its own.
_LABEL = "anon_rpc"


def rpc(words: Sequence[str]) -> ExitCode:
    """Ask the owner of a port."""
    parser = make_parser(
        "rpc",
        "Put questions to a port, one for each line of the standard input, or the one that is given.",
        "rtf rpc /robot/left_arm/rpc:i '[get] [axes]'\nrtf rpc /robot/left_arm/rpc:i < questions.txt",
    )
    return _converse(parser, words, "d")


def admin(words: Sequence[str]) -> ExitCode:
    """Ask the port itself."""
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
    questions = iter([" ".join(options.question)]) if options.question else typed(">> ")
    network = make_network()
    with Caller(network, options.port) as caller:
        for question in questions:
            if not question.strip():
                continue
            try:
                answer = caller.ask(key, Bottle.parse(question), options.timeout)
            except MiddlewareError as error:
                complain(
                    f"{options.port.name} did not answer {question!r}: {error}", "'rtf ping' says whether it lives"
                )
                return ExitCode.FAILURES
            _show(options.port, answer)
    return ExitCode.PASSED


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
    """A connection to ask by, over tcp and without a port of one's own, as long as the block lasts.

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
            self._link = Tcp().call(stream, _LABEL)
        except MiddlewareError:
            stream.close()
            raise
        self._dialect = network.dialect

    def ask(self, key: str, question: Bottle, timeout: float | None = None) -> Bottle | None:
        """Ask, and wait for the answer; None when the other side has none to give. Raises MiddlewareError."""
        link = self._link
        link.limit_waiting(timeout)
        link.send(OutgoingMessage(key, question, BOTTLE, self._dialect))
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
