"""Prismatic joints in tests: degrees above the client of the board, metres below it."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.devices.board_axes import BoardAxis
from rtf.robot.devices.fake_board import FakeBoard, FakeDriver
from rtf.robot.interfaces import JointType, Pid, PidType
from rtf.robot.model import find_robot, load_robot
from rtf.robot_testing.guard.snapshot import sliding_joints
from rtf.robot_testing.judging.checked_values import CheckedValue
from rtf.robot_testing.slides import as_text, converted, in_units, open_board, shown, slides_of
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.robot.extended_state import ExtendedState

AXES = [
    BoardAxis(name="turn", minimum=-50.0, maximum=50.0, gearbox=100.0),
    BoardAxis(name="lift", kind=JointType.PRISMATIC, maximum=0.3, minimum=0.0, max_velocity=0.1, gearbox=1000.0),
]
#: Metres that stand for a degree of the lift.
DEGREE = 0.003


class _Driver(FakeDriver):
    def connect(self, configuration: Property) -> list[BoardAxis]:
        return AXES


class Board(FakeBoard):
    """A joint that turns, and one that slides."""

    driver_class = _Driver


@pytest.fixture(scope="module")
def boards() -> Iterator[tuple]:
    """The device, a client that converts, one that does not, and the server."""
    with ExitStack() as opened:
        network = Network(LocalNames())
        device = Board("fake", network=network)
        device.open(Property())
        opened.callback(device.close)
        server = ControlBoardServer(device, "/fake", network=network, period=0.01)
        opened.callback(server.close)
        board = open_board("/fake", {"lift": DEGREE}, carrier="tcp", network=network)
        opened.callback(board.close)
        plain = connect("/fake", carrier="tcp", network=network)
        opened.callback(plain.close)
        yield device, board, plain, server


def test_settings_are_in_degrees_above_and_in_metres_below(boards: tuple):
    """Limits, speeds and targets of the joint that turns are as they are."""
    device, board, _, _ = boards
    assert board.limits(1) == pytest.approx((0.0, 100.0))
    assert board.limits(0) == (-50.0, 50.0)
    board.set_limits(1, 10.0, 90.0)
    assert device.limits(1) == pytest.approx((0.03, 0.27))
    board.set_limits(1, 0.0, 100.0)
    board.set_reference_speeds([5.0, 20.0])
    assert device.reference_speeds() == pytest.approx([5.0, 0.06])
    assert board.reference_speeds() == pytest.approx([5.0, 20.0])
    assert board.velocity_limits(1)[1] == pytest.approx(0.1 / DEGREE)
    board.position_move([10.0], [1])
    assert device.target_positions(1) == pytest.approx([0.03])
    assert board.target_positions(1) == pytest.approx([10.0])


def test_gains_are_per_degree_above_and_per_metre_below(boards: tuple):
    """So that a loop of the test's own, in degrees, is that of the board; and the motor's turns are a degree's."""
    device, board, _, _ = boards
    board.set_pid(PidType.POSITION, 1, Pid(kp=3.0, kd=0.3, max_output=50.0))
    assert device.pid(PidType.POSITION, 1).kp == pytest.approx(1000.0)
    assert device.pid(PidType.POSITION, 1).max_output == 50.0
    assert board.pid(PidType.POSITION, 1).kd == pytest.approx(0.3)
    assert board.pids(PidType.POSITION)[1].kp == pytest.approx(3.0)
    board.set_pids(PidType.POSITION, board.pids(PidType.POSITION))
    assert device.pid(PidType.POSITION, 1).kp == pytest.approx(1000.0)
    board.set_pid(PidType.TORQUE, 1, Pid(kp=3.0))
    assert device.pid(PidType.TORQUE, 1).kp == 3.0
    board.set_impedance(1, 0.3, 0.03)
    assert device.impedance(1) == pytest.approx((100.0, 10.0))
    assert board.impedance(1) == pytest.approx((0.3, 0.03))
    assert board.gearbox_ratio(1) == pytest.approx(1000.0 * 360.0 * DEGREE), "motor degrees a degree of the joint"
    assert board.gearbox_ratio(0) == 100.0


