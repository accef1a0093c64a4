"""What a board says of itself a hundred times a second, as its client has it: the newest message, and its age.

A reading asks nobody: it is the last state that came, or an error when that is older than the client's time-out. By
the machine's clock the age counts from the arrival, so the clocks of robot and client need not agree. By a simulator's
clock it counts from the stamp of the message, for there a second may pass in a moment, or in none.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rtf import clock
from rtf.middleware import remote
from rtf.middleware.names import Contact
from rtf.robot.client.newest import Newest
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.extended_state import EXTENDED_STATE, ExtendedState, Field
from rtf.robot.interfaces import selected

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.middleware.incoming_message import IncomingMessage
    from rtf.middleware.network import Network
    from rtf.robot.client.newest import Came
    from rtf.robot.interfaces import AxisSelection, FloatArray

#: Seconds that opening waits for the first state. A board that publishes at all does so ten times in them.
_MOST_WAITING = 1.0

#: Is given each state with its time, s of the robot's clock; in the thread of the connection, which waits meanwhile.
Observer: TypeAlias = "Callable[[float, ExtendedState], None]"


class StateReader(Newest[ExtendedState]):
    """The port to which a board sends its state, which nobody changes any more once it has come.

    ``lost`` is called in the thread of a reader, before the error is raised, when no state came for too long. A message
    is kept in the thread of the connection, before it is acknowledged, and read when it is asked for or observed.
    ``diagnostic`` reports messages that come later after each other than ``timeout``.
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
        """Have the board send here, and to nobody who had this name before. Raises MiddlewareError, DeviceError."""
        here = Contact(self.name)
        if remote.connection(self._network, self.source, here) is not None:
            remote.disconnect(self._network, self.source, here)
        self.connect(self.source.name, self._carrier)

    def wait_for_first(self) -> None:
        """Wait for a state to come, no longer than the time-out by the machine's clock, and than a second."""
        self._first.wait(min(self.timeout, _MOST_WAITING))

    def _receive(self, delivery: IncomingMessage) -> None:
        before = self.came if self._diagnostic else None
        super()._receive(delivery)
        if not self._first.is_set():
            self._first.set()
        if self._observers:
            came = self.came
            if came is not None:
                self._show(came.at if came.stamp is None else came.stamp.time, came.value)
        if before is not None:
            self._diagnose(before)

    def _diagnose(self, before: Came[ExtendedState]) -> None:
        """Say that a state came late after the one before."""
        came = self.came
        if came is not None and came.at - before.at > self.timeout:
            self._network.report(f"{self.name}: no state came for {came.at - before.at:.3f} s")

    # Observing ---------------------------------------------------------------------------------------------------

    def observe(self, observer: Observer) -> None:
        """Give every state to a function from now on."""
        with self._changing:
            self._observers = (*self._observers, observer)

    def unobserve(self, observer: Observer) -> None:
        """Give it no more; nothing happens if it was given none."""
        with self._changing:
            self._observers = tuple(one for one in self._observers if one != observer)

    def _show(self, time: float, state: ExtendedState) -> None:
        """Give a state to the observers; one of another board than this client was opened for is none of theirs."""
        if state.axes != self.axes:
            return
        for observer in self._observers:
            try:
                observer(time, state)
            except Exception as error:  # noqa: BLE001 - the state is everybody's, and the observer's fault is told
                self.unobserve(observer)
                self._network.report(
                    f"{self.name}: an observer is given no more states, it raised {type(error).__name__}: {error}"
                )

    # Reading -----------------------------------------------------------------------------------------------------

    def read(self, field: Field, axes: AxisSelection = None) -> NDArray[Any]:
        """A copy of what was measured last, for these axes; shape (k,), of the type of the field.

        Raises StaleStateError when nothing came within the time-out, NotSupportedError for what the board says is not
        valid, RefusedError for an axis that it does not have. Flat, as controllers call it a thousand times a second.
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
        """Copies of several fields for all axes, all of the same message. Errors as for ``read``."""
        state = self._current()
        for field in fields:
            if not state.valid[field]:
                raise self._not_valid(field)
        return tuple(state.values(field).copy() for field in fields)

    def _current(self) -> ExtendedState:
        """The state that came last. Raises an error for one that is too old, or of another board."""
        came = self._came if self._unread is None else self._read()
        if came is None:
            raise self._none()
        age = clock.current().now() - came.at
        if not -self.timeout <= age <= self.timeout:
            raise self._stale(age)
        state = came.value
        if state.axes != self.axes:
            raise self._of_another(state)
        return state

    def times(self, axes: AxisSelection = None) -> FloatArray:
        """When what is read was true, by the robot's clock; the same for all axes. Errors as for ``read``."""
        positions = self.read(Field.JOINT_POSITIONS, axes)
        came = self.came
        if came is None or came.stamp is None:
            raise NotSupportedError(f"{self.source.name} sends its states without the time")
        return np.full(positions.shape, came.stamp.time)

    def _none(self) -> StaleStateError:
        self._lost()
        return StaleStateError(f"no state has come from {self.source.name} to {self.name} yet; look whether it runs")

    def _stale(self, age: float) -> StaleStateError:
        self._lost()
        return StaleStateError(
            f"the last state from {self.source.name} to {self.name} is {age:.3f} s old, "
            f"which is more than the time-out of {self.timeout:g} s"
        )

    def _of_another(self, state: ExtendedState) -> NoAnswerError:
        return NoAnswerError(
            f"{self.source.name} sends states of {state.axes} joints, which makes no sense: the board has {self.axes}"
        )

    def _not_valid(self, field: Field) -> NotSupportedError:
        what = field.name.lower().replace("_", " ")
        return NotSupportedError(f"{self.board} gives no valid {what}: it has none, or cannot measure them now")


def chosen(board: str, count: int, axes: AxisSelection) -> list[int]:
    """The numbers of the axes. Raises RefusedError, naming the board."""
    try:
        return selected(count, axes)
    except RefusedError as error:
        raise RefusedError(f"{board}: {error}") from None
