"""Nodes at a real master: topics and services between them, names, parameters, and what the master shows."""

from __future__ import annotations

import threading
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
import pytest

from rtf.ros1 import subscribing
from rtf.ros1.errors import MasterError, MessageError, NoServiceError, PeerError, Ros1Error, ServiceFailedError
from rtf.ros1.node import Node
from rtf.ros1.registration import Registration
from rtf.ros1.types import message_type, service_type
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from ros1.conftest import Ros

IMAGE, STATE, STRING = (
    message_type(name) for name in ("sensor_msgs/Image", "sensor_msgs/JointState", "std_msgs/String")
)
TRIGGER, SET = service_type("std_srvs/Trigger"), service_type("std_srvs/SetBool")


def test_messages_reach_all_subscribers(node: Callable[..., Node]):
    """Of other nodes and of the same; all callbacks of a node get them."""
    talker, listener = node("talker", "/lab"), node("listener")
    got: list[list[str]] = [[], [], []]
    listener.subscribe("/lab/chatter", STRING, lambda message: got[0].append(message.data))
    listener.subscribe("/lab/chatter", STRING, lambda message: got[1].append(message.data))
    talker.subscribe("chatter", STRING, lambda message: got[2].append(message.data))
    chatter = talker.publisher("chatter", STRING)
    eventually(lambda: chatter.subscribers == 2, "they are not connected")
    for number in range(20):
        chatter.publish(STRING(f"hello {number}"))
    eventually(lambda: all(len(one) == 20 for one in got), "messages are missing")
    assert got[0] == got[1] == got[2] == [f"hello {number}" for number in range(20)]


def test_a_latched_topic_has_its_last_message(node: Callable[..., Node]):
    """For subscribers that come later; one that takes any type uses the publisher's definition."""
    latched = node("talker").publisher("state", STATE, latched=True)
    latched.publish(STATE(name=["old"]))
    latched.publish(STATE(name=["elbow"], position=[0.5]))
    got: list[Any] = []
    node("listener").subscribe("state", None, got.append)
    eventually(lambda: got, "nothing came")
    assert (got[0].name, got[0].position.tolist()) == (["elbow"], [0.5])


def test_large_messages_arrive_whole(node: Callable[..., Node]):
    """Pictures that no socket takes at once; a subscriber that is slow misses the oldest."""
    talker, listener = node("talker"), node("listener")
    got: list[Any] = []
    go_on = threading.Event()

    def look(image: Any) -> None:
        got.append(image)
        go_on.wait(20)

    listener.subscribe("image", IMAGE, look)
    images = talker.publisher("image", IMAGE, depth=2)
    eventually(lambda: images.subscribers, "it is not connected")
    pixels = np.arange(6_000_000, dtype=np.uint32).view(np.uint8)[:6_000_000]
    for number in range(12):
        images.publish(IMAGE(height=number, data=pixels))
    go_on.set()
    eventually(lambda: got and got[-1].height == 11, "the last one is missing")
    assert len(got) < 12
    assert all(np.array_equal(one.data, pixels) for one in got)


def test_a_message_that_is_none_is_refused(node: Callable[..., Node]):
    """Where it is published."""
    chatter = node("talker").publisher("chatter", STRING)
    with pytest.raises(MessageError, match="is no std_msgs/String"):
        chatter.publish(STRING(data=3))


def test_services_answer(node: Callable[..., Node], said: list[str]):
    """One connection for many calls; what a service raises is reported to both."""
    server, caller = node("server", "/lab"), node("caller")

    def switch(request: Any) -> Any:
        if not request.data:
            raise ValueError("it is off already")
        return SET.response(success=True, message="on")

    server.serve("switch", SET, switch)
    client = caller.client("/lab/switch", SET)
    assert [client.call(SET.request(data=True)).message for _ in range(3)] == ["on"] * 3
    with pytest.raises(ServiceFailedError, match="/lab/switch failed: ValueError: it is off already"):
        client.call(SET.request(data=False))
    assert said == ["the service /lab/switch could not answer: ValueError: it is off already"]
    assert client.call(SET.request(data=True)).success


def test_a_service_that_is_not_there_or_slow(node: Callable[..., Node]):
    """Its name is in the error; one that comes back is found again."""
    caller = node("caller")
    client = caller.client("/lab/beep", TRIGGER)
    with pytest.raises(NoServiceError, match="no service /lab/beep; is its node running"):
        client.call()
    slow = threading.Event()
    first = node("server", "/lab")
    first.serve("beep", TRIGGER, lambda _: slow.wait(20) and TRIGGER.response())
    with pytest.raises(NoServiceError, match=r"/lab/beep (did not answer in 0\.1 s|at .* cannot be reached)"):
        client.call(timeout=0.1)
    slow.set()
    assert client.call() == TRIGGER.response()
    first.close()
    with pytest.raises(NoServiceError, match="no service /lab/beep"):
        client.call()
    node("server", "/lab").serve("beep", TRIGGER, lambda _: TRIGGER.response(message="again"))
    assert client.call().message == "again"
    with pytest.raises(Ros1Error, match="has the service /lab/beep already"):
        first_again(node)
    with pytest.raises(PeerError, match="/caller calls /lab/beep with md5sum"):
        caller.client("/lab/beep", SET).call()


