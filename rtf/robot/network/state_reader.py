"""The published state of a board at its client: the latest message, and its age.

A reading sends no request: it is the latest state, or an error if that is older than the client's timeout. By the
machine's clock the age counts from the arrival, so the clocks of robot and client need not agree. By a simulator's
clock it counts from the stamp of the message, because simulated seconds may pass in an instant, or not at all.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rtf import clock
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.extended_state import EXTENDED_STATE, ExtendedState, Field
from rtf.robot.interfaces import selected
from rtf.robot.network.latest_message import LatestMessage

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.interfaces import AxisSelection, FloatArray
    from rtf.robot.network.latest_message import ReceivedValue

#: Longest wait in seconds for the first state. A board that publishes sends at least ten in this time.
_MOST_WAITING = 1.0

#: Called with the time, in seconds of the robot's clock, and each state, in the thread of the connection, which waits.
Observer: TypeAlias = "Callable[[float, ExtendedState], None]"


class StateReader(LatestMessage[ExtendedState]):
    """The port that receives a board's state. A received state is not modified any more.

    ``lost`` is called in the thread of a reader, before the error is raised, if the state is stale. A message is stored
    in the thread of the connection, before it is acknowledged, and decoded when it is read or observed. ``diagnostic``
    reports gaps between messages that are longer than ``timeout``.
    """

    def __init__(
        self,
        name: str,
        board: str,
        *,
        network: Network,
        carrier: str,
        timeout: float,
        lost: Callable[[], None],
        diagnostic: bool = False,
    ) -> None:
        self.board = board
        self.source = Contact(f"{board}/stateExt:o")
        self.axes = 0
        self._carrier = carrier
        self._lost = lost
        self._diagnostic = diagnostic
        self._first = threading.Event()
        self._observers: tuple[Observer, ...] = ()
        self._changing = threading.Lock()
        super().__init__(name, EXTENDED_STATE, timeout=timeout, network=network, lazily=True)

    def reconnect(self) -> None:
        """Connect the board's state to this port, replacing an older connection of this name.

        Raises MiddlewareError, DeviceError.
        """
        here = Contact(self.name)
        if remote.connection(self._network, self.source, here) is not None:
            remote.disconnect(self._network, self.source, here)
        self.connect(self.source.name, self._carrier)

    def wait_for_first(self) -> None:
        """Wait for a first state, at most the timeout by the machine's clock, and at most a second."""
        self._first.wait(min(self.timeout, _MOST_WAITING))

    def _receive(self, delivery: IncomingMessage) -> None:
        before = self.latest if self._diagnostic else None
        super()._receive(delivery)
        if not self._first.is_set():
            self._first.set()
        if self._observers:
            latest = self.latest
            if latest is not None:
                self._show(latest.time, latest.value)
        if before is not None:
            self._diagnose(before)

    def _diagnose(self, before: ReceivedValue[ExtendedState]) -> None:
        """Report a state that arrived late after the previous one."""
        latest = self.latest
        if latest is not None and latest.at - before.at > self.timeout:
            self._network.report(f"{self.name}: no state arrived for {latest.at - before.at:.3f} s")

    # Observing ---------------------------------------------------------------------------------------------------

    def observe(self, observer: Observer) -> None:
        """Call a function with every state from now on."""
        with self._changing:
            self._observers = (*self._observers, observer)

    def unobserve(self, observer: Observer) -> None:
        """Stop calling a function; no error if it is unknown."""
        with self._changing:
            self._observers = tuple(one for one in self._observers if one != observer)

    def _show(self, time: float, state: ExtendedState) -> None:
        """Call the observers with a state. A state with another number of axes than this client's is skipped."""
        if state.axes != self.axes:
            return
        for observer in self._observers:
            try:
                observer(time, state)
            except Exception as error:  # noqa: BLE001 - other readers need the state; the observer's error is reported
                self.unobserve(observer)
                self._network.report(
                    f"{self.name}: an observer was removed, because it raised {type(error).__name__}: {error}"
                )

    # Reading -----------------------------------------------------------------------------------------------------

    def read(self, field: Field, axes: AxisSelection = None) -> NDArray[Any]:
        """Return a copy of a field of the latest state for these axes: shape (k,), the type of the field.

        Raises StaleStateError if no state arrived within the timeout, NotSupportedError for a field that the board
        marks as invalid, RefusedError for an axis that it does not have. No helper functions: controllers call it a
        thousand times a second.
        """
        state = self._current()
        if not state.valid[field]:
            raise self._not_valid(field)
        values = state.floats[field] if field <= Field.CURRENTS else state.values(field)
        if axes is None:
            return values.copy()
        if type(axes) is int and 0 <= axes < len(values):
            return values[axes : axes + 1].copy()
        return values[chosen(self.board, len(values), axes)]

    def together(self, *fields: Field) -> tuple[NDArray[Any], ...]:
        """Return copies of several fields for all axes, from the same message. Errors as for ``read``."""
        state = self._current()
        for field in fields:
            if not state.valid[field]:
                raise self._not_valid(field)
        return tuple(state.values(field).copy() for field in fields)

    def _current(self) -> ExtendedState:
        """Return the latest state. Raises an error if it is stale, or of another board."""
        latest = self._latest if self._unread is None else self._read()
        if latest is None:
            raise self._none()
        age = clock.current().now() - latest.at
        if not -self.timeout <= age <= self.timeout:
            raise self._stale(age)
        state = latest.value
        if state.axes != self.axes:
            raise self._of_another(state)
        return state

    def times(self, axes: AxisSelection = None) -> FloatArray:
        """Return the time of the state by the robot's clock, the same for all axes. Errors as for ``read``."""
        positions = self.read(Field.JOINT_POSITIONS, axes)
        latest = self.latest
        if latest is None or latest.stamp is None:
            raise NotSupportedError(f"{self.source.name} sends its states without the time")
        return np.full(positions.shape, latest.stamp.time)

    def _none(self) -> StaleStateError:
        self._lost()
        return StaleStateError(
            f"no state has arrived from {self.source.name} at {self.name} yet; is its robot running?"
        )

    def _stale(self, age: float) -> StaleStateError:
        self._lost()
        return StaleStateError(
            f"the last state from {self.source.name} to {self.name} is {age:.3f} s old, "
            f"which is more than the timeout of {self.timeout:g} s"
        )

    def _of_another(self, state: ExtendedState) -> NoAnswerError:
        return NoAnswerError(f"{self.source.name} sends states of {state.axes} joints, but the board has {self.axes}")

    def _not_valid(self, field: Field) -> NotSupportedError:
        what = field.name.lower().replace("_", " ")
        return NotSupportedError(f"{self.board} marks {what} as invalid: it has none, or cannot measure them now")


def chosen(board: str, count: int, axes: AxisSelection) -> list[int]:
    """Return the numbers of the selected axes. Raises RefusedError, naming the board."""
    try:
        return selected(count, axes)
    except RefusedError as error:
        raise RefusedError(f"{board}: {error}") from None
