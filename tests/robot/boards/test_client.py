"""The client of a control board: its state, its opening and closing, and boards that misbehave."""

from __future__ import annotations

import threading
from functools import partial
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle, Property, as_string
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.qos import Qos
from rtf.middleware.wire.contact import Contact
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.device import make_device
from rtf.robot.errors import (
    ConfigurationError,
    DeviceError,
    NoAnswerError,
    NotSupportedError,
    RefusedError,
    StaleStateError,
)
from rtf.robot.extended_state import Field
from rtf.robot.yarp3.client import RemoteControlBoard
from waiting import eventually

from ..scripted_board import ScriptedBoard, client_of, names, raises
from ..sensor_bench import ManualClock
from ..served_board import fake_board, publish

if TYPE_CHECKING:
    pass


CARRIERS = ("tcp", "fast_tcp", "udp")
STAMP = "[tsta] 1 2.0 [ok]"


# State --------------------------------------------------------------------------------------------------------------


def test_measurements_come_with_the_state(network: Network):
    """Each reading is the field of its name in the last state, and needs no request."""
    with ScriptedBoard("/board", network) as board:
        for field in Field:
            board.state.values(field)[:] = [10 * field + joint for joint in range(3)]
        board.state.control_modes[:] = [ControlMode.POSITION, ControlMode.IDLE, 12345]
        board.state.interaction_modes[:] = [InteractionMode.STIFF, InteractionMode.COMPLIANT, 0]
        with client_of(board, network) as client:
            readings = [
                client.encoders(),
                client.encoder_speeds(),
                client.encoder_accelerations(),
                client.motor_encoders(),
                client.motor_encoder_speeds(),
                client.motor_encoder_accelerations(),
                client.torques(),
                client.duty_cycles(),
                client.currents(),
            ]
            assert [reading.tolist() for reading in readings] == [
                [10.0 * n, 10.0 * n + 1, 10.0 * n + 2] for n in range(9)
            ]
            assert client.encoders([2, 0]).tolist() == [2.0, 0.0]
            assert client.pwm(2) == 72.0
            assert client.control_modes() == (ControlMode.POSITION, ControlMode.IDLE, ControlMode.UNKNOWN)
            assert client.interaction_modes([1, 2]) == (InteractionMode.COMPLIANT, InteractionMode.UNKNOWN)
            client.encoders()[:] = 99.0
            assert client.encoder(1) == 1.0
        assert board.asked == []


def test_what_is_not_valid_is_not_given(network: Network):
    """Reading a field that the board marks as invalid raises NotSupportedError."""
    with ScriptedBoard("/board", network) as board:
        board.state.valid[Field.TORQUES] = False
        with client_of(board, network) as client:
            assert client.encoders().shape == (3,)
            with pytest.raises(NotSupportedError, match=r"^/board marks torques as invalid"):
                client.torques()


def test_an_old_state_is_an_error(network: Network):
    """The error of a stale state names the port and the age; after the next state readings work again."""
    with ScriptedBoard("/board", network) as board, client_of(board, network, timeout=0.05) as client:
        eventually(lambda: raises(StaleStateError, client.encoders), "the state does not get too old")
        with pytest.raises(StaleStateError, match=r"from /board/stateExt:o to /client/stateExt:i is 0?\d*\.\d+ s old"):
            client.encoders()
        client._link.state.timeout = 60.0
        board.publish()
        eventually(lambda: not raises(StaleStateError, client.encoders), "the new state does not come")


def test_without_a_state_nothing_is_read(network: Network):
    """Before the first state a reading is an error, not zero."""
    with ScriptedBoard("/board", network) as board:
        board.publish = lambda: None  # type: ignore[method-assign]
        with client_of(board, network, timeout=0.01) as client:
            with pytest.raises(
                StaleStateError, match=r"no state has arrived from /board/stateExt:o at /client/stateExt:i"
            ):
                client.encoders()
            assert client.axes() == 3


