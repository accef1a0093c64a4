"""A walk through the control modes in which every request is made in every mode, with few steps that repeat one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import HOLDING_MODES, TRANSITIONS, ControlMode

if TYPE_CHECKING:
    from collections.abc import Collection


class ModeWalk:
    """The requests of :data:`TRANSITIONS` that are still to be made in the modes ``states``.

    ``without`` are modes that the robot has not got: they are neither asked for nor entered.
    """

    def __init__(self, states: Collection[ControlMode], without: Collection[ControlMode] = ()) -> None:
        self.open: dict[ControlMode, list[ControlMode]] = {state: [] for state in states if state not in without}
        for state, request in TRANSITIONS:
            if state in self.open and request not in without:
                self.open[state].append(request)
        for state, requests in self.open.items():
            if state not in HOLDING_MODES:  # it is left at once for what holds a joint
                requests.sort(key=lambda request: request is not ControlMode.POSITION)

    @property
    def pairs(self) -> set[tuple[ControlMode, ControlMode]]:
        """What is still open, as (state, request)."""
        return {(state, request) for state, requests in self.open.items() for request in requests}

    def next_request(self, state: ControlMode) -> ControlMode | None:
        """What to ask for in a state: what was not asked there, or what leads to where something is open; None: over.

        What is answered counts as made.
        """
        requests = self.open.get(state)
        if requests:
            return requests.pop(0)
        return next((other for other, left in self.open.items() if left), None)
