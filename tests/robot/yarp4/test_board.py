"""Boards of YARP 4.0: recorded answers of real boards, answers of our server, and any other messages."""

from __future__ import annotations

import math
import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from replaying import receive, recordings, segments
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.bottle.binary import decode_from
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import ProtocolVersion, Record, call
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.wire import framing
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import (
    DeviceError,
    NoAnswerError,
    NotSupportedError,
    RefusedError,
    RobotError,
    StaleStateError,
)
from rtf.robot.forwarded_board import ForwardedBoard
from rtf.robot.interfaces import (
    CalibrationParameters,
    IAxisInfo,
    IRemoteVariables,
    JointType,
    MotorTorqueParameters,
    Pid,
    PidType,
)
from rtf.robot.network.outlets import PipelinedOutlets
from rtf.robot.publishing import PeriodicPublishing
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot.yarp4 import values as kinds
from rtf.robot.yarp4.client import ControlBoardServiceClient
from rtf.robot.yarp4.functions import Message
from rtf.robot.yarp4.rpc import ServiceRpc
from rtf.robot.yarp4.server import BoardService
from rtf.robot.yarp4.table import BY_NAME, INTERFACES, MESSAGES
from rtf.robot.yarp4.values import RETURN_VALUE, Kind, ReturnValue, read_all, write_all
from waiting import eventually

from ..contract import ControlBoardContract
from ..sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.device import Device

PART = "/robot/arm"
#: The port of the board's service in the recordings, as each connecting client is told.
RECORDED_PORT = 10008


def described(joints: int = 4, limits: tuple[float, float] = (-95.0, 10.0)) -> Property:
    """Return the configuration of a board of so many joints."""
    least, greatest = (" ".join([str(limit)] * joints) for limit in limits)
    variables = "(VARIABLES (kinematic_mj (1.0 0.0 0.0 1.0)))"
    return Property.parse(f"(GENERAL (Joints {joints})) (LIMITS (Min ({least})) (Max ({greatest}))) {variables}")


def opened(joints: int = 4, limits: tuple[float, float] = (-95.0, 10.0)) -> FakeBoard:
    """A board of so many joints."""
    board = FakeBoard("fake")
    board.open(described(joints, limits))
    return board


def connected(network: Network, **parameters: object) -> ControlBoardServiceClient:
    """A client of the served board, by tcp unless the parameters have another carrier."""
    client = ControlBoardServiceClient("client", network=network)
    client.open(Property({"remote": PART, "local": "/client", **(parameters or {"carrier": "tcp"})}))
    return client


class Link(NamedTuple):
    """A client, the board that it is connected with, and their time."""

    time: ManualClock
    board: FakeBoard
    server: ControlBoardServer
    client: ControlBoardServiceClient


@pytest.fixture(scope="class")
def link(shared_time: ManualClock, shared_network: Network) -> Iterator[Link]:
    """One client and board for all tests."""
    board, outlets = opened(), PipelinedOutlets()
    with (
        closing(
            ControlBoardServer(board, PART, network=shared_network, outlets=outlets, protocols=[Dialect.YARP4])
        ) as server,
        closing(connected(shared_network)) as client,
    ):
        yield Link(shared_time, board, server, client)


class TestServedBoard(ControlBoardContract):
    """A board at the other end of the service keeps the contract."""

    @pytest.fixture
    def board(self, link: Link) -> Device:
        """The client of a board in its initial state; no fresh state has arrived yet."""
        self.link = link
        link.board.open(described())
        link.time.sleep(1.0)
        return link.client

    def advance(self, seconds: float) -> None:
        """See ControlBoardContract."""
        time, _, server, _ = self.link
        time.sleep(seconds)
        server.publish(time.now())
        server.settle()


# The bytes ------------------------------------------------------------------------------------------------------------

RECORDED = recordings("4.0.0", "robot.json")["questions"]


def of_the_board() -> list[Any]:
    """Return the recorded conversations with the board's service."""
    return [talk for talk in RECORDED if bytes.fromhex(talk[1][1]) == framing.yarp_number(RECORDED_PORT)]