def test_states_are_in_degrees_above(boards: tuple):
    """Readings and observed states; another client sees metres."""
    device, board, plain, server = boards
    device.set_encoders([7.0, 0.15])
    seen: list[ExtendedState] = []
    raw: list[ExtendedState] = []
    board.observe(lambda _, state: seen.append(state))
    plain.observe(lambda _, state: raw.append(state))
    server.publish(clock.now())
    eventually(lambda: bool(seen and raw), "no state came")
    assert board.encoders() == pytest.approx([7.0, 50.0])
    assert board.encoder(1) == pytest.approx(50.0)
    assert np.asarray(board.encoders([1])) == pytest.approx([50.0])
    assert seen[-1].joint_positions == pytest.approx([7.0, 50.0])
    assert plain.encoders() == pytest.approx([7.0, 0.15])


def test_a_known_slide_is_tested_and_an_unknown_one_is_not(boards: tuple):
    """By what the clients say of its type."""
    _, board, plain, _ = boards
    assert sliding_joints(board) == frozenset()
    assert sliding_joints(plain) == frozenset({1})


def test_positions_of_the_model_are_in_its_units(boards: tuple):
    """For forward kinematics and planned moves; the client of another board has them anyway."""
    _, board, plain, _ = boards
    assert in_units(board, np.array([[7.0, 50.0]])) == pytest.approx(np.array([[7.0, 0.15]]))
    assert in_units(board, np.array([50.0]), [1]) == pytest.approx([0.15])
    assert in_units(plain, np.array([7.0, 0.15])) == pytest.approx([7.0, 0.15])


def test_what_is_shown_is_in_metres(boards: tuple):
    """Texts, measured values and recordings."""
    _, board, _, _ = boards
    assert shown(board, 1, 50.0) == "0.1500 m"
    assert shown(board, 1, -1.0, "+.2f", "/s") == "-0.0030 m/s"
    assert shown(board, 0, 50.0, ".1f") == "50.0 deg"
    assert converted(DEGREE, "deg/s") == (DEGREE, "m/s")
    assert converted(DEGREE, "A") == (1.0, "A")
    assert converted(None, "deg") == (1.0, "deg")
    assert CheckedValue("error", 2.0, "deg", 4.0).scaled(0.5, "m") == CheckedValue("error", 1.0, "m", 2.0)
    assert as_text(DEGREE, 3.0, "Nm", ".1f") == "3.0 N"
    assert as_text(None, 3.0, "Nm", "g") == "3 Nm"
    assert as_text(DEGREE, 3.0, "Nm/deg", "g") == "1000 N/m"
    assert as_text(DEGREE, 0.3, "Nm/deg s", "g") == "100 N/m s"


def test_a_degree_is_a_share_of_the_range_unless_the_file_says_more(tmp_path: Path):
    """A hundredth of it; robot.toml may give the metres, for a slide alone."""
    bench = find_robot("bench").parent
    description = (bench / "bench.xml").read_text(encoding="utf-8")
    slide = description.replace('name="elbow" axis="0 1 0" range="0 130"', 'name="elbow" type="slide" range="0 0.2"')
    (tmp_path / "bench.xml").write_text(slide, encoding="utf-8")
    text = (bench / "robot.toml").read_text(encoding="utf-8").replace("home = 30.0", "home = 0.03")
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    assert slides_of(load_robot(f"{tmp_path}/"), "arm") == {"elbow": pytest.approx(0.002)}
    (tmp_path / "robot.toml").write_text(text.replace("home = 0.03", "home = 0.03, degree = 0.001"), encoding="utf-8")
    assert slides_of(load_robot(f"{tmp_path}/"), "arm") == {"elbow": 0.001}
    assert slides_of(load_robot(f"{tmp_path}/"), "leg") == {}
    (tmp_path / "robot.toml").write_text(text.replace("{ max_torque = 15.0", "{ degree = 1, max_torque = 15.0"))
    with pytest.raises(ValueError, match=r"robot.toml:25: shoulder: degree is for prismatic joints"):
        load_robot(f"{tmp_path}/")
