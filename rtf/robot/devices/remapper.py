"""A remapper of boards: axes of several boards as one board, selected by name or by ranges, in any order.

A call for several axes becomes one call to each board that has some of them. The boards are called in sequence; when
one raises an error, those before it have already executed their call.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from rtf.bottle import Bottle, as_int
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError, RobotError
from rtf.robot.extended_state import MAX_AXES
from rtf.robot.forwarded_board import ForwardedBoard
from rtf.robot.interfaces import IAxisInfo, IRemoteCalibrator, IRemoteVariables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from rtf.bottle import Property
    from rtf.robot.forwarded_board import Plural
    from rtf.robot.interfaces import AxisSelection

R = TypeVar("R")
_RANGE_NUMBERS = 4
#: The replacements, for each axis, of calls to a board of which only some axes belong here; the other axes do not move.
_FOR_EACH = {
    "calibrate_part": IRemoteCalibrator.calibrate_joint,
    "home_part": IRemoteCalibrator.home_joint,
    "park_part": IRemoteCalibrator.park_joint,
}


class Place(NamedTuple):
    """The place of an axis: its board, and its number there."""

    board: Device
    joint: int


class _Share(NamedTuple):
    """The part of a selection on one board: the indexes in the selection, and the axis numbers of the board."""

    board: Device
    places: list[int]
    joints: list[int]


class RemappedBoard(ForwardedBoard, IRemoteVariables):
    """A board whose axes are those of other boards. It has no axes until ``places`` is set."""

    name: str
    places: tuple[Place, ...] = ()

    def axes(self) -> int:
        """Return the number of axes. Raises DeviceError if it is attached to no board."""
        if not self.places:
            raise DeviceError(f"{self.name} is attached to no board")
        return len(self.places)

    def boards(self) -> list[Device]:
        """Return the boards, in the order of their first axes."""
        return [*{id(place.board): place.board for place in self.places}.values()]

    # Forwarding ---------------------------------------------------------------------------------------------------

    def forward_reading(self, method: Plural, axes: AxisSelection, *of: object) -> Sequence[Any]:
        chosen = self.chosen(axes)
        found: list[Any] = [None] * len(chosen)
        for share in self._shares(chosen):
            values = _bound(share.board, method)(*of, share.joints)
            if len(values) != len(share.joints):
                raise NoAnswerError(
                    f"{share.board.name} gave {len(values)} values of {method.__name__} for {len(share.joints)} axes"
                )
            for place, value in zip(share.places, values, strict=True):
                found[place] = value
        return found

    def forward_setting(self, method: Plural, values: Sequence[Any], axes: AxisSelection, *of: object) -> None:
        for share in self._shares(self.chosen(axes)):
            _bound(share.board, method)(*of, [values[place] for place in share.places], share.joints)

    def forward_action(self, method: Plural, axes: AxisSelection) -> list[Any]:
        return [_bound(share.board, method)(share.joints) for share in self._shares(self.chosen(axes))]

    def forward_single(self, method: Callable[..., R], axis: int, *arguments: object, of: tuple[object, ...] = ()) -> R:
        place = self.places[axis]
        return _bound(place.board, method)(*of, place.joint, *arguments)

    def forward_whole(self, method: Callable[..., R]) -> R:
        """Call every board. The result is the first false answer, or the first one if all are true."""
        answers = [self._whole(share, method) for share in self._shares(self.chosen(None))]
        return next((answer for answer in answers if not answer), answers[0])

    def _whole(self, share: _Share, method: Callable[..., R]) -> R:
        if method.__name__ in _FOR_EACH and sorted(share.joints) != [*range(share.board.view(IAxisInfo).axes())]:  # type: ignore[type-abstract]
            one: Callable[..., Any] = _FOR_EACH[method.__name__]
            *_, last = [_bound(share.board, one)(joint) for joint in share.joints]
            return last  # type: ignore[no-any-return]  # nothing, as of the method for all
        return _bound(share.board, method)()

    def _shares(self, axes: Sequence[int]) -> Iterator[_Share]:
        """Return the part of each board that has some of the axes."""
        shares: dict[int, _Share] = {}
        for index, axis in enumerate(axes):
            board, joint = self.places[axis]
            share = shares.get(id(board))
            if share is None:
                share = shares[id(board)] = _Share(board, [], [])
            share.places.append(index)
            share.joints.append(joint)
        yield from shares.values()

    # Remote variables: of the boards, not of the axes ---------------------------------------------------------------

    def variable(self, key: str) -> Bottle:
        """Return the values of all boards that have the variable, one after the other."""
        values = [value for board, keys in self._keys() if key in keys for value in board.variable(key)]
        if not values:
            raise RefusedError(f"{self.name}: none of {self._board_names()} knows a variable {key!r}")
        return Bottle(values)

    def set_variable(self, key: str, value: Bottle) -> None:
        """Refuse: a variable is set at its own board."""
        raise NotSupportedError(f"{self.name} does not set {key!r} to {value}; set it at the board that it belongs to")

    def variables(self) -> tuple[str, ...]:
        known = self._keys()
        if not known:
            raise NotSupportedError(f"{self.name}: none of {self._board_names()} has variables")
        return (*dict.fromkeys(key for _, keys in known for key in keys),)

    def _keys(self) -> list[tuple[IRemoteVariables, tuple[str, ...]]]:
        """Return the boards with remote variables, and the names of these."""
        found = []
        for board in self.boards():
            with suppress(NotSupportedError):
                variables = board.view(IRemoteVariables)  # type: ignore[type-abstract]
                found.append((variables, variables.variables()))
        return found

    def _board_names(self) -> str:
        return ", ".join(board.name for board in self.boards())


def _bound(board: Device, method: Callable[..., R]) -> Callable[..., R]:
    """Return a board's method. Raises NotSupportedError if it has none."""
    found: Callable[..., R] | None = getattr(board, method.__name__, None)
    if found is None:
        raise NotSupportedError(f"{board.name} ({type(board).__name__}) has no {method.__qualname__}")
    return found


