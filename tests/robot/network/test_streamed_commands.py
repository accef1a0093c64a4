"""Streamed commands of a control board: each is executed, or skipped and reported."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import RAW
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.network.streamed_commands import STREAMED
from waiting import eventually

from ..control_board_bench import QUESTIONS, CalibratedBoard, command
from ..sensor_bench import ManualClock


@pytest.fixture
def board(stepped: ManualClock) -> CalibratedBoard:
    """A board whose time stands still."""
    return CalibratedBoard()


@pytest.fixture
def server(board: CalibratedBoard, network: Network) -> Iterator[ControlBoardServer]:
    """The server of the board."""
    with closing(ControlBoardServer(board, "/robot/arm", network=network)) as opened:
        yield opened


@contextmanager
def commanding(network: Network, codec=None, carrier: str = "tcp") -> Iterator[Port]:
    """A port that is connected to the port for commands of the board."""
    with Port("/commander", network=network, inputs=False) as port:
        port.add_output("/robot/arm/command:i", carrier)
        yield port


STREAMS = [
    ("[poss]", [3.0, 4.0], "pos", lambda board: board.target_positions(), [3.0, 4.0]),
    ("[vmo] 1", [2.0], "vel", lambda board: board.target_velocities(), [0.0, 2.0]),
    ("[vmos]", [1.0, 2.0], "vel", lambda board: board.target_velocities(), [1.0, 2.0]),
    ("[vmog] 2 (1 0)", [1.0, 2.0], "vel", lambda board: board.target_velocities(), [2.0, 1.0]),
    ("[dpo] 0", [7.5], "posd", lambda board: board.reference_positions(), [7.5, 0.0]),
    ("[dpos]", [5.5, 6.5], "posd", lambda board: board.reference_positions(), [5.5, 6.5]),
    ("[dpog] 1 (1)", [6.5], "posd", lambda board: board.reference_positions(), [0.0, 6.5]),
    ("[dtq] 0", [1.5], "torq", lambda board: board.reference_torques(), [1.5, 0.0]),
    ("[dtqs]", [1.5, 2.5], "torq", lambda board: board.reference_torques(), [1.5, 2.5]),
    ("[dtqg] 2 (1 0)", [1.5, 2.5], "torq", lambda board: board.reference_torques(), [2.5, 1.5]),
    ("[ipwm] [ref] 1", [20.0], "ipwm", lambda board: board.reference_duty_cycles(), [0.0, 20.0]),
    ("[ipwm] [refs]", [10.0, 20.0], "ipwm", lambda board: board.reference_duty_cycles(), [10.0, 20.0]),
    ("[icur] [ref] 0", [0.5], "icur", lambda board: board.reference_currents(), [0.5, 0.0]),
    ("[icur] [refs]", [0.5, 0.25], "icur", lambda board: board.reference_currents(), [0.5, 0.25]),
    ("[icur] [refg] 1 (1)", [0.25], "icur", lambda board: board.reference_currents(), [0.0, 0.25]),
]


@pytest.mark.parametrize(("head", "values", "mode", "read", "expected"), STREAMS, ids=lambda value: str(value)[:16])
def test_streamed_commands(network: Network, server, board, head, values, mode, read, expected):
    """A command has been executed when it is acknowledged."""
    board.set_control_modes(ControlMode(Vocab(mode).value))
    with commanding(network) as port:
        port.write(command(head, *values), RAW)
        assert read(board).tolist() == expected


def test_all_streamed_commands_are_tried():
    """The test streams every command of the table."""
    tried = {tuple(str(value) for value in Bottle.parse(head) if isinstance(value, Vocab)) for head, *_ in STREAMS}
    assert tried == set(STREAMED)


def test_recorded_command(network: Network, server: ControlBoardServer, board: CalibratedBoard):
    """The recorded bytes of a real client's command are executed, also by carriers without acknowledgement."""
    board.set_control_modes(ControlMode.POSITION_DIRECT)
    data = bytes.fromhex(
        "0001000002000000 0001000002000000 0900000064706f00 0100000000000000 0a01000001000000 0000000000001e40"
    )
    assert command("[dpo] 0", 7.5) == data
    for carrier in ("fast_tcp", "udp"):
        board.reset_encoders()
        with commanding(network, carrier=carrier) as port:
            port.write(data, RAW)
            eventually(lambda: board.reference_positions(0).tolist() == [7.5], f"nothing came by {carrier}")


