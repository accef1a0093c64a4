"""CAN time-outs: joints stop by themselves when their host falls silent, and obey it again afterwards."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.boards.can_frames import LONGEST
from rtf.robot.boards.can_over_yarp import YarpBus
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.codes import FocFault
from rtf.robot.devices.can.interfaces import can
from rtf.robot.errors import StaleStateError
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.can_test import YARP, CanTest
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.can_traffic import longest_gap, rest_after
from rtf.robot_testing.motion.start_position import bring, hold
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.devices.can.messages import Frame
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.can_test import AxisPlace
    from rtf.robot_testing.judging.can_traffic import BoardOnBus, CanTraffic
    from rtf.robot_testing.motion.part import Part

#: Seconds in which a joint reaches its speed, and between two commands of the client, which end after half a second.
_ACCELERATES, _REPEATS = 0.4, 0.1
#: A joint that is slower than this share of its speed has stopped.
_STOPPED = 0.1
#: Ticks or counts a speed at least, on the bus, so that it can be judged.
_LEAST_SPEED = 4.0
_BACK = 20.0  # deg/s
#: Seconds after the silence that are recorded: drives show where they are only when they are spoken to again.
_SPEAKS = 0.1
#: Seconds after the silence in which the board obeys again.
_OBEYS = 0.5


class CanTimeouts(CanTest):
    """Has the host of a part send nothing for a while, in the middle of a slow motion, and measures when joints stop.

    Boards end a velocity that is not renewed within their time-out, and drives of motors stop without setpoints. The
    program that drives the boards stops sending, as if it had died; joints go on for a few degrees meanwhile,
    even if a time-out does not work. Afterwards the boards obey again.
    """

    tags = ("can",)
    safety = Safety.FAULT

    # As the driver configures it: Timeout in the group VELOCITY, 1 s by default, as of the iCub's hosts.
    timeout = Parameter(float, "the time-out of the boards", unit="s", default=1.0, low=0.05, high=3.5)
    # A joint of a few deg/s slows down in a tenth of a second; boards count time-outs in loops of 0.1 s at most.
    max_late = Parameter(
        float, "how much later than that a joint may stop, from the last command on", unit="s", default=0.3, low=0.0
    )
    speed = Parameter(float, "of the joints", unit="deg/s", default=4.0, low=1.0, high=10.0)

    def run(self) -> None:
        """Move, be silent, and judge each joint."""
        self.assert_error_if_true(
            self.interface != YARP,
            "interface: the program of the boards has to fall silent, which it does by the interface yarp only",
        )
        watched = self.timeout + self.max_late + _OBEYS
        self.assert_error_if_true(
            watched > LONGEST, f"timeout: nothing can be withheld for {watched:g} s, but {LONGEST:g} s"
        )
        part = self.open_part(self.part)
        joints = part.held()
        self.boards = {
            channel: {one.address: one for one in self.boards_of(channel, self.versions(bus))}
            for channel, bus in self.buses.items()
        }
        traffics = self._be_silent(part, joints, watched)
        for one in self.places:
            if part.names.index(one.name) in joints:
                with self.subresult(one.name):
                    self._judge(one, traffics[one.channel])
        self._come_back(part, joints)

    # Motion ------------------------------------------------------------------------------------------------------

    def _be_silent(self, part: Part, joints: Sequence[int], seconds: float) -> dict[str, CanTraffic]:
        """Move joints with a velocity, away from the nearer limit, and have the host be silent; return the frames."""
        hold(part, joints)
        away = np.where(part.home[joints] < (part.low + part.high)[joints] / 2, 1.0, -1.0)
        for bus in self.buses.values():
            bus.clear()
        try:
            part.set_mode(ControlMode.VELOCITY, joints)
            self._run_for(part, joints, self.speed * away, _ACCELERATES)
            for channel in self.buses:
                self._withhold(channel, seconds)
            self._run_for(part, joints, self.speed * away, seconds)
        except (GuardError, StaleStateError) as error:
            self.report(f"the guard stops the motion: {error}")
            self.sleep(seconds)
        finally:
            for channel in self.buses:
                self._withhold(channel, 0.0)
        self.sleep(_SPEAKS)
        return {channel: bus.traffic() for channel, bus in self.buses.items()}

    def _run_for(self, part: Part, joints: Sequence[int], speeds: FloatArray, seconds: float) -> None:
        """Command a velocity again and again, as a client that lives."""
        end = self.now() + seconds
        while (left := end - self.now()) > 0.001:  # noqa: PLR2004 - a step of the boards
            part.board.velocity_move(speeds, joints)
            part.wait(min(_REPEATS, left))

    def _withhold(self, channel: str, seconds: float) -> None:
        """Have the program of a bus be silent for some seconds; 0 ends it."""
        settings = self.buses[channel].bus.settings
        bus = YarpBus(settings.channel, network=self.network)
        try:
            bus.withhold(seconds)
        except can.CanError as error:
            self.assert_error(f"the program of the bus {channel} cannot be silenced: {error}")
        finally:
            bus.shutdown()

    def _come_back(self, part: Part, joints: Sequence[int]) -> None:
        """Move back: the boards obey again."""
        modes = part.board.control_modes(joints)
        faulty = [one for one, mode in zip(joints, modes, strict=True) if mode is ControlMode.HARDWARE_FAULT]
        if faulty:  # a drive without setpoints is in fault, as it should be
            part.set_mode(ControlMode.FORCE_IDLE, faulty)
        hold(part, joints)
        bring(self, part, joints, part.home[joints], speed=_BACK)

    # Verdict -----------------------------------------------------------------------------------------------------

    def _judge(self, axis: AxisPlace, traffic: CanTraffic) -> None:
        """Judge when a joint stopped, by the frames of its board."""
        board = self.boards[axis.channel].get(axis.board)
        name = f"{axis.name} on board {axis.channel}:{axis.board}"
        if board is None:
            self.assert_fail(f"{name}: the board does not answer; {likely_causes('board silent')}")
        commands = [time for frame, time in traffic.frames if _commands(frame, board, axis.place)]
        self.assert_error_if_false(commands, f"{name}: no command to the board was seen on the bus")
        since, until = longest_gap([*commands, float(traffic.times.max())])
        if board.drives:
            self._judge_drive(name, board, traffic, until)
            return
        times, speeds = _speeds(traffic, board, axis.place)
        times, speeds = times[times <= until], speeds[times <= until]
        self.record(f"{axis.name} on the bus", time=(times - since, "s"), speed=(speeds, "count"))
        fastest = float(np.abs(speeds).max(initial=0.0))
        self.assert_fail_if_true(
            fastest < _LEAST_SPEED,
            f"{name} has not moved: {fastest:g} counts of speed on the bus; {likely_causes('does not move')}",
        )
        stopped = rest_after(times, speeds, _STOPPED)
        took = (until if stopped is None else stopped) - since
        goes_on = " at least: it still moves when the host speaks again" if stopped is None else ""
        hint = f"{name} stops {took:.2f} s after the last command{goes_on}; {likely_causes('watchdog')}"
        self.measure("time until it stops", took, "s", high=self.timeout + self.max_late, hint=hint)

    def _judge_drive(self, name: str, board: BoardOnBus, traffic: CanTraffic, until: float) -> None:
        """Judge a board that drives a motor: it says nothing in the silence, and afterwards whether it has stopped.

        A joint may fall then, as its motor is off, so its way says nothing.
        """
        ways = [(time, float(got.values[2])) for time, got in traffic.messages(board, motor.FOC_FEEDBACK)]
        states = [int(got.values[3]) for time, got in traffic.messages(board, motor.FOC_STATUS) if time >= until]
        self.assert_fail_if_false(states, f"{name}: the board does not answer setpoints after the silence")
        before = [position for time, position in ways if time < until]
        after = [position for time, position in ways if time >= until]
        if before and after:
            self.measure("way of the rotor in the silence", after[0] - before[-1], "count")
        self.check_fail_if_false(
            any(state & FocFault.SETPOINT_EXPIRED for state in states),
            f"{name} has not stopped within {self.timeout + self.max_late + _OBEYS:g} s without setpoints; "
            f"{likely_causes('watchdog')}",
        )


def _commands(frame: Frame, board: BoardOnBus, place: int) -> bool:
    """Whether a frame commands a velocity of an axis."""
    if board.drives:
        return frame.identifier == motor.SETPOINTS[0].identifier(0)
    wanted = motor.VELOCITY_MOVE.frame(board.address, 0, 0, axis=place)
    return frame.identifier == wanted.identifier and frame.data[:1] == wanted.data[:1]


def _speeds(traffic: CanTraffic, board: BoardOnBus, place: int) -> tuple[FloatArray, FloatArray]:
    """Return the times and the speeds of an axis, as its board broadcasts them."""
    rows = [(time, float(got.values[place])) for time, got in traffic.messages(board, motor.BROADCAST_VELOCITY)]
    times, speeds = np.array(rows).reshape(-1, 2).T
    return times, speeds