def test_a_state_of_another_board_is_not_taken(network: Network):
    """A state with another number of joints is an error."""
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        client._link.state.axes = 4
        with pytest.raises(NoAnswerError, match="states of 3 joints, but the board has 4"):
            client.encoders()


def test_an_invalid_state_closes_its_connection(network: Network, said: list[str]):
    """A message that is not a state closes the connection of its sender; the last state stays."""
    with ScriptedBoard("/board", network) as board, client_of(board, network, timeout=10.0) as client:
        before = client.encoders().tolist()
        with Port("/stranger", network=network) as stranger:
            stranger.add_output("/client/stateExt:i")
            stranger.write(Bottle.parse("[pos] 1 2 3"))
            eventually(lambda: any("/stranger was cut off" in sentence for sentence in said), "nobody is told")
        assert client.encoders().tolist() == before


def test_by_a_simulators_clock_the_age_is_that_of_the_robots_time(network: Network, stepped: ManualClock):
    """A state is stale when simulated time has passed without it, and commands arrive at their simulated time."""
    with fake_board(network) as (_, server), connect("/fake", carrier="tcp", network=network) as client:
        publish(server, stepped)
        stepped.sleep(0.49)
        assert client.encoder_times().tolist() == [100.0] * 3
        stepped.sleep(0.02)
        with pytest.raises(StaleStateError, match=r" is 0\.510 s old"):
            client.encoders()
        publish(server, stepped)
        assert client.encoders().tolist() == [0.0] * 3
        client.set_control_modes(ControlMode.POSITION_DIRECT)
        client.set_positions([1.0, 2.0, 3.0])
        assert client.reference_positions().tolist() == [1.0, 2.0, 3.0]


# Opening and closing ------------------------------------------------------------------------------------------------


def test_it_opens_three_ports_and_leaves_nothing(network: Network):
    """The client's ports have YARP's names; closing unregisters them, and closing again changes nothing."""
    with ScriptedBoard("/board", network) as board:
        before = names(network)
        with client_of(board, network) as client:
            assert names(network) - before == {"/client/rpc:o", "/client/command:o", "/client/stateExt:i"}
            assert client.axes() == 3
            client.close()
            assert names(network) == before
            with pytest.raises(DeviceError, match="board is not open"):
                client.encoders()


@pytest.mark.parametrize("carrier", CARRIERS)
def test_it_is_opened_by_its_type(network: Network, carrier: str):
    """The table of device types has the client; ``carrier`` is used for state and commands, requests use tcp."""
    with ScriptedBoard("/board", network) as board:
        parameters = Property({"remote": board.name, "local": "/client", "carrier": carrier})
        client = make_device("remote_controlboard", parameters, network=network)
        used = {
            source: carrier_of(network, source, target)
            for source, target in (
                ("/client/rpc:o", "/board/rpc:i"),
                ("/client/command:o", "/board/command:i"),
                ("/board/stateExt:o", "/client/stateExt:i"),
            )
        }
        client.close()
    assert used == {"/client/rpc:o": "tcp", "/client/command:o": carrier, "/board/stateExt:o": carrier}


def carrier_of(network: Network, source: str, target: str) -> str:
    """Return the carrier of a connection."""
    found = remote.connection(network, Contact(source), Contact(target))
    assert found is not None
    return as_string(found.find("carrier"))


def test_two_clients_get_names_of_their_own(network: Network):
    """Clients without a given name have different port names."""
    with (
        ScriptedBoard("/board", network) as board,
        connect(board.name, network=network, timeout=10.0) as one,
        connect(board.name, network=network, timeout=10.0) as other,
    ):
        assert one._link.settings.local != other._link.settings.local
        assert one.encoders().tolist() == other.encoders().tolist()


