"""Services: requests and responses between processes, in the form that rmw_cyclonedds sends."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

from rtf.ros2.errors import NoServiceError, Ros2Error
from rtf.ros2.graph import Graph
from rtf.ros2.messages import String
from rtf.ros2.node import default_qos
from rtf.ros2.service_types import (
    GET_PARAMETERS,
    LIST_CONTROLLERS,
    TRIGGER,
    ControllerState,
    GetParametersRequest,
    GetParametersResponse,
    ListControllersRequest,
    ListControllersResponse,
    ParameterValue,
    TriggerRequest,
    TriggerResponse,
)
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.ros2.node import Node

#: A node with parameters, which ends when it is asked to.
SERVER = """
import sys, threading
from rtf.ros2.node import Node
from rtf.ros2.service_types import *
end = threading.Event()
values = {"robot_description": "<robot/>", "joints": ["elbow", "knee"]}
def parameters(request):
    found = [ParameterValue.of(values[name]) if name in values else ParameterValue() for name in request.names]
    return GetParametersResponse(values=found)
def stop(request):
    end.set()
    return TriggerResponse(success=True, message="bye")
with Node("state_publisher", domain=int(sys.argv[1])) as node:
    node.serve("/state_publisher/get_parameters", GET_PARAMETERS, parameters)
    node.serve("stop", TRIGGER, stop)
    print("ready", flush=True)
    end.wait(60)
    node.client("last", TRIGGER)  # so that the response is sent before the end
