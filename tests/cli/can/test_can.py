"""The commands ``rtf can`` on a virtual bus with scripted boards, and a recording from one bus to another."""

from __future__ import annotations

import argparse
from contextlib import closing
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import can
import cantools
import pytest

from rtf import clock
from rtf.cli.can import watching
from rtf.cli.tools import main
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.codes import BoardMode, BoardType
from rtf.robot.devices.can.listener import Listener, described
from rtf.robot.devices.can.messages import Frame
from rtf.robot.devices.can.sensor_messages import DISCOVER
from scripted_boards import ScriptedBoard
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

CHANNEL = "rtf-can"
_VERSION = "firmware_major 1, firmware_minor 2, firmware_build 3, protocol_major 1, protocol_minor 6, acknowledged 1"
Captured = pytest.CaptureFixture[str]


def run(*words: str, channel: str = CHANNEL) -> int:
    """Run ``rtf can`` on the virtual bus."""
    return main(["can", *words, "--interface", "virtual", "--channel", channel])


def printed(capsys: Captured, code: int, right: Callable[[str], object], *words: str) -> str:
    """Run a command that listens for a time, on a busy machine again, until it has heard enough. Return its output."""
    out = ""

    def is_right() -> bool:
        nonlocal out
        capsys.readouterr()
        ended = run(*words)
        out = capsys.readouterr().out
        return ended == code and bool(right(out))

    eventually(is_right, "it does not hear it")
    return out


@pytest.fixture(scope="module")
def arm() -> Iterator[ScriptedBoard]:
    """A board of joints with the address 3, which broadcasts."""
    with closing(ScriptedBoard(BusSettings("virtual", CHANNEL), 3)) as board:
        board.positions[:] = [500, -600]
        board.mask = 1
        yield board


@pytest.fixture(scope="module")
def drive() -> Iterator[ScriptedBoard]:
    """A board of a motor with the address 1."""
    with closing(ScriptedBoard(BusSettings("virtual", CHANNEL), 1, BoardType.FOC_2)) as board:
        yield board


@pytest.mark.usefixtures("arm", "drive")
def test_scan_lists_boards(capsys: Captured):
    """Each board is a line with its address, type and firmware."""
    lines = ["    1  FOC_2   1.2.3", "    3  MC_4DC  1.2.3"]
    printed(capsys, 0, lambda out: out.splitlines()[1:] == lines, "scan", "--seconds", "0.1")


@pytest.mark.usefixtures("arm")
def test_scan_reports_two_boards_with_one_address(capsys: Captured):
    """Two answers from one address are an error."""
    with closing(ScriptedBoard(BusSettings("virtual", CHANNEL), 3)):
        printed(capsys, 1, lambda out: "two boards have the address 3" in out, "scan", "--seconds", "0.1")


def test_scan_of_an_empty_bus(capsys: Captured):
    """No answer is 1."""
    assert run("scan", "--seconds", "0.01", channel="nobody here") == 1
    assert "no board on virtual nobody here answers within 0.01 s" in capsys.readouterr().out


def test_parameters_are_set_and_read(arm: ScriptedBoard, drive: ScriptedBoard, capsys: Captured):
    """``get`` shows the fields by name; ``set`` reads back, and is 1 where the board has not taken it."""
    assert run("set", "3", "position_pid", "100", "1", "-10", "4", "--axis", "1") == 0
    assert run("get", "3", "position_pid", "--axis", "1") == 0
    assert run("get", "1", "version") == 0
    assert run("set", "1", "current_limits", "1000", "2000", "3000") == 0
    arm.deaf = {"set_min_position"}
    assert run("set", "3", "min_position", "5") == 1
    arm.deaf = set()
    assert capsys.readouterr().out.splitlines() == [
        "board 3 → axis 1 position_pid: kp 100, ki 1, kd -10, shift 4",
        "board 3 → axis 1 position_pid: kp 100, ki 1, kd -10, shift 4",
        f"board 1 → version: board_type foc_2, {_VERSION}",
        "board 1 → axis 0 current_limits: nominal 1 A, peak 2 A, overload 3 A",
        "board 3 → axis 0 min_position: position 0 tick",
        "board 3 has not taken it",
    ]
    assert drive.values["current_limits", 0] == (1000, 2000, 3000)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("get", "3", "psition_pid"), "did you mean position_pid"),
        (("set", "3", "position_pid", "1"), "4 are needed (kp, ki, kd, shift), not 1"),
        (("set", "3", "version", "1"), "no parameter 'version'"),
        (("get", "15", "version"), "15 is no address"),
        (("dbc", "--board", "1=TOASTER"), "there is no type TOASTER"),
        (("log", "run.xyz"), "argument file"),
        (("scan", "--port", "1"), "it is of udp_multicast"),
    ],
)
def test_wrong_words_are_reported(words: tuple[str, ...], said: str, capsys: Captured):
    """A usage error names the argument, and what would be right."""
    with pytest.raises(SystemExit) as ended:
        run(*words)
    assert ended.value.code == 4
    assert said in capsys.readouterr().err


