"""The watch of the joints of one part: it follows their states, and finds joints that press.

It needs the states that the board publishes. Following errors are not among them: they are asked for when a joint
stands still with an unusual output, at most ten times a second.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import PidType
from rtf.robot_testing.guard.watches.joint_state import JointBounds, JointState
from rtf.robot_testing.guard.watches.overload import overload
from rtf.robot_testing.guard.watches.pressing import pressing
from rtf.robot_testing.guard.watches.saturation import saturation
from rtf.robot_testing.guard.watches.stall import may_stall, stall
from rtf.robot_testing.slides import as_text

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from numpy.typing import NDArray

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray

#: A joint is still if its positions within this time, s, differ by less than this, deg.
STILL_TIME, STILL = 0.1, 0.2
#: Shortest time between two requests of following errors, s.
_ASK_AGAIN = 0.1
#: Longest time between two states that counts as such a time, s: what happened in a longer gap is unknown.
_LONGEST = 0.1
_FOLLOWING = [ControlMode.POSITION, ControlMode.POSITION_DIRECT, ControlMode.VELOCITY, ControlMode.MIXED]
_COMMANDED = [ControlMode.PWM, ControlMode.CURRENT]
_LIMP = [ControlMode.IDLE, ControlMode.HARDWARE_FAULT]
_STIFF, _TORQUE = int(InteractionMode.STIFF), int(ControlMode.TORQUE)


class Press(NamedTuple):
    """A joint that presses: the watch that found it, and what it did."""

    joint: int
    watch: str
    text: str


class _Watch(NamedTuple):
    """A watch: its name, its function, the field of the state that it needs, and its sentence."""

    name: str
    use: Callable[[JointState, JointBounds], FloatArray]
    needs: Field
    say: Callable[[JointState, JointBounds, int], str]


def _say_overload(state: JointState, bounds: JointBounds, joint: int) -> str:
    return (
        f"draws {abs(state.currents[joint]):.2f} A, more than its nominal {bounds.nominal[joint]:g} A, for too long "
        f"(its motor may take {bounds.peak[joint]:g} A for {bounds.profile.peak_time:g} s)"
    )


def _say_saturation(state: JointState, bounds: JointBounds, joint: int) -> str:
    return f"has had {abs(state.duties[joint]):.0f} % of duty cycle for {bounds.profile.saturated_time:g} s"


def _say_stall(state: JointState, bounds: JointBounds, joint: int) -> str:
    error = as_text(bounds.metres[joint], abs(float(state.errors[joint])), "deg", ".1f")
    return (
        f"does not move although it is {error} from its setpoint and its duty cycle is "
        f"{state.duties[joint]:.0f} %, for {bounds.profile.stalled_time:g} s"
    )


def _say_pressing(state: JointState, bounds: JointBounds, joint: int) -> str:
    return (
        f"does not move in torque mode although its duty cycle is {state.duties[joint]:.0f} %, "
        f"{state.effort[joint]:.0f} % away from the one that holds it, for {bounds.profile.stalled_time:g} s"
    )


_WATCHES = (
    _Watch("overload", overload, Field.CURRENTS, _say_overload),
    _Watch("saturation", saturation, Field.DUTY_CYCLES, _say_saturation),
    _Watch("stall", stall, Field.DUTY_CYCLES, _say_stall),
    _Watch("pressing", pressing, Field.DUTY_CYCLES, _say_pressing),
)


class JointWatch:
    """The watch of a part. ``check`` is called in one thread; states arrive in that of the connection.

    Without ``currents`` overloads are not watched.
    """

    def __init__(self, board: RemoteBoard, names: Sequence[str], bounds: JointBounds, *, currents: bool = True) -> None:
        count = len(names)
        self._board, self._bounds = board, bounds
        self._watches = _WATCHES if currents else _WATCHES[1:]
        self._used = np.zeros((len(self._watches), count))
        self._resting = np.zeros(count)
        self._unknown = np.ones(count, dtype=bool)  # whether it is unknown how a joint rests
        self._duties = np.zeros(count)  # of the state before
        self._errors = np.full(count, np.nan)
        self._asked = -np.inf
        self._modes: NDArray[np.int32] | None = None
        self._following = self._torquing = self._commanded = np.zeros(count, dtype=bool)
        self._positions: deque[tuple[float, FloatArray]] = deque()
        self._newest: tuple[float, ExtendedState] | None = None
        self._last = np.nan
        self._no_errors = ""  # why following errors cannot be asked for
        board.observe(self._see)

    def _see(self, stamp: float, state: ExtendedState) -> None:
        """Keep a state. Called in the thread of the connection."""
        self._newest = stamp, state

    def forget(self, joints: Collection[int]) -> None:
        """Begin anew with joints that were stopped: they have another output now."""
        chosen = [*joints]
        self._used[:, chosen] = 0.0
        self._unknown[chosen] = True
        self._errors[chosen] = np.nan

    def farthest(self, joints: Sequence[int]) -> int:
        """Return the joint of some that is farthest from its setpoint, as far as is known; else the first.

        Of joints that share motors it is the blocked one: currents and duty cycles are those of motors.
        """
        errors = np.nan_to_num(np.abs(self._errors[[*joints]]))
        return joints[int(errors.argmax())]

    def coverage(self) -> dict[str, NDArray[np.bool_]]:
        """Return for each watch the joints that it covers."""
        found = {one.name: np.ones(self._used.shape[1], dtype=bool) for one in self._watches}
        if "overload" in found:
            found["overload"] = np.isfinite(self._bounds.nominal)
        return found

    def missing(self) -> dict[str, str]:
        """Return the watches that cannot work, each with the reason."""
        read = {Field.CURRENTS: self._board.currents, Field.DUTY_CYCLES: self._board.duty_cycles}
        found: dict[str, str] = {}
        for one in self._watches:
            try:
                read[one.needs]()
            except (NotSupportedError, RefusedError) as error:
                found[one.name] = str(error)
        if self._no_errors:
            found["stall"] = self._no_errors
        return found

    def check(self, excluded: Collection[int] = ()) -> Press | None:
        """Return a joint that has used up the time of a watch; None if there is none, or no new state.

        ``excluded`` joints are not watched.
        """
        newest = self._newest
        if newest is None or newest[0] == self._last:
            return None
        stamp, message = newest
        step, self._last = stamp - self._last, stamp
        if not step > 0.0:  # the first state, or the clock was set
            self._used[:] = 0.0
            self._positions.clear()
        state = self._state(stamp, message)
        if not step > 0.0:
            return None
        self._ask(stamp, state)
        step = min(step, _LONGEST)
        for row, watch in enumerate(self._watches):
            if not message.valid[watch.needs]:
                continue
            used = self._used[row]
            used += watch.use(state, self._bounds) * step
            np.maximum(used, 0.0, out=used)
            if excluded:
                used[[*excluded]] = 0.0
            joint = int(used.argmax())
            if used[joint] >= 1.0:
                return Press(joint, watch.name, watch.say(state, self._bounds, joint))
        return None

    def _state(self, stamp: float, message: ExtendedState) -> JointState:
        modes, positions, duties = message.control_modes, message.joint_positions, message.duty_cycles
        kept = self._positions
        while kept and kept[0][0] < stamp - STILL_TIME:
            kept.popleft()
        kept.append((stamp, positions))
        earlier = kept[0][1]
        # Not the range of all of them: a joint that goes there and back within a tenth of a second does not press.
        still = (np.abs(positions - earlier) < STILL) if stamp - kept[0][0] >= 0.5 * STILL_TIME else _none(positions)
        if self._modes is None or (modes != self._modes).any() or self._unknown.any():
            self._begin_modes(modes, duties)
        self._duties = duties
        return JointState(
            following=self._following,
            torquing=self._torquing,
            commanded=self._commanded,
            stiff=message.interaction_modes == _STIFF if message.valid[Field.INTERACTION_MODES] else ~_none(positions),
            still=still,
            duties=duties,
            resting=self._resting,
            currents=message.currents,
            errors=self._errors,
        )

    def _begin_modes(self, modes: NDArray[np.int32], duties: FloatArray) -> None:
        """Take over the modes of joints, and with which outputs those rest whose modes have changed.

        A torque begins with the output of before, if the joint had power; the others are asked how they rest.
        """
        before = self._modes
        changed = self._unknown if before is None else self._unknown | (modes != before)
        held = duties if before is None else np.where(np.isin(before, _LIMP), duties, self._duties)
        self._modes, self._torquing = modes, modes == _TORQUE
        self._following, self._commanded = np.isin(modes, _FOLLOWING), np.isin(modes, _COMMANDED)
        np.copyto(self._resting, np.where(self._torquing, held, 0.0), where=changed)
        self._unknown[:] = False

    def _ask(self, now: float, state: JointState) -> None:
        """Ask for following errors where they matter. A joint near its setpoint rests with its present output."""
        suspects = may_stall(state, self._bounds)
        if not suspects.any():
            self._errors[:] = np.nan
            return
        self._errors[~suspects] = np.nan
        if self._no_errors or 0.0 <= now - self._asked < _ASK_AGAIN:
            return
        self._asked = now
        try:
            errors = self._board.pid_errors(PidType.POSITION)
        except (NotSupportedError, RefusedError) as error:
            self._no_errors = str(error)
            return
        near = suspects & (np.abs(errors) <= self._bounds.profile.stalled_error)
        np.copyto(self._errors, errors, where=suspects)
        np.copyto(self._resting, state.duties, where=near)


def _none(values: FloatArray) -> NDArray[np.bool_]:
    return np.zeros(len(values), dtype=bool)
