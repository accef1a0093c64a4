"""The server of Cartesian control: the ports of a controller.

=================  ====================================================================================================
``NAME/rpc:i``     requests, see :mod:`rtf.robot.cartesian.requests`; each client is served in a thread of its own, so
                   one that waits for a motion to begin does not keep another from stopping it
``NAME/command:i`` streamed targets and velocities, without an answer
``NAME/state:o``   the pose of the tip with its stamp, while there is a solver
``NAME/events:o``  events with their stamps; none is skipped
=================  ====================================================================================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_vocab
from rtf.robot.cartesian.requests import GO, TABLE, VELOCITY, motion_of
from rtf.robot.errors import RefusedError
from rtf.robot.network.request_table import POSE_SIZE, array
from rtf.robot.network.task_server import TaskServer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.interfaces.cartesian import ICartesianControl
    from rtf.robot.publishing import Outlets


class CartesianServer(TaskServer["FloatArray"]):
    """The ports of a controller; ``period`` in s is that of its poses.

    Raises ConnectError and AddressError.
    """

    table, streams, rpc_end = TABLE, ("/state:o",), "/rpc:i"

    def __init__(
        self,
        control: ICartesianControl,
        name: str,
        *,
        network: Network,
        period: float = 0.01,
        outlets: Outlets | None = None,
    ) -> None:
        self._control = control
        super().__init__(control, name, network=network, period=period, outlets=outlets)

    def measure(self, now: float) -> tuple[FloatArray, float] | None:
        if not self._control.solver_connected():
            return None
        pose = self._control.pose()
        return pose.vector, pose.time or now  # of boards that do not report the time of their encoders

    def commands(self) -> Sequence[tuple[str, Callable[[Sequence[Value]], None]]]:
        return [("/command:i", self._command)]

    def _command(self, command: Sequence[Value]) -> None:
        word = as_vocab(command[0] if command else None)
        if word == GO:
            self._control.stream_target(*motion_of(command[1:]))
        elif word == VELOCITY and len(command) > 1:
            self._control.stream_velocity(array(command[1], POSE_SIZE))
        else:
            raise RefusedError(f"{self.name} has no command {Bottle(command).to_text()[:80]}")
