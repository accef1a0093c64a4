"""Server and client of Cartesian control against each other, and the server against the protocol of the original."""

from __future__ import annotations

import math
import threading
from contextlib import closing
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replaying import VERSIONS
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.cartesian.client import CartesianClient
from rtf.robot.cartesian.requests import TABLE, TRUTH
from rtf.robot.cartesian.server import CartesianServer
from rtf.robot.device import make_device
from rtf.robot.errors import DeviceError, NoAnswerError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.interfaces import ControllerEvent, ICartesianControl
from rtf.robot.network.request_table import ACK
from waiting import eventually

from .scripted_controller import ScriptedController

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

    from ..sensor_bench import ManualClock

NAME = "/bot/cartesianController/left_arm"
#: ``[go] [xyz] 0.0 (-0.4 0 0)`` on the wire.
_GO = (
    "00010000 04000000 09000000 676f0000 09000000 78797a00 0a000000 00000000 00000000 "
    "0a010000 03000000 9a999999 9999d9bf 0000000000000000 0000000000000000"
)
POSE = [-0.25, 0.1, 0.2, 0.0, 1.0, 0.0, math.pi / 2]


@pytest.fixture(params=VERSIONS.values(), ids=VERSIONS)
def spoken(request: pytest.FixtureRequest, network: Network) -> Network:
    """The network in each dialect."""
    return network.in_dialect(request.param)


@pytest.fixture
def control(stepped: ManualClock) -> ScriptedController:
    """The controller behind the server."""
    assert stepped.time == 100.0
    return ScriptedController()


@pytest.fixture
def server(spoken: Network, control: ScriptedController) -> Iterator[CartesianServer]:
    """The server."""
    with closing(CartesianServer(control, NAME, network=spoken)) as served:
        yield served


def connected(network: Network) -> CartesianClient:
    """A client of the server."""
    made = make_device("cartesiancontrollerclient", Property({"remote": NAME, "carrier": "tcp"}), network=network)
    assert isinstance(made, CartesianClient)
    return made


@pytest.fixture
def client(spoken: Network, server: CartesianServer) -> Iterator[CartesianClient]:
    """A client of the server."""
    assert server.name == NAME
    with closing(connected(spoken)) as made:
        yield made


@pytest.fixture
def peer(spoken: Network, server: CartesianServer) -> Iterator[RpcClient]:
    """A program that writes requests by hand."""
    with RpcClient("", f"{server.name}/rpc:i", network=spoken) as made:
        yield made


def test_every_setting_goes_there_and_back(client: CartesianClient, control: ScriptedController):
    """What the client sets, the controller has, and the client reads."""
    for name, value in (
        ("trajectory_time", 1.25),
        ("tolerance", 0.002),
        ("tracking", True),
        ("tracking", False),
        ("reference_feedback", True),
        ("priority", "orientation"),
        ("tweaks", Bottle.parse("(straightness 0.1) (tol 0.01)")),
    ):
        getattr(client, f"set_{name}")(value)
        assert getattr(control, name)() == value, name
        assert getattr(client, name)() == value, name
    client.set_tip(POSE)
    assert client.tip().tolist() == control.tip().tolist() == POSE
    client.set_limits(2, -10.0, 20.5)
    assert client.limits(2) == control.limits(2) == (-10.0, 20.5)


def test_lists_of_joints_may_be_short(client: CartesianClient):
    """Only the first joints change, or those that are not None; the reply has all."""
    assert client.active_joints() == (False,) * 3 + (True,) * 7
    assert client.set_active_joints([True, None, True]) == (True, False, True) + (True,) * 7
    assert client.set_rest_posture([10, 20]).tolist() == [10, 20, *[0] * 8]
    assert client.set_rest_weights([0.5]).tolist() == [0.5, *[0] * 9]
    assert client.rest_weights().tolist() == [0.5, *[0] * 9]


