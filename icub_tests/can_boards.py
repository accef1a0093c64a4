"""CAN boards: the boards of a part are those that they should be, have their settings, and work while joints move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, as_int, as_string
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.codes import FOC_BOARDS, BoardState
from rtf.robot.devices.can.messages import Setting
from rtf.robot.errors import DeviceError, RobotError, StaleStateError
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.can_test import CanTest, OpenBus
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.judging.can_traffic import BoardOnBus, older_than_usual
from rtf.robot_testing.motion.start_position import hold
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.devices.can.exchange import Version
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.judging.can_traffic import CanTraffic
    from rtf.robot_testing.motion.part import Part

    #: Channel of the bus, address of the board, place of the axis there, name of the command that sets it.
    Key = tuple[str, int, int, str]

_SETTINGS = {one.set.name: one for one in vars(motor).values() if isinstance(one, Setting)}
#: The share of a limit that is set for a moment, to see that a board takes it.
_CHANGED = 0.9
#: A position that stands still, while the board says that the axis goes this share of its whole way, is stuck.
_STUCK_WAY = 0.25
#: The greatest error of a speed, which is a whole number made of whole positions: a way that it explains is none.
_ROUNDING = 2.0
#: Ticks a millisecond in the speeds that boards broadcast, as a shift: as the driver sets it.
_SPEED_SHIFT = 5
_SENSOR_ERRORS = BoardState.TEMPERATURE_SENSOR_1 | BoardState.TEMPERATURE_SENSOR_2
_GRACE = 1.0  # s, of a move
_SHOWN = 3


class CanBoards(CanTest):
    """Asks the boards of a part for versions and settings, and watches what they send while its joints move.

    All boards of the configuration answer, each once; boards of one type have one firmware, and have the settings that
    the driver has sent; one that is changed is taken. While the joints move a few degrees, no board falls silent or is
    reset, no count of errors rises, and positions follow the speeds.
    """

    tags = ("can",)
    safety = Safety.MOTION
    limits = Limits(fault=True)

    firmware = Parameter(
        Bottle, "versions that boards should have, such as (BLL 3.5.0); others: that of most of their type",
        default=Bottle(),
    )  # fmt: skip
    distance = Parameter(float, "how far the joints move", unit="deg", default=5.0, low=0.5, high=20.0)
    speed = Parameter(float, "how fast", unit="deg/s", default=10.0, low=1.0, high=50.0)
    # 25 periods of the positions: after this time the driver of this project takes a board for silent, too.
    max_silence = Parameter(float, "longest time without positions of a board", unit="ms", default=100.0, low=10.0)
    # One disturbed frame counts 8 at its sender (ISO 11898-1).
    max_errors = Parameter(int, "greatest count of errors of a board", unit="count", default=8, low=0)
    # The range of industrial electronic parts.
    coldest = Parameter(float, "lowest temperature of a motor", unit="degC", default=-40.0)
    hottest = Parameter(float, "highest temperature of a motor", unit="degC", default=85.0)

    def run(self) -> None:
        """Ask, change a setting, move, and judge each board."""
        self.wrong: set[tuple[str, int]] = set()
        self.complaints: dict[tuple[str, int], list[str]] = {(one.channel, one.board): [] for one in self.places}
        self.found = {channel: self.versions(bus) for channel, bus in self.buses.items()}
        self._check_versions()
        self._check_settings(self.sent_settings(), "it has not taken")
        if not any(self.complaints.values()):
            self._check_moving()
        for (channel, board), texts in self.complaints.items():
            with self.subresult(f"{channel}:{board}"):
                for text in texts:
                    self.check_fail_if_true(text, f"{self.named(channel, board)}: {text}")

    def _complain(self, channel: str, board: int, text: str, *findings: str) -> None:
        self.complaints[channel, board].append(f"{text}; {likely_causes(*findings)}" if findings else text)

    # Versions ----------------------------------------------------------------------------------------------------

    def _check_versions(self) -> None:
        wanted = {as_string(row.get(0)): as_string(row.get(1)) for row in self._wanted()}
        kinds: dict[int, dict[tuple[str, int], Version]] = {}
        for channel, bus in self.buses.items():
            for board in self.addresses(channel):
                version = self.found[channel].get(board)
                if version is None:
                    self._complain(channel, board, "it does not answer", "board silent")
                    continue
                kinds.setdefault(version.board_type, {})[channel, board] = version
                self.report(f"{channel}:{board} is a {version.type_name} with firmware {version.firmware_text}")
                if not version.acknowledged:
                    self._complain(channel, board, "it does not acknowledge the protocol", "board version")
            for board in bus.exchange.clashes():
                if (channel, board) in self.complaints:
                    self._complain(channel, board, "two boards answer at this address", "board clash")
        for boards in kinds.values():
            self._compare_versions(boards, wanted)

    def _wanted(self) -> list[Bottle]:
        """Return the pairs of the parameter ``firmware``, which may be one pair alone."""
        rows = [row for row in self.firmware if isinstance(row, Bottle)]
        return rows or [self.firmware] * bool(len(self.firmware))

    def _compare_versions(self, boards: dict[tuple[str, int], Version], wanted: dict[str, str]) -> None:
        kind = next(iter(boards.values())).type_name
        if kind in wanted:
            odd = {key: wanted[kind] for key, one in boards.items() if one.firmware_text != wanted[kind]}
        else:
            usual = older_than_usual({key: one.firmware for key, one in boards.items()})
            odd = {key: ".".join(map(str, version)) for key, version in usual.items()}
        for (channel, board), right in odd.items():
            text = f"its firmware is {boards[channel, board].firmware_text}, and that of a {kind} here is {right}"
            self._complain(channel, board, text, "board version")

    # Settings ----------------------------------------------------------------------------------------------------

    def sent_settings(self) -> dict[Key, tuple[float, ...]]:
        """Return what the driver has sent and boards can be asked for."""
        found: dict[Key, tuple[float, ...]] = {}
        for row in self.rows_of("canSettings"):
            channel, board, place, name, *values = row
            if as_string(name) in _SETTINGS:
                key = as_string(channel), as_int(board), as_int(place), as_string(name)
                found[key] = tuple(float(value) for value in values if isinstance(value, int | float))
        return found

    def _check_settings(self, sent: dict[Key, tuple[float, ...]], what: str, *findings: str) -> set[tuple[str, int]]:
        """Compare what boards have with what was sent; return the boards with differences."""
        wrong: dict[tuple[str, int], list[str]] = {}
        for channel, bus in self.buses.items():
            for board in self.boards_of(channel, self.found[channel]):
                mine = {key: values for key, values in sent.items() if key[:2] == (channel, board.address)}
                got = self._read_settings(bus, board, [*mine])
                if mine and not got:
                    self._complain(channel, board.address, "it does not answer any more", "board silent")
                    continue
                for key, values in mine.items():
                    if got.get(key) != values:
                        has = "no answer" if key not in got else _numbers(got[key])
                        wrong.setdefault(key[:2], []).append(
                            f"{key[3]} of axis {key[2]}: {has}, not {_numbers(values)}"
                        )
        for (channel, address), texts in wrong.items():
            more = f" and {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else ""
            self._complain(
                channel, address, f"{what} {'; '.join(texts[:_SHOWN])}{more}", *(findings or ("board settings",))
            )
        return {*wrong}

    def _read_settings(self, bus: OpenBus, board: BoardOnBus, keys: Sequence[Key]) -> dict[Key, tuple[float, ...]]:
        """Ask a board for settings; those that it does not answer, once more."""
        found: dict[Key, tuple[float, ...]] = {}
        for _ in range(2):
            missing = [key for key in keys if key not in found]
            questions = [(_SETTINGS[name], address, place, board.dialect) for _, address, place, name in missing]
            got = bus.ask_all(questions, self.sleep) if questions else {}
            for key in missing:
                answer = got.get((_SETTINGS[key[3]].value.name, key[1], key[2]))
                if answer is not None:
                    found[key] = tuple(float(value) for value in answer if not isinstance(value, bytes))
        return found

    def _check_change(self, part: Part) -> None:
        """Change a limit of the first axis of each board, and see that the board has taken it.

        It is the greatest velocity, or for a board that drives a motor, and has none, the peak current.
        """
        before, board = self.sent_settings(), part.board
        firsts = {(one.channel, one.board): part.names.index(one.name) for one in reversed(self.places)}
        types = {(name, one.board): one.board_type for name, found in self.found.items() for one in found.values()}
        drives = {joint for key, joint in firsts.items() if types[key] in FOC_BOARDS}
        limits = {joint: board.velocity_limits(joint) for joint in firsts.values() if joint not in drives}
        currents = {joint: board.peak_current(joint) for joint in drives}
        try:
            for joint, (low, high) in limits.items():
                board.set_velocity_limits(joint, low, _CHANGED * high)
            for joint, most in currents.items():
                board.set_peak_current(joint, _CHANGED * most)
            changed = {key: values for key, values in self.sent_settings().items() if before.get(key) != values}
            self._check_settings(changed, "it does not take a new")
        finally:
            for joint, ends in limits.items():
                board.set_velocity_limits(joint, *ends)
            for joint, most in currents.items():
                board.set_peak_current(joint, most)
        for channel, address in firsts.keys() - {key[:2] for key in changed}:
            self.report(f"{channel}:{address} has no such limit: whether it takes changes is not judged")

    # Motion ------------------------------------------------------------------------------------------------------

    def _check_moving(self) -> None:
        """Change a setting, and move; then judge what the boards have sent."""
        part = self.open_part(self.part)
        hold(part, part.held())  # a driver sends no settings to an axis in fault
        self._check_change(part)
        for bus in self.buses.values():
            bus.clear()
        stopped = self._move(part)
        traffics = {channel: bus.traffic() for channel, bus in self.buses.items()}
        lost = self._check_settings(self.sent_settings(), "it was reset: it has lost", "board reset")
        for channel, traffic in traffics.items():
            for board in self.boards_of(channel, self.found[channel]):
                with self.subresult(f"{channel}:{board.address}"):
                    self._judge_traffic(channel, board, traffic, reset=(channel, board.address) in lost)
        if stopped is not None and not self.wrong and not any(self.complaints.values()):
            if isinstance(stopped, GuardError):
                self.blame(part, stopped)
            self.assert_fail(f"{part.name} did not move as commanded, and its boards show no reason: {stopped}")

    def _move(self, part: Part) -> RobotError | None:
        """Move all joints away from the nearer limit and back; return what has gone wrong."""
        joints = part.held()
        home = part.home[joints]
        away = home + self.distance * np.where(home < (part.low + part.high)[joints] / 2, 1.0, -1.0)
        timeout = 2 * self.distance / self.speed + _GRACE
        try:
            for goal in (away, home):
                arrival = part.move(goal, joints, speed=self.speed, timeout=timeout)
                if not arrival.reached:
                    return DeviceError(arrival.late(part, joints, goal))
        except (GuardError, StaleStateError) as error:
            return error
        return None

    def _judge_traffic(self, channel: str, board: BoardOnBus, traffic: CanTraffic, *, reset: bool) -> None:
        """Judge what a board has sent while the joints moved."""
        name = self.named(channel, board.address)
        silence, since = traffic.longest_silence(board.broadcasts()[0])
        spoiled = [
            one.address
            for one in self.boards_of(channel, self.found[channel])
            if one != board and traffic.errors(one)[1] > self.max_errors
        ]
        causes = likely_causes("board reset" if reset else "board clash" if spoiled else "board silent")
        seen = f", while boards {', '.join(map(str, spoiled))} count disturbed frames" if spoiled else ""
        begin = since - float(traffic.times.min())
        hint = f"{name} falls silent {begin:.2f} s after the motion began{seen}; {causes}"
        self._measure(channel, board, "longest time without positions", 1e3 * silence, "ms", self.max_silence, hint)
        hint = f"{name} counts errors of the bus; {likely_causes('bus errors')}"
        for what, count in zip(("transmission", "reception"), traffic.errors(board), strict=True):
            self._measure(channel, board, f"errors of {what}", count, "count", self.max_errors, hint)
        self._judge_positions(channel, board, traffic)
        if board.drives:
            self._judge_temperature(channel, board, traffic)
        else:
            self._judge_state(channel, board, traffic)

    def _measure(
        self, channel: str, board: BoardOnBus, name: str, value: float, unit: str, most: float, hint: str
    ) -> None:
        """Measure something of a board that has a greatest value."""
        self.measure(name, value, unit, high=most, hint=hint)
        if value > most:
            self.wrong.add((channel, board.address))

    def _judge_positions(self, channel: str, board: BoardOnBus, traffic: CanTraffic) -> None:
        """Compare the positions of the axes of a board with the ways that its speeds say."""
        for place, joint in enumerate(board.joints):
            (times, where), (speed_times, speed) = _motion(board, traffic, place)
            if not len(times) or not len(speed_times):
                continue
            way = np.interp(times, speed_times, _integral(speed_times, 1e3 * speed))
            self.record(
                f"{joint} on the bus", time=(times - times[0], "s"), position=(where, "count"), by_speed=(way, "count")
            )
            whole, still = float(np.ptp(way)), _longest_way_at_rest(where, way)
            self.measure(f"way of {joint} by its speeds, ticks", whole, "count")
            unit = 1.0 if board.drives else 2.0**-_SPEED_SHIFT
            if whole > _ROUNDING * unit * 1e3 * float(np.ptp(speed_times)) and still > _STUCK_WAY * whole:
                text = f"the positions of {joint} stand still for {still:.0f} of the {whole:.0f} ticks that it moves"
                self._complain(channel, board.address, text, "position stuck")

    def _judge_state(self, channel: str, board: BoardOnBus, traffic: CanTraffic) -> None:
        """Complain of temperature sensors that the board reports as broken."""
        for _, got in traffic.messages(board, motor.STATUS):
            if int(got.values[5]) & _SENSOR_ERRORS:
                self._complain(channel, board.address, "it reports a broken temperature sensor", "sensor frozen")
                return

    def _judge_temperature(self, channel: str, board: BoardOnBus, traffic: CanTraffic) -> None:
        """Check the temperatures that a board that drives a motor sends."""
        values = [float(got.values[0]) for _, got in traffic.messages(board, motor.FOC_ADDITIONAL_STATUS)]
        if values and not (self.coldest <= min(values) and max(values) <= self.hottest):
            text = f"its motor has {min(values):g} to {max(values):g} degC"
            self._complain(channel, board.address, text, "sensor frozen")


def _motion(board: BoardOnBus, traffic: CanTraffic, place: int) -> tuple[FloatArray, FloatArray]:
    """Return times with the positions of an axis, in ticks, and times with its speeds, in ticks a millisecond."""
    if board.drives:
        rows = [(time, *got.values[:0:-1]) for time, got in traffic.messages(board, motor.FOC_FEEDBACK)]
        times, where, speed = np.array(rows, dtype=float).reshape(-1, 3).T
        return np.array([times, where]), np.array([times, speed])
    where, speed = (
        np.array([(time, got.values[place]) for time, got in traffic.messages(board, message)], dtype=float)
        .reshape(-1, 2).T
        for message in (motor.BROADCAST_POSITION, motor.BROADCAST_VELOCITY)
    )  # fmt: skip
    speed[1] /= 2.0**_SPEED_SHIFT
    return where, speed


def _numbers(values: Sequence[float]) -> str:
    return f"({' '.join(f'{value:g}' for value in values)})"


def _integral(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return the integral of values from the first time on, by the trapezoidal rule."""
    steps = np.diff(times) * (values[1:] + values[:-1]) / 2
    whole: FloatArray = np.concatenate([[0.0], np.cumsum(steps)])
    return whole


def _longest_way_at_rest(where: FloatArray, way: FloatArray) -> float:
    """Return the longest way by the speeds while the positions stand still."""
    ends = np.flatnonzero(np.diff(where)) + 1
    return max(float(np.ptp(piece)) for piece in np.split(way, ends))
