"""Server and client of gaze control against each other, and the server against the protocol of the original."""

from __future__ import annotations

import math
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replaying import VERSIONS
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.device import make_device
from rtf.robot.errors import DeviceError, NotSupportedError, RefusedError, StaleStateError
from rtf.robot.gaze.client import GazeClient
from rtf.robot.gaze.requests import TABLE, TARGETS, target_elements
from rtf.robot.gaze.server import GazeServer
from rtf.robot.interfaces import (
    ControllerEvent,
    FixationPoint,
    GazeAngles,
    IGazeControl,
    MonoPixel,
    MonoPixelWithVergence,
    StereoPixels,
)
from rtf.robot.network.request_table import ACK
from waiting import eventually

from .scripted_gaze import POSE, RESULTS, ScriptedGaze

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

    from ..sensor_bench import ManualClock

NAME = "/iKinGazeCtrl"
_SETTINGS = sorted(name.removeprefix("set_") for name in IGazeControl.__abstractmethods__ if name.startswith("set_"))


@pytest.fixture(params=VERSIONS.values(), ids=VERSIONS)
def spoken(request: pytest.FixtureRequest, network: Network) -> Network:
    """The network in each dialect."""
    return network.in_dialect(request.param)


@pytest.fixture
def control(stepped: ManualClock) -> ScriptedGaze:
    """The controller behind the server."""
    assert stepped.time == 100.0
    return ScriptedGaze()


@pytest.fixture
def server(spoken: Network, control: ScriptedGaze) -> Iterator[GazeServer]:
    """The server."""
    with closing(GazeServer(control, NAME, network=spoken)) as served:
        yield served


def connected(network: Network) -> GazeClient:
    """A client of the server."""
    made = make_device("gazecontrollerclient", Property({"remote": NAME, "carrier": "tcp"}), network=network)
    assert isinstance(made, GazeClient)
    return made


@pytest.fixture
def client(spoken: Network, server: GazeServer, control: ScriptedGaze) -> Iterator[GazeClient]:
    """A client of the server."""
    assert server.name == NAME
    with closing(connected(spoken)) as made:
        control.said.clear()
        yield made


@pytest.fixture
def peer(spoken: Network, server: GazeServer) -> Iterator[RpcClient]:
    """A program that writes requests by hand."""
    with RpcClient("", f"{server.name}/rpc", network=spoken) as made:
        yield made


#: Another value of each setting.
OTHERS = {bool: lambda value: not value, float: lambda value: value + 0.5, Bottle: lambda _: Bottle.parse("((a 1))")[0]}


def test_every_setting_goes_there_and_back(client: GazeClient, control: ScriptedGaze):
    """What is set arrives, and is what is reported from then on."""
    for name in _SETTINGS:
        before = getattr(client, name)()
        assert before == RESULTS[name]
        value = OTHERS[type(before)](before)
        getattr(client, f"set_{name}")(value)
        assert getattr(client, name)() == value
        assert (f"set_{name}", value) in control.said


TARGETS_OF_EACH_KIND = (
    GazeAngles(10.0, -5.0, 7.5),
    GazeAngles(10.0, -5.0, 7.5, relative=True),
    MonoPixel("left", 160.0, 120.5, 0.5),
    MonoPixelWithVergence("right", 160.0, 120.5, 5.0),
    StereoPixels((160.0, 120.5), (150.0, 121.5)),
)


def test_every_kind_of_target(client: GazeClient, control: ScriptedGaze):
    """Each arrives by a request, as a command without an answer, and in the question which point it is."""
    for target in TARGETS_OF_EACH_KIND:
        client.look_at(target)
        assert client.point_of(target).tolist() == [-0.5, 0.125, 0.25]
        assert control.said == [("look_at", target), ("point_of", target)]
        client.stream_target(target)
        eventually(lambda: len(control.said) == 3, "the command did not arrive")
        assert control.said.pop() == ("stream_target", target)
        control.said.clear()
    client.look_at(FixationPoint([-0.5, 0.125, 0.25]))
    [(method, target)] = control.said
    assert (method, target.point.tolist()) == ("look_at", [-0.5, 0.125, 0.25])
    client.stream_target(FixationPoint([-0.25, 0.0, 0.25]))
    eventually(lambda: control.said[-1][0] == "stream_target", "the command did not arrive")
    assert control.said[-1][1].point.tolist() == [-0.25, 0.0, 0.25]
    assert client.point_of(FixationPoint([1, 2, 3])).tolist() == [1.0, 2.0, 3.0]


