"""A board that can only be asked: what a test gets of a part that it has not said it would move."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.robot.client.control_board import RemoteControlBoard
from rtf.robot.client.link import ControlBoardLink
from rtf.robot.client.questions import CALIBRATION_DONE, plain
from rtf.robot.client.rpc import BoardRpc
from rtf.robot.client.settings import unique_local
from rtf.testing.outcome import TestProblem

if TYPE_CHECKING:
    from rtf.bottle import Value
    from rtf.middleware.network import Network
    from rtf.robot.client.questions import Question
    from rtf.robot.client.settings import ClientSettings
    from rtf.robot.interfaces import AxisSelection, Values


class UndeclaredMotionError(TestProblem):
    """A test commands a part, and its class says that it only listens. Nothing was sent."""

    def __init__(self, name: str, what: str) -> None:
        super().__init__(
            f"{name}: {what}, and no guard looks on, for the test says that it only listens; "
            "declare safety = Safety.MOTION in its class, or what else it does"
        )


class _AskingRpc(BoardRpc):
    """Refuses what is told, before it is sent, until the board shall obey."""

    obeys = False

    def tell(self, question: Question, *arguments: Value) -> None:
        if question is not CALIBRATION_DONE:  # that one is a question, answered as if it were told
            self._check(question)
        super().tell(question, *arguments)

    def act(self, question: Question, *arguments: Value) -> None:
        self._check(question)
        super().act(question, *arguments)

    def _check(self, question: Question) -> None:
        if not self.obeys:
            raise UndeclaredMotionError(self.board, f"'{plain((question, ())).to_text()}' would be told")


class ListeningBoard(RemoteControlBoard):
    """A board at the other end of a network that is asked and not told: commands raise UndeclaredMotionError."""

    _asking: _AskingRpc

    def obey(self) -> None:
        """Let commands pass from now on: a guard looks on."""
        self._asking.obeys = True

    def _connect(self, settings: ClientSettings) -> ControlBoardLink[BoardRpc]:
        link = ControlBoardLink[BoardRpc](settings, self.network, _AskingRpc)
        assert isinstance(link.rpc, _AskingRpc)
        self._asking = link.rpc
        return link

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        if not self._asking.obeys:
            raise UndeclaredMotionError(self.name, f"{method} would be sent")
        super()._stream(method, values, axes)


def listen_to(remote: str, *, carrier: str, network: Network) -> ListeningBoard:
    """Open a client of a board such as ``/icub/left_arm`` that is only asked. Raises DeviceError."""
    board = ListeningBoard(remote, network=network)
    board.open(Property({"remote": remote, "local": unique_local(remote), "carrier": carrier}))
    return board