def test_motions(client: CartesianClient, control: ScriptedController):
    """Poses, positions and velocities arrive as they are given, by request and by stream."""
    client.go_to(POSE, 1.5)
    assert not client.motion_done()
    client.go_to(POSE[:3])
    client.stop()
    assert client.motion_done()
    client.stream_target(POSE)
    client.stream_target(POSE[:3], 0.5)
    client.stream_velocity([0.01, 0, 0, 0, 0, 1, 0.1])
    eventually(lambda: len(control.said) == 6, "a streamed command did not arrive")
    assert control.said == [
        ("go", POSE, 1.5),
        ("go", POSE[:3], None),
        ("stop",),
        ("stream", POSE, None),
        ("stream", POSE[:3], 0.5),
        ("velocity", [0.01, 0, 0, 0, 0, 1, 0.1]),
    ]


def test_questions(client: CartesianClient, control: ScriptedController):
    """The solver's answer, the aim, the velocities and the frames of links."""
    found = client.ask(POSE, range(7))
    assert (found.pose.tolist(), found.joints.tolist()) == (POSE, [*range(7)])
    assert client.ask(POSE[:3]).joints.tolist() == [0.0] * 10
    assert client.desired().joints.tolist() == [*range(10)]
    assert client.joint_velocities().tolist() == [*range(7)]
    assert client.task_velocity()[4] == 0.5
    assert client.pose(3).vector.tolist() == [3.0] * 7
    assert client.pose(3).time == control.present.time
    assert client.info().to_text() == Bottle.parse(control.text)[0].to_text()


def test_the_pose_is_streamed(
    client: CartesianClient, server: CartesianServer, control: ScriptedController, stepped: ManualClock
):
    """The pose comes with the time of its stamp, only while there is a solver; an old one is not shown."""
    with pytest.raises(StaleStateError, match="no message has arrived"):
        client.pose()
    server.publish(stepped.now())
    eventually(lambda: client._streams["state"].latest is not None, "no pose arrived")
    assert client.pose().vector.tolist() == control.present.vector.tolist()
    assert client.pose().time == 100.25
    stepped.sleep(0.5)
    control.solver = False
    server.publish(stepped.now())
    with pytest.raises(StaleStateError, match=r"more than the allowed 0\.1 s"):
        client.pose()


def test_events(client: CartesianClient, control: ScriptedController):
    """Every event arrives, in its order."""
    found: list[ControllerEvent] = []
    client.observe_events(found.append)
    control.happen("motion-onset", 100.5)
    control.happen("motion-ongoing", 100.75, 0.5)
    control.happen("motion-done", 101.0)
    eventually(lambda: len(found) == 3, "an event did not arrive")
    assert found == [("motion-onset", 100.5, None), ("motion-ongoing", 100.75, 0.5), ("motion-done", 101.0, None)]
    client.unobserve_events(found.append)


def test_an_observer_that_raises_is_removed(client: CartesianClient, control: ScriptedController, said: list[str]):
    """With a report; all other observers get that event and the later ones."""
    found: list[ControllerEvent] = []

    def fail(event: ControllerEvent) -> None:
        raise ValueError(f"{event.name} is not known")

    client.observe_events(fail)
    client.observe_events(found.append)
    control.happen("motion-onset", 100.5)
    control.happen("motion-done", 101.0)
    eventually(lambda: len(found) == 2, "an event did not arrive")
    assert [event.name for event in found] == ["motion-onset", "motion-done"]
    removed = "an observer of events was removed, because it raised ValueError: motion-onset is not known"
    assert [removed in sentence for sentence in said if "observer" in sentence] == [True]


def test_a_server_that_closes_says_so(spoken: Network, control: ScriptedController):
    """The last event is ``closing``; requests fail from then on, and the client closes."""
    found: list[ControllerEvent] = []
    server = CartesianServer(control, NAME, network=spoken)
    with closing(connected(spoken)) as client:
        client.observe_events(found.append)
        server.close()
        eventually(lambda: [event.name for event in found] == ["closing"], "the server did not say so")
        with pytest.raises(NoAnswerError):
            client.motion_done()