def test_recorded_questions_are_answered_as_recorded(network: Network):
    """Our board answers the recorded requests with the same bytes as the real one."""
    talks = of_the_board()
    assert len(talks) > 10
    with closing(ControlBoardServer(opened(16), PART, network=network, protocols=[Dialect.YARP4])):
        contact = network.names.query(f"{PART}/nws/rpc:i")
        assert contact is not None
        for talk in map(segments, talks):
            with socket.create_connection((contact.host, contact.port), timeout=10) as connection:
                for number, (way, data) in enumerate(talk):
                    if way == ">":
                        connection.sendall(data)
                    else:
                        wanted = framing.yarp_number(contact.port) if number == 1 else data
                        assert receive(connection, len(data)) == wanted


OK = "00 01 00 00 01 00 00 00 09 00 00 00 6f 6b 00 00"
FAILED = "09 01 00 00 01 00 00 00 66 61 69 6c"
VERIFIED = [
    ("getAxesRPC", f"00 01 00 00 02 00 00 00 {OK} 01 00 00 00 02 00 00 00"),
    (
        "getPosLimitsRPC 0",
        f"00 01 00 00 03 00 00 00 {OK} 14 00 00 00 00 00 00 00 00 00 00 00 14 00 00 00 00 00 00 00 00 00 59 40",
    ),
    ("setControlModeOneRPC 0 [posd]", OK),
    ("setControlModeOneRPC 0 1685286768", OK),
    ("getEncodersAllRPC", FAILED),
    ("setControlModeOneRPC 0 pos", FAILED),
    ("positionMoveOneRPC 0", FAILED),
    ("getAxesRPC 1", FAILED),
]


def bytes_of(answer: object) -> bytes:
    """Return the bytes of an answer."""
    return b"".join(codec_of(answer).encode(answer, Dialect.YARP4))


@pytest.mark.parametrize(("question", "answer"), VERIFIED)
def test_answers_have_the_bytes_of_real_boards(network: Network, question: str, answer: str):
    """The code is a list of its own, and the results follow it; a code without results is not in another list."""
    service = BoardService(opened(2, (0.0, 100.0)), PART, network=network)
    assert bytes_of(service.answer(Bottle.parse(question))).hex(" ") == answer


def test_all_interfaces_are_listed(network: Network):
    """The answer has all 23 interfaces, also those that the board lacks."""
    service = BoardService(opened(), PART, network=network)
    answer = decode_from(bytes_of(service.answer(Bottle(["getDeviceInterfacesRPC"]))), 0, Dialect.YARP4)[0]
    assert answer[0] == Bottle([Vocab("ok")])
    assert isinstance(answer[1], Bottle)
    answers = {entry[0]: entry[1] for entry in answer[1]}
    assert len(answers) == 23
    assert [*answers] == sorted(answers)
    assert answers["iEncodersTimed"] == Vocab("ok")
    assert answers["iJointBrake"] == Vocab("fail")


def test_pids_travel_in_an_order_of_their_own(network: Network):
    """The scale and the greatest output are before the offset, unlike in YARP 3."""
    board = opened()
    board.set_pid(PidType.POSITION, 0, Pid(1, 2, 3, 4, 6, 7, 5, 8, 9, 10))
    answer = BoardService(board, PART, network=network).answer(Bottle(["getPidRPC", Vocab("pos"), 0]))
    assert Bottle(np.arange(1.0, 11.0)).to_text() in decode_from(bytes_of(answer), 0, Dialect.YARP4)[0].to_text()
    head = bytes.fromhex("00 01 00 00 0a 00 00 00 14 00 00 00 00 00 00 00 00 00 f0 3f 14 00 00 00")
    assert head in bytes_of(answer)


def test_questions_are_never_abbreviated():
    """Each element of a request has its type code, as generated services expect."""
    asked = b"".join(codec_of(call("getAxesRPC")).encode(call("getAxesRPC"), Dialect.YARP4))
    assert asked.hex(" ") == "00 01 00 00 01 00 00 00 04 00 00 00 0a 00 00 00 67 65 74 41 78 65 73 52 50 43"


RECORDED_ANSWERS = [
    ("getAxesRPC", (), 16),
    ("getPosLimitsRPC", (0,), (-95.0, 10.0)),
    ("getAxisNameRPC", (0,), "joint0"),
]


