"""What a guard looks at beside places and contacts: quantities of which there is a most, and what nobody measures."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import NotSupportedError, RefusedError, RobotError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.guard import Limits

#: A quantity that had been measured may be no number for so long, s.
_SILENT = 0.5
#: What a joint may turn at, whatever it was told, deg/s: on the simulated robot a limp one that falls comes to 90, and
#: one that steps by 2 deg to 41. Boards may allow 1000 to all.
_CALM = 80.0
#: How much faster a joint is on its way than it was told to go: a minimum-jerk trajectory has a peak of 15/8.
_PEAK = 2.0


class Wrong(NamedTuple):
    """Which joints do what they may not, and the words for one of them."""

    joints: NDArray[np.bool_]
    say: Callable[[int], str]


class Place(NamedTuple):
    """Of which part a quantity is: the name of its ports, those of its joints, and who is told what is not watched."""

    name: str
    joints: Sequence[str]
    report: Callable[[str], None]


class Watched:
    """A quantity of all joints, with the ``most`` of each. ``sentence`` has places for a value and its limit.

    What is no number is not measured, and told once. Where there had been numbers, that is wrong when it lasts.
    """

    def __init__(
        self, what: str, place: Place, measure: Callable[[], FloatArray], most: FloatArray, sentence: str
    ) -> None:
        self.what = what
        self._place = place
        self._measure = measure
        self._most = most
        self._sentence = sentence
        self._measured = np.zeros(len(most), dtype=bool)
        self._lost = np.full(len(most), np.inf)  # since when there is no number, s of the robot's clock
        self._told: set[int] = set()

    @property
    def limited(self) -> bool:
        """Whether there is a limit for any joint."""
        return bool(np.isfinite(self.most(np.zeros(len(self._most)))).any())

    def look(self, now: float) -> Iterator[Wrong]:
        """Which joints have too much of it, and of which it is not known any more; ``now`` is the robot's time (s)."""
        why = "no numbers come"
        try:
            values = np.abs(self._measure())
        except (NotSupportedError, RefusedError) as error:
            values, why = np.full(len(self._most), np.nan), str(error)
        most = self.most(values)
        yield Wrong(values > most, lambda joint: self._sentence.format(values[joint], most[joint]))
        unknown = np.isnan(values) & np.isfinite(most)
        self._tell(unknown, why)
        self._measured |= ~np.isnan(values)
        # A clock may also jump back.
        self._lost = np.where(unknown, np.minimum(self._lost, now), np.inf)
        silent = self._measured & (now - self._lost >= _SILENT)
        yield Wrong(silent, lambda _: f"has had no {self.what} for {_SILENT:g} s, of which there is a limit: {why}")

    def most(self, values: FloatArray) -> FloatArray:
        """The most of each joint while it has so much; infinite where there is no limit."""
        del values
        return self._most

    def _tell(self, unknown: NDArray[np.bool_], why: str) -> None:
        joints = [int(joint) for joint in np.flatnonzero(unknown) if joint not in self._told]
        self._told.update(joints)
        if joints:
            names = ", ".join(self._place.joints[joint] for joint in joints)
            self._place.report(f"the {self.what} of {self._place.name} is not watched: {why} ({names})")


class Speeds(Watched):
    """How fast joints turn (deg/s): ``share`` times what is usual for what they were told, and for their boards.

    What they were told is asked for when one would be too fast otherwise.
    """

    def __init__(self, board: RemoteControlBoard, place: Place, share: float, fastest: FloatArray) -> None:
        sentence = "turns at {:.0f} deg/s, too fast: more than {:.0f} deg/s"
        super().__init__("speed", place, board.encoder_speeds, fastest, sentence)
        self._ask = board.reference_speeds
        self._share = share
        self._commanded = np.zeros(len(fastest))

    def most(self, values: FloatArray) -> FloatArray:
        """See Watched. It does not become less in the middle of a move, when its end is told to be slow."""
        if (values > self._usual()).any():
            with suppress(RobotError):  # nobody has told it then
                self._commanded = np.fmax(self._commanded, self._ask())
        return self._usual()

    def _usual(self) -> FloatArray:
        usual: FloatArray = np.minimum(self._most, np.maximum(_CALM, _PEAK * self._commanded))
        return self._share * usual


def in_the_state(
    board: RemoteControlBoard,
    place: Place,
    limits: Limits,
    fastest: FloatArray,
    currents: Sequence[float | None],
) -> list[Watched]:
    """The quantities that come with the state, and of which some joint has a limit; boards say 0 A for none."""
    found: list[Watched] = []
    if limits.speed < np.inf:
        found.append(Speeds(board, place, limits.speed, fastest))
    if limits.current is not None:
        amperes = limits.current * np.array([most or np.inf for most in currents])
        sentence = "draws {:.2f} A, too much: more than {:.2f} A"
        found.append(Watched("current", place, board.currents, amperes, sentence))
    if limits.torque is not None:
        torques = limits.torque * greatest(board, lambda joint: max(map(abs, board.torque_range(joint))))
        sentence = "bears {:.1f} Nm, too much: more than {:.1f} Nm"
        found.append(Watched("torque", place, board.torques, torques, sentence))
    return [one for one in found if one.limited]


def temperatures(board: RemoteControlBoard, place: Place, limits: Limits) -> Watched | None:
    """Those of the motors, which have to be asked for; None without a limit."""
    if limits.temperature is None:
        return None
    most = limits.temperature * greatest(board, board.temperature_limit)
    sentence = "has {:.0f} degC, too hot: more than {:.0f} degC"
    found = Watched("temperature", place, board.temperatures, most, sentence)
    return found if found.limited else None


def greatest(board: RemoteControlBoard, question: Callable[[int], float]) -> FloatArray:
    """What a board says is the most of each joint; infinite where there is none.

    Boards say 0, or refuse to say, for joints that have no such limit; some know no such limits at all.
    """

    def most(joint: int) -> float:
        try:
            return question(joint) or np.inf
        except RefusedError:
            return np.inf

    try:
        return np.array([most(joint) for joint in range(board.axes())])
    except NotSupportedError:
        return np.full(board.axes(), np.inf)


def greatest_speeds(board: RemoteControlBoard) -> FloatArray:
    """The greatest speeds of all joints by their board (deg/s); infinite where it knows none."""
    return greatest(board, lambda joint: board.velocity_limits(joint)[1])