def test_contexts_and_checkpoints_go_with_their_client(
    spoken: Network, server: CartesianServer, control: ScriptedController
):
    """A client that closes deletes its contexts, if it has any, and takes back its checkpoints."""
    assert server.name == NAME
    with closing(connected(spoken)) as client:
        first, second = client.store_context(), client.store_context()
        client.set_trajectory_time(5.0)
        client.restore_context(first)
        assert client.trajectory_time() == 2.0
        client.delete_contexts([first])
        with pytest.raises(RefusedError):
            client.restore_context(first)
        client.add_checkpoint(0.25)
        client.add_checkpoint(0.25)
        assert client.checkpoints().tolist() == [0.25, 0.25]
        client.remove_checkpoint(0.25)
        with pytest.raises(RefusedError):
            client.remove_checkpoint(0.75)
    assert control.said == [("delete", [first]), ("delete", [second])]
    assert control.checkpoints().tolist() == []
    connected(spoken).close()
    assert control.said[2:] == []


def test_a_motion_that_does_not_begin_keeps_nobody_from_stopping_it(
    client: CartesianClient, control: ScriptedController, peer: RpcClient
):
    """Each client of the server has a thread of its own."""
    control.gate.clear()
    waiting = threading.Thread(target=client.go_to, args=(POSE,))
    waiting.start()
    assert peer.call(Bottle.parse("[stop]"), timeout=20) == Bottle.parse("[ack]")
    control.gate.set()
    waiting.join()
    assert control.said == [("stop",), ("go", POSE, None)]


#: What a program asks, one after the other, and what it is answered.
CONVERSATION = (
    ("[get] [ison]", "[ack] [true]"),
    ('"get" "ison"', "[ack] [true]"),
    ("get isonly", "[ack] [true]"),
    ("[get] [mode]", "[ack] [shot]"),
    ("[get] [prio]", "[ack] position"),
    ("[get] [lim] 3", "[ack] -90.0 90.0"),
    ("[get] [lim] 10", "[nack]"),
    ("[set] [lim] 3 -10 95", "[nack]"),
    ("[set] [lim] 3 0", "[nack]"),
    ("[get] [dof]", "[ack] (0 0 0 1 1 1 1 1 1 1)"),
    ("[set] [dof] (1 2 0)", "[ack] (1 0 0 1 1 1 1 1 1 1)"),
    ("[set] [dof]", "[nack]"),
    ("[set] [refe] true", "[nack]"),  # the word is another value than the vocab
    ("[set] [time] 0.01", "[ack]"),
    ("[set] [tol] word", "[nack]"),
    ("[stor]", "[ack] 1"),
    ("[rest]", ""),
    ("[rest] 7", "[nack]"),
    ("[del]", ""),
    ("[del] 5", "[nack]"),
    ("[del] (5 6)", "[ack]"),
    ("[del] ()", "[ack]"),
    ("[even] [regi] [ogoi] 0.5", "[ack]"),
    ("[even] [list] [ogoi]", "[ack] (0.5)"),
    ("[even] [unre] [ogoi] 0.5", "[ack]"),
    ("[even] [unre] [ogoi] 0.5", "[nack]"),
    ("[get] [tip]", "[ack] (0.0 0.0 0.0 0.0 0.0 1.0 0.0)"),
    ("[set] [tip] (0 0 0)", "[nack]"),
    ("[get] [pose] 2", "[ack] (2.0 2.0 2.0 2.0 2.0 2.0 2.0) (0 100.25)"),
    ("[get] [pose]", "[nack]"),
    ("[go] [xyz] 0.0 (-0.3 0 0)", "[ack]"),
    ("[go] [full] 1 (-0.3 0 0 0 0 1 0)", "[ack]"),
    ("[go] [full] 0.0 (-0.3 0 0)", "[nack]"),
    ("[go] [half] 0.0 (-0.3 0 0)", "[nack]"),
    ("[go] [xyz] (-0.3 0 0)", "[nack]"),
    ("[ask] ([xd] (1 2 3)) ([q] (4 5))", "[ack] ([x] (1.0 2.0 3.0 1.0 2.0 3.0 1.0)) ([q] (4.0 5.0))"),
    ("[ask] ([xd] (1 2))", "[nack]"),
    ("[ask]", "[nack]"),
    ("[get]", "[nack]"),
    ("[fly]", "[nack]"),
)


