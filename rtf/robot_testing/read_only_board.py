"""Read-only control board, for tests that do not declare to move the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.robot.client.board_requests import CALIBRATION_DONE, plain
from rtf.robot.client.control_board import RemoteControlBoard
from rtf.robot.client.control_board_link import ControlBoardLink
from rtf.robot.client.rpc import BoardRpc
from rtf.robot.client.settings import unique_local
from rtf.testing.verdict import TestProblem

if TYPE_CHECKING:
    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.client.board_requests import Request
    from rtf.robot.client.settings import ClientSettings
    from rtf.robot.interfaces import AxisSelection, Values


class UndeclaredMotionError(TestProblem):
    """A test whose safety class is ``STILL`` commands a part. Nothing was sent."""

    def __init__(self, name: str, what: str) -> None:
        super().__init__(
            f"{name}: {what}, but the test is declared as Safety.STILL, and no guard watches; "
            "declare safety = Safety.MOTION in its class, or a higher class"
        )


class _ReadOnlyRpc(BoardRpc):
    """Refuses commands before they are sent, until commands are allowed."""

    commands_allowed = False

    def tell(self, request: Request, *arguments: Value) -> None:
        if request is not CALIBRATION_DONE:  # a query that the protocol treats as a command
            self._check(request)
        super().tell(request, *arguments)

    def act(self, request: Request, *arguments: Value) -> None:
        self._check(request)
        super().act(request, *arguments)

    def _check(self, request: Request) -> None:
        if not self.commands_allowed:
            raise UndeclaredMotionError(self.board, f"'{plain((request, ())).to_text()}' would be sent")


class ReadOnlyBoard(RemoteControlBoard):
    """A remote control board that answers queries only: commands raise UndeclaredMotionError."""

    _asking: _ReadOnlyRpc

    def allow_commands(self) -> None:
        """Send commands from now on: a guard watches."""
        self._asking.commands_allowed = True

    def _connect(self, settings: ClientSettings) -> ControlBoardLink[BoardRpc]:
        link = ControlBoardLink[BoardRpc](settings, self.network, _ReadOnlyRpc)
        assert isinstance(link.rpc, _ReadOnlyRpc)
        self._asking = link.rpc
        return link

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        if not self._asking.commands_allowed:
            raise UndeclaredMotionError(self.name, f"{method} would be sent")
        super()._stream(method, values, axes)


def connect_read_only(remote: str, *, carrier: str, network: Network) -> ReadOnlyBoard:
    """Open a read-only client of a board such as ``/icub/left_arm``. Raises DeviceError."""
    board = ReadOnlyBoard(remote, network=network)
    board.open(Property({"remote": remote, "local": unique_local(remote), "carrier": carrier}))
    return board