# Finding axes ---------------------------------------------------------------------------------------------------------


def find_axes(names: Sequence[str], boards: Mapping[str, Device], whose: str) -> tuple[Place, ...]:
    """Find axes by name. Raises DeviceError for one that no board has, or several."""
    known: dict[str, list[Place]] = {}
    looked_at = []
    for label, board in boards.items():
        try:
            axes = board.view(IAxisInfo).axis_names()  # type: ignore[type-abstract]
        except RobotError as error:
            raise DeviceError(f"{whose}: {label} cannot list its axes: {error}") from error
        looked_at.append(f"{label} ({', '.join(axes)})")
        for joint, axis in enumerate(axes):
            known.setdefault(axis, []).append(Place(board, joint))
    where = "; ".join(looked_at) or "no boards at all"
    for name in names:
        if len(known.get(name, ())) != 1:
            which = "no board has an axis" if name not in known else "several boards have an axis"
            raise DeviceError(f"{whose}: {which} {name!r}; the boards are {where}")
    return tuple(known[name][0] for name in names)


class Range(NamedTuple):
    """A range of axes: ``first`` to ``last`` are the axes of a board from ``start`` on."""

    board: str
    first: int
    last: int
    start: int


def read_ranges(configuration: Property) -> tuple[Range, ...]:
    """Read ``networks``, ``joints``, and a range ``(first last boardFirst boardLast)`` for each network.

    Together the ranges must cover every axis once. Raises ConfigurationError.
    """
    joints = parameters.count(configuration, "joints", 0, MAX_AXES)
    ranges = tuple(_range(configuration, network) for network in parameters.names(configuration, "networks"))
    covered = sorted(axis for one in ranges for axis in range(one.first, one.last + 1))
    if covered != [*range(joints)]:
        raise parameters.wrong(
            configuration, "networks", f"the ranges do not cover each axis from 0 to {joints - 1} once"
        )
    return ranges


def _range(configuration: Property, network: str) -> Range:
    group = configuration.find_group(network) or Bottle()
    listed = group.get(1)
    numbers = [*listed] if isinstance(listed, Bottle) else [*group.tail()]
    if len(numbers) != _RANGE_NUMBERS or not all(isinstance(number, int) for number in numbers):
        raise parameters.wrong(configuration, network, "four numbers are needed: (first last boardFirst boardLast)")
    first, last, start, end = map(as_int, numbers)
    if not 0 <= first <= last < MAX_AXES or start < 0 or end - start != last - first:
        raise parameters.wrong(configuration, network, f"({first} {last} {start} {end}) are not ranges of equal length")
    return Range(network, first, last, start)


def place_ranges(ranges: Sequence[Range], boards: Mapping[str, Device], whose: str) -> tuple[Place, ...]:
    """Find the axes of ranges. Raises DeviceError for a missing board, or one with too few axes."""
    places: dict[int, Place] = {}
    for one in ranges:
        board = boards.get(one.board)
        if board is None:
            raise DeviceError(f"{whose}: there is no board {one.board!r}; the boards are {', '.join(boards) or 'none'}")
        axes = board.view(IAxisInfo).axes()  # type: ignore[type-abstract]
        end = one.start + one.last - one.first
        if end >= axes:
            raise DeviceError(f"{whose}: {one.board} has no axis {end}; they go from 0 to {axes - 1}")
        for axis in range(one.first, one.last + 1):
            places[axis] = Place(board, one.start + axis - one.first)
    return tuple(places[axis] for axis in sorted(places))


def read_axis_names(configuration: Property) -> tuple[str, ...]:
    """Read the parameter ``axesNames``. Raises ConfigurationError if it is empty, or has a name twice."""
    names = parameters.names(configuration, "axesNames")
    if not names:
        raise parameters.wrong(configuration, "axesNames", "it is a list of the axes, such as (l_elbow r_elbow)")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise parameters.wrong(configuration, "axesNames", f"{twice} is named more than once")
    return names


class ControlBoardRemapper(RemappedBoard, Device):
    """A board made of axes of the attached boards: by ``axesNames``, or by ``networks``, ``joints`` and ranges."""

    _names: tuple[str, ...] = ()
    _ranges: tuple[Range, ...] = ()

    def open(self, configuration: Property) -> None:
        if configuration.check("axesNames") or not configuration.check("networks"):
            self._names, self._ranges = read_axis_names(configuration), ()
        else:
            self._names, self._ranges = (), read_ranges(configuration)

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Attach the boards, which their owner closes. Raises DeviceError for axes that are not found."""
        if not self._names and not self._ranges:
            raise DeviceError(f"{self.name} is not open; open it before it is attached")
        if self._names:
            self.places = find_axes(self._names, devices, self.name)
        else:
            self.places = place_ranges(self._ranges, devices, self.name)

    def detach(self) -> None:
        self.places = ()

    def close(self) -> None:
        self.detach()
        self._names, self._ranges = (), ()
