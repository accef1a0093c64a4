"""The questions of a client to a board, and what is made of the answers.

A board answers one question of a client after the other. Every question has its time; a board that does not answer in
it is hung up on, because a late answer would be taken for that to the next question, and connected to anew when the
next question is put. No question is put twice by itself: nobody knows whether the board obeyed the first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from rtf.bottle import Bottle, Value
from rtf.errors import RtfError
from rtf.middleware.names import Contact
from rtf.middleware.rpc import RpcClient
from rtf.robot.client.questions import ASKED, PROTOCOL, plain
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.vocabulary import FAIL, IS, NAK, OK, PROTOCOL_VERSION
from rtf.robot.vocabulary import PROTOCOL as VERSION

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.network import Network
    from rtf.robot.client.questions import Asked, Question

#: Seconds that an action may take whose answer comes when it is done, such as the calibration of a whole part.
ACTION_LIMIT = 600.0
_SHOWN = 120
_PROTOCOL_ANSWER = 5


class BoardRpc:
    """The connection by which a board is asked, from a port whose name begins with ``local``.

    ``remade`` is called when it has been lost and is wanted again.

    All may be called from any thread; each waits until those before are answered.
    """

    #: How the names of the ports of the two ends go on.
    ends: ClassVar[tuple[str, str]] = ("rpc:o", "rpc:i")

    def __init__(self, local: str, board: str, *, network: Network, limit: float, remade: Callable[[], None]) -> None:
        self.board = board
        self._network = network
        self._limit = limit
        self._remade = remade
        here, there = self.ends
        self._target = Contact(f"{board}/{there}")
        self._port = RpcClient(f"{local}/{here}", network=network)

    @property
    def connected(self) -> bool:
        """Whether there is a connection, as far as is known."""
        return bool(self._port.outputs)

    def reconnect(self) -> None:
        """Connect, by tcp; anew if there is a connection. Raises MiddlewareError."""
        self.disconnect()
        self._port.add_output(self._target, "tcp")

    def disconnect(self) -> None:
        """Hang up; the next use makes a new connection."""
        self._port.remove_output(self._target.name)

    def close(self) -> None:
        """Disconnect."""
        self._port.close()

    # Questions ---------------------------------------------------------------------------------------------------

    def get(self, question: Question, *arguments: Value) -> list[Value]:
        """The data of the answer.

        Raises RefusedError, NotSupportedError and NoAnswerError, as ``tell`` does.
        """
        answer = self._ask(self._port, question, arguments, self._limit)
        head, first, end, last = question.head, answer[0], answer[-1], len(answer) - question.tail
        # Words are the same objects as a rule, and to see that costs a tenth of comparing them.
        if last < head or (end is not OK and end != OK) or (head and first is not IS and first != IS):
            raise self.nonsense(question, arguments, answer)
        return answer[head:last]

    def read(self, question: Question, *arguments: Value) -> Any:
        """The data of the answer as what they mean: one value, or a tuple of several. Errors as for ``get``."""
        data = self.get(question, *arguments)
        try:
            values = question.kind.read(data)
        except RefusedError as error:
            raise self.nonsense(question, arguments, data, str(error)) from None
        return values[0] if len(values) == 1 else values

    def tell(self, question: Question, *arguments: Value) -> None:
        """Tell the board to do something.

        Raises RefusedError when it does not, NotSupportedError when it knows no such thing, NoAnswerError when it does
        not answer in time or what it says makes no sense.
        """
        self._tell(self._port, question, arguments, self._limit)

    def act(self, question: Question, *arguments: Value) -> None:
        """The same for what takes its time. It goes over a connection of its own, so that others are not held up.

        It is answered when it is done, within :data:`ACTION_LIMIT`.
        """
        with self._port_of_its_own() as port:
            self._tell(port, question, arguments, ACTION_LIMIT)

    def _port_of_its_own(self) -> RpcClient:
        """Another connection with the board, for what takes its time. Raises NoAnswerError."""
        try:
            return RpcClient("", self._target, network=self._network)
        except RtfError as error:
            raise NoAnswerError(f"{self.board} cannot be reached: {error}") from error

    def _tell(self, port: RpcClient, question: Question, arguments: tuple[Value, ...], limit: float) -> None:
        answer = self._ask(port, question, arguments, limit)
        if answer[0] is not OK and answer[0] != OK:
            raise self.nonsense(question, arguments, answer)

    def check_protocol(self, *, ignore: bool) -> None:
        """See whether the board speaks what this client does. Raises NotSupportedError, unless it shall be ignored."""
        try:
            answer = self._ask(self._port, PROTOCOL, (), self._limit, again=False)
        except (RefusedError, NotSupportedError):
            answer = []
        known = len(answer) == _PROTOCOL_ANSWER and answer[0] == PROTOCOL_VERSION and answer[-1] == OK
        if ignore or (known and answer[1:3] == [*VERSION[:2]]):
            return
        raise NotSupportedError(
            f"{self.board} does not speak version {VERSION[0]}.{VERSION[1]} of the protocol of control boards but "
            f"answers {_shown(answer)} when it is asked; ignoreProtocolCheck makes it be tried all the same"
        )

    def get_at_once(self, question: Question) -> list[Value]:
        """As ``get`` over the connection that there is, for the making of a connection itself."""
        answer = self._ask(self._port, question, (), self._limit, again=False)
        return answer[question.head : len(answer) - question.tail]

    def _ask(
        self, port: RpcClient, question: Question, arguments: tuple[Value, ...], limit: float, *, again: bool = True
    ) -> list[Value]:
        """The elements of an answer that is no failure, of which there is at least one."""
        if again and not port.outputs:
            self._remade()
        asked = question, arguments
        try:
            answer = port.call(asked, codec=ASKED, timeout=limit)
        except RtfError as error:
            raise NoAnswerError(f"{self.board} did not answer {_text(asked)}: {error}") from error
        elements = answer.elements() if answer is not None else []
        if not elements:
            raise NoAnswerError(f"{self.board} answered {_text(asked)} with nothing, which makes no sense")
        first = elements[0]
        if first is IS or first is OK:  # as nearly always
            return elements
        if first == FAIL:
            raise RefusedError(f"{self.board} refused {_text(asked)}{_joints(arguments)}")
        if first == NAK:
            raise NotSupportedError(f"{self.board} does not know what {_text(asked)} means")
        return elements

    def nonsense(
        self, question: Question, arguments: tuple[Value, ...], answer: list[Value], why: str = ""
    ) -> NoAnswerError:
        """What to raise for an answer that cannot be used."""
        reason = f": {why}" if why else ""
        asked = _text((question, arguments))
        return NoAnswerError(f"{self.board} answered {asked} with {_shown(answer)}, which makes no sense{reason}")


def _joints(arguments: tuple[Value, ...]) -> str:
    """Which joints a question is about, for a sentence; empty when about all of them, or none."""
    for place, argument in enumerate(arguments):
        if type(argument) is int:
            group = arguments[place + 1] if place + 1 < len(arguments) else None
            return f", joints {group.to_text()}" if isinstance(group, Bottle) else f", joint {argument}"
    return ""


def _text(asked: Asked) -> str:
    """A question as it stands in a sentence."""
    return _shown(plain(asked).elements())


def _shown(elements: list[Value]) -> str:
    """An answer likewise."""
    text = Bottle.adopt(elements).to_text()
    return f"'{text[:_SHOWN]}{'…' if len(text) > _SHOWN else ''}'"
