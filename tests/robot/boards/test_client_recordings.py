"""Recordings of a real client and a real board: the same calls of our client make the same bytes."""

from __future__ import annotations

import socket
import threading
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import pytest

from replaying import playing, recordings, segments
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.bottle.binary import decode_from
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.types.codecs import TextCodec
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import Pid, PidType
from rtf.robot.network.state_reader import StateReader
from rtf.robot.network.streamed_commands import COMMAND
from rtf.robot.yarp3.client import RemoteControlBoard
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from replaying import Segment
    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.types.codecs import Buffer

RECORDED = recordings("3.12.3", "board_clients.json")
BOARD = "/icubSim/head"
#: The beginning of a request.
ASKED = b"~d\0\1"
#: Requests of the recordings by their words, and the calls that they stand for.
CALLS: dict[str, Callable[[RemoteControlBoard, Bottle], object]] = {
    "[get] [pid] [pid]": lambda board, arguments: board.pid(PidType(arguments[0].value), arguments[1]),
    "[set] [pid] [pid]": lambda board, arguments: board.set_pid(
        PidType(arguments[0].value), arguments[1], Pid(*arguments[2])
    ),
    "[set] [icmd] [cmod]": lambda board, arguments: board.set_control_modes(
        ControlMode(arguments[1].value), arguments[0]
    ),
    "[set] [intm] [mode]": lambda board, arguments: board.set_interaction_modes(
        InteractionMode(arguments[1].value), arguments[0]
    ),
    "[get] [ivar] [mvar]": lambda board, arguments: board.variable(arguments[0]),
    "[set] [vel]": lambda board, arguments: board.set_reference_speeds(arguments[1], arguments[0]),
    "[set] [pos]": lambda board, arguments: board.position_move(arguments[1], arguments[0]),
    "[get] [llim]": lambda board, arguments: board.limits(arguments[0]),
}


class Raw(TextCodec[bytes]):
    """The bytes of a message as they are."""

    def encode(self, value: bytes, dialect: Dialect) -> Sequence[Buffer]:
        """Return the bytes as one block."""
        del dialect
        return (value,)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[bytes, int]:
        """Return all bytes."""
        del dialect
        return bytes(data), len(data)


class StatePort(BufferedPort[bytes]):
    """Sends the last of the recorded states to every reader that connects."""

    def connected(self, output: Output) -> None:
        """See BufferedPort."""
        super().connected(output)
        envelope, data = RECORDED["state"][-1]
        self.write(bytes.fromhex(data), envelope=envelope)


@contextmanager
def recorded_board(network: Network, talk: list[Segment]) -> Iterator[tuple[list[Segment], BufferedPort[bytes]]]:
    """A board with the recorded answers: its received and expected requests, and its port for commands."""
    with ExitStack() as opened:
        listening = opened.enter_context(socket.create_server(("127.0.0.1", 0)))
        network.dialect = Dialect.YARP3  # the recorded boards are not asked for it
        network.names.register(f"{BOARD}/rpc:i", carrier="tcp", host="127.0.0.1", port=listening.getsockname()[1])
        commands = opened.enter_context(
            BufferedPort(f"{BOARD}/command:i", Raw(), strict=True, network=network, outputs=False)
        )
        opened.enter_context(StatePort(f"{BOARD}/stateExt:o", Raw(), network=network, inputs=False))
        yield opened.enter_context(playing(listening, talk)), commands


def open_client(network: Network, test: str, **parameters: object) -> RemoteControlBoard:
    """A client with the names of the recorded one."""
    board = RemoteControlBoard("head", network=network)
    board.open(Property({"remote": BOARD, "local": f"/{test}{BOARD}", "timeout": 0.1, **parameters}))
    return board


@pytest.mark.parametrize("test", [*RECORDED["questions"]])
def test_calls_are_put_as_the_real_client_puts_them(network: Network, test: str):
    """The client's bytes in handshake, opening, every call and disconnection are the recorded ones."""
    talk = segments(RECORDED["questions"][test])
    questions = [decode_from(data, data.index(ASKED) + 4, Dialect.YARP3)[0] for _, data in talk if ASKED in data]
    assert [str(question) for question in questions[:2]] == ["[get] [prot]", "[get] [axes]"]
    with recorded_board(network, talk) as (sent, _), open_client(network, test) as board:
        for question in questions[2:]:
            words = Bottle([word for word in question if isinstance(word, Vocab)])
            name = max((key for key in CALLS if str(words).startswith(key)), key=len)
            put(CALLS[name], board, question[len(name.split()) :])
        board.close()
    assert len(sent) == 2 + len(questions)
    for expected, got in sent:
        assert got == expected


def put(call: Callable[[RemoteControlBoard, Bottle], object], board: RemoteControlBoard, arguments: Bottle) -> None:
    """Make a call; an unknown variable must be refused as in the recording."""
    if isinstance(arguments[0], str):
        with pytest.raises(RefusedError, match=arguments[0]):
            call(board, arguments)
    else:
        call(board, arguments)


def test_streamed_commands_are_the_recorded_ones(network: Network):
    """Each datagram has the payload that the real client sent for the same references of three joints."""
    expected = [bytes.fromhex(data) for data in RECORDED["commands"]]
    talk = segments(RECORDED["questions"]["positionDirectTest"])
    with (
        recorded_board(network, [*talk[:6], *talk[-2:]]) as (_, commands),
        open_client(network, "positionDirectTest", writeStrict="on") as board,
    ):
        for data in expected:
            board.set_positions(COMMAND.decode(data, Dialect.YARP3).second, [0, 1, 2])
        eventually(lambda: commands.pending == len(expected), "a command is missing")
        assert [commands.read() for _ in expected] == expected


def test_recorded_states_are_read(network: Network):
    """The client returns what a real board published, with the time of the envelope."""
    talk = segments(RECORDED["questions"]["positionDirectTest"])
    stamp = float(RECORDED["state"][-1][0].split()[1])
    with (
        recorded_board(network, [*talk[:6], *talk[-2:]]),
        open_client(network, "positionDirectTest", timeout=10.0) as board,
    ):
        assert board.axes() == 6
        assert board.encoders().tolist() == [0.0] * 6
        assert board.encoder_times(3).tolist() == [stamp]
        assert board.control_modes() == (ControlMode.POSITION,) * 6


def test_the_state_is_asked_for_as_the_real_client_asks(network: Network):
    """The client asks the board's port for an existing connection, then requests one."""
    talks = [segments(talk) for talk in RECORDED["connecting"]]
    sent: list[tuple[bytes, bytes]] = []
    with socket.create_server(("127.0.0.1", 0)) as listening:
        network.names.register(f"{BOARD}/stateExt:o", carrier="tcp", host="127.0.0.1", port=listening.getsockname()[1])

        def administer() -> None:
            for talk in talks:
                with playing(listening, talk) as part:
                    pass
                sent.extend(part)

        board = threading.Thread(target=administer)
        board.start()
        name = f"/ControlModesTest{BOARD}/stateExt:i"
        state = StateReader(name, BOARD, network=network, carrier="udp", timeout=0.5, lost=int)
        state.reconnect()
        board.join(10)
        state.close()
    assert len(sent) == 4
    for expected, got in sent:
        assert got == expected
