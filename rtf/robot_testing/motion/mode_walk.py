"""A walk through the control modes that makes every request in every mode, with few repetitions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import HOLDING_MODES, TRANSITIONS, ControlMode

if TYPE_CHECKING:
    from collections.abc import Collection


class ModeWalk:
    """The requests of :data:`TRANSITIONS` that are still to be made in the modes ``states``.

    ``without`` are modes that the robot does not have: they are neither requested nor entered.
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
