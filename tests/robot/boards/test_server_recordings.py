"""Recorded conversations of real clients with a real board, replayed with our board: it answers the same bytes."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from replaying import receive, recordings, segments
from rtf.bottle import Dialect, Property
from rtf.bottle.binary import decode_from
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.types.codecs import RAW
from rtf.middleware.wire import framing
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.extended_state import EXTENDED_STATE, ExtendedState
from rtf.robot.interfaces import Pid, PidType
from rtf.robot.network.streamed_commands import COMMAND

CLIENTS = recordings("3.12.3", "board_clients.json")
#: The conversations with a board; those with other devices follow.
QUESTIONS = recordings("3.12.3", "robot.json")["questions"][:38]
HEAD = (
    "(GENERAL (Joints 6) (AxisName (neck_pitch neck_roll neck_yaw eyes_tilt eyes_vers eyes_verg)))"
    " (LIMITS (Max (30 20 50 15 50 50)) (Min (-40 -20 -50 -35 -50 0)))"
)
ARM = (
    "(GENERAL (Joints 16)) (LIMITS (Max (10 160 80 105 90 10 40 60 90 180 90 180 90 180 90 270))"
    " (Min (-95 0 -37 15 -90 -80 -20 0 0 0 0 0 0 0 0 0)))"
)
#: Intended differences: the request, the answer of the recorded board, the answer of our board, and the reason.
ELSE = {
    "[get] [don] 0": (
        "[is] [don] 0",
        "[is] [don] 1",
        "the joint is in velocity mode, which takes no position moves: there is no motion that is not done",
    ),
}
_STAMP = re.compile(rb"(tsta\x01\0\0\0)(....)(\x0a\0\0\0)........", re.DOTALL)
_ASKED = b"~d\0\1"


def as_recorded(configuration: str) -> FakeBoard:
    """Return our fake board with the zeros that the recorded one began with."""
    board = FakeBoard("fake")
    board.open(Property.parse(configuration))
    zeros = np.zeros(board.axes())
    board.set_reference_speeds(zeros)
    board.set_reference_accelerations(zeros)
    board.set_pids(PidType.POSITION, [Pid(scale=0.0)] * board.axes())
    return board


def replayed(server: ControlBoardServer, network: Network, talk: list[list[str]]) -> Iterator[tuple[str, bytes, bytes]]:
    """Replay the client: yield each request, the recorded answer, and the present answer."""
    contact = network.names.query(f"{server.name}/rpc:i")
    assert contact is not None
    with socket.create_connection((contact.host, contact.port), timeout=5) as connection:
        question = ""
        for number, (way, data) in enumerate(segments(talk)):
            if way == ">":
                connection.sendall(data)
                question = str(decode_from(data, data.index(_ASKED) + 4)[0]) if _ASKED in data else "greeting or leave"
            else:
                expected = data if number > 1 else framing.yarp_number(contact.port)
                yield question, expected, receive(connection, len(expected))


def without_time(data: bytes) -> bytes:
    """Return the bytes with the time of a stamp blanked; its count stays."""
    return _STAMP.sub(rb"\1\2\3--------", data)


def without_stamp(data: bytes) -> bytes:
    """Return the bytes without time and count, for conversations of which parts are not stored."""
    return _STAMP.sub(rb"\1----\3--------", data)


def test_a_person_asks_a_board(network: Network):
    """Thirty-eight typed requests, each of its own client, have the recorded answers, stamps and acknowledgements."""
    others = dict(ELSE)
    with closing(ControlBoardServer(as_recorded(ARM), "/icubSim/left_arm", network=network)) as server:
        for talk in QUESTIONS:
            for question, expected, got in replayed(server, network, talk):
                if question in others:
                    then, now, _ = others.pop(question)
                    assert str(decode_from(expected)[0]).startswith(then)
                    assert str(decode_from(got)[0]).startswith(now)
                else:
                    assert without_time(got) == without_time(expected), question
    assert not others, "these were not asked"


def test_robot_tests_ask_a_board(network: Network):
    """The requests of three robot tests, from opening to moves, have the recorded answers."""
    asked = 0
    with closing(ControlBoardServer(as_recorded(HEAD), "/icubSim/head", network=network)) as server:
        for talk in CLIENTS["questions"].values():
            for question, expected, got in replayed(server, network, talk):
                assert without_stamp(got) == without_stamp(expected), question
                asked += 1
    assert asked > 80


def test_robot_tests_stream_to_a_board(network: Network):
    """The streamed references arrive at the three joints that they name, and at no others."""
    board = as_recorded(HEAD)
    board.set_control_modes(ControlMode.POSITION_DIRECT, [0, 1, 2])
    with (
        closing(ControlBoardServer(board, "/icubSim/head", network=network)),
        Port("/commander", network=network, inputs=False) as port,
    ):
        port.add_output("/icubSim/head/command:i", "tcp")
        for payload in CLIENTS["commands"]:
            data = bytes.fromhex(payload)
            port.write(data, RAW)
            wanted = COMMAND.decode(data, Dialect.YARP3).second
            assert board.reference_positions([0, 1, 2]).tolist() == wanted.tolist()
            assert board.reference_positions([3, 4, 5]).tolist() == [0.0] * 3


@pytest.mark.parametrize("number", [0, -1])
def test_state_is_published_as_recorded(number: int):
    """The state of a board at rest has the recorded bytes, except for values that the recorded board invented."""
    _, payload = CLIENTS["state"][number]
    recorded, _ = EXTENDED_STATE.decode_from(bytes.fromhex(payload), Dialect.YARP3)
    state = ExtendedState(6)
    as_recorded(HEAD).fill_state(state)
    state.duty_cycles[:] = 33 + np.arange(6)  # the recorded board drives nothing with 33 per cent and more
    state.currents[:] = 100 * state.duty_cycles  # and thousands of amperes
    state.interaction_modes[:] = recorded.interaction_modes  # where it had set none it sent 0, which is no mode
    assert state.write(Dialect.YARP3) == bytes.fromhex(payload)