@pytest.mark.parametrize(("function", "arguments", "result"), RECORDED_ANSWERS)
def test_recorded_answers_are_understood(
    network: Network, function: str, arguments: tuple[object, ...], result: object
):
    """Our client decodes the answers of a real board."""
    [answer] = [
        data
        for talk in map(segments, of_the_board())
        for (_, question), (_, data) in [talk[2:4]]
        if b"help" not in question and function.encode() in question
    ]
    recorded = decode_from(answer, 0, Dialect.YARP4)[0]
    with answering(network, recorded) as rpc:
        assert rpc.call(BY_NAME[function], *arguments) == result


@contextmanager
def answering(network: Network, answer: object) -> Iterator[ServiceRpc]:
    """Return a connection to a board with always the same answer."""
    network = network.in_dialect(Dialect.YARP4)
    with (
        RpcServer(f"{PART}/nws/rpc:i", lambda _: answer, network=network),
        closing(ServiceRpc("/rpc", PART, network=network, limit=10.0, remade=lambda: None)) as rpc,
    ):
        rpc.reconnect()
        yield rpc


# The table ------------------------------------------------------------------------------------------------------------


def test_every_row_names_what_exists():
    """Function names are unique, and each row names an existing method of its interface."""
    assert len({message.name for message in MESSAGES}) == len(MESSAGES) == 193
    for message in MESSAGES:
        if message.method:
            assert callable(getattr(message.interface, message.method)), message.name
        assert message.interface in (None, object, *INTERFACES.values()), message.name


NUMBERS = st.floats(allow_nan=False)
PIDS = st.builds(Pid, *[NUMBERS] * 10)
PID_INFOS = st.lists(st.text(max_size=5), min_size=13, max_size=13)
BOTTLES = st.lists(st.one_of(st.integers(0, 9), st.text(max_size=5)), max_size=3).map(Bottle)


def some(of: st.SearchStrategy[Any]) -> st.SearchStrategy[list[Any]]:
    """Return lists of values."""
    return st.lists(of, max_size=5)


#: Possible values of each kind.
VALUES: tuple[tuple[Kind, st.SearchStrategy[Any]], ...] = (
    (kinds.AXIS, st.integers(-(2**31), 2**31 - 1)),
    (kinds.AXIS16, st.integers(-(2**15), 2**15 - 1)),
    (kinds.NUMBER, NUMBERS),
    (kinds.TRUTH, st.booleans()),
    (kinds.TEXT, st.text(max_size=20)),
    (kinds.AXES, some(st.integers(-(2**31), 2**31 - 1))),
    (kinds.NUMBERS, some(NUMBERS)),
    (kinds.BOTTLE, BOTTLES),
    (kinds.BOTTLES, some(BOTTLES)),
    (kinds.TRUTHS, st.dictionaries(st.text(max_size=8), st.booleans(), max_size=4)),
    (kinds.MODE, st.sampled_from(ControlMode)),
    (kinds.MODES, some(st.sampled_from(ControlMode))),
    (kinds.INTERACTION, st.sampled_from(InteractionMode)),
    (kinds.INTERACTIONS, some(st.sampled_from(InteractionMode))),
    (kinds.JOINT_TYPE, st.sampled_from(JointType)),
    (kinds.PID_TYPE, st.sampled_from(PidType)),
    (kinds.PID_TYPES, some(st.sampled_from(PidType))),
    (kinds.PID, PIDS),
    (kinds.PIDS, some(PIDS)),
    (kinds.PID_INFO, PID_INFOS),
    (kinds.PID_INFOS, some(PID_INFOS)),
    (kinds.CALIBRATION, st.builds(CalibrationParameters, st.integers(0, 20), *[NUMBERS] * 6)),
    (kinds.TORQUE_PARAMETERS, st.builds(MotorTorqueParameters, *[NUMBERS] * 9)),
)


def value_of(kind: Kind) -> st.SearchStrategy[Any]:
    """Return values of a kind."""
    return next(strategy for known, strategy in VALUES if known is kind)


@pytest.mark.fuzz
@given(st.data())
def test_what_is_written_is_read(data: st.DataObject):
    """Arguments and results of every function are the same after encoding and decoding."""
    message = data.draw(st.sampled_from(MESSAGES))
    for row in (message.takes, message.gives):
        sent = [data.draw(value_of(kind)) for kind in row]
        written = bytes_of(Record(*write_all(row, sent)))
        assert read_all(row, decode_from(written, 0, Dialect.YARP4)[0]) == sent


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.name)
def test_a_failure_can_be_read_as_well(message: Message):
    """An error answer has the usual number of elements, so that the client can decode it."""
    written = bytes_of(Record(*write_all(message.gives, [kind.default for kind in message.gives])))
    assert len(read_all(message.gives, decode_from(written, 0, Dialect.YARP4)[0])) == len(message.gives)