def test_replies_are_those_of_the_original(peer: RpcClient):
    """Words and vocabs are the same, by four characters; what is wrong is refused."""
    for asked, reply in CONVERSATION:
        answer = peer.call(Bottle.parse(asked), timeout=20)
        assert answer is not None
        wanted = Bottle([ACK, Vocab("true")]) if reply == "[ack] [true]" else Bottle.parse(reply)
        assert answer == wanted, f"{asked}: {answer.to_text()}"


def test_bytes_of_the_original():
    """Requests and replies that were seen on the wire have these bytes."""
    for bottle, wanted in (
        (TABLE.request("motion_done"), "09010000020000006765740 0646f6e65"),
        (Bottle([ACK, *TRUTH.write(True)]), "090100000200000061636b0074727565"),
        (Bottle([ACK]), "090100000100000061636b00"),
        (
            TABLE.request("go_to", [-0.4, 0.0, 0.0], None),
            _GO,
        ),
    ):
        assert encode(bottle, Dialect.YARP3).hex() == wanted.replace(" ", "")


def test_invalid_streamed_commands_are_reported(client: CartesianClient, control: ScriptedController, said: list[str]):
    """A command that is none is ignored; the next one counts."""
    for text in ("[fly] (1 2 3)", "[tvel] (1 2 3)", "[go] [xyz] 0.0 (word 0 0)"):
        client.stream("command", Bottle.parse(text))
    client.stream_target(POSE)
    eventually(lambda: control.said == [("stream", POSE, None)], "the valid command did not arrive")
    assert sum("a command is ignored" in sentence for sentence in said) == 3


@pytest.mark.parametrize("numbers", [[1.0, 2.0], [math.nan] * 3, [0, 0, 0, 0, 0, 1, math.inf], [[1, 2, 3]]])
def test_the_client_refuses_what_is_no_target(client: CartesianClient, control: ScriptedController, numbers):
    """Wrong counts, and numbers that are none, are not sent."""
    for method in (client.go_to, client.stream_target, client.stream_velocity, client.ask):
        with pytest.raises(RefusedError):
            method(numbers)
    assert control.said == []


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"solver": False}, DeviceError, "has no solver"),
        ({"text": '((server_version "1.0"))'}, NotSupportedError, "has version '1.0'"),
    ],
)
def test_servers_that_are_no_use(
    spoken: Network, server: CartesianServer, control: ScriptedController, change, error, message: str
):
    """A server without a solver, or of another version, is refused; nothing stays open."""
    assert server.name == NAME
    for name, value in change.items():
        setattr(control, name, value)
    with pytest.raises(error, match=message):
        connected(spoken)


def test_a_server_without_a_version_is_taken(
    spoken: Network, server: CartesianServer, control: ScriptedController, said
):
    """As the original does, with a report."""
    assert server.name == NAME
    control.text = ""
    connected(spoken).close()
    assert any("does not say its version" in sentence for sentence in said)


def test_no_server(network: Network):
    """The error names the port."""
    with pytest.raises(DeviceError, match=f"{NAME}/rpc:i"):
        connected(network)


def test_the_table_has_every_method():
    """Each method of the interface has a request, but those of streamed commands and of observers."""
    others = {"stream_target", "stream_velocity", "observe_events", "unobserve_events"}
    assert set(TABLE.by_key) | others == ICartesianControl.__abstractmethods__
    assert len(TABLE.by_words) == len(TABLE.requests)


VALUES = st.recursive(
    st.one_of(st.integers(-5, 5), st.floats(), st.sampled_from(["x", "true"]), st.sampled_from([ACK])),
    lambda inner: st.lists(inner, max_size=8).map(Bottle),
    max_leaves=12,
)


@given(st.sampled_from([*TABLE.by_words]), st.lists(VALUES, max_size=4))
def test_any_arguments_are_answered(words, values):
    """Whatever follows the words, the answer is a reply or a refusal, and the controller gets what it expects."""
    server = CartesianServer.__new__(CartesianServer)
    server.name, server.task = NAME, ScriptedController()
    try:
        reply = server.answer(Bottle([*words, *values]))
    except RefusedError:
        return
    assert reply.elements()[:1] in ([], [ACK])
