"""An arm of the demonstration: it reaches for the ball, stops, and goes home."""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from rtf.bottle import Property
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.interfaces import ICartesianControl

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray

Side = Literal["left", "right"]
#: A target that has moved less than this (m) is not commanded again.
_SAME = 0.003
#: How far a hand may be sent: a box in the frame of the root (m), in front of the robot and beside it.
LOWEST, HIGHEST = np.array([-0.5, -0.4, -0.2]), np.array([-0.18, 0.4, 0.4])
_CARRIER = "tcp"
#: The first joints of the chain: pitch, roll and yaw of the torso.
_TORSO_JOINTS = 3


@dataclass(frozen=True, slots=True)
class Reach:
    """How hands reach.

    ``orientation`` is that of the hand: axis and angle (rad). ``offset`` is added to the place of the ball for the left
    hand (m); for the right one its y has the other sign. ``home`` (deg) and ``speed`` (deg/s) are those of the seven
    joints of an arm.
    """

    duration: float = 1.5  # of a motion (s)
    orientation: tuple[float, float, float, float] = (0.0, -0.70711, 0.70711, np.pi)
    offset: tuple[float, float, float] = (0.0, -0.03, 0.0)
    home: tuple[float, ...] = (-30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0)
    speed: float = 30.0
    torso: bool = True  # whether it bends and turns, too
    bend: float = 10.0  # how far it bends, forwards and backwards (deg)


class Hand:
    """A hand: clients of its Cartesian controller and of its board. ``opened`` closes them."""

    def __init__(self, side: Side, robot: str, local: str, reach: Reach, network: Network, opened: ExitStack) -> None:
        self.side = side
        self._reach = reach
        place = f"/{robot}/{side}_arm"
        self._board = opened.enter_context(
            connect(place, local=f"{local}/{side}_arm", carrier=_CARRIER, network=network)
        )
        settings = {
            "remote": f"/{robot}/cartesianController/{side}_arm",
            "local": f"{local}/{side}_arm/cartesian",
            "carrier": _CARRIER,
            "timeout": 1.0,
        }
        client = make_device("cartesiancontrollerclient", Property(settings), network=network)
        opened.enter_context(closing(client))
        self._control = client.view(ICartesianControl)  # type: ignore[type-abstract]  # it is only looked for
        self._sent: FloatArray | None = None
        self._context: int | None = None

    def prepare(self) -> None:
        """Set what takes part in its motions. Raises RobotError."""
        if self._context is None:
            self._context = self._control.store_context()
        joints = len(self._control.active_joints())
        free = self._reach.torso
        self._control.set_active_joints([free, False, free, *[True] * (joints - _TORSO_JOINTS)])
        self._control.set_limits(0, -self._reach.bend, self._reach.bend)

    def release(self) -> None:
        """Put the settings back. Raises RobotError."""
        if self._context is not None:
            self._control.restore_context(self._context)
            self._control.delete_contexts([self._context])
            self._context = None

    @property
    def moving(self) -> bool:
        """Whether it was sent somewhere, and not stopped since."""
        return self._sent is not None

    def place_for(self, ball: FloatArray) -> FloatArray:
        """Return where the hand is sent for a ball (m)."""
        x, y, z = self._reach.offset
        place: FloatArray = ball + np.array([x, y if self.side == "left" else -y, z])
        return place

    def can_reach(self, ball: FloatArray) -> bool:
        """Return whether a ball is where a hand may be sent."""
        place = self.place_for(ball)
        return bool((place >= LOWEST).all() and (place <= HIGHEST).all())

    def reach(self, ball: FloatArray) -> None:
        """Send the hand to a ball, unless it is on its way there. Raises RobotError."""
        place = self.place_for(ball)
        if self._sent is not None and np.linalg.norm(place - self._sent) < _SAME:
            return
        self._control.go_to([*place, *self._reach.orientation], self._reach.duration)
        self._sent = place

    def stop(self) -> None:
        """Stop it where it is. Raises RobotError."""
        self._sent = None
        self._control.stop()

    def go_home(self) -> None:
        """Move the joints of the arm home, slowly. Raises RobotError."""
        self._sent = None
        move_joints(self._board, self._reach.home, self._reach.speed)


def move_joints(board: RemoteBoard, positions: Sequence[float], speed: float) -> None:
    """Move the first joints of a board to positions (deg) at a speed (deg/s). Raises RobotError."""
    joints = list(range(len(positions)))
    board.set_control_modes(ControlMode.POSITION, joints)
    board.set_reference_speeds([speed] * len(joints), joints)
    board.position_move(list(positions), joints)