"""


def test_another_process_answers(node: Callable[..., Node], domain: int):
    """Parameters of a node by name; one that is unknown has no value."""
    here = node("here")
    with subprocess.Popen([sys.executable, "-c", SERVER, str(domain)], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"ready\n"
        client = here.client("/state_publisher/get_parameters", GET_PARAMETERS)
        got = client.call(GetParametersRequest(names=["joints", "nothing", "robot_description"]), 20.0)
        assert [one.value for one in got.values] == [["elbow", "knee"], None, "<robot/>"]
        said = here.client("/stop", TRIGGER).call(TriggerRequest(), 20.0)
        assert (said.success, said.message) == (True, "bye")
        assert other.wait(20) == 0


def test_each_client_gets_its_own_responses(node: Callable[..., Node]):
    """Several clients call at the same time, several times."""
    server = node("server")
    server.serve(
        "echo", GET_PARAMETERS, lambda call: GetParametersResponse(values=[*map(ParameterValue.of, call.names)])
    )
    clients = [node(f"client{number}").client("/echo", GET_PARAMETERS) for number in range(3)]

    def ask(number: int) -> object:
        text = f"call {number}"
        return clients[number % 3].call(GetParametersRequest(names=[text]), 20.0).values[0].value == text

    with ThreadPoolExecutor(6) as pool:
        assert all(pool.map(ask, range(30)))


def test_no_service_and_no_answer_are_reported(node: Callable[..., Node]):
    """Each in its time; an answer that fails is reported by its node, which goes on."""
    said: list[str] = []
    server = node("server", report=said.append)
    client = node("client").client("/nowhere", TRIGGER)
    with pytest.raises(NoServiceError, match="there is no service /nowhere"):
        client.call(TriggerRequest(), 0.05)
    answers = iter([None, TriggerResponse(success=True)])
    server.serve("doubtful", TRIGGER, lambda _: next(answers))  # type: ignore[arg-type, return-value]  # once nothing
    doubtful = node("client2").client("/doubtful", TRIGGER)
    with pytest.raises(NoServiceError, match=r"the service /doubtful did not answer in 1 s"):
        doubtful.call(TriggerRequest(), 1.0)
    assert doubtful.call(TriggerRequest(), 20.0).success
    assert len(said) == 1
    assert said[0].startswith("the service /doubtful could not answer: AttributeError")


def test_a_call_ends_with_its_node(node: Callable[..., Node]):
    """Another thread closes it."""
    one = node("one")
    client = one.client("/nowhere", TRIGGER)
    threading.Timer(0.05, one.close).start()
    with pytest.raises(Ros2Error, match="the node of the client of /nowhere was closed"):
        client.call(TriggerRequest(), 20.0)


def test_a_node_is_closed_when_its_calls_have_ended(node: Callable[..., Node], monkeypatch: pytest.MonkeyPatch):
    """A call that is looking at the service at that moment ends like any other, with an error of the library."""
    one = node("one")
    client = one.client("/nowhere", TRIGGER)
    closing, look = threading.Thread(target=one.close), client._is_there

    def closed_meanwhile() -> bool:
        if not closing.ident:
            closing.start()
            closing.join(0.3)  # unless it waits for the call
        return look()

    monkeypatch.setattr(client, "_is_there", closed_meanwhile)
    with pytest.raises(Ros2Error, match="the node of the client of /nowhere was closed"):
        client.call(TriggerRequest(), 20.0)
    closing.join()


def test_bytes_and_names_are_those_of_rmw_cyclonedds(node: Callable[..., Node], domain: int):
    """Number of the client, number of the call, then the fields; an empty message has a byte."""
    assert TriggerRequest(client=3, sequence=2).serialize().hex() == "000100000300000000000000020000000000000000"
    got = TriggerResponse(client=1, sequence=2, success=True, message="a").serialize()
    assert got.hex() == "000100000100000000000000020000000000000001000000020000006100"
    assert TRIGGER.name == "std_srvs/srv/Trigger"
    assert TriggerRequest.__idl_typename__ == "std_srvs.srv.dds_.Trigger_Request_"
    server = node("server", "/lab")
    server.serve("x", LIST_CONTROLLERS, lambda _: ListControllersResponse())
    names = {entity.topic.name for entity in (*server._readers, *server._writers)}  # type: ignore[attr-defined]
    assert names == {"rq/lab/xRequest", "rr/lab/xReply"}


def test_controllers_are_listed(node: Callable[..., Node]):
    """As the controller manager of Jazzy lists them."""
    state = ControllerState("arm", "active", "forward_command_controller/ForwardCommandController", ["elbow/position"])
    node("manager").serve(
        "controller_manager/list_controllers", LIST_CONTROLLERS, lambda _: ListControllersResponse(controller=[state])
    )
    client = node("client").client("/controller_manager/list_controllers", LIST_CONTROLLERS)
    assert client.call(ListControllersRequest(), 20.0).controller == [state]


def test_a_message_that_cannot_be_read_is_reported(node: Callable[..., Node], domain: int):
    """Others that follow arrive."""
    said: list[str] = []
    got: list[str] = []
    listener = node("listener", report=said.append)
    listener.subscribe("/chatter", String, lambda message: got.append(message.data))
    participant = DomainParticipant(domain)
    writer = DataWriter(participant, Topic(participant, "rt/chatter", String), qos=default_qos())

    class Broken(String):
        def serialize(self, *_: object, **__: object) -> bytes:
            return bytes.fromhex("0001000002000000ff00")

    def reported() -> bool:
        writer.write(Broken())
        writer.write(String("next"))
        return bool(said and got)

    eventually(reported, "nothing was reported")
    assert said[0].startswith("rt/chatter: String of 12 bytes cannot be read: 'utf-8' codec")
    assert set(got) == {"next"}


def test_the_graph_of_a_domain(node: Callable[..., Node], domain: int):
    """Nodes and topics of others, until these are closed."""
    graph = Graph(domain, report=print)
    one = node("talker", "/lab")
    one.publisher("chatter", String)
    one.serve("stop", TRIGGER, lambda _: TriggerResponse())
    node("reader").subscribe("/lab/chatter", String, print)
    eventually(lambda: {"/lab/talker", "/reader"} <= {*graph.nodes()}, "the nodes are not in the graph")
    eventually(
        lambda: "/lab/chatter" in (found := graph.topics()) and found["/lab/chatter"].subscriptions == 1, "no topic"
    )
    found = graph.topics()["/lab/chatter"]
    assert (found.publishers, found.types) == (1, {"std_msgs/msg/String"})
    assert not any("stop" in name for name in graph.topics())
    one.close()
    eventually(lambda: "/lab/talker" not in graph.nodes(), "the node is still in the graph")
    eventually(lambda: graph.topics()["/lab/chatter"].publishers == 0, "the topic is still published")
    graph.close()