@pytest.mark.parametrize("protocol", ["[prot] 1 8 0 [ok]", "[prot] 2 9 0 [ok]", "[prot] 1 9 [ok]", "[fail]", "hello"])
def test_another_protocol_is_not_spoken(network: Network, protocol: str):
    """A failed opening says why and leaves nothing open; ignoreProtocolCheck tries it all the same."""
    with ScriptedBoard("/board", network, protocol=protocol) as board:
        before = names(network)
        with pytest.raises(DeviceError, match=r"^/board cannot be opened: /board does not speak version 1\.9"):
            connect(board.name, network=network)
        assert names(network) == before
        with client_of(board, network, ignoreProtocolCheck=1) as client:
            assert client.axes() == 3


@pytest.mark.parametrize("missing", ["rpc:i", "command:i", "stateExt:o"])
def test_all_three_connections_are_needed(network: Network, missing: str):
    """A board of which a port is missing cannot be opened, and nothing of the client is left."""
    with ScriptedBoard("/board", network):
        network.names.unregister(f"/board/{missing}")
        before = names(network)
        with pytest.raises(DeviceError, match=rf"^/board cannot be opened: .*/board/{missing}"):
            connect("/board", network=network)
        assert names(network) == before


def test_a_board_without_joints_is_none(network: Network):
    """A board with no joints cannot be opened."""
    with (
        ScriptedBoard("/board", network, axes=0),
        pytest.raises(DeviceError, match=r"^/board cannot be opened: /board says that it has 0 joints"),
    ):
        connect("/board", network=network)


def test_another_board_of_the_same_name_is_not_taken_for_it(network: Network):
    """A board with another number of joints after its restart must be opened again."""
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        client._link.axes = 4
        client._link.rpc._port.remove_output("/board/rpc:i")
        for call in (client.stop, partial(client.set_positions, 0.0, 0)):
            with pytest.raises(NoAnswerError, match=r"/board has 3 joints now, it had 4; open it again$"):
                call()
        assert board.asked == []
        assert board.commands.pending == 0


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ("(local /x)", "remote: it is missing"),
        ("(remote board)", "remote: board is not a port name"),
        ("(remote /board) (carrier pigeon)", "carrier: there is no carrier 'pigeon'"),
        ("(remote /board) (timeout 0)", "timeout: 0 is not a number above 0"),
        ("(remote /board) (writeStrict maybe)", "writeStrict: it is 'on' or 'off', not 'maybe'"),
        ("(remote /board) (local_qos (packet_priority LEVEL:SOME))", "local_qos: packet_priority: 'SOME' is no"),
    ],
)
def test_wrong_parameters_are_named(network: Network, parameters: str, sentence: str):
    """The error begins with the name of the parameter, and no port is opened."""
    with pytest.raises(ConfigurationError, match=f"^{sentence}"):
        RemoteControlBoard("board", network=network).open(Property.parse(parameters))
    assert names(network) == set()


def test_quality_of_service_is_set_at_both_ends(network: Network):
    """The sockets of state and commands have the requested settings, here and at the board."""
    qos = "(local_qos (packet_priority LEVEL:HIGH)) (remote_qos (packet_priority DSCP:AF11))"
    with ScriptedBoard("/board", network) as board:
        client = RemoteControlBoard("board", network=network)
        client.open(Property.parse(f"(remote {board.name}) (local /client) (carrier tcp) {qos}"))
        high, af11 = Qos.of_level("HIGH").tos, Qos.of_dscp("AF11").tos
        for source, target, wanted in (
            ("/board/stateExt:o", "/client/stateExt:i", (af11, high)),
            ("/client/command:o", "/board/command:i", (high, af11)),
        ):
            found = remote.connection_qos(network, Contact(source), Contact(target))
            assert tuple(end.tos for end in found) == wanted
        client.close()


# Boards that misbehave ----------------------------------------------------------------------------------------------


