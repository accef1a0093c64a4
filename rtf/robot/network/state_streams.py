"""The state streams of a control board: its positions alone, and all measurements."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtf.middleware.types.vector import VECTOR
from rtf.robot.errors import StaleStateError
from rtf.robot.extended_state import EXTENDED_STATE, ExtendedState, Field, InterfaceState, IStateSource
from rtf.robot.network.outlets import BackgroundOutlets, StampCounter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.robot.publishing import Outlets

_POSITIONS = Field.JOINT_POSITIONS


class StateStreams:
    """The ports ``NAME/state:o`` and ``NAME/stateExt:o`` of a device with ``axes`` axes.

    Messages are sent in the background, and a slow reader misses some, unless ``outlets`` opens other ports: those of
    :class:`~rtf.robot.network.outlets.PipelinedOutlets` send in the thread that publishes, and ``settle`` waits until
    every reader that acknowledges has processed the message. Nothing is published while the joints' times are too far
    apart, which is reported.
    """

    def __init__(
        self,
        device: object,
        axes: int,
        name: str,
        *,
        network: Network,
        outlets: Outlets | None = None,
    ) -> None:
        self._source = device if isinstance(device, IStateSource) else InterfaceState(device)
        self._report = network.report
        self._name = name
        self._state = ExtendedState(axes)
        self._stamps = StampCounter()
        self._stale = False
        outlets = outlets or BackgroundOutlets()
        self._positions = outlets.open(f"{name}/state:o", VECTOR, network)
        try:
            self._extended = outlets.open(f"{name}/stateExt:o", EXTENDED_STATE, network)
        except BaseException:
            self._positions.close()
            raise

    def publish(self, now: float) -> None:
        """Publish the state, stamped with the mean time of its encoders, or ``now`` if it has none."""
        to_positions, to_extended = self._positions.outputs, self._extended.outputs
        if not (to_positions or to_extended):
            return
        state = self._state
        try:
            time = self._source.fill_state(state)
        except StaleStateError as error:
            if not self._stale:
                self._report(f"{self._name}: the state is not published: {error}")
            self._stale = True
            return
        self._stale = False
        envelope = self._stamps.next(now if math.isnan(time) else time)
        if to_positions and state.valid[_POSITIONS]:
            self._positions.write(state.joint_positions.copy(), envelope=envelope)
        if to_extended:
            self._extended.write(state.copy() if _is_shared(to_extended) else state, envelope=envelope)

    def settle(self) -> None:
        """Wait until everything published is sent, as far as the ports know."""
        self._positions.settle()
        self._extended.settle()

    def close(self) -> None:
        """Close the ports."""
        self._positions.close()
        self._extended.close()


def _is_shared(outputs: Sequence[Output]) -> bool:
    """Return whether there are ``local`` readers: they get the object itself, and may store it."""
    for output in outputs:  # noqa: SIM110 - a generator costs as much as the message
        if output.carrier == "local":
            return True
    return False