def first_again(node: Callable[..., Node]) -> None:
    """A node with the same service twice."""
    twice = node("twice", "/lab")
    for _ in range(2):
        twice.serve("beep", TRIGGER, lambda _: TRIGGER.response())


def test_parameters_are_read(ros: Ros, node: Callable[..., Node]):
    """Such as the description of a robot."""
    one = node("one", "/lab")
    one.master.set_parameter("/robot_description", "<robot name='r2'/>")
    one.master.set_parameter("/lab/gains", {"p": 1.5, "list": [1, True]})
    assert one.parameter("/robot_description") == "<robot name='r2'/>"
    assert one.parameter("gains") == {"p": 1.5, "list": [1, True]}
    assert one.parameter("nothing", 7) == 7
    with pytest.raises(MasterError, match=r"refused getParam: Parameter \[/nothing\] is not set"):
        one.master.parameter("/nothing")


def test_a_closed_node_is_gone(node: Callable[..., Node]):
    """From the master, and from its peers; its names are free again."""
    talker, listener = node("talker"), node("listener")
    received = listener.subscribe("chatter", STRING, lambda _: None)
    talker.publisher("chatter", STRING)
    talker.serve("beep", TRIGGER, lambda _: TRIGGER.response())
    eventually(lambda: received.publishers == 1, "it is not connected")
    published, subscribed, served = listener.master.call("getSystemState")
    assert ["/chatter", ["/talker"]] in published
    assert ["/chatter", ["/listener"]] in subscribed
    assert ["/beep", ["/talker"]] in served
    talker.close()
    published, _, served = listener.master.call("getSystemState")
    assert not [one for one in (*published, *served) if "/talker" in one[1]]
    eventually(lambda: received.publishers == 0, "it is still connected")
    talker.close()
    with pytest.raises(Ros1Error, match="the node /talker is closed"):
        talker.publisher("chatter", STRING)


def test_a_node_that_is_closed_meanwhile_is_not_registered(node: Callable[..., Node], monkeypatch: pytest.MonkeyPatch):
    """The master would have it for ever."""
    talker, add = node("talker"), Registration.add

    def closed_before(registration: Registration, what: str, name: str, kind: str) -> list[str]:
        talker.close()
        return add(registration, what, name, kind)

    monkeypatch.setattr(Registration, "add", closed_before)
    with pytest.raises(MasterError, match="the node /talker is closed"):
        talker.publisher("chatter", STRING)
    published, _, _ = talker.master.call("getSystemState")
    assert not [one for one in published if "/talker" in one[1]]


def test_the_last_word_of_the_master_counts(monkeypatch: pytest.MonkeyPatch):
    """A list of publishers that comes while connections are ended for the one before is not undone by that."""
    one, two, gone = (f"http://127.0.0.1:{port}/" for port in (9, 10, 11))

    class Source(subscribing._Source):
        def close(self) -> None:
            if self._uri == gone:
                subscription.update([one])
            super().close()

    monkeypatch.setattr(subscribing, "_Source", Source)
    subscription = subscribing.Subscription("/chatter", STRING, "/listener", str, 1000)
    with closing(subscription):
        subscription.update([gone])
        subscription.update([one, two])
        assert [*subscription._sources] == [one]


def test_a_second_node_of_a_name_ends_the_first(node: Callable[..., Node], said: list[str]):
    """The master says so."""
    first = node("same")
    first.publisher("one", STRING)
    node("same").publisher("two", STRING)
    eventually(lambda: any("/same ends, as its master says" in one for one in said), f"it was not reported: {said}")
    eventually(lambda: first._contents.closed, "it is still open")


def test_nothing_is_open_off_the_machine(node: Callable[..., Node]):
    """All sockets are those of loopback."""
    node("local").publisher("chatter", STRING)
    opened = [one.laddr.ip for one in psutil.Process().net_connections("tcp") if one.status == "LISTEN"]
    assert opened
    assert set(opened) == {"127.0.0.1"}


def test_a_topic_has_one_type(node: Callable[..., Node]):
    """In a node."""
    one = node("one")
    one.publisher("chatter", STRING)
    with pytest.raises(Ros1Error, match="publishes /chatter with std_msgs/String already, not with sensor_msgs/Image"):
        one.publisher("chatter", IMAGE)
    one.subscribe("chatter", STRING, lambda _: None)
    with pytest.raises(Ros1Error, match="subscribes to /chatter with another type"):
        one.subscribe("chatter", IMAGE, lambda _: None)


def test_a_missing_master_is_reported(monkeypatch: pytest.MonkeyPatch):
    """With its address, as everywhere else it could be wrong."""
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    with pytest.raises(MasterError, match=r"http://127\.0\.0\.1:9 does not answer getPid"):
        Node("one")
    with pytest.raises(MasterError, match="'nowhere' is no address"):
        Node("one", master="nowhere")


def test_the_host_has_to_be_ours(ros: Ros):
    """An address of another machine is refused."""
    with pytest.raises(Ros1Error, match=r"192\.0\.2\.1 is no address of this machine"):
        Node("one", master=ros.uri, host="192.0.2.1")
