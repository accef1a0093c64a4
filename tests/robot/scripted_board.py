"""A control board with scripted answers, on real ports; it records requests and commands."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import Stamp
from rtf.robot.extended_state import EXTENDED_STATE, ExtendedState
from rtf.robot.network.streamed_commands import COMMAND
from rtf.robot.yarp3.client import RemoteControlBoard

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType
    from typing import Any, Self

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types import Pair
    from rtf.robot.errors import RobotError


class ScriptedBoard:
    """Ports like those of a board with so many axes.

    ``answer`` returns the answer to each request that does not belong to the opening; ``protocol`` is the answer about
    the version. A state is sent to each reader that connects, and whenever ``publish`` is called.
    """

    def __init__(
        self,
        name: str,
        network: Network,
        *,
        axes: int = 3,
        answer: Callable[[Bottle], Bottle] = lambda _: Bottle.parse("[ok]"),
        protocol: str = "[prot] 1 9 0 [ok]",
    ) -> None:
        self.name = name
        self.asked: list[str] = []
        self.answer = answer
        self.state = ExtendedState(axes)
        self.state.valid[:] = True
        self._opening = {
            "[get] [prot]": Bottle.parse(protocol),
            "[get] [axes]": Bottle.parse(f"[is] [axes] {axes} [tsta] 0 0.0 [ok]"),
        }
        self._stamp = Stamp()
        with ExitStack() as opened:
            opened.enter_context(RpcServer(f"{name}/rpc:i", self._answer, network=network))
            self.commands: BufferedPort[Pair[Bottle, Any]] = opened.enter_context(
                BufferedPort(f"{name}/command:i", COMMAND, strict=True, network=network, outputs=False)
            )
            self._states = opened.enter_context(_States(self, network))
            self._opened = opened.pop_all()

    def publish(self) -> None:
        """Send the state, stamped with the present time."""
        self._stamp = self._stamp.next(clock.now())
        self._states.write(self.state, envelope=str(self._stamp))

    def _answer(self, question: Bottle) -> Bottle:
        text = question.to_text()
        if text in self._opening:
            return self._opening[text]
        self.asked.append(text)
        return self.answer(question)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()


class _States(BufferedPort[ExtendedState]):
    def __init__(self, board: ScriptedBoard, network: Network) -> None:
        self._board = board
        super().__init__(f"{board.name}/stateExt:o", EXTENDED_STATE, network=network, inputs=False)

    def connected(self, output: Output) -> None:
        super().connected(output)
        self._board.publish()


@contextmanager
def client_of(board: ScriptedBoard, network: Network, **parameters: object) -> Iterator[RemoteControlBoard]:
    """Return an open client with a unique name."""
    client = RemoteControlBoard("board", network=network)
    given = {"remote": board.name, "local": "/client", "carrier": "tcp", "timeout": 10.0, **parameters}
    client.open(Property({key: value for key, value in given.items() if value is not None}))
    try:
        yield client
    finally:
        client.close()


def raises(kind: type[RobotError], call: Callable[[], object]) -> bool:
    """Return whether a call raises this error."""
    try:
        call()
    except kind:
        return True
    return False


def names(network: Network) -> set[str]:
    """Return the registered names."""
    return {contact.name for contact in network.names.list()}