def test_questions(client: GazeClient, control: ScriptedGaze):
    """Their arguments arrive, and their results."""
    assert client.motion_done()
    assert client.saccade_done()
    assert client.pose("left").vector.tolist() == POSE.vector.tolist()
    assert client.pose("head").time == POSE.time
    assert client.desired().tolist() == [*range(6)]
    assert client.joint_velocities()[4] == 0.5
    assert client.pixel_of("right", [-0.5, 0.0, 0.25]).tolist() == [160.0, 120.5]
    assert client.point_on_plane("left", (160, 120), (0, 0, 1, -0.5)).tolist() == [-0.5, 0.25, 0.25]
    assert client.angles_of([-0.5, 0.1, 0.4]).tolist() == [10.0, -5.0, 7.5]
    assert client.neck_range("roll") == (-40.0, 22.5)
    assert client.blocked_vergence() is None
    control.results["blocked_vergence"] = 7.5
    assert client.blocked_vergence() == 7.5
    assert client.status() == "running"
    client.suspend()
    client.resume()
    client.stop()
    client.bind_neck("yaw", -10.0, 10.0)
    client.clear_neck("pitch")
    client.bind_eyes(5.0)
    client.clear_eyes()
    assert [one for one in control.said if one[0] not in RESULTS] == [
        ("suspend",), ("resume",), ("stop",),
        ("bind_neck", "yaw", -10.0, 10.0), ("clear_neck", "pitch"), ("bind_eyes", 5.0), ("clear_eyes",),
    ]  # fmt: skip
    assert ("pose", "left") in control.said
    assert ("neck_range", "roll") in control.said
    [(_, eye, pixel, plane)] = [one for one in control.said if one[0] == "point_on_plane"]
    assert (eye, pixel.tolist(), plane.tolist()) == ("left", [160.0, 120.0], [0.0, 0.0, 1.0, -0.5])


def test_the_state_is_streamed(client: GazeClient, server: GazeServer, stepped: ManualClock):
    """Point, joints and angles come with the time of their stamp; old ones are not shown."""
    for name in ("fixation_point", "joints", "angles"):
        with pytest.raises(StaleStateError, match="no message has arrived"):
            getattr(client, name)()
    server.publish(stepped.now())
    for end, name in (("x", "fixation_point"), ("q", "joints"), ("angles", "angles")):
        eventually(lambda end=end: client._streams[end].latest is not None, "nothing arrived")
        found = getattr(client, name)()
        assert (found.values.tolist(), found.time) == (RESULTS[name].values.tolist(), 100.25)
    stepped.sleep(0.5)
    with pytest.raises(StaleStateError, match=r"more than the allowed 0\.1 s"):
        client.joints()


def test_events(spoken: Network, server: GazeServer, control: ScriptedGaze):
    """Every event arrives, in its order; the last one is that of a server that closes."""
    found: list[ControllerEvent] = []
    with closing(connected(spoken)) as client:
        client.observe_events(found.append)
        control.happen("saccade-onset", 100.5)
        control.happen("motion-ongoing", 100.75, 0.5)
        server.close()
        eventually(lambda: len(found) == 3, "an event did not arrive")
    assert found[:2] == [("saccade-onset", 100.5, None), ("motion-ongoing", 100.75, 0.5)]
    assert found[2].name == "closing"


def test_contexts_and_checkpoints_go_with_their_client(spoken: Network, server: GazeServer, control: ScriptedGaze):
    """A client that closes deletes its contexts, if it has any, and takes back its checkpoints."""
    assert server.name == NAME
    with closing(connected(spoken)) as client:
        assert client.store_context() == 1
        client.restore_context(1)
        client.add_checkpoint(0.25)
        assert client.checkpoints().tolist() == [0.5]
        control.said.clear()
    assert control.said == [("delete_contexts", (1,)), ("remove_checkpoint", 0.25)]
    control.said.clear()
    connected(spoken).close()
    assert control.said == [("info",)]