@given(st.sampled_from(ReturnValue), st.sampled_from(Dialect))
def test_codes_travel_in_both_dialects(value: ReturnValue, dialect: Dialect):
    """A code is a list of a word in 4.0, and a number without a list in 3.12."""
    written = b"".join(RETURN_VALUE.encode(value, dialect))
    assert RETURN_VALUE.decode_from(written, dialect) == (value, len(written))
    assert RETURN_VALUE.from_text(RETURN_VALUE.to_text(value)) is value
    if dialect is Dialect.YARP3:
        assert written == b"\1\0\0\0" + value.number.to_bytes(4, "little")


# Devices that fail ----------------------------------------------------------------------------------------------------


class Scripted(ForwardedBoard):
    """A board of two axes whose methods all call ``does``."""

    def __init__(self, does: Any) -> None:
        self.does = does

    def axes(self) -> int:
        """See IAxisInfo."""
        return 2

    def forward_reading(self, *_: object, **__: object) -> Any:
        """See ForwardedBoard."""
        return self.does()

    forward_setting = forward_action = forward_single = forward_whole = forward_reading


def raising(error: Exception) -> Scripted:
    """Return a board whose methods raise this error."""

    def fail() -> None:
        raise error

    return Scripted(fail)


@pytest.mark.parametrize(
    ("error", "code", "here"),
    [
        (RefusedError("no"), "err5", RefusedError),
        (NotSupportedError("no"), "err2", NotSupportedError),
        (StaleStateError("old"), "err6", StaleStateError),
        (NoAnswerError("gone"), "err3", NoAnswerError),
        (DeviceError("broken"), "err5", RefusedError),
        (ZeroDivisionError("oops"), "err1", RefusedError),
    ],
    ids=str,
)
def test_errors_of_the_device_reach_the_client(
    network: Network, said: list[str], error: Exception, code: str, here: type[RobotError]
):
    """Each error is the same at the client; one that is not a RobotError is reported at the server."""
    service = BoardService(raising(error), PART, network=network)
    for question in ("stopOneRPC 0", "getTrajSpeedOneRPC 0"):
        answer = service.answer(Bottle.parse(question))
        assert code in decode_from(bytes_of(answer), 0, Dialect.YARP4)[0].to_text()
        with answering(network, answer) as rpc, pytest.raises(here):
            rpc.call(BY_NAME[question.split()[0]], 0)
    assert bool(said) == isinstance(error, ZeroDivisionError)


def test_a_device_that_gives_nonsense_is_reported(network: Network, said: list[str]):
    """A result that cannot be encoded is reported as an error of the device."""
    service = BoardService(Scripted(lambda: "nonsense"), PART, network=network)
    answer = decode_from(bytes_of(service.answer(Bottle.parse("getPosLimitsRPC 0"))), 0, Dialect.YARP4)[0]
    assert answer.to_text() == "([err1]) 0.0 0.0"
    assert "getPosLimitsRPC failed" in said[0]


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("isJointBrakedRPC 0", "([err2]) [fail]"),
        ("setRefVelocityOneRPC 0 1.0", "[err2]"),
        ("getPidExtraInfosRPC [pos]", "([err2]) ()"),
        ("getRemoteVariableRPC x", "([err5]) ()"),
        ("setControlModeOneRPC 0 77", "[err5]"),
        ("positionMoveOneRPC 0 far", "[fail]"),
    ],
)
def test_what_a_board_lacks(network: Network, question: str, answer: str):
    """Functions of no device, of a missing interface, and unknown functions have different answers."""
    service = BoardService(Scripted(lambda: None), PART, network=network)
    given = service.answer(Bottle.parse(question))
    assert decode_from(bytes_of(given), 0, Dialect.YARP4)[0].to_text() == answer


