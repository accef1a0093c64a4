"""The client of a control board of YARP 3: a board that stands elsewhere, as if it stood here.

What is measured comes with the state that the board publishes; references at a high rate are streamed and not answered;
everything else is a question with an answer. For YARP 4 see :mod:`rtf.robot.client.control_board_service`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Property
from rtf.robot.client.control_board_controllers import ControllersStub
from rtf.robot.client.control_board_efforts import EffortsStub
from rtf.robot.client.control_board_modes import ModesStub
from rtf.robot.client.control_board_motion import MotionStub
from rtf.robot.client.control_board_motors import MotorsStub
from rtf.robot.client.link import ControlBoardLink
from rtf.robot.client.settings import TIMEOUT, ClientSettings, unique_local

if TYPE_CHECKING:
    from types import TracebackType
    from typing import Self

    from rtf.middleware.network import Network
    from rtf.robot.client.state import Observer


class RemoteControlBoard(MotionStub, MotorsStub, EffortsStub, ModesStub, ControllersStub):
    """``remote_controlboard``: a board of another process. The parameters are those of :class:`ClientSettings`.

    A board that is lost raises NoAnswerError, or StaleStateError for what is measured, and is looked for again by the
    next call; see :class:`~rtf.robot.client.link.ControlBoardLink` for how long that may take.

    A client that dies stops nothing: what a joint does then is the board's business. A trajectory goes on to its end, a
    joint that is moved by velocity is stopped by the board's watchdog, references of position, torque, current and duty
    cycle stay what they were last unless the board has a watchdog for them. So does ``close``: who wants joints to
    stand still says so with ``stop``, or brings them into another mode.
    """

    def open(self, configuration: Property) -> None:
        """See Device. By the machine's clock it returns with the first state, if that comes soon."""
        settings = ClientSettings.read(configuration)
        self.close()
        self._opened = ControlBoardLink(settings, self.network)
        if type(clock.current()) is clock.SystemClock:  # by others time may stand still meanwhile
            self._opened.state.wait_for_first()

    def observe(self, observer: Observer) -> None:
        """Have every state given to a function as it comes. Until ``unobserve``, until it is closed, or it raises."""
        self._link.state.observe(observer)

    def unobserve(self, observer: Observer) -> None:
        """Give it no more."""
        self._link.state.unobserve(observer)

    def close(self) -> None:
        """See Device."""
        opened, self._opened = self._opened, None
        if opened is not None:
            opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def connect(
    remote: str,
    *,
    local: str | None = None,
    carrier: str = "fast_tcp",
    network: Network | None = None,
    timeout: float = TIMEOUT,
) -> RemoteControlBoard:
    """Open a client of a board such as ``/icub/left_arm``; in a ``with`` statement it is closed, too.

    ``local`` is what the names of its ports begin with, by default one that nobody else uses. Raises DeviceError.
    """
    board = RemoteControlBoard(remote, network=network)
    parameters = {"remote": remote, "local": local or unique_local(remote), "carrier": carrier, "timeout": timeout}
    board.open(Property(parameters))
    return board
