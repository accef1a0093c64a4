"""A fake board on real ports, which counts commands."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.middleware.ports.network import Network
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.network.outlets import PipelinedOutlets

from .sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import AxisSelection, Values


class CountingBoard(FakeBoard):
    """A fake board that counts the commands that were streamed to it."""

    streamed = 0

    def open(self, configuration: Property) -> None:
        """See Device."""
        self._configuration = configuration
        super().open(configuration)

    def begin_anew(self) -> None:
        """Restore the state after opening; connections stay."""
        self.open(self._configuration)

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """See IVelocityControl."""
        super().velocity_move(velocities, joints)
        self.streamed += 1

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        """See IPositionDirect."""
        super().set_positions(positions, joints)
        self.streamed += 1

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        """See ITorqueControl."""
        super().set_reference_torques(torques, joints)
        self.streamed += 1

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        """See ICurrentControl."""
        super().set_reference_currents(currents, motors)
        self.streamed += 1

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """See IPWMControl."""
        super().set_reference_duty_cycles(duties, motors)
        self.streamed += 1


@contextmanager
def fake_board(network: Network, configuration: str = "") -> Iterator[tuple[CountingBoard, ControlBoardServer]]:
    """Serve a fake board of three joints; the test publishes its state."""
    with ExitStack() as opened:
        board = CountingBoard("fake", network=network)
        board.open(Property.parse(f"(GENERAL (Joints 3)) {configuration}"))
        opened.callback(board.close)
        server = ControlBoardServer(board, "/fake", network=network, outlets=PipelinedOutlets())
        opened.callback(server.close)
        yield board, server


def publish(server: ControlBoardServer, time: ManualClock) -> None:
    """Publish the state, and wait for readers that acknowledge."""
    server.publish(time.now())
    server.settle()