def test_what_is_no_number_moves_nothing(network: Network):
    """Infinity and NaN do not reach the device, alone, in a list or in a PID."""
    service = BoardService(raising(AssertionError("it was called")), PART, network=network)
    for question in (
        Bottle(["positionMoveOneRPC", 0, math.nan]),
        Bottle(["positionMoveAllRPC", Bottle([1.0, math.inf])]),
        Bottle(["setPidRPC", Vocab("pos"), 0, Bottle([math.nan] * 10)]),
    ):
        assert service.answer(question) is ReturnValue.METHOD_FAILED


# Any messages of a peer -----------------------------------------------------------------------------------------------

WORDS = st.recursive(
    st.one_of(
        st.integers(-(2**63), 2**63 - 1),
        st.floats(),
        st.text(max_size=8),
        st.binary(max_size=8),
        st.sampled_from(["ok", "fail", "err5", "pos", "miss", "zzz"]).map(Vocab),
    ),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=12,
)
ANYTHING = st.lists(WORDS, max_size=6).map(Bottle)
FUNCTIONS = st.sampled_from([message.name for message in MESSAGES])
CALLS = st.builds(lambda name, rest: Bottle([name, *rest]), st.one_of(FUNCTIONS, st.just("help")), ANYTHING)


@pytest.mark.fuzz
@settings(max_examples=60, deadline=None)
@given(st.one_of(ANYTHING, CALLS))
def test_any_question_is_answered(question: Bottle):
    """The answer is results, a code or [fail], can be encoded, and no exception escapes."""
    said: list[str] = []
    service = BoardService(opened(2), PART, network=Network(LocalNames(), report=said.append))
    assert bytes_of(service.answer(question))
    assert not said


@pytest.mark.fuzz
@settings(max_examples=75, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    answer=st.one_of(ANYTHING, ANYTHING.map(lambda rest: Bottle([[Vocab("ok")], *rest]))),
    message=st.sampled_from(MESSAGES),
)
def test_any_answer_is_a_result_or_an_error_of_robots(network: Network, answer: Bottle, message: Message):
    """Any answer to any request gives a value or a RobotError."""
    with answering(network, answer) as rpc:
        try:
            rpc.call(message, *(kind.default for kind in message.takes))
        except RobotError:
            return


# Clients and servers --------------------------------------------------------------------------------------------------


@contextmanager
def publishing(network: Network, device: Device, *protocols: Dialect) -> Iterator[ControlBoardServer]:
    """Serve a board, and publish its state periodically within the block."""
    protocols = protocols or (Dialect.YARP4,)
    with closing(ControlBoardServer(device, PART, network=network, period=0.005, protocols=protocols)) as server:
        thread = PeriodicPublishing(server, name=PART, report=network.report)
        try:
            yield server
        finally:
            thread.stop()


@pytest.mark.parametrize("dialect", Dialect, ids=lambda dialect: dialect.name)
def test_both_styles_of_clients_are_served_at_once(network: Network, dialect: Dialect):
    """Clients of YARP 3 and 4.0 of the same board send requests and commands, and read its state."""
    network.dialect = dialect
    board = opened()
    with (
        publishing(network, board, Dialect.YARP3, Dialect.YARP4),
        closing(connected(network)) as four,
        closing(RemoteControlBoard("three", network=network)) as three,
    ):
        three.open(Property({"remote": PART, "local": "/three", "carrier": "tcp", "timeout": 10.0}))
        four.set_reference_speeds(7.5, 1)
        assert three.reference_speeds(1) == pytest.approx([7.5])
        three.set_control_modes(ControlMode.POSITION_DIRECT, 1)
        eventually(lambda: four.control_mode(1) is ControlMode.POSITION_DIRECT, "the mode is not seen")
        four.set_positions([-3.5], [1])
        eventually(lambda: three.reference_positions(1) == pytest.approx([-3.5]), "the position did not arrive")
        eventually(lambda: three.encoder(1) == four.encoder(1) == pytest.approx(-3.5), "it is not seen")


def test_a_service_speaks_its_dialect_whatever_the_network_does(network: Network):
    """Numbers of the service are right in a network of YARP 3, too, also by fast_tcp."""
    network.dialect = Dialect.YARP3
    with publishing(network, opened()), closing(connected(network, timeout=1.0)) as client:
        assert client.limits(0) == (-95.0, 10.0)
        client.position_move([-1.0, -2.0, -3.0, -4.0])
        assert client.target_positions([2, 0]) == pytest.approx([-3.0, -1.0])
        assert network.dialect is Dialect.YARP3
        [output] = client._link.stream._port.outputs
        assert output.carrier == "fast_tcp"


