"""Judging of the frames of a CAN bus: what the schedule of the boards and the protocol of CAN allow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.codes import BoardType, FocFault
from rtf.robot.devices.can.messages import Frame
from rtf.robot_testing.judging.can_traffic import BoardOnBus, CanTraffic, older_than_usual, rest_after

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.interfaces import FloatArray

BITRATE = 1_000_000
BOARD = BoardOnBus(2, BoardType.BLL, ("neck_yaw", "eyes_tilt"))
POSITIONS = motor.BROADCAST_POSITION.identifier(2)


def position(place: int) -> Frame:
    """The place-th position of a moving board."""
    return motor.BROADCAST_POSITION.frame(2, place, -place)


def regular(count: int = 100) -> list[tuple[Frame, float]]:
    """Positions that move, on schedule."""
    return [(position(place), 10.0 + place * BOARD.cycle) for place in range(count)]


def test_a_schedule_is_expected_as_long_as_the_recording_is():
    """A board of four axes has a longer one; a drive answers each setpoint."""
    traffic = CanTraffic(regular(), BITRATE)
    assert traffic.seconds == pytest.approx(99 * BOARD.cycle)
    assert traffic.expected(BOARD)[POSITIONS] == pytest.approx(99)
    assert traffic.expected(BOARD._replace(board_type=BoardType.MC_4DC))[POSITIONS] == pytest.approx(99 * 4 / 5)
    drive = BoardOnBus(1, BoardType.FOC_2, ("hip",))
    setpoints = [(motor.SETPOINTS[0].frame(0, 5), 1.0 + place * 1e-3) for place in range(50)]
    traffic = CanTraffic(setpoints, BITRATE)
    assert set(traffic.expected(drive).values()) == {50.0}
    assert traffic.cycle_of(drive) == pytest.approx(1e-3)
    assert traffic.cycle_of(BOARD) == BOARD.cycle


def test_repeated_and_overtaken_frames_are_told_apart():
    """Equal data at once came twice; other data at once was overtaken."""
    frames = regular()
    assert CanTraffic(frames, BITRATE).repetition(POSITIONS, BOARD.cycle) == (0, 0)
    twice = sorted([*frames, *frames[10:20]], key=lambda one: one[1])
    assert CanTraffic(twice, BITRATE).repetition(POSITIONS, BOARD.cycle) == (10, 0)
    overtaken = [*frames]
    overtaken[30] = frames[31][0], frames[31][1]
    overtaken[31] = frames[30][0], frames[31][1]
    assert CanTraffic(overtaken, BITRATE).repetition(POSITIONS, BOARD.cycle) == (0, 1)


def test_frames_of_nobody_are_those_without_a_board():
    """Requests to boards that are known, their answers and broadcasts, and sensors that are named, are of somebody."""
    known = [
        motor.VERSION.get.frame(2, 1, 6),
        motor.VERSION.value.frame(2, 4, 1, 2, 3, 1, 6, 1),
        motor.STATUS.frame(2, 0, 0, 0, 0, 0, 0, 0, 0),
        motor.SETPOINTS[0].frame(0, 5),
        Frame(0x3DA, bytes(6)),
    ]
    strangers = [position(1)._replace(identifier=0x151), Frame(0x12F, b""), Frame(0x003, b"\x07")]
    traffic = CanTraffic([(frame, float(place)) for place, frame in enumerate([*known, *strangers])], BITRATE)
    assert traffic.strangers([BOARD], [13]) == {0x151: 1, 0x12F: 1, 0x003: 1}
    assert 0x3DA in traffic.strangers([BOARD], [])


def test_lengths_and_counts_of_errors_are_those_of_messages():
    """A frame that is too short is no message; statuses say how many errors a board counts."""
    frames = [
        (Frame(POSITIONS, bytes(7)), 0.0),
        (motor.STATUS.frame(2, 0, 1, 0, 1, 0, 0, 16, 3), 0.1),
        (motor.STATUS.frame(2, 0, 1, 0, 1, 0, 0, 8, 5), 0.2),
    ]
    traffic = CanTraffic(frames, BITRATE)
    assert traffic.unreadable([BOARD]) == {POSITIONS: 1}
    assert traffic.errors(BOARD) == (16, 5)
    assert CanTraffic([], BITRATE).errors(BOARD) == (0, 0)
    drive = BoardOnBus(1, BoardType.FOC_2, ("hip",))
    for faults, counts in ((0, (0, 0)), (FocFault.RX_WARNING, (0, 96)), (FocFault.TX_PASSIVE, (128, 0))):
        frame = motor.FOC_STATUS.frame(1, 0, 0, 0, int(faults))
        assert CanTraffic([(frame, 1.0)], BITRATE).errors(drive) == counts


def test_silence_counts_from_the_last_frame_and_to_the_end():
    """Another board still sends."""
    other = [(motor.BROADCAST_POSITION.frame(1, 0, 0), 10.0 + place * 0.004) for place in range(200)]
    frames = sorted([*regular(), *other], key=lambda one: one[1])
    seconds, since = CanTraffic(frames, BITRATE).longest_silence(POSITIONS)
    assert (seconds, since) == (pytest.approx(0.4), pytest.approx(10.396))


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8), st.floats(0.0, 1.0)), max_size=30))
def test_any_frames_can_be_judged(rows: list[tuple[int, bytes, float]]):
    """Whatever comes, there is a load from 0 on, and no frame is counted twice."""
    frames = [(Frame(number, data), time) for number, data, time in sorted(rows, key=lambda row: row[2])]
    traffic = CanTraffic(frames, BITRATE)
    assert traffic.load >= 0.0
    assert traffic.busiest(0.1) >= 0.0
    assert sum(len(stream.times) for stream in traffic.streams.values()) == len(frames)
    assert sum(traffic.strangers([BOARD], [13]).values()) <= len(frames)
    assert sum(traffic.unreadable([BOARD]).values()) <= len(frames)
    for number in traffic.streams:
        assert sum(traffic.repetition(number, BOARD.cycle)) < max(1, len(frames))
        assert 0.0 <= traffic.longest_silence(number)[0] <= traffic.seconds
    assert all(0 <= count <= 255 for count in traffic.errors(BOARD))


def test_the_version_of_most_is_the_right_one():
    """Of two with different ones, the newer one."""
    assert older_than_usual({"a": (3, 5, 0), "b": (2, 5, 0), "c": (3, 5, 0)}) == {"b": (3, 5, 0)}
    assert older_than_usual({"a": (3, 5, 0), "b": (2, 5, 0)}) == {"b": (3, 5, 0)}
    assert older_than_usual({}) == {}


def _broadcasts(speeds_at: Callable[[float], float]) -> tuple[FloatArray, FloatArray]:
    """Times and speeds of a board that broadcasts a speed every 4 ms for 2 s, in counts of 64."""
    times = np.arange(0.0, 2.0, 0.004)
    return times, np.array([64.0 * round(speeds_at(time) / 64.0) for time in times])


@given(st.floats(0.2, 1.5))
def test_a_joint_rests_when_it_has_slowed_down(stops: float):
    """It goes at 6 counts of speed, and slows down within 50 ms."""
    times, speeds = _broadcasts(lambda time: -384.0 * min(1.0, max(0.0, (stops + 0.05 - time) / 0.05)))
    assert rest_after(times, speeds, 0.1) == pytest.approx(stops + 0.05, abs=0.06)


def test_a_joint_that_creeps_rests_and_one_that_goes_on_does_not():
    """Creeping shows as a single count now and then, which is more than a tenth of the speed."""
    times, speeds = _broadcasts(lambda time: 384.0 if time < 1.0 else 0.0)
    speeds[[400, 420, 424, 450, 499]] = 64.0
    assert rest_after(times, speeds, 0.1) == pytest.approx(1.04, abs=0.01)
    assert rest_after(*_broadcasts(lambda _: 384.0), 0.1) is None
    assert rest_after(*_broadcasts(lambda time: 384.0 if time < 1.0 else 64.0), 0.1) is None
    assert rest_after(*_broadcasts(lambda _: 0.0), 0.1) is None


def test_a_joint_that_trembles_rests():
    """By half a count of speed to either side, which a board reports as a whole one."""
    times, speeds = _broadcasts(lambda time: 384.0 if time < 1.0 else 64.0 * (round(time / 0.004) % 3 - 1))
    assert rest_after(times, speeds, 0.1) == pytest.approx(1.04, abs=0.01)