@pytest.mark.usefixtures("arm")
def test_monitor_prints_messages_by_name(capsys: Captured):
    """Each message is a line with its time, identifier, bytes and values; others than those asked for are left out."""
    asked = "monitor", "--seconds", "0.1", "--board", "3", "--message", "posit*"
    lines = printed(capsys, 0, bool, *asked).splitlines()
    assert all(
        line.split(" ", 1)[1]
        == "131 [8] F4 01 00 00 A8 FD FF FF  board 3 position: position_0 500 tick, position_1 -600 tick"
        for line in lines
    )


class Busy:
    """Traffic during which another identifier comes, whenever it is looked at."""

    data = b""

    def __init__(self, traffic: dict[int, Busy]) -> None:
        self._traffic = traffic

    @property
    def frames(self) -> int:
        """Their number."""
        self._traffic[len(self._traffic)] = self
        return 1


def test_identifiers_may_come_while_the_table_is_made(monkeypatch: pytest.MonkeyPatch):
    """They are in the next one."""
    monkeypatch.setattr(watching, "_LOOK", 0.0)
    traffic: dict[int, Busy] = {}
    traffic[0] = Busy(traffic)
    bus: Any = SimpleNamespace(name="b", off=False, traffic=traffic, settings=BusSettings("virtual", "b"))
    options = argparse.Namespace(foc=(), board=(), message="*")
    tables = watching._tables(bus, options, clock.Deadline())
    first, second = next(tables)[0], next(tables)[0]
    assert len(second.rows) > len(first.rows)


@pytest.mark.usefixtures("arm")
def test_load_is_shown_by_identifier(capsys: Captured):
    """Each identifier has its rate, bits and share; the last line is the sum."""
    rows = [
        line.split() for line in printed(capsys, 0, lambda out: "131" in out, "load", "--seconds", "0.2").splitlines()
    ]
    shares = [float(row[3].rstrip("%")) for row in rows[1:-1]]
    assert rows[1][0] == "131"
    assert float(rows[-1][2].rstrip("%")) == pytest.approx(sum(shares), abs=0.05)


@pytest.mark.usefixtures("arm")
@pytest.mark.parametrize("ending", ["asc", "blf", "log"])
def test_a_recording_is_replayed(ending: str, tmp_path: Path, capsys: Captured):
    """What was recorded arrives on another bus, without the commands of the host."""
    file = tmp_path / f"run.{ending}"
    with can.Logger(file) as logger:
        for frame, stamp in [
            (motor.POSITION_MOVE.frame(3, 5, 6), 10.0),
            (motor.SETPOINTS[0].frame(0, 7), 10.0),
            (motor.BROADCAST_POSITION.frame(3, 1, 2), 10.001),
            (motor.BROADCAST_POSITION.frame(3, 3, 4), 10.002),
        ]:
            logger(can.Message(timestamp=stamp, arbitration_id=frame.identifier, data=frame.data, is_extended_id=False))
    with can.Bus(interface="virtual", channel="elsewhere") as bus:
        assert run("replay", str(file), channel="elsewhere") == 0
        got = [bus.recv(1.0) for _ in range(2)]
        assert [motor.BROADCAST_POSITION.structs[8].unpack(one.data) for one in got if one] == [(1, 2), (3, 4)]
        assert bus.recv(0) is None
    assert "2 frames sent; 2 commands of the host were not" in capsys.readouterr().out
    new = tmp_path / f"new.{ending}"

    def logged(_out: str) -> bool:
        with can.LogReader(new) as reader:
            return {message.arbitration_id for message in reader} >= {0x131}

    printed(capsys, 0, logged, "log", str(new), "--seconds", "0.1")


def test_a_file_that_is_no_recording(tmp_path: Path, capsys: Captured):
    """It is named; 1."""
    (tmp_path / "bad.log").write_text("no recording at all\n")
    assert run("replay", str(tmp_path / "bad.log")) == 1
    assert "bad.log cannot be replayed" in capsys.readouterr().err


@pytest.mark.usefixtures("arm")
def test_dbc_of_a_bus(tmp_path: Path):
    """Boards that answer, or are given, are in the file."""
    assert run("dbc", str(tmp_path / "bus.dbc")) == 0
    database = cantools.database.load_file(tmp_path / "bus.dbc")
    assert "board3_position" in [message.name for message in database.messages]


def test_messages_are_printed(capsys: Captured):
    """The page of all messages."""
    assert main(["can", "messages"]) == 0
    assert "`position_move`" in capsys.readouterr().out


def test_a_listener_learns_what_boards_are():
    """Feedback and versions tell boards that drive motors; codes and flags are shown in words."""
    listener = Listener()
    status = motor.FOC_STATUS.frame(2, BoardMode.CURRENT, 0, 3200, 0x401)
    assert listener.decode(status).message is motor.STATUS
    listener.decode(motor.FOC_FEEDBACK.frame(2, 0, 0, 0))
    assert (
        described(listener.decode(status))
        == "board 2 foc_status: mode current, encoder none, pwm 10 %, faults external|tx_passive"
    )
    listener.decode(DISCOVER.value.frame(4, BoardType.FOC_2, 1, 0, 0))
    assert listener.decode(motor.CURRENT_PID.set.frame(4, 1, 2, 3, 4)).message is motor.CURRENT_PID.set
    assert described(listener.decode(motor.SETPOINTS[1].frame(0, 1, 2))) == (
        "→ all boards setpoints_2: setpoint_1 1, setpoint_2 2"
    )
    assert described(listener.decode(Frame(0x136, b"\x86\x10hello"))).endswith("text 'hello'")