#: What a program asks, one after the other, and what it is answered.
CONVERSATION = (
    ('"get" "done"', "[ack] 1"),
    ("[get] [done]", "[ack] 1"),
    ("get doneness", "[ack] 1"),
    ("get Tneck", "[ack] 0.75"),
    ("set Teyes 0.5", "[ack]"),
    ("set Teyes word", "[nack]"),
    ("set track 1", "[ack]"),
    ("get track", "[ack] 1"),
    ("get pitch", "[ack] -40.0 22.5"),
    ("get eyes", "[ack] -1.0 -1.0"),
    ("bind yaw -10 10", "[ack]"),
    ("bind yaw -10", "[nack]"),
    ("bind neck -10 10", "[nack]"),
    ("clear eyes", "[ack]"),
    ("get pose left", "[ack] (-0.05 0.03 0.35 0.0 0.0 1.0 0.5) (0 100.25)"),
    ("get pose foot", "[nack]"),
    ("get 2D (left -0.5 0 0.25)", "[ack] (160.0 120.5)"),
    ("get 2D (left -0.5 0)", "[nack]"),
    ("get 3D mono (left 160 120 0.5)", "[ack] (-0.5 0.125 0.25)"),
    ("get 3D mono (left 160 120 1)", "[nack]"),
    ("get 3D mono (left 160 120 ver 5)", "[ack] (-0.5 0.125 0.25)"),
    ("get 3D proj (left 160 120 0 0 1 -0.5)", "[ack] (-0.5 0.25 0.25)"),
    ("get 3D proj ()", "[nack]"),
    ("get ang (-0.5 0.1 0.4)", "[ack] (10.0 -5.0 7.5)"),
    ("get pid", "[ack] ((Kp (0.001)) (Ki (0.001)))"),
    ("look 3D (-0.5 0 0.25)", "[ack]"),
    ("look 3D (-0.5 0)", "[nack]"),
    ("look 3D -0.5 0 0.25", "[nack]"),
    ("look mono (left 160 120 0.5)", "[ack]"),
    ("look mono (middle 160 120 0.5)", "[nack]"),
    ("look stereo (160 120 150 120)", "[ack]"),
    ("look ang (abs 10 0 5)", "[ack]"),
    ("look ang (over 10 0 5)", "[nack]"),
    ("look", "[nack]"),
    ("stor", "[ack] 1"),
    ("rest 1", "[ack]"),
    ("rest", "[nack]"),
    ("del (1 1)", "[ack]"),
    ("del ()", "[ack]"),
    ("del", "[nack]"),
    ("del 1", "[nack]"),
    ("register ongoing 0.5", "[ack]"),
    ("list ongoing", "[ack] (0.5)"),
    ("status", "[ack] running"),
    ("quit", "[nack]"),
    ("fly", '"command not recognized" "command not recognized"'),
)


def test_replies_are_those_of_the_original(peer: RpcClient):
    """Words and vocabs are the same, by four characters; what is wrong is refused."""
    for asked, reply in CONVERSATION:
        assert peer.call(Bottle.parse(asked), timeout=20) == Bottle.parse(reply), asked


def test_what_the_controller_refuses(client: GazeClient, control: ScriptedGaze):
    """It is refused to the client, too."""
    control.refused = {"look_at", "set_stabilization"}
    with pytest.raises(RefusedError):
        client.look_at(FixationPoint([-0.5, 0, 0.3]))
    with pytest.raises(RefusedError):
        client.set_stabilization(True)


def test_a_program_is_ended_by_a_request(network: Network, control: ScriptedGaze):
    """By four characters, as with the original."""
    ended: list[bool] = []
    with closing(GazeServer(control, NAME, network=network, quit_program=lambda: ended.append(True))) as server:
        assert server.answer(Bottle.parse("quit_")) == Bottle([Vocab("bye")])
    assert ended == [True]


def test_bytes_of_the_original():
    """A request and its reply that were seen on the wire have these bytes."""
    asked, reply = TABLE.request("motion_done"), Bottle([ACK, *TABLE.by_key["motion_done"].gives.write(True)])
    assert encode(asked, Dialect.YARP3).hex() == "04010000020000000300000067657404000000646f6e65"
    assert encode(reply, Dialect.YARP3).hex() == "00010000020000000900000061636b000100000001000000"


