"""Transmission of a part: gearbox ratios and couplings as its board reports them, and agreement of the encoders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from rtf.bottle import as_float, as_list
from rtf.robot.errors import NotSupportedError, RefusedError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rtf.bottle import Bottle
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.control_modes import ControlMode
    from rtf.robot.interfaces import FloatArray
    from rtf.testing import TestCase

#: The remote variable with the coupling matrices: a list of square blocks, each flattened row by row.
COUPLING_VARIABLE = "kinematic_mj"


@dataclass(frozen=True, slots=True)
class Transmission:
    """The transmission ``rotor = gearbox * (coupling @ joint)``, in deg; rows are motors, columns joints of the part.

    ``blocks`` has for each joint the joints of its board, which may be coupled. ``unknown`` is the reason why the
    couplings are unknown; "" if the board reports them. The ratios are NaN if only the couplings were read.
    """

    gearbox: FloatArray
    coupling: FloatArray
    blocks: tuple[tuple[int, ...], ...]
    unknown: str = ""

    @classmethod
    def read(cls, board: RemoteBoard) -> Self:
        """Read the transmission from a board; without a reported coupling there is none.

        Raises RobotError for invalid ratios or matrices.
        """
        axes = board.axes()
        gearbox = np.array([board.gearbox_ratio(motor) for motor in range(axes)])
        if not (np.isfinite(gearbox) & (gearbox != 0)).all():
            raise RefusedError(f"invalid gearbox ratios {gearbox.tolist()}: none may be 0")
        try:
            blocks = board.variable(COUPLING_VARIABLE)
        except (NotSupportedError, RefusedError) as error:
            return cls(gearbox, *_uncoupled(axes), str(error))
        return cls(gearbox, *block_diagonal(blocks, axes))

    @classmethod
    def read_couplings(cls, board: RemoteBoard) -> Self:
        """Read which joints are coupled, without the ratios; invalid couplings are unknown, and so there are none.

        Raises NoAnswerError if the board does not answer.
        """
        axes = board.axes()
        ratios = np.full(axes, np.nan)
        try:
            return cls(ratios, *block_diagonal(board.variable(COUPLING_VARIABLE), axes))
        except (NotSupportedError, RefusedError) as error:
            return cls(ratios, *_uncoupled(axes), str(error))

    def warn_if_unknown(self, test: TestCase, part: str) -> None:
        """Warn that the joints of a part are assumed to be uncoupled, if its couplings are unknown."""
        if self.unknown:
            test.warn(
                f"{part} does not report the coupling of its motors: each is assumed to move its own joint only, and "
                f"verdicts on coupled joints may be wrong ({COUPLING_VARIABLE}: {self.unknown})"
            )

    def rotors(self, joints: ArrayLike) -> FloatArray:
        """Return the rotor positions (deg) that belong to joint positions (deg); shape (axes,) or (states, axes).

        A joint position that is not finite makes the rotors that turn that joint NaN, and no others.
        """
        shown = np.asarray(joints, dtype=np.float64)
        missing = ~np.isfinite(shown)
        angles = self.gearbox * (np.where(missing, 0.0, shown) @ self.coupling.T)
        return np.where(missing @ (self.coupling.T != 0), np.nan, angles)

    def joints(self, rotors: ArrayLike) -> FloatArray:
        """Return the joint positions (deg) that belong to rotor positions (deg); shape (axes,) or (states, axes).

        A rotor position that is not finite makes all joints of its state NaN. Raises RefusedError for couplings that
        leave a joint without a motor.
        """
        shown = np.asarray(rotors, dtype=np.float64) / self.gearbox
        try:
            found: FloatArray = shown @ np.linalg.inv(self.coupling).T
        except np.linalg.LinAlgError:
            raise RefusedError(f"{COUPLING_VARIABLE} has no inverse: a joint has no motor of its own") from None
        return found

    @property
    def factors(self) -> FloatArray:
        """The signed ratios of each rotor to the joint of the same number.

        For a motor that does not move that joint it is the ratio to the joint that it moves most.
        """
        own = np.diagonal(self.coupling)
        most = self.coupling[np.arange(len(own)), np.abs(self.coupling).argmax(axis=1)]
        factors: FloatArray = self.gearbox * np.where(own != 0, own, most)
        return factors

    def sharing(self, joint: int) -> set[int]:
        """Return a joint and those that have a motor in common with it."""
        turns = self.coupling != 0
        return {int(other) for other in np.flatnonzero(turns[turns[:, joint]].any(axis=0))} | {joint}

    def coupled(self, joint: int) -> list[int]:
        """Return a joint and all that are coupled with it, directly or through others, sorted.

        Boards may change the modes of coupled joints together.
        """
        found, waiting = set[int](), {joint}
        while waiting:
            found |= waiting
            waiting = set[int]().union(*map(self.sharing, waiting)) - found
        return sorted(found)

    def disagreement(self, joints: ArrayLike, rotors: ArrayLike) -> FloatArray:
        """Return the difference of rotor and joint positions, in deg of the joint of the rotor's number."""
        apart: FloatArray = (np.asarray(rotors, dtype=np.float64) - self.rotors(joints)) / self.factors
        return apart

    def went_along(self, board: RemoteBoard, joint: int, mode: ControlMode) -> list[int]:
        """Return the joints coupled with ``joint`` that are in ``mode``, too, after only ``joint`` was set to it."""
        others = [one for one in self.coupled(joint) if one != joint]
        return [one for one in others if board.control_mode(one) is mode]

    def joint_duties(self, duties: ArrayLike, joint: int) -> FloatArray:
        """Return the duty cycles of a joint (%), the sums of those of its motors; ``duties`` are (states, axes)."""
        found: FloatArray = np.asarray(duties, dtype=np.float64) @ (np.sign(self.gearbox) * self.coupling[:, joint])
        return found

    def by_motors(self, torques: ArrayLike, joint: int) -> FloatArray:
        """Return what each motor contributes to the torque of a joint, of which that is the sum; (motors,).

        ``torques`` are those of all joints. Where a joint has no motor, or one is not finite, it carries itself.
        """
        given = np.asarray(torques, dtype=np.float64)
        alone = np.where(np.arange(len(given)) == joint, given, 0.0)
        if not np.isfinite(given).all() or np.linalg.matrix_rank(self.coupling) < len(given):
            return alone
        found: FloatArray = self.coupling[:, joint] * np.linalg.solve(self.coupling.T, given)
        return found

    def holding_duty(self, duties: ArrayLike, joint: int) -> float:
        """Return the duty cycle (%) at which the joint's own motor gives the torque that all its motors give now."""
        column = np.sign(self.gearbox) * self.coupling[:, joint]
        own = column[joint]
        return float(np.asarray(duties, dtype=np.float64) @ column / own) if own else 0.0


def _uncoupled(axes: int) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    return np.eye(axes), tuple((joint,) for joint in range(axes))


def block_diagonal(blocks: Bottle, axes: int) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """Return the matrix of a list of flattened square blocks, and for each joint the joints of its block.

    Joints after the last block are not coupled. Raises RefusedError for an invalid list, or one that is too large.
    """
    matrix, first = np.eye(axes), 0
    members: list[tuple[int, ...]] = [(joint,) for joint in range(axes)]
    for number, item in enumerate(blocks):
        inner = as_list(item)
        numbers = np.array([] if inner is None else [as_float(value) for value in inner], dtype=np.float64)
        size = round(numbers.size**0.5)
        if size == 0 or size * size != numbers.size or first + size > axes or not np.isfinite(numbers).all():
            raise RefusedError(
                f"block {number} of {COUPLING_VARIABLE} has {numbers.size} numbers; it has to be square, with at most "
                f"{axes - first} joints"
            )
        span = slice(first, first + size)
        matrix[span, span] = numbers.reshape(size, size)
        members[span] = [tuple(range(first, first + size))] * size
        first += size
    return matrix, tuple(members)