def test_commands_keep_their_order(network: Network, server: ControlBoardServer, board: CalibratedBoard):
    """All commands of a fast stream are executed in order."""
    seen = []
    board.set_control_modes(ControlMode.VELOCITY)
    board.velocity_move = lambda values, axes: seen.append(values[0])  # type: ignore[method-assign]
    with commanding(network, carrier="fast_tcp") as port:
        for number in range(500):
            port.write(command("[vmo] 0", float(number)), RAW)
        eventually(lambda: len(seen) == 500, "some are missing")
    assert seen == [*map(float, range(500))]


@pytest.mark.parametrize(
    ("head", "values", "why"),
    [
        ("[vmos]", [1.0, 2.0, 3.0], "takes 2 values, got 3"),
        ("[vmos]", [], "takes 2 values, got 0"),
        ("[vmos]", [1.0], "takes 2 values, got 1"),
        ("[vmo] 0", [1.0, 2.0], "takes 1 values, got 2"),
        ("[vmog] 0 ()", [], "takes 0 values, got 0"),
        ("[vmog] 3 (0 1)", [1.0, 2.0], "a list of 3 values is needed"),
        ("[vmo] 2", [1.0], "there is no joint 2"),
        ("[vmo] x", [1.0], "a whole number is needed"),
        ("[vmo]", [1.0], "a whole number is needed, not nothing"),
        ("[vmo] 0", [float("nan")], "not all finite"),
        ("[posd] 0", [1.0], "is not a command"),
        ("[veld] 0", [1.0], "is not a command"),
        ("", [1.0], "is not a command"),
    ],
    ids=str,
)
def test_an_invalid_command_is_skipped_and_reported(network: Network, server, board, said, head, values, why):
    """An invalid command changes nothing and is reported once; the connection stays open."""
    board.set_control_modes(ControlMode.VELOCITY)
    with commanding(network) as port:
        port.write(command(head, *values), RAW)
        port.write(command(head, *values), RAW)
        assert board.target_velocities().tolist() == [0.0, 0.0]
        assert len(said) == 1
        assert said[0].startswith("/robot/arm: a command of /commander is skipped: ")
        assert why in said[0]
        port.write(command("[vmo] 0", 3.0), RAW)
        assert board.target_velocities(0).tolist() == [3.0]


def test_an_error_of_the_device_is_reported(network: Network, server, board, said):
    """An unexpected error of the device is reported, and the next command is executed."""

    def fail(values, axes):
        raise ZeroDivisionError("broken")

    board.velocity_move = fail
    with commanding(network) as port:
        port.write(command("[vmo] 0", 1.0), RAW)
        assert said == ["/robot/arm: a command of /commander failed: ZeroDivisionError: broken"]
        board.set_control_modes(ControlMode.TORQUE)
        port.write(command("[dtq] 0", 1.0), RAW)
        assert board.reference_torques(0).tolist() == [1.0]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    message=st.one_of(
        st.binary(max_size=80),
        st.builds(encode, QUESTIONS),
        st.builds(
            lambda head, body: bytes.fromhex("0001000002000000") + encode(head) + encode(body), QUESTIONS, QUESTIONS
        ),
    )
)
def test_any_message_is_survived(network: Network, server, board, message: bytes):
    """After any message the next command is executed."""
    board.set_control_modes(ControlMode.FORCE_IDLE)
    board.set_control_modes(ControlMode.VELOCITY)
    with commanding(network) as port:
        port.write(message, RAW)
        port.write(command("[vmos]", 1.0, 2.0), RAW)
        assert board.target_velocities().tolist() == [1.0, 2.0]
