"""Read-only control board, for tests that do not declare to move the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.bottle import Dialect, Property
from rtf.robot.boards.client import version_of
from rtf.robot.network.board_stub import BoardStub
from rtf.robot.network.client_settings import unique_local
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot.yarp3.requests import CALIBRATION_DONE, plain
from rtf.robot.yarp3.rpc import WordRpc
from rtf.robot.yarp4.client import ControlBoardServiceClient
from rtf.robot.yarp4.rpc import ServiceRpc
from rtf.testing.verdict import TestProblem

if TYPE_CHECKING:
    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import AxisSelection, Values
    from rtf.robot.yarp3.requests import Request
    from rtf.robot.yarp4.functions import Message


#: How the names of functions begin that change nothing.
_QUERIES = ("get", "is", "check", "calibrationDone")


class UndeclaredMotionError(TestProblem):
    """A test whose safety class is ``STILL`` commands a part. Nothing was sent."""

    def __init__(self, name: str, what: str) -> None:
        super().__init__(
            f"{name}: {what}, but the test is declared as Safety.STILL, and no guard watches; "
            "declare safety = Safety.MOTION in its class, or a higher class"
        )


class _ReadOnlyWords(WordRpc):
    """Refuses commands before they are sent, until commands are allowed."""

    commands_allowed = False

    def command(self, request: Request, *arguments: Value) -> None:
        if request is not CALIBRATION_DONE:  # a query that the protocol treats as a command
            self._check(request)
        super().command(request, *arguments)

    def act(self, request: Request, *arguments: Value) -> None:
        self._check(request)
        super().act(request, *arguments)

    def _check(self, request: Request) -> None:
        if not self.commands_allowed:
            raise UndeclaredMotionError(self.board, f"'{plain((request, ())).to_text()}' would be sent")


class _ReadOnlyService(ServiceRpc):
    """The same for boards of YARP 4."""

    commands_allowed = False

    def call(self, message: Message, *arguments: object) -> Any:
        self._check(message)
        return super().call(message, *arguments)

    def call_slowly(self, message: Message, *arguments: object) -> Any:
        self._check(message)
        return super().call_slowly(message, *arguments)

    def _check(self, message: Message) -> None:
        if not (self.commands_allowed or message.name.startswith(_QUERIES)):
            raise UndeclaredMotionError(self.board, f"{message.name} would be sent")


class ReadOnlyBoard(BoardStub[Any]):
    """A remote control board that answers queries only: commands raise UndeclaredMotionError."""

    @property
    def _asking(self) -> _ReadOnlyWords | _ReadOnlyService:
        return self._link.rpc  # type: ignore[no-any-return]  # what ``rpc`` of the subclasses makes

    def allow_commands(self) -> None:
        """Send commands from now on: a guard watches."""
        self._asking.commands_allowed = True

    def _stream(self, method: str, values: Values, axes: AxisSelection) -> None:
        if not self._asking.commands_allowed:
            raise UndeclaredMotionError(self.name, f"{method} would be sent")
        super()._stream(method, values, axes)


class _ReadOnlyBoard3(ReadOnlyBoard, RemoteControlBoard):
    rpc = _ReadOnlyWords


class _ReadOnlyBoard4(ReadOnlyBoard, ControlBoardServiceClient):
    rpc = _ReadOnlyService


def connect_read_only(remote: str, *, carrier: str, network: Network) -> ReadOnlyBoard:
    """Open a read-only client of a board such as ``/icub/left_arm``. Raises DeviceError."""
    kind = _ReadOnlyBoard4 if version_of(remote, network) is Dialect.YARP4 else _ReadOnlyBoard3
    board = kind(remote, network=network)
    board.open(Property({"remote": remote, "local": unique_local(remote), "carrier": carrier}))
    return board
