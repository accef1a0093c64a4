"""Quantities that a guard monitors beside positions and contacts: speed, current, torque, temperature."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError
from rtf.robot_testing.slides import as_text, in_metres, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard.limits import Limits

#: Longest time without a value of a quantity that had been measured, s.
_SILENT = 0.5
#: Speed that is always expected, deg/s, whatever was commanded: a step of 2 deg by a loop of 5 Hz begins with 63.
#: Boards may allow all joints 1000.
_USUAL_SPEED = 80.0
#: Speed that is always expected of a joint on a trajectory, deg/s: the peak of a move at 20 deg/s; and the time for
#: which it may be faster, s: a loop of some hertz stops a joint that was limp, or hit, in about that.
_TRAJECTORY_SPEED, _CAUGHT = 40.0, 0.1
_TRAJECTORY_MODES = frozenset({ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.MIXED})
#: Ratio of the peak speed of a move to its commanded speed: a minimum-jerk trajectory has a peak of 15/8.
PEAK_RATIO = 2.0


class Violation(NamedTuple):
    """The joints that violate a limit, and the text for one of them."""

    joints: NDArray[np.bool_]
    describe: Callable[[int], str]


class MonitoredPart(NamedTuple):
    """The part of a quantity: prefix of its ports, names of its joints, and the report of unwatched quantities."""

    name: str
    joints: Sequence[str]
    report: Callable[[str], None]


class MonitoredQuantity:
    """A quantity of all joints with its limits ``most``.

    ``describe`` returns the text for a joint, with the value that violates its limit, and the limit. A joint without
    values is reported once as not watched. Values that stop for more than ``_SILENT`` s are a
    violation.
    """

    def __init__(
        self,
        what: str,
        part: MonitoredPart,
        measure: Callable[[], FloatArray],
        most: FloatArray,
        describe: Callable[[int, float, float], str],
    ) -> None:
        self.what = what
        self._part = part
        self._measure = measure
        self._most = most
        self._describe = describe
        self._measured = np.zeros(len(most), dtype=bool)
        self._missing_since = np.full(len(most), np.inf)  # since when the value is missing, s of the robot's clock
        self._reported: set[int] = set()

    @property
    def limited(self) -> NDArray[np.bool_]:
        """The joints that have a limit."""
        return np.isfinite(self.most(np.zeros(len(self._most))))

    def check(self, now: float) -> Iterator[Violation]:
        """Yield the joints above their limits, and those whose values have stopped; ``now`` is the robot's time (s)."""
        why = "there are no values"
        try:
            values = np.abs(self._measure())
        except (NotSupportedError, RefusedError) as error:
            values, why = np.full(len(self._most), np.nan), str(error)
        most = self.most(values)
        if (values <= most).all():  # nearly always, at every tick
            self._all_is_well()
            return
        yield Violation(values > most, lambda joint: self._describe(joint, float(values[joint]), float(most[joint])))
        unknown = np.isnan(values) & np.isfinite(most)
        self._report(unknown, why)
        self._measured |= ~np.isnan(values)
        # The clock may also be set back.
        self._missing_since = np.where(unknown, np.minimum(self._missing_since, now), np.inf)
        silent = self._measured & (now - self._missing_since >= _SILENT)
        yield Violation(silent, lambda _: f"has had no {self.what} for {_SILENT:g} s, which is limited: {why}")

    def _all_is_well(self) -> None:
        """Note that all joints have values, and none above its limit."""
        self._measured[:] = True
        self._missing_since[:] = np.inf

    def most(self, values: FloatArray) -> FloatArray:
        """Return the limits for the current values; infinite if there is no limit."""
        del values
        return self._most

    def _report(self, unknown: NDArray[np.bool_], why: str) -> None:
        if not unknown.any():
            return
        joints = [int(joint) for joint in np.flatnonzero(unknown) if joint not in self._reported]
        self._reported.update(joints)
        if joints:
            names = ", ".join(self._part.joints[joint] for joint in joints)
            self._part.report(f"the {self.what} of {self._part.name} is not watched: {why} ({names})")