def test_a_refusal_names_board_question_and_joint(network: Network):
    """[fail] is a refusal, [nak] a request that the board does not know."""
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        board.answer = lambda _: Bottle.parse("[fail]")
        with pytest.raises(RefusedError, match=r"^/board refused '\[set\] \[pos\] 1 2\.0', joint 1$"):
            client.position_move(2.0, 1)
        with pytest.raises(RefusedError, match=r"^/board refused '\[get\] \[velg\] 2 \(0 1\)', joints 0 1$"):
            client.reference_speeds([0, 1])
        board.answer = lambda _: Bottle.parse("[nak]")
        with pytest.raises(NotSupportedError, match=r"^/board does not know what '\[set\] \[stos\]' means$"):
            client.stop()


@pytest.mark.parametrize(
    "answer", ["[ok]", "[is] [poss] (1.0 2.0) [tsta] 0 0.0 [ok]", "[is] [poss] (1.0 2.0 hello) [tsta] 0 0.0 [ok]", "1"]
)
def test_nonsense_is_named(network: Network, answer: str):
    """The error of an invalid answer has the request and the answer."""
    with (
        ScriptedBoard("/board", network, answer=lambda _: Bottle.parse(answer)) as board,
        client_of(board, network) as client,
        pytest.raises(NoAnswerError, match=r"^/board answered '\[get\] \[poss\]' with '.*', which is not valid"),
    ):
        client.target_positions()


def test_a_board_that_is_slow_is_given_up_and_asked_again(network: Network):
    """A late answer is dropped; the next request uses a new connection."""
    go_on = threading.Event()

    def slowly(question: Bottle) -> Bottle:
        if question == Bottle.parse("[get] [pos] 0"):
            go_on.wait(10)
        return Bottle.parse(f"[is] [pos] {float(question[2])} {STAMP}")

    with (
        ScriptedBoard("/board", network, answer=slowly) as board,
        client_of(board, network, timeout=10.0) as client,
    ):
        client._link.rpc._limit = 0.2
        with pytest.raises(NoAnswerError, match=r"^/board did not answer '\[get\] \[pos\] 0': "):
            client.target_positions(0)
        go_on.set()
        client._link.rpc._limit = 10.0
        assert client.target_positions(1).tolist() == [1.0]
        board.publish()
        assert client.encoders().shape == (3,)


def test_a_long_action_delays_no_request(network: Network):
    """While a part is being calibrated its client still answers, and can abort the calibration."""
    ended = threading.Event()

    def calibrate(question: Bottle) -> Bottle:
        if question == Bottle.parse("[set] [reca] [cals]"):
            ended.wait(10)
        elif question == Bottle.parse("[set] [reca] [quca]"):
            ended.set()
        return Bottle.parse("[ok]")

    with (
        ScriptedBoard("/board", network, answer=calibrate) as board,
        client_of(board, network, rpcTimeout=0.5) as client,
    ):
        calibration = threading.Thread(target=client.calibrate_part)
        calibration.start()
        eventually(lambda: board.asked, "the calibration does not begin")
        client.stop()
        client.quit_calibrate()
        calibration.join(10)
        assert board.asked == ["[set] [reca] [cals]", "[set] [stos]", "[set] [reca] [quca]"]


def test_many_threads_of_two_clients_get_their_own_answers(network: Network):
    """Each thread gets the answer to its own request."""

    def echo(question: Bottle) -> Bottle:
        return Bottle.parse(f"[is] [llim] {question[2]} {question[2]} {STAMP}")

    wrong: list[object] = []

    def ask(client: RemoteControlBoard, joint: int) -> None:
        for _ in range(50):
            found = client.limits(joint)
            if found != (joint, joint):
                wrong.append(found)

    with (
        ScriptedBoard("/board", network, answer=echo) as board,
        connect(board.name, network=network) as one,
        connect(board.name, network=network) as other,
    ):
        threads = [threading.Thread(target=ask, args=(client, joint)) for client in (one, other) for joint in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
        assert len(board.asked) == 300
    assert wrong == []
