"""Control modes in tests: as small numbers, for plots over time, and a walk that makes every request in every mode."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import HOLDING_MODES, STATES, TRANSITIONS, ControlMode

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray

_NUMBERS = {int(mode): float(number) for number, mode in enumerate(STATES)}
_UNKNOWN = -1.0
#: The legend of such a plot.
LEGEND = (
    f"modes by number: {', '.join(f'{number} {mode.word}' for number, mode in enumerate(STATES))}, "
    f"{_UNKNOWN:g} none of them"
)


def mode_numbers(modes: ArrayLike) -> FloatArray:
    """Return the legend's numbers of modes given as packed words."""
    return np.array([_NUMBERS.get(mode, _UNKNOWN) for mode in np.asarray(modes).tolist()])


class ModeWalk:
    """A walk through the modes with few repetitions: the requests that are still to be made in the modes ``states``.

    The requests are those of :data:`TRANSITIONS`. ``without`` are modes that the robot does not have: they are neither
    requested nor entered.
    """

    def __init__(self, states: Collection[ControlMode], without: Collection[ControlMode] = ()) -> None:
        self.open: dict[ControlMode, list[ControlMode]] = {state: [] for state in states if state not in without}
        for state, request in TRANSITIONS:
            if state in self.open and request not in without:
                self.open[state].append(request)
        for state, requests in self.open.items():
            if state not in HOLDING_MODES:  # leave it at once for a mode that holds the joint
                requests.sort(key=lambda request: request is not ControlMode.POSITION)

    @property
    def pairs(self) -> set[tuple[ControlMode, ControlMode]]:
        """The open pairs (state, request)."""
        return {(state, request) for state, requests in self.open.items() for request in requests}

    def next_request(self, state: ControlMode) -> ControlMode | None:
        """Return the next request in a state: an open one, or one that leads to a state with open ones.

        None if no request is open. A returned request counts as made.
        """
        requests = self.open.get(state)
        if requests:
            return requests.pop(0)
        return next((other for other, left in self.open.items() if left), None)