class MonitoredSpeed(MonitoredQuantity):
    """Joint speeds (deg/s), limited to ``share`` times the expected speed, see ``Limits.speed``.

    A stiff joint on a trajectory may exceed what is expected there only for a moment. The commanded speeds are read
    from the board when a joint would be too fast without them.
    """

    def __init__(self, board: RemoteBoard, part: MonitoredPart, share: float, fastest: FloatArray) -> None:
        self._text = partial(shown, board, spec=".0f", rate="/s")
        self._verbs = ["turns" if in_metres(board, joint) is None else "moves" for joint in range(len(fastest))]

        def describe(joint: int, value: float, most: float) -> str:
            text = self._text
            return f"{self._verbs[joint]} at {text(joint, value)}, too fast: more than {text(joint, most)}"

        super().__init__("speed", part, board.encoder_speeds, fastest, describe)
        self._commanded_speeds = board.reference_speeds
        self._modes, self._interactions = board.control_modes, board.interaction_modes
        self._fast_since = np.full(len(fastest), np.inf)  # since when a joint is too fast for a trajectory, s
        self._share = share
        self._commanded = np.zeros(len(fastest))

    def most(self, values: FloatArray) -> FloatArray:
        """See MonitoredQuantity. The limits never fall: a slower command must not stop the move that is under way."""
        if (values > self._expected()).any():
            with suppress(RobotError):  # the board does not report commanded speeds
                self._commanded = np.fmax(self._commanded, self._commanded_speeds())
        return self._expected()

    def check(self, now: float) -> Iterator[Violation]:
        """See MonitoredQuantity."""
        limit = self._expected(_TRAJECTORY_SPEED)
        try:
            values = np.abs(self._measure())
        except (NotSupportedError, RefusedError):
            yield from super().check(now)
            return
        if (values <= limit).all():  # the lower limit of the two
            self._all_is_well()
            self._fast_since[:] = np.inf
            return
        yield from super().check(now)
        if not (values > limit).any():
            self._fast_since[:] = np.inf
            return
        with suppress(RobotError):
            self._commanded = np.fmax(self._commanded, self._commanded_speeds())
            limit = self._expected(_TRAJECTORY_SPEED)
        following = np.array([mode in _TRAJECTORY_MODES for mode in self._modes()])
        with suppress(NotSupportedError, RefusedError):  # a compliant joint goes where it is pushed
            following &= np.array([mode is not InteractionMode.COMPLIANT for mode in self._interactions()])
        fast = following & (values > limit)
        # The clock may also be set back.
        self._fast_since = np.where(fast, np.minimum(self._fast_since, now), np.inf)
        yield Violation(
            now - self._fast_since >= _CAUGHT,
            lambda joint: (
                f"{self._verbs[joint]} at {self._text(joint, values[joint])} for {_CAUGHT:g} s, too fast for its "
                f"commanded {self._text(joint, self._commanded[joint])}: more than {self._text(joint, limit[joint])}"
            ),
        )

    def _expected(self, least: float = _USUAL_SPEED) -> FloatArray:
        expected: FloatArray = np.minimum(self._most, np.maximum(least, PEAK_RATIO * self._commanded))
        return self._share * expected


def state_quantities(
    board: RemoteBoard,
    part: MonitoredPart,
    limits: Limits,
    fastest: FloatArray,
    currents: Sequence[float | None],
) -> list[MonitoredQuantity]:
    """Return the quantities of the state message that have a limit for some joint; boards report 0 A for no limit."""
    found: list[MonitoredQuantity] = []
    if limits.speed < np.inf:
        found.append(MonitoredSpeed(board, part, limits.speed, fastest))
    if limits.current is not None:
        amperes = limits.current * np.array([most or np.inf for most in currents])
        found.append(
            MonitoredQuantity(
                "current", part, board.currents, amperes,
                lambda _, value, most: f"draws {value:.2f} A, too much: more than {most:.2f} A",
            )
        )  # fmt: skip
    if limits.torque is not None:
        torques = limits.torque * greatest(board, lambda joint: max(map(abs, board.torque_range(joint))))
        found.append(MonitoredQuantity("torque", part, board.torques, torques, partial(_describe_torque, board)))
    return [one for one in found if one.limited.any()]


def _describe_torque(board: RemoteBoard, joint: int, value: float, most: float) -> str:
    metres = in_metres(board, joint)
    what = "torque" if metres is None else "force"
    text = partial(as_text, metres, symbol="Nm", spec=".1f")
    return f"has a {what} of {text(value)}, too much: more than {text(most)}"


def temperatures(board: RemoteBoard, part: MonitoredPart, limits: Limits) -> MonitoredQuantity | None:
    """Return the motor temperatures, which need a request to the board; None without a limit."""
    if limits.temperature is None:
        return None
    most = limits.temperature * greatest(board, board.temperature_limit)
    found = MonitoredQuantity(
        "temperature", part, board.temperatures, most,
        lambda _, value, limit: f"has {value:.0f} degC, too hot: more than {limit:.0f} degC",
    )  # fmt: skip
    return found if found.limited.any() else None


def greatest(board: RemoteBoard, request: Callable[[int], float]) -> FloatArray:
    """Return the limits of all joints that ``request`` reads from the board; infinite if there is none.

    Boards answer 0, or refuse, for joints without such a limit; some support no such limits at all.
    """

    def most(joint: int) -> float:
        try:
            return request(joint) or np.inf
        except RefusedError:
            return np.inf

    try:
        return np.array([most(joint) for joint in range(board.axes())])
    except NotSupportedError:
        return np.full(board.axes(), np.inf)


def greatest_speeds(board: RemoteBoard) -> FloatArray:
    """Return the greatest speeds of all joints by their board (deg/s); infinite if it has none."""
    return greatest(board, lambda joint: board.velocity_limits(joint)[1])