def test_ports_have_the_names_of_yarp(network: Network):
    """The ports have the names of YARP 4.0, and there is no port for requests of YARP 3."""
    with publishing(network, opened()), closing(connected(network)):
        for name in ("nws/rpc:i", "command:i", "state:o", "stateExt:o"):
            assert network.names.query(f"{PART}/{name}") is not None
        for name in ("nwc/rpc:o", "command:o", "stateExt:i"):
            assert network.names.query(f"/client/{name}") is not None
        assert network.names.query(f"{PART}/rpc:i") is None


def test_clients_may_ask_for_the_version(network: Network):
    """Real clients ask for the version before anything else."""
    with publishing(network, opened()), RpcClient("/rpc", f"{PART}/nws/rpc:i", network=network) as rpc:
        assert rpc.call(call("getRemoteProtocolVersion"), answer=ProtocolVersion.codec) == ProtocolVersion(0, 4, 0, 0)


def test_a_client_of_a_board_that_is_not_there(network: Network):
    """The error names the missing port, and no port stays open."""
    with pytest.raises(DeviceError, match="/robot/arm"):
        connected(network)


def test_a_board_that_is_gone(network: Network):
    """A request raises RobotError, and so does a reading after the timeout."""
    with closing(ControlBoardServiceClient("client", network=network)) as client:
        with publishing(network, opened()):
            client.open(Property({"remote": PART, "carrier": "tcp", "timeout": 0.5}))
            assert client.encoders().shape == (4,)
        with pytest.raises(NoAnswerError):
            client.stop()
        eventually(lambda: is_stale(client), "an old state is given")


def is_stale(client: ControlBoardServiceClient) -> bool:
    """Return whether the state is stale."""
    try:
        client.encoders()
    except StaleStateError:
        return True
    return False


def test_a_client_that_is_not_open():
    """A client that is not open raises an error that says so."""
    with pytest.raises(DeviceError, match="not open"):
        ControlBoardServiceClient("client").encoders()


def test_a_device_without_axes_is_not_served(network: Network):
    """A device without IAxisInfo is refused."""
    with pytest.raises(NotSupportedError, match="IAxisInfo"):
        ControlBoardServer(object(), PART, network=network)


def test_variables_travel(network: Network):
    """Remote variables can be listed, read and set."""
    with publishing(network, opened()), closing(connected(network)) as client:
        assert client.variables() == ("kinematic_mj",)
        assert client.variable("kinematic_mj").to_text() == "(1.0 0.0 0.0 1.0)"
        client.set_variable("kinematic_mj", Bottle([2.0]))
        assert client.variable("kinematic_mj").to_text() == "2.0"
        assert client.view(IRemoteVariables) is client.view(IAxisInfo)


class Dawdling(Scripted):
    """A board whose slow actions last until the test ends them."""

    def __init__(self) -> None:
        super().__init__(lambda: 1.5)
        self.begun, self.end = threading.Event(), threading.Event()

    def forward_whole(self, *_: object) -> None:
        """See ForwardedBoard."""
        self.begun.set()
        assert self.end.wait(10)


def test_a_slow_action_delays_no_request(network: Network):
    """A client answers other requests while it waits for the calibration of a part."""
    board = Dawdling()
    with publishing(network, board), closing(connected(network)) as client, ThreadPoolExecutor(1) as pool:
        calibrating = pool.submit(client.calibrate_part)
        try:
            assert board.begun.wait(10)
            assert client.max_current(0) == 1.5
            assert not calibrating.done()
        finally:
            board.end.set()
        assert calibrating.result(10) is None


def test_parameters_that_do_not_travel_are_refused(network: Network):
    """A calibration with parameters that the protocol does not transmit is refused."""
    with publishing(network, opened()), closing(connected(network)) as client:
        client.calibrate_axis(0, CalibrationParameters(3, 1.0, 2.0, 3.0))
        with pytest.raises(RefusedError, match="three parameters"):
            client.calibrate_axis(0, CalibrationParameters(3, 1.0, 2.0, 3.0, 4.0))
