"""Base class of tests of CAN buses and of the boards on them.

Where the frames come from is a matter of parameters: by default from the program that drives the boards, which
publishes them (``canBus_nws_yarp``; the simulated robot does so, too), or from any interface of python-can that this
machine has. Which boards there should be is what the driver of the part says: ``canMotionControl`` has the remote
variable ``canAxes``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, as_int, as_string
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import BITRATE, BusSettings
from rtf.robot.devices.can.exchange import PROTOCOL, Exchange
from rtf.robot.devices.can.messages import ADDRESSES
from rtf.robot.devices.can.sensor_messages import SENSOR_VERSION
from rtf.robot.errors import DeviceError, RefusedError, RobotError
from rtf.robot_testing.guard.read_only_board import connect_read_only
from rtf.robot_testing.judging.can_traffic import BoardOnBus, CanTraffic, decoded
from rtf.robot_testing.robot_test import RobotTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.bottle import Value
    from rtf.robot.devices.can.exchange import Version
    from rtf.robot.devices.can.messages import Dialect, Frame, Question, Setting
    from rtf.robot.interfaces import IRemoteVariables

#: The interface of frames that the program of the boards publishes.
YARP = "yarp"
#: Seconds for an answer of a board, and how often it is asked again: ten times what the iCub's hosts allow (20 ms).
_PATIENCE, _RETRIES = 0.2, 1
#: Seconds of the robot's clock between two looks at the buses, and until the first frames are published.
_LOOK, _FIRST_FRAMES = 0.05, 0.05
_SHORTEST = 1e-6  # s; a clock may not advance by less
#: Seconds for the answers to many questions: each board has some 25 of them, 5 ms on the bus with the answers.
_ANSWERS = 0.1


class AxisPlace(NamedTuple):
    """Where the driver has an axis: the channel of its bus, the address of its board, and its place there."""

    name: str
    channel: str
    board: int
    place: int


class OpenBus:
    """A bus that a test listens to: its frames since the last ``clear``, and questions to its boards."""

    def __init__(self, name: str, bus: CanBus) -> None:
        self.name = name
        self.bus = bus
        self.frames: list[tuple[Frame, float]] = []
        self.exchange = Exchange(bus, _PATIENCE, _RETRIES)
        self._end = bus.watch(lambda frame, stamp: self.frames.append((frame, stamp)))

    def read(self) -> None:
        """Take the frames that have arrived, if no thread does."""
        while not self.bus.threaded and self.bus.poll():
            pass

    def clear(self) -> None:
        """Forget the frames of before."""
        self.read()
        self.frames.clear()

    def traffic(self) -> CanTraffic:
        """Return the frames since the last ``clear``."""
        self.read()
        return CanTraffic([*self.frames], self.bus.settings.bitrate)

    def ask_all(
        self, questions: Sequence[tuple[Question | Setting, int, int, Dialect]], wait: Callable[[float], None]
    ) -> dict[tuple[str, int, int], tuple[float | bytes, ...]]:
        """Send questions without values to boards and places of axes together; return the answers that have come.

        They are by the name of the answer, board and place. ``wait`` lets the robot's time pass.
        """
        self.clear()
        self.bus.send(*(question.get.frame(board, axis=place) for question, board, place, _ in questions))
        wait(_ANSWERS)
        self.read()
        found: dict[tuple[str, int, int], tuple[float | bytes, ...]] = {}
        wanted = {(question.value.identifier(board), dialect) for question, board, _, dialect in questions}
        for frame, _ in self.frames:
            for identifier, dialect in wanted:
                if frame.identifier == identifier and (got := decoded(*frame, dialect)) is not None:
                    found[got.message.name, got.source, got.axis] = got.values
        return found

    def close(self) -> None:
        """Close the bus."""
        self._end()
        self.exchange.close()
        self.bus.close()


class CanTest(RobotTest):
    """A test of the boards of one part. ``setup`` reads where its axes are, and opens its buses.

    ``places`` are the axes, ``buses`` the open buses by channel.
    """

    part = Parameter(str, "the part whose boards are tested", default="left_arm")
    interface = Parameter(
        str, f"where frames come from: {YARP}, or an interface of python-can such as socketcan", default=YARP
    )
    channel = Parameter(
        str,
        "its channel, {} where the channel of the driver belongs; none: that for socketcan and others, "
        "and /ROBOT/can/{} for yarp",
        default="",
    )
    bitrate = Parameter(int, "of the buses, bit/s", default=BITRATE, low=10_000, high=BITRATE)

    places: list[AxisPlace]
    buses: dict[str, OpenBus]

    def setup(self) -> None:
        """Read which boards the part has, and open their buses."""
        super().setup()
        place = f"/{self.robot_name}/{self.part}"
        try:
            board = connect_read_only(place, carrier=self._carrier, network=self.network)
        except RobotError as error:
            self.assert_error(f"{place} cannot be opened: {error}")
        self.add_cleanup(board.close)
        self.variables: IRemoteVariables = board
        self.places = [
            AxisPlace(as_string(row.get(0)), as_string(row.get(1)), as_int(row.get(2)), as_int(row.get(3)))
            for row in self.rows_of("canAxes")
        ]
        self.buses = {channel: self._open_bus(channel) for channel in dict.fromkeys(one.channel for one in self.places)}
        self.sleep(_FIRST_FRAMES)

    def rows_of(self, variable: str) -> list[Bottle]:
        """Return the rows of a remote variable of the part. The test ends with an error without it."""
        try:
            return [row for row in self.variables.variable(variable) if isinstance(row, Bottle)]
        except (RefusedError, RobotError) as error:
            self.assert_error(
                f"{self.part} of /{self.robot_name} does not say which boards it has: {error}; this test needs the "
                "driver canMotionControl (of a simulated robot: rtf simulator --can)"
            )

    def _open_bus(self, channel: str) -> OpenBus:
        pattern = self.channel or (f"/{self.robot_name}/can/{{}}" if self.interface == YARP else "{}")
        settings = BusSettings(self.interface, pattern.replace("{}", channel), self.bitrate)
        try:
            bus = CanBus(settings, report=self.report, threaded=self.interface != YARP)
        except DeviceError as error:
            self.assert_error(f"the bus {channel} of {self.part}: {error}")
        opened = OpenBus(channel, bus)
        self.add_cleanup(opened.close)
        return opened

    # Boards ------------------------------------------------------------------------------------------------------

    def boards_of(self, channel: str, versions: dict[int, Version]) -> list[BoardOnBus]:
        """Return the boards of a bus that have answered with their versions, with their joints."""
        return [
            BoardOnBus(number, one.board_type, tuple(self.joints_of(channel, number)))
            for number, one in sorted(versions.items())
        ]

    def joints_of(self, channel: str, board: int) -> list[str]:
        """Return the joints that a board has."""
        return [one.name for one in self.places if (one.channel, one.board) == (channel, board)]

    def addresses(self, channel: str) -> list[int]:
        """Return the addresses of the boards that the driver has on a bus."""
        return sorted({one.board for one in self.places if one.channel == channel})

    def named(self, channel: str, board: int) -> str:
        """Return a board and its joints, for texts."""
        return f"board {channel}:{board} ({', '.join(self.joints_of(channel, board)) or 'of no joint'})"

    def others_on(self, bus: OpenBus) -> list[int]:
        """Return the addresses on a bus that are not of motors, and where a board of sensors answers."""
        free = [board for board in ADDRESSES if board not in self.addresses(bus.name)]
        bus.clear()
        bus.bus.send(*(SENSOR_VERSION.get.frame(board, *PROTOCOL) for board in free))
        self.sleep(_ANSWERS)
        bus.read()
        answers = {SENSOR_VERSION.value.identifier(board): board for board in free}
        found = sorted({answers[frame.identifier] for frame, _ in bus.frames if frame.identifier in answers})
        if found:
            self.report(f"boards of sensors on {bus.name}: {', '.join(map(str, found))}")
        return found

    def versions(self, bus: OpenBus) -> dict[int, Version]:
        """Ask the boards of a bus for their versions; boards that do not answer are missing."""
        found = {}
        for board in self.addresses(bus.name):
            try:
                found[board] = bus.exchange.version(board)
            except DeviceError as error:
                self.report(str(error))
        return found

    # Time --------------------------------------------------------------------------------------------------------

    def listen(self, seconds: float) -> None:
        """Record all buses for some seconds, from now on."""
        for bus in self.buses.values():
            bus.clear()
        end = self.now() + seconds
        while (left := end - self.now()) > _SHORTEST:
            self.sleep(min(_LOOK, left))
            for bus in self.buses.values():
                bus.read()

    def host_counters(self) -> dict[str, dict[str, float]]:
        """Return what the driver counts on each of its buses: ``load``, ``bus_off`` and so on, by the bus's name."""
        found: dict[str, dict[str, float]] = {}
        latest: dict[str, float] = {}
        for key, value in _pairs(self.rows_of("canBus")):
            if key == "name":
                latest = found.setdefault(str(value), {})
            elif isinstance(value, int | float):
                latest[key] = float(value)
        return found


def _pairs(rows: list[Bottle]) -> Iterator[tuple[str, Value | None]]:
    for row in rows:
        yield as_string(row.get(0)), row.get(1)
