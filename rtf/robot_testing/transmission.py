"""How the motors of a part are geared to its joints, by the board's own account, and how well the encoders agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from rtf.bottle import as_float, as_list
from rtf.robot.errors import NotSupportedError, RefusedError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rtf.bottle import Bottle
    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import FloatArray
    from rtf.testing import TestCase

#: The remote variable with the coupling matrices: a list of square blocks, each flattened row by row.
COUPLING_VARIABLE = "kinematic_mj"


@dataclass(frozen=True, slots=True)
class Transmission:
    """``rotor = gearbox * (coupling @ joint)``, all in deg; rows are motors, columns joints, by number in the part.

    ``blocks`` has for each joint the joints of its board, among which there may be couplings. ``untold`` is why nothing
    is known of couplings; "" where the board tells of them.
    """

    gearbox: FloatArray
    coupling: FloatArray
    blocks: tuple[tuple[int, ...], ...]
    untold: str = ""

    @classmethod
    def read(cls, board: RemoteControlBoard) -> Self:
        """Ask a board. One that tells no coupling has none. Raises RobotError for what makes no sense."""
        axes = board.axes()
        gearbox = np.array([board.gearbox_ratio(motor) for motor in range(axes)])
        if not (np.isfinite(gearbox) & (gearbox != 0)).all():
            raise RefusedError(f"gearbox ratios of {gearbox.tolist()} make no sense: none may be 0")
        try:
            told = board.variable(COUPLING_VARIABLE)
        except (NotSupportedError, RefusedError) as error:
            return cls(gearbox, np.eye(axes), tuple((joint,) for joint in range(axes)), str(error))
        return cls(gearbox, *block_diagonal(told, axes))

    def tell(self, test: TestCase, part: str) -> None:
        """Warn that the joints of a part are taken to be uncoupled, where nothing is known of that."""
        if self.untold:
            test.warn(
                f"{part} does not tell how its motors are coupled: each is taken to move its own joint alone, and what "
                f"is said of coupled joints may be wrong ({COUPLING_VARIABLE}: {self.untold})"
            )

    def rotors(self, joints: ArrayLike) -> FloatArray:
        """Where the rotors are (deg) when the joints are there; shape (axes,) or (states, axes).

        Of a joint that shows no number those are unknown that turn it, and no others.
        """
        shown = np.asarray(joints, dtype=np.float64)
        missing = ~np.isfinite(shown)
        angles = self.gearbox * (np.where(missing, 0.0, shown) @ self.coupling.T)
        return np.where(missing @ (self.coupling.T != 0), np.nan, angles)

    @property
    def factors(self) -> FloatArray:
        """How many degrees each rotor turns for one of the joint of the same number, with its sign.

        Of a motor that does not move that joint: for the one that it moves most.
        """
        own = np.diagonal(self.coupling)
        most = self.coupling[np.arange(len(own)), np.abs(self.coupling).argmax(axis=1)]
        factors: FloatArray = self.gearbox * np.where(own != 0, own, most)
        return factors

    def sharing(self, joint: int) -> set[int]:
        """A joint, and those that have a motor in common with it."""
        turns = self.coupling != 0
        return {int(other) for other in np.flatnonzero(turns[turns[:, joint]].any(axis=0))} | {joint}

    def coupled(self, joint: int) -> list[int]:
        """A joint, and all that share motors with it, or with each other: boards may change their modes together."""
        found, waiting = set[int](), {joint}
        while waiting:
            found |= waiting
            waiting = set[int]().union(*map(self.sharing, waiting)) - found
        return sorted(found)

    def disagreement(self, joints: ArrayLike, rotors: ArrayLike) -> FloatArray:
        """By how much rotors are elsewhere than the joints say, in deg of the joint of the same number."""
        apart: FloatArray = (np.asarray(rotors, dtype=np.float64) - self.rotors(joints)) / self.factors
        return apart

    def went_along(self, board: RemoteControlBoard, joint: int, mode: ControlMode) -> list[int]:
        """The joints coupled with one that are in the mode that only that one was asked for, as many boards do it."""
        others = [one for one in self.coupled(joint) if one != joint]
        return [one for one in others if board.control_mode(one) is mode]

    def holding_duty(self, duties: ArrayLike, joint: int) -> float:
        """The duty cycle (%) at which the motor of a joint alone gives the torque that it has from all its motors."""
        column = np.sign(self.gearbox) * self.coupling[:, joint]
        own = column[joint]
        return float(np.asarray(duties, dtype=np.float64) @ column / own) if own else 0.0


def block_diagonal(blocks: Bottle, axes: int) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """The whole matrix of a list of flattened square blocks, and the joints of each joint's block.

    Joints behind the last block are not coupled. Raises RefusedError for what is no such list, or too large.
    """
    matrix, first = np.eye(axes), 0
    members: list[tuple[int, ...]] = [(joint,) for joint in range(axes)]
    for number, item in enumerate(blocks):
        inner = as_list(item)
        numbers = np.array([] if inner is None else [as_float(value) for value in inner], dtype=np.float64)
        size = round(numbers.size**0.5)
        if size == 0 or size * size != numbers.size or first + size > axes or not np.isfinite(numbers).all():
            raise RefusedError(
                f"block {number} of {COUPLING_VARIABLE} has {numbers.size} numbers; a square one that fits into the "
                f"{axes - first} joints that are left is needed"
            )
        span = slice(first, first + size)
        matrix[span, span] = numbers.reshape(size, size)
        members[span] = [tuple(range(first, first + size))] * size
        first += size
    return matrix, tuple(members)