def test_invalid_streamed_commands_are_reported(client: GazeClient, control: ScriptedGaze, said: list[str]):
    """A command that is none is ignored; the next one counts."""
    for end, text in (("xd", "1 2"), ("mono", "left 160 120 1"), ("angles", "abs 1 2"), ("stereo", "1 2 3 x")):
        client.stream(end, Bottle.parse(text))
        wanted = f"{NAME}/{end}:i: a command is ignored"
        eventually(lambda wanted=wanted: any(wanted in one for one in said), "the command is not reported")
    assert control.said == []


@pytest.mark.parametrize(
    "target",
    [
        FixationPoint([1.0, 2.0]),
        FixationPoint([math.nan] * 3),
        GazeAngles(0.0, math.inf, 1.0),
        MonoPixel("left", math.nan, 1.0),
        StereoPixels((1.0, 2.0), (math.nan, 1.0)),
    ],
)
def test_the_client_refuses_what_is_no_target(client: GazeClient, control: ScriptedGaze, target):
    """Wrong counts, and numbers that are none, are not sent."""
    for method in (client.look_at, client.stream_target, client.point_of):
        with pytest.raises(RefusedError):
            method(target)
    assert control.said == []


def test_servers_that_are_no_use(spoken: Network, server: GazeServer, control: ScriptedGaze):
    """A server of another version is refused; nothing stays open."""
    assert server.name == NAME
    control.results["info"] = Bottle.parse('((server_version "1.0"))')[0]
    with pytest.raises(NotSupportedError, match=r"has version '1.0' of gaze control"):
        connected(spoken)


def test_no_server(network: Network):
    """The error names the port."""
    with pytest.raises(DeviceError, match=f"{NAME}/rpc"):
        connected(network)


def test_the_table_has_every_method():
    """Each method of the interface has a request, but those of streamed commands, streams and observers."""
    others = {"stream_target", "observe_events", "unobserve_events", "fixation_point", "angles", "joints"}
    assert {one.method for one in TABLE.requests} | others == IGazeControl.__abstractmethods__
    assert len(TABLE.by_words) == len(TABLE.requests) == len(TABLE.by_key)


NUMBERS = st.floats(-1e3, 1e3)
PIXELS = st.tuples(NUMBERS, NUMBERS)
EYES = st.sampled_from(["left", "right"])


@given(
    st.one_of(
        st.builds(GazeAngles, NUMBERS, NUMBERS, NUMBERS, st.booleans()),
        st.builds(MonoPixel, EYES, NUMBERS, NUMBERS, NUMBERS),
        st.builds(MonoPixelWithVergence, EYES, NUMBERS, NUMBERS, NUMBERS),
        st.builds(StereoPixels, PIXELS, PIXELS),
    )
)
def test_a_target_is_what_its_elements_say(target):
    """Encoding and decoding are inverse."""
    end = {GazeAngles: "angles", StereoPixels: "stereo"}.get(type(target), "mono")
    assert TARGETS[end](target_elements(target)) == target


VALUES = st.recursive(
    st.one_of(st.integers(-5, 5), st.floats(), st.sampled_from(["left", "abs", "ver"]), st.sampled_from([ACK])),
    lambda inner: st.lists(inner, max_size=8).map(Bottle),
    max_leaves=12,
)


@given(st.sampled_from([*TABLE.by_words]), st.lists(VALUES, max_size=4))
def test_any_arguments_are_answered(words, values):
    """Whatever follows the words, the answer is a reply or a refusal, and the controller gets what it expects."""
    server = GazeServer.__new__(GazeServer)
    server.name, server.task = NAME, ScriptedGaze()
    try:
        reply = server.answer(Bottle([*words, *values]))
    except RefusedError:
        return
    assert reply[0] == ACK


def test_shapes_of_results():
    """A controller that answers with a wrong number of values is not sent to a client."""
    with pytest.raises(RefusedError, match="6 finite numbers are needed"):
        TABLE.by_key["desired"].gives.write(np.zeros(5))
